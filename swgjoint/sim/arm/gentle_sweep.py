"""Start pose of an arm, and a collision-free sweep of its joints."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.sim.arm.number_checks import LARGEST
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.typing import Array
from swgjoint.units import deg, mm

SWEEP = 20.0 * deg
"""Travel of every joint, unless its range or obstacles limit it [rad]."""
MARGIN = 0.1
"""Smallest distance of the sweep, and of a start in the reference pose, from both ends
of a joint's range, relative to the range. Other starts may be closer to an end."""
START_MARGIN = 0.01
"""Smallest distance of a keyframe pose from both ends of a joint's range, relative to
the range. At an end, the limit would exert a force as soon as the drive yields."""
CLEARANCE = 5.0 * mm
"""Smallest distance between bodies during a sweep [m]. It is larger than the
displacement of the links by the compliance of the drives."""
DEEPER = 0.1 * mm
"""Accepted increase in penetration of bodies that touch at the start [m]."""
SPACING = 1.0 * deg
"""Joint angle between two poses at which distances are checked [rad]."""
BENDS = (45.0 * deg, 30.0 * deg, 60.0 * deg)
"""Angles to try in turn by which the joints of a stretched arm are bent [rad]."""
SHARES = (1.0, 0.5, 0.25)
"""Fractions of the sweep to try in turn if obstacles limit it."""
REFERENCE, MIDDLE, HOME = "reference", "middle", "home"
"""Names of start poses that need no keyframe."""


class StartWarning(UserWarning):
    """Warning that bodies touch in the start pose of an arm."""


def place_arm(
    reference: str, *, reading: ArmReading, pose: str | None = None
) -> tuple[RigidArm, Array]:
    """Read an arm in its start pose.

    By default, the start pose is the first of the following poses in which no bodies
    touch: the first keyframe of the file; the reference position, with joints whose
    range excludes it at the middle of the range; the middle of all ranges. If bodies
    touch in all of them, the first one is used with a :class:`StartWarning`. Hinges
    without a drive are held in the start pose.

    Args:
        reference: Path of an arm's file, or name of a bundled arm.
        reading: Hinges that move; its pose and angles are replaced.
        pose: Name of a keyframe, ``reference`` or ``middle``. ``home`` is the keyframe
            of that name, or else the first keyframe or the reference position. None
            chooses the default.

    Returns:
        The arm, and its joint angles [rad], shape (n_joints,).

    Raises:
        InputError: If the arm cannot be used or has no such pose.
    """
    every = replace(reading, driven=())
    # a link without mass, such as a helper of a gripper, may move on held joints only
    whole = RigidArm(reference, reading=every, kinematics_only=bool(reading.driven))
    tried: list[tuple[str, RigidArm, Array]] = []
    for name, keyframe, angles in _poses(whole, pose):
        arm = _in_pose(reference, whole, reading, keyframe, angles)
        start = np.array([angles[joint] for joint in arm.joints])
        tried.append((name, arm, start))
        if not arm.contacts(start[None]):
            return arm, start
    _, arm, start = tried[0]
    first, second, depth = arm.contacts(start[None])[0]
    names = ", ".join(name for name, _, _ in tried)
    warnings.warn(
        f"{arm.path}: bodies {first!r} and {second!r} touch at the start,"
        f" {depth / mm:.2g} mm deep (tried: {names}); for another pose: --pose with one"
        f" of {', '.join([*whole.keyframes, REFERENCE, MIDDLE])}",
        StartWarning,
        stacklevel=2,
    )
    return arm, start


def _in_pose(
    reference: str,
    whole: RigidArm,
    reading: ArmReading,
    keyframe: str | None,
    angles: dict[str, float],
) -> RigidArm:
    """The arm with its held joints in a pose."""
    others = {name: q for name, q in angles.items() if not reading.drives(name)}
    if not others and (keyframe is None or not whole.held):
        return whole if not reading.driven else RigidArm(reference, reading=reading)
    chosen = replace(reading, pose=keyframe if whole.held else None, angles=others)
    return RigidArm(reference, reading=chosen)


def _poses(
    arm: RigidArm, chosen: str | None
) -> list[tuple[str, str | None, dict[str, float]]]:
    """Name, keyframe and angles of all candidate start poses."""
    model = arm.model
    low, high = model.jnt_range.T
    limited = _limited(arm)
    inside = ~limited | ((model.qpos0 >= low) & (model.qpos0 <= high))
    middle = np.where(limited, 0.5 * (low + high), model.qpos0)
    reference = np.where(inside, model.qpos0, middle)

    def angles(q: Array, margin: float = START_MARGIN) -> dict[str, float]:
        pad = np.where(limited, margin * (high - low), 0.0)
        kept = np.where(limited, np.clip(q, low + pad, high - pad), q)
        return dict(zip(arm.joints, kept.tolist(), strict=True))

    poses: dict[str, tuple[str | None, dict[str, float]]] = {
        key: (key, angles(np.array([values[name] for name in arm.joints])))
        for key, values in arm.keyframes.items()
    }
    first = list(poses)[:1]
    poses.setdefault(REFERENCE, (None, angles(reference, MARGIN)))
    poses.setdefault(MIDDLE, (None, angles(middle)))
    if chosen is None:
        names = [*first, REFERENCE, MIDDLE]
    elif chosen == HOME and HOME not in poses:
        names = first or [REFERENCE]
    elif chosen in poses:
        names = [chosen]
    else:
        raise InputError(f"{arm.path}: pose {chosen!r}; accepted: {', '.join(poses)}")
    return [(name, *poses[name]) for name in dict.fromkeys(names)]


