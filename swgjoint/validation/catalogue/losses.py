"""No-load running torque, starting torque and efficiency compared with the catalogue.

The model has Coulomb friction of the teeth and of the rim on its race, rolling and
sliding balls, the drag of the balls in churning grease, and bending steel; see
:mod:`swgjoint.fe.rings.losses`. No parameter is fitted. The brackets cover both limits
of the grease, run in and flooded, and the ranges of the coefficient of friction, the
base oil and the loss factor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from swgjoint.fe.rings.running import RunningFriction
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.base_oil import MAKER_GREASES, ROOM
from swgjoint.gear.bearing.rolling_friction import BASE_OILS
from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.catalogue_stated import LOSS_CONDITIONS, stated_losses
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.friction_bending import STEEL_LOSS_FACTOR, STEEL_LOSS_FACTORS
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.units import mm
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.printed import catalogue_row
from swgjoint.validation.catalogue.rows import bracket_row
from swgjoint.validation.catalogue.runs import CatalogueTask, Found
from swgjoint.validation.rows import Row

RUNNING = "no-load running torque"
STARTING = "starting torque"
EFFICIENCY = "efficiency at rated torque"
GREASES = MAKER_GREASES.values()
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
            torques=(catalogue_row(size, ratio).rated_torque,),
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


@dataclass(frozen=True, kw_only=True)
class _Losses:
    """Figures of one drive under one set of conditions, in the units of the rows."""

    running: float
    efficiency: float


def _losses(
    free: RunningFriction,
    loaded: RunningFriction,
    useful: float,
    *,
    mu: float,
    oil: float,
    flooded: bool,
    loss_factor: float,
) -> _Losses:
    """Figures for friction without load and under rated torque.

    ``useful`` is the input torque without friction at rated torque [N·m].
    """
    torques = [
        one.running_torque(
            mu, RUNNING_SPEED, oil, flooded=flooded, loss_factor=loss_factor
        )
        for one in (free, loaded)
    ]
    return _Losses(
        running=torques[0] / _MILLI, efficiency=100.0 * useful / (useful + torques[1])
    )


def loss_rows(
    study: CatalogueFile, row: CatalogueRow, found: Mapping[str, Found]
) -> list[Row]:
    """Rows of running torque, starting torque and efficiency of a drive.

    Their brackets cover all flank angles, coefficients of friction, base oils, loss
    factors and both states of the grease. ``more["maker_greases"]`` of a row is the
    bracket of the flooded bearing with the greases of the drives' maker at 20 °C.

    Args:
        study: Study file.
        row: Ratings of the drive.
        found: Results by computation.

    Returns:
        Three rows; none if the catalogue states no losses for the drive.
    """
    stated = stated_losses(row)
    if stated is None:
        return []
    values: dict[str, list[float]] = {RUNNING: [], STARTING: [], EFFICIENCY: []}
    greases: dict[str, list[float]] = {RUNNING: [], EFFICIENCY: []}
    faults, drives = list[str](), list[tuple[RunningFriction, RunningFriction]]()
    useful = row.rated_torque / row.ratio
    for flank in dict.fromkeys(v.flank_deg for v in study.variants):
        one = found[_name(row.size, row.ratio, flank)]
        if "fault" in one:
            faults.append(f"{flank:g} deg: {one['fault']}")
            continue
        design = variant_design(row.size, row.ratio, study.variants[0])
        free, loaded = (running_of(x, design) for x in (one, one["loaded"][0]))
        drives.append((free, loaded))
        for mu, eta in product(study.coefficients, STEEL_LOSS_FACTORS):
            start = free.starting_torque(mu, loss_factor=eta)
            values[STARTING].append(start / _MILLI)
            oils = [(oil, full, False) for oil in BASE_OILS for full in (False, True)]
            oils += [(grease.viscosity(ROOM), True, True) for grease in GREASES]
            for oil, flooded, named in oils:
                losses = _losses(
                    free,
                    loaded,
                    useful,
                    mu=mu,
                    oil=oil,
                    flooded=flooded,
                    loss_factor=eta,
                )
                into = greases if named else values
                into[RUNNING].append(losses.running)
                into[EFFICIENCY].append(losses.efficiency)
    why = [*faults, *_parts(study, drives)] if drives else faults
    printed = {
        RUNNING: (stated.no_load_running / _MILLI, "mN·m", "2000 rpm, "),
        STARTING: (stated.starting / _MILLI, "mN·m", ""),
        EFFICIENCY: (100.0 * stated.efficiency, "%", "2000 rpm, "),
    }
    rows = []
    for quantity, (source, unit, speed) in printed.items():
        bracket = bracket_row(
            row,
            quantity,
            unit,
            source,
            values[quantity],
            "; ".join(why),
            whole=not faults,
            conditions=f"{speed}{LOSS_CONDITIONS}",
        )
        own = greases.get(quantity)
        ends = [min(own), max(own)] if own else None
        rows.append(replace(bracket, more={**bracket.more, "maker_greases": ends}))
    return rows


def _parts(
    study: CatalogueFile, drives: Sequence[tuple[RunningFriction, RunningFriction]]
) -> list[str]:
    """What the brackets cover, and the share of bending without load and at rated."""
    coefficients = " to ".join(f"{mu:g}" for mu in study.coefficients)
    low, high = (round(oil / mm**2, 9) for oil in BASE_OILS)
    etas = " to ".join(f"{eta:g}" for eta in STEEL_LOSS_FACTORS)
    lines = [
        f"bracket of Coulomb friction {coefficients} of the rim on its race and of the"
        f" teeth, a base oil of {low:g} to {high:g} mm2/s, grease run in to flooded,"
        f" loss factor {etas}; not included: seals, cage, yield of the grease"
    ]
    for name, part in (("without load", 0), ("at rated torque", 1)):
        ones = [drive[part] for drive in drives]
        share = 100.0 * max(one.teeth_share for one in ones)
        pairs = max(float(one.tooth_pairs.mean()) for one in ones)
        force = max(float(one.lobe_force.mean()) for one in ones)
        bending = max(float(one.bending.mean()) for one in ones) * STEEL_LOSS_FACTOR
        lines.append(
            f"{name}: balls roll under {force:.3g} N at each lobe, teeth {share:.3g} %"
            f" of the Coulomb friction ({pairs:.2g} pairs in contact), bending"
            f" {bending / _MILLI:.2g} mN·m at a loss factor of {STEEL_LOSS_FACTOR:g}"
        )
    return lines


def loss_lines(rows: Sequence[Row]) -> list[str]:
    """Lines that state, by quantity, whether the brackets contain the catalogue."""
    lines = []
    for quantity in (RUNNING, STARTING, EFFICIENCY):
        own = [row for row in rows if row.quantity == quantity]
        own = [row for row in own if row.more["high_over_source"] is not None]
        if not own:
            continue
        ends = {
            row.case: (row.more["low_over_source"], row.more["high_over_source"])
            for row in own
        }
        missed = {
            case: high if high < 1.0 else low
            for case, (low, high) in ends.items()
            if not low <= 1.0 <= high
        }
        text = (
            f"{quantity}: the bracket contains the catalogue value in"
            f" {len(own) - len(missed)} of {len(own)} cases"
        )
        if missed:
            parts = (f"{case} {100.0 * part:.2g} %" for case, part in missed.items())
            text += f"; its nearer end is, of the catalogue value: {', '.join(parts)}"
        lines.append(text)
        named = [row for row in own if row.more["maker_greases"]]
        if named:
            parts = (
                f"{row.case} {row.more['maker_greases'][0]:.3g} to"
                f" {row.more['maker_greases'][1]:.3g} ({row.source_value:.3g})"
                for row in named
            )
            lines.append(
                f"{quantity} [{own[0].unit}] with the greases of the drives' maker at"
                f" 20 °C, flooded (catalogue): {', '.join(parts)}"
            )
    return lines
