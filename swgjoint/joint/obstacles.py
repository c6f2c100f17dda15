"""What stands in the way of a drive: the joint itself, and what else holds it."""

from __future__ import annotations

from typing import Any

import mujoco

from swgjoint.errors import InputError

ON_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def driven_joint(spec: mujoco.MjSpec, name: str) -> Any:
    """The hinge of that name, free to take a drive.

    Raises:
        InputError: If there is none, or it is held or driven by something else.
    """
    found = spec.joint(name)
    if found is None:
        known = ", ".join(j.name for j in spec.joints if j.name) or "none"
        raise InputError(f"joint {name!r} is not in the model; its joints: {known}")
    if found.type != mujoco.mjtJoint.mjJNT_HINGE:
        kind = mujoco.mjtJoint(found.type).name.removeprefix("mjJNT_").lower()
        raise InputError(f"joint {name!r} is a {kind} joint; a drive needs a hinge")
    _check_driven(spec, name)
    _check_names(spec, name)
    body = found.parent
    if body.joints[0].name != name:
        raise InputError(
            f"joint {name!r} is not the first joint of body {body.name!r}; give it a "
            "body of its own"
        )
    _check_equalities(spec, name)
    _check_actuators(spec, name)
    return found


def actuators_on(spec: mujoco.MjSpec, joint: str) -> dict[int, Any]:
    """Actuators that act on a joint, by their place in the model."""
    return {
        k: actuator
        for k, actuator in enumerate(spec.actuators)
        if actuator.trntype in ON_JOINT and actuator.target == joint
    }


def _is_drive(spec: mujoco.MjSpec, joint: str) -> bool:
    """Whether a tendon of :func:`attach` ties the joint to its rotor."""
    tendon = spec.tendon(f"{joint}_drive")
    return tendon is not None and {f"{joint}_rotor", joint} == set(_wrapped(tendon))


def _wrapped(tendon: Any) -> list[str]:
    """Joints of a fixed tendon."""
    return [w.target.name for w in tendon.path if w.type == mujoco.mjtWrap.mjWRAP_JOINT]


def _check_driven(spec: mujoco.MjSpec, name: str) -> None:
    if _is_drive(spec, name):
        raise InputError(f"joint {name!r} has a drive already")
    if name.endswith("_rotor") and _is_drive(spec, name.removesuffix("_rotor")):
        raise InputError(
            f"joint {name!r} is the rotor of a drive; a drive goes on the joint"
            f" {name.removesuffix('_rotor')!r} of its link, which has one"
        )


def _check_names(spec: mujoco.MjSpec, name: str) -> None:
    rotor = f"{name}_rotor"
    taken = {"body": spec.body(rotor), "joint": spec.joint(rotor)}
    for kind, element in taken.items():
        if element is not None:
            raise InputError(_clash(name, kind, rotor))
    for tendon in spec.tendons:
        rest = tendon.name.removeprefix(f"{name}_")
        if rest != tendon.name and (
            rest in ("drive", "friction") or rest.startswith("hysteresis")
        ):
            raise InputError(_clash(name, "tendon", tendon.name))
    if any(instance.name == f"{name}_drive" for instance in spec.plugins):
        raise InputError(_clash(name, "plugin instance", f"{name}_drive"))


def _clash(joint: str, kind: str, taken: str) -> str:
    return (
        f"joint {joint!r}: its drive would be called {taken!r}, as a {kind} of the"
        " model is already; rename that one"
    )


def _check_equalities(spec: mujoco.MjSpec, name: str) -> None:
    for equality in spec.equalities:
        if not equality.active:
            continue
        if equality.type == mujoco.mjtEq.mjEQ_JOINT and equality.name1 == name:
            does = f"follows {equality.name2!r}" if equality.name2 else "is locked"
            raise InputError(
                f"joint {name!r} {does} by equality {equality.name!r}, against which a"
                " drive would work; accepted: the joint that leads, or an equality"
                " that is not active"
            )
        if equality.type == mujoco.mjtEq.mjEQ_TENDON:
            for end in (equality.name1, equality.name2):
                tendon = spec.tendon(end) if end else None
                if tendon is not None and name in _wrapped(tendon):
                    raise InputError(
                        f"joint {name!r} is held by equality {equality.name!r} of"
                        f" tendon {end!r}, against which a drive would work; accepted:"
                        " an equality that is not active"
                    )


def _check_actuators(spec: mujoco.MjSpec, name: str) -> None:
    for actuator in actuators_on(spec, name).values():
        if actuator.dyntype == mujoco.mjtDyn.mjDYN_MUSCLE:
            raise InputError(
                f"joint {name!r} is moved by muscle {actuator.name!r}, which is no"
                " motor; a drive needs another actuator or none"
            )
    for actuator in spec.actuators:
        if actuator.trntype != mujoco.mjtTrn.mjTRN_TENDON:
            continue
        tendon = spec.tendon(actuator.target)
        if tendon is not None and name in _wrapped(tendon):
            raise InputError(
                f"joint {name!r} is moved by actuator {actuator.name!r} through tendon"
                f" {tendon.name!r}, past a drive; accepted: an actuator on the joint"
            )
