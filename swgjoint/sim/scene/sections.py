"""Tables of a scene file, with the names of their keys."""

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
"""Signals of a joint in a recording."""

Positive = Annotated[float, Field(gt=0)]
Several = Field(strict=False)


class ControllerSection(Section):
    r"""Position control of every motor on its own encoder.

    ``pd`` and, with the integral of the error, ``pid``:

    .. math:: \tau = k_p e + k_d \dot e + k_i \int e\,dt + \tau_\text{ff}, \quad
        e = i q_r - \theta.

    The gains are either stated, or follow from a natural frequency and a damping ratio
    of the rigid drive, :math:`k_p = J\omega^2`, :math:`k_d = 2\zeta J\omega` with
    :math:`J = J_m + J_l(q_0)/i^2`. The integral gain is :math:`k_i = k_p/T_i`.

    ``computed_torque`` is the inverse dynamics of the rigid arm (M, h) with its rotors
    (J) at the measured motion, which is the motor motion divided by the ratio:

    .. math:: \tau = \left(M a + h\right)/i + i J a, \quad
        a = \ddot q_r + 2\zeta\omega(\dot q_r - \dot\theta/i)
        + \omega^2(q_r - \theta/i).
    """

    kind: ControlKind = "pd"
    natural_frequency_Hz: Annotated[float, Field(gt=0, le=1_000)] | None = None
    damping_ratio: Annotated[float, Field(gt=0, le=10)] | None = None
    stiffness_Nm_rad: Annotated[float, Field(gt=0)] | None = None
    """Motor torque per motor angle."""
    damping_Nms_rad: Annotated[float, Field(ge=0)] | None = None
    integral_time_s: Positive | None = None
    """Integral time of ``pid``; None is 4 divided by the loop's natural frequency in
    rad/s."""
    integral_limit_Nm: Positive | None = None
    """Largest motor torque of the integral term; None is the rated torque over the
    ratio."""
    feedforward: FeedForward = "gravity"
    """Motor torques for the rigid arm on the reference motion and for the load."""
    control_period_s: Positive | None = None
    """Control period, a multiple of ``step_s``: the loop is evaluated once per period
    and its torque held. None: ``pd`` and ``pid`` act within every engine step, and a
    loop that must be sampled (computed torque, sensors, link feedback) once per step.
    """
    feedback: Literal["motor", "link"] = "motor"
    """Side at which the position error is measured; the speed is that of the motor."""

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
    """Constant torque of the load against a joint, which the drive must balance."""

    torque_Nm: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    rated_fraction: Annotated[float, Field(ge=-5, le=5)] | None = None
    """Load torque as a fraction of the drive's rated torque."""

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
    """Largest number of equal sub-steps of a step, used if the integration of a joint
    requires them; 1 rejects such a scene. Recorded samples and kept harmonics depend on
    ``step_s`` only."""


class Recording(Section):
    """Contents and layout of the recording.

    The signals of every joint are kept at every step, whether they are plotted or not.
    """

    pose_rate_Hz: Annotated[float, Field(gt=0, le=10_000)] = 50.0
    """Rate of the body poses that the viewer shows."""
    joints: Annotated[tuple[str, ...], Several] = ()
    """Joints that have a tab, in this order; if empty all joints, most loaded first.
    The viewer draws the drive of the first joint whose map has fields."""
    plots: Annotated[tuple[Signal, ...], Several] = (
        "torsion_arcmin",
        "transmission_error_arcmin",
        "output_torque_Nm",
        "torque_deviation_Nm",
    )
    """Signals that every tab plots over time."""


class Metrics(Section):
    """Reference values for the figures of a run."""

    settle_band_mm: Positive = 0.1
    """Half width of the settling band about the last tool position."""
    settle_band_arcmin: Positive = 1.0
    """Half width of the settling band about the last angle of every joint."""
    contacts_expected: bool = False
    """Whether bodies may touch in this scene; if not, a run with contacts is not valid.
    """
