"""``swgjoint advise``: the cheapest level, integrator and step within an error.

All errors are measured on the scene itself. The reference is level ``full``
extrapolated to step zero; its step is halved until two successive extrapolations agree.
Settings are then tried in the order of increasing cost until one meets the bound.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco

from swgjoint.drives.references import drive_of
from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.advise.bound import ErrorBound
from swgjoint.explore.advise.reference import settle
from swgjoint.explore.advise.search import SettingSearch, choose_row
from swgjoint.joint.attach import LEVELS
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.assembly import assemble
from swgjoint.sim.scene.scene import Scene

STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3)
"""Time steps to try [s]."""


def advise(
    scene: Scene,
    bound: ErrorBound,
    *,
    drives: Mapping[str, DriveMap] | None = None,
    levels: Sequence[str] = LEVELS,
    steps: Sequence[float] = STEPS,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Find the cheapest setting of a scene that meets an error bound.

    Args:
        scene: The scene; its own levels, integrator and step do not matter.
        bound: Largest accepted error.
        drives: Maps that replace drive references of the scene.
        levels: Levels to try.
        steps: Steps to try [s].
        progress: Called while maps are built and after every run.

    Returns:
        ``scene``, ``bound`` and ``quantity`` of the bound; ``level``, ``integrator``,
        ``step_s`` and ``sub_steps`` of the cheapest setting; its ``expected_error`` in
        ``unit``, ``expected_error_arcmin`` (of the link angle) and ``cost`` (CPU time
        per simulated time, divided by that of the rigid arm at 1 ms); ``reference``;
        ``rows`` (settings in the order in which they were tried); ``wall_s``.

    Raises:
        InputError: If the scene cannot be run, or if the bound refers to the tool
            position and the arm has no tool.
        ComputationError: If the reference does not converge, or if no setting meets the
            bound; the message then names the most accurate setting.
    """
    begin = time.perf_counter()
    known = _loaded(scene, drives, progress)
    if bound.quantity == "tool_position" and not _has_tool(scene, known):
        raise InputError(
            f"--error {bound.text}: arm {scene.arm!r} has no tool; accepted: an angle"
        )
    # a diverging run becomes a row, so the engine need not print a warning
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        reference = settle(scene, bound, known, progress)
        search = SettingSearch(
            scene=scene, bound=bound, drives=known, reference=reference
        )
        rows = search.run(levels, steps, progress)
    finally:
        mujoco.set_mju_user_warning(None)
    tried = [row for row in rows if row["error"] is not None]
    best = min(tried, key=lambda row: float(row["error"]), default=None)
    found = choose_row(rows)
    if found is None:
        what = (
            "no setting runs"
            if best is None
            else f"the most accurate one is {best['level']}, {best['integrator']} at"
            f" {1e3 * best['step_s']:g} ms with {best['error']:.3g} {bound.unit}"
        )
        raise ComputationError(
            f"{scene.where}: no setting is within {bound.text}; {what}; use a larger"
            " --error"
        )
    return {
        "scene": scene.name,
        "bound": bound.text,
        "quantity": bound.quantity,
        "level": found["level"],
        "integrator": found["integrator"],
        "step_s": found["step_s"],
        "sub_steps": found["sub_steps"],
        "expected_error": found["error"],
        "unit": bound.unit,
        "expected_error_arcmin": found["link_angle_arcmin"],
        "cost": found["cost"],
        "reference": {
            "level": "full",
            "integrator": "discrete, extrapolated to step zero",
            "step_s": reference.step,
            "error": reference.error,
        },
        "rows": rows,
        "wall_s": time.perf_counter() - begin,
    }


def _loaded(
    scene: Scene, drives: Mapping[str, DriveMap] | None, progress: Progress
) -> dict[str, DriveMap]:
    """Maps of all joints, each built once.

    Raises:
        InputError: If the scene cannot be run.
    """
    known = dict(drives or {})
    rigid = assemble(scene.with_level("rigid"), drives=known, progress=progress)
    for name in rigid.joints:
        drive_of(scene.joint_settings(name), known=known, progress=progress)
    return known


def _has_tool(scene: Scene, drives: Mapping[str, DriveMap]) -> bool:
    return bool(assemble(scene.with_level("rigid"), drives=drives).arm.tool >= 0)
