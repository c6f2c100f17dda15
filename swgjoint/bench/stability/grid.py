"""Grid of stiffness, inertias and time steps, and the runs of each of its joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import sqrt

import numpy as np

from swgjoint.bench.stability.damping import numerical_damping
from swgjoint.bench.stability.impact import drop, drop_joint, impact_speed
from swgjoint.bench.stability.joint import (
    GAIN,
    RATIO,
    Joint,
    Start,
    hardening_drive,
    make_joint,
    with_friction_of_teeth,
)
from swgjoint.bench.stability.reference import TwoMassReference, reference
from swgjoint.bench.stability.rows import DEFAULT, StabilityRow, outcome_of
from swgjoint.joint.region import MAX_SUB_STEPS, Region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import rpm

STIFFNESS = (1e2, 1e3, 1e4, 1e5, 1e6, 1e7)
"""Stiffnesses at zero torque [N·m/rad]."""
ROTOR = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""Rotor inertias [kg·m²]."""
LINK = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2)
"""Link inertias [kg·m²]."""
STEPS = (1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 5e-3)
"""Time steps [s]."""
FEWER_ROTOR = (1e-7, 1e-5, 1e-3)
"""Rotor inertias of the subset [kg·m²]."""
FEWER_LINK = (1e-4, 1e-2, 1.0, 1e2)
"""Link inertias of the subset [kg·m²]."""
FEWER_STEPS = (1e-4, 1e-3, 2e-3, 5e-3)
"""Time steps of the subset [s]."""
FAST = 2000.0 * rpm
"""Speed of the free-running rotor [rad/s], the rated speed of catalogues."""
SLOW = 20.0
"""Speed of the rotor under load [rad/s]."""
RATCHETING = 5.0
"""Torque step divided by the repeated peak torque [-]; in the catalogue, the ratcheting
torque is 2.7 to 4.9 times the repeated peak torque."""
COUNT, SHORTEST = 2000, 0.2
"""Minimum number of time steps and minimum duration [s] of a run."""
FINE = 1e-5
"""Time step of the run that shows the energy gain of the contacts alone [s]."""

OTHERS = {
    "discrete, never cut": ("full", "discrete"),
    "native tendon": ("native", "discrete"),
    "RK4": ("full", "RK4"),
}
"""Level and integrator of the other schemes, which run without region check at the
undivided time step."""


@dataclass(frozen=True, kw_only=True)
class GridJoint:
    """One joint of the grid with its time steps."""

    stiffness: float
    """Stiffness at zero torque [N·m/rad]."""
    rotor: float
    """Rotor inertia [kg·m²]."""
    link: float
    """Link inertia [kg·m²]."""
    steps: tuple[float, ...]
    """Time steps [s]."""
    others: bool = False
    """Whether the other schemes are run as well."""

    @property
    def name(self) -> str:
        """Stiffness and inertias in SI units."""
        return f"K={self.stiffness:.0e} J={self.rotor:.0e} Jl={self.link:.0e}"

    @property
    def frequency(self) -> float:
        """Frequency of the torsional vibration at zero torque [rad/s]."""
        reflected = RATIO**2 * self.rotor
        return sqrt(self.stiffness * (1.0 / reflected + 1.0 / self.link))


def grid(*, full: bool) -> list[GridJoint]:
    """All joints, or a subset at fewer time steps; the longest run time first."""
    rotors, links = (ROTOR, LINK) if full else (FEWER_ROTOR, FEWER_LINK)
    joints = [
        GridJoint(
            stiffness=stiffness,
            rotor=rotor,
            link=link,
            steps=STEPS if full else FEWER_STEPS,
            others=rotor in FEWER_ROTOR[:2] and link in FEWER_LINK[::2],
        )
        for stiffness, rotor, link in product(STIFFNESS, rotors, links)
    ]
    return sorted(joints, key=lambda joint: -joint.frequency)


def situations(drive: DriveMap) -> dict[str, tuple[Start, float]]:
    """Initial conditions by group, with the rotor speed for the region check [rad/s].

    ``free``: rotation at rated speed without torque. ``loaded``: slow rotation under
    full torque. ``released``: release from full torque at rest. ``step``: slow rotation
    with a torque step at which a real drive would ratchet.
    """
    full = drive.ratings.repeated_peak
    return {
        "free": (Start(speed=FAST), FAST),
        "loaded": (Start(torque=full, load=full, speed=SLOW), SLOW),
        "released": (Start(torque=full), 0.0),
        "step": (Start(load=RATCHETING * full, speed=SLOW), SLOW),
    }


def rubbed_situations(drive: DriveMap) -> dict[str, tuple[Start, float]]:
    """Initial conditions under load, for a drive with hysteresis of its teeth."""
    some = situations(drive)
    return {f"{group}, hysteresis": some[group] for group in ("loaded", "released")}


