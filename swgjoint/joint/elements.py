"""Rotor, tendon and keyframes that a drive adds to a spec."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from swgjoint.joint.drive import JointDrive
from swgjoint.joint.native import NativeSpring
from swgjoint.joint.place import ROTOR_MASS, DrivePlace, Rotor
from swgjoint.units import deg

SOLREF = (0.02, 1.0)
SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's constraint defaults: ``SOLREF`` is time constant [s] and damping ratio [-],
``SOLIMP`` the impedance."""


def add_rotor(
    spec: mujoco.MjSpec, place: DrivePlace, name: str, rotor: Rotor
) -> tuple[Any, Any]:
    """Add the rotor body and its hinge, which inherit no defaults, at the joint.

    A gyroscopic rotor moves with the link that carries it and exerts gyroscopic torques
    on it. A lumped rotor has only the kinetic energy of its rotation relative to that
    link.

    Args:
        spec: The model, which is changed.
        place: Joint that gets the drive.
        name: Name of the body and of its hinge.
        rotor: Inertia of the rotor and whether it is lumped.

    Returns:
        Body and hinge of the rotor.
    """
    body = place.parent.add_body(name=name, pos=place.pos, quat=place.quat)
    body.explicitinertial = True
    body.mass = ROTOR_MASS
    body.ipos = np.zeros(3)  # an unset value is not written to XML
    # isotropic: only the spin about the axis matters, so no frame has to be aligned
    body.inertia = np.full(3, rotor.body)
    hinge = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE)
    hinge.pos = np.zeros(3)
    hinge.axis = place.axis
    hinge.stiffness = np.zeros(3)
    hinge.damping = np.zeros(3)
    hinge.springdamper = np.zeros(2)
    hinge.springyield = 0.0
    hinge.armature = rotor.inertia - rotor.body
    hinge.frictionloss = 0.0
    # used by the friction loss at level native
    hinge.solref_friction = np.array(SOLREF)
    hinge.solimp_friction = np.array(SOLIMP)
    hinge.actgravcomp = False
    hinge.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.ref = place.ref * rotor.ratio / (deg if spec.compiler.degree else 1.0)
    hinge.userdata = np.zeros(0)
    place.joint.armature = 0.0
    return body, hinge


def add_tendon(
    spec: mujoco.MjSpec,
    name: str,
    rotor: str,
    link: str,
    ratio: float,
    stiffness: tuple[float, float, float],
    damping: float,
    springyield: float = 0.0,
    dead_band: float = 0.0,
    coefficients: tuple[float, float] | None = None,
) -> Any:
    """Add a fixed tendon of length theta/i - psi that inherits no defaults.

    Args:
        spec: The model, which is changed.
        name: Name of the tendon.
        rotor: Name of the rotor joint.
        link: Name of the link joint.
        ratio: Signed ratio i of the drive [-].
        stiffness: Polynomial coefficients of the spring, for powers 0 to 2 of the
            length [N·m/rad, N·m/rad², N·m/rad³].
        damping: Torque per rate of the length [N·m·s/rad].
        springyield: Length at which the spring yields [rad]; zero: never.
        dead_band: Half width of the band without spring torque [rad].
        coefficients: Factors of theta and psi in the length; (1/i, -1) if None [-].

    Returns:
        The tendon.
    """
    tendon = spec.add_tendon(name=name)
    tendon.stiffness = np.array(stiffness)
    tendon.damping = np.array([damping, 0.0, 0.0])
    tendon.springlength = np.array([-dead_band, dead_band])
    tendon.springyield = springyield
    tendon.armature = 0.0
    tendon.frictionloss = 0.0
    tendon.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    tendon.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    tendon.userdata = np.zeros(0)
    by_theta, by_psi = coefficients or (1.0 / ratio, -1.0)
    tendon.wrap_joint(rotor, by_theta)
    if by_psi:
        tendon.wrap_joint(link, by_psi)
    return tendon


def add_native(
    spec: mujoco.MjSpec,
    drive: JointDrive,
    spring: NativeSpring,
    rotor: Any,
) -> None:
    """Add the springs, Jenkin elements and rotor friction of a drive at ``native``.

    Args:
        spec: The model, which is changed.
        drive: The drive.
        spring: Native springs fitted to its map.
        rotor: Hinge of the rotor.
    """
    assert drive.tendon is not None
    pair = rotor.name, drive.joint, drive.ratio
    polynomial = spring.linear, 0.0, spring.cubic
    add_tendon(spec, drive.tendon, *pair, polynomial, drive.damping)
    for one, corner in zip(drive.corners, spring.corners, strict=True):
        lines = corner.stiffness, 0.0, 0.0
        add_tendon(spec, one, *pair, lines, 0.0, dead_band=corner.torsion)
    if spring.friction:
        rotor.frictionloss = spring.friction
    if spring.viscous:
        rotor.damping[0] = spring.viscous
    for one, element in zip(drive.hysteresis, spring.hysteresis, strict=True):
        add_tendon(
            spec,
            one,
            *pair,
            (element.stiffness, 0.0, 0.0),
            0.0,
            springyield=element.yield_torque / element.stiffness,
        )


def has_positions(spec: mujoco.MjSpec) -> bool:
    """Whether a keyframe states positions or velocities."""
    return any(len(key.qpos) or len(key.qvel) for key in spec.keys)


def extend_keys(spec: mujoco.MjSpec, drives: Iterable[JointDrive]) -> None:
    """Add the rotors to every keyframe, with positions and velocities at zero torsion.

    Args:
        spec: The model, which is changed.
        drives: Its drives.
    """
    rotors = [(d.rotor, d.joint, d.ratio) for d in drives if d.rotor is not None]
    if not rotors or not has_positions(spec):
        return
    bare = spec.copy()
    for key in list(bare.keys):
        bare.delete(key)
    model = bare.compile()
    for field, size, address in (
        ("qpos", model.nq, "qposadr"),
        ("qvel", model.nv, "dofadr"),
    ):
        new, link = (
            [int(getattr(model.joint(row[k]), address)[0]) for row in rotors]
            for k in (0, 1)
        )
        old = np.setdiff1d(np.arange(size), new)
        for key in spec.keys:
            values = np.asarray(getattr(key, field), float)
            if len(values) == len(old):
                full = np.zeros(size)
                full[old] = values
                full[new] = [
                    row[2] * full[k] for row, k in zip(rotors, link, strict=True)
                ]
                setattr(key, field, full.tolist())
