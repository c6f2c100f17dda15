"""Selection of catalogue drives by rule: the smallest one that suffices per joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.gear.catalogue import CatalogueRow, catalogue_rows
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.trajectory import Trajectory

SERIES = "CSG"
"""Series of the selected drives."""
RATIO = 100
"""Reduction ratio of the selected drives."""
LARGER = 10.0
"""Ratio of available to required torque above which the smallest drive is reported as
larger than needed."""
SAMPLES = 200
"""Smallest number of poses of a motion at which torques are evaluated, if it has as
many samples."""


@dataclass(frozen=True, kw_only=True)
class DriveChoice:
    """The drive of one joint and the required torque that determined its size."""

    drive: str
    """Catalogue name of the drive."""
    decided_by: str
    """Kind of the torque that determined the size: ``effort`` (torque limit in the
    arm's file), ``weight`` or ``motion``."""
    needed: float
    """Required torque that determined the size [N·m]."""
    available: float
    """Torque of the drive with which ``needed`` is compared [N·m]: rated torque for the
    weight, repeated peak torque otherwise."""
    fits: bool
    """Whether the drive suffices; if not, it is the largest of the series."""
    asked: Mapping[str, float]
    """All required torques by kind [N·m]."""

    @property
    def larger_than_needed(self) -> bool:
        """Whether even the smallest drive is much larger than the joint requires."""
        smallest = _rows()[0].name == self.drive
        return smallest and self.available > LARGER * self.needed

    def as_json(self) -> dict[str, Any]:
        """Values under the keys of ``drive_choice`` of ``swgjoint run --json``."""
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
    """Select the smallest CSG drive with ratio 100 for every joint of an arm.

    The repeated peak torque of the drive is at least the torque limit in the arm's
    file, if there is one, and at least the largest torque of the rigid arm on the
    motion, which includes weight, acceleration, and damping and friction of the file.
    The rated torque is at least the largest weight torque on the motion. If no drive
    suffices, the largest one is selected.

    Args:
        arm: The rigid arm.
        motion: Its commanded motion.

    Returns:
        Selected drive by joint name.
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
    """Select the smallest drive for three output torques.

    Args:
        effort: Torque limit of the joint [N·m]; None if the file states none.
        weight: Largest torque at rest [N·m].
        motion: Largest torque in motion, including the weight [N·m].
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
    # among the torques that require this size, choose the one closest to the limit
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
    """Torque of a drive with which a kind of required torque is compared [N·m]."""
    return row.rated_torque if kind == "weight" else row.repeated_peak


def _rows() -> list[CatalogueRow]:
    """Drives to select from, by increasing rated torque."""
    rows = (r for r in catalogue_rows() if (r.series, r.ratio) == (SERIES, RATIO))
    return sorted(rows, key=lambda row: row.rated_torque)
