"""The spec sheet of any drive: a design, a map or a catalogue name.

:mod:`swgjoint.maps.sheet.spec_sheet` measures the figures of a map. A design provides
further figures: radial stiffness and fatigue of the 3D model, the ratcheting torque,
and lower bounds of the running torque.
"""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint.drives.references import find_drive, load_drive
from swgjoint.errors import ComputationError, DesignError
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.cache import recall
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.friction_bending import without_friction
from swgjoint.maps.sheet.efficiency import EfficiencyTable, efficiency_of_map
from swgjoint.maps.sheet.spec_sheet import (
    RATCHETING_KEY,
    SLOW_KEYS,
    SOLID_KEYS,
    SpecSheet,
    check_keys,
    measure_spec,
    needs_map,
    needs_turn,
    validity,
)
from swgjoint.maps.sheet.validation_notes import validation_of_sheet
from swgjoint.progress import Progress, silent

if TYPE_CHECKING:
    from swgjoint.maps.fit.overlay import Overlay

FEW_ANGLES = 3
"""Number of wave-generator positions in the map of a design if the requested figures
need only the first position, where the input is locked; the design is then modelled
without manufacturing errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveSheet:
    """A spec sheet with the data behind its figures."""

    design: str
    """Name of the drive."""
    sheet: SpecSheet
    """The figures of the drive."""
    result: dict[str, Any]
    """The sheet under the keys of ``swgjoint spec --json``."""
    overlay: Overlay | None
    """Comparison of a measured loop with the prediction; None without measurement."""
    efficiency: EfficiencyTable | None
    """Efficiency over load, speed and temperature; None if not requested, or without
    friction over temperature."""


def spec_sheet(
    drive: str | Path | Design | DriveMap,
    *,
    model: str | None = None,
    only: Collection[str] = (),
    measured: str | Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Catalogue-style sheet of a drive, as ``swgjoint spec --json`` prints it.

    Args:
        drive: A design, a map, or the name of one: a file, a bundled name, or a
            catalogue drive such as ``CSG-25-100``.
        model: Finite element model of a design, ``ring``, ``2d`` or ``3d``; by default
            ``3d`` for a design with a cup, otherwise ``2d``.
        only: Requested keys of :data:`swgjoint.maps.sheet.spec_sheet.KEYS`, all if
            empty; only what they need is computed. The ratcheting torque is computed
            only if it is listed.
        measured: CSV file of a measured torque-torsion loop with locked input, which is
            compared with the prediction; columns ``torque_Nm`` and ``torsion_arcmin``
            or ``torsion_rad``.
        progress: Called while finite elements are solved.

    Returns:
        The figures, or None with the reason in ``missing`` where the source does not
        provide one; ``design``; ``validity`` (level, torque range, omitted effects);
        ``uncertain`` (by key, what the map does not cover); ``validation`` of the map
        against solves that were not used in the fit (None with
        ``validation_reason``) and ``validation_notes``; ``stated`` by the catalogue;
        the data behind figures of a design (``radial_stiffness``, ``fatigue``,
        ``ratcheting``, ``running``, ``losses``); ``efficiency`` over load, speed and
        temperature, if the drive has friction over temperature; ``measured``, see
        :meth:`swgjoint.maps.fit.overlay.Overlay.as_dict`; ``wall_s``.

    Raises:
        InputError: If the drive, a key, the fidelity or the file cannot be used.
        DesignError: If the design cannot be built.
        ComputationError: If the finite elements fail.

    >>> spec_sheet("CSG-25-100", only=["rated_torque_Nm"])["rated_torque_Nm"]
    87.0
    """
    return measure_drive(
        drive, model=model, only=only, measured=measured, progress=progress
    ).result


