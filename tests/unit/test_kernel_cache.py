"""The kernel cache: never stale, never in the way. Numba's own fails each of the five faults below."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

from pbd.jit import kernel

pytestmark = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="there is no kernel to cache")

COMPILING = "pbd: compiling"


def python(directory, *arguments, cache=None, **variables):
    """A new interpreter that imports from ``directory``: (what it printed, whether it compiled)."""
    cache = directory / "cache" if cache is None else cache
    environment = {
        **os.environ,
        "PBD_CACHE_DIR": str(cache),
        "PYTHONPATH": os.pathsep.join([str(directory), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep),
        "PYTHONDONTWRITEBYTECODE": "1",
        **variables,
    }
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, timeout=120, cwd=directory
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), COMPILING in done.stderr


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(dedent(text))


# ------------------------------------------------------------------ sources: a small package of a user's


@pytest.fixture
def package(tmp_path):
    """A kernel whose helper, and whose helper's helper, live in other files, and a user's class."""
    write(tmp_path / "user" / "__init__.py", "")
    write(tmp_path / "user" / "constants.py", "GAIN = 2.0\n")
    write(
        tmp_path / "user" / "deep.py",
        """
        from pbd.jit import device
        from user.constants import GAIN

        @device
        def deep(x):
            return GAIN * x
        """,
    )
    write(
        tmp_path / "user" / "helper.py",
        """
        from pbd.jit import device
        from user import deep as d

        @device
        def helper(x):
            return d.deep(x) + 1.0
        """,
    )
    write(
        tmp_path / "user" / "work.py",
        """
        from pbd.jit import kernel
        from pbd.stages import size
        from user.helper import helper

        @kernel
        def work(x):
            return helper(x)

        @kernel
        def count(batch):
            return size(batch)
        """,
    )
    write(
        tmp_path / "thing.py",
        """
        from typing import NamedTuple

        class Thing(NamedTuple):
            n: int

            def size(self):
                return self.n + 100
        """,
    )
    return tmp_path


WORK = ("-c", "from user.work import work; print(work(3.0))")
COUNT = ("-c", "from user.work import count; from thing import Thing; print(count(Thing(5)))")


def test_a_new_process_finds_the_kernel(package):
    assert python(package, *WORK) == ("7.0", True)
    assert python(package, *WORK) == ("7.0", False)
    assert [path.suffix for path in (package / "cache").iterdir()] == [".bin"]  # nothing half-written left


def test_an_edited_helper_is_compiled_again(package):
    """Fault 1: the kernel's own file is unchanged; what it calls, or the constant it holds, is not."""
    assert python(package, *WORK) == ("7.0", True)
    for file, old, new, result in [
        ("user/helper.py", "+ 1.0", "+ 10.0", "16.0"),
        ("user/deep.py", "GAIN * x", "GAIN * x * x", "28.0"),
        ("user/constants.py", "2.0", "3.0", "37.0"),
        ("user/constants.py", "3.0", "float(__import__('os').environ['GAIN'])", "46.0"),
    ]:
        path = package / file
        path.write_text(path.read_text().replace(old, new))
        assert python(package, *WORK, GAIN="4.0") == (result, True), file
    # the file is the same, the constant it computes is not
    assert python(package, *WORK, GAIN="5.0") == ("55.0", True)


def test_an_edited_user_class_is_compiled_again(package):
    """Fault 2: the class reaches the kernel by its argument types alone."""
    assert python(package, *COUNT) == ("105", True)
    path = package / "thing.py"
    path.write_text(path.read_text().replace("100", "200"))
    assert python(package, *COUNT) == ("205", True)
    path.write_text(path.read_text().replace("200", "100"))
    assert python(package, *COUNT) == ("105", False)  # the first build is still there, and right


def test_a_vanished_user_module_harms_no_other_load(package):
    """Fault 3: what was cached for a class that is gone is not even read."""
    assert python(package, *COUNT) == ("105", True)
    write(package / "other.py", (package / "thing.py").read_text().replace("Thing", "Other").replace("100", "300"))
    other = ("-c", "from user.work import count; from other import Other; print(count(Other(5)))")
    assert python(package, *other) == ("305", True)
    (package / "thing.py").unlink()
    assert python(package, *other) == ("305", False)


def test_classes_without_a_file_are_never_served_stale(package):
    """As in a notebook or ``python -c``: no source to compare, so nothing is cached."""
    program = dedent(
        """
        from typing import NamedTuple
        from user.work import count

        class Cell(NamedTuple):
            n: int

            def size(self):
                return self.n + {}

        print(count(Cell(5)))
        """
    )
    assert python(package, "-c", program.format(1)) == ("6", True)
    assert python(package, "-c", program.format(2)) == ("7", True)


