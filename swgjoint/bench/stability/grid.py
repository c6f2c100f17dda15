"""The grid of stiffness, inertias and steps, and what happens to each joint of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
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
)
from swgjoint.bench.stability.reference import TwoMassReference, reference
from swgjoint.bench.stability.rows import DEFAULT, StabilityRow, outcome_of
from swgjoint.joint.region import MAX_SUB_STEPS, Region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import rpm

STIFFNESS = (1e2, 1e3, 1e4, 1e5, 1e6, 1e7)
"""[N·m/rad]."""
ROTOR = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""[kg·m²]."""
LINK = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2)
"""[kg·m²]."""
STEPS = (1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 5e-3)
"""[s]."""
FEWER_ROTOR = (1e-7, 1e-5, 1e-3)
FEWER_LINK = (1e-4, 1e-2, 1.0, 1e2)
FEWER_STEPS = (1e-4, 1e-3, 2e-3, 5e-3)
FAST = 2000.0 * rpm
"""Rotor running free: the speed at which catalogues rate drives [rad/s]."""
SLOW = 20.0
"""Rotor under load [rad/s]."""
RATCHETING = 5.0
"""Torque step over the repeated peak torque: in the catalogue ratcheting begins at 2.7
to 4.9 times that torque."""
COUNT, SHORTEST = 2000, 0.2
"""A run has so many steps and lasts so long at least [s]."""
FINE = 1e-5
"""Step of the run that tells what contacts give by themselves [s]."""

OTHERS = {
    "discrete, never cut": ("full", "discrete"),
    "native tendon": ("native", "discrete"),
    "RK4": ("full", "RK4"),
}
"""Other schemes: level and integrator, at the whole step and without a region."""


@dataclass(frozen=True, kw_only=True)
class GridJoint:
    """One joint of the grid with the steps at which it is run."""

    stiffness: float
    rotor: float
    link: float
    steps: tuple[float, ...]
    others: bool = False
    """Whether the other schemes run it, too."""

    @property
    def name(self) -> str:
        """Its numbers, SI."""
        return f"K={self.stiffness:.0e} J={self.rotor:.0e} Jl={self.link:.0e}"

    @property
    def frequency(self) -> float:
        """Frequency of the torsional vibration [rad/s]."""
        reflected = RATIO**2 * self.rotor
        return sqrt(self.stiffness * (1.0 / reflected + 1.0 / self.link))


def grid(*, full: bool) -> list[GridJoint]:
    """All joints, the slowest first, or a third of them at fewer steps."""
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
    """How the joints of the grid are run, with the speed that the region is asked for.

    ``free``: turning at rated speed without torque. ``loaded``: turning slowly under
    full torque. ``released``: at rest under full torque, let go. ``step``: turning
    slowly, hit by a torque that would make a real drive ratchet.
    """
    full = drive.ratings.repeated_peak
    return {
        "free": (Start(speed=FAST), FAST),
        "loaded": (Start(torque=full, load=full, speed=SLOW), SLOW),
        "released": (Start(torque=full), 0.0),
        "step": (Start(load=RATCHETING * full, speed=SLOW), SLOW),
    }


def run_joint(task: GridJoint) -> list[StabilityRow]:
    """All rows of one joint."""
    drive = hardening_drive(task.stiffness)
    references = {
        group: reference(
            task.stiffness, rotor=task.rotor, link=task.link, start=situation[0]
        )
        for group, situation in situations(drive).items()
        if group in ("free", "loaded")
    }
    rows: list[StabilityRow] = []
    for step in task.steps:
        rows += _default(task, drive, step, references)
        rows.append(_dropped(task, drive, step))
        if task.others:
            rows += _others(task, drive, step, references)
    return rows


def _default(
    task: GridJoint,
    drive: DriveMap,
    step: float,
    references: dict[str, TwoMassReference],
) -> Iterator[StabilityRow]:
    """The default scheme, cut into sub-steps or refused as its region asks for."""
    joint = make_joint(drive, rotor=task.rotor, link=task.link, step=step)
    plain = _without_error(task, drive, step)
    for group, (start, speed) in situations(drive).items():
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
    """The default scheme with the link dropped on a floor."""
    joint = drop_joint(drive, rotor=task.rotor, link=task.link, step=step)
    region = joint.region(impact_speed(), contacts=True)
    parts = region.sub_steps
    if parts is None or parts > MAX_SUB_STEPS:
        return _refused(task, "drop", region)
    duration = max(SHORTEST, 400 * step)
    course = drop(joint, duration=duration, sub_steps=parts)
    own = 0.0
    if course.gain > GAIN:
        # bounces tell small differences apart, so the start is varied
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
    """What the other schemes make of the same joint."""
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
    plain = drive.with_harmonics(np.zeros(len(drive.orders), dtype=bool))
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
