"""Engines in child processes: one that aborts, hangs or floods its output costs its own run alone.

A `Worker` is one child for one engine, kept for many runs; parent and child exchange length-prefixed
MessagePack, never pickles. The child's own standard output goes nowhere, because some engines write
there from C. Times are taken inside the child.
"""

from __future__ import annotations

import dataclasses
import os
import selectors
import signal
import struct
import subprocess
import sys
import threading
import time
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from comparisons.record import Finding, RunSpec
from comparisons.trajectory import Trajectory
from pbd.errors import InvalidInput

if TYPE_CHECKING:
    from comparisons.run import Bound
    from comparisons.scene import Scene

TIMEOUT = 300.0
"""Seconds that one request may take."""

MEMORY = 12 * 2**30
"""Address space of a child [bytes]: a memory bomb ends itself, not the machine."""

ENDING = 2.0
"""Seconds that a child may take to end after it closed its answers."""

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class Lost(RuntimeError):
    """A run whose child ended, hung or failed: status code, what happened, remedy."""

    def __init__(self, code: str, what: str, remedy: str) -> None:
        super().__init__(what)
        self.code, self.what, self.remedy = code, what, remedy


class Worker:
    """A child process that runs specs of one engine, started when first needed and again after a loss."""

    def __init__(self, timeout: float = TIMEOUT) -> None:
        self.timeout = timeout
        self._child: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def run(self, spec: RunSpec) -> Trajectory:
        """The trajectory of ``spec``; raises `Lost`."""
        answer = self._ask({"task": "run", "spec": msgspec.to_builtins(spec)})
        arrays: Any = {name: np.frombuffer(blob).reshape(shape) for name, (blob, shape) in answer["arrays"].items()}
        return Trajectory(**arrays, **answer["rest"])

    def seconds(self, spec: RunSpec) -> tuple[float, float]:
        """Time of one run of ``spec``, and of the empty world in its place [s]; raises `Lost`."""
        answer = self._ask({"task": "time", "spec": msgspec.to_builtins(spec)})
        return answer["seconds"], answer["overhead"]

    def findings(self, engine: str) -> list[Finding]:
        """What the engine's ``calibrate`` finds, none where it has no such hook; raises `Lost`."""
        answer = self._ask({"task": "calibrate", "engine": engine})
        return msgspec.convert(answer["findings"], list[Finding])

    def close(self) -> None:
        """End the child."""
        if self._child is not None:
            self._child.kill()
            self._child.communicate()
            self._child = None

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            if self._child is None or self._child.poll() is not None:
                self._child = _start()
            try:
                answer = self._exchange(self._child, msgspec.msgpack.encode(request))
            except BaseException:
                self.close()
                raise
        if "error" in answer:
            raise Lost("crashed", answer["error"], "see the engine's documentation for what this input means to it")
        return answer

    def _exchange(self, child: subprocess.Popen[bytes], request: bytes) -> dict[str, Any]:
        assert child.stdin is not None
        deadline = time.monotonic() + self.timeout
        try:
            child.stdin.write(struct.pack("<Q", len(request)) + request)
            child.stdin.flush()
            size = struct.unpack("<Q", _read(child, 8, deadline))[0]
            return msgspec.msgpack.decode(_read(child, size, deadline))
        except (EOFError, BrokenPipeError, msgspec.DecodeError):
            raise Lost("crashed", f"the engine's process {_ending(child)}", "change the settings of this run") from None
        except TimeoutError:
            remedy = "use a larger time step, fewer samples or a shorter duration"
            raise Lost("timeout", f"no result within {self.timeout:g} s", remedy) from None


def _start() -> subprocess.Popen[bytes]:
    environment = {**os.environ, **dict.fromkeys(THREAD_VARIABLES, "1")}
    command = [sys.executable, "-m", "comparisons.isolation"]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0)


