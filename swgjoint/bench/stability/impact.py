"""Impacts: a link with drive and rotor falls onto a floor.

The rotor initially turns with the link, without torsion. The sum of kinetic, torsion
and gravity energy must not exceed its initial value, because the floor only dissipates
energy, or stores it under compression and returns it.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.bench.stability.joint import RATIO, SAMPLES, Course, Joint, compile_joint
from swgjoint.maps.drive_map import DriveMap

LENGTH = 0.3
"""Distance from the joint to the ball at the end of the link [m]."""
HEIGHT = 0.05
"""Initial angle of the link above its contact with the floor [rad]."""
TIP_SPEED = 1.0
"""Initial speed of the ball towards the floor [m/s]."""
GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""

_BALL = 0.03
"""Radius of the ball [m]."""
_XML = """
<mujoco>
  <option timestep="{step!r}" integrator="discrete" gravity="0 0 -{gravity}"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1" pos="0 0 -{ball}"/>
    <body name="link">
      <joint name="joint" axis="0 -1 0"/>
      <inertial pos="{length} 0 0" mass="{mass!r}"
        diaginertia="{own!r} {own!r} {own!r}"/>
      <geom type="sphere" size="{ball}" pos="{length} 0 0" mass="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def drop_joint(drive: DriveMap, *, rotor: float, link: float, step: float) -> Joint:
    """Joint whose link is a bar with a ball above a floor; see :func:`drop`.

    Args:
        drive: Map of the drive.
        rotor: Inertia of rotor and wave generator [kg·m²].
        link: Inertia of the link about the joint [kg·m²].
        step: Time step [s].
    """
    # almost all of the inertia comes from the mass at the end of the link
    own = 0.01 * link
    text = _XML.format(
        step=step,
        gravity=GRAVITY,
        ball=_BALL,
        length=LENGTH,
        mass=(link - own) / LENGTH**2,
        own=own,
    )
    return compile_joint(text, drive, rotor=rotor, level="full", midpoint=True)


def impact_speed() -> float:
    """Initial rotor speed [rad/s], at which the stability region is checked."""
    return RATIO * TIP_SPEED / LENGTH


def drop(
    joint: Joint, *, duration: float, sub_steps: int, speed: float = 1.0
) -> Course:
    """Let the link fall on the floor and come to rest.

    Args:
        joint: Joint from :func:`drop_joint`.
        duration: Duration of the run [s].
        sub_steps: Number of equal parts of a time step.
        speed: Initial speed of the ball relative to :data:`TIP_SPEED` [-].

    Returns:
        Course whose energy includes gravity, and whose scale is the initial kinetic
        and torsion energy.
    """
    model, law = joint.model, joint.law
    whole = float(model.opt.timestep)
    h = whole / sub_steps
    steps = max(1, round(duration / whole))
    samples = min(SAMPLES, steps)
    every = steps // samples * sub_steps
    try:
        model.opt.timestep = h
        data = mujoco.MjData(model)
        rate = -speed * TIP_SPEED / LENGTH
        theta = law.ratio * HEIGHT
        e0, e_theta, _ = law.error_at(law.phases(theta, HEIGHT))
        x = np.array([theta, HEIGHT + float(e0)])
        v = np.array([rate / (1.0 / law.ratio + float(e_theta)), rate])
        data.qpos[joint.q], data.qvel[joint.v] = x + 0.5 * h * v, v
        q, rates = np.empty((samples + 1, 2)), np.empty((samples + 1, 2))
        q[0], rates[0] = x, v
        for k in range(1, samples + 1):
            mujoco.mj_step(model, data, every)
            rates[k] = data.qvel[joint.v]
            q[k] = data.qpos[joint.q] - 0.5 * h * rates[k]
    finally:
        model.opt.timestep = whole
    bad = any(warning.number for warning in data.warning)
    bad = bad or not (np.isfinite(q).all() and np.abs(rates).max() < 1e9)
    energy = np.full(samples + 1, np.inf)
    if not bad:
        energy = joint.energy(q, rates) + _weight(model, q[:, 1])
    return Course(
        time=np.asarray(np.arange(samples + 1) * (every * h), float),
        position=q,
        velocity=rates,
        energy=energy,
        scale=float(joint.energy(q[:1], rates[:1])[0]),
        diverged=bad,
        sub_steps=sub_steps,
    )


def _weight(model: mujoco.MjModel, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Potential energy of the link due to gravity [J]."""
    mass = float(model.body("link").mass[0])
    return np.asarray(mass * GRAVITY * LENGTH * np.sin(angle))
