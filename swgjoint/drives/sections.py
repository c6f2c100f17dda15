"""Tables of a scene file, and options of ``attach``, for the drive of one joint."""

from __future__ import annotations

from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.maps.fit.error_spectrum import LARGEST

Level = Literal["rigid", "kinematic", "linear", "native", "full"]
LEVELS: tuple[str, ...] = get_args(Level)

Positive = Annotated[float, Field(gt=0)]


class MotorLimits(Section):
    """What a motor can do, all at the motor shaft; each limit is optional."""

    torque_limit_Nm: Positive | None = None
    stall_torque_Nm: Positive | None = None
    """Torque-speed line: at most this at rest, nothing at the no-load speed."""
    no_load_speed_rpm: Positive | None = None
    torque_constant_Nm_A: Positive | None = None
    """With it the metrics state the current."""
    current_limit_A: Positive | None = None

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        faults = []
        if (self.stall_torque_Nm is None) != (self.no_load_speed_rpm is None):
            faults.append(
                (
                    "stall_torque_Nm",
                    "accepted: stall_torque_Nm and no_load_speed_rpm together",
                )
            )
        if self.current_limit_A is not None and self.torque_constant_Nm_A is None:
            faults.append(("current_limit_A", "needed with it: torque_constant_Nm_A"))
        if faults:
            raise Fault(*faults)
        return self

    @property
    def torque(self) -> float | None:
        """Largest torque at any speed, of torque and current [N·m]; None: any."""
        bounds = [] if self.torque_limit_Nm is None else [self.torque_limit_Nm]
        if self.current_limit_A is not None and self.torque_constant_Nm_A is not None:
            bounds.append(self.current_limit_A * self.torque_constant_Nm_A)
        return min(bounds, default=None)


class LinearDrive(Section):
    """A drive of constant stiffness without kinematic error."""

    stiffness_Nm_rad: Positive
    teeth_flexspline: Annotated[int, Field(ge=40, le=400)] = 200
    teeth_circular_spline: Annotated[int, Field(ge=42, le=412)] = 202
    rated_torque_Nm: Positive = 100.0


class JointSection(Section):
    """Drive of one joint; what is absent comes from ``[defaults]``."""

    drive: str | None = None
    """Design (path or bundled name), ``.swg`` file or catalogue name."""
    linear: LinearDrive | None = None
    model: Literal["ring", "2d", "3d"] | None = None
    """Fidelity of the finite elements of a design; None: 3d with a cup, else 2d."""
    kinematic_error_arcmin: Annotated[float, Field(ge=0, le=LARGEST)] | None = None
    """Peak to peak over one output turn of the error that a catalogue drive is assumed
    to have, see :mod:`swgjoint.maps.fit.error_spectrum`, or another drive without
    error. None: the transmission accuracy that the catalogue states. A drive with an
    error of
    its own keeps it, and takes no other value than 0."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """Of that error; the joints of one seed differ by their names. None: 0."""
    level: Level | None = None
    rotor_inertia_kgm2: Annotated[float, Field(gt=0, le=1)] | None = None
    """Rotor with wave generator about the motor axis."""
    damping_ratio: Annotated[float, Field(ge=0, le=1)] | None = None
    """Of the torsional vibration; None takes that of the drive."""
    hysteresis: bool | None = None
    """False leaves the hysteresis of the drive out; native and full have it else."""
    friction: bool | None = None
    """False leaves the friction of the drive out; native and full have it else."""
    harmonics_tolerance_arcmin: Positive | None = None
    """Drops harmonics of the drive that together turn the output by less at a given
    torque, see :mod:`swgjoint.maps.fit.pruning`; None keeps all. Without effect at the
    levels rigid, linear and native, which have no harmonics. At the others a map is
    refused where the swing of its stiffness, summed over the harmonics, exceeds the
    mean: no torque then bounds an angle."""
    rotor: Literal["gyroscopic", "lumped"] | None = None
    """Whether the rotor is a body that its link carries along, the default."""
    motor: MotorLimits | None = None
    """Limits of the motor; None: it gives what the controller asks for."""

    @model_validator(mode="after")
    def _one_drive(self) -> Self:
        if self.drive is not None and self.linear is not None:
            raise Fault(("drive", "given beside linear; accepted: one of the two"))
        return self

    def fill_from(self, base: JointSection) -> JointSection:
        """These settings, completed by others."""
        own = self.model_dump(exclude_none=True)
        values = {key: getattr(self, key) for key in own}
        rest = base.model_dump(exclude_none=True)
        if "drive" in own or "linear" in own:
            rest = {k: v for k, v in rest.items() if k not in ("drive", "linear")}
        return JointSection(**{key: getattr(base, key) for key in rest} | values)
