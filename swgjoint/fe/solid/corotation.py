r"""Corotational 3D segments: large rotations, small strains within a segment.

Each segment of each sector has a frame R, which is the best-fit rotation of its masters
from the reference positions X to the positions x (polar decomposition of
:math:`\sum x_i X_i^T`). With :math:`d = R^T x - X` the strain energy is
:math:`\tfrac12 d^T \hat K d`. To first order, a motion :math:`\delta y` of the masters
in the frame rotates the frame by :math:`\omega = G\,\delta y` and deforms the segment
by :math:`P\,\delta y`, where :math:`P = I - S G` and :math:`S\omega = \omega\times y`.

To second order, the frame rotates by a further :math:`I^{-1} \sum X \times
(\tfrac12 \omega \times (\omega \times y) - \omega \times \delta y)`, where
:math:`I\omega = \sum X \times (\omega \times y)`. With the moment
:math:`\tau = \sum y \times f` of the forces f and :math:`G^T \tau = (I^{-1} \tau)
\times X`, this reduces the forces in the second derivative of the energy from f to
the gradient :math:`P^T f`. Gradient and tangent are exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.solid.strip.segment import StripSegment
from swgjoint.typing import Array


def spin(vectors: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product v x with vectors v (..., 3)."""
    matrix = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., i, k], matrix[..., k, i] = vectors[..., j], -vectors[..., j]
    return matrix


def about_z(angle: Array) -> Array:
    """Matrices of rotations about the axis of the drive by angles [rad] (..., 3, 3)."""
    cos, sin = np.cos(angle), np.sin(angle)
    matrix = np.zeros((*np.shape(angle), 3, 3))
    matrix[..., 0, 0] = matrix[..., 1, 1] = cos
    matrix[..., 0, 1], matrix[..., 1, 0] = -sin, sin
    matrix[..., 2, 2] = 1.0
    return matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidFrames:
    """Kinematics of one segment with m masters in all sectors."""

    turn: Array
    """Rotations from the frames to the global frame (N, 3, 3)."""
    position: Array
    """Positions y of the masters in the frames, relative to their mean (N, m, 3) [m].
    """
    centre: Array
    """Mean of d: mean of the masters' positions in the frames minus the mean of X
    (N, 3) [m]."""
    deformation: Array
    """Displacement d without its mean (N, 3 m) [m]."""
    gradient: Array
    """Derivative G of the rotation of the frames by the masters in the frames
    (N, 3, 3 m) [1/m]."""

    @property
    def displacement(self) -> Array:
        """Displacement d of the masters in the frames (N, 3 m) [m]."""
        n, m = self.position.shape[:2]
        return self.deformation + np.tile(self.centre, (1, m)).reshape(n, 3 * m)


def segment_frames(
    segment: StripSegment, x: Array, place: Array, *, fitted: bool = True
) -> SolidFrames:
    """Frames of a segment in all sectors, fitted to its masters.

    Args:
        segment: The condensed segment.
        x: Positions of its masters in the global frame (N, m, 3) [m].
        place: Rotations of the sectors in the undeformed ring (N, 3, 3).
        fitted: Whether the frames follow the masters; if not, they remain at
            ``place`` (linear model).
    """
    reference = segment.position - segment.position.mean(axis=0)
    mean = x.mean(axis=1)
    seen = np.einsum("sji,saj->sai", place, x - mean[:, None])
    crossed = spin(reference).transpose(1, 0, 2).reshape(3, -1)
    gradient = np.zeros((len(x), *crossed.shape))
    turn, y = place, seen
    if fitted:
        left, _, right = np.linalg.svd(seen.transpose(0, 2, 1) @ reference)
        left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
        fit = left @ right
        turn, y = place @ fit, seen @ fit
        arm = np.einsum("ai,sai->s", reference, y)
        inertia = arm[:, None, None] * np.eye(3)
        inertia -= y.transpose(0, 2, 1) @ reference
        gradient += np.linalg.solve(inertia, np.broadcast_to(crossed, gradient.shape))
    return SolidFrames(
        turn=turn,
        position=y,
        centre=np.einsum("sji,sj->si", turn, mean) - segment.position.mean(axis=0),
        deformation=(y - reference).reshape(len(x), -1),
        gradient=gradient,
    )


def energies(segment: StripSegment, frames: SolidFrames) -> Array:
    """Strain energy d^T K d/2 of a segment in each sector (N,) [J].

    The energy of loads on the segment is not included.

    Args:
        segment: The condensed segment.
        frames: Its frames, see :func:`segment_frames`.
    """
    d = frames.deformation
    return np.asarray(0.5 * np.einsum("si,si->s", d @ segment.stiffness, d))