def measure_drive(
    drive: str | Path | Design | DriveMap,
    *,
    model: str | None = None,
    only: Collection[str] = (),
    measured: str | Path | None = None,
    progress: Progress = silent,
) -> DriveSheet:
    """Spec sheet of a drive together with the data behind its figures.

    Args:
        drive: See :func:`spec_sheet`.
        model: See :func:`spec_sheet`.
        only: See :func:`spec_sheet`.
        measured: See :func:`spec_sheet`.
        progress: See :func:`spec_sheet`.

    Returns:
        The sheet, its dictionary for ``--json``, and the comparison with ``measured``.
    """
    start = time.perf_counter()
    keys, loop = check_keys(only), None
    if measured is not None:
        from swgjoint.maps.fit.measurement import read_loop

        loop = read_loop(measured)
    source = find_drive(drive)
    design = source if isinstance(source, Design) else None
    lossy = design is not None and design.losses is not None
    always = loop is not None or (lossy and "back_driving_torque_Nm" in keys)
    drive_map = _map(source, model, keys, always=always, progress=progress)
    ratings = ratings_of(source) if isinstance(source, Design) else source.ratings
    if drive_map is not None:
        ratings = drive_map.ratings
    more = _Figures()
    if isinstance(source, Design):
        more.add_solid(source, model, keys, ratings, progress)
        if only:
            more.add_ratcheting(source, keys, progress)
        if lossy:
            more.add_losses(source, keys, progress)
        else:
            more.add_running(source, keys)
    elif drive_map is not None and "efficiency_percent" in keys:
        more.efficiency = efficiency_of_map(drive_map)
    sheet = measure_spec(
        drive_map,
        ratings=ratings,
        only=keys,
        known=more.values,
        unknown=more.reasons,
        progress=progress,
    )
    if more.efficiency is not None:
        more.details["efficiency"] = more.efficiency.as_dict()
    name = source.drive.name if isinstance(source, Design) else source.name
    result: dict[str, Any] = {"design": name, **sheet.as_dict(), **more.details}
    result |= _validity(drive_map, ratings, keys)
    overlay = None
    if loop is not None:
        assert drive_map is not None
        from swgjoint.maps.fit.loop_units import check_units
        from swgjoint.maps.fit.overlay import overlay as compare

        doubts = check_units(str(measured), loop, drive_map.ratings.rated_torque)
        overlay = compare(drive_map, loop)
        content = overlay.as_dict()
        content["warnings"] = [*doubts, *content["warnings"]]
        result["measured"] = {"file": str(measured), **content}
    result |= {"wall_s": time.perf_counter() - start}
    return DriveSheet(
        design=name,
        sheet=sheet,
        result=result,
        overlay=overlay,
        efficiency=more.efficiency,
    )


def _map(
    source: Design | DriveMap,
    model: str | None,
    keys: tuple[str, ...],
    *,
    always: bool,
    progress: Progress,
) -> DriveMap | None:
    """The map; None if the ratings of a design suffice, unless ``always`` is set."""
    if not needs_map(keys) and not always:
        if isinstance(source, Design):
            return None
        if model is None:
            return source
    turn = needs_turn(keys)
    return load_drive(
        source,
        model=model,
        angles=None if turn else FEW_ANGLES,
        errors=turn,
        progress=progress,
    )


def _validity(
    drive: DriveMap | None, ratings: Ratings, keys: tuple[str, ...]
) -> dict[str, Any]:
    """Model, range and validation of the figures."""
    if drive is None:
        valid_for: dict[str, Any] = {"level": "design", "ratings": ratings.source}
        return {"validity": valid_for, **validation_of_sheet(None, keys)}
    valid_for = validity(drive)
    if "manufacturing_errors" in drive.info:
        valid_for["manufacturing_errors"] = drive.info["manufacturing_errors"]
    label = drive.info.get("label")
    if isinstance(label, dict):
        for key in ("stress_state", "left_out"):
            if label.get(key):
                valid_for[key] = label[key]
        if label.get("friction"):
            valid_for["ripple"] = "without friction of the teeth"
    stated = drive.info.get("stated")
    return {
        "validity": valid_for,
        **validation_of_sheet(drive, keys),
        "stated": stated if isinstance(stated, dict) else None,
    }


