"""What MuJoCo does that no setting shows: a run that has blown up starts anew."""

from __future__ import annotations

from typing import Any

from comparisons.record import Finding

STEPS, STEP = 100, 1.0
STIFFNESS = 1e3
"""N/m on 1 kg: far beyond what a step of 1 s is stable for."""


def find() -> list[Finding]:
    """The same run with and without the restart."""
    return [_clock(is_restarted=True), _clock(is_restarted=False)]


def _clock(*, is_restarted: bool) -> Finding:
    """A mass on a spring, with far too large a step: what the clock says after all steps."""
    import mujoco

    from comparisons.engines.mujoco import be_quiet

    mujoco.set_mju_user_warning(be_quiet)
    model = _unstable(mujoco, 0 if is_restarted else int(mujoco.mjtDisableBit.mjDSBL_AUTORESET))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, STEPS)
    asked = "as it comes" if is_restarted else "with AUTORESET switched off"
    restarted = "trap: a run that blows up starts anew, without an error, and looks fine"
    return Finding(
        what=f"clock after {STEPS} steps of {STEP:g} s of a run that blows up, {asked}",
        expected=STEPS * STEP,
        found=float(data.time),
        unit="s",
        verdict=restarted if data.time < STEPS * STEP else "goes on, and its state is not finite",
    )


def _unstable(mujoco: Any, disabled: int) -> Any:
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.disableflags = STEP, disabled
    body = spec.worldbody.add_body(pos=[1.0, 0.0, 0.0])
    body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0] * 3
    joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    joint.stiffness, joint.springref = [STIFFNESS, 0.0, 0.0], 0.1
    return spec.compile()
