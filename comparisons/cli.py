"""The command ``pbdbench``: the composition root, which alone joins studies and reports.

Everything heavy is imported when it is needed, so that ``--help`` answers at once.
Exit codes: 0 ok, 2 bad input, 3 runs crashed or timed out, 130 interrupted.
"""

from __future__ import annotations

import argparse
import ast
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from comparisons import catalog
from pbd.errors import InvalidInput

if TYPE_CHECKING:
    from comparisons.record import Record
    from comparisons.study import Study

BAD_INPUT, LOST_RUNS, INTERRUPTED = 2, 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        _check_places(options)
        return int(options.action(options))
    except InvalidInput as error:
        print(f"pbdbench: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"pbdbench: {error.filename or 'output'}: {error.strerror}; give another place", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("pbdbench: interrupted; what was finished is kept", file=sys.stderr)
        return INTERRUPTED


def _check_places(options: argparse.Namespace) -> None:
    """Refuse a place that cannot be written to before hours are spent on what should go there."""
    for flag, name in (("-o", "directory"), ("--json", "json")):
        place: Path | None = getattr(options, name, None)
        if place is None:
            continue
        if "\0" in str(place):
            raise InvalidInput(flag, str(place), "a path without NUL")
        wrong = place.is_dir() if name == "json" else place.exists() and not place.is_dir()
        nearest = next((p for p in [place, *place.absolute().parents] if p.exists()), place)
        if wrong or not os.access(nearest, os.W_OK) or (nearest != place and not nearest.is_dir()):
            kind = "a file" if name == "json" else "a directory"
            raise InvalidInput(flag, str(place), f"{kind} that can be written", "give another place")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="pbdbench", description="How accurate and how fast is a PBD solver?")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    report = commands.add_parser("report", help="run the main job and write the report")
    report.add_argument("-o", dest="directory", type=Path, default=Path("build/report"), help="default build/report")
    report.set_defaults(action=_report)
    commands.add_parser("list", help="list scenes, engines, metrics and studies").set_defaults(action=_list)
    one = commands.add_parser("run", help="run one scene in one engine and print its record")
    one.add_argument("--engine", required=True, metavar="E", help="one of: " + ", ".join(catalog.names("engines")))
    one.add_argument("--preset", default="default", help="the engine's preset; default: default")
    one.set_defaults(action=_run)
    _common(one)
    for name in catalog.names("studies"):
        source = _source(name)
        study = commands.add_parser(name, help=_summary(source))
        study.add_argument("--engines", metavar="A,B", help="default: all")
        study.add_argument("-o", dest="directory", type=Path, metavar="DIR", help="write figures and records there")
        study.set_defaults(action=_study, study=name)
        _common(study, takes_scene=_takes_scene(source))
    return parser


