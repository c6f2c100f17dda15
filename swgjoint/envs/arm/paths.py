r"""Seeded paths of an arm that begin at rest in one pose, in joint or tool space.

In joint space every joint has its own motion of :mod:`swgjoint.envs.references`. In
tool space the tool follows a curve :math:`x(s) = x_0 + r\,u(s)` with :math:`|u| \le 1`,
which moves by :math:`s(t)`, the point-to-point motion of the same module. The joint
angles q(s) of the curve follow from inverse kinematics, so that

.. math:: \dot q = q'\,\dot s, \quad \ddot q = q''\,\dot s^2 + q'\,\ddot s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mujoco
import numpy as np

from swgjoint.envs.references import (
    KINDS,
    DrawnMotion,
    Instants,
    Motion,
    Move,
    draw_motion,
)
from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.commanded import HOLDS_ORIENTATION
from swgjoint.sim.motion.inverse_kinematics import ToolKinematics, follow
from swgjoint.typing import Array

Curve = Callable[[Array], Array]
"""Points u(s) of a curve from the origin, shape (n, 3), for 0 <= s <= 1, shape (n,)."""

ATTEMPTS = 20
"""Number of paths of a kind of which an arm must be able to follow one."""
SMALLER = 0.7
"""Size of a curve relative to the preceding one, which the arm could not follow [-]."""
LEAST = 0.1
"""Share of its drawn size, or of one of its limits, that a path must use [-]."""
ROOM = 0.01
"""Room of every joint for motions to either side, relative to their largest angle
[-]."""
PROBED = 20
"""Number of periods between the poses that are checked for contacts."""
_FLAT = 1e-3  # relative speed of the tool in a direction in which it does not move
_CONTROLS = 8  # points that a spline approaches; its first point is the start
_DEGREE = 5  # four continuous derivatives


def _line(rng: np.random.Generator, axes: Array) -> Curve:
    """Draw a direction."""
    direction = _unit(rng.standard_normal(len(axes))) @ axes
    return lambda s: s[:, None] * direction


def _arc(rng: np.random.Generator, axes: Array) -> Curve:
    """Draw an arc of a circle, of 90 to 360 degrees."""
    first, second = rng.standard_normal((2, len(axes)))
    first = _unit(first)
    second = _unit(second - (second @ first) * first) @ axes
    first = first @ axes
    angle = rng.uniform(0.5, 2.0) * np.pi
    radius = 0.5 / np.sin(0.5 * min(angle, np.pi))  # of the largest distance

    def place(s: Array) -> Array:
        turned = np.outer(np.cos(angle * s) - 1.0, first)
        return np.asarray(radius * (turned + np.outer(np.sin(angle * s), second)))

    return place


def _spline(rng: np.random.Generator, axes: Array) -> Curve:
    """Draw a smooth curve, which stays in the convex hull of its control points."""
    from scipy.interpolate import BSpline

    points = np.zeros((_CONTROLS, len(axes)))
    for one in points[1:]:
        share = rng.uniform() ** (1.0 / one.size)
        one[:] = share * _unit(rng.standard_normal(one.size))
    inner = np.linspace(0.0, 1.0, _CONTROLS - _DEGREE + 1)
    knots = np.pad(inner, _DEGREE, mode="edge")
    spline = BSpline(knots, points @ axes, _DEGREE)
    return lambda s: np.asarray(spline(s))


def _points(place: Array, size: float, curve: Curve, s: Array) -> Array:
    """Points of a curve of some size [m] from a place [m]. Shape (n, 3)."""
    return place + size * curve(s)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


CURVES: dict[str, Callable[[np.random.Generator, Array], Curve]] = {
    "line": _line,
    "arc": _arc,
    "spline": _spline,
}
"""Functions that draw a curve of the tool in the space of some unit vectors, shape
(n_axes, 3), by the name of its kind."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointPath:
    """Independent motions of all joints."""

    kind: str
    """One of :data:`~swgjoint.envs.references.KINDS`."""
    start: Array
    """Angles at the start [rad]. Shape (n_joints,)."""
    motions: tuple[DrawnMotion, ...]
    """Motion of every joint from its start."""

    def shorten(self, share: float) -> JointPath:
        """Copy whose motions have a share of their size."""
        smaller = tuple(replace(one, size=share * one.size) for one in self.motions)
        return replace(self, motions=smaller)

    def sample(self, instants: Instants, part: slice) -> Motion:
        """Angles, speeds and accelerations of the joints. Shapes (n, n_joints).

        Args:
            instants: Times of the path.
            part: Range of the instants.
        """
        each = [one.sample(instants, part) for one in self.motions]
        q, v, a = (np.stack(values, axis=1) for values in zip(*each, strict=True))
        return self.start + q, v, a


