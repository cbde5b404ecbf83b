"""SHAKE and its compositions: energy kept, and time to an error against every other engine.

Run as ``python tests/benchmarks/second_order.py``. Each case is one work-precision study: all engines interleaved,
one thread, the minimum of the repeats; only errors that were reached count, nothing is extrapolated. The times stand
as called from Python, and again less each engine's empty-world time.
"""

from __future__ import annotations

import argparse

import comparisons
from comparisons import catalog, engine
from comparisons.record import RunSpec
from comparisons.run import execute
from comparisons.studies.work_precision import ANALYST, time_to_error

OURS, PBD = "shake", "pbd"
OWN = (OURS, PBD, "symplectic_euler", ANALYST)
CASES = (
    (1, 10.0, (1e-6, 1e-8), 10.0, 0.3),
    (2, 10.0, (1e-6, 1e-8), 50.0, 1.0),
    (10, 1.0, (1e-6, 1e-8), 15.0, 0.5),
    (100, 1.0, (1e-6,), 60.0, 4.0),
)
"""Links, duration [s], errors [m], goal for the last of them, seconds a run may take."""


def energy():
    """Largest energy change in 100 s at 1 kHz, in m g L, of SHAKE and of PBD."""
    changes = {}
    for name, settings in ((OURS, {}), (PBD, {}), (PBD, {"iterations": 16}), (PBD, {"solver": "direct"})):
        spec = RunSpec(
            scene="pendulum_chain",
            engine=name,
            parameters={"links": 1, "duration": 100.0},
            settings={"dt": 1e-3, **settings},
            metrics=("energy_drift",),
        )
        changes[f"{name} {settings or ''}"] = execute(spec).metric("energy_drift")
    for what, change in changes.items():
        print(f"energy after 100 s at 1 kHz, 1 link, {what}: {change:.2e} m g L")
    kept = changes[f"{OURS} "]
    print(f"  goal 1e-5: {'met' if kept <= 1e-5 else 'missed'}")


def race(links, duration, targets, goal, cap):
    """One case: times of all engines to each error, and the ratio of the best peer to SHAKE."""
    names = [OURS, PBD, *[name for name in catalog.names("engines") if name not in (OURS, PBD)]]
    study = comparisons.work_precision(
        "pendulum_chain",
        scene={"links": links, "duration": duration},
        engines=[name for name in names if not engine.load(name).missing()],
        cap=cap,
        rounds=5,
        quiet=True,
    )
    for target in targets:
        best = time_to_error(study.records, target)
        print(f"{links} links, {duration:g} s, error {target:g} m:")
        for name, (seconds, record) in sorted(best.items(), key=lambda item: item[1][0]):
            net = f"{1e3 * record.seconds.net:9.3f} ms net"
            print(f"    {name:17s}{1e3 * seconds:9.3f} ms  {net}  dt {record.dt}  {record.settings}")
        peers = {name: found for name, found in best.items() if name not in OWN}
        if OURS not in best or not peers:
            print(f"  {'no peer gets there' if OURS in best else 'SHAKE does not get there'} within {cap:g} s a run")
            continue
        first = min(peers, key=lambda name: peers[name][0])
        ratio = peers[first][0] / best[OURS][0]
        net = peers[first][1].seconds.net / best[OURS][1].seconds.net
        verdict = f"; goal {goal:g}: {'met' if ratio >= goal else 'missed'}" if target == targets[-1] else ""
        print(f"  {first} / SHAKE {ratio:.1f}, net {net:.1f}{verdict}")
        if ANALYST in best:
            print(f"  {ANALYST} / SHAKE {best[ANALYST][0] / best[OURS][0]:.1f}")


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--links", type=int, help="only the case with so many links")
    chosen = parser.parse_args()
    if chosen.links is None:
        energy()
    for case in CASES:
        if chosen.links in (None, case[0]):
            race(*case)


if __name__ == "__main__":
    main()
