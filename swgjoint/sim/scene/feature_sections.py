"""Tables of a scene file for what a joint need not have: limits, sensors, payload."""

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
    """An angle sensor as the controller reads it."""

    counts_per_turn: Annotated[int, Field(ge=4, le=2**32)] | None = None
    """Resolution; None reads the angle itself. Speed is then its change over a control
    period."""
    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it, which knows it: it holds a reading
    against the command of the instant at which that was taken. A multiple of
    ``step_s``."""
    noise_arcsec: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Standard deviation of every reading, normal, before it is counted. Speed is then
    the change of the angle over a control period, too."""


class TorqueSensor(Section):
    """Behind every drive, for a controller that is given to ``run_scene``."""

    delay_s: Seconds = 0.0
    """Age of a reading when the controller uses it; a multiple of ``step_s``."""
    noise_Nm: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Standard deviation of every reading, normal."""


class SensorsSection(Section):
    """Sensors of every joint; without one an angle reads exactly and at once."""

    motor: Sensor | None = None
    link: Sensor | None = None
    torque: TorqueSensor | None = None
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Of the noise."""


class Payload(Section):
    """A body at the tool site, in the axes of that site."""

    mass_kg: Annotated[float, Field(gt=0, le=1_000)]
    centre_mm: Vector = (
        0.0,
        0.0,
        0.0,
    )
    """Centre of mass."""
    inertia_kgm2: Vector = (
        0.0,
        0.0,
        0.0,
    )
    """About the axes through its centre; zeros: a point mass."""
    known: bool = True
    """Whether the controller's model of the arm has it."""

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
    """A constant torque against a joint for a while, as if somebody leaned on it."""

    kind: Literal["joint_pulse"] = "joint_pulse"
    joint: str
    torque_Nm: Torque
    """On the link, positive along the joint."""
    start_s: Seconds
    duration_s: Positive


class JointSine(Section):
    """A torque on a joint that swings."""

    kind: Literal["joint_sine"] = "joint_sine"
    joint: str
    torque_Nm: Torque
    """Amplitude, on the link."""
    frequency_Hz: Annotated[float, Field(gt=0, le=1_000)]
    start_s: Seconds = 0.0
    duration_s: Positive | None = None
    """None: until the end."""


class ToolForce(Section):
    """A constant force on the tool site for a while."""

    kind: Literal["tool_force"] = "tool_force"
    force_N: Vector
    """In the world."""
    start_s: Seconds
    duration_s: Positive

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if math.hypot(*self.force_N) > 1e6:
            raise Fault(("force_N", f"{list(self.force_N)} N; accepted: <= 1e+06 N"))
        return self


Disturbance = Annotated[JointPulse | JointSine | ToolForce, Field(discriminator="kind")]


def too_fast(frequency: float, step: float) -> list[str]:
    """What to say of a frequency [Hz] that steps of this length [s] cannot carry."""
    highest = 0.1 / step
    if frequency <= highest * (1.0 + 1e-9):
        return []
    return [
        f"{frequency:g} Hz; accepted: at most {highest:g} Hz, ten steps of"
        f" {step:g} s in a period"
    ]


def misfits(
    disturbance: JointPulse | JointSine | ToolForce, *, run: float, step: float
) -> list[tuple[str, str]]:
    """Keys of a disturbance that would have no effect or another one, and why.

    Args:
        disturbance: The table.
        run: Length of the run [s].
        step: Of the scene [s].
    """
    found = []
    if isinstance(disturbance, JointSine):
        fast = too_fast(disturbance.frequency_Hz, step)
        found += [("frequency_Hz", fault) for fault in fast]
    length, start = disturbance.duration_s, disturbance.start_s
    if length is not None and length < step * (1.0 - 1e-9):
        found.append(("duration_s", f"{length:g} s; accepted: >= step_s, {step:g} s"))
    # it acts by its value in the middle of a step
    if start > run - 0.5 * step:
        found.append(
            ("start_s", f"{start:g} s; accepted: before the run ends, at {run:g} s")
        )
    return found
