"""Optional tables of a scene file: sensors, payload, disturbances."""

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
    """Resolution; None reads the exact angle. With a resolution, the speed is the
    change of the reading over a control period."""
    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it. The controller knows the age: it
    compares a reading with the command of the instant at which it was taken. A multiple
    of ``step_s``."""
    noise_arcsec: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Standard deviation of the normally distributed noise of every reading, before
    quantisation. With noise, the speed is the change of the reading over a control
    period."""


class TorqueSensor(Section):
    """Torque sensor at the output of every drive, for a controller of ``run_scene``."""

    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it; a multiple of ``step_s``."""
    noise_Nm: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Standard deviation of the normally distributed noise of every reading."""


class SensorsSection(Section):
    """Sensors of every joint; without one the reading is exact and has no delay."""

    motor: Sensor | None = None
    link: Sensor | None = None
    torque: TorqueSensor | None = None
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the noise."""


class Payload(Section):
    """A body at the tool site, in the axes of that site."""

    mass_kg: Annotated[float, Field(gt=0, le=1_000)]
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
    """Moments of inertia about the axes through the centre of mass; zero for a point
    mass."""
    known: bool = True
    """Whether the controller's model of the arm includes the payload."""

    @model_validator(mode="after")
    def _is_a_body(self) -> Self:
        if math.hypot(*self.centre_mm) > 10_000.0:
            raise Fault(
                ("centre_mm", f"{list(self.centre_mm)} mm; accepted: within 10000 mm")
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


class JointPulse(Section):
    """A rectangular disturbance-torque pulse on a joint."""

    kind: Literal["joint_pulse"] = "joint_pulse"
    joint: str
    torque_Nm: Torque
    """Torque on the link, positive along the joint axis."""
    start_s: Seconds
    duration_s: Positive


class JointSine(Section):
    """A sinusoidal disturbance torque on a joint."""

    kind: Literal["joint_sine"] = "joint_sine"
    joint: str
    torque_Nm: Torque
    """Amplitude of the torque on the link."""
    frequency_Hz: Annotated[float, Field(gt=0, le=1_000)]
    start_s: Seconds = 0.0
    duration_s: Positive | None = None
    """Duration; None lasts until the end of the run."""


class ToolForce(Section):
    """A rectangular force pulse on the tool site."""

    kind: Literal["tool_force"] = "tool_force"
    force_N: Vector
    """Force vector in the world frame."""
    start_s: Seconds
    duration_s: Positive

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if math.hypot(*self.force_N) > 1e6:
            raise Fault(("force_N", f"{list(self.force_N)} N; accepted: <= 1e+06 N"))
        return self


Disturbance = Annotated[JointPulse | JointSine | ToolForce, Field(discriminator="kind")]


def too_fast(frequency: float, step: float) -> list[str]:
    """Fault of a frequency that the time step cannot resolve.

    Args:
        frequency: Frequency of a sine [Hz].
        step: Time step of the scene [s].

    Returns:
        One message, or none if the step resolves the frequency.
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
    """Faults of a disturbance that would have no effect or a wrong one.

    Args:
        disturbance: The table of the disturbance.
        run: Duration of the run [s].
        step: Time step of the scene [s].

    Returns:
        Keys of the table, each with its message.
    """
    faults = []
    if isinstance(disturbance, JointSine):
        fast = too_fast(disturbance.frequency_Hz, step)
        faults += [("frequency_Hz", fault) for fault in fast]
    length, start = disturbance.duration_s, disturbance.start_s
    if length is not None and length < step * (1.0 - 1e-9):
        faults.append(("duration_s", f"{length:g} s; accepted: >= step_s, {step:g} s"))
    # the value in the middle of a step acts
    if start > run - 0.5 * step:
        faults.append(
            ("start_s", f"{start:g} s; accepted: before the run ends, at {run:g} s")
        )
    return faults
