"""The one kernel decorator, and a kernel cache that is never stale.

Numba's own file cache keys a kernel by its own source file alone: after an edit of a helper in
another file it runs the old machine code; its index unpickles the classes of every signature, so a
vanished user module breaks all later loads; and a flipped bit is loaded as it is. Here a cached
kernel is one file whose name is a digest of plain strings - signature, sources, versions, CPU -
and whose content carries its own digest. On any doubt the kernel is compiled again; where nothing
is writable it runs uncached.

Kernels are compiled without the reference-counting runtime: they cannot allocate, and a 10-link
chain step costs a third of what it does with counting.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import platform
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite
import numba
import numpy
from numba import config as _numba_config
from numba import njit, types
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.extending import register_jitable

KERNEL_OPTIONS: Any = {"_nrt": False, "error_model": "numpy"}
"""No allocation, and division by zero gives inf or nan as in numpy: a kernel never raises."""

DEVICE_OPTIONS: Any = {
    **KERNEL_OPTIONS,
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""For functions called only by kernels. Without wrappers they compile twice as fast; left to itself, LLVM keeps the
larger stages as calls that pass a hundred words each, which costs a 10-link step another 60 % of its time."""

device = register_jitable(**DEVICE_OPTIONS)
"""Decorator for a helper function that kernels call and that stays plain Python elsewhere."""

device_sum = register_jitable(**{**DEVICE_OPTIONS, "fastmath": {"contract", "reassoc", "nsz"}})
"""As `device`, for sums that may be taken in any order, several at once."""

