"""Compilation of models, with error messages of one line."""

from __future__ import annotations

import mujoco

from swgjoint.errors import InputError

_BALANCE = (
    "; accepted: moments of inertia that a rigid body can have, or the option"
    " --balance-inertia (scene key balance_inertia), which sets all three to their mean"
)
_MASS_ALONE = (
    "; accepted: a mass and moments of inertia for every body that moves (<inertial> in"
    " its link or body), or the option --balance-inertia (scene key balance_inertia),"
    " which gives a body with a mass alone the moments of a sphere of water"
)
_REMEDIES = {
    "balanceinertia": _BALANCE,
    "positive eigenvalues": _BALANCE,
    "larger than mjMINVAL": _MASS_ALONE,
    "Error opening file": (
        "; accepted: the meshes and textures of an MJCF file in their places, or a"
        " copy of the file without these shapes whose bodies have an <inertial>"
    ),
}
"""What to change, by a part of the engine's message."""


def compile_spec(spec: mujoco.MjSpec, *, where: str) -> mujoco.MjModel:
    """Compile a model, with an error message of one line.

    Args:
        spec: The model.
        where: Start of the message.

    Raises:
        InputError: If the engine rejects the model.
    """
    try:
        return spec.compile()
    except ValueError as exc:
        line = " ".join(str(exc).split())
        remedy = next((text for sign, text in _REMEDIES.items() if sign in line), "")
        raise InputError(f"{where}: MuJoCo cannot compile it: {line}{remedy}") from None


def skeleton(spec: mujoco.MjSpec, *, where: str) -> mujoco.MjModel:
    """Compile only bodies, joints and keyframes of a model, without its shapes.

    Every body gets a mass of 1 kg, so only the kinematics of the result is valid.

    Args:
        spec: The model; left unchanged.
        where: Start of the message.

    Raises:
        InputError: If the engine rejects the model.
    """
    bones = spec.copy()
    for elements in (bones.tendons, bones.pairs, bones.flexes, bones.skins):
        for element in list(elements):
            bones.delete(element)
    for equality in list(bones.equalities):
        bones.delete(equality)
    for geom in list(bones.geoms):
        bones.delete(geom)
    for mesh in list(bones.meshes):
        bones.delete(mesh)
    for body in bones.bodies[1:]:
        body.explicitinertial = True
        body.mass, body.inertia = 1.0, [1.0, 1.0, 1.0]
        body.fullinertia = [float("nan")] * 6
    return compile_spec(bones, where=where)
