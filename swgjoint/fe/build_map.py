"""The drive map of a design, sampled by finite elements."""

from __future__ import annotations

from swgjoint.fe.drive2d import check_modelled
from swgjoint.fe.sampling import ANGLES, sample_map
from swgjoint.gear.design import Design
from swgjoint.maps.cache import cached
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit import fit_map
from swgjoint.progress import Progress, silent


def build_map(
    design: Design,
    *,
    model: str | None = None,
    angles: int = ANGLES,
    progress: Progress = silent,
    cache: bool = True,
) -> DriveMap:
    """Drive map of a design.

    Args:
        design: The drive.
        model: Fidelity; default ``2d``.
        angles: Wave-generator positions over one pitch of the fixed member.
        progress: Called with the stage, the solves done and their number.
        cache: Whether to look in the cache of maps, and to store there.

    Raises:
        DesignError: If the design cannot be built or holds what is not modelled.
        ComputationError: If no torque at all can be solved.
    """
    model = model or ("3d" if design.cup is not None else "2d")
    check_modelled(design, model)

    def build() -> DriveMap:
        return fit_map(sample_map(design, angles=angles, progress=progress))

    if not cache:
        return build()
    parts = {"design": design.content_hash(), "model": model, "angles": angles}
    return cached(parts, build, name=design.drive.name)
