"""The import contract of the three packages, read from their sources: what may know what."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("pbd", "comparisons", "reports")
SOURCES = sorted(path.relative_to(ROOT).as_posix() for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
HARNESS = [name for name in SOURCES if not name.startswith("pbd/")]

MAX_LINES = 300
VALIDATION = {"pbd.errors", "pbd.fields"}
"""All of the solver that the harness may know, apart from the solver's own adapter."""

OWN_ADAPTERS = {
    f"comparisons/engines/{name}.py"
    for name in ("pbd", "pbf", "rattle", "shake", "_pbd_scene", "particle_boxes", "_particle_boxes_motion")
}
"""Adapters of the solver itself, and what they share."""

SHARED_WITH_SYMPLECTIC_EULER = {"pbd.jit", "pbd.vector", "pbd.collision", "pbd.routine", "pbd.intrinsics"} | {
    f"pbd.fluid.{name}" for name in ("cells", "candidates", "lanes", "sums", "kernels", "walls", "wall_input")
}
"""So that methods are compared, and not compilers, ray casts, neighbour searches or the walls of a fluid."""

UNSAFE_MODULES = {"pickle", "marshal", "shelve", "dill", "joblib", "yaml", "cloudpickle"}
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}


@cache
def tree(name: str) -> ast.Module:
    return ast.parse((ROOT / name).read_text(encoding="utf-8"))


@cache
def imports(name: str) -> frozenset[str]:
    """Dotted names of all that a file imports, in functions too; a relative import would hide here, so none may be."""
    found = set()
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}:{node.lineno}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(module_of(dotted) for dotted in found)


def module_of(dotted: str) -> str:
    """The module part of a dotted name of ours: ``pbd.errors.unknown`` is from ``pbd.errors``."""
    parts = dotted.split(".")
    if parts[0] not in PACKAGES:
        return dotted
    while len(parts) > 1 and not is_module(parts):
        parts.pop()
    return ".".join(parts)


def is_module(parts: list[str]) -> bool:
    path = ROOT.joinpath(*parts)
    return path.is_dir() or path.with_suffix(".py").is_file()


def inside(module: str, packages: set[str]) -> bool:
    return any(module == package or module.startswith(package + ".") for package in packages)


def within(folder: str) -> list[str]:
    found = [name for name in SOURCES if name.startswith(folder + "/")]
    assert found, f"no sources in {folder}"
    return found


def test_the_reader_sees_every_form_of_import():
    assert "numpy" in imports("pbd/vector.py")
    assert "pbd.stiffness" in imports("comparisons/engines/pbd.py"), "an import inside a function"
    assert "pbd.fields" in imports("comparisons/run.py"), "from a package import a module"
    assert "reports.figures" in imports("comparisons/study.py")


@pytest.mark.parametrize("name", within("pbd"))
def test_solver_needs_numpy_and_numba_only(name):
    allowed = {"numpy", "numba", "llvmlite", "pbd"}
    roots = {module.partition(".")[0] for module in imports(name)}
    assert roots - sys.stdlib_module_names - allowed == set()


@pytest.mark.parametrize("name", [name for name in HARNESS if name not in OWN_ADAPTERS])
def test_only_its_adapter_knows_the_solver(name):
    allowed = set(VALIDATION)
    if Path(name).parent.name == "engines" and "symplectic_euler" in name:
        allowed |= SHARED_WITH_SYMPLECTIC_EULER
    known = {module for module in imports(name) if module.partition(".")[0] == "pbd"}
    assert {module for module in known if not inside(module, allowed)} == set()


@pytest.mark.parametrize("name", within("comparisons/scenes"))
def test_scenes_know_no_engine(name):
    forbidden = {"comparisons." + part for part in ("engine", "engines", "run", "isolation", "gather", "studies")}
    assert [module for module in imports(name) if inside(module, forbidden)] == []


@pytest.mark.parametrize("name", within("comparisons/metrics"))
def test_metrics_know_neither_engines_nor_scenes(name):
    forbidden = {"comparisons." + part for part in ("engine", "engines", "scenes", "run", "isolation", "gather")}
    assert [module for module in imports(name) if inside(module, forbidden)] == []


@pytest.mark.parametrize("name", within("comparisons/engines"))
def test_engines_know_no_scene_metric_or_study(name):
    forbidden = {"comparisons." + part for part in ("scenes", "metrics", "studies", "run", "gather", "store")}
    assert [module for module in imports(name) if inside(module, forbidden)] == []


@pytest.mark.parametrize("name", within("comparisons/engines"))
def test_adapters_name_no_scene(name):
    scenes = {path.stem for path in (ROOT / "comparisons/scenes").glob("[!_]*.py")}
    assert "pendulum_chain" in scenes
    constants = {node.value for node in ast.walk(tree(name)) if isinstance(node, ast.Constant)}
    assert constants & scenes == set()


@pytest.mark.parametrize("name", within("comparisons"))
def test_reports_are_loaded_by_cli_and_plot_only_and_late(name):
    if name not in ("comparisons/cli.py", "comparisons/study.py"):
        assert not any(inside(module, {"reports"}) for module in imports(name))
    at_import = [node for node in tree(name).body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not any("reports" in ast.unparse(node) for node in at_import)


@pytest.mark.parametrize("name", within("reports"))
def test_reports_run_nothing(name):
    forbidden = {"comparisons." + part for part in ("run", "gather", "engine", "engines", "isolation", "studies")}
    assert [module for module in imports(name) if inside(module, forbidden)] == []


@pytest.mark.parametrize("name", SOURCES)
def test_nothing_is_unpickled_or_evaluated(name):
    # compiled kernels are pickles with a digest, written and read by pbd/jit.py alone
    allowed = {"pickle"} if name == "pbd/jit.py" else set()
    assert {module.partition(".")[0] for module in imports(name)} & UNSAFE_MODULES <= allowed
    calls = [node for node in ast.walk(tree(name)) if isinstance(node, ast.Call)]
    assert not [call.lineno for call in calls if isinstance(call.func, ast.Name) and call.func.id in UNSAFE_CALLS]
    for call in calls:
        for keyword in call.keywords:
            if keyword.arg == "allow_pickle":
                assert isinstance(keyword.value, ast.Constant)
                assert keyword.value.value is False


@pytest.mark.parametrize("name", SOURCES)
def test_files_stay_short(name):
    lines = (ROOT / name).read_text(encoding="utf-8").count("\n")
    assert lines <= MAX_LINES, f"{name} has {lines} lines: split it"


def test_every_package_is_installed():
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = {Path(name).parent.as_posix().replace("/", ".") for name in SOURCES}
    assert found <= set(listed)


def loaded_after(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.split())


FOREIGN = {"pymunk", "pybullet", "mujoco", "pypbd"}
HEAVY = FOREIGN | {"numpy", "numba", "llvmlite", "scipy", "msgspec", "matplotlib", "rich", "jinja2"}


def test_command_line_answers_before_anything_heavy_is_loaded():
    assert loaded_after("import comparisons.cli; comparisons.cli._parser()") & HEAVY == set()


def test_importing_the_solver_costs_nothing():
    assert loaded_after("import pbd; pbd.InvalidInput") & (HEAVY | {"comparisons"}) == set()


def test_kernels_load_when_used():
    assert "numba" in loaded_after("import pbd; pbd.simulate"), "or else the test above shows nothing"
