"""Catalogue drives for an arm by rule: the smallest that carries every joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.gear.catalogue import CatalogueRow, catalogue_rows
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.trajectory import Trajectory

SERIES = "CSG"
RATIO = 100
LARGER = 10.0
"""A drive that carries more than this many times what a joint asks is said to be larger
than the joint."""
SAMPLES = 200
"""Poses of a motion whose torques count."""


@dataclass(frozen=True, kw_only=True)
class DriveChoice:
    """The drive of one joint and what decided."""

    drive: str
    decided_by: str
    """``effort`` (torque of the motor in the arm's file), ``weight`` or ``motion``."""
    needed: float
    """Torque that decided [N·m]."""
    available: float
    """What the drive has for it [N·m]: repeated peak torque, for the weight its rated
    torque."""
    fits: bool
    """False where no drive of the series carries it; the drive is the largest then."""
    asked: Mapping[str, float]
    """Torques that were compared [N·m]."""

    @property
    def larger_than_needed(self) -> bool:
        """Whether even the smallest drive is much larger than the joint."""
        smallest = _rows()[0].name == self.drive
        return smallest and self.available > LARGER * self.needed

    def as_json(self) -> dict[str, Any]:
        """Under the keys of ``drive_choice`` in the output of ``swgjoint run``."""
        return {
            "drive": self.drive,
            "decided_by": self.decided_by,
            "needed_Nm": self.needed,
            "available_Nm": self.available,
            "fits": self.fits,
            "larger_than_needed": self.larger_than_needed,
            "asked_Nm": dict(self.asked),
        }


def choose_drives(arm: RigidArm, motion: Trajectory) -> dict[str, DriveChoice]:
    """The smallest CSG of ratio 100 for every joint of an arm on a motion.

    Its repeated peak torque is at least what the file lets the joint's motor exert,
    where the file says, and what the motion of the rigid arm needs at most, weight,
    acceleration and friction of the file together; its rated torque is at least the
    weight on that motion. The largest drive where none carries that much.
    """
    step = max(1, len(motion.time) // SAMPLES)
    path = motion.every(step)
    weight = np.abs(arm.gravity(path.position)).max(axis=0)
    torques = arm.torques(path.position, path.velocity, path.acceleration)
    moving = np.abs(torques).max(axis=0)
    return {
        joint: choose_drive(
            effort=arm.effort.get(joint), weight=float(still), motion=float(most)
        )
        for joint, still, most in zip(arm.joints, weight, moving, strict=True)
    }


def choose_drive(*, effort: float | None, weight: float, motion: float) -> DriveChoice:
    """The smallest drive for three torques at the output [N·m].

    Args:
        effort: Of the motor, None where the file does not say.
        weight: Largest at rest.
        motion: Largest in motion, weight included.
    """
    rows = _rows()
    asked = {"weight": weight, "motion": motion}
    if effort is not None:
        asked = {"effort": effort, **asked}
    sizes = {}
    for kind, torque in asked.items():
        fits = [k for k, row in enumerate(rows) if _carries(row, kind) >= torque]
        sizes[kind] = fits[0] if fits else len(rows)
    largest = len(rows) - 1
    row = rows[min(max(sizes.values()), largest)]
    # of those that ask for this size the one that uses most of it
    decided_by = max(
        asked, key=lambda kind: (sizes[kind], asked[kind] / _carries(row, kind))
    )
    return DriveChoice(
        drive=row.name,
        decided_by=decided_by,
        needed=asked[decided_by],
        available=_carries(row, decided_by),
        fits=sizes[decided_by] <= largest,
        asked=asked,
    )


def _carries(row: CatalogueRow, kind: str) -> float:
    return row.rated_torque if kind == "weight" else row.repeated_peak


def _rows() -> list[CatalogueRow]:
    rows = (r for r in catalogue_rows() if (r.series, r.ratio) == (SERIES, RATIO))
    return sorted(rows, key=lambda row: row.rated_torque)