def run_joint(task: GridJoint) -> list[StabilityRow]:
    """Rows of one joint, at all time steps."""
    drive = hardening_drive(task.stiffness)
    references = {
        group: reference(
            task.stiffness, rotor=task.rotor, link=task.link, start=situation[0]
        )
        for group, situation in situations(drive).items()
        if group in ("free", "loaded")
    }
    rubbed = with_friction_of_teeth(drive)
    rows: list[StabilityRow] = []
    for step in task.steps:
        rows += _default(task, drive, step, situations(drive), references)
        rows += _default(task, rubbed, step, rubbed_situations(drive), {})
        rows.append(_dropped(task, drive, step))
        if task.others:
            rows += _others(task, drive, step, references)
    return rows


def _default(
    task: GridJoint,
    drive: DriveMap,
    step: float,
    starts: dict[str, tuple[Start, float]],
    references: dict[str, TwoMassReference],
) -> Iterator[StabilityRow]:
    """Rows of the default scheme, with the sub-steps that its region requires."""
    joint = make_joint(drive, rotor=task.rotor, link=task.link, step=step)
    plain = _without_error(task, drive, step)
    for group, (start, speed) in starts.items():
        region = joint.region(speed, torque=start.load)
        parts = region.sub_steps
        if parts is None or parts > MAX_SUB_STEPS:
            yield _refused(task, group, region)
            continue
        course = joint.run(start, duration=_duration(step), sub_steps=parts)
        known = references.get(group)
        yield StabilityRow(
            case=task.name,
            group=group,
            scheme=DEFAULT,
            step_s=step,
            outcome=outcome_of(course),
            sub_steps=parts,
            largest_gain=course.gain,
            energy_balance=course.balance,
            error=known.error(joint, start, parts) if known else None,
            numerical_damping_ratio=numerical_damping(plain, parts),
            physical_damping_ratio=drive.damping_ratio,
            phase_step=step * task.frequency,
            reason=region.exceeded or None,
        )


def _dropped(task: GridJoint, drive: DriveMap, step: float) -> StabilityRow:
    """Row of the default scheme for a link dropped on a floor."""
    joint = drop_joint(drive, rotor=task.rotor, link=task.link, step=step)
    region = joint.region(impact_speed(), contacts=True)
    parts = region.sub_steps
    if parts is None or parts > MAX_SUB_STEPS:
        return _refused(task, "drop", region)
    duration = max(SHORTEST, 400 * step)
    course = drop(joint, duration=duration, sub_steps=parts)
    own = 0.0
    if course.gain > GAIN:
        # bounces amplify small differences, so the initial speed is varied
        finer = max(4 * parts, round(step / FINE))
        own = max(
            drop(joint, duration=duration, sub_steps=finer, speed=speed).gain
            for speed in np.linspace(0.96, 1.04, 5)
        )
    return StabilityRow(
        case=task.name,
        group="drop",
        scheme=DEFAULT,
        step_s=step,
        outcome=outcome_of(course, own_gain=own),
        sub_steps=parts,
        largest_gain=course.gain,
        own_gain=own or None,
        energy_balance=course.balance,
        phase_step=step * task.frequency,
        reason=region.exceeded or None,
    )


def _others(
    task: GridJoint,
    drive: DriveMap,
    step: float,
    references: dict[str, TwoMassReference],
) -> Iterator[StabilityRow]:
    """Rows of the other schemes for the same joint."""
    for scheme, (level, integrator) in OTHERS.items():
        joint = make_joint(
            drive,
            rotor=task.rotor,
            link=task.link,
            step=step,
            level=level,
            integrator=integrator,
        )
        plain = _without_error(task, drive, step, level=level, integrator=integrator)
        for group, (start, _) in situations(drive).items():
            course = joint.run(start, duration=_duration(step))
            known = references.get(group)
            yield StabilityRow(
                case=task.name,
                group=group,
                scheme=scheme,
                step_s=step,
                outcome=outcome_of(course),
                sub_steps=1,
                largest_gain=course.gain,
                energy_balance=course.balance,
                error=known.error(joint, start, 1) if known else None,
                numerical_damping_ratio=numerical_damping(plain, 1),
                physical_damping_ratio=drive.damping_ratio,
                phase_step=step * task.frequency,
            )


def _without_error(task: GridJoint, drive: DriveMap, step: float, **keys: str) -> Joint:
    plain = replace(drive, hysteresis=())
    plain = plain.with_harmonics(np.zeros(len(drive.orders), dtype=bool))
    return make_joint(plain, rotor=task.rotor, link=task.link, step=step, **keys)


def _refused(task: GridJoint, group: str, region: Region) -> StabilityRow:
    return StabilityRow(
        case=task.name,
        group=group,
        scheme=DEFAULT,
        step_s=region.timestep,
        outcome="refused",
        phase_step=region.timestep * task.frequency,
        reason=region.exceeded,
    )


def _duration(step: float) -> float:
    return max(SHORTEST, COUNT * step)
