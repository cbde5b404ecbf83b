"""Open functions: a stage of the step finds its method on the type it is given.

A stage is called as ``stage(owner, ...)``. The owner's class - a NamedTuple, so that its Numba type
carries its class - may define a method of the stage's name; that method is what runs. An owner
without it, None among them, runs the stage's own body, its default, where that applies; else the
stage compiles to nothing. A plain tuple is walked element by element at compile time. So one step
loop serves every scene, and what a scene lacks is never compiled.

The same call works in plain Python, which is what NUMBA_DISABLE_JIT=1 runs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload

from pbd.jit import DEVICE_OPTIONS


def _nothing(owner: Any, *args: Any) -> None:
    """What an absent stage does."""


def stage(declaration: Callable[..., Any] | None = None, *, needs: str = "", required: bool = False) -> Any:
    """Declare an open function; the decorated function's body is the default method.

    Parameters
    ----------
    needs : the default applies only to classes that have a field of this name
    required : the stage has no default; an owner without the method is an error that says so
    """
    if declaration is None:
        return functools.partial(stage, needs=needs, required=required)
    name = declaration.__name__

    def method_of(cls: type) -> Callable[..., Any]:
        method = getattr(cls, name, None)
        if method is not None:
            return method
        if required:
            raise TypeError(f"{cls.__name__} has no method {name}(); see pbd/stages.py for what it must do")
        return declaration if not needs or needs in getattr(cls, "_fields", ()) else _nothing

    @functools.wraps(declaration)
    def call(owner: Any, *args: Any) -> Any:
        if type(owner) is tuple:
            for part in owner:
                call(part, *args)
            return None
        return method_of(type(owner))(owner, *args)

    def walk(owner: Any, *args: Any) -> None:
        call(owner[0], *args)
        call(owner[1:], *args)

    def find(owner: Any, *args: Any) -> Callable[..., Any]:
        if isinstance(owner, types.BaseTuple) and not isinstance(owner, types.BaseNamedTuple):
            return walk if len(owner) > 0 else _nothing
        return method_of(getattr(owner, "instance_class", type(None)))

    overload(call, strict=False, jit_options=DEVICE_OPTIONS)(find)
    return call
