"""Films of planar scenes side by side, as one animated GIF of few colours."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from comparisons.film import Film
from comparisons.study import write_atomically
from pbd.errors import InvalidInput
from reports.style import COLOURS, OTHER, RC

COLUMNS = 3
WIDTH = 840
"""Pixels, about what a README shows."""

DPI = 100
TITLE, GAP = 30, 8
"""Pixels above each panel and around it."""

HOLD = 1.5
"""Seconds for which the last frame stays."""

MARGIN = 0.05
"""Of the height, that shows ground."""

HEADROOM = 1.17
"""Height of a panel over what bodies reach: there stand note and time."""

SHOWN = 96.0
"""Percentage of the bodies that end within a panel; who rolls on would make all others small."""

PALE = 0.45
"""Share of an engine's colour in its bodies; the rest is white."""

PALETTE = 48


def write(films: Sequence[Film], path: Path) -> None:
    """Draw all films, frame by frame, into the GIF ``path``."""
    if not films:
        raise InvalidInput("films", 0, "at least one", "see the study's omissions")
    if path.suffix != ".gif":
        raise InvalidInput("path", str(path), "a file name that ends in .gif")
    with matplotlib.rc_context(RC):
        frames = _frames(films)
    times = films[0].times
    step = 1000.0 * (times[-1] - times[0]) / max(len(times) - 1, 1)
    durations = [round(step / 10.0) * 10] * (len(frames) - 1) + [round(1000.0 * HOLD)]
    palette = frames[len(frames) // 2].quantize(PALETTE, dither=Image.Dither.NONE)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}")
    flat[0].save(
        partial, format="GIF", save_all=True, append_images=flat[1:], duration=durations, loop=0, optimize=False
    )
    content = partial.read_bytes()
    partial.unlink()
    write_atomically(path, content)


def still(films: Sequence[Film], index: int) -> Image.Image:
    """One frame."""
    with matplotlib.rc_context(RC):
        return _frames(films, [index])[0]


def moments(films: Sequence[Film], path: Path) -> None:
    """The films' moments below each other, all films in a row, into the PNG ``path``."""
    with matplotlib.rc_context(RC):
        rows = _frames(films, films[0].moments, columns=len(films))
    sheet = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)), "white")
    for k, row in enumerate(rows):
        sheet.paste(row, (0, k * row.height))
    content = io.BytesIO()
    sheet.save(content, "PNG")
    write_atomically(path, content.getvalue())


def _columns(films: int) -> int:
    """In how many columns so many panels stand: four as two rows of two."""
    return 2 if films == 4 else min(COLUMNS, films)


def _frames(films: Sequence[Film], wanted: Sequence[int] | None = None, columns: int = 0) -> list[Image.Image]:
    """The still parts are drawn once; each frame adds bodies and time to them. 0 columns: as suits their number."""
    view = _view(films)
    columns = columns or _columns(len(films))
    rows = math.ceil(len(films) / columns)
    side = (WIDTH - GAP) / columns - GAP
    tall = side * (view[3] - view[2]) / (view[1] - view[0])
    height = round(rows * (tall + TITLE + GAP)) + GAP
    figure = Figure(figsize=(WIDTH / DPI, height / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    stages = []
    for k, film in enumerate(films):
        row, column = divmod(k, columns)
        left, bottom = GAP + column * (side + GAP), height - (row + 1) * (tall + TITLE + GAP)
        ax = figure.add_axes((left / WIDTH, bottom / height, side / WIDTH, tall / height))
        stages.append(Stage(ax, film, view))
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)
    frames = []
    for index in range(len(films[0].times)) if wanted is None else wanted:
        canvas.restore_region(background)
        for stage in stages:
            stage.draw(index)
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    return frames


def _view(films: Sequence[Film]) -> tuple[float, float, float, float]:
    """What all panels show: x from and to, y from and to [m]: all the fall, and nearly all of the heaps."""
    if films[0].view:
        left, right, low, high = films[0].view
        return left, right, low, high
    poses = np.concatenate([np.array(film.poses).reshape(-1, 3) for film in films])
    ends = np.concatenate([np.array(film.poses[-1]) for film in films])
    reach = max(math.hypot(*shape) for film in films for shape in film.shapes) / 2.0
    half, top = float(np.percentile(np.abs(ends[:, 0]), SHOWN)) + reach, float(poses[:, 1].max()) + reach
    return -half, half, -MARGIN * top, HEADROOM * top


class Stage:
    """A film's panel: title and ground, which stay, and the bodies."""

    def __init__(self, ax: Axes, film: Film, view: tuple[float, float, float, float]) -> None:
        self.ax, self.film = ax, film
        self.poses = np.array(film.poses)
        self.corners, self.radii = _outlines(film)
        shade = np.array(to_rgb(COLOURS.get(film.engine, OTHER)))
        fill = tuple(PALE * shade + (1.0 - PALE))
        edges: dict[str, Any] = {"facecolors": [fill], "edgecolors": [tuple(0.85 * shade)], "linewidths": 0.8}
        ax.set(xlim=view[:2], ylim=view[2:], xticks=[], yticks=[])
        ax.grid(visible=False)
        for spine in ax.spines.values():
            spine.set(visible=True, color="#cccccc")
        ax.set_title(film.label, fontsize=11, fontweight="bold", loc="left", color=tuple(0.8 * shade), pad=5)
        for x, y, offset in film.planes:
            _ground(ax, np.array([x, y]), offset)
        self.boxes = PolyCollection([], **edges)
        self.balls = EllipseCollection(
            2.0 * self.radii, 2.0 * self.radii, self.radii * 0.0, units="xy", offset_transform=ax.transData, **edges
        )
        ax.text(0.03, 0.96, film.note, ha="left", va="top", fontsize=10, transform=ax.transAxes)
        self.clock = ax.text(0.97, 0.96, "", ha="right", va="top", fontsize=10, transform=ax.transAxes)
        for artist in (self.boxes, self.balls, self.clock):
            artist.set_animated(True)
        ax.add_collection(self.boxes)
        ax.add_collection(self.balls)

    def draw(self, index: int) -> None:
        """Draw the bodies of one frame, and the time."""
        k = min(index, len(self.poses) - 1)
        x, angle = self.poses[k, :, :2], self.poses[k, :, 2]
        c, s = np.cos(angle), np.sin(angle)
        turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
        is_ball = self.radii > 0.0
        placed = np.einsum("nij,nkj->nki", turn, self.corners) + x[:, None]
        self.boxes.set_verts(list(placed[~is_ball]))
        self.balls.set_offsets(x)
        self.clock.set_text(self.film.clock.format(self.film.times[k]))
        for artist in (self.boxes, self.balls, self.clock):
            self.ax.draw_artist(artist)


def _outlines(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 4, 2) of the boxes about their centres [m], radii (n,) of the balls [m]; 0 of the others."""
    signs = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    sizes = np.array([shape if len(shape) == 2 else [0.0, 0.0] for shape in film.shapes])
    radii = np.array([shape[0] if len(shape) == 1 else 0.0 for shape in film.shapes])
    return signs * sizes[:, None], radii


def _ground(ax: Axes, normal: np.ndarray, offset: float) -> None:
    """Fill a half-space, as far as the panel goes."""
    far = 1e3
    along, point = np.array([-normal[1], normal[0]]), offset * normal
    corners = [point + far * along, point - far * along, point - far * (along + normal), point + far * (along - normal)]
    ax.fill(*np.transpose(corners), color="#d9d9d9", linewidth=0)