@dataclass(kw_only=True)
class _Figures:
    """Figures of a design that a map does not contain."""

    values: dict[str, float] = field(default_factory=dict)
    """Figures by key, in the unit of the key."""
    reasons: dict[str, str] = field(default_factory=dict)
    """Reason why a figure is missing, by key."""
    details: dict[str, Any] = field(default_factory=dict)
    """Data behind the figures."""
    efficiency: EfficiencyTable | None = None
    """Efficiency over load, speed and temperature."""

    def add_solid(
        self,
        design: Design,
        model: str | None,
        keys: tuple[str, ...],
        ratings: Ratings,
        progress: Progress,
    ) -> None:
        """Add radial stiffness and fatigue of the 3D model."""
        wanted = [key for key in SOLID_KEYS if key in keys]
        if not wanted:
            return
        if model not in (None, "3d"):
            reason = f"needs the 3d model, not --model {model}"
            self.reasons |= dict.fromkeys(wanted, reason)
            return
        from swgjoint.fe.solid.figures.spec_figures import solid_figures

        solid = solid_figures(design, wanted, ratings.rated_torque, progress=progress)
        self.values |= solid.values
        self.reasons |= solid.missing
        self.details |= solid.details

    def add_ratcheting(
        self, design: Design, keys: tuple[str, ...], progress: Progress
    ) -> None:
        """Add the ratcheting torque, or the lower bound at which the search ended."""
        if RATCHETING_KEY not in keys:
            return
        from swgjoint.fe.plane.figures.ratcheting import ratcheting_path

        path = recall(
            "figures",
            {"figure": RATCHETING_KEY, "design": design.content_hash()},
            dict[str, Any],
            lambda: ratcheting_path(design, progress=progress).as_dict(),
        )
        self.details["ratcheting"] = path
        if path["passed"]:
            self.values[RATCHETING_KEY] = path["limit_Nm"]
        else:
            rim = design.circular_spline.outer_rim
            self.reasons[RATCHETING_KEY] = (
                f"more than {path['limit_Nm']:.4g} N·m (lower bound; the search ended"
                f" with: {path['outcome']}): the 2D model has a centred wave generator"
                f" and a circular spline whose outside is {rim}"
            )

    def add_losses(
        self, design: Design, keys: tuple[str, ...], progress: Progress
    ) -> None:
        """Add the losses of a design with ``[losses]``, or the reason why not."""
        wanted = [key for key in (*SLOW_KEYS, "efficiency_percent") if key in keys]
        if not wanted:
            return
        from swgjoint.fe.rings.losses import loss_model

        try:
            model = loss_model(design, progress=progress)
        except (ComputationError, DesignError) as error:
            why = "; ".join(str(error).splitlines())
            self.reasons |= dict.fromkeys(wanted, why)
            return
        stated = model.catalogue_losses(model.conditions.temperature)
        self.values |= {
            "no_load_running_torque_Nm": stated.no_load_running,
            "starting_torque_Nm": model.starting_torque(),
            "efficiency_percent": 100.0 * stated.efficiency,
        }
        self.details["losses"] = model.as_dict()
        if "efficiency_percent" in keys:
            self.efficiency = model.table()

    def add_running(self, design: Design, keys: tuple[str, ...]) -> None:
        """Report the friction of teeth, race and balls as a bound on no-load torque.

        It is a lower bound and only a part of the no-load torque of a drive. It is
        therefore stated in the reason why the figure is missing.
        """
        wanted = [key for key in SLOW_KEYS if key in keys]
        if not wanted:
            return
        from swgjoint.fe.rings.running import LEFT_OUT, running_friction

        mu = design.friction.tooth_coefficient
        running, why = None, "no friction with friction.tooth_coefficient = 0"
        if mu:
            try:
                running = running_friction(design)
            except (ComputationError, DesignError) as error:
                why = "; ".join(str(error).splitlines())
        if running is None:
            self.reasons |= dict.fromkeys(wanted, f"{why}; {without_friction(design)}")
            return
        figures = self.details["running"] = running.as_dict(mu)
        low, high = figures["base_oil_mm2_s"]
        oil = f" at 2000 rpm with {low:g} to {high:g} mm2/s of base oil, assumed"
        keys_of = ("running_torque_Nm", "starting_torque_Nm")
        for key, figure, how in zip(SLOW_KEYS, keys_of, (oil, ""), strict=True):
            if key in wanted:
                self.reasons[key] = (
                    f"more than {figures[figure]:.3g} N·m (friction of teeth, race and"
                    f" rolling balls{how}; a lower bound); not modelled: {LEFT_OUT};"
                    " a table [losses] in the design gives a value"
                )
