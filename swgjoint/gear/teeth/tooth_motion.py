"""Motion of one flexspline tooth relative to the circular spline, and its inverse.

The teeth are rigid and move with the deflected neutral line. The parameter theta is the
angle of the tooth on the undeflected rim, counter-clockwise from the lobe of the wave
generator. At theta = 0, the tooth is in the middle of its tooth space, whichever member
of the drive is fixed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.neutral_line import Pose, neutral_line
from swgjoint.typing import Array

Receiver = Literal["flexspline", "circular_spline"]

SAME = 1e-9
"""Largest difference between motions that count as identical, relative to the radius
[-]."""

_MIRROR = np.array([-1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class MovedFlank:
    """Rigid motions q = turn p + shift of points p, one for each value of theta."""

    turn: Array
    """Rotation or reflection matrices (n, 2, 2)."""
    shift: Array
    """Translations (n, 2) [m]."""
    d_turn: Array
    """Derivatives of ``turn`` with respect to theta (n, 2, 2) [1/rad]."""
    d_shift: Array
    """Derivatives of ``shift`` with respect to theta (n, 2) [m/rad]."""

    def points(self, p: Array) -> Array:
        """Images of points p (n, ..., 2) [m]; the first axis matches the motions."""
        return _apply(self.turn, p) + _wide(self.shift, p)

    def vectors(self, v: Array) -> Array:
        """Images of direction vectors v (n, ..., 2), which are not translated."""
        return _apply(self.turn, v)

    def velocities(self, p: Array) -> Array:
        """Derivatives of the images of p with respect to theta (n, ..., 2) [m/rad]."""
        return _apply(self.d_turn, p) + _wide(self.d_shift, p)


def _apply(matrix: Array, v: Array) -> Array:
    return np.asarray(np.einsum("nij,n...j->n...i", matrix, v))


def _wide(shift: Array, like: Array) -> Array:
    return shift.reshape(shift.shape[0], *(1,) * (like.ndim - 2), 2)


def _rotation(angle: Array) -> tuple[Array, Array]:
    """Rotation matrices and their derivatives by the angle, each (n, 2, 2)."""
    c, d = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([c, -d], -1), np.stack([d, c], -1)], axis=-2)
    return turn, np.stack([np.stack([-d, -c], -1), np.stack([c, -d], -1)], axis=-2)


class TeethOnRim(Protocol):
    """Motion of the teeth on the deflected rim: neutral line or finite elements."""

    @property
    def lobes(self) -> int:
        """Number of lobes of the wave generator."""

    @property
    def radius(self) -> float:
        """Radius of the reference point of the tooth [m]."""

    def pose(self, theta: ArrayLike) -> Pose:
        """Pose of a tooth in the frame of the wave generator.

        Args:
            theta: Angles on the undeflected rim from the first lobe, counter-clockwise
                (n,) [rad].
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothMotion:
    """Relative motion of the teeth of both members at one lobe."""

    line: TeethOnRim
    """Motion of the teeth on the rim."""
    teeth_flexspline: int
    """Number of teeth of the flexspline."""
    teeth_circular_spline: int
    """Number of teeth of the circular spline."""
    lobe: int = 0
    """Index of the lobe, counter-clockwise from 0."""
    mirrored: bool = False
    """Whether left and right are exchanged, so that a right flank represents a left
    flank."""

    @property
    def half_range(self) -> float:
        """Half the angle between neighbouring lobes [rad]."""
        return np.pi / self.line.lobes

    def in_space(self, theta: Array) -> MovedFlank:
        """Map from the frame of the flexspline tooth to the frame of the tooth space.

        The frame of the tooth space in the circular spline has the gear axis as its
        origin and the middle of the space on +y.

        Args:
            theta: Positions of the motion (n,) [rad].
        """
        sign = -1.0 if self.mirrored else 1.0
        at_lobe = 2.0 * np.pi * self.lobe / self.line.lobes
        pose = self.line.pose(sign * theta + at_lobe)
        # angle of the wave generator relative to the circular spline,
        # alpha = -theta z_fs/z_cs
        rate = -self.teeth_flexspline / self.teeth_circular_spline
        alpha = sign * theta * rate - at_lobe
        turn, d_turn = _rotation(pose.angle + alpha)
        carry, d_carry = _rotation(alpha)
        foot = np.array([0.0, self.line.radius])
        d_turn = d_turn * (pose.d_angle + rate)[:, None, None]
        shift = _apply(carry, pose.point) - _apply(turn, _like(foot, turn))
        d_shift = (
            _apply(d_carry, pose.point) * rate
            + _apply(carry, pose.d_point)
            - _apply(d_turn, _like(foot, turn))
        )
        if not self.mirrored:
            return MovedFlank(turn=turn, shift=shift, d_turn=d_turn, d_shift=d_shift)
        both = _MIRROR[:, None] * _MIRROR
        return MovedFlank(
            turn=turn * both,
            shift=shift * _MIRROR,
            d_turn=-d_turn * both,
            d_shift=-d_shift * _MIRROR,
        )

    def to_circular_spline(self, theta: Array) -> MovedFlank:
        """Map from a right flank of the flexspline to the right flank of the mate.

        The mate is the tooth of the circular spline half a pitch clockwise, mirrored so
        that its left flank becomes the right flank.
        """
        space = self.in_space(theta)
        matrix = _facing(self.teeth_circular_spline)
        return MovedFlank(
            turn=matrix @ space.turn,
            shift=space.shift @ matrix.T,
            d_turn=matrix @ space.d_turn,
            d_shift=space.d_shift @ matrix.T,
        )

    def to_flexspline(self, theta: Array) -> MovedFlank:
        """Inverse of :meth:`to_circular_spline`, from circular spline to flexspline.

        Args:
            theta: Positions of the motion (n,) [rad].
        """
        forward = self.to_circular_spline(theta)
        turn = np.swapaxes(forward.turn, -1, -2)
        d_turn = np.swapaxes(forward.d_turn, -1, -2)
        return MovedFlank(
            turn=turn,
            shift=-_apply(turn, forward.shift),
            d_turn=d_turn,
            d_shift=-_apply(d_turn, forward.shift) - _apply(turn, forward.d_shift),
        )

    def map_to(self, receiver: Receiver, theta: Array) -> MovedFlank:
        """Map from the right flank of the other member to that of the receiver.

        Args:
            receiver: Member whose tooth frame contains the result.
            theta: Positions of the motion (n,) [rad].
        """
        if receiver == "flexspline":
            return self.to_flexspline(theta)
        return self.to_circular_spline(theta)


