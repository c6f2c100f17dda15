"""Optional tables of a scene file: sensors, payload and disturbances."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section

Torque = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Positive = Annotated[float, Field(gt=0)]
Seconds = Annotated[float, Field(ge=0, le=10_000)]


class Sensor(Section):
    """An angle sensor that the controller reads."""

    counts_per_turn: Annotated[int, Field(ge=4, le=2**32)] | None = None
    """Resolution of the reading; if omitted, the angle is not quantised. If the motor
    encoder has a resolution, the motor speed is the change of its reading over a
    control period, divided by that period."""
    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it, a multiple of ``step_s``. The
    controller knows this age and compares a reading with the command at the instant at
    which it was taken."""
    noise_arcsec: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Standard deviation of the normally distributed noise of every reading, before
    quantisation. If the motor encoder has noise, the motor speed is computed from its
    readings in the same way."""


class TorqueSensor(Section):
    """Torque sensor at the output of every drive, read by external controllers only."""

    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it; a multiple of ``step_s``."""
    noise_Nm: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Standard deviation of the normally distributed noise of every reading."""


class SensorsSection(Section):
    """Sensors, the same for every joint."""

    motor: Sensor | None = None
    """Encoder of the motor; if omitted, its readings are exact and have no delay."""
    link: Sensor | None = None
    """Encoder of the link, for ``controller.feedback = "link"``; if omitted, its
    readings are exact and have no delay."""
    torque: TorqueSensor | None = None
    """Torque sensor, for an external controller; if omitted, it gets no torques."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the noise of all sensors."""


class Payload(Section):
    """A body fixed to the tool site."""

    mass_kg: Annotated[float, Field(gt=0, le=1_000)]
    """Mass of the body."""
    centre_mm: Vector = (
        0.0,
        0.0,
        0.0,
    )
    """Centre of mass in the frame of the tool site."""
    inertia_kgm2: Vector = (
        0.0,
        0.0,
        0.0,
    )
    """Moments of inertia about the axes of the tool site, moved to the centre of mass;
    zero for a point mass."""
    known: bool = True
    """Whether the controller's model of the arm includes the payload."""

    @model_validator(mode="after")
    def _is_a_body(self) -> Self:
        if math.hypot(*self.centre_mm) > 10_000.0:
            raise Fault(
                ("centre_mm", f"{list(self.centre_mm)} mm; accepted: up to 10000 mm")
            )
        a, b, c = sorted(self.inertia_kgm2)
        if a < 0.0 or c > 1e6 or a + b < c * (1.0 - 1e-9):
            raise Fault(
                (
                    "inertia_kgm2",
                    f"{list(self.inertia_kgm2)} kg·m²; accepted: 0 to 1e+06, the"
                    " largest not above the sum of the others",
                )
            )
        return self


class JointTorque(Section):
    """Torque on the link of a joint, in N·m or relative to the drive."""

    joint: str
    """Name of the joint."""
    torque_Nm: Torque | None = None
    """Torque on the link, positive along the joint axis; amplitude of a sine, whose
    phase is zero at ``start_s``."""
    rated_fraction: Annotated[float, Field(ge=-5, le=5)] | None = None
    """The same torque as a fraction of the drive's rated torque."""

    @model_validator(mode="after")
    def _one_value(self) -> Self:
        if (self.torque_Nm is None) == (self.rated_fraction is None):
            raise Fault(("torque_Nm", "expected either torque_Nm or rated_fraction"))
        return self

    def scale_to(self, rated_torque: float) -> Self:
        """A copy that states the torque in N·m.

        Args:
            rated_torque: Rated torque of the drive [N·m].
        """
        if self.rated_fraction is None:
            return self
        torque = self.rated_fraction * rated_torque
        return self.model_copy(update={"torque_Nm": torque, "rated_fraction": None})


class JointPulse(JointTorque):
    """A rectangular disturbance-torque pulse on a joint."""

    kind: Literal["joint_pulse"] = "joint_pulse"
    start_s: Seconds
    """Start time of the pulse."""
    duration_s: Positive
    """Duration of the pulse."""


class JointSine(JointTorque):
    """A sinusoidal disturbance torque on a joint."""

    kind: Literal["joint_sine"] = "joint_sine"
    frequency_Hz: Annotated[float, Field(gt=0, le=1_000)]
    """Frequency of the torque."""
    start_s: Seconds = 0.0
    """Start time of the torque."""
    duration_s: Positive | None = None
    """Duration of the torque; if omitted, it lasts until the end of the run."""


class ToolForce(Section):
    """A rectangular force pulse on the tool site."""

    kind: Literal["tool_force"] = "tool_force"
    force_N: Vector
    """Force vector in the world frame."""
    start_s: Seconds
    """Start time of the pulse."""
    duration_s: Positive
    """Duration of the pulse."""

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if math.hypot(*self.force_N) > 1e6:
            raise Fault(("force_N", f"{list(self.force_N)} N; accepted: <= 1e+06 N"))
        return self


Disturbance = Annotated[JointPulse | JointSine | ToolForce, Field(discriminator="kind")]


def too_fast(frequency: float, step: float) -> list[str]:
    """Messages about a frequency that the time step cannot resolve.

    Args:
        frequency: Frequency of a sine [Hz].
        step: Time step of the scene [s].

    Returns:
        One message; an empty list if the step resolves the frequency.
    """
    highest = 0.1 / step
    if frequency <= highest * (1.0 + 1e-9):
        return []
    return [
        f"{frequency:g} Hz; accepted: at most {highest:g} Hz, ten steps of"
        f" {step:g} s per period"
    ]


def misfits(
    disturbance: JointPulse | JointSine | ToolForce, *, run: float, step: float
) -> list[tuple[str, str]]:
    """Faults of a disturbance that the time grid of the run cannot represent.

    Args:
        disturbance: The table of the disturbance.
        run: Duration of the run in whole steps [s].
        step: Time step of the scene [s].

    Returns:
        Pairs of a key of the table and its message.
    """
    faults = []
    if isinstance(disturbance, JointSine):
        fast = too_fast(disturbance.frequency_Hz, step)
        faults += [("frequency_Hz", fault) for fault in fast]
    length, start = disturbance.duration_s, disturbance.start_s
    if length is not None and length < step * (1.0 - 1e-9):
        faults.append(("duration_s", f"{length:g} s; accepted: >= step_s, {step:g} s"))
    # the disturbance of a step is its value at the middle of the step
    if start > run - 0.5 * step:
        faults.append(
            ("start_s", f"{start:g} s; accepted: before the run ends, at {run:g} s")
        )
    return faults
