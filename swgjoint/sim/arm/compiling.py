"""Compilation of models, with error messages of one line."""

from __future__ import annotations

import mujoco

from swgjoint.errors import InputError


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
        remedy = ""
        if "balanceinertia" in line or "positive eigenvalues" in line:
            remedy = (
                "; accepted: moments of inertia that a rigid body can have, or the"
                " option --balance-inertia (scene key balance_inertia), which sets all"
                " three to their mean"
            )
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
