"""What MuJoCo does that no setting shows: runs start anew, masses lie elsewhere, slides hop, what sticks creeps."""

from __future__ import annotations

import math
from typing import Any

from comparisons.record import Finding

STEPS, STEP = 100, 1.0
STIFFNESS = 1e3
"""N/m on 1 kg: far beyond what a step of 1 s is stable for."""

G, FINE = 9.81, 1.0 / 240.0


def find() -> list[Finding]:
    """Each in a model of its own."""
    return [_clock(is_restarted=True), _clock(is_restarted=False), _centre(), _hop(2.0), _hop(20.0), _creep()]


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


def _centre() -> Finding:
    """A body at x = 1 whose mass and inertia are given, but not where its centre of mass is."""
    import mujoco

    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(pos=[1.0, 0.0, 0.0])
    body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0] * 3
    body.add_freejoint()
    found = float(spec.compile().body_ipos[1, 0])
    return Finding(
        what="centre of mass, from the origin of a body at 1 m that is given a mass and an inertia in an MjSpec",
        expected=0.0,
        found=found,
        unit="m",
        verdict="trap: it is the body's own position once more, unless ipos is set" if found > 0.5 else "as meant",
    )


def _hop(steps: float) -> Finding:
    """A cube of 1 m slides over level ground at 5 m/s, friction 0.5: how high it comes."""
    import mujoco

    model = _cube(mujoco, 0.0, solref=[steps * FINE, 1.0])
    data = mujoco.MjData(model)
    data.qvel[0], height = 5.0, 0.0
    for _ in range(round(1.0 / FINE)):
        mujoco.mj_step(model, data)
        height = max(height, float(data.qpos[2]) - 0.5)
    return Finding(
        what=f"height to which a cube that slides at 5 m/s hops, time constant {steps:g} steps, dt 1/240 s",
        expected=0.0,
        found=height,
        unit="m",
        verdict="trap: friction lifts what slides, at any step, if the time constant is a few steps"
        if height > 0.05
        else "hops little",
    )


def _creep() -> Finding:
    """A cube of 1 m on a slope of 26 degrees, friction 0.5, whose limit is 26.57: how far it goes in 10 s."""
    import mujoco

    model = _cube(mujoco, math.radians(26.0))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(10.0 / FINE))
    found = float(data.qpos[0])
    return Finding(
        what="way in 10 s of a cube that friction holds on a slope, dt 1/240 s",
        expected=0.0,
        found=found,
        unit="m",
        verdict="trap: soft contacts creep; an elliptic cone and a high impratio hold" if found > 1e-3 else "held",
    )


def _cube(mujoco: Any, slope: float, **contact: Any) -> Any:
    """A free cube of 1 m and 1 kg at rest on the plane z = 0, which falls towards +x by ``slope`` [rad]."""
    mujoco.set_mju_user_warning(lambda _: None)
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = FINE, [G * math.sin(slope), 0.0, -G * math.cos(slope)]
    touching = {"friction": [0.5, 0.005, 0.0001], **contact}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], **touching)
    body = spec.worldbody.add_body(pos=[0.0, 0.0, 0.5])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5] * 3, mass=1.0, **touching)
    return spec.compile()
