"""What PyBullet does that no setting shows: hidden damping, dropped links, clamped rates, and contacts."""

from __future__ import annotations

from typing import Any

from comparisons.engines._pybullet_contact_findings import contacts
from comparisons.record import Finding

DAMPING = 0.04
G, STEP, STEPS = 9.81, 0.01, 100
LINKS = 200
RATE = 500.0
SINGLE_PRECISION = 1e-6
"""Its default damping is stored as a float."""
UNROTATED = (0.0, 0.0, 0.0, 1.0)


def find() -> list[Finding]:
    """Each in a client of its own."""
    from comparisons.engines.pybullet import load

    bullet = load()
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setTimeStep(STEP, client)
        found = [_joint_rate(bullet, client), _links(bullet, client), _fall(bullet, client)]
    finally:
        bullet.disconnect(client)
    return found + contacts(bullet)


def _fall(bullet: Any, client: int) -> Finding:
    """v <- v + h (g - c v (1 + |v|)) and then x <- x + h v, with c = 0.04 that nobody asked for."""
    bullet.setGravity(0.0, -G, 0.0, physicsClientId=client)
    body = bullet.createMultiBody(baseMass=1.0, physicsClientId=client)
    speed = fallen = 0.0
    for _ in range(STEPS):
        bullet.stepSimulation(client)
        speed += STEP * (G - DAMPING * speed * (1.0 + speed))
        fallen += STEP * speed
    found = -bullet.getBasePositionAndOrientation(body, client)[0][1]
    return Finding(
        what="free fall for 1 s of a body as it is made, dt 0.01 s",
        expected=0.5 * G,
        found=found,
        unit="m",
        verdict=f"trap: damped by c v (1 + |v|), c = {DAMPING:g}/s, which must give {fallen:.6f} m; set it to 0"
        if abs(found - fallen) < SINGLE_PRECISION
        else "explained by no closed form known here",
    )


def _links(bullet: Any, client: int) -> Finding:
    body = _chain(bullet, client, LINKS)
    found = bullet.getNumJoints(body, client)
    return Finding(
        what=f"links of a multi-body made with {LINKS}",
        expected=LINKS,
        found=found,
        unit="links",
        verdict="trap: the rest is dropped without a word" if found < LINKS else "as asked",
    )


def _joint_rate(bullet: Any, client: int) -> Finding:
    """A free hinge that spins, before gravity is set."""
    body = _chain(bullet, client, 1)
    bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)
    bullet.changeDynamics(body, 0, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
    bullet.resetJointState(body, 0, 0.0, RATE, client)
    bullet.stepSimulation(client)
    found = bullet.getJointState(body, 0, client)[1]
    return Finding(
        what=f"rate of a free hinge that was given {RATE:g} rad/s, one step later",
        expected=RATE,
        found=found,
        unit="rad/s",
        verdict="trap: clamped without a word; raise maxJointVelocity" if found < RATE else "kept",
    )


def _chain(bullet: Any, client: int, links: int) -> int:
    down = [[0.0, -1.0, 0.0]] * links
    body: int = bullet.createMultiBody(
        baseMass=0.0,
        linkMasses=[1.0] * links,
        linkCollisionShapeIndices=[-1] * links,
        linkVisualShapeIndices=[-1] * links,
        linkPositions=[[0.0, 0.0, 0.0], *down[1:]],
        linkOrientations=[UNROTATED] * links,
        linkInertialFramePositions=down,
        linkInertialFrameOrientations=[UNROTATED] * links,
        linkParentIndices=list(range(links)),
        linkJointTypes=[bullet.JOINT_REVOLUTE] * links,
        linkJointAxis=[(0.0, 0.0, 1.0)] * links,
        physicsClientId=client,
    )
    return body
