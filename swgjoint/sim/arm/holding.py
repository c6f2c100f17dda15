"""Removal of joints that do not move in a scene, in a given pose of the arm."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.typing import Array

Pose = tuple[Array, Array]
"""Position [m] and orientation as a unit quaternion (w, x, y, z)."""

WORLD = "world"
HINGE = "hinge"
NOT_CHOSEN = f"{HINGE}, not among the driven joints"
FREE = "free"
_ON_BODIES = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)


@dataclass(frozen=True, kw_only=True, eq=False)
class Holding:
    """Joints of a file that do not move, with reasons and consequences."""

    held: dict[str, str]
    """Held joints, each with the reason: its type, what ties it, or that it has no
    drive."""
    unfiltered: list[tuple[str, str]]
    """Pairs of bodies to exclude from contact once these joints are removed."""
    hung: frozenset[str]
    """Bodies of a robot whose free joint is held."""
    still: frozenset[str]
    """Bodies that no joint of the file moves."""


def choose_held(spec: mujoco.MjSpec, reading: ArmReading, path: Path) -> Holding:
    """Find joints that are not hinges, that equalities tie, or that have no drive.

    All equalities are deleted. Inactive ones have no effect, those that pull a body to
    a mocap body replace a motor, and the joints that the others tie are held.

    Args:
        spec: The arm; its equalities are deleted.
        reading: Hinges that have drives.
        path: File of the arm, for messages.

    Returns:
        The joints to hold.

    Raises:
        InputError: If equalities tie every hinge, if an equality has an unsupported
            kind, or if a pattern matches no independent hinge.
    """
    held = {
        joint.name: mujoco.mjtJoint(joint.type).name.removeprefix("mjJNT_").lower()
        for joint in spec.joints
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE
    }
    hinges = [joint.name for joint in spec.joints if joint.name not in held]
    first = ""
    for equality in list(spec.equalities):
        kind = mujoco.mjtEq(equality.type).name.removeprefix("mjEQ_").lower()
        name = equality.name or kind
        if equality.active and not _pulls_to_mocap(spec, equality):
            tied = _tied(spec, equality)
            if tied is None:
                raise InputError(
                    f"{path}: equality {name!r} of kind {kind}; accepted: connect,"
                    " weld, joint and tendon, whose joints are then held"
                )
            held |= {
                joint: f"{HINGE}, tied by {name!r}"
                for joint in hinges
                if joint in tied and joint not in held
            }
            if tied and not first:
                first = f"equality {name!r} ties {' and '.join(sorted(tied))}"
        spec.delete(equality)
    free = [name for name in hinges if name not in held]
    if hinges and not free:
        raise InputError(
            f"{path}: every hinge is tied to another joint: {first}; accepted in a"
            " scene: an arm with a hinge that moves independently"
        )
    for pattern in reading.driven:
        if not any(ArmReading(driven=(pattern,)).drives(name) for name in free):
            raise InputError(
                f"{path}: joints {pattern!r}: no independent hinge matches it;"
                f" accepted: {', '.join(free)}"
            )
    held |= {name: NOT_CHOSEN for name in free if not reading.drives(name)}
    hung = {
        body.name
        for root in spec.worldbody.bodies
        if any(held.get(joint.name) == FREE for joint in root.joints)
        for body in _tree(root)
    }
    welds = _welds(spec, set())
    still = {name for name, (weld, _) in welds.items() if weld == WORLD}
    return Holding(
        held=held,
        unfiltered=_unfiltered(spec, held, hung, still),
        hung=frozenset(hung),
        still=frozenset(still),
    )


def hold(
    spec: mujoco.MjSpec,
    holding: Holding,
    reading: ArmReading,
    bones: mujoco.MjModel,
    path: Path,
) -> None:
    """Remove the held joints in their pose, and what depends on them.

    Tendons with a held joint are deleted, and so are contact pairs between fixed bodies
    and a robot whose free joint is held.

    Args:
        spec: The arm; changed in place.
        holding: Joints to hold, with reasons.
        reading: Pose in which they are held.
        bones: The arm as read, see :func:`swgjoint.sim.arm.compiling.skeleton`.
        path: File of the arm, for messages.

    Raises:
        InputError: If an angle is given for a held joint that is not a hinge.
    """
    held = holding.held
    for name in set(reading.angles) & set(held):
        if not held[name].startswith(HINGE):
            raise InputError(
                f"{path}: an angle for joint {name!r}, a {held[name]} joint that is"
                f" held in the {reading.pose or 'reference'} pose; accepted: hinges"
            )
    for tendon in list(spec.tendons):
        if _joints_of_tendon(tendon) & set(held):
            spec.delete(tendon)
    if held and (reading.pose is not None or set(reading.angles) & set(held)):
        _fold(spec, held, reading, bones)
    for name in held:
        spec.delete(spec.joint(name))
    for first, second in holding.unfiltered:
        spec.add_exclude(bodyname1=first, bodyname2=second)
    for pair in list(spec.pairs):  # <exclude> has no effect on pairs
        geoms = (spec.geom(pair.geomname1), spec.geom(pair.geomname2))
        bodies = {geom.parent.name for geom in geoms}
        if bodies & holding.hung and bodies & holding.still:
            spec.delete(pair)


def _fold(
    spec: mujoco.MjSpec,
    held: Mapping[str, str],
    reading: ArmReading,
    model: mujoco.MjModel,
) -> None:
    r"""Move the frames of bodies by the displacement of their held joints in the pose.

    The pose of a body in its parent is :math:`T_0 J_1 J_2 \dots` with one factor per
    joint. A held factor moves to the front past the remaining factors, which transforms
    their axes and anchors: :math:`J_m J_h = J_h\,(J_h^{-1} J_m J_h)`.
    """
    qpos = model.qpos0
    if reading.pose is not None:
        qpos = model.key(reading.pose).qpos
    for body in spec.bodies[1:]:
        if not any(joint.name in held for joint in body.joints):
            continue
        here = model.body(body.name)
        pose: Pose = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        passed: list[tuple[mujoco.MjsJoint, Array, Array]] = []
        for joint in body.joints:
            own = model.joint(joint.name)
            axis, anchor = own.axis.copy(), own.pos.copy()
            if joint.name not in held:
                passed.append((joint, axis, anchor))
                continue
            value = qpos[own.qposadr[0] :][: _WIDTH[int(own.type[0])]].copy()
            if joint.name in reading.angles:
                value[0] = reading.angles[joint.name]
            moved = _moved(own, value, start=model.qpos0[own.qposadr[0]], body=here)
            back = _inverse(moved)
            passed = [
                (stays, _turned(back, along), _placed(back, at))
                for stays, along, at in passed
            ]
            pose = _after(pose, moved)
        for joint, axis, anchor in passed:
            joint.axis, joint.pos = axis, anchor
        body.pos, body.quat = _after(_own_pose(body), pose)
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


_WIDTH = {
    int(mujoco.mjtJoint.mjJNT_FREE): 7,
    int(mujoco.mjtJoint.mjJNT_BALL): 4,
    int(mujoco.mjtJoint.mjJNT_SLIDE): 1,
    int(mujoco.mjtJoint.mjJNT_HINGE): 1,
}


def _moved(joint: object, value: Array, *, start: float, body: object) -> Pose:
    """Displacement of a body by one joint, in the frame of the body.

    Args:
        joint: The joint in the compiled model.
        value: Its coordinates in the pose [rad or m].
        start: Its first coordinate in the reference position [rad or m].
        body: The body in the compiled model.
    """
    own, here = joint, body
    kind = int(own.type[0])  # type: ignore[attr-defined]
    axis, anchor = own.axis, own.pos  # type: ignore[attr-defined]
    if kind == mujoco.mjtJoint.mjJNT_FREE:
        rest = (here.pos.copy(), here.quat.copy())  # type: ignore[attr-defined]
        return _after(_inverse(rest), (value[:3], _unit(value[3:])))
    if kind == mujoco.mjtJoint.mjJNT_SLIDE:
        return (value[0] - start) * axis, np.array([1.0, 0.0, 0.0, 0.0])
    turn = np.empty(4)
    if kind == mujoco.mjtJoint.mjJNT_BALL:
        turn = _unit(value)
    else:
        mujoco.mju_axisAngle2Quat(turn, axis, value[0] - start)
    return anchor - _turned((anchor, turn), anchor), turn


def _own_pose(body: mujoco.MjsBody) -> Pose:
    """Pose of a body in its parent or frame, as stated in the file."""
    quat = np.array(body.quat)
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        compiler = body.compiler
        quat = np.array(
            mujoco.MjSpec.resolve_orientation(
                degree=compiler.degree,
                sequence=compiler.eulerseq,
                orientation=body.alt,
            )
        )
    return np.array(body.pos), _unit(quat)


def _unit(quat: Array) -> Array:
    """Normalised copy of a quaternion."""
    out = np.array(quat, dtype=float)
    mujoco.mju_normalize4(out)
    return out


def _after(first: Pose, second: Pose) -> Pose:
    """Composition of two poses: the second in the frame of the first."""
    place, turn = np.empty(3), np.empty(4)
    mujoco.mju_mulPose(place, turn, *first, *second)
    return place, turn


def _inverse(pose: Pose) -> Pose:
    """Inverse of a pose."""
    place, turn = np.empty(3), np.empty(4)
    mujoco.mju_negPose(place, turn, *pose)
    return place, turn


def _turned(pose: Pose, vector: Array) -> Array:
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, vector, pose[1])
    return out


def _placed(pose: Pose, point: Array) -> Array:
    return np.asarray(pose[0] + _turned(pose, point))


def _tied(spec: mujoco.MjSpec, equality: mujoco.MjsEquality) -> set[str] | None:
    """Joints that an equality couples; None for unsupported kinds of equality."""
    names = [name for name in (equality.name1, equality.name2) if name]
    if equality.type == mujoco.mjtEq.mjEQ_JOINT:
        return set(names)
    if equality.type == mujoco.mjtEq.mjEQ_TENDON:
        tendons = [spec.tendon(name) for name in names]
        return set().union(*(_joints_of_tendon(t) | _joints_along(t) for t in tendons))
    if equality.type in _ON_BODIES:
        ends = [_body(spec, equality, name) for name in names]
        return _between(ends)
    return None


def _pulls_to_mocap(spec: mujoco.MjSpec, equality: mujoco.MjsEquality) -> bool:
    """Whether an equality pulls a body to a mocap body, which the user would move."""
    if equality.type not in _ON_BODIES:
        return False
    names = [name for name in (equality.name1, equality.name2) if name]
    return any(_body(spec, equality, name).mocap for name in names)


def _body(
    spec: mujoco.MjSpec, equality: mujoco.MjsEquality, name: str
) -> mujoco.MjsBody:
    if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
        return spec.site(name).parent
    return spec.body(name)


def _between(ends: Iterable[mujoco.MjsBody]) -> set[str]:
    """Joints in the tree between bodies, or between one body and the world."""
    chains = [{body.name: body for body in _chain(end)} for end in ends]
    shared = set(chains[0]).intersection(*chains[1:]) if len(chains) > 1 else {WORLD}
    return {
        joint.name
        for chain in chains
        for name, body in chain.items()
        if name not in shared
        for joint in body.joints
    }


def _chain(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    """A body and all its parents, the world last."""
    while True:
        yield body
        if body.name == WORLD:
            return
        body = body.parent


def _joints_of_tendon(tendon: mujoco.MjsTendon) -> set[str]:
    return {w.target.name for w in tendon.path if w.type == mujoco.mjtWrap.mjWRAP_JOINT}


def _joints_along(tendon: mujoco.MjsTendon) -> set[str]:
    """Joints between the bodies whose sites are on a spatial tendon."""
    sites = [w.target for w in tendon.path if w.type == mujoco.mjtWrap.mjWRAP_SITE]
    return _between([site.parent for site in sites]) if sites else set()


def _unfiltered(
    spec: mujoco.MjSpec, held: Mapping[str, str], hung: set[str], still: set[str]
) -> list[tuple[str, str]]:
    """Pairs of bodies that would touch only because joints are held.

    The engine excludes contact between a body and its parent, where welded bodies count
    as one, but not if the parent is fixed to the world. Holding a joint can fix bodies
    to the world and thus enable such contacts. In addition, contact forces between the
    feet of a robot whose free base is held and the floor would depend on the height at
    which it is held, so these pairs are included as well.
    """
    before, after = _welds(spec, set()), _welds(spec, set(held))
    shaped = [body.name for body in spec.bodies if _collides(body)]
    pairs = []
    parents = not (
        int(spec.option.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    )
    for k, first in enumerate(shaped):
        for second in shaped[k + 1 :]:
            if _apart(after, first, second, parents):
                continue
            both = {first, second}
            if _apart(before, first, second, parents) or (both & hung and both & still):
                pairs.append((first, second))
    return pairs


def _collides(body: mujoco.MjsBody) -> bool:
    return any(geom.contype or geom.conaffinity for geom in body.geoms)


def _tree(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    yield body
    for child in body.bodies:
        yield from _tree(child)


def _welds(spec: mujoco.MjSpec, held: set[str]) -> dict[str, tuple[str, str]]:
    """For every body, the root of its welded group and the parent of that root."""
    welds = {WORLD: (WORLD, WORLD)}

    def visit(body: mujoco.MjsBody, parent: str) -> None:
        for child in body.bodies:
            moves = any(joint.name not in held for joint in child.joints)
            welds[child.name] = (child.name, parent) if moves else welds[body.name]
            visit(child, welds[child.name][0])

    visit(spec.worldbody, WORLD)
    return welds


def _apart(
    welds: Mapping[str, tuple[str, str]], first: str, second: str, parents: bool
) -> bool:
    """Whether the kinematic tree alone excludes contact between two bodies."""
    (a, above_a), (b, above_b) = welds[first], welds[second]
    if a == b:
        return True
    return parents and WORLD not in (a, b) and (a == above_b or b == above_a)
