"""How long a user waits: for ``pbdbench --help``, and from the start of a process to the first step of a cached scene.

Run as ``python tests/benchmarks/start_up.py``. Whole processes are timed, and the minimum of the repeats counts.
"""

from __future__ import annotations

import subprocess
import sys
import time

REPEATS = 7
FIRST_STEP = """
import time, pbd
chain = pbd.particles([[float(i), 0.0] for i in range(11)], pinned=[0])
links = pbd.distance(chain, [(i, i + 1) for i in range(10)])
pbd.Simulation(chain, [links], gravity=(0.0, -9.81)).run(1)
print(time.time())
"""


def until_exit(*arguments):
    """Seconds from the start of a process to its end."""
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return time.perf_counter() - start


def until_first_step():
    """Seconds from the start of a process to the end of its first step."""
    start = time.time()
    done = subprocess.run([sys.executable, "-c", FIRST_STEP], check=True, capture_output=True, text=True)
    return float(done.stdout) - start


def main():
    until_first_step()  # compiles, where this kind of scene is not cached yet
    for what, goal, measure in (
        ("pbdbench --help", 0.150, lambda: until_exit("-m", "comparisons", "--help")),
        ("first step of a cached scene", 0.800, until_first_step),
    ):
        seconds = min(measure() for _ in range(REPEATS))
        print(f"{what}: {1e3 * seconds:.0f} ms, goal {1e3 * goal:.0f} ms: {'met' if seconds <= goal else 'missed'}")


if __name__ == "__main__":
    main()
