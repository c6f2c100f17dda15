"""Rotor, tendon and keyframes that a drive adds to a spec."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from swgjoint.joint.native import NativeSpring
from swgjoint.joint.place import Place
from swgjoint.units import deg

ROTOR_MASS = 1e-9
"""Mass of the rotor body [kg]; the arm's model already holds the motor's mass."""
LUMPED_INERTIA = 1e-12
"""Of the body of a lumped rotor [kg·m²]: the engine wants some."""


def add_rotor(
    spec: mujoco.MjSpec,
    place: Place,
    name: str,
    inertia: float,
    ratio: float,
    *,
    lumped: bool,
) -> Any:
    """Rotor body and hinge at the joint's place, nothing inherited from defaults.

    A body turns with the link that carries it, with all that follows from its spin;
    lumped, its kinetic energy is that of its own rotation against that link alone.
    """
    body = place.parent.add_body(name=name, pos=place.pos, quat=place.quat)
    body.explicitinertial = True
    body.mass = ROTOR_MASS
    body.ipos = np.zeros(3)  # unset, it is not written to XML
    # a ball: the spin about the axis is what counts, and no axis needs aligning
    own = min(LUMPED_INERTIA, 1e-3 * inertia) if lumped else inertia
    body.inertia = np.full(3, own)
    hinge = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE)
    hinge.pos = np.zeros(3)
    hinge.axis = place.axis
    hinge.stiffness = np.zeros(3)
    hinge.damping = np.zeros(3)
    hinge.springdamper = np.zeros(2)
    hinge.springyield = 0.0
    hinge.armature = inertia - own
    hinge.frictionloss = 0.0
    hinge.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.ref = place.ref * ratio / (deg if spec.compiler.degree else 1.0)
    place.joint.armature = 0.0
    _extend_keys(spec, name, place.joint.name, ratio)
    return body


def add_tendon(
    spec: mujoco.MjSpec,
    name: str,
    rotor: str,
    link: str,
    ratio: float,
    stiffness: tuple[float, float, float],
    damping: float,
    springyield: float = 0.0,
    coefficients: tuple[float, float] | None = None,
) -> None:
    """Fixed tendon of length theta/i - psi, nothing inherited from defaults.

    With ``coefficients`` its length is that sum of theta and psi instead.
    """
    tendon = spec.add_tendon(name=name)
    tendon.stiffness = np.array(stiffness)
    tendon.damping = np.array([damping, 0.0, 0.0])
    tendon.springlength = np.zeros(2)
    tendon.springyield = springyield
    tendon.armature = 0.0
    tendon.frictionloss = 0.0
    tendon.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    tendon.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    by_theta, by_psi = coefficients or (1.0 / ratio, -1.0)
    tendon.wrap_joint(rotor, by_theta)
    if by_psi:
        tendon.wrap_joint(link, by_psi)


def add_native(
    spec: mujoco.MjSpec,
    spring: NativeSpring,
    name: str,
    rotor: str,
    link: str,
    ratio: float,
    damping: float,
) -> tuple[str, ...]:
    """Polynomial spring, Jenkin tendons and rotor friction; only what there is.

    Returns:
        Names of the Jenkin tendons.
    """
    add_tendon(
        spec, name, rotor, link, ratio, (spring.linear, 0.0, spring.cubic), damping
    )
    if spring.friction:
        spec.joint(rotor).frictionloss = spring.friction
    if spring.viscous:
        spec.joint(rotor).damping[0] = spring.viscous
    names = tuple(f"{link}_hysteresis{k}" for k in range(len(spring.hysteresis)))
    for one, element in zip(names, spring.hysteresis, strict=True):
        add_tendon(
            spec,
            one,
            rotor,
            link,
            ratio,
            (element.stiffness, 0.0, 0.0),
            0.0,
            springyield=element.yield_torque / element.stiffness,
        )
    return names


def _extend_keys(spec: mujoco.MjSpec, rotor: str, link: str, ratio: float) -> None:
    """Give every keyframe the rotor's position and velocity, without torsion."""
    if not any(len(key.qpos) or len(key.qvel) for key in spec.keys):
        return
    bare = spec.copy()
    for key in list(bare.keys):
        bare.delete(key)
    model = bare.compile()
    m, j = model.joint(rotor), model.joint(link)
    for field, old, new in (
        ("qpos", int(j.qposadr[0]), int(m.qposadr[0])),
        ("qvel", int(j.dofadr[0]), int(m.dofadr[0])),
    ):
        size = model.nq if field == "qpos" else model.nv
        # addresses after the rotor have moved up by one
        source = old - (old > new)
        for key in spec.keys:
            values = list(getattr(key, field))
            if len(values) == size - 1:
                values.insert(new, ratio * values[source])
                setattr(key, field, values)
