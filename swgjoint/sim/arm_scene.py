"""A scene around any arm: a drive in every hinge and a gentle sweep."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from swgjoint.maps.catalogue import catalogue_rows
from swgjoint.models_path import bundled_names
from swgjoint.sim.rigid_arm import RigidArm
from swgjoint.sim.rotors import catalogue_rotor_inertia
from swgjoint.sim.scene import Scene
from swgjoint.units import deg

SWEEP = 20.0 * deg
"""Travel of every joint, less where its range is short [rad]."""
MARGIN = 0.1
"""Share of a joint's range that the sweep keeps from either end."""
RATIO = 100
ROTOR_INERTIA = 1e-4
"""Where the drive is not of the catalogue [kg·m²]: assumed, as in scene ``bench``."""
TIMING = {"hold_s": 0.25, "ramp_s": 0.5, "settle_s": 0.25}
DURATION = 4.0


def is_arm(reference: str) -> bool:
    """Whether a reference names an arm and no scene: a file or a bundled name."""
    if Path(reference).suffix.lower() in (".xml", ".urdf", ".xacro"):
        return True
    return (
        not Path(reference).is_file()
        and reference in bundled_names("arms", ".xml")
        and reference not in bundled_names("scenes", ".toml")
    )


def scene_of_arm(
    reference: str,
    *,
    drive: str | None = None,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
) -> Scene:
    """All hinges turn by up to 20 degrees within their limits, each with a drive.

    Without a drive each joint gets the smallest CSG of ratio 100 whose repeated peak
    torque is at least what the file lets its motor exert or, where the file does not
    say, whose rated torque is at least the weight on the sweep; the largest if none is.
    A rule to start from, not the choice of the arm's maker. The rotor has twice the
    inertia of the wave generator of its size: a motor of the same inertia is assumed.

    Args:
        reference: Path of an MJCF or URDF file, or the name of a bundled arm.
        drive: Drive of all joints: design, map or catalogue name.
        overrides: Changes of the scene, as for :meth:`Scene.load_file`.

    Raises:
        InputError: If the arm cannot be used.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the run says it
        arm = RigidArm(reference)
        start, end = gentle_sweep(arm)
        by_rule = {} if drive else _by_rule(arm, start, end)
    data: dict[str, Any] = {
        "name": arm.path.stem,
        "description": f"Sweep of all joints of {arm.path.name}",
        "arm": reference,
        "tool_site": _tool(arm),
        "defaults": {"level": "full"},
        "trajectory": {
            "kind": "sweep",
            **TIMING,
            "start_deg": dict(zip(arm.joints, (start / deg).tolist(), strict=True)),
            "end_deg": dict(zip(arm.joints, (end / deg).tolist(), strict=True)),
        },
        "controller": {"feedforward": "gravity_inertia"},
        "simulation": {"duration_s": DURATION},
    }
    if drive is not None:
        data["defaults"] |= {"drive": drive, "rotor_inertia_kgm2": _rotor(drive)}
    else:
        data["joints"] = {
            joint: {"drive": name, "rotor_inertia_kgm2": _rotor(name)}
            for joint, name in by_rule.items()
        }
    return Scene.from_data(data, where=f"scene of {reference}", overrides=overrides)


def gentle_sweep(arm: RigidArm) -> tuple[np.ndarray, np.ndarray]:
    """Where the joints start and end [rad]. Shapes (n_joints,).

    From the reference position, or the nearest that keeps the margin, towards the
    farther limit.
    """
    model = arm.model
    low, high = model.jnt_range.T.copy()
    free = ~model.jnt_limited.astype(bool)
    low[free], high[free] = -np.inf, np.inf
    room = np.where(free, 0.0, MARGIN * (model.jnt_range[:, 1] - model.jnt_range[:, 0]))
    low, high = low + room, high - room
    start = np.clip(model.qpos0, low, high)
    up = high - start >= start - low
    return start, np.clip(start + np.where(up, SWEEP, -SWEEP), low, high)


def _by_rule(arm: RigidArm, start: np.ndarray, end: np.ndarray) -> dict[str, str]:
    """Catalogue drive of every joint."""
    rows = sorted(
        (row for row in catalogue_rows() if row.ratio == RATIO),
        key=lambda row: row.rated_torque,
    )
    path = np.linspace(start, end, 21)
    weight = np.abs(arm.gravity(path)).max(axis=0)
    names = {}
    for joint, needed in zip(arm.joints, weight, strict=True):
        effort = arm.effort.get(joint)
        fits = [
            row
            for row in rows
            if (
                row.rated_torque >= needed
                if effort is None
                else row.repeated_peak >= effort
            )
        ]
        names[joint] = (fits or rows[-1:])[0].name
    return names


def _rotor(drive: str) -> float:
    """Rotor with wave generator of a drive [kg·m²]."""
    return catalogue_rotor_inertia(drive) or ROTOR_INERTIA


def _tool(arm: RigidArm) -> str:
    """The site ``tool``, else the last body of the longest chain."""
    if arm.tool >= 0:
        return "tool"
    model = arm.model
    depth = np.zeros(model.nbody, dtype=int)
    for body in range(1, model.nbody):
        depth[body] = depth[model.body_parentid[body]] + 1
    last = int(np.flatnonzero(depth == depth.max())[0])
    return str(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, last))
