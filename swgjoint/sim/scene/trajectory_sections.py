"""The table ``[trajectory]`` of a scene file, with one class per kind of motion."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section

Seconds = Annotated[float, Field(ge=0, le=10_000)]
Degrees = Annotated[float, Field(ge=-3_600, le=3_600)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Cycles = Annotated[int, Field(ge=1, le=1_000)]
Plane = Literal["+x", "-x", "+y", "-y"]


class MotionSection(Section):
    """Keys that all motions share."""

    start_deg: dict[str, Degrees] = Field(default_factory=dict)
    """Joint angles at the start of the run; zero for joints that are not named."""

    @property
    def shortest_s(self) -> float:
        """Duration that the run must exceed [s]."""
        return 0.0

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Names of joints that each key contains."""
        return {"start_deg": set(self.start_deg)}


class SweepSection(MotionSection):
    """All joints move together: rest, ramp, constant speed, ramp, rest."""

    kind: Literal["sweep"] = "sweep"
    hold_s: Seconds = 0.2
    """Rest before and after the motion."""
    ramp_s: Annotated[float, Field(gt=0, le=10_000)] = 1.0
    """Duration of each ramp."""
    settle_s: Seconds = 0.0
    """Initial part of the constant-speed motion that the metrics leave out."""
    end_deg: dict[str, Degrees] = Field(default_factory=dict)
    """Joint angles at the end; joints that are not named stay at rest."""

    @property
    def shortest_s(self) -> float:
        """Total time of rests, ramps and settling [s]."""
        return 2.0 * (self.hold_s + self.ramp_s) + self.settle_s

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Joints that each key names."""
        return {"start_deg": set(self.start_deg), "end_deg": set(self.end_deg)}


class ConstantSpeed(MotionSection):
    """Constant joint speeds from the first instant."""

    kind: Literal["constant_speed"] = "constant_speed"
    settle_s: Seconds = 0.0
    """Initial part of the run that the metrics leave out."""
    speed_deg_s: dict[str, Degrees]
    """Joint speeds; joints that are not named stay at rest."""

    @property
    def shortest_s(self) -> float:
        """Time before the part that the metrics use [s]."""
        return self.settle_s

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Joints that each key names."""
        return {
            "start_deg": set(self.start_deg),
            "speed_deg_s": set(self.speed_deg_s),
        }


class SpeedSteps(MotionSection):
    """One joint turns at several constant speeds, one after the other."""

    kind: Literal["speed_steps"] = "speed_steps"
    joint: str
    """Name of the joint; all other joints rest."""
    speeds_deg_s: Annotated[tuple[Degrees, ...], Field(strict=False, min_length=1)]
    """Joint speeds in their order; each has the same share of the run. The metrics use
    the last one."""
    hold_s: Seconds = 0.2
    """Rest before and after the motion."""
    ramp_s: Annotated[float, Field(gt=0, le=10_000)] = 0.5
    """Duration of every change of speed."""

    @property
    def shortest_s(self) -> float:
        """Total time of rests and ramps [s]."""
        return 2.0 * self.hold_s + (len(self.speeds_deg_s) + 1) * self.ramp_s

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Names of joints that each key contains."""
        return {"start_deg": set(self.start_deg), "joint": {self.joint}}


class StepSection(MotionSection):
    """The commanded joint angles jump once, and the run records the step response."""

    kind: Literal["step"] = "step"
    at_s: Annotated[float, Field(gt=0, le=10_000)] = 0.2
    """Time of the jump."""
    step_deg: dict[str, Degrees]
    """Height of the jump of each joint; zero for joints that are not named."""

    @property
    def shortest_s(self) -> float:
        """Time before the jump [s]."""
        return self.at_s

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Joints that each key names."""
        return {"start_deg": set(self.start_deg), "step_deg": set(self.step_deg)}