config: Any = _numba_config
_DIGEST_BYTES = 32
_STDLIB = sys.stdlib_module_names
_SITE = tuple({str(Path(sysconfig.get_paths()[key]).resolve()) for key in ("purelib", "platlib")})
_SCALARS = (bool, int, float, complex, str, numpy.generic)
_OWN = str(Path(__file__).resolve().parent)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function`` as a kernel with the safe cache; under NUMBA_DISABLE_JIT=1 leave it as it is."""
    if config.DISABLE_JIT:
        return function
    dispatcher = njit(nogil=True, **KERNEL_OPTIONS)(function)
    dispatcher._cache = KernelCache(function)
    return dispatcher


def announce(name: str) -> None:
    """Say on stderr that a one-time compilation starts, so that nobody takes it for the simulation."""
    print(f"pbd: compiling {name} for this kind of scene (a few seconds, once)", file=sys.stderr, flush=True)


def cache_directory() -> Path | None:
    """The first writable directory of PBD_CACHE_DIR, the user's cache and the temporary directory; else None."""
    named = os.environ.get("PBD_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pbd"
    spare = Path(tempfile.gettempdir()) / f"pbd-{os.getuid()}"
    for directory in [Path(named)] if named else [user, spare]:
        try:
            directory.mkdir(parents=True, exist_ok=True, mode=0o700)
            if os.access(directory, os.W_OK) and directory.stat().st_uid == os.getuid():
                return directory
        except OSError:
            continue
    return None


class KernelCache(_Cache):
    """File cache of one kernel's compiled signatures (Numba's cache interface)."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._directory = cache_directory()

    @property
    def cache_path(self) -> str:
        return str(self._directory)

    def enable(self) -> None:
        self._directory = cache_directory()

    def disable(self) -> None:
        self._directory = None

    def flush(self) -> None:
        """Nothing is held in memory."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled signature, or None - a miss - whenever anything about the file is doubtful.

        Deviation from Numba's cache: the target context is not refreshed first. That loads every registry, scipy
        among them, for 0.35 s; machine code needs none of it, and a compilation refreshes by itself.
        """
        try:
            blob = self._path(sig, target_context.codegen()).read_bytes()
            digest, payload = blob[:_DIGEST_BYTES], blob[_DIGEST_BYTES:]
            if hashlib.blake2b(payload, digest_size=_DIGEST_BYTES).digest() != digest:
                raise ValueError("damaged cache file")
            return CompileResult._rebuild(target_context, *pickle.loads(payload))
        except Exception:  # a cache may cost time, never a run
            announce(self._function.__name__)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the compiled signature beside its digest, atomically; silently not where that fails."""
        if self._directory is None or data.library.has_dynamic_globals:
            return
        try:
            path = self._path(sig, data.codegen)
        except Exception:  # as above: no key, no cache, but a run
            return
        payload = dumps(data._reduce())
        digest = hashlib.blake2b(payload, digest_size=_DIGEST_BYTES).digest()
        partial = path.with_suffix(f".{os.getpid()}.tmp")
        try:
            partial.write_bytes(digest + payload)
            os.replace(partial, path)
        except OSError:
            partial.unlink(missing_ok=True)

    def _path(self, sig: Any, codegen: Any) -> Path:
        if self._directory is None or self._function.__closure__:
            raise OSError("no writable cache directory, or a kernel that holds values no file tells")
        key = "\n".join(_key_lines(self._function, sig, codegen))
        return self._directory / f"{self._function.__name__}-{hashlib.sha256(key.encode()).hexdigest()[:40]}.bin"


def _key_lines(function: Callable[..., Any], sig: Any, codegen: Any) -> Iterator[str]:
    """All that decides the machine code, as text: signature, classes, versions, CPU, flags, sources."""
    arguments = getattr(sig, "args", sig)
    classes = sorted(set(_classes(arguments)), key=lambda cls: (cls.__module__, cls.__qualname__))
    yield f"{function.__module__}.{function.__qualname__}"
    yield str(arguments)
    yield from (f"{cls.__module__}.{cls.__qualname__}" for cls in classes)
    yield f"{platform.python_version()} {numba.__version__} {llvmlite.__version__} {numpy.__version__}"
    yield str(codegen.magic_tuple())
    yield f"{config.OPT} {config.BOUNDSCHECK} {config.DEBUGINFO_DEFAULT} {KERNEL_OPTIONS}"
    modules = _modules({function.__module__, *(cls.__module__ for cls in classes)})
    paths = {str(Path(str(module.__file__)).resolve()) for module in modules}
    for path in sorted(paths | {str(path) for path in Path(_OWN).rglob("*.py")}):
        yield f"{path} {hashlib.sha256(Path(path).read_bytes()).hexdigest()}"
    for module in modules:
        yield from _constants(module)


def _classes(argument_types: Any) -> Iterator[type]:
    """The NamedTuple classes among argument types, however deep."""
    for kind in argument_types:
        if isinstance(kind, types.BaseTuple):
            yield from _classes(kind)
            yield from filter(None, [getattr(kind, "instance_class", None)])


def _modules(roots: set[str]) -> list[ModuleType]:
    """The named modules, and all they import that is not installed, by name.

    Raises OSError for a root without a source file - a notebook, ``python -c`` -: its code cannot be compared.
    """
    found: dict[str, ModuleType] = {}
    seen: set[str] = set()
    waiting = sorted(roots)
    while waiting:
        name = waiting.pop()
        module = sys.modules.get(name)
        path = getattr(module, "__file__", None)
        if name in roots and (path is None or not Path(path).is_file()):
            raise OSError(f"{name} has no source file")
        if module is None or name in seen:
            continue
        seen.add(name)
        if name.partition(".")[0] in _STDLIB - {"__main__"} or not path:
            continue
        if name in roots or _is_local(path):
            found[name] = module
            waiting.extend(_imported(module))
    return [found[name] for name in sorted(found)]


def _constants(module: ModuleType) -> Iterator[str]:
    """The numbers, texts and arrays that a module holds, its own or imported: kernels freeze them."""
    if str(Path(str(module.__file__)).resolve()).startswith(_OWN):
        return  # all of them stand in the package's own files
    for name, value in sorted(vars(module).items()):
        if not name.startswith("__") and (isinstance(value, (*_SCALARS, tuple)) or type(value) is numpy.ndarray):
            yield f"{module.__name__}.{name} {_text(value)}"


def _text(value: Any) -> str:
    if type(value) is numpy.ndarray:
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, tuple):
        return f"({', '.join(_text(part) for part in value)})"
    return repr(value) if isinstance(value, _SCALARS) else type(value).__qualname__


def _is_local(path: str) -> bool:
    resolved = str(Path(path).resolve())
    return resolved.endswith(".py") and (resolved.startswith(_OWN) or not resolved.startswith(_SITE))


def _imported(module: ModuleType) -> Iterator[str]:
    """Names of the modules from which ``module`` holds something."""
    for value in vars(module).values():
        if inspect.ismodule(value):
            yield value.__name__
        elif isinstance(getattr(value, "__module__", None), str):
            yield value.__module__
