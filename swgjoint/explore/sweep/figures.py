"""Figures of one design of a sweep, computed in a process of the executor."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite, pi
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.drives.fidelity import default_model
from swgjoint.errors import InputError, MissingExtraError, SwgError
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import code_version
from swgjoint.maps.sheet.spec_sheet import LOOP_KEYS, RATING_KEYS, TURN_KEYS

if TYPE_CHECKING:
    from swgjoint.explore.sweep.points import Point
    from swgjoint.explore.sweep.tasks import MeshingTask, RunTask, SizeTask, SpecTask
    from swgjoint.fe.meshing_run import MeshingRun
    from swgjoint.fe.solid.meshing import SolidRun
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.maps.sheet.map_validity import Difference
    from swgjoint.sim.scene.scene import Scene

_STRESSES = ("von_mises_MPa", "tensile_MPa", "compressive_MPa")
_RING = "circular_spline_"
KINEMATIC = "kinematic_error_pp_arcsec"
STIFFNESS = "torsional_stiffness_Nm_rad"
MESHING_FIGURES = (
    *_STRESSES,
    *(f"{_RING}{name}" for name in _STRESSES),
    "transmission_error_pp_arcsec",
    KINEMATIC,
    "pairs_in_contact",
    "wave_generator_torque_pp_Nm",
    STIFFNESS,
)
"""Figures of the meshing task.