def project_to_frames(frames: SolidFrames, force: Array) -> Array:
    """Gradient P^T f of the energy by the masters in the frames (N, 3 m) [N].

    Args:
        frames: Frames of a segment.
        force: Gradient f of the energy by the displacements d (N, 3 m) [N].
    """
    n, m = frames.position.shape[:2]
    moment = np.cross(frames.position, force.reshape(n, m, 3)).sum(axis=1)
    return np.asarray(force - np.einsum("sw,swi->si", moment, frames.gradient))


def tangent(segment: StripSegment, frames: SolidFrames, force: Array) -> Array:
    r"""Second derivative of the energy by the masters in the frames.

    .. math:: T = P^T \hat K P + H G + (H G)^T - G^T \mathrm{sym}(H^T S) G, \quad
        H\omega = \omega \times f

    Args:
        segment: The condensed segment.
        frames: Its frames, see :func:`segment_frames`.
        force: Gradient f of the energy by the masters in the frames, including that of
            the loads, see :func:`project_to_frames` (N, 3 m) [N].

    Returns:
        Symmetric matrices (N, 3 m, 3 m) [N/m].
    """
    n, m = frames.position.shape[:2]
    g = frames.gradient
    # S and H map a rotation to motions and to changes of force
    s = -spin(frames.position).reshape(n, 3 * m, 3)
    h = -spin(force.reshape(n, m, 3)).reshape(n, 3 * m, 3)
    ks = segment.stiffness @ s
    middle = s.transpose(0, 2, 1) @ ks
    geometric = h.transpose(0, 2, 1) @ s
    middle -= 0.5 * (geometric + geometric.transpose(0, 2, 1))
    # everything but K has G on one side: T = K + U G + (U G)^T
    u = h - ks + 0.5 * (g.transpose(0, 2, 1) @ middle)
    outer = u @ g
    return np.asarray(segment.stiffness + outer + outer.transpose(0, 2, 1))


def dead_load_tangent(
    frames: SolidFrames, carry: Array, arm: Array, force: Array
) -> tuple[Array, Array]:
    r"""Gradient and tangent of forces that keep their direction in the global frame.

    A force F at the arm a of a segment, which moves by :math:`A\,\delta y` with the
    masters in the frame, has the potential :math:`-F \cdot R\,(a + A\,\delta y)`.
    Without what :func:`tangent` takes into account, if the force of the masters there
    contains :math:`-A^T F` and the gradient below, its second derivative is

    .. math:: H_F A P + (H_F A P)^T + G^T \mathrm{sym}(Q) G, \quad
        H_F v = \sum F \times v, \quad
        Q\omega = \sum (F \cdot a)\,\omega - F (a \cdot \omega) .

    Args:
        frames: Frames of a segment.
        carry: Displacements A of b points by its masters (3 b, 3 m) [-].
        arm: Positions of the points relative to the mean of the masters, in the frames
            (N, b, 3) [m].
        force: Forces at the points in the frames (N, b, 3) [N].

    Returns:
        Gradient by the rotation of the frames (N, 3 m) [N], and the symmetric matrices
        (N, 3 m, 3 m) [N/m], both by the masters in the frames.
    """
    n, m = frames.position.shape[:2]
    g = frames.gradient
    moment = np.cross(arm, force).sum(axis=1)
    gradient = -(moment[:, None] @ g)[:, 0]
    s = -spin(frames.position).reshape(n, 3 * m, 3)
    turned = spin(force).transpose(0, 2, 1, 3).reshape(n, 3, -1) @ carry
    dyad = force.transpose(0, 2, 1) @ arm
    middle = np.trace(dyad, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    middle -= 0.5 * (dyad + dyad.transpose(0, 2, 1))
    # everything has G on one side: T = G^T U + (G^T U)^T
    outer = g.transpose(0, 2, 1) @ (turned - (turned @ s) @ g + 0.5 * (middle @ g))
    return gradient, outer + outer.transpose(0, 2, 1)


def rotate_to_global(frames: SolidFrames, rows: Array) -> Array:
    """Rotate one vector per master from the frames to the global frame (N, 3 m).

    Args:
        frames: Frames of a segment.
        rows: Vectors in the frames (N, 3 m).
    """
    n, m = frames.position.shape[:2]
    turned = np.einsum("sij,saj->sai", frames.turn, rows.reshape(n, m, 3))
    return np.asarray(turned.reshape(n, 3 * m))


def matrices_in_global(frames: SolidFrames, matrix: Array) -> Array:
    """Rotate matrices over masters from the frames to the global frame (N, 3 m, 3 m).

    Args:
        frames: Frames of a segment.
        matrix: Matrices in the frames (N, 3 m, 3 m).
    """
    n, m = frames.position.shape[:2]
    half = frames.turn[:, None] @ matrix.reshape(n, m, 3, 3 * m)
    full = half.reshape(n, 3 * m * m, 3) @ frames.turn.transpose(0, 2, 1)
    return np.asarray(full.reshape(n, 3 * m, 3 * m))