class Trapezoid(MotionSection):
    """Point-to-point motion: constant acceleration, speed and deceleration, then rest.

    All joints start and stop together. The joint with the longest travel determines the
    duration: it reaches the acceleration limit and, if it travels far enough, the speed
    limit.
    """

    kind: Literal["trapezoid"] = "trapezoid"
    hold_s: Seconds = 0.2
    """Rest before the motion; after the motion the arm rests until the end of the run.
    """
    end_deg: dict[str, Degrees]
    """Joint angles at the end; joints that are not named stay at rest."""
    max_speed_deg_s: Annotated[float, Field(gt=0, le=3_600)]
    """Speed limit of every joint."""
    max_acceleration_deg_s2: Annotated[float, Field(gt=0, le=1e6)]
    """Acceleration limit of every joint."""

    @property
    def shortest_s(self) -> float:
        """Total time of the first rest and the motion [s]."""
        return self.hold_s + self.move_s

    @property
    def move_s(self) -> float:
        """Duration of the motion without rests [s]."""
        way = max(
            (abs(end - self.start_deg.get(j, 0.0)) for j, end in self.end_deg.items()),
            default=0.0,
        )
        speed, acceleration = self.max_speed_deg_s, self.max_acceleration_deg_s2
        if way * acceleration >= speed**2:
            return way / speed + speed / acceleration
        return 2.0 * float((way / acceleration) ** 0.5)

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Joints that each key names."""
        return {"start_deg": set(self.start_deg), "end_deg": set(self.end_deg)}


class ChirpSection(MotionSection):
    """One joint oscillates about its start at linearly changing frequency."""

    kind: Literal["chirp"] = "chirp"
    joint: str
    """Name of the joint; all other joints rest."""
    amplitude_deg: Annotated[float, Field(gt=0, le=360)]
    """Amplitude of the joint angle."""
    from_Hz: Annotated[float, Field(gt=0, le=1_000)]
    """Frequency at the start of the oscillation."""
    to_Hz: Annotated[float, Field(gt=0, le=1_000)]
    """Frequency at the end of the oscillation."""
    hold_s: Seconds = 0.2
    """Rest before and after the oscillation."""
    ramp_s: Annotated[float, Field(gt=0, le=10_000)] = 0.5
    """Time in which the amplitude grows, and time in which it decays."""

    @property
    def shortest_s(self) -> float:
        """Total time of rests and ramps, without full amplitude [s]."""
        return 2.0 * (self.hold_s + self.ramp_s)

    @property
    def named_joints(self) -> dict[str, set[str]]:
        """Joints that each key names."""
        return {"start_deg": set(self.start_deg), "joint": {self.joint}}


class FromFile(MotionSection):
    """A smooth motion through all points of a CSV file."""

    kind: Literal["csv"] = "csv"
    file: str
    """Path of the CSV file. Its columns are ``time_s`` and, for each joint that moves,
    ``<joint>_deg`` or ``<joint>_rad``."""
    hold_s: Seconds = 0.2
    """Rest before the motion; after the last point the arm rests until the end of the
    run."""

    @property
    def shortest_s(self) -> float:
        """Rest before the motion [s]."""
        return self.hold_s


class ToolMotion(MotionSection):
    """A motion of the tool site; the joint angles follow by inverse kinematics."""

    orientation: Literal["hold", "free"] | None = None
    """Whether the tool keeps its orientation (``hold``) or not (``free``); if omitted,
    it keeps it on arms with six or more driven joints."""


class LineSection(ToolMotion):
    """The tool moves back and forth on a straight line and rests at both ends."""

    kind: Literal["line"] = "line"
    displacement_mm: Vector
    """Vector from the tool position at ``start_deg`` to the far end of the line, in the
    world frame."""
    cycles: Cycles = 1
    """Number of cycles back and forth."""
    hold_s: Seconds = 0.2
    """Rest at the start and at every turning point."""
    ramp_s: Annotated[float, Field(gt=0, le=10_000)] = 0.2
    """Duration of each acceleration and of each deceleration."""

    @property
    def shortest_s(self) -> float:
        """Total time of rests and ramps [s]."""
        return self.hold_s + 2 * self.cycles * (self.hold_s + 2.0 * self.ramp_s)

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if not any(self.displacement_mm):
            raise Fault(("displacement_mm", "[0, 0, 0] mm; accepted: not zero"))
        return self


class Circle(ToolMotion):
    """The tool moves along a circle: rest, ramp, constant speed, ramp, rest."""

    kind: Literal["circle"] = "circle"
    radius_mm: Annotated[float, Field(gt=0, le=10_000)]
    """Radius of the circle."""
    normal: Vector = (0.0, 0.0, 1.0)
    """Axis of the circle in the world frame; the tool moves about it right-handed."""
    towards: Vector = (1.0, 0.0, 0.0)
    """Direction from the tool position at ``start_deg`` to the centre, in the world
    frame; only its component perpendicular to ``normal`` is used."""
    cycles: Cycles = 1
    """Number of turns."""
    hold_s: Seconds = 0.2
    """Rest before and after the motion."""
    ramp_s: Annotated[float, Field(gt=0, le=10_000)] = 0.5
    """Duration of the acceleration and of the deceleration."""

    @property
    def shortest_s(self) -> float:
        """Total time of rests and ramps [s]."""
        return 2.0 * (self.hold_s + self.ramp_s)

    @model_validator(mode="after")
    def _spans_a_plane(self) -> Self:
        (a, b, c), (x, y, z) = self.normal, self.towards
        across = (b * z - c * y, c * x - a * z, a * y - b * x)
        size = (a * a + b * b + c * c) * (x * x + y * y + z * z)
        if sum(v * v for v in across) <= 1e-12 * size:
            raise Fault(
                (
                    "towards",
                    "parallel to normal, or one of the two is zero; accepted: two"
                    " directions that span a plane",
                )
            )
        return self


class Iso9283(ToolMotion):
    """The pose cycle of ISO 9283: P1 at the centre of a cube, P2 to P5 around it."""

    kind: Literal["iso9283"] = "iso9283"
    edge_mm: Annotated[float, Field(gt=0, le=10_000)] = 250.0
    """Edge length of the cube; the standard lists 250, 400, 630 and 1000 mm. The centre
    P1 is the tool position at ``start_deg``, and the edges are parallel to the world
    axes."""
    plane: Plane = "+x"
    """Horizontal direction in which the diagonal plane rises; the four directions are
    the four planes of the standard."""
    cycles: Cycles = 30
    """Number of cycles through the five poses."""
    hold_s: Seconds = 0.2
    """Rest at P1 before the first cycle."""
    rest_s: Annotated[float, Field(gt=0, le=10_000)] = 0.4
    """Rest at every pose; the pose is measured at the end of the rest."""

    @property
    def shortest_s(self) -> float:
        """Total time of all rests [s]."""
        return self.hold_s + 5 * self.cycles * self.rest_s


TrajectorySection = Annotated[
    SweepSection
    | ConstantSpeed
    | SpeedSteps
    | StepSection
    | Trapezoid
    | ChirpSection
    | FromFile
    | LineSection
    | Circle
    | Iso9283,
    Field(discriminator="kind"),
]
MOTIONS: dict[str, type[MotionSection]] = {
    str(model.model_fields["kind"].default): model
    for model in (
        SweepSection,
        ConstantSpeed,
        SpeedSteps,
        StepSection,
        Trapezoid,
        ChirpSection,
        FromFile,
        LineSection,
        Circle,
        Iso9283,
    )
}
"""Class of every kind of motion, by the value of ``kind``."""