def test_classes_of_unregistered_modules_are_never_served_stale(package):
    """Loaded by path, not entered in sys.modules."""
    program = (
        "-c",
        dedent(
            """
            import importlib.util
            from user.work import count

            spec = importlib.util.spec_from_file_location("loose", "thing.py")
            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
            print(count(module.Thing(5)))
            """
        ),
    )
    assert python(package, *program)[0] == "105"
    path = package / "thing.py"
    path.write_text(path.read_text().replace("100", "200"))
    assert python(package, *program) == ("205", True)


def test_classes_of_installed_packages_are_compiled_again_after_an_upgrade(package):
    """site-packages is not followed through imports, but a class's own file is always looked at."""
    program = ("-c", f"import pbd.jit; pbd.jit._SITE += ({str(package)!r},); " + COUNT[1])
    assert python(package, *program) == ("105", True)
    assert python(package, *program) == ("105", False)
    path = package / "thing.py"
    path.write_text(path.read_text().replace("100", "200"))
    assert python(package, *program) == ("205", True)


def test_scripts_are_cached_by_their_content(package):
    """A class in ``__main__`` with a file is followed by that file."""
    script = "from typing import NamedTuple\nfrom user.work import count\n" + dedent(
        """
        class Own(NamedTuple):
            n: int

            def size(self):
                return self.n + 1

        if __name__ == "__main__":
            print(count(Own(5)))
        """
    )
    (package / "script.py").write_text(script)
    assert python(package, "script.py") == ("6", True)
    (package / "script.py").write_text(script.replace("+ 1", "+ 2"))
    assert python(package, "script.py") == ("7", True)


def test_without_a_writable_directory_it_runs_uncached(package):
    """A path below a plain file can be no directory, for any user."""
    (package / "plain").write_text("")
    for _ in range(2):
        assert python(package, *WORK, cache=package / "plain" / "cache") == ("7.0", True)
    assert (package / "plain").read_text() == ""


# ------------------------------------------------------------------ files


def square(x):
    return x * x


@pytest.fixture
def fresh(tmp_path, monkeypatch, capfd):
    """Run a newly decorated kernel on the temporary cache: (its result, whether it compiled)."""
    monkeypatch.setenv("PBD_CACHE_DIR", str(tmp_path))

    def run():
        result = kernel(square)(3.0)
        return result, COMPILING in capfd.readouterr().err

    return run


def only_file(directory) -> Path:
    (path,) = directory.iterdir()
    return path


@pytest.mark.parametrize("where", [0.0, 0.01, 0.3, 0.9, 1.0])
def test_a_flipped_bit_is_detected(fresh, tmp_path, where):
    """Fault 4, in the digest or anywhere in the payload; and the file is healed."""
    assert fresh() == (9.0, True)
    assert fresh() == (9.0, False)
    path = only_file(tmp_path)
    whole = path.read_bytes()
    damaged = bytearray(whole)
    damaged[round(where * (len(whole) - 1))] ^= 0x10
    path.write_bytes(damaged)
    assert fresh() == (9.0, True)
    assert only_file(tmp_path).read_bytes() != bytes(damaged)
    assert fresh() == (9.0, False)


@pytest.mark.parametrize("keep", [0.0, 0.001, 0.5, 0.999])
def test_a_truncated_file_is_detected(fresh, tmp_path, keep):
    """Fault 5, down to the empty file."""
    assert fresh() == (9.0, True)
    path = only_file(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    assert fresh() == (9.0, True)
    assert fresh() == (9.0, False)


def test_a_foreign_file_of_that_name_is_detected(fresh, tmp_path):
    assert fresh() == (9.0, True)
    only_file(tmp_path).write_bytes(b"not a kernel " * 1000)
    assert fresh() == (9.0, True)


def test_a_directory_in_the_way_costs_time_only(fresh, tmp_path):
    assert fresh() == (9.0, True)
    path = only_file(tmp_path)
    path.unlink()
    path.mkdir()
    assert fresh() == (9.0, True)
    assert list(tmp_path.iterdir()) == [path]


def test_signatures_have_their_own_files(fresh, tmp_path, monkeypatch):
    fresh()
    assert kernel(square)(3) == 9
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("option", ["OPT", "BOUNDSCHECK"])
def test_compiler_options_are_part_of_the_key(fresh, tmp_path, monkeypatch, option):
    """A bounds-checked run does not load an unchecked kernel."""
    fresh()
    monkeypatch.setattr(f"numba.core.config.{option}", 1)
    assert fresh() == (9.0, True)
    assert len(list(tmp_path.iterdir())) == 2


def test_kernels_that_hold_a_value_are_not_mixed_up(tmp_path, monkeypatch):
    """A closure's value stands in no file: two kernels of one name and source stay two kernels."""
    monkeypatch.setenv("PBD_CACHE_DIR", str(tmp_path))

    def scaled(factor):
        return kernel(lambda x: factor * x)

    assert [scaled(factor)(3.0) for factor in (2.0, 5.0)] == [6.0, 15.0]


def test_versions_are_part_of_the_key(fresh, monkeypatch):
    fresh()
    monkeypatch.setattr("numba.__version__", "0.0.0")
    assert fresh() == (9.0, True)
