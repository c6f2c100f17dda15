"""The spec sheet of any drive: a design, a map or a catalogue name.

Of a map alone :mod:`swgjoint.maps.sheet.spec_sheet` measures the figures. A design has
more to tell: radial stiffness and fatigue of the 3D model, the ratcheting torque, and
lower bounds of the running torque.
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
"""Wave-generator positions of a design's map where every wanted figure is read with the
input locked at the first one, without manufacturing errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveSheet:
    """A spec sheet and what stands behind its figures."""

    design: str
    """Name of the drive."""
    sheet: SpecSheet
    result: dict[str, Any]
    """The sheet under the keys of ``swgjoint spec --json``."""
    overlay: Overlay | None
    """A measured loop over the prediction."""


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
        drive: A design, a map, or what names one: a file, a bundled name, a catalogue
            drive such as ``CSG-25-100``.
        model: Fidelity of the finite elements of a design, ``ring``, ``2d`` or ``3d``;
            by default ``3d`` for a design with a cup, else ``2d``.
        only: Keys of :data:`swgjoint.maps.sheet.spec_sheet.KEYS` that are wanted, and
            no more is computed than they need; all if empty. The ratcheting torque is
            computed only where it is named.
        measured: CSV file of a measured torque-torsion loop, input locked, that is
            laid over the prediction: ``torque_Nm`` with ``torsion_arcmin`` or
            ``torsion_rad``.
        progress: Called while finite elements are solved.

    Returns:
        The figures, None where the source cannot tell, with the reason in ``missing``;
        ``design``; ``validity`` (level, torque range, what was left out);
        ``uncertain`` (by key, what the map misses); ``validation`` of the map against
        unseen solves (None with ``validation_reason``) and ``validation_notes``;
        ``stated`` by the catalogue; what stands behind figures of a design
        (``radial_stiffness``, ``fatigue``, ``ratcheting``, ``running``); ``measured``,
        see :meth:`swgjoint.maps.fit.overlay.Overlay.as_dict`; ``wall_s``.

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
    """The sheet of a drive with the objects that pictures need; see `spec_sheet`."""
    start = time.perf_counter()
    keys, loop = check_keys(only), None
    if measured is not None:
        from swgjoint.maps.fit.measurement import read_loop

        loop = read_loop(measured)
    source = find_drive(drive)
    found = _map(source, model, keys, always=loop is not None, progress=progress)
    ratings = ratings_of(source) if isinstance(source, Design) else source.ratings
    if found is not None:
        ratings = found.ratings
    more = _Figures()
    if isinstance(source, Design):
        more.add_solid(source, model, keys, ratings, progress)
        if only:
            more.add_ratcheting(source, keys, progress)
        more.add_running(source, keys)
    sheet = measure_spec(
        found, ratings=ratings, only=keys, known=more.values, unknown=more.reasons
    )
    name = source.drive.name if isinstance(source, Design) else source.name
    result: dict[str, Any] = {"design": name, **sheet.as_dict(), **more.details}
    result |= _validity(found, ratings, keys)
    overlay = None
    if loop is not None:
        assert found is not None
        from swgjoint.maps.fit.loop_units import check_units
        from swgjoint.maps.fit.overlay import overlay as laid_over

        doubts = check_units(str(measured), loop, found.ratings.rated_torque)
        overlay = laid_over(found, loop)
        content = overlay.as_dict()
        content["warnings"] = [*doubts, *content["warnings"]]
        result["measured"] = {"file": str(measured), **content}
    result |= {"wall_s": time.perf_counter() - start}
    return DriveSheet(design=name, sheet=sheet, result=result, overlay=overlay)


def _map(
    source: Design | DriveMap,
    model: str | None,
    keys: tuple[str, ...],
    *,
    always: bool,
    progress: Progress,
) -> DriveMap | None:
    """The map; None where the ratings of a design suffice, unless always."""
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
    """What the figures stand for."""
    if drive is None:
        found: dict[str, Any] = {"level": "design", "ratings": ratings.source}
        return {"validity": found, **validation_of_sheet(None, keys)}
    found = validity(drive)
    if "manufacturing_errors" in drive.info:
        found["manufacturing_errors"] = drive.info["manufacturing_errors"]
    label = drive.info.get("label")
    if isinstance(label, dict) and label.get("stress_state"):
        found["stress_state"] = label["stress_state"]
    stated = drive.info.get("stated")
    return {
        "validity": found,
        **validation_of_sheet(drive, keys),
        "stated": stated if isinstance(stated, dict) else None,
    }


@dataclass(kw_only=True)
class _Figures:
    """Figures of a design that no map holds."""

    values: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    """Why a figure is missing."""
    details: dict[str, Any] = field(default_factory=dict)
    """What stands behind the figures."""

    def add_solid(
        self,
        design: Design,
        model: str | None,
        keys: tuple[str, ...],
        ratings: Ratings,
        progress: Progress,
    ) -> None:
        """Radial stiffness and fatigue of the 3D model."""
        wanted = [key for key in SOLID_KEYS if key in keys]
        if not wanted:
            return
        if model not in (None, "3d"):
            reason = f"needs the 3d model, not --model {model}"
            self.reasons |= dict.fromkeys(wanted, reason)
            return
        from swgjoint.fe.solid.figures.spec_figures import solid_figures

        found = solid_figures(design, wanted, ratings.rated_torque, progress=progress)
        self.values |= found.values
        self.reasons |= found.missing
        self.details |= found.details

    def add_ratcheting(
        self, design: Design, keys: tuple[str, ...], progress: Progress
    ) -> None:
        """Ratcheting torque, or the lower bound at which the search ended."""
        if RATCHETING_KEY not in keys:
            return
        from swgjoint.fe.plane.ratcheting import ratcheting_path

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
                f"more than {path['limit_Nm']:.4g} N·m (a lower bound, where the search"
                f" ended: {path['outcome']}): the plane has a rigid wave generator, and"
                f" the outside of the circular spline is {rim}"
            )

    def add_running(self, design: Design, keys: tuple[str, ...]) -> None:
        """What friction of teeth and race takes of the unloaded input.

        A lower bound, a small part of what a drive takes: no figure, but the reason
        why there is none.
        """
        wanted = [key for key in SLOW_KEYS if key in keys]
        if not wanted:
            return
        from swgjoint.fe.rings.running import LEFT_OUT, running_friction

        mu = design.friction.tooth_coefficient
        found, why = None, "nothing rubs with friction.tooth_coefficient = 0"
        if mu:
            try:
                found = running_friction(design)
            except (ComputationError, DesignError) as error:
                why = "; ".join(str(error).splitlines())
        if found is None:
            self.reasons |= dict.fromkeys(wanted, f"{why}; {without_friction(design)}")
            return
        self.details["running"] = found.as_dict(mu)
        figures = (found.running_torque(mu), found.starting_torque(mu))
        for key, figure in zip(SLOW_KEYS, figures, strict=True):
            if key in wanted:
                self.reasons[key] = (
                    f"more than {figure:.3g} N·m (friction of teeth and race, a lower"
                    f" bound); not modelled: {LEFT_OUT}"
                )
