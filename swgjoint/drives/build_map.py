"""The drive map of a design, sampled by finite elements."""

from __future__ import annotations

from swgjoint.drives.fidelity import default_model
from swgjoint.errors import InputError
from swgjoint.flags import check_flags
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design, check_design
from swgjoint.gear.design.tolerances import has_errors, without_errors
from swgjoint.maps.cache import cache_map
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.layouts import with_layout
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent


def build_map(
    design: Design,
    *,
    model: str | None = None,
    angles: int | None = None,
    progress: Progress = silent,
    cache: bool = True,
) -> DriveMap:
    """Compute the drive map of a design with finite elements.

    The potential is that of the drive without friction. If the teeth have a friction
    coefficient, torque loops with friction are computed as well, with thin rings for
    ``ring`` and in 2D for ``2d`` and ``3d``, and hysteresis elements are fitted to
    them; ``info["friction_loop"]`` compares the loops with these elements. With a table
    ``[losses]``, the map has the friction of :mod:`swgjoint.fe.rings.losses` at speed,
    for all temperatures. Thin rings, and a 2D model with a bearing, are computed with
    the circular spline fixed and transformed to the layout of the design.

    Args:
        design: The drive.
        model: Fidelity, ``ring``, ``2d`` or ``3d``; by default ``3d`` for a design with
            a cup, otherwise ``2d``.
        angles: Number of wave-generator positions over one pitch of the fixed member
            (for ``ring``: of ball positions over one ball passage); None takes the
            default of :func:`swgjoint.fe.common.sampling.sample_map` or
            :func:`swgjoint.fe.rings.sampling.sample_thin_rings`.
        progress: Called with the stage, the number of finished solves and their total.
        cache: Whether to read and write the map cache. With the cache, an interrupted
            computation resumes where it stopped, with bit-identical results.

    Returns:
        The fitted map of the drive.

    Raises:
        InputError: If ``design`` is not a design, or there are no angles.
        DesignError: If the design cannot be built or contains something that the model
            does not cover.
        ComputationError: If the solver converges at none of the torques.
    """
    check_design(design)
    check_flags(cache=cache)
    if angles is not None and not angles >= 1:
        raise InputError(f"angles {angles}; accepted: >= 1, or None")
    model = model or default_model(design)
    if design.losses is not None:  # not part of the finite elements
        plain = design.with_changes({"losses": None})
        drive = build_map(
            plain, model=model, angles=angles, progress=progress, cache=cache
        )
        from swgjoint.drives.solve_map import with_losses

        return with_losses(design, drive, progress)
    twin = _fixed_twin(design, model)
    if twin is not None:
        drive = build_map(
            twin, model=model, angles=angles, progress=progress, cache=cache
        )
        moved = with_layout(drive, design.drive.layout, ratings_of(design))
        return moved.with_parts(
            info={**moved.info, "design_hash": design.content_hash()}
        )
    parts = {"design": design.content_hash(), "model": model, "angles": angles}

    keep = Unfinished.from_parts(parts) if cache else None
    perfect_keep = _perfect_store(design, angles) if cache and model == "ring" else None

    def build() -> DriveMap:
        # a map from the cache does without the finite elements
        from swgjoint.drives.solve_map import solve_map

        return solve_map(
            design,
            model,
            angles,
            progress=progress,
            keep=keep,
            perfect_keep=perfect_keep,
        )

    if not cache:
        return build()
    drive = cache_map(parts, build, name=design.drive.name)
    if keep is not None:
        keep.clear()  # only once the map itself is in the cache
    return drive


def _fixed_twin(design: Design, model: str) -> Design | None:
    """The drive with a fixed circular spline, if only this layout has all its parts.

    The rolling of the balls in thin rings and in 2D is derived for it. None if the
    layout of the design is computed itself.
    """
    fixed = "circular_spline_fixed"
    bearing = design.wave_generator.bearing
    if bearing is None or model == "3d" or design.drive.layout == fixed:
        return None
    return design.with_changes({"drive.layout": fixed})


def _perfect_store(design: Design, angles: int | None) -> Unfinished | None:
    """Store of ring results without errors and friction, after changes of these alone.

    It is not removed with the map, so that a drive with other tolerances computes
    only what depends on them. None if the design has none of them.
    """
    perfect = without_errors(design).with_changes({"friction.tooth_coefficient": 0.0})
    if perfect == design:
        return None
    return Unfinished.from_parts(
        {
            "perfect": perfect.content_hash(),
            "model": "ring",
            "angles": angles,
            "flawed": has_errors(design),
        }
    )
