"""Finite element solves of a drive map and the fit to them."""

from __future__ import annotations

import numpy as np

from swgjoint.errors import ComputationError, DesignError
from swgjoint.fe.common.sampling import sample_map
from swgjoint.fe.plane import drive2d
from swgjoint.fe.plane.figures.friction_loop import friction_loops
from swgjoint.fe.rings import sampling as thin_ring
from swgjoint.fe.rings.friction_loops import ring_friction_loops
from swgjoint.fe.rings.losses import loss_model
from swgjoint.fe.solid import drive3d
from swgjoint.gear.catalogue_stated import LOSS_KEYS
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.friction_bending import without_friction
from swgjoint.maps.fit.friction_fit import friction_of_losses
from swgjoint.maps.fit.hysteresis_loops import with_hysteresis
from swgjoint.maps.friction_temperature import KEY, at_temperature, friction_table
from swgjoint.maps.sheet.efficiency import EfficiencyTable, efficiency_of_map
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress
from swgjoint.units import ZERO_CELSIUS, rpm


def solve_map(
    design: Design,
    model: str,
    angles: int | None,
    *,
    progress: Progress,
    keep: Unfinished | None,
    perfect_keep: Unfinished | None,
) -> DriveMap:
    """The map of a design without speed-dependent losses, from new solves.

    Args:
        design: The drive, without the table ``[losses]``.
        model: Fidelity, ``ring``, ``2d`` or ``3d``.
        angles: Number of wave-generator positions; None for the default.
        progress: Called with the stage, the number of finished solves and their total.
        keep: Store of finished solves; None for none.
        perfect_keep: Store of ring results without errors and friction.

    Raises:
        DesignError: If the design cannot be built or contains something that the model
            does not cover.
        ComputationError: If the solver converges at none of the torques.
    """
    check_level(design, model)
    if model == "3d":
        minutes = "10 to 20 min" if has_errors(design) else "2 to 5 min"
        hint = f"takes {minutes}; 2d and ring are faster"
        progress(f"map of {design.drive.name} in 3D, {hint}", 0, 1)
    if model == "ring":
        samples = thin_ring.sample_thin_rings(
            design,
            angles=angles,
            progress=progress,
            keep=keep,
            perfect_keep=perfect_keep,
        )
    else:
        samples = sample_map(
            design, model=model, angles=angles, progress=progress, keep=keep
        )
    drive = fit_map(samples)
    if design.friction.tooth_coefficient:
        store = perfect_keep if model == "ring" else keep
        drive = _with_friction(design, drive, progress, store)
    return _without_losses(design, drive)


def check_level(design: Design, model: str) -> None:
    """Reject designs without a map at a level.

    A feature that a level lacks is no reason: it is left out, and the label of the map
    names it, see :func:`swgjoint.fe.plane.drive2d.unmodelled_parts`.

    Args:
        design: The drive.
        model: Level of the map: ``ring``, ``2d`` or ``3d``.

    Raises:
        DesignError: If the level is unknown, or the design lacks what the level
            needs: a cup in 3D; a bearing with a smooth cam for thin rings.
    """
    if model == "3d":
        drive3d.check_modelled(design)
    elif model == "ring":
        # the map is transformed from this layout to that of the design
        thin_ring.check_modelled(
            design.with_changes({"drive.layout": "circular_spline_fixed"})
        )
    else:
        drive2d.check_modelled(design, model)


def _with_friction(
    design: Design, drive: DriveMap, progress: Progress, keep: Unfinished | None
) -> DriveMap:
    """The map with hysteresis from tooth friction, or the reason why it has none."""
    top = min(drive.ratings.repeated_peak, *(abs(t) for t in drive.torque_range))
    try:
        solve = ring_friction_loops if drive.level == "ring" else friction_loops
        loops = solve(
            design,
            top=top,
            rated=drive.ratings.rated_torque,
            progress=progress,
            keep=keep,
        )
    except ComputationError as failure:
        reason = f"friction of the teeth gives no hysteresis: {failure}"
        missing = {**drive.info.get("missing", {}), "hysteresis_loss_arcmin": reason}
        return drive.with_parts(info={**drive.info, "missing": missing})
    return with_hysteresis(drive, loops)


def with_losses(design: Design, drive: DriveMap, progress: Progress) -> DriveMap:
    """The map with friction at speed from ``[losses]``, or the reason why not.

    Args:
        design: The drive, with the table ``[losses]``.
        drive: Its map without these losses.
        progress: Called with the stage, the number of finished solves and their total.
    """
    assert design.losses is not None
    info = {**drive.info, "design_hash": design.content_hash()}
    try:
        model = loss_model(design, progress=progress)
        own = model.conditions
        laws = {
            temperature: friction_of_losses(
                model.catalogue_losses(temperature),
                design.ratio,
                film=model.film(temperature),
                source="bearing maker's model, teeth, race, bending and seals of the"
                " design",
            )
            for temperature in sorted({*own.temperatures(), own.temperature})
        }
    except (ComputationError, DesignError) as failure:
        why = "; ".join(str(failure).splitlines())
        missing = {**info.get("missing", {}), **dict.fromkeys(LOSS_KEYS, why)}
        return drive.with_parts(info={**info, "missing": missing})
    missing = {k: v for k, v in info["missing"].items() if k not in LOSS_KEYS}
    section = design.losses
    table = friction_table(
        laws,
        lubricant=f"{section.grease.replace('_', ' ')} grease, base oil of"
        f" {section.base_oil_40C_mm2_s:g} and {section.base_oil_100C_mm2_s:g} mm²/s at"
        " 40 and 100 °C",
    )
    info = {**info, "missing": missing}
    simple = efficiency_of_map(drive.with_parts(info={**info, KEY: table}))
    assert simple is not None
    table["source"] += _simplification(model.table(), simple)
    drive = drive.with_parts(info={**info, KEY: table})
    return at_temperature(drive, own.temperature, where=design.drive.name)


def _simplification(model: EfficiencyTable, law: EfficiencyTable) -> str:
    """Remark on the largest difference of the law of a map from the model.

    The law has the same losses at rest, without load and at rated torque at 2000 rpm.

    Args:
        model: Efficiency of the model.
        law: Efficiency of the law at the same speeds, of which loads and temperatures
            that both tables have are compared.
    """
    (T, *at), (load, *under) = (
        np.intersect1d(np.round(one, 6), np.round(other, 6), return_indices=True)
        for one, other in (
            (model.temperature, law.temperature),
            (model.load, law.load),
        )
    )
    exact, simple = (
        table.efficiency[rows][:, :, columns]
        for table, rows, columns in zip((model, law), at, under, strict=True)
    )
    if not exact.size:
        return ""
    off = np.abs(exact - simple).max()
    low, high = T[[0, -1]] - ZERO_CELSIUS
    loads = 100.0 * load[[0, -1]] / law.load[-1]
    return (
        f"; the efficiency of this law is within {100.0 * off:.2g} percentage points of"
        f" that of the model at {law.speed[0] / rpm:.4g} to"
        f" {law.speed[-1] / rpm:.4g} rpm, {loads[0]:.3g} to {loads[1]:.3g} % of the"
        f" rated torque and {low:.3g} to {high:.3g} °C"
    )


def _without_losses(design: Design, drive: DriveMap) -> DriveMap:
    """The map with the reason why it has no speed-dependent losses."""
    missing = dict.fromkeys(LOSS_KEYS, without_friction(design))
    missing |= drive.info.get("missing", {})
    return drive.with_parts(info={**drive.info, "missing": missing})
