"""What the figures of a sweep stand for: level, torque, what is not modelled."""

from __future__ import annotations

from typing import Any

from swgjoint.explore.sweep.tasks import AskedFile

NOT_MODELLED = {
    "ring": "passage of teeth, rim of the circular spline, micro-geometry, cup but for"
    " its torsion",
    "2d": "micro-geometry, cup but for its torsion; in a map the passage of balls; the"
    " bearing of the wave generator outside of the layout circular_spline_fixed and on"
    " outlines with corners, straights or three lobes, and in a map with errors",
    "3d": "bearing of the wave generator; stresses at edges and at the step from rim to"
    " cup do not converge with the mesh",
}
"""Of a drive, by the fidelity of its model; all of them are quasi-static."""
RUN = "what the level of a joint leaves out, orders too fast for the step"


def validity_of(file: AskedFile) -> dict[str, dict[str, Any]]:
    """One label for every task of a sweep.

    ``swgjoint meshing``, ``spec`` and ``run`` tell more of a single design. No error
    of the mesh is estimated in a sweep.
    """
    from swgjoint.maps.sheet.spec_sheet import needs_map

    found: dict[str, dict[str, Any]] = {}
    if (meshing := file.meshing) is not None:
        given = meshing.torque_Nm
        torque = "rated torque" if given is None else f"{given:g} N·m"
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