def bent_starts(arm: RigidArm, start: Array) -> list[Array]:
    """Poses with bent joints near a start pose in which no bodies touch.

    Successive joints are bent in opposite directions, each within its range.

    Args:
        arm: The arm.
        start: Joint angles at the start [rad]. Shape (n_joints,).

    Returns:
        Joint angles of each pose [rad], in the order in which to try
            them. Shapes (n_joints,).
    """
    model = arm.model
    low, high = model.jnt_range.T
    limited = _limited(arm)
    pad = np.where(limited, MARGIN * (high - low), 0.0)
    turn = np.where(np.arange(start.size) % 2, -1.0, 1.0)
    poses = [start + sign * bend * turn for bend in BENDS for sign in (1.0, -1.0)]
    poses = [np.where(limited, np.clip(q, low + pad, high - pad), q) for q in poses]
    return [q for q in poses if not arm.contacts(q[None])]


def gentle_sweep(arm: RigidArm, start: Array | None = None) -> tuple[Array, Array]:
    """Start and end of a collision-free sweep [rad]. Shapes (n_joints,).

    Every joint turns towards its farther limit by :data:`SWEEP`, or less if its range
    ends before. If bodies would come closer than :data:`CLEARANCE`, the joints are
    added one by one. A joint that would cause this turns in the other direction, or
    less far, or remains at rest.

    Args:
        arm: The arm.
        start: Joint angles at the start [rad], shape (n_joints,). None uses the
            reference position, with joints whose range excludes it at the middle of the
            range.

    Raises:
        InputError: If no joint can turn without a collision.
    """
    if start is None:
        ((_, _, angles),) = _poses(arm, REFERENCE)
        start = np.array([angles[name] for name in arm.joints])
    low, high = _room(arm, start)
    farther = np.where(high - start >= start - low, 1.0, -1.0)
    way = _Way(arm, start)
    end = np.clip(start + farther * SWEEP, low, high)
    if way.is_free(end):
        return start, end
    end = start.copy()
    for j in range(start.size):
        for share in SHARES:
            for sign in (farther[j], -farther[j]):
                tried = end.copy()
                tried[j] = np.clip(start[j] + sign * share * SWEEP, low[j], high[j])
                if tried[j] != start[j] and way.is_free(tried):
                    break
            else:
                continue
            end = tried
            break
    if not (end != start).any():
        raise InputError(
            f"{arm.path}: no joint can turn by {SHARES[-1] * SWEEP / deg:g} deg in"
            f" either direction from the start, {way.in_the_way}; accepted: another"
            " --pose, or --motion with another motion"
        )
    return start, end


def _room(arm: RigidArm, start: Array) -> tuple[Array, Array]:
    """Bounds of the sweep of all joints [rad]; they always include the start."""
    model = arm.model
    low, high = model.jnt_range.T.copy()
    # an extremely large limit is no limit, and differences of such limits overflow
    free = ~_limited(arm)
    low[free], high[free] = 0.0, 0.0
    room = MARGIN * (high - low)
    low, high = low + room, high - room
    low[free], high[free] = -np.inf, np.inf
    return np.minimum(low, start), np.maximum(high, start)


def _limited(arm: RigidArm) -> NDArray[np.bool_]:
    """Whether each joint has a range with realistic ends. Shape (n_joints,)."""
    model = arm.model
    reached = (abs(model.jnt_range) < LARGEST).all(axis=1)
    return np.asarray(model.jnt_limited.astype(bool) & reached)


class _Way:
    """Collision check of straight motions in joint space from the start of an arm."""

    def __init__(self, arm: RigidArm, start: Array) -> None:
        self._arm, self._start = arm, start
        self.in_the_way = "because the ranges end there"
        # bodies that are close at the start may halve their distance; bodies that touch
        # there may penetrate only slightly deeper
        self._allowed = {
            (a, b): 0.5 * depth if depth < 0.0 else depth + DEEPER
            for a, b, depth in arm.contacts(start[None], within=CLEARANCE)
        }

    def is_free(self, end: Array) -> bool:
        """Whether no bodies collide on the straight joint motion to an end."""
        count = 2 + int(np.abs(end - self._start).max() / SPACING)
        path = np.linspace(self._start, end, count)
        for a, b, depth in self._arm.contacts(path, within=CLEARANCE):
            if depth > self._allowed.get((a, b), -CLEARANCE):
                self.in_the_way = f"because bodies {a!r} and {b!r} would collide"
                return False
        return True
