"""Where an arm starts, and a sweep of its joints in which nothing collides."""

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
"""Travel of every joint, less where its range is short or something is near [rad]."""
MARGIN = 0.1
"""Share of a joint's range that the sweep keeps from either end, unless the arm starts
nearer to it."""
START_MARGIN = 0.01
"""Share that the pose of a keyframe keeps: drives give way, and a limit pushes."""
CLEARANCE = 5.0 * mm
"""Distance that bodies keep on a sweep: more than drives give way."""
DEEPER = 0.1 * mm
"""What bodies that touch where the arm starts may press on [m]."""
SPACING = 1.0 * deg
"""Between two poses in which distances are checked [rad]."""
BENDS = (45.0 * deg, 30.0 * deg, 60.0 * deg)
"""Of joints that are stretched where a tool is to move [rad]."""
SHARES = (1.0, 0.5, 0.25)
"""Of the sweep, tried one after the other where something is in the way."""
REFERENCE, MIDDLE, HOME = "reference", "middle", "home"


class StartWarning(UserWarning):
    """Bodies touch where an arm starts."""


def place_arm(
    reference: str, *, reading: ArmReading, pose: str | None = None
) -> tuple[RigidArm, Array]:
    """Read an arm in the pose from which it starts.

    That is the first in which no bodies touch of: the file's first keyframe; the
    reference position, joints outside their range in the middle of it; the middle of
    all ranges. Hinges that are not driven are held there, too.

    Args:
        reference: Path or name of a bundled arm.
        reading: What moves; its pose and angles are chosen here.
        pose: Keyframe, ``reference`` or ``middle``; ``home`` is a keyframe of that name
            or else the first. None: as above.

    Returns:
        The arm, and the angles of its joints [rad], shape (n_joints,).

    Raises:
        InputError: If the arm cannot be used or has no such pose.
    """
    whole = RigidArm(reference, reading=replace(reading, driven=()))
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
        f"{arm.path}: bodies {first!r} and {second!r} touch where the arm starts,"
        f" {depth / mm:.2g} mm deep (tried: {names}); another pose: --pose with one of"
        f" {', '.join([*whole.keyframes, REFERENCE, MIDDLE])}",
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
    """The arm with what does not move in a pose."""
    others = {name: q for name, q in angles.items() if not reading.drives(name)}
    if not others and (keyframe is None or not whole.held):
        return whole if not reading.driven else RigidArm(reference, reading=reading)
    chosen = replace(reading, pose=keyframe if whole.held else None, angles=others)
    return RigidArm(reference, reading=chosen)


def _poses(
    arm: RigidArm, asked: str | None
) -> list[tuple[str, str | None, dict[str, float]]]:
    """Name, keyframe and angles of the poses that may be the start."""
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

    found: dict[str, tuple[str | None, dict[str, float]]] = {
        key: (key, angles(np.array([values[name] for name in arm.joints])))
        for key, values in arm.keyframes.items()
    }
    first = list(found)[:1]
    found.setdefault(REFERENCE, (None, angles(reference, MARGIN)))
    found.setdefault(MIDDLE, (None, angles(middle)))
    if asked is None:
        names = [*first, REFERENCE, MIDDLE]
    else:
        if asked == HOME and HOME not in found:
            names = first or [REFERENCE]
        elif asked in found:
            names = [asked]
        else:
            raise InputError(
                f"{arm.path}: pose {asked!r}; accepted: {', '.join(found)}"
            )
    return [(name, *found[name]) for name in dict.fromkeys(names)]


def bent_starts(arm: RigidArm, start: Array) -> list[Array]:
    """Poses about a start in which the arm is not stretched and no bodies touch [rad].

    Joints bend to either side in turn, each within its range.
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
    """Where the joints start and end [rad]. Shapes (n_joints,).

    Every joint turns towards its farther limit, by :data:`SWEEP` or less. Where bodies
    would come nearer to each other than :data:`CLEARANCE`, the joints are taken one
    after the other, and each turns the other way or less far, or stays.

    Args:
        arm: The arm.
        start: [rad]; None: the reference position, or the middle of the range of a
            joint that may not be there. Shape (n_joints,).
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
            f"{arm.path}: no joint can turn by {SHARES[-1] * SWEEP / deg:g} deg either"
            f" way from the start, {way.in_the_way}; accepted: another --pose, or"
            " --motion with a motion of your own"
        )
    return start, end


def _room(arm: RigidArm, start: Array) -> tuple[Array, Array]:
    """Bounds of all joints [rad]; a start beyond the margin is within."""
    model = arm.model
    low, high = model.jnt_range.T.copy()
    # a limit far beyond any turn is none, and differences of such ones overflow
    free = ~_limited(arm)
    low[free], high[free] = 0.0, 0.0
    room = MARGIN * (high - low)
    low, high = low + room, high - room
    low[free], high[free] = -np.inf, np.inf
    return np.minimum(low, start), np.maximum(high, start)


def _limited(arm: RigidArm) -> NDArray[np.bool_]:
    """Joints whose range has two ends that a state can reach. Shape (n_joints,)."""
    model = arm.model
    reached = (abs(model.jnt_range) < LARGEST).all(axis=1)
    return np.asarray(model.jnt_limited.astype(bool) & reached)


class _Way:
    """What lies in the way of an arm from its start."""

    def __init__(self, arm: RigidArm, start: Array) -> None:
        self._arm, self._start = arm, start
        self.in_the_way = "where the ranges end"
        # bodies that are near from the start: half the distance is left to them, those
        # that touch stay as deep as they are
        self._allowed = {
            (a, b): 0.5 * depth if depth < 0.0 else depth + DEEPER
            for a, b, depth in arm.contacts(start[None], within=CLEARANCE)
        }

    def is_free(self, end: Array) -> bool:
        """Whether nothing collides on the straight way to an end."""
        count = 2 + int(np.abs(end - self._start).max() / SPACING)
        path = np.linspace(self._start, end, count)
        for a, b, depth in self._arm.contacts(path, within=CLEARANCE):
            if depth > self._allowed.get((a, b), -CLEARANCE):
                self.in_the_way = f"bodies {a!r} and {b!r} would collide"
                return False
        return True
