"""Validity of the figures of a sweep: model level, torque, effects left out."""

from __future__ import annotations

from typing import Any

from swgjoint.explore.sweep.tasks import AskedFile

NOT_MODELLED = {
    "ring": "tooth passage, rim of the circular spline, micro-geometry, cup except its"
    " torsion",
    "2d": "micro-geometry, cup except its torsion; in a map, ball passage; the bearing"
    " of the wave generator in layouts other than circular_spline_fixed, on outlines"
    " with corners, straights or three lobes, and in a map with errors",
    "3d": "bearing of the wave generator; stresses at edges and at the step from rim to"
    " cup do not converge with the mesh",
}
"""Effects left out, by model of the drive; all models are quasi-static."""
RUN = "effects left out at the level of a joint, orders too fast for the time step"
"""Effects left out by the joints of a run."""


def validity_of(file: AskedFile) -> dict[str, dict[str, Any]]:
    """Validity labels by task of a sweep: ``level``, ``torque``, ``not_modelled``.

    ``swgjoint meshing``, ``spec`` and ``run`` report more about a single design. A
    sweep does not estimate the mesh error.
    """
    from swgjoint.maps.sheet.spec_sheet import needs_map

    found: dict[str, dict[str, Any]] = {}
    if (meshing := file.meshing) is not None:
        load = meshing.torque_Nm
        torque = "rated torque" if load is None else f"{load:g} N·m"
        found["meshing"] = _label(meshing.model, torque)
    if file.spec is not None:
        torque = "up to the repeated peak, or to the end of the map"
        found["spec"] = _label(file.spec.model, torque)
        if not needs_map(file.spec.figures):
            found["spec"] |= {"level": "ratings alone", "not_modelled": {}}
    if file.size is not None:
        found["size"] = {"level": "design", "torque": "none", "not_modelled": {}}
    if file.run is not None:
        found["run"] = _label(file.run.model, "within the map of a drive")
        if file.design is None:
            found["run"] |= {"level": "drives of the scene", "not_modelled": {}}
        found["run"]["not_modelled"] |= {"joint": RUN}
    return found


def _label(model: str | None, torque: str) -> dict[str, Any]:
    levels = ("2d", "3d") if model is None else (model,)
    return {
        "level": model or "3d with a cup, else 2d",
        "torque": torque,
        "not_modelled": {level: NOT_MODELLED[level] for level in levels},
    }
