"""No-load running torque and starting torque compared with the catalogue.

Our values include the friction of sliding teeth, of the rim on its race and of rolling
balls. The catalogue values also include churning grease and seals. Our values should
therefore be lower bounds; the summary reports whether they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swgjoint.fe.rings.running import LEFT_OUT, RunningFriction
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.rolling_friction import BASE_OILS
from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.catalogue_stated import LOSS_CONDITIONS, stated_losses
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.friction_bending import bending_torque
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.units import mm
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import catalogue_row
from swgjoint.validation.catalogue.rows import bracket_row
from swgjoint.validation.catalogue.runs import CatalogueTask, Found
from swgjoint.validation.rows import Row

RUNNING = "no-load running torque"
STARTING = "starting torque"
_MILLI = 1e-3


def loss_tasks(study: CatalogueFile) -> list[CatalogueTask]:
    """Computations for every drive with catalogue losses and every flank angle.

    The cup has no losses, so variants that differ only in the cup share a computation.
    """
    flanks = {v.flank_deg: v for v in reversed(study.variants)}
    return [
        CatalogueTask(
            name=_name(size, ratio, flank),
            kind="running",
            design=variant_design(size, ratio, variant),
            work=0.5,
        )
        for ratio in study.ratios
        for size in study.sizes
        if stated_losses(catalogue_row(size, ratio)) is not None
        for flank, variant in flanks.items()
    ]


def _name(size: int, ratio: int, flank: float) -> str:
    return f"running {size} {ratio} {flank:g}"


def running_of(found: Found, design: Design) -> RunningFriction:
    """Convert a result of kind ``running`` to :class:`RunningFriction`.

    Args:
        found: The result.
        design: The drive.
    """
    return RunningFriction.from_json(found, BallBearing.from_design(design))


def loss_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found]
) -> list[Row]:
    """Rows of no-load running torque and starting torque of a drive.

    Their brackets cover all flank angles, friction coefficients and base oils.

    Args:
        study: Study file.
        row: Ratings of the drive.
        found: Results by computation.

    Returns:
        Two rows; none if the catalogue states no losses for the drive.
    """
    stated = stated_losses(row)
    if stated is None:
        return []
    values: dict[str, list[float]] = {RUNNING: [], STARTING: []}
    faults, slows = list[str](), list[RunningFriction]()
    for flank in dict.fromkeys(v.flank_deg for v in study.variants):
        one = found[_name(row.size, row.ratio, flank)]
        if "fault" in one:
            faults.append(f"{flank:g} deg: {one['fault']}")
            continue
        slow = running_of(one, variant_design(row.size, row.ratio, study.variants[0]))
        slows.append(slow)
        for mu in study.coefficients:
            values[STARTING].append(slow.starting_torque(mu) / _MILLI)
            values[RUNNING] += [
                slow.running_torque(mu, RUNNING_SPEED, oil) / _MILLI
                for oil in BASE_OILS
            ]
    why = list(faults)
    if slows:
        share = 100.0 * max(slow.teeth_share for slow in slows)
        pairs = max(float(slow.tooth_pairs.mean()) for slow in slows)
        bending = bending_torque(variant_design(row.size, row.ratio, study.variants[0]))
        coefficients = " to ".join(f"{mu:g}" for mu in study.coefficients)
        force = max(float(slow.lobe_force.mean()) for slow in slows)
        low, high = (round(oil / mm**2, 9) for oil in BASE_OILS)
        why.append(
            f"Coulomb friction {coefficients} of the rim on its race and of the teeth"
            f" (teeth {share:.3g} %, {pairs:.2g} pairs in contact), and balls that roll"
            f" under {force:.3g} N at each lobe, in grease with a base oil of"
            f" {low:g} to {high:g} mm2/s; not included: {LEFT_OUT}"
            f" ({bending / _MILLI:.2g} mN·m, loss factor assumed)"
        )
    printed = {
        RUNNING: (stated.no_load_running, f"2000 rpm, {LOSS_CONDITIONS}"),
        STARTING: (stated.starting, LOSS_CONDITIONS),
    }
    return [
        bracket_row(
            row,
            quantity,
            "mN·m",
            source / _MILLI,
            values[quantity],
            "; ".join(why),
            whole=not faults,
            conditions=conditions,
        )
        for quantity, (source, conditions) in printed.items()
    ]


def loss_lines(rows: Sequence[Row]) -> list[str]:
    """Lines that state, by quantity, whether our torques are below the catalogue."""
    lines = []
    for quantity in (RUNNING, STARTING):
        over = {
            row.case: row.more["high_over_source"]
            for row in rows
            if row.quantity == quantity and row.more["high_over_source"] is not None
        }
        if not over:
            continue
        above = [case for case, part in over.items() if part >= 1.0]
        least, most = (
            100.0 * part for part in (min(over.values()), max(over.values()))
        )
        lines.append(
            f"{quantity}: friction of teeth, race and balls is at most {least:.2g} to"
            f" {most:.2g} % of the catalogue value; a lower bound in"
            f" {len(over) - len(above)} of {len(over)} cases"
            + f", above the catalogue in {', '.join(above)}"
            * bool(above)
        )
    return lines
