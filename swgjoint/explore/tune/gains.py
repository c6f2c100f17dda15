r"""Controllers with tuned gains, and the textbook rule for comparison.

With a sufficiently stiff drive, motor and link behave like one inertia
:math:`J = J_m + J_l/i^2` at the motor. PD control with

.. math:: k_p = J\omega^2, \quad k_d = 2\zeta J\omega

then has the natural frequency :math:`\omega` and the damping ratio :math:`\zeta`. The
drive limits the bandwidth: with the motor locked, the link oscillates on the stiffness
K of the drive at the anti-resonance :math:`\omega_a = \sqrt{K/J_l}`. The textbook rule
of this file is :math:`\omega = \omega_a/3` and :math:`\zeta = 0.7`, with nominal
inertias and the mean stiffness of the map up to rated torque.

Where the environment has a motor loop, the torque of the controller minus that of the
loop is added, so that the gains of the loop are the rule, and the difference of the two
plans remains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

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
from swgjoint.explore.tune.added import COMPENSATION, LOOP, Compensation
from swgjoint.explore.tune.own import OwnController
from swgjoint.explore.tune.tunable import Act, GainParameter, Tunable
from swgjoint.sim.controller import KnownJoints, KnownLoop, Measured, ReadingAge, Task
from swgjoint.typing import Array

BANDWIDTH, DAMPING = 1.0 / 3.0, 0.7
"""Textbook rule: bandwidth as a fraction of the anti-resonance, and damping ratio."""


@dataclass(frozen=True, kw_only=True)
class PlannedControl:
    """A controller along a plan, and the keys of its tuned parameters."""

    name: str
    text: str
    """Description for messages."""
    plan: Planner
    """Function that plans the motor motion and torque of a task."""
    keys: tuple[str, ...]
    """Keys of the tuned parameters."""
    untuned, content = "by rule", ""
    needs: Mapping[str, Any] = field(default_factory=dict)

    def parameters(
        self, joints: KnownJoints, loop: KnownLoop | None
    ) -> tuple[GainParameter, ...]:
        """Tuned parameters, with bounds for the first joint.

        Before tuning they are gains by the rule or those of the loop, shares of 1, no
        integral, and no delay of the readings.

        Args:
            joints: Joints with their drives and inertias.
            loop: Motor loop to which torques are added, if there is one.
        """
        high = anti_resonance(joints)
        frequency, damping = BANDWIDTH * high, DAMPING
        if loop is not None:
            inertia = motor_inertia(joints)
            omega = float(np.sqrt(loop.stiffness[0] / inertia))
            frequency = omega / (2.0 * np.pi)
            damping = float(loop.damping[0] / (2.0 * omega * inertia))
        known = (
            # 0.1 to 2 times the anti-resonance: softer control follows poorly, stiffer
            # control oscillates
            GainParameter(
                key="frequency_Hz", low=0.1 * high, high=2.0 * high, neutral=frequency
            ),
            GainParameter(key="damping_ratio", low=0.2, high=3.0, neutral=damping),
            GainParameter(key="integral_time_s", low=0.01, high=10.0, neutral=np.inf),
            GainParameter(key="torque_share", low=0.5, high=2.0, neutral=1.0),
            GainParameter(key="friction_share", low=0.3, high=3.0, neutral=1.0),
            GainParameter(key="torsion_share", low=0.5, high=2.0, neutral=1.0),
            # share of the nominal kinematic error, whose phase differs between
            # specimens
            GainParameter(key="error_share", low=0.02, high=2.0, neutral=1.0),
            # a reading taken at t - age is compared with the plan at that time
            GainParameter(key="reading_age_s", low=1e-4, high=4e-3, neutral=0.0),
        )
        return tuple(p for key in self.keys for p in known if p.key == key)

    def gains(
        self, values: Mapping[str, Array], joints: KnownJoints
    ) -> dict[str, Array]:
        """Gains at the motor of the first joint, in SI units.

        Args:
            values: Values of the tuned parameters by key.
            joints: Joints with their inertias and ratios.

        Returns:
            Gains by key with unit, of the same shape as the values.
        """
        inertia = motor_inertia(joints)
        omega = 2.0 * np.pi * values["frequency_Hz"]
        stiffness = inertia * omega**2
        gains = {
            "stiffness_Nm_rad": stiffness,
            "damping_Nms_rad": 2.0 * values["damping_ratio"] * omega * inertia,
        }
        if "integral_time_s" in values:
            gains["integral_Nm_rads"] = stiffness / values["integral_time_s"]
        return gains

    def begin(
        self, values: Mapping[str, Array], task: Task, kept: dict[str, Any]
    ) -> Act:
        """Begin the episodes of all candidates; their plans have common parts.

        Args:
            values: Values of the candidates by key. Shape (n_candidates,) each.
            task: Motions of all episodes.
            kept: Parts of the plans, by name of the controller.
        """
        repeats = len(values["frequency_Hz"])
        count = task.position.shape[1] // repeats
        few = task.select(slice(0, count))
        if self.name not in kept:
            kept[self.name] = parts_of(self, few)
        each = {key: np.repeat(x, count)[:, None] for key, x in values.items()}
        plan = weight_plan(kept[self.name], few, each, repeats=repeats)
        loop = build(plan, each, task.joints.torque_limit)
        # the age of the readings is a tuned parameter, so hide the true one
        loop.start(replace(task, reading_age=ReadingAge()))
        return lambda k, measured, alive: loop.torque(k, measured)


class AddedPID(MotorPID):
    """PID control whose torque replaces that of a motor loop, if the task has one."""

    def start(self, task: Task) -> None:
        """Prepare the motion and the torque of the loop along it."""
        super().start(task)
        self._loop, i = task.loop, task.joints.ratio
        if (loop := task.loop) is not None:
            self._command = (
                loop.stiffness * (i * task.position)
                + loop.damping * (i * task.velocity)
                + loop.feedforward
            )

    def torque(self, k: int, measured: Measured) -> Array:
        """Motor torques in addition to those of the loop [N·m]. Shape (..., n_joints).

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """
        whole, loop = super().torque(k, measured), self._loop
        if loop is None:
            return whole
        by_loop = (
            self._command[k]
            - loop.stiffness * measured.motor_angle
            - loop.damping * measured.motor_speed
        )
        return np.asarray(whole - by_loop)


PLANNED = {
    one.name: one
    for one in (
        PlannedControl(
            name="pd",
            text="PD on the motor angle",
            plan=ideal_plan,
            keys=("frequency_Hz", "damping_ratio"),
        ),
        PlannedControl(
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
        PlannedControl(
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


CONTROLLERS: dict[str, PlannedControl | Compensation] = {
    **PLANNED,
    COMPENSATION.name: COMPENSATION,
}
"""Controllers by name."""


def controller_named(name: Any) -> Tunable:
    """Controller of a tuning run.

    Args:
        name: Name in :data:`CONTROLLERS`, ``FILE.py:NAME``, or a class or function of
            the user, see :class:`~swgjoint.explore.tune.own.OwnController`.

    Raises:
        InputError: If there is no such controller, or if a class of the user has the
            name of another controller.
    """
    if not isinstance(name, str):
        own = OwnController.from_object(name)
        if own.name in (*CONTROLLERS, LOOP.name):
            raise InputError(
                f"controller {own.name!r} of your own: accepted: a name other than"
                f" {', '.join(CONTROLLERS)}"
            )
        return own
    if name in CONTROLLERS:
        return CONTROLLERS[name]
    if ".py:" in name:
        return OwnController.from_file(name)
    raise InputError(
        f"controller {name!r}; accepted: "
        + "; ".join(f"{one.name} ({one.text})" for one in CONTROLLERS.values())
        + "; FILE.py:NAME (a class of your own)"
    )


def anti_resonance(joints: KnownJoints) -> float:
    """Anti-resonance of the first joint: link on its drive, with locked motor [Hz]."""
    stiffness = joints.drives[0].mean_stiffness
    return float(np.sqrt(stiffness / joints.link_inertia[0]) / (2.0 * np.pi))


def motor_inertia(joints: KnownJoints) -> float:
    """Inertia of motor and link of the first joint, at its motor [kg·m²]."""
    return float(
        joints.rotor_inertia[0] + joints.link_inertia[0] / joints.ratio[0] ** 2
    )


def parts_of(tunable: PlannedControl, task: Task) -> tuple[MotorPlan, MotorPlan]:
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
) -> AddedPID:
    """Build the controller of parallel motions.

    Args:
        plan: Weighted plan of all motions.
        values: Values of the tuned parameters, shape (n_motions, 1) each.
        torque_limit: Torque limit of the motors [N·m], used as limit of the integral.
    """
    return AddedPID(
        lambda task: plan,
        frequency=values["frequency_Hz"],
        damping_ratio=values["damping_ratio"],
        integral_time=values.get("integral_time_s"),  # type: ignore[arg-type]
        integral_limit=torque_limit,
    )
