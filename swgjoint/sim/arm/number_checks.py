"""Numbers of an arm's file that no arm has, found in the compiled model."""

from __future__ import annotations

import mujoco
import numpy as np

from swgjoint.errors import InputError

LARGEST = 1e10
"""The engine's ``mjMAXVAL``, SI units: a state beyond it counts as diverged."""
_KINDS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "jnt": mujoco.mjtObj.mjOBJ_JOINT,
    "dof": mujoco.mjtObj.mjOBJ_JOINT,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "eq": mujoco.mjtObj.mjOBJ_EQUALITY,
    "key": mujoco.mjtObj.mjOBJ_KEY,
}
"""Prefixes of the model's arrays, and whose rows they have."""
_BOUNDED = {
    *("body_mass", "body_inertia", "body_pos", "body_ipos", "geom_pos", "geom_size"),
    *("jnt_pos", "site_pos", "key_qpos"),
}
"""Arrays of the file's own numbers; others may follow from them and be larger, and a
range without an end is written as a large number."""
_HOLDING = {
    *("jnt_stiffness", "dof_damping", "dof_frictionloss"),
    *("tendon_stiffness", "tendon_damping", "tendon_frictionloss"),
}
"""Arrays with which some arms hold a joint for good, by a damping of 1e11."""
HOLDING = LARGEST**2
"""Their largest value."""


def check_numbers(model: mujoco.MjModel, *, where: str) -> None:
    """Refuse numbers that are not finite or absurdly large, and axes of no direction.

    Args:
        model: The compiled arm.
        where: Begins the message.

    Raises:
        InputError: Naming the first element and attribute.
    """
    for name in ("timestep", "gravity", "wind", "density", "viscosity"):
        _refuse(where, f"option: {name}", np.atleast_1d(getattr(model.opt, name)))
    for key in dir(model):
        kind, _, attribute = key.partition("_")
        values = getattr(model, key) if kind in _KINDS and attribute else None
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
            continue
        rows = values.reshape(len(values), -1) if values.size else values[:, None]
        top = LARGEST if key in _BOUNDED else np.finfo(float).max
        if key in _HOLDING:
            top = HOLDING
        if key.endswith("range"):  # inf is a range without an end
            top = np.inf
        for row in np.flatnonzero(~(abs(rows) <= top).all(axis=1)).tolist():
            _refuse(where, f"{_element(model, kind, row)}: {attribute}", rows[row], top)
    lengths = np.linalg.norm(model.jnt_axis, axis=1)
    for row in np.flatnonzero(abs(lengths - 1.0) > 1e-6).tolist():
        raise InputError(
            f"{where}: {_element(model, 'jnt', row)}: the axis has no direction;"
            " accepted: a vector of a length that can be computed"
        )


def _refuse(where: str, what: str, values: np.ndarray, top: float = LARGEST) -> None:
    """One line about the first value beyond the bound, if there is one."""
    wrong = values[~(abs(values) <= top)]  # NaN, too
    if wrong.size:
        raise InputError(
            f"{where}: {what} {wrong[0]:g}; accepted: finite numbers up to"
            f" {top:.3g} in SI units"
        )


def _element(model: mujoco.MjModel, kind: str, row: int) -> str:
    """Kind and name of a row's owner."""
    index = int(model.dof_jntid[row]) if kind == "dof" else row
    word = {"jnt": "joint", "dof": "joint", "eq": "equality"}.get(kind, kind)
    name = mujoco.mj_id2name(model, _KINDS[kind], index)
    return f"{word} {name[:60]!r}" if name else f"{word} number {index}"