def _ending(child: subprocess.Popen[bytes]) -> str:
    """How a child that gave no answer ended, in words."""
    try:
        code = child.wait(timeout=ENDING)
    except subprocess.TimeoutExpired:
        return "gave no answer that can be read"
    return f"ended with signal {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def _read(child: subprocess.Popen[bytes], size: int, deadline: float) -> bytes:
    assert child.stdout is not None
    parts = bytearray()
    with selectors.DefaultSelector() as selector:
        selector.register(child.stdout, selectors.EVENT_READ)
        while len(parts) < size:
            if not selector.select(max(0.0, deadline - time.monotonic())):
                raise TimeoutError
            part = os.read(child.stdout.fileno(), min(size - len(parts), 2**20))
            if not part:
                raise EOFError
            parts += part
    return bytes(parts)


class Workers:
    """One worker for each engine, made when first asked for; a context manager that ends them all."""

    def __init__(self) -> None:
        self._workers: dict[str, Worker] = {}

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *error: object) -> None:
        for worker in self._workers.values():
            worker.close()

    def __getitem__(self, engine: str) -> Worker:
        return self._workers.setdefault(engine, Worker())


def lent(workers: Workers | None) -> AbstractContextManager[Workers]:
    """The workers that are given, or else new ones that end with the block."""
    return Workers() if workers is None else nullcontext(workers)


def run_apart(spec: RunSpec) -> Trajectory:
    """Run ``spec`` in a child of its own."""
    with Workers() as workers:
        return workers[spec.engine].run(spec)


# ------------------------------------------------------------------ the child

_WARM: set[str] = set()


def _serve(requests: Any, answers: Any) -> None:
    """Answer requests until the parent closes the pipe."""
    while head := requests.read(8):
        request = msgspec.msgpack.decode(requests.read(struct.unpack("<Q", head)[0]))
        try:
            answer = _answer(request)
        except Exception as error:  # whatever an engine raises is this run's loss alone
            answer = {"error": f"{type(error).__name__}: {error}"}
        blob = msgspec.msgpack.encode(answer)
        answers.write(struct.pack("<Q", len(blob)) + blob)
        answers.flush()


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    from comparisons import engine, run

    if request["task"] == "calibrate":
        os.dup2(1, 2)
        calibrate = getattr(engine.load(request["engine"]), "calibrate", list)
        return {"findings": msgspec.to_builtins(calibrate())}
    bound = run.bind(msgspec.convert(request["spec"], RunSpec))
    if bound.adapter.FOREIGN:
        os.dup2(1, 2)  # foreign engines also write to the error stream, from C
    _warm_up(bound, bound.scene)
    out = bound.run()
    if request["task"] == "time":
        return {"seconds": out.wall, "overhead": _overhead(bound)}
    values = {field.name: getattr(out, field.name) for field in dataclasses.fields(out)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    sent = {name: (np.ascontiguousarray(a, dtype=float).tobytes(), a.shape) for name, a in arrays.items()}
    return {"arrays": sent, "rest": {name: value for name, value in values.items() if name not in arrays}}


def _overhead(bound: Bound) -> float:
    """Time of the empty world [s], by the preset's settings where the run's own are of no use without a scene."""
    from comparisons import engine, scene

    world = scene.empty(bound.scene)
    try:
        _warm_up(bound, world)
        return bound.run(world).wall
    except InvalidInput:
        spec = msgspec.structs.replace(bound.spec, settings={"dt": bound.settings.dt})
        settings = engine.make_settings(spec.engine, spec.preset, spec.settings)
        usual = msgspec.structs.replace(bound, spec=spec, settings=settings)
        _warm_up(usual, world)
        return usual.run(world).wall


def _warm_up(bound: Bound, world: Scene) -> None:
    """Compile and load everything by a run over one sample interval, once for each kind of run."""
    kind = repr((world.name, len(world.gravity), bound.spec.preset, {**bound.spec.settings, "dt": None, "rtol": None}))
    if kind not in _WARM:
        _WARM.add(kind)
        bound.run(dataclasses.replace(world, duration=world.duration / world.samples, samples=1))


def _main() -> None:
    import resource

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    answers = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    _serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    _main()
