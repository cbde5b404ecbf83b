"""The main job: the studies of the report."""

from __future__ import annotations

from comparisons.studies import convergence, stiffness, work_precision
from comparisons.study import Study

CHAINS = (1, 2, 10, 100)
COMPLIANCE = 1e-2
"""Of a whole chain of N links is this over N, of each link this over N^2 [m/N]: 1 kg stretches one link by 10 %."""

SECONDS_PER_RUN = 0.05
ROUNDS = 2
CONVERGENCE_SECONDS_PER_RUN = {1: 0.1, 2: 0.1, 10: 0.25, 100: 0.8}
"""Longer chains reach their asymptotic range later: 100 links only below dt = 3e-5 s."""


def run(*, quiet: bool = False) -> list[Study]:
    """Work-precision and convergence of rigid and compliant chains, and stiffness."""
    studies = []
    for links in CHAINS:
        for compliance in (0.0, COMPLIANCE / links**2):
            scene = {"links": links, "compliance": compliance}
            cap = CONVERGENCE_SECONDS_PER_RUN[links]
            studies.append(convergence.run("pendulum_chain", scene=scene, cap=cap, quiet=quiet))
            studies.append(
                work_precision.run("pendulum_chain", scene=scene, cap=SECONDS_PER_RUN, rounds=ROUNDS, quiet=quiet)
            )
    studies.append(stiffness.run("pendulum_chain", quiet=quiet))
    return studies
