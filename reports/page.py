"""The report: one self-contained HTML page, the same as Markdown, figures as files, all records as JSON."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from jinja2 import Environment, PackageLoader

from comparisons.study import Chapter, Omission, Study, duration, write_atomically
from reports import animation, figures
from reports.figures import Cell
from reports.style import TITLES

COLUMNS = 2


@dataclass(frozen=True)
class Picture:
    """One figure of a chapter: its file, what it shows, the drawing as a data URI: SVG, or a GIF of films."""

    file: str
    caption: str
    uri: str


@dataclass(frozen=True)
class Section:
    """A chapter with its pictures."""

    chapter: Chapter
    pictures: list[Picture]


def write(chapters: Sequence[Chapter], directory: Path) -> Path:
    """Write index.html, report.md, figures/ and records.json into ``directory``; returns the page's path."""
    sections = [Section(chapter, _pictures(chapter, directory / "figures")) for chapter in chapters]
    studies = [study for chapter in chapters for study in chapter.studies]
    context = {
        "sections": sections,
        "targets": sorted({won.target for study in studies for won in study.winners}, reverse=True),
        "races": [study for study in studies if study.winners],
        "score": _score(studies),
        "omissions": _omissions(studies),
        "head": studies[0].head,
        "titles": TITLES,
        "duration": duration,
    }
    for template, name, escape in (("page.html.j2", "index.html", True), ("page.md.j2", "report.md", False)):
        environment = Environment(
            loader=PackageLoader("reports"), autoescape=escape, trim_blocks=True, lstrip_blocks=True
        )
        write_atomically(directory / name, environment.get_template(template).render(context).encode())
    write_atomically(directory / "records.json", msgspec.json.encode(list(chapters)))
    return directory / "index.html"


def _pictures(chapter: Chapter, directory: Path) -> list[Picture]:
    """One figure for each panel that the chapter's studies share; a single study is one figure, or none."""
    if len(chapter.studies) == 1:
        study = chapter.studies[0]
        cells = [(study, panel.name, panel.title) for panel in study.panels]
        drawn = [_picture(cells, chapter.heading, "", directory)] if cells else []
        filmed = [_animation(study, chapter.heading, directory)] if study.films else []
        stills = [_moments(study, chapter.heading, directory)] if study.films and study.films[0].moments else []
        return [*drawn, *stills, *filmed]
    titles = {panel.name: panel.title for study in chapter.studies for panel in study.panels}
    found = []
    for name, title in titles.items():
        having = [study for study in chapter.studies if any(panel.name == name for panel in study.panels)]
        title = title if any(s.kind != "settings" for s in having) else ""
        cells = [(study, name, study.subject) for study in having]
        found.append(_picture(cells, chapter.heading, title, directory))
    return found


def _picture(cells: Sequence[Cell], heading: str, detail: str, directory: Path) -> Picture:
    caption = f"{heading}: {detail}" if detail else heading
    stem = _stem(caption)
    figure = figures.grid(cells, caption, min(COLUMNS, len(cells)))
    for ending in figures.FORMATS:
        figures.save(figure, directory / f"{stem}.{ending}")
    svg = (directory / f"{stem}.svg").read_bytes()
    return Picture(f"{stem}.png", caption, "data:image/svg+xml;base64," + base64.b64encode(svg).decode())


def _animation(study: Study, heading: str, directory: Path) -> Picture:
    path = directory / f"{_stem(heading)}.gif"
    animation.write(study.films, path)
    return Picture(path.name, study.title, "data:image/gif;base64," + base64.b64encode(path.read_bytes()).decode())


def _moments(study: Study, heading: str, directory: Path) -> Picture:
    path = directory / f"{_stem(heading)}-moments.png"
    animation.moments(study.films, path)
    return Picture(path.name, study.title, "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode())


def _stem(caption: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in caption.lower().replace("'", "")).split())


def _score(studies: Sequence[Study]) -> list[tuple[str, int]]:
    """(engine, number of scene and error pairs that it wins), best first; "" counts those that none reaches."""
    return Counter(won.engine for study in studies for won in study.winners).most_common()


def _omissions(studies: Sequence[Study]) -> list[tuple[Omission, list[str]]]:
    """Each omission once, with the studies that it touches."""
    found: dict[tuple[str, str, str], tuple[Omission, list[str]]] = {}
    for study in studies:
        for omission in study.omissions:
            key = (omission.engine, omission.reason, omission.remedy)
            found.setdefault(key, (omission, []))[1].append(study.title)
    return list(found.values())
