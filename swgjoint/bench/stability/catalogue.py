"""Catalogue drives with kinematic error: free running for 10 s, and torque steps."""

from __future__ import annotations

from dataclasses import dataclass

from swgjoint.bench.stability.joint import Start, make_joint, with_kinematic_error
from swgjoint.bench.stability.rows import DEFAULT, FREE, StabilityRow, outcome_of
from swgjoint.gear.catalogue import table
from swgjoint.joint.region import MAX_SUB_STEPS
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import rpm

FREE_STEP, FREE_TIME = 1e-3, 10.0
"""Time step and duration of free running [s]."""
FREE_SPEEDS = (200.0 * rpm, 2000.0 * rpm)
"""Rotor speeds of free running [rad/s]: a tenth of the rated speed of catalogues, and
that speed."""
STEPS = (5e-4, 1e-3, 2e-3)
"""Time steps of the runs with a torque step to the ratcheting torque [s]."""
LINKS = (1e-2, 1.0)
"""Link inertias of a wrist and of a shoulder [kg·m²]."""
COUNT, SHORTEST = 2000, 0.5
"""Minimum number of time steps and minimum duration [s] after a torque step."""


@dataclass(frozen=True, kw_only=True)
class CatalogueDrive:
    """One drive of the catalogue."""

    name: str
    rotor: float
    """Inertia of the wave generator alone, that is of the lightest rotor [kg·m²]."""
    ratcheting: float
    """Ratcheting torque [N·m]."""


def catalogue_drives() -> list[CatalogueDrive]:
    """All drives of the catalogue that have ratings."""
    return [
        CatalogueDrive(
            name=f"CSG-{row['size']:.0f}-{row['ratio']:.0f}",
            rotor=1e-4 * _number(row["input_inertia_1e-4kgm2"]),
            ratcheting=_number(row["ratcheting_Nm"]),
        )
        for row in table("ratings")
    ]


def run_drive(task: CatalogueDrive) -> list[StabilityRow]:
    """Run one drive freely and with torque steps."""
    drive = with_kinematic_error(
        DriveMap.from_catalogue(task.name, kinematic_error_arcmin=0.0)
    )
    rows = []
    for link in LINKS:
        for speed in FREE_SPEEDS:
            case = f"{task.name} Jl={link:g} {speed / rpm:.0f} rpm"
            start = Start(speed=speed)
            rows.append(
                _row(task, drive, FREE, case, FREE_STEP, link, start, FREE_TIME)
            )
        for step in STEPS:
            case = f"{task.name} Jl={link:g} {task.ratcheting:g} N·m"
            duration = max(SHORTEST, COUNT * step)
            start = Start(load=task.ratcheting)
            rows.append(_row(task, drive, "ratchet", case, step, link, start, duration))
    return rows


def _row(
    task: CatalogueDrive,
    drive: DriveMap,
    group: str,
    case: str,
    step: float,
    link: float,
    start: Start,
    duration: float,
) -> StabilityRow:
    joint = make_joint(drive, rotor=task.rotor, link=link, step=step)
    region = joint.region(start.speed, torque=start.load)
    parts = region.sub_steps
    phase = step * joint.attached.natural_frequency
    if parts is None or parts > MAX_SUB_STEPS:
        return StabilityRow(
            case=case,
            group=group,
            scheme=DEFAULT,
            step_s=step,
            outcome="refused",
            phase_step=phase,
            reason=region.exceeded,
        )
    course = joint.run(start, duration=duration, sub_steps=parts)
    return StabilityRow(
        case=case,
        group=group,
        scheme=DEFAULT,
        step_s=step,
        outcome=outcome_of(course),
        sub_steps=parts,
        largest_gain=course.gain,
        energy_balance=course.balance,
        phase_step=phase,
        reason=region.exceeded or None,
    )


def _number(value: float | str | None) -> float:
    assert value is not None
    return float(value)
