"""The tables of a scene file, with the same names as in the file."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.joint.region import MAX_SUB_STEPS

Integrator = Literal["discrete", "RK4"]
FeedForward = Literal["none", "gravity", "gravity_inertia"]
ControlKind = Literal["pd", "pid", "computed_torque"]

Signal = Literal[
    "output_torque_Nm",
    "torque_deviation_Nm",
    "motor_torque_Nm",
    "torsion_arcmin",
    "transmission_error_arcmin",
    "position_deg",
    "reference_deg",
]
"""Of a joint in a recording."""

Positive = Annotated[float, Field(gt=0)]
Several = Field(strict=False)


class ControllerSection(Section):
    r"""Position control of every motor on its own encoder.

    ``pd`` and, with the integral of the error, ``pid``:

    .. math:: \tau = k_p e + k_d \dot e + k_i \int e\,dt + \tau_\text{ff}, \quad
        e = i q_r - \theta.

    Gains either from a natural frequency and a damping ratio, which hold for a rigid
    drive, :math:`k_p = J\omega^2`, :math:`k_d = 2\zeta J\omega` with
    :math:`J = J_m + J_l(q_0)/i^2`, or given outright; :math:`k_i = k_p/T_i`.

    ``computed_torque`` is the inverse dynamics of the rigid arm (M, h) with its rotors
    (J) at the measured motion, motor angles over the ratio:

    .. math:: \tau = \left(M a + h\right)/i + i J a, \quad
        a = \ddot q_r + 2\zeta\omega(\dot q_r - \dot\theta/i)
        + \omega^2(q_r - \theta/i).
    """

    kind: ControlKind = "pd"
    natural_frequency_Hz: Annotated[float, Field(gt=0, le=1_000)] | None = None
    damping_ratio: Annotated[float, Field(gt=0, le=10)] | None = None
    stiffness_Nm_rad: Annotated[float, Field(gt=0)] | None = None
    """Motor side, N·m of motor torque per rad of motor angle."""
    damping_Nms_rad: Annotated[float, Field(ge=0)] | None = None
    integral_time_s: Positive | None = None
    """Of ``pid``; None: 4 over the loop's natural frequency in rad/s."""
    integral_limit_Nm: Positive | None = None
    """Largest motor torque of the integral; None: that of the rated torque."""
    feedforward: FeedForward = "gravity"
    """Torques of the rigid arm on the reference motion, and of the constant load."""
    control_period_s: Positive | None = None
    """Given, the loop is computed once a period and its torque held; a multiple of
    ``step_s``. None: ``pd`` and ``pid`` act within every step of the engine, a loop
    that must be sampled (computed torque, sensors, link feedback) once a step."""
    feedback: Literal["motor", "link"] = "motor"
    """Whose angle the position error is taken from; the speed is the motor's."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        faults = []
        by_frequency = (self.natural_frequency_Hz, self.damping_ratio)
        by_gain = (self.stiffness_Nm_rad, self.damping_Nms_rad)
        if by_gain != (None, None) and (
            None in by_gain or by_frequency != (None, None)
        ):
            faults.append(
                (
                    "stiffness_Nm_rad",
                    "accepted: stiffness_Nm_rad with damping_Nms_rad, or"
                    " natural_frequency_Hz with damping_ratio, not both",
                )
            )
        if self.kind == "computed_torque" and by_gain != (None, None):
            faults.append(
                (
                    "stiffness_Nm_rad",
                    "with computed_torque; accepted: natural_frequency_Hz with"
                    " damping_ratio",
                )
            )
        for key in ("integral_time_s", "integral_limit_Nm"):
            if self.kind != "pid" and getattr(self, key) is not None:
                faults.append((key, f"with {self.kind}; accepted: with pid"))
        if faults:
            raise Fault(*faults)
        return self


class LoadSection(Section):
    """Constant torque of the load against a joint; the drive exerts the same."""

    torque_Nm: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    rated_fraction: Annotated[float, Field(ge=-5, le=5)] | None = None
    """Share of the drive's rated torque."""

    @model_validator(mode="after")
    def _one_value(self) -> Self:
        if (self.torque_Nm is None) == (self.rated_fraction is None):
            raise Fault(("torque_Nm", "accepted: either torque_Nm or rated_fraction"))
        return self


class Simulation(Section):
    """Duration and time stepping."""

    duration_s: Annotated[float, Field(gt=0, le=10_000)]
    step_s: Annotated[float, Field(ge=1e-6, le=0.02)] = 0.001
    integrator: Integrator = "discrete"
    max_sub_steps: Annotated[int, Field(ge=1, le=1_000)] = MAX_SUB_STEPS
    """Equal parts that a step may be cut into where the integration of a joint asks for
    it; 1 refuses such a scene. What is recorded and which harmonics are kept follows
    from ``step_s`` alone."""


class Recording(Section):
    """What goes into the recording and its layout.

    The signals of every joint are kept at every step, whatever is drawn.
    """

    pose_rate_Hz: Annotated[float, Field(gt=0, le=10_000)] = 50.0
    """Rate of the body poses that the viewer shows."""
    joints: Annotated[tuple[str, ...], Several] = ()
    """Joints that have a tab, in this order; none named: all, the most loaded first.
    The drive that is drawn is that of the first one whose map has fields."""
    plots: Annotated[tuple[Signal, ...], Several] = (
        "torsion_arcmin",
        "transmission_error_arcmin",
        "output_torque_Nm",
        "torque_deviation_Nm",
    )
    """Signals that every tab draws over time."""


class Metrics(Section):
    """What the figures of a run refer to."""

    settle_band_mm: Positive = 0.1
    """Half width of the band about the last tool position that settling refers to."""
    settle_band_arcmin: Positive = 1.0
    """The same about the last angle of every joint."""
    contacts_expected: bool = False
    """Whether bodies may touch in this scene; if not, a run in which they do is not
    valid."""