A stress is the largest one in the flexspline or circular spline, averaged over the
positions. The transmission error is the peak-to-peak output error over the positions
under the torque, the kinematic error that of a second, unloaded simulation. The torque
of the wave generator is also a peak-to-peak value. The number of pairs is the mean over
the positions. The stiffness is the reciprocal of the mean compliance under the torque,
including cup and mounting.
"""
RANGES = tuple(name for name in MESHING_FIGURES if "_pp_" in name)
"""Figures of the meshing task that are ranges, for which one position has no value."""
SPEC_FIGURES = tuple(
    key for key in (*RATING_KEYS, *LOOP_KEYS, *TURN_KEYS) if key != "orders"
)
"""Keys of the specification sheet that a sweep can compute."""
SIZE_FIGURES = ("outer_diameter_mm", "length_mm", "volume_cm3")
"""Outer diameter of the circular spline including its rim, length of the cup (face
width for a design without cup), and volume of the cylinder of this diameter and length.
"""
RUN_FIGURES = (
    "ripple_rms_percent",
    "ripple_pp_percent",
    "transmission_error_arcmin",
    "transmission_error_ripple_arcmin",
    "torsion_arcmin",
    "tool_path_rms_mm",
    "tool_ap_mm",
    "tool_rp_mm",
    "peak_torque_of_rating",
    "cubed_mean_torque_of_rating",
)
"""Figures of a run, see :class:`swgjoint.explore.compare.compare.Compared`."""

OK = "ok"
"""Outcome of a design with figures."""
LOST = "lost"
"""Outcome of a design that failed because of the machine."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """One design or scene, and the tasks to compute for it."""

    key: str
    """Key under which the record is stored."""
    design: Design | None
    scene: Scene | None
    meshing: MeshingTask | None
    spec: SpecTask | None
    size: SizeTask | None
    run: RunTask | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Record:
    """Outcome and figures of one design."""

    outcome: str
    """``ok``, ``refused`` (the values give no valid design), ``infeasible`` (the design
    cannot be built), ``failed`` (no solution), ``error`` (a bug) or ``lost`` (the
    process died, or memory, disk space or a package was missing). A lost record is not
    stored, because another machine may succeed."""
    reason: str = ""
    """Why there are no figures, or why some are missing or uncertain."""
    figures: dict[str, float | None] = field(default_factory=dict)
    """Figures by name; None where the model provides no value."""
    work_s: float = 0.0
    """Computing time in the process of the design [s]."""

    @property
    def ok(self) -> bool:
        """Whether there are figures."""
        return self.outcome == OK


def compute_all(points: Sequence[Point]) -> tuple[str, list[Record]]:
    """Compute the records of a task.

    Returns:
        Version of the code that computed them, and one record per point with a key.
    """
    asked = [one for point in points if (one := point.asked) is not None]
    _load(asked[0])  # all points of a sweep have the same tasks
    return code_version(), [compute(one) for one in asked]


def _load(first: Asked) -> None:
    """Import the modules that the tasks need, to exclude imports from ``work_s``."""
    from swgjoint.gear.design import feasibility  # noqa: F401
    from swgjoint.maps.sheet.spec_sheet import needs_map

    if first.meshing is not None:
        from swgjoint.fe import meshing  # noqa: F401
    mapped = first.spec is not None and needs_map(first.spec.figures)
    if mapped or (first.run is not None and first.design is not None):
        from swgjoint.drives import build_map  # noqa: F401
    if first.run is not None:
        from swgjoint.explore.compare import compare  # noqa: F401


def compute(asked: Asked) -> Record:
    """Compute the figures of one design; errors become part of the record."""
    begin = time.perf_counter()
    figures: dict[str, float | None] = {}
    reason = ""
    try:
        if asked.design is not None and (reason := _infeasible(asked.design)):
            outcome = "infeasible"
        else:
            found, reason = _figures(asked)
            # NaN becomes None, like a value that the model does not provide
            figures = {k: v if _finite(v) else None for k, v in found.items()}
            outcome = OK
    except InputError as error:
        outcome, reason = "refused", str(error)
    except (MemoryError, OSError, MissingExtraError) as error:
        outcome, reason = LOST, f"{type(error).__name__}: {error}"
    except SwgError as error:
        outcome, reason = "failed", str(error)
    except Exception as error:  # one design must not end the sweep
        outcome, reason = "error", f"{type(error).__name__}: {error}"
    return Record(
        outcome=outcome,
        reason="; ".join(reason.splitlines()),
        figures=figures,
        work_s=time.perf_counter() - begin,
    )


def _finite(value: float | None) -> bool:
    return value is not None and isfinite(value)


def _infeasible(design: Design) -> str:
    """Faults of the failed feasibility checks; empty for a feasible design."""
    from swgjoint.gear.design.feasibility import design_checks

    return "\n".join(check.fault for check in design_checks(design) if not check.ok)


def _figures(asked: Asked) -> tuple[dict[str, float | None], str]:
    figures: dict[str, float | None] = {}
    reasons: dict[str, str] = {}
    if asked.meshing is not None:
        assert asked.design is not None
        figures |= _meshing(asked.design, asked.meshing)
    if asked.spec is not None:
        assert asked.design is not None
        found, reasons = _spec(asked.design, asked.spec)
        figures |= found
    if asked.size is not None:
        assert asked.design is not None
        figures |= _size(asked.design, asked.size)
    if asked.run is not None:
        assert asked.scene is not None
        found, doubts = _run(asked.scene, asked.design, asked.run)
        figures |= found
        reasons = reasons | doubts
    return figures, "\n".join(f"{name}: {why}" for name, why in reasons.items())


def _meshing(design: Design, task: MeshingTask) -> dict[str, float | None]:
    """Figures of the meshing task: means and ranges over the positions."""
    from swgjoint.gear.catalogue import ratings_of
    from swgjoint.gear.mounting import series_compliance

    rated = ratings_of(design).rated_torque
    torque = rated if task.torque_Nm is None else task.torque_Nm
    found: dict[str, float | None] = {}
    if set(task.figures) - {KINEMATIC}:
        run = _simulated(design, task, torque)
        result = run.to_json()
        steps = result["per_step"]
        for member, above in (("flexspline", ""), ("circular_spline", _RING)):
            means = result[member]["average_max_MPa"]
            found |= {f"{above}{kind}_MPa": value for kind, value in means.items()}
        found["transmission_error_pp_arcsec"] = _range(steps["output_error_arcsec"])
        found["pairs_in_contact"] = float(np.mean(steps["pairs_in_contact"]))
        found["wave_generator_torque_pp_Nm"] = _range(steps["wave_generator_torque_Nm"])
        series = series_compliance(design, cup=_model(design, task) == "2d")
        compliance = float(np.mean([state.compliance for state in run.states]))
        found[STIFFNESS] = 1.0 / (compliance + series)
    if KINEMATIC in task.figures:
        steps = _simulated(design, task, 0.0).common_series()
        found[KINEMATIC] = _range(steps["output_error_arcsec"])
    return {name: found[name] for name in task.figures}


def _model(design: Design, task: MeshingTask) -> str:
    return task.model or default_model(design)


def _simulated(
    design: Design, task: MeshingTask, torque: float
) -> MeshingRun | SolidRun:
    """Simulate meshing with every position solved."""
    from swgjoint.fe.meshing import simulate_meshing

    turn, model = 1.0 / design.periodicity, _model(design, task)
    return simulate_meshing(
        design,
        model=model,
        torque=torque,
        steps=task.positions,
        turn=turn if task.turn_deg is None else task.turn_deg / 360.0,
        half="auto",
    )


def _range(values: Sequence[float]) -> float:
    return float(np.ptp(values))


def _map(
    design: Design, task: SpecTask | RunTask, *, turn: bool
) -> tuple[DriveMap, Design]:
    from swgjoint.drives.build_map import build_map
    from swgjoint.gear.design.tolerances import has_errors, without_errors

    # figures with locked input are those of the drive without tooth errors
    if not turn and has_errors(design):
        design = without_errors(design)
    return build_map(design, model=task.model, angles=task.angles), design


def _spec(
    design: Design, task: SpecTask
) -> tuple[dict[str, float | None], dict[str, str]]:
    """Figures of the spec sheet, and the reasons for missing ones."""
    from swgjoint.gear.catalogue import ratings_of
    from swgjoint.maps.sheet.spec_sheet import (
        check_keys,
        measure_spec,
        needs_map,
        needs_turn,
    )

    keys = check_keys(task.figures)
    drive = None
    if needs_map(keys):
        drive, design = _map(design, task, turn=needs_turn(keys))
    sheet = measure_spec(drive, ratings=ratings_of(design), only=keys)
    doubts = {name: _uncertain(why) for name, why in sheet.uncertain.items()}
    figures = {name: sheet.figures[name] for name in task.figures}
    return figures, {**sheet.missing, **doubts}


def _size(design: Design, task: SizeTask) -> dict[str, float | None]:
    """Dimensions of the cylinder around the drive."""
    gear, ring = design.drive, design.circular_spline
    teeth, cup = gear.teeth_circular_spline, design.cup
    depth = ring.dedendum_coefficient * gear.module_mm + ring.rim_mm
    diameter, length = gear.module_mm * teeth + 2.0 * depth, gear.face_width_mm
    if cup is not None:
        length += cup.length_mm  # of the wall behind the teeth
    if cup is not None and cup.kind == "hat":
        diameter = max(diameter, 2.0 * cup.bore_radius_mm)  # of the flange
    found = {
        "outer_diameter_mm": diameter,
        "length_mm": length,
        "volume_cm3": 0.25e-3 * pi * diameter**2 * length,
    }
    return {name: found[name] for name in task.figures}


def _run(
    scene: Scene, design: Design | None, task: RunTask
) -> tuple[dict[str, float | None], dict[str, str]]:
    """Figures of the worst joint of a run, and reasons why figures are not valid."""
    from swgjoint.explore.compare.compare import row_of
    from swgjoint.maps.sheet.validity_marks import joint_doubt
    from swgjoint.sim.figures.keys import RIPPLE
    from swgjoint.view.run import run_scene

    drive = None
    if design is None:
        run = run_scene(scene)
    else:
        drive, _ = _map(design, task, turn=True)
        name = design.drive.name
        run = run_scene(scene.with_drive(name), drives={name: drive})
    row = row_of(scene.name, run, drive, level=None)
    found = {name: getattr(row, name) for name in task.figures}
    reasons, remarks = {}, {}
    doubt = joint_doubt(row.to_json())
    for name in task.figures:
        if name in RIPPLE and row.ripple_valid is False:
            reasons[name] = f"not valid: the map {doubt}"
        elif row.is_lower_bound(name):
            reasons[name] = "not resolved: the step leaves out orders of the drive"
        elif name in RIPPLE and found[name] is None:
            reasons[name] = "the inputs turn too little for the strongest order"
        elif name in RIPPLE and doubt is not None:
            remarks[name] = _uncertain(doubt)
    return found | dict.fromkeys(reasons), remarks | reasons


def _uncertain(doubt: Difference) -> str:
    """Remark on a figure that depends on an inaccurate part of the map."""
    return f"uncertain: the map {doubt}"
