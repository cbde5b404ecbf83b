"""Finished work, kept: references and records, in memory and - once `open_file` was called - in one SQLite file.

SQLite in WAL mode loses nothing to a kill at any moment. What is stored is JSON and plain arrays, never
pickles. Every entry's key holds a digest of the sources and versions that made it, so that a change of
code is a miss. Where the file cannot be used, the memory alone is.
"""

from __future__ import annotations

import hashlib
import io
import platform
import sqlite3
import sys
import threading
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from comparisons import engine, exact_projection, minimiser
from comparisons import reference as references
from comparisons.record import SCHEMA, Record, RunSpec
from comparisons.scene import Scene

KEPT = ("ok", "drifting", "diverged", "refused")
"""Statuses that a repetition would give again; what crashed or timed out is tried anew."""

_lock = threading.Lock()
_memory: dict[str, bytes] = {}
_file: list[sqlite3.Connection] = []


def open_file(path: Path) -> None:
    """Keep entries in the SQLite file ``path`` from now on; one that is damaged is set aside."""
    close_file()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _file.append(_connect(path))
    except (sqlite3.OperationalError, OSError) as trouble:  # no damage: locked, read-only, no such place
        print(f"{path}: results are not kept on disk: {trouble}", file=sys.stderr)
    except sqlite3.DatabaseError as damage:
        print(f"{path}: {damage}; set aside as {path.name}.damaged", file=sys.stderr)
        try:
            path.replace(path.with_name(path.name + ".damaged"))
            _file.append(_connect(path))
        except (OSError, sqlite3.Error) as trouble:
            print(f"{path}: results are not kept on disk: {trouble}", file=sys.stderr)


def close_file() -> None:
    """Forget the file; the memory stays."""
    while _file:
        _file.pop().close()


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=30.0, check_same_thread=False, isolation_level=None)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA synchronous=NORMAL")
    connection.execute("CREATE TABLE IF NOT EXISTS entries (key TEXT PRIMARY KEY, digest TEXT, value BLOB)")
    connection.execute("SELECT key, digest FROM entries LIMIT 1")
    return connection


def _get(key: str) -> bytes | None:
    with _lock:
        if key in _memory or not _file:
            return _memory.get(key)
        try:
            row = _file[0].execute("SELECT digest, value FROM entries WHERE key = ?", (key,)).fetchone()
        except sqlite3.Error:
            return None
        if row is None or not isinstance(row[1], bytes) or _checksum(key, row[1]) != row[0]:
            return None
        _memory[key] = row[1]
        return row[1]


def _put(key: str, value: bytes) -> None:
    with _lock:
        _memory[key] = value
        try:
            for connection in _file:
                row = (key, _checksum(key, value), value)
                connection.execute("INSERT OR REPLACE INTO entries VALUES (?, ?, ?)", row)
        except sqlite3.Error as trouble:
            print(f"results are not kept on disk: {trouble}", file=sys.stderr)
            close_file()


def _checksum(key: str, value: bytes) -> str:
    """Of key and value together: a damaged index may lead to the whole value of another key."""
    return hashlib.sha256(key.encode() + b"\0" + value).hexdigest()


@lru_cache(maxsize=1)
def environment() -> str:
    """Digest of all sources that make results, and of the versions below them."""
    digest = hashlib.sha256(f"{SCHEMA} {platform.python_version()} {platform.processor()}".encode())
    root = Path(__file__).resolve().parent
    for package in (root, root.parent / "pbd"):
        for path in sorted(package.rglob("*.py")):
            digest.update(path.name.encode() + path.read_bytes())
    for dependency in ("numpy", "scipy", "numba", "llvmlite"):
        digest.update(version(dependency).encode())
    return digest.hexdigest()[:32]


def load_record(spec: RunSpec) -> Record | None:
    """The stored record of a spec, without its time: times are never re-used."""
    value = _get(_key(spec))
    return msgspec.json.decode(value, type=Record) if value else None


def save_record(spec: RunSpec, record: Record) -> None:
    """Keep a record, unless a repetition could end otherwise."""
    if record.status.code in KEPT:
        _put(_key(spec), msgspec.json.encode(msgspec.structs.replace(record, seconds=None)))


def _key(spec: RunSpec) -> str:
    return f"record {environment()} {_engine_version(spec.engine)} {spec.key()}"


@lru_cache
def _engine_version(name: str) -> str:
    adapter = engine.load(name)
    return "" if adapter.missing() else str(adapter.version())


def reference(scene: Scene) -> tuple[np.ndarray, float]:
    """(positions (s, n, d) [m] of the scene's reference, its predictability horizon [s]); computed once."""

    def solve() -> dict[str, Any]:
        solved = references.solve(scene)
        if solved.diverged:
            raise references.NoReference(f"DOP853 broke off at {solved.times[-1]:g} s: {solved.diverged}")
        return {"positions": solved.positions, "horizon": np.array(references.horizon(scene))}

    found = _arrays(f"reference {environment()} {_digest(scene)}", solve)
    return found["positions"], float(found["horizon"])


def static_state(scene: Scene) -> np.ndarray:
    """(n, d) positions [m] of the scene's static state; computed once."""
    key = f"static state {environment()} {_digest(scene)}"
    return _arrays(key, lambda: {"positions": minimiser.static_state(scene).positions})["positions"]


def projection(scene: Scene) -> np.ndarray:
    """(n, d) positions [m] of the exact projection of the scene's start; computed once."""
    key = f"projection {environment()} {_digest(scene)}"
    return _arrays(key, lambda: {"positions": exact_projection.project(scene).positions})["positions"]


def implicit_euler(scene: Scene, dt: float) -> np.ndarray:
    """(s, n, d) positions [m] of the scene's motion by implicit Euler with steps of dt [s]; computed once."""
    key = f"implicit Euler {dt!r} {environment()} {_digest(scene)}"
    return _arrays(key, lambda: {"positions": minimiser.implicit_euler(scene, dt).positions})["positions"]


def _arrays(key: str, make: Callable[[], dict[str, Any]]) -> dict[str, np.ndarray]:
    """The arrays kept under ``key``, made where there are none."""
    value = _get(key)
    if value is None:
        buffer = io.BytesIO()
        np.savez(buffer, **make())
        value = buffer.getvalue()
        _put(key, value)
    with np.load(io.BytesIO(value), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _digest(scene: Scene) -> str:
    """A digest of everything in the scene."""
    parts = [scene.gravity, scene.times, scene.masses.positions, scene.masses.velocities, scene.masses.masses]
    parts.append(np.array(scene.masses.pinned))
    for link in scene.links:
        parts.extend(vars(link).values())
    digest = hashlib.sha256(" ".join(type(link).__name__ for link in scene.links).encode())
    for part in parts:
        digest.update(str(part.shape).encode() + np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()
