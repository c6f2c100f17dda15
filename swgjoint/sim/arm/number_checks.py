"""Checks of a compiled arm for numbers that no real arm can have."""

from __future__ import annotations

import mujoco
import numpy as np

from swgjoint.errors import InputError

LARGEST = 1e10
"""The engine's ``mjMAXVAL`` in SI units; it treats larger states as a divergence."""
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
"""Kinds of the elements that own the rows of a model array, by prefix of the array."""
_BOUNDED = {
    *("body_mass", "body_inertia", "body_pos", "body_ipos", "geom_pos", "geom_size"),
    *("jnt_pos", "site_pos", "key_qpos"),
}
"""Arrays with numbers from the file, which :data:`LARGEST` bounds. Derived arrays may
contain larger numbers, and large numbers represent unlimited ranges."""
_HOLDING = {
    *("jnt_stiffness", "dof_damping", "dof_frictionloss"),
    *("tendon_stiffness", "tendon_damping", "tendon_frictionloss"),
}
"""Arrays with which some files lock a joint, for example by a damping of 1e11."""
HOLDING = LARGEST**2
"""Largest accepted value in the arrays that may lock a joint, in SI units."""


def check_numbers(model: mujoco.MjModel, *, where: str) -> None:
    """Reject non-finite or absurdly large numbers, and joint axes without direction.

    Args:
        model: The compiled arm.
        where: Start of the message.

    Raises:
        InputError: If there is such a number; the message names the first element and
            attribute.
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
        if key.endswith("range"):  # inf means an unlimited range
            top = np.inf
        for row in np.flatnonzero(~(abs(rows) <= top).all(axis=1)).tolist():
            _refuse(where, f"{_element(model, kind, row)}: {attribute}", rows[row], top)
    lengths = np.linalg.norm(model.jnt_axis, axis=1)
    for row in np.flatnonzero(abs(lengths - 1.0) > 1e-6).tolist():
        raise InputError(
            f"{where}: {_element(model, 'jnt', row)}: the axis has no direction;"
            " accepted: a vector of finite, non-zero length"
        )


def _refuse(where: str, name: str, values: np.ndarray, top: float = LARGEST) -> None:
    """Reject values beyond a bound, with a message about the first one."""
    wrong = values[~(abs(values) <= top)]  # includes NaN
    if wrong.size:
        raise InputError(
            f"{where}: {name} {wrong[0]:g}; accepted: finite numbers up to"
            f" {top:.3g} in SI units"
        )


def _element(model: mujoco.MjModel, kind: str, row: int) -> str:
    """Kind and name of the element that owns a row."""
    index = int(model.dof_jntid[row]) if kind == "dof" else row
    word = {"jnt": "joint", "dof": "joint", "eq": "equality"}.get(kind, kind)
    name = mujoco.mj_id2name(model, _KINDS[kind], index)
    return f"{word} {name[:60]!r}" if name else f"{word} number {index}"
