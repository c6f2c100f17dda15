"""Sampling of a design's equilibria over torque and input angle, for its map."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

from swgjoint.errors import ComputationError
from swgjoint.fe.common.clearance import FAINT, HELD
from swgjoint.fe.common.columns.angle_columns import SolvedColumns
from swgjoint.fe.common.columns.torque_choice import Ripple
from swgjoint.fe.common.mesh_cycle import Effort, Pattern, solve_mesh_cycle
from swgjoint.fe.label import label_of
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import in_plane, sector_model
from swgjoint.fe.plane.equilibrium import map_solver
from swgjoint.fe.plane.figures.shape_fields import (
    SectorFields,
    ShapeSurface,
    drive_fields,
    plane_fields,
    plane_surface,
)
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.shape_fields import solid_fields, solid_surface
from swgjoint.fe.tolerances.rest import SMALL
from swgjoint.fe.tolerances.ripple import ripple_with_errors
from swgjoint.fe.tolerances.sampling import sample_tolerances, stage_name
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors, without_errors
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.gear.mounting import series_compliance
from swgjoint.gear.wave_generators.wave_generator import has_mirror_symmetry
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.worst_positions import worst_positions
from swgjoint.maps.samples import MapSamples, ToleranceSamples
from swgjoint.maps.unfinished import Unfinished, UnfinishedSeries
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

ANGLES = 24
"""Initial number of input positions over one pitch in a 2D map. It is doubled as
needed, up to :data:`MOST_ANGLES`: contact events cause corners in the output error,
with some wave generators at a few torques only and with others at every angle."""
MOST_ANGLES = 96
"""Largest number of input positions over one pitch in a 2D map."""
SOLVES = 2700
"""Largest number of equilibria of a 2D map, doubled if both signs of torque are
sampled. An elliptical wave generator needs about a fifth of it, a simplified one all of
it."""
CORNERS = 0.15
"""Fraction of the equilibria of a 2D map that may be added at angles where the contact
changes between the samples [-]."""
TOLERANCED_SOLVES = 1050
"""The same for a map with tooth errors, whose accuracy is limited by the harmonics that
it leaves out."""
TOLERANCED_ANGLES = 12
"""Initial number of input positions over one pitch in a 2D map with tooth errors."""
TOLERANCED_UNSEEN = (5, 3)
"""Numbers of validation torques of one sign and of validation angles of the pattern of
perfect teeth in a 2D map with tooth errors, whose accuracy is validated separately."""
ANNOUNCED = 0.3
"""Fraction of the largest number of equilibria that is announced at first [-]. The
announced number grows with the finished ones."""
UNSEEN = (16, 7)
"""Numbers of validation torques of one sign and of validation angles of a 2D map."""
SOLID_ANGLES = 16
"""Initial number of input positions over one pitch in a 3D map. An equilibrium of the
3D model takes fifty times as long as one of the 2D model."""
SOLID_MOST_ANGLES = 16
"""Largest number of input positions over one pitch in a 3D map."""
SOLID_SOLVES = 220
"""Largest number of equilibria of a 3D map, doubled for both signs of torque."""
SOLID_UNSEEN = (2, 2)
"""Numbers of validation torques of one sign and of validation angles of a 3D map."""
TORQUES = 200
"""Largest number of torques of one sign in the table of a map."""
TOLERANCED_TORQUES = 24
"""Largest number of torques of one sign in the table of a map with tooth errors, which
has ten times as many harmonics."""
FIXED_SOLVES = 14
"""Largest mean number of equilibria per angle if the number of angles is prescribed,
doubled for both signs of torque."""
LEVELS = (0.05, 0.15, 0.35, 0.65, 1.0)
"""Initial torques, of both signs and at every angle, as fractions of the repeated peak
torque [-]. More torques are added at all angles."""


def sample_map(
    design: Design,
    *,
    model: str = "2d",
    angles: int | None = None,
    progress: Progress = silent,
    keep: Unfinished | None = None,
) -> MapSamples:
    """Equilibria of a design over one pitch and both signs of torque, for its map.

    Angles and torques of the nonlinear model are added, within a budget of equilibria,
    until the samples predict equilibria between them, see
    :func:`swgjoint.fe.common.mesh_cycle.solve_mesh_cycle`. A few equilibria at other
    angles and torques are reserved for the validation of the map. Unless the number of
    angles is prescribed, the 2D map is also validated where it is likely to be least
    accurate, see :mod:`swgjoint.maps.fit.worst_positions`. With perfect teeth
    one pitch suffices, and with a symmetric wave generator the results under negative
    torques are the mirror image of those under positive ones. Both properties are
    checked at rated torque and recorded. If a solve fails, its torque and all larger
    ones are omitted, and the samples are marked as truncated. Manufacturing errors are
    superposed, see :mod:`swgjoint.fe.tolerances.sampling`.

    In the 2D model the balls of a bearing are held at fixed positions on the cam, the
    first one on the major axis. Balls and teeth pass at different rates, so the drive
    repeats after a pitch and has mirror symmetry only if the balls do not pass.

    Args:
        design: The drive.
        model: Fidelity, ``2d`` or ``3d``.
        angles: Number of input positions over one pitch of the fixed member, with up to
            :data:`FIXED_SOLVES` equilibria each on average. None chooses as many as the
            drive needs, starting from :data:`ANGLES` (2D) or :data:`SOLID_ANGLES` (3D).
        progress: Called with the stage, the number of finished solves and the number
            announced, which may grow.
        keep: Store of all equilibria, from which an interrupted run resumes with
            bit-identical samples. None stores none.

    Returns:
        Samples of the map.

    Raises:
        DesignError: If the design cannot be built.
        ComputationError: If the unloaded drive or small torques cannot be solved.
    """
    begin = time.perf_counter()
    drive, ratings = design.drive, ratings_of(design)
    given = design
    if model == "2d":
        design = in_plane(design)
    symmetric = has_mirror_symmetry(design)
    effort = effort_of(
        model, angles, both_signs=not symmetric, errors=has_errors(design)
    )
    done, total = 0, int(ANNOUNCED * effort.solves)
    flawed = has_errors(design)
    stage = stage_name(design, 0) if flawed else f"{drive.name}: equilibria"

    def tick() -> None:
        nonlocal done, total
        done += 1
        total = min(effort.solves, max(total, int(1.2 * done)))
        progress(stage, min(done, total), total)

    found: dict[float, ToleranceSamples] = {}

    def with_errors(top: float, solved: SolvedColumns[Any] | None = None) -> Ripple:
        nonlocal stage
        found[top] = sample_tolerances(
            design,
            repeated_peak=top,
            rated_torque=ratings.rated_torque,
            model=model,
            progress=progress,
            keep=keep,
            solved=solved,
        )
        stage = stage_name(design, -1)
        return ripple_with_errors(found[top], design.periodicity)

    def ripple(solved: SolvedColumns[Any]) -> Ripple:
        return with_errors(max(abs(t) for t in solved.levels), solved)

    options: dict[str, Any] = {"ripple": ripple} if flawed else {}
    pattern, shown, surface = _solved(design, model, effort, tick, keep, **options)
    _check_torques(design, pattern)
    # springs in series: the cup that the 2D model lacks, boss and housing
    series = series_compliance(design, cup=model == "2d")
    samples = MapSamples(
        **_in_series(pattern, series),
        name=drive.name,
        level=model,
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        ratings=ratings,
        damping_ratio=design.joint.damping_ratio,
        order=_order(design),
        input_angle=pattern.theta,
        torque=pattern.torque,
        tolerances=None,
        free=pattern.free,
        solved=pattern.solved,
        solved_angles=pattern.solved_angles,
        worst=None,
        unseen=pattern.unseen.in_series(series),
        shortfall=pattern.shortfall,
        fields=drive_fields(
            design, pattern.states, shown, surface, symmetric=symmetric
        ),
        info=pattern.info
        | {
            "design_hash": given.content_hash(),
            "label": label_of(given, model),
            "ratings_source": ratings.source,
            "truncated": pattern.truncated,
        },
    )
    if effort.worst:
        positions = worst_positions(fit_map(samples), samples, pattern.corners)
        worst = pattern.solve_at(positions)
        worst = None if worst is None else worst.in_series(series)
        samples = replace(samples, worst=worst)
    # fewer solves than announced may have been needed
    progress(stage, total, total)
    if flawed:
        top = float(pattern.torque[-1])
        if top not in found:  # a solve failed at the largest torque later
            with_errors(top)
        samples = replace(samples, tolerances=found[top].in_series(series))
    spent = {"solves": done, "sampling_wall_s": time.perf_counter() - begin}
    return replace(samples, info=samples.info | spent)


def _solved(
    design: Design,
    model: str,
    effort: Effort,
    tick: Callable[[], None],
    keep: Unfinished | None,
    **options: Any,
) -> tuple[Pattern[Any], Callable[[Any], SectorFields], ShapeSurface]:
    """Pattern of equilibria of a drive in the 2D or 3D model.

    Returns:
        The pattern, a function that returns the fields of one of its equilibria, and
        the surface on which the fields are displayed.

    Raises:
        ComputationError: If the unloaded drive or all torques cannot be solved.
    """
    ratings, period = ratings_of(design), 2.0 * pi / design.periodicity
    torques = _initial_torques(design)
    series = None
    if keep is not None:
        series = UnfinishedSeries(keep=keep, name="solve-{:04d}")
    settings: dict[str, Any] = {
        "small": SMALL * ratings.rated_torque,
        "rated": ratings.rated_torque,
        "symmetric": has_mirror_symmetry(design),
        "tick": tick,
        "keep": series,
        **options,
    }
    try:
        # two calls, because states of 2D and 3D models have different types
        pattern: Pattern[Any]
        if model == "3d":
            solid = _follower_3d(design)
            pattern = solve_mesh_cycle(solid, period, torques, effort, **settings)
            surface = solid_surface(solid.model)
            return pattern, partial(solid_fields, solid.model, surface=surface), surface
        plane = follower_in_plane(design)
        pattern = solve_mesh_cycle(plane, period, torques, effort, **settings)
        surface = plane_surface(plane.model)
        return pattern, partial(plane_fields, plane.model, surface=surface), surface
    except ComputationError as failure:
        raise ComputationError(f"{design.drive.name}: {failure}") from failure
    finally:
        if series is not None:
            series.flush()


def _initial_torques(design: Design) -> list[float]:
    """Initial torques of every angle [N·m]; only positive ones if symmetric."""
    peak = ratings_of(design).repeated_peak
    parts = [part * peak for part in LEVELS]
    if has_mirror_symmetry(design):
        return parts
    return [-t for t in parts[::-1]] + parts


def _check_torques(design: Design, pattern: Pattern[Any]) -> None:
    """Reject a pattern with too few torques for a map."""
    used = pattern.torque
    if used[0] >= 0.0 or used[-1] <= 0.0 or used.size < 5:
        peak = ratings_of(design).repeated_peak
        raise ComputationError(
            f"{design.drive.name}: too few torques for a map can be solved; tried"
            f" {LEVELS[0] * peak:g} N·m to {LEVELS[-1] * peak:g} N·m (repeated peak)"
        )


def _in_series(pattern: Pattern[Any], series: float) -> dict[str, Array]:
    """Tables of a pattern by name, with a compliance [rad/(N·m)] added in series."""
    torque = pattern.torque
    error, energy, compliance, input_torque = pattern.table
    return {
        "output_error": error - (torque * series)[:, None],
        "energy": energy + (0.5 * torque**2 * series)[:, None],
        "compliance": compliance + series,
        "input_torque": input_torque,
    }


def _order(design: Design) -> tuple[int, int]:
    """Numbers p and q of a pattern that is a function of p alpha + q beta.

    Of the gear angles alpha and beta, the one that depends on the input only determines
    the pattern. Its sign is such that the phase grows with the input angle theta.
    """
    alpha, beta = angle_coefficients(design.drive.layout)
    cycles = design.periodicity
    return (cycles, 0) if alpha == (1, 0) else (0, cycles * beta[0])


def effort_of(
    model: str, angles: int | None, *, both_signs: bool, errors: bool
) -> Effort:
    """Budget of equilibria of a map.

    Args:
        model: Fidelity, ``2d`` or ``3d``.
        angles: Number of input positions over one pitch; None for as many as the drive
            needs.
        both_signs: Whether negative torques are sampled as well.
        errors: Whether manufacturing errors are superposed.
    """
    solid, chosen = model == "3d", angles is None
    unseen = SOLID_UNSEEN if solid else TOLERANCED_UNSEEN if errors else UNSEEN
    if angles is not None:
        # a quick map is validated at the same number of torques but at fewer angles
        unseen = unseen[0], min(unseen[1], max(2, angles // 4))
        solves = angles * FIXED_SOLVES + unseen[0] * unseen[1]
        most = angles
    else:
        solves = SOLID_SOLVES if solid else TOLERANCED_SOLVES if errors else SOLVES
        angles = SOLID_ANGLES if solid else TOLERANCED_ANGLES if errors else ANGLES
        most = angles
        while 2 * most <= (SOLID_MOST_ANGLES if solid else MOST_ANGLES):
            most *= 2
    return Effort(
        angles=angles,
        most_angles=most,
        solves=solves * (2 if both_signs else 1),
        unseen=unseen,
        torques=TOLERANCED_TORQUES if errors else TORQUES,
        faint=HELD if errors else FAINT,
        # in 3D these solves are better spent on other torques, and a map with tooth
        # errors is extrapolated beyond its samples anyway
        beyond=not solid and not errors,
        corners=CORNERS if chosen and not solid and not errors else 0.0,
        worst=chosen and not solid and not errors,
    )


def follower_in_plane(design: Design) -> Continuation:
    """Solver of the 2D drive that maps sample, without errors and friction."""
    model = sector_model(
        without_errors(design), half="auto", friction=False, cage_held=True
    )
    return Continuation(
        model=model,
        ratio=design.ratio,
        layout=design.drive.layout,
        solver=map_solver(model.lobe_height),
    )


def _follower_3d(design: Design) -> SolidContinuation:
    """Solver of the 3D drive that maps sample, without manufacturing errors."""
    perfect = without_errors(design)
    return SolidContinuation(
        model=solid_sector_model(perfect, half="auto"),
        ratio=design.ratio,
        layout=design.drive.layout,
    )