def _like(vector: Array, matrix: Array) -> Array:
    return np.broadcast_to(vector, (matrix.shape[0], 2))


def _facing(teeth: int) -> Array:
    """Matrix from the frame of a tooth space to that of its mirrored right tooth."""
    c, d = np.cos(np.pi / teeth), np.sin(np.pi / teeth)
    return np.array([[-c, d], [d, c]])


def tooth_motions(
    design: Design, line: TeethOnRim | None = None
) -> tuple[ToothMotion, ...]:
    """Distinct motions of right and left flanks at all lobes.

    Args:
        design: The drive.
        line: Motion of the teeth on the rim; None takes the neutral line of the design.

    Raises:
        DesignError: If the wave generator cannot be built.
    """
    line = line or neutral_line(design)
    first = ToothMotion(
        line=line,
        teeth_flexspline=design.drive.teeth_flexspline,
        teeth_circular_spline=design.drive.teeth_circular_spline,
    )
    theta = np.linspace(-1.0, 1.0, 41) * first.half_range

    def path(motion: ToothMotion) -> Array:
        moved = motion.in_space(theta)
        return np.concatenate([moved.turn.ravel(), moved.shift.ravel() / line.radius])

    distinct: list[tuple[ToothMotion, Array]] = []
    for lobe in range(line.lobes):
        for mirrored in (False, True):
            motion = ToothMotion(
                line=line,
                teeth_flexspline=first.teeth_flexspline,
                teeth_circular_spline=first.teeth_circular_spline,
                lobe=lobe,
                mirrored=mirrored,
            )
            new = path(motion)
            if all(np.abs(new - old).max() > SAME for _, old in distinct):
                distinct.append((motion, new))
    return tuple(motion for motion, _ in distinct)
