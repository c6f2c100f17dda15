"""Computations of the catalogue study, stored in the cache."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from swgjoint.code_hash import code_hash
from swgjoint.errors import ComputationError, DesignError
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import recall
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.fe.rings.friction import RubbedPath


Found = dict[str, Any]

OUTSIDE = 1.37
"""Outer diameter of the circular spline divided by the pitch diameter [-], for
ratcheting: mean for component sets of sizes 14 to 32 (50, 60, 70, 85, 110 mm, not
verified), which range from 1.34 to 1.41."""
ANGLES = 96
"""Number of input angles over one output turn for the transmission error."""
INDIVIDUAL_ANGLES = 8
"""Number of input angles over one output turn at which an individual gear is loaded."""
LOADED_ANGLES = 2
"""Number of input angles at which the friction under load is computed; eight change the
loss of size 25 by 1.3 %."""


@dataclass(frozen=True, kw_only=True)
class CatalogueTask:
    """One computation of the study."""

    name: str
    kind: str
    """Key of :data:`KINDS`."""
    design: Design
    torques: tuple[float, ...] = ()
    """Output torques [N·m]."""
    work: float = 1.0
    """Estimated relative work, so that long computations start first."""


def run_task(task: CatalogueTask) -> Found:
    """Result of a task, read from the cache or computed.

    Every result includes ``wall_s``; that of a failed task has only ``fault`` besides.
    """
    parts = {
        "study": _own_version(),
        "kind": task.kind,
        "design": task.design.content_hash(),
        "torques": task.torques,
    }
    return recall("studies", parts, Found, lambda: _computed(task))


def _computed(task: CatalogueTask) -> Found:
    begin = time.perf_counter()
    try:
        found = KINDS[task.kind](task)
    except (ComputationError, DesignError) as error:
        found = {"fault": str(error).splitlines()[0]}
    found["wall_s"] = time.perf_counter() - begin
    return found


@lru_cache
def _own_version() -> str:
    return code_hash("validation/catalogue/runs.py")


def _whole_path(task: CatalogueTask, angles: Array | None = None) -> RubbedPath:
    """Loading path of the thin rings up to the largest torque of a task."""
    from swgjoint.fe.rings.friction import friction_path

    path = friction_path(task.design, task.torques, angles=angles)
    if not path.outcome.ok:
        reached = path.torque[-1] if path.torque.size else 0.0
        raise ComputationError(
            f"the thin rings reach {reached:.4g} of {max(task.torques):.4g} N·m:"
            f" {path.outcome.value}"
        )
    return path


def _path(task: CatalogueTask) -> Found:
    """Torsion without cup [rad] by torque, and friction work between torques.

    The friction work [J] is divided by the friction coefficient.
    """
    path = _whole_path(task)
    work = path.teeth_work + path.race_work
    return {
        "torque_Nm": path.torque.tolist(),
        "ring_torsion_rad": (path.torsion - path.series * path.torque).tolist(),
        "work_per_mu_J": work.tolist(),
        "race_part": (path.race_work / np.maximum(work, 1e-300)).tolist(),
        "ring_compliance_rad_Nm": (path.compliance - path.series).tolist(),
        "ring_shares": {
            name: (share * path.compliance / (path.compliance - path.series)).tolist()
            for name, share in path.shares.items()
        },
        "balls": path.balls.tolist(),
        "tooth_pairs": path.tooth_pairs.tolist(),
    }


def _ratcheting(task: CatalogueTask) -> Found:
    """Ratcheting torque of the 2D model, with the outer rim as in the design."""
    from swgjoint.fe.plane.figures.ratcheting import ratcheting_path

    mounting = task.kind.removeprefix("ratcheting").strip()
    return ratcheting_path(
        task.design, bearing=mounting != "rigid", floating=mounting == "floating"
    ).as_dict()


def _individual(task: CatalogueTask) -> Found:
    """Torsion without cup [rad] by torque, at several angles of an output turn."""
    from swgjoint.fe.rings.accuracy import output_turn_angles

    angles = output_turn_angles(task.design, INDIVIDUAL_ANGLES)
    paths = [_whole_path(task, angles[k : k + 1]) for k in range(angles.size)]
    return {
        "input_angles_rad": angles.tolist(),
        "torque_Nm": paths[0].torque.tolist(),
        "ring_torsion_rad": [
            (path.torsion - path.series * path.torque).tolist() for path in paths
        ],
    }


def _accuracy(task: CatalogueTask) -> Found:
    """Transmission error of the thin rings over one output turn at almost no load."""
    from swgjoint.fe.rings.accuracy import output_turn_angles, transmission_error

    angles = output_turn_angles(task.design, ANGLES)
    error = transmission_error(task.design, angles)
    return {"input_angles_rad": angles.tolist(), "error_rad": error.tolist()}


def _running(task: CatalogueTask) -> Found:
    """Input torque in slow rotation and friction torques, without load and loaded."""
    from swgjoint.fe.rings.loading import positions
    from swgjoint.fe.rings.model import thin_ring
    from swgjoint.fe.rings.running import running_friction, running_over_load

    angles = positions(thin_ring(task.design), LOADED_ANGLES)
    loaded = running_over_load(task.design, task.torques, angles=angles)
    return {
        **running_friction(task.design).to_json(),
        "loaded": [one.to_json() for one in loaded],
    }


def _coning(task: CatalogueTask) -> Found:
    """Torsion of the 3D model by torque; the last word of the kind is the bearing."""
    from swgjoint.fe.solid.figures.torsion import solid_torsion

    bearing = {"rigid": None, "free": "free", "held": "held"}[task.kind.split()[1]]
    found = solid_torsion(task.design, task.torques, bearing=cast(Any, bearing))
    return {
        "torque_Nm": found.torque.tolist(),
        "torsion_rad": found.torsion.tolist(),
        "compliance_rad_Nm": found.compliance.tolist(),
        "tooth_centre_over_face": found.tooth_centre.tolist(),
        "tooth_force_N": found.tooth_force.tolist(),
        "bore_centre_over_face": found.bore_centre.tolist(),
        "balls": found.balls.tolist(),
        "half_play_rad": found.half_play,
    }


def _coning_ring(task: CatalogueTask) -> Found:
    """Torsion of the thin rings by torque, with the cup in series in closed form."""
    path = _whole_path(task, np.zeros(1))
    at = np.searchsorted(path.torque, task.torques)
    return {
        "torque_Nm": list(task.torques),
        "torsion_rad": path.torsion[at].tolist(),
        "compliance_rad_Nm": path.compliance[at].tolist(),
        "balls": path.balls[at].tolist(),
        "half_play_rad": float(path.torsion[0] - path.compliance[0] * path.torque[0]),
    }


KINDS: dict[str, Callable[[CatalogueTask], Found]] = {
    "path": _path,
    "individual": _individual,
    "ratcheting": _ratcheting,
    "ratcheting floating": _ratcheting,
    "ratcheting rigid": _ratcheting,
    "accuracy": _accuracy,
    "running": _running,
    "coning rigid": _coning,
    "coning free": _coning,
    "coning held": _coning,
    "coning ring": _coning_ring,
}


def oval(design: Design) -> Design:
    """Design whose circular spline can become oval.

    Its outside is free, and its rim is as thick as in component sets.
    """
    drive = design.drive
    own = design.circular_spline
    root = drive.module_mm * (
        drive.teeth_circular_spline + 2.0 * own.dedendum_coefficient
    )
    outside = OUTSIDE * drive.module_mm * drive.teeth_flexspline
    return design.with_changes(
        {
            "circular_spline.outer_rim": "free",
            "circular_spline.rim_mm": 0.5 * (outside - root),
        }
    )