@dataclass(frozen=True, kw_only=True, eq=False)
class ToolPath:
    """Motion of the tool along a curve."""

    kind: str
    """One of :data:`CURVES`."""
    joints: tuple[Any, Any, Any]
    """Splines of the joint angles along the curve, and of their derivatives."""
    profile: Move
    """Motion along the curve."""
    size: float
    """Share of the curve that is used [-]."""

    def shorten(self, share: float) -> ToolPath:
        """Copy that uses a share of the used part of the curve."""
        return replace(self, size=share * self.size)

    def sample(self, instants: Instants, part: slice) -> Motion:
        """Angles, speeds and accelerations of the joints. Shapes (n, n_joints).

        Args:
            instants: Times of the path.
            part: Range of the instants.
        """
        s, rate, bend = (self.size * x for x in self.profile.sample(instants, part))
        q, slope, curvature = (np.asarray(one(s)) for one in self.joints)
        rate, bend = rate[:, None], bend[:, None]
        return q, slope * rate, curvature * (rate * rate) + slope * bend


class ArmPaths:
    """Random paths of one arm within limits of speed and reach."""

    def __init__(
        self,
        arm: RigidArm,
        start: Array,
        instants: Instants,
        *,
        kinds: tuple[str, ...],
        max_speed: float,
        max_angle: float,
        max_acceleration: float,
        max_distance: float,
    ) -> None:
        """Prepare the limits.

        Args:
            arm: The arm, which has a tool site.
            start: Joint angles at the start [rad]. Shape (n_joints,).
            instants: Times of the paths.
            kinds: Names of :data:`KINDS` and :data:`CURVES`, of which each path draws
                one.
            max_speed: Largest joint speed [rad/s].
            max_angle: Largest deviation of a joint angle from the start [rad].
            max_acceleration: Largest joint acceleration [rad/s²].
            max_distance: Largest distance of the tool from its start along curves [m].

        Raises:
            InputError: If the arm cannot follow a kind of path from its start.
        """
        self._arm, self._start, self._instants = arm, start, instants
        self._kinds, self._distance = kinds, max_distance
        self._rates = max_speed, max_acceleration
        model = arm.model
        low, high = np.where(model.jnt_limited[:, None], model.jnt_range, np.inf).T
        low = np.where(model.jnt_limited, low, -np.inf)
        self._below = np.clip(start - low, 0.0, max_angle)
        self._above = np.clip(high - start, 0.0, max_angle)
        holds = len(arm.joints) >= HOLDS_ORIENTATION
        where = f"arm {arm.reference!r}"
        self._kinematics = ToolKinematics(arm, hold_orientation=holds, where=where)
        self._axes = np.eye(3)
        if not holds:  # directions in which the tool of a simple arm can move
            axes, speeds, _ = np.linalg.svd(tool_slopes(arm, start[None])[0])
            self._axes = axes.T[: int((speeds > _FLAT * speeds[0]).sum())]
        self._touching = self._contacts(start[None])
        if set(kinds) & set(KINDS):
            self._check_room(max_angle)
        self._most = np.full(start.shape, max_angle)
        self._known: dict[str, JointPath | ToolPath] = {}
        for kind in dict.fromkeys(kinds):
            self._known[kind] = self._first(kind, np.random.default_rng(0))

    def draw(self, rng: np.random.Generator) -> tuple[JointPath | ToolPath, Motion]:
        """Draw a path, which uses some of its limits.

        Returns:
            The path, and its values at all instants.
        """
        kind = self._kinds[int(rng.integers(len(self._kinds)))]
        for k in range(10 * ATTEMPTS):
            try:
                path, motion = self._attempt(kind, rng, k)
            except InputError:
                continue
            if self._is_used(path, motion):
                return path, motion
        # so few fit that the known one is better than an end of a training
        path = self._known[kind]
        return path, path.sample(self._instants, slice(None))

    def _first(self, kind: str, rng: np.random.Generator) -> JointPath | ToolPath:
        """Path of a kind that the arm can follow."""
        why = "all paths shrink, because bodies would touch or a joint would leave its"
        why += " range"
        for k in range(ATTEMPTS):
            try:
                path, motion = self._attempt(kind, rng, k)
            except InputError as failure:
                why = str(failure)
                continue
            if self._is_used(path, motion):
                return path
        others = ", ".join(one for one in (*KINDS, *CURVES) if one != kind)
        size = "max_distance_mm" if kind in CURVES else "max_angle_rad"
        raise InputError(
            f"reference {kind!r}: arm {self._arm.reference!r} cannot follow such a"
            f" path from its start ({why}); accepted: another start, a smaller {size},"
            f" or others of {others}"
        )

    def _attempt(
        self, kind: str, rng: np.random.Generator, k: int
    ) -> tuple[JointPath | ToolPath, Motion]:
        """Draw a path after k failures, and shorten it until it keeps the limits."""
        path: JointPath | ToolPath
        if kind in CURVES:
            path = self._along_curve(kind, rng, SMALLER ** min(k, ATTEMPTS))
        else:
            path = self._joint(kind, rng)
        motion = path.sample(self._instants, slice(None))
        limits = self._below, self._above
        while (excess := self._excess(motion, *limits)) > 1.0 + 1e-9:
            path = path.shorten(0.99 / min(excess, 10.0))
            motion = path.sample(self._instants, slice(None))
        while not self._contacts(motion[0][::PROBED]) <= self._touching:
            path = path.shorten(0.5)
            motion = path.sample(self._instants, slice(None))
        return path, motion

    def _is_used(self, path: JointPath | ToolPath, motion: Motion) -> bool:
        """Whether a path is more than a remainder of what was drawn."""
        if isinstance(path, ToolPath):
            # limits are those of the settings, not what the end of a joint leaves
            limits = self._most, self._most
            return max(path.size, self._excess(motion, *limits)) >= LEAST
        return self._excess(motion, self._below, self._above) >= LEAST

    def _check_room(self, max_angle: float) -> None:
        """Reject a joint that has no room for motions to either side of its start."""
        names, room = self._arm.joints, np.minimum(self._below, self._above)
        least = int(room.argmin())
        if room[least] < ROOM * max_angle:
            raise InputError(
                f"reference: arm {self._arm.reference!r}: joint {names[least]!r} starts"
                f" {room[least]:.3g} rad from an end of its range; accepted: at least"
                f" {ROOM * max_angle:.3g} rad, {100.0 * ROOM:g} % of max_angle_rad"
            )

    def _joint(self, kind: str, rng: np.random.Generator) -> JointPath:
        """Draw a motion of every joint, within the limits."""
        speed, acceleration = self._rates
        motions = [
            draw_motion(
                self._instants,
                rng,
                kinds=(kind,),
                max_speed=speed,
                max_angle=float(angle),
                max_acceleration=acceleration,
            )[0]
            for angle in np.minimum(self._below, self._above)
        ]
        return JointPath(kind=kind, start=self._start, motions=tuple(motions))

    def _along_curve(
        self, kind: str, rng: np.random.Generator, share: float
    ) -> ToolPath:
        """Draw a curve, of a share of the drawn size.

        Raises:
            InputError: If the arm cannot follow it.
        """
        if len(self._axes) < (1 if kind == "line" else 2):
            count = len(self._axes)
            raise InputError(f"the tool moves in {count} direction only")
        place, _ = self._kinematics.pose(self._start)
        size = self._distance * rng.uniform(0.4, 1.0) * share
        points = partial(_points, place, size, CURVES[kind](rng, self._axes))
        joints = follow(self._kinematics, self._start, points, length=1.0)
        return ToolPath(
            kind=kind,
            joints=(joints, joints.derivative(), joints.derivative(2)),
            profile=Move.draw(float(self._instants.time[-1]), rng),
            size=1.0,
        )

    def _excess(self, motion: Motion, below: Array, above: Array) -> float:
        """Largest ratio of a motion to its limit [-]."""
        q, v, a = motion
        (speed, acceleration), moved = self._rates, q - self._start
        shares = [np.abs(v).max() / speed, np.abs(a).max() / acceleration]
        for way, limit in ((-moved, below), (moved, above)):
            top = way.max(axis=0)
            # a joint at its end has only the round-off of inverse kinematics
            shares.append((top / np.maximum(limit, 1e-9)).max())
        return float(max(shares))

    def _contacts(self, position: Array) -> set[tuple[str, str]]:
        """Pairs of bodies that touch in some of the poses."""
        model = self._arm.model
        if not (model.geom_contype.any() or model.geom_conaffinity.any()):
            return set()
        return {(a, b) for a, b, _ in self._arm.contacts(position)}


def tool_slopes(arm: RigidArm, path: Array) -> Array:
    """Tool displacement per link angle along a path [m/rad]. Shape (n, 3, n_joints).

    Args:
        arm: Arm with a tool site.
        path: Joint angles [rad]. Shape (n, n_joints).
    """
    out = np.empty((len(path), 3, path.shape[1]))
    data = mujoco.MjData(arm.model)
    for row, q in zip(out, path, strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm.model, data)
        mujoco.mj_comPos(arm.model, data)
        mujoco.mj_jacSite(arm.model, data, row, None, arm.tool)
    return out
