"""Basic tables of a scene file; their attributes have the names of the keys."""

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
    r"""Position control of every motor, by default on its own encoder.

    The kinds ``pd``, with :math:`k_i = 0`, and ``pid`` use the law

    .. math:: \tau = k_p e + k_d \dot e + k_i \int e\,dt + \tau_\text{ff}, \quad
        e = i q_r - \theta.

    The gains are either stated, or follow from the natural frequency and the damping
    ratio of the loop with a rigid drive: :math:`k_p = J\omega^2` and
    :math:`k_d = 2\zeta J\omega` with :math:`J = J_m + J_l(q_0)/i^2`. The integral gain
    is :math:`k_i = k_p/T_i`.

    The kind ``computed_torque`` uses the inverse dynamics of the rigid arm, with
    inertia matrix M and bias torques h, and of its rotors, with inertias J. They are
    evaluated at the measured motion, which is the motor motion divided by the ratio:

    .. math:: \tau = \left(M a + h\right)/i + i J a, \quad
        a = \ddot q_r + 2\zeta\omega(\dot q_r - \dot\theta/i)
        + \omega^2(q_r - \theta/i).
    """

    kind: ControlKind = "pd"
    """Control law: ``pd``, ``pid`` or ``computed_torque``."""
    natural_frequency_Hz: Annotated[float, Field(gt=0, le=1_000)] | None = None
    """Natural frequency of the loop with a rigid drive; 8 Hz if omitted."""
    damping_ratio: Annotated[float, Field(gt=0, le=10)] | None = None
    """Damping ratio of the loop with a rigid drive; 1 if omitted."""
    stiffness_Nm_rad: Annotated[float, Field(gt=0)] | None = None
    """Proportional gain: motor torque per motor angle error."""
    damping_Nms_rad: Annotated[float, Field(ge=0)] | None = None
    """Derivative gain [N·m·s/rad]: motor torque per motor speed error."""
    integral_time_s: Positive | None = None
    """Integral time of ``pid``; if omitted, 4 divided by the natural frequency of the
    loop in rad/s."""
    integral_limit_Nm: Positive | None = None
    """Largest motor torque of the integral term; if omitted, the rated torque of the
    drive divided by its ratio."""
    feedforward: FeedForward = "gravity"
    """Feed-forward motor torque. ``gravity`` carries the weight of the rigid arm on the
    reference motion and the load; ``gravity_inertia`` also accelerates arm and rotors;
    ``none`` is zero."""
    control_period_s: Positive | None = None
    """Control period, a multiple of ``step_s``. The loop is evaluated once per period
    and its torque is held in between. If omitted, ``pd`` and ``pid`` act within every
    engine step, and loops that must be sampled (computed torque, sensors, link
    feedback) are evaluated once per step."""
    feedback: Literal["motor", "link"] = "motor"
    """Side of the drive whose angle the loop controls; the speed is always that of the
    motor."""

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
                    "expected either stiffness_Nm_rad with damping_Nms_rad, or"
                    " natural_frequency_Hz with damping_ratio",
                )
            )
        if self.kind == "computed_torque" and by_gain != (None, None):
            faults.append(
                (
                    "stiffness_Nm_rad",
                    "not used by computed_torque; accepted: natural_frequency_Hz with"
                    " damping_ratio",
                )
            )
        for key in ("integral_time_s", "integral_limit_Nm"):
            if self.kind != "pid" and getattr(self, key) is not None:
                faults.append((key, f"not used by {self.kind}; accepted: kind pid"))
        if faults:
            raise Fault(*faults)
        return self


class LoadSection(Section):
    """Constant torque of the load against a joint, which the drive must balance."""

    torque_Nm: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    """Load torque; positive if it acts against the positive direction of the joint."""
    rated_fraction: Annotated[float, Field(ge=-5, le=5)] | None = None
    """Load torque as a fraction of the drive's rated torque, with the same sign
    convention."""

    @model_validator(mode="after")
    def _one_value(self) -> Self:
        if (self.torque_Nm is None) == (self.rated_fraction is None):
            raise Fault(("torque_Nm", "expected either torque_Nm or rated_fraction"))
        return self


class Simulation(Section):
    """Duration and time stepping."""

    duration_s: Annotated[float, Field(gt=0, le=10_000)]
    """Simulated time."""
    step_s: Annotated[float, Field(ge=1e-6, le=0.02)] = 0.001
    """Time step, which is also the interval between recorded samples."""
    integrator: Integrator = "discrete"
    """Integrator of the engine."""
    max_sub_steps: Annotated[int, Field(ge=1, le=1_000)] = MAX_SUB_STEPS
    """Largest accepted number of equal sub-steps per step. The run uses sub-steps if
    the stable integration of a joint requires them; with 1, such a scene is rejected.
    Recorded samples and kept harmonics depend on ``step_s`` only."""


class Recording(Section):
    """Contents and layout of the recording.

    The recording contains the signals of every joint at every step, whether they are
    plotted or not.
    """

    pose_rate_Hz: Annotated[float, Field(gt=0, le=10_000)] = 50.0
    """Rate of the body poses that the viewer shows."""
    joints: Annotated[tuple[str, ...], Several] = ()
    """Joints that have a tab, in this order; if empty, all joints, the most loaded one
    first. The viewer draws the drive of the first joint whose map has fields."""
    plots: Annotated[tuple[Signal, ...], Several] = (
        "torsion_arcmin",
        "transmission_error_arcmin",
        "output_torque_Nm",
        "torque_deviation_Nm",
    )
    """Signals that every tab plots against time."""


class Metrics(Section):
    """Reference values for the figures of a run."""

    settle_band_mm: Positive = 0.1
    """Half width of the settling band about the final tool position."""
    settle_band_arcmin: Positive = 1.0
    """Half width of the settling band about the final angle of every joint."""
    contacts_expected: bool = False
    """Whether bodies may touch in this scene. If not, a run with contacts is reported
    as not valid."""


class AcceptanceSection(Section):
    """Acceptance test that ``swgjoint accept`` evaluates from the run."""

    test: Literal[
        "no_load",
        "starting",
        "stiffness",
        "kinematic_error",
        "efficiency",
        "back_driving",
        "resonance",
    ]
    """Evaluation of the run."""
    limits: dict[str, Positive] = Field(default_factory=dict)
    """Limits by figure, unless a file with limits states others."""
