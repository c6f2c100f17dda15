"""Scene-file tables and ``attach`` options that describe the drive of one joint."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from swgjoint.drives.thermal_section import ThermalSection
from swgjoint.errors import InputError
from swgjoint.faults import Fault, Section, shorten
from swgjoint.gear.bearing.output_bearing import OutputBearing, catalogue_bearing
from swgjoint.gear.gauges import GaugeRing
from swgjoint.maps.fit.error_spectrum import LARGEST
from swgjoint.units import arcmin, deg, mm

Level = Literal["rigid", "kinematic", "linear", "native", "full"]
LEVELS: tuple[str, ...] = get_args(Level)

DRIVE_KEYS = ("drive", "linear", "numbers")
"""Keys that state the drive of a joint, of which a joint has one."""
Positive = Annotated[float, Field(gt=0)]


class MotorLimits(Section):
    """Limits of a motor, all at the motor shaft; each limit is optional."""

    torque_limit_Nm: Positive | None = None
    """Largest torque at any speed [N·m]."""
    stall_torque_Nm: Positive | None = None
    """Largest torque at rest [N·m]; the limit falls linearly to zero with speed."""
    no_load_speed_rpm: Positive | None = None
    """Speed at which that limit reaches zero torque [rpm]."""
    torque_constant_Nm_A: Positive | None = None
    """Torque per current [N·m/A]; if given, the metrics include the motor current."""
    current_limit_A: Positive | None = None
    """Largest current [A]; requires the torque constant."""

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        faults = []
        if (self.stall_torque_Nm is None) != (self.no_load_speed_rpm is None):
            faults.append(
                (
                    "stall_torque_Nm",
                    "expected stall_torque_Nm and no_load_speed_rpm together",
                )
            )
        if self.current_limit_A is not None and self.torque_constant_Nm_A is None:
            faults.append(("current_limit_A", "also needs torque_constant_Nm_A"))
        if faults:
            raise Fault(*faults)
        return self

    @property
    def torque(self) -> float | None:
        """Smaller of torque limit and current limit [N·m]; None without limits."""
        bounds = [] if self.torque_limit_Nm is None else [self.torque_limit_Nm]
        if self.current_limit_A is not None and self.torque_constant_Nm_A is not None:
            bounds.append(self.current_limit_A * self.torque_constant_Nm_A)
        return min(bounds, default=None)


class LinearDrive(Section):
    """A drive of constant stiffness without kinematic error."""

    stiffness_Nm_rad: Positive
    """Torsional stiffness at the output [N·m/rad]."""
    teeth_flexspline: Annotated[int, Field(ge=40, le=400)] = 200
    """Number of teeth of the flexspline."""
    teeth_circular_spline: Annotated[int, Field(ge=42, le=412)] = 202
    """Number of teeth of the circular spline."""
    rated_torque_Nm: Positive = 100.0
    """Rated torque at the output [N·m]."""


class NumbersDrive(Section):
    """A drive of which a few figures are known, as on a data sheet."""

    K1_Nm_rad: Positive
    """Torsional stiffness at low torque [N·m/rad]."""
    K2_Nm_rad: Positive | None = None
    """Torsional stiffness between T1 and T2 [N·m/rad]; by default K1."""
    K3_Nm_rad: Positive | None = None
    """Torsional stiffness beyond T2 [N·m/rad]; by default K2."""
    rated_torque_Nm: Positive
    """Rated torque at the output [N·m]."""
    ratio: Annotated[int, Field(ge=30, le=320)] = 100
    """Magnitude of the ratio, with the circular spline fixed."""
    lost_motion_arcmin: Positive | None = None
    """Lost motion at 4 % of the rated torque [arcmin]; by default that of K1. More than
    that becomes a clearance."""
    hysteresis_loss_arcmin: Positive | None = None
    """Width of the torque loop at zero torque [arcmin]; by default that of the
    clearance. More than that becomes friction of the torsion."""
    kinematic_error_arcmin: dict[str, Positive] = Field(default_factory=dict)
    """Amplitude, zero to peak, of the kinematic error [arcmin] by its order per input
    turn; by default none."""
    T1_Nm: Positive | None = None
    """Torque up to which K1 applies [N·m]; by default 0.2 of the rated torque."""
    T2_Nm: Positive | None = None
    """Torque up to which K2 applies [N·m]; by default 0.6 of the rated torque."""
    repeated_peak_Nm: Positive | None = None
    """Repeated peak torque [N·m]; by default twice the rated torque."""
    momentary_peak_Nm: Positive | None = None
    """Momentary peak torque [N·m]; by default four times the rated torque."""
    name: str = "numbers"
    """Name of the drive in tables and reports."""

    @model_validator(mode="after")
    def _whole_orders(self) -> Self:
        faults = [
            (f"kinematic_error_arcmin.{shorten(key)}", "accepted: an order, 1 to 1000")
            for key in self.kinematic_error_arcmin
            if not re.fullmatch("[1-9][0-9]{0,2}|1000", key)
        ]
        if faults:
            raise Fault(*faults)
        return self


class LifeSection(Section):
    """Rated life of the wave-generator bearing, and S-N curve of the flexspline."""

    L50_h: Positive | None = None
    """Life that half of the bearings exceed at rated torque and rated speed [h]; by
    default that of the catalogue, for drives with a catalogue name."""
    L10_h: Positive | None = None
    """Life that nine out of ten bearings exceed [h]; by default L50 / 5."""
    rated_speed_rpm: Positive | None = None
    """Input speed to which rated torque and life refer [rpm]; by default 2000 rpm."""
    endurance_limit_MPa: Positive | None = None
    """Amplitude of reversed stress that the steel endures without limit [MPa]."""
    ultimate_strength_MPa: Positive | None = None
    """Ultimate tensile strength, for the Goodman line [MPa]."""
    sn_exponent: Annotated[float, Field(gt=0, le=100)] | None = None
    """Exponent of the S-N curve above the endurance limit [-]."""
    sn_knee_cycles: Annotated[float, Field(ge=1, le=1e12)] | None = None
    """Number of cycles at which the S-N curve reaches the endurance limit [-]."""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        faults = []
        if self.L50_h is None:
            faults += [
                (key, "also needs L50_h")
                for key in ("L10_h", "rated_speed_rpm")
                if getattr(self, key) is not None
            ]
        elif self.L10_h is not None and self.L10_h > self.L50_h:
            faults.append(("L10_h", f"{self.L10_h:g} h; accepted: at most L50_h"))
        curve = (
            "endurance_limit_MPa",
            "ultimate_strength_MPa",
            "sn_exponent",
            "sn_knee_cycles",
        )
        absent = [key for key in curve if getattr(self, key) is None]
        if 0 < len(absent) < len(curve):
            faults.append((absent[0], f"missing; expected {', '.join(curve)} together"))
        limit, ultimate = self.endurance_limit_MPa, self.ultimate_strength_MPa
        if limit is not None and ultimate is not None and limit >= ultimate:
            faults.append(
                (
                    "endurance_limit_MPa",
                    f"{limit:g} MPa; accepted: below"
                    f" ultimate_strength_MPa, {ultimate:g} MPa",
                )
            )
        if faults:
            raise Fault(*faults)
        return self


class OutputBearingSection(Section):
    """Bearing at the output of one drive, which yields to tilting moments."""

    unit: str | None = None
    """Housed unit in ``models/catalogue/output_bearings.csv`` that provides the values,
    such as ``CSG-25``; other keys replace its values."""
    tilt_stiffness_Nm_arcmin: Positive | None = None
    """Tilting moment per tilt angle [N·m/arcmin]; required without ``unit``."""
    permissible_moment_Nm: Positive | None = None
    """Permissible dynamic tilting moment [N·m]."""
    dynamic_rating_N: Positive | None = None
    """Basic dynamic load rating [N], for the life."""
    pitch_diameter_mm: Positive | None = None
    """Pitch circle diameter of the rollers [mm], for the life."""
    load_factor: Annotated[float, Field(ge=1, le=10)] = 1.2
    """Load factor of the life [-]: 1 to 1.2 for smooth operation, 1.2 to 1.5 for
    normal operation, 1.5 to 3 with shocks."""
    damping_ratio: Annotated[float, Field(ge=0, le=1)] = 0.02
    """Damping ratio of the tilt vibration with the other joints locked [-]."""
    centre_mm: Annotated[float, Field(ge=-10_000, le=10_000)] = 0.0
    """Centre of the bearing on the joint axis, from the origin of the joint [mm]."""

    @model_validator(mode="after")
    def _stiff(self) -> Self:
        if self.unit is None and self.tilt_stiffness_Nm_arcmin is None:
            raise Fault(
                ("tilt_stiffness_Nm_arcmin", "missing; a bearing without unit needs it")
            )
        try:
            self.bearing()
        except InputError as error:
            raise Fault(("unit", str(error))) from None
        return self

    def bearing(self) -> OutputBearing:
        """The bearing in SI units.

        Raises:
            InputError: If the catalogue has no such unit.
        """
        units = {
            "tilt_stiffness": (self.tilt_stiffness_Nm_arcmin, 1.0 / arcmin),
            "permissible_moment": (self.permissible_moment_Nm, 1.0),
            "dynamic_rating": (self.dynamic_rating_N, 1.0),
            "pitch_diameter": (self.pitch_diameter_mm, mm),
        }
        stated: dict[str, Any] = {
            k: v * unit for k, (v, unit) in units.items() if v is not None
        }
        base = OutputBearing(tilt_stiffness=stated.get("tilt_stiffness", 1.0))
        if self.unit is not None:
            base = catalogue_bearing(self.unit)
        return replace(
            base,
            load_factor=self.load_factor,
            damping_ratio=self.damping_ratio,
            centre=self.centre_mm * mm,
            **stated,
        )


class GaugesSection(Section):
    """Full bridges of strain gauges around the wall behind the teeth of a flexspline.

    They read the torque, and the shear of the wall that turns with the wave generator.
    """

    flexspline: str | None = None
    """Design with a cup that states the geometry (path or bundled name); by default
    ``drive``, which must then be such a design. Its ratio and layout must be those of
    the drive."""
    position_mm: Positive
    """Distance of the gauges from the outside of the closed end [mm]."""
    strain: Literal["3d", "outline"] = "3d"
    """Strain of the wall on the wave generator: ``3d`` solves the contact with finite
    elements once per design (up to minutes), ``outline`` is the closed form of a wall
    that follows the outline everywhere."""
    bridges: Annotated[int, Field(ge=1, le=100)] = 1
    """Number of bridges, whose mean is the reading."""
    spacing_deg: Annotated[float, Field(gt=0, le=360)] | None = None
    """Angle between neighbouring bridges [deg]; by default they are distributed around
    the full turn. The first one is below a lobe at input and output angle zero."""
    gauge_angle_deg: Annotated[float, Field(gt=0, lt=90)] = 45.0
    """Angle of the gauges to the generator of the wall [deg]; two are at plus, two at
    minus this angle."""
    gauge_factor: Annotated[float, Field(gt=0, le=1000)] = 2.0
    """Relative change of resistance per strain [-]."""
    place_errors_deg: list[Annotated[float, Field(ge=-180, le=180)]] = Field(
        default_factory=list
    )
    """Errors of the bridges' angles around the flexspline [deg], one per bridge; by
    default none."""
    turn_errors_deg: list[Annotated[float, Field(ge=-45, le=45)]] = Field(
        default_factory=list
    )
    """Angles by which the bridges are turned on the wall [deg], one per bridge; by
    default none."""

    @model_validator(mode="after")
    def _one_error_each(self) -> Self:
        faults = [
            (key, f"{len(errors)} values; accepted: {self.bridges}, one per bridge")
            for key in ("place_errors_deg", "turn_errors_deg")
            if (errors := getattr(self, key)) and len(errors) != self.bridges
        ]
        if faults:
            raise Fault(*faults)
        return self

    def ring(self) -> GaugeRing:
        """The bridges in SI units."""
        return GaugeRing(
            place=self.position_mm * mm,
            bridges=self.bridges,
            spacing=None if self.spacing_deg is None else self.spacing_deg * deg,
            angle=self.gauge_angle_deg * deg,
            gauge_factor=self.gauge_factor,
            shifts=tuple(error * deg for error in self.place_errors_deg),
            turns=tuple(error * deg for error in self.turn_errors_deg),
        )


class JointSection(Section):
    """Drive of one joint; absent keys take their values from ``[defaults]``."""

    drive: str | None = None
    """Design (path or bundled name), ``.swg`` file or catalogue name."""
    linear: LinearDrive | None = None
    """Drive of constant stiffness, instead of ``drive``."""
    numbers: NumbersDrive | None = None
    """Drive of stated figures, instead of ``drive``."""
    model: Literal["ring", "2d", "3d"] | None = None
    """Fidelity of a design; by default 3d for a design with a cup, else 2d."""
    kinematic_error_arcmin: Annotated[float, Field(ge=0, le=LARGEST)] | None = None
    """Assumed kinematic error, peak to peak over one output turn [arcmin], of a
    catalogue drive or of another drive without kinematic error; see
    :mod:`swgjoint.maps.fit.error_spectrum`. The default is the transmission accuracy of
    the catalogue. A drive with its own kinematic error keeps it and accepts only 0."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """Seed of the assumed error, by default 0; with equal seeds, the errors of joints
    with different names still differ."""
    level: Level | None = None
    """Level of detail of the joint model."""
    rotor_inertia_kgm2: Annotated[float, Field(gt=0, le=1)] | None = None
    """Inertia of rotor and wave generator about the motor axis [kg·m²]."""
    damping_ratio: Annotated[float, Field(ge=0, le=1)] | None = None
    """Damping ratio of the torsional vibration [-]; by default that of the drive."""
    hysteresis: bool | None = None
    """Whether the levels native and full include the hysteresis of the drive; by
    default true."""
    friction: bool | None = None
    """Whether the levels native and full include the friction of the drive; by
    default true."""
    temperature_C: Annotated[float, Field(ge=-60, le=200)] | None = None
    """Temperature of the lubricant [°C], which determines the friction at the levels
    native and full. The drive must state its friction over temperature: a design with
    ``[losses]``, a map built from one, or a catalogue drive with stated losses. By
    default, the friction is that of the drive, at +20 °C in catalogues."""
    thermal: ThermalSection | None = None
    """Warming of the drive by its own losses at level full, from ``temperature_C`` on;
    by default the temperature is constant. The drive must state its friction over
    temperature."""
    harmonics_tolerance_arcmin: Positive | None = None
    """Tolerance for omitting harmonics [arcmin]: at constant torque, the omitted
    harmonics together turn the output by less than this, see
    :mod:`swgjoint.maps.fit.pruning`. By default all harmonics are kept. The tolerance
    has no effect at the levels rigid, linear and native, which have no harmonics. At
    the other levels, a map is rejected if the variation of its stiffness, summed over
    the harmonics, exceeds the mean stiffness, because a given torque then does not
    bound the angle."""
    rotor: Literal["gyroscopic", "lumped"] | None = None
    """Rotor model: ``gyroscopic`` (default), a body carried by the parent link, or
    ``lumped``, an inertia that rotates only relative to that link."""
    motor: MotorLimits | None = None
    """Limits of the motor; by default it delivers any commanded torque."""
    life: LifeSection | None = None
    """Rated life and fatigue strength, for the life over the duty cycle."""
    output_bearing: OutputBearingSection | None = None
    """Bearing that lets the link tilt; by default the joint is a rigid hinge."""
    gauges: GaugesSection | None = None
    """Strain gauges on the flexspline, whose reading of the torque is recorded; by
    default there are none. They do not affect the motion."""

    @model_validator(mode="after")
    def _one_drive(self) -> Self:
        stated = [key for key in DRIVE_KEYS if getattr(self, key) is not None]
        if len(stated) > 1:
            more = " and ".join(stated[1:])
            raise Fault((stated[0], f"given together with {more}; accepted: one"))
        return self

    @property
    def has_drive(self) -> bool:
        """Whether one of :data:`DRIVE_KEYS` states the drive."""
        return any(getattr(self, key) is not None for key in DRIVE_KEYS)

    def with_drive(self, drive: str) -> JointSection:
        """A copy with this drive instead of its own; a design at default fidelity."""
        none = dict.fromkeys((*DRIVE_KEYS, "model"))
        return self.model_copy(update={**none, "drive": drive})

    def fill_from(self, base: JointSection) -> JointSection:
        """Complete these settings with those of ``base``, which have lower priority."""
        present = self.model_dump(exclude_none=True)
        values = {key: getattr(self, key) for key in present}
        rest = base.model_dump(exclude_none=True)
        if self.has_drive:
            rest = {k: v for k, v in rest.items() if k not in DRIVE_KEYS}
        return JointSection(**{key: getattr(base, key) for key in rest} | values)
