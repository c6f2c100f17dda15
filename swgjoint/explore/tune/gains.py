r"""Controllers with tuned gains, and the textbook rule for comparison.

With a sufficiently stiff drive, motor and link behave like one inertia
:math:`J = J_m + J_l/i^2` at the motor. PD control with

.. math:: k_p = J\omega^2, \quad k_d = 2\zeta J\omega

then has the natural frequency :math:`\omega` and the damping ratio :math:`\zeta`. The
drive limits the bandwidth: with the motor locked, the link oscillates on the stiffness
K of the drive at the anti-resonance :math:`\omega_a = \sqrt{K/J_l}`. The textbook rule
of this file is :math:`\omega = \omega_a/3` and :math:`\zeta = 0.7`, with nominal
inertias and the mean stiffness of the map up to rated torque.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import (
    MotorPID,
    MotorPlan,
    Planner,
    ideal_plan,
    known_friction,
    rigid_plan,
)
from swgjoint.errors import InputError
from swgjoint.sim.controller import KnownJoints, Task
from swgjoint.typing import Array

BANDWIDTH, DAMPING = 1.0 / 3.0, 0.7
"""Textbook rule: bandwidth as a fraction of the anti-resonance, and damping ratio."""


@dataclass(frozen=True, kw_only=True)
class GainParameter:
    """One tuned number, on a logarithmic scale between two bounds."""

    key: str
    """Name that ends with the unit; without a unit the parameter is dimensionless."""
    low: float
    """Lower bound, in the unit of the key."""
    high: float
    """Upper bound, in the unit of the key."""
    neutral: float
    """Value before tuning, in the unit of the key: gains by the rule, shares of 1, no
    integral, no delay of the readings."""

    def value(self, place: Array) -> Array:
        """Values at relative positions between the bounds, 0 to 1."""
        return np.asarray(self.low * (self.high / self.low) ** place)

    @property
    def start(self) -> float:
        """Relative position of the neutral value, 0 to 1; clipped to the bounds."""
        inside = min(max(self.neutral, self.low), self.high)
        return float(np.log(inside / self.low) / np.log(self.high / self.low))


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """A named controller and the keys of its tuned parameters."""

    name: str
    text: str
    """Description for messages."""
    plan: Planner
    """Function that plans the motor motion and torque of a task."""
    keys: tuple[str, ...]
    """Keys of the tuned parameters."""


CONTROLLERS = {
    one.name: one
    for one in (
        Tunable(
            name="pd",
            text="PD on the motor angle",
            plan=ideal_plan,
            keys=("frequency_Hz", "damping_ratio"),
        ),
        Tunable(
            name="pd-feedforward",
            text="PID with feed-forward of torque and friction of a rigid drive",
            plan=rigid_plan,
            keys=(
                "frequency_Hz",
                "damping_ratio",
                "integral_time_s",
                "torque_share",
                "friction_share",
                "reading_age_s",
            ),
        ),
        Tunable(
            name="pd-flexible",
            text="PID with feed-forward of torque, friction and torsion of the map",
            plan=flexible_plan,
            keys=(
                "frequency_Hz",
                "damping_ratio",
                "integral_time_s",
                "torque_share",
                "friction_share",
                "reading_age_s",
                "torsion_share",
                "error_share",
            ),
        ),
    )
}


def controller_named(name: str) -> Tunable:
    """Look up one of :data:`CONTROLLERS`.

    Raises:
        InputError: If the name is unknown.
    """
    if name not in CONTROLLERS:
        raise InputError(
            f"controller {name!r}; accepted: "
            + "; ".join(f"{one.name} ({one.text})" for one in CONTROLLERS.values())
        )
    return CONTROLLERS[name]


def anti_resonance(joints: KnownJoints) -> float:
    """Anti-resonance of the first joint: link on its drive, with locked motor [Hz]."""
    stiffness = joints.drives[0].mean_stiffness
    return float(np.sqrt(stiffness / joints.link_inertia[0]) / (2.0 * np.pi))


def parameters_of(tunable: Tunable, joints: KnownJoints) -> tuple[GainParameter, ...]:
    """Tuned parameters of a controller, with bounds for the first joint.

    Args:
        tunable: Controller.
        joints: Joints with their drives and inertias.
    """
    high = anti_resonance(joints)
    known = (
        # 0.1 to 2 times the anti-resonance: softer control follows poorly, stiffer
        # control oscillates
        GainParameter(
            key="frequency_Hz",
            low=0.1 * high,
            high=2.0 * high,
            neutral=BANDWIDTH * high,
        ),
        GainParameter(key="damping_ratio", low=0.2, high=3.0, neutral=DAMPING),
        GainParameter(key="integral_time_s", low=0.01, high=10.0, neutral=np.inf),
        GainParameter(key="torque_share", low=0.5, high=2.0, neutral=1.0),
        GainParameter(key="friction_share", low=0.3, high=3.0, neutral=1.0),
        GainParameter(key="torsion_share", low=0.5, high=2.0, neutral=1.0),
        # share of the nominal kinematic error, whose phase differs between specimens
        GainParameter(key="error_share", low=0.02, high=2.0, neutral=1.0),
        # a reading taken at t - age is compared with the plan at that time
        GainParameter(key="reading_age_s", low=1e-4, high=4e-3, neutral=0.0),
    )
    return tuple(p for key in tunable.keys for p in known if p.key == key)


def textbook(joints: KnownJoints) -> dict[str, Array]:
    """Parameter values of plain PD control by the rule, shape (1,) each."""
    pd = parameters_of(CONTROLLERS["pd"], joints)
    return {p.key: np.array([p.neutral]) for p in pd}


def gains_of(values: Mapping[str, Array], joints: KnownJoints) -> dict[str, Array]:
    """Gains at the motor of the first joint, in SI units.

    Args:
        values: Values of the tuned parameters by key.
        joints: Joints with their inertias and ratios.

    Returns:
        Gains by key with unit, of the same shape as the values.
    """
    ratio, rotor = joints.ratio[0], joints.rotor_inertia[0]
    inertia = rotor + joints.link_inertia[0] / ratio**2
    omega = 2.0 * np.pi * values["frequency_Hz"]
    stiffness = inertia * omega**2
    gains = {
        "stiffness_Nm_rad": stiffness,
        "damping_Nms_rad": 2.0 * values["damping_ratio"] * omega * inertia,
    }
    if "integral_time_s" in values:
        gains["integral_Nm_rads"] = stiffness / values["integral_time_s"]
    return gains


def parts_of(tunable: Tunable, task: Task) -> tuple[MotorPlan, MotorPlan]:
    """Split the plan of a controller into a mean part and an angle-dependent part.

    The first part is the plan for the mean torsion curve of the drives, without
    kinematic error. The second part is added to it and contains the angle-dependent
    functions of the drives; it is zero if the controller has no ``error_share``.

    Args:
        tunable: Controller.
        task: Motions and joints.
    """
    plan = tunable.plan(task)
    if "error_share" not in tunable.keys:
        zero = np.zeros_like(plan.angle)
        return plan, MotorPlan(angle=zero, speed=zero, torque=zero)
    drives = tuple(
        drive.with_harmonics(np.zeros(len(drive.orders), dtype=bool))
        for drive in task.joints.drives
    )
    even = tunable.plan(replace(task, joints=replace(task.joints, drives=drives)))
    return even, MotorPlan(
        angle=plan.angle - even.angle,
        speed=plan.speed - even.speed,
        torque=plan.torque - even.torque,
    )


def weight_plan(
    parts: tuple[MotorPlan, MotorPlan],
    task: Task,
    values: Mapping[str, Array],
    repeats: int = 1,
) -> MotorPlan:
    """Plan with weighted parts.

    Args:
        parts: Parts of the plan of the task, see :func:`parts_of`.
        task: Motions of the episodes, which are the second axis of its arrays.
        values: Shares and age of the readings [s] by key, shape (n_motions, 1) each. A
            missing share is 1, a missing age zero.
        repeats: Number of candidates, for each of which the motions are repeated.
    """
    (even, uneven), joints, i = parts, task.joints, task.joints.ratio
    one = np.ones(1)
    torsion, error, torque, rubs = (
        values.get(f"{key}_share", one)
        for key in ("torsion", "error", "torque", "friction")
    )

    def tiled(x: Array) -> Array:
        return np.tile(x, (1, repeats, 1))

    angle, speed = tiled(i * task.position), tiled(i * task.velocity)
    angle = angle + torsion * (tiled(even.angle) - angle) + error * tiled(uneven.angle)
    speed = speed + torsion * (tiled(even.speed) - speed) + error * tiled(uneven.speed)
    if "reading_age_s" in values:
        change = np.gradient(even.speed + uneven.speed, task.period, axis=0)
        angle = angle - values["reading_age_s"] * speed
        speed = speed - values["reading_age_s"] * tiled(change)
    friction = np.zeros_like(even.torque)
    if "friction_share" in values:
        friction = known_friction(joints, even.speed, task.velocity, task.link_torque)
    return MotorPlan(
        angle=angle,
        speed=speed,
        torque=torque * tiled(even.torque - friction)
        + rubs * tiled(friction)
        + error * tiled(uneven.torque),
    )


def build(
    plan: MotorPlan, values: Mapping[str, Array], torque_limit: Array
) -> MotorPID:
    """Build the controller of parallel motions.

    Args:
        plan: Weighted plan of all motions.
        values: Values of the tuned parameters, shape (n_motions, 1) each.
        torque_limit: Torque limit of the motors [N·m], used as limit of the integral.
    """
    return MotorPID(
        lambda task: plan,
        frequency=values["frequency_Hz"],
        damping_ratio=values["damping_ratio"],
        integral_time=values.get("integral_time_s"),  # type: ignore[arg-type]
        integral_limit=torque_limit,
    )