def _common(parser: argparse.ArgumentParser, *, takes_scene: bool = True) -> None:
    if takes_scene:
        parser.add_argument("scene", metavar="SCENE", help="one of: " + ", ".join(catalog.names("scenes")))
    else:
        parser.set_defaults(scene=None)
    parser.add_argument(
        "--set",
        dest="changes",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="scene.links=10, pymunk.iterations=50, dt=0.001; may be repeated",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the records there")


def _source(name: str) -> ast.Module:
    """A study's source, read without importing it."""
    return ast.parse((Path(__file__).parent / "studies" / f"{name}.py").read_text(encoding="utf-8"))


def _summary(source: ast.Module) -> str:
    """The first line of a study's docstring."""
    return (ast.get_docstring(source) or "").split("\n")[0].rstrip(".")


def _takes_scene(source: ast.Module) -> bool:
    """Whether the study's ``run`` is about a scene that is asked for: its argument ``scene_name``."""
    runs = [node for node in source.body if isinstance(node, ast.FunctionDef) and node.name == "run"]
    return any(argument.arg == "scene_name" for run in runs for argument in run.args.args)


# ------------------------------------------------------------------ actions


def _list(_: argparse.Namespace) -> int:
    from comparisons import engine

    for kind in ("scenes", "engines", "metrics", "studies"):
        print(f"{kind}:")
        for name in catalog.names(kind):
            remedy = engine.load(name).missing() if kind == "engines" else ""
            print(f"  {name}" + (f"  (absent: {remedy})" if remedy else ""))
    return 0


def _run(options: argparse.Namespace) -> int:
    import msgspec

    from comparisons.record import RunSpec
    from comparisons.run import execute
    from comparisons.study import write_atomically

    scene, engines, rest = _changes(options, [options.engine])
    settings = {**engines.get(options.engine, {}), **_engine_settings(options.engine, rest)}
    spec = RunSpec(
        scene=options.scene, engine=options.engine, parameters=scene, preset=options.preset, settings=settings
    )
    record = execute(spec)
    text = msgspec.json.format(msgspec.json.encode(record), indent=2)
    if options.json:
        write_atomically(options.json, text)
    print(text.decode())
    return _exit_code([record])


def _study(options: argparse.Namespace) -> int:
    module = catalog.load("studies", options.study)
    names = options.engines.split(",") if options.engines else None
    scene, settings, rest = _changes(options, names or catalog.names("engines"))
    asked = {"engines": names, "settings": settings, **_arguments(module, rest)}
    study: Study = module.run(options.scene, scene=scene, **asked) if options.scene else module.run(**asked)
    if options.json:
        study.to_json(options.json)
    if options.directory:
        study.to_json(options.directory / f"{study.kind}.json")
        for ending in ("png", "svg") if study.series else ():
            study.plot(options.directory / f"{study.kind}.{ending}")
        if study.films:
            study.plot(options.directory / f"{study.kind}.gif")
            study.plot_moments(options.directory / f"{study.kind}-moments.png")
        print(f"figures and records: {options.directory}")
    print(study.table())
    for omission in study.omissions:
        print(f"left out: {omission.engine}, {omission.reason}; {omission.remedy}")
    print("\n".join(study.sentences))
    return _exit_code(study.records)


def _exit_code(records: Iterable[Record]) -> int:
    """3 where runs were lost to a crash or a timeout."""
    return LOST_RUNS if {record.status.code for record in records} & {"crashed", "timeout"} else 0


def _report(options: argparse.Namespace) -> int:
    from comparisons import main_job, store

    store.open_file(options.directory.parent / "runs.sqlite")
    chapters = main_job.run()
    from reports import page

    print(f"report: {page.write(chapters, options.directory)}")
    return _exit_code(record for chapter in chapters for study in chapter.studies for record in study.records)


# ------------------------------------------------------------------ --set


def _changes(options: argparse.Namespace, engines: list[str]) -> tuple[dict, dict[str, dict], dict[str, str]]:
    """(scene parameters, engine -> settings, what has no prefix) of all --set."""
    from comparisons import engine
    from pbd import fields
    from pbd.errors import unknown

    parameters = catalog.load("scenes", options.scene).Parameters if options.scene else None
    scene: dict[str, Any] = {}
    settings: dict[str, dict[str, Any]] = {}
    rest: dict[str, str] = {}
    for change in options.changes:
        key, equals, text = change.partition("=")
        owner, dot, name = key.partition(".")
        if not equals:
            raise InvalidInput("--set", change, "of the form KEY=VALUE")
        if not dot:
            rest[key] = text
        elif owner == "scene" and parameters is not None:
            scene[name] = fields.parse(key, fields.find("scene parameter", name, parameters), text)
        elif owner in engines:
            settings.setdefault(owner, {}).update(_engine_settings(owner, {name: text}))
        else:
            engine.load(owner)
            raise unknown("--set", owner, [*(["scene"] if parameters else []), *engines])
    return scene, settings, rest


def _engine_settings(name: str, texts: dict[str, str]) -> dict[str, Any]:
    from comparisons import engine
    from pbd import fields

    settings = engine.load(name).Settings
    return {
        key: fields.parse(f"{name}.{key}", fields.find(f"{name} setting", key, settings), text)
        for key, text in texts.items()
    }


def _arguments(module: Any, texts: dict[str, str]) -> dict[str, Any]:
    """Keyword arguments of a study: numbers, lists of numbers for what it sweeps, none for what it leaves out."""
    import inspect

    from pbd.errors import unknown

    signature = inspect.signature(module.run).parameters
    known = {
        key: str(p.annotation)
        for key, p in signature.items()
        if "float" in str(p.annotation) or "int" in str(p.annotation)
    }
    found: dict[str, Any] = {}
    for key, text in texts.items():
        if key not in known:
            raise unknown("--set", key, [*known, "scene.NAME", "ENGINE.NAME"])
        if text == "none" and "None" in known[key]:
            found[key] = None
            continue
        kind = int if "int" in known[key] else float
        many = "Sequence" in known[key]
        try:
            values = [kind(part) for part in (text.split(",") if many else [text])]
        except ValueError:
            noun = "a whole number" if kind is int else "a number"
            raise InvalidInput(key, text, f"{noun}, or several with commas" if many else noun) from None
        found[key] = values if many else values[0]
    return found


if __name__ == "__main__":
    sys.exit(main())
