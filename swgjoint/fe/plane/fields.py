"""Fields of equilibria of the whole drive as plain arrays, for tables and plots.

All positions are in the global frame of :mod:`swgjoint.fe.plane.sector_model`, which
does not turn. A half model is completed by a copy rotated by 180 deg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.ndimage import uniform_filter1d

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import (
    circular_spline_stress,
    flexspline_stress,
    turned_stress,
)
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.typing import Array, Index

Arc = tuple[float, float]
"""First and last angle of a contact arc [rad]."""

ARC_GAP = 1.5
"""Largest distance between neighbouring loaded stations of one contact arc, in tooth
pitches [-]. The teeth stiffen the rim, so that it touches the wave generator only once
per tooth, below the tooth or between two teeth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MemberField:
    """Deformed mesh of a member and the stress at its nodes."""

    points: Array
    """Deformed positions of the nodes of every sector (N, n_nodes, 2) [m]."""
    stress: Array
    """Stress components xx, yy, xy, zz in the global frame (N, n_nodes, 4) [Pa]."""
    quads: Index
    """Corner nodes of the elements of a sector, counter-clockwise (4, n_elements)."""
    outline: Index
    """Nodes along both flanks of a sector, from its clockwise to its counter-clockwise
    root land."""

    @property
    def maxima(self) -> tuple[Array, Array, Array]:
        """Tensile, compressive (magnitude) and von Mises stress (N, n_nodes) [Pa]."""
        return stress_maxima(self.stress)


def flexspline_field(model: SectorModel, state: State) -> MemberField:
    """Deformed flexspline and its stress.

    Args:
        model: The 2D model.
        state: An equilibrium.
    """
    frames = model.frames(state)
    return _field(
        model,
        model.element,
        frames.displacement,
        state.flank_force,
        frames.angle,
        flexspline_stress(model, state),
    )


def circular_spline_field(model: SectorModel, state: State) -> MemberField | None:
    """Deformed circular spline and its stress.

    Args:
        model: The 2D model.
        state: An equilibrium.

    Returns:
        The field; None for a rigid circular spline.
    """
    stress = circular_spline_stress(model, state)
    compliance = model.circular_spline.compliance
    if stress is None or compliance is None:
        return None
    # tooth space 0 faces tooth 0 of the flexspline; tooth 0 is half a pitch from it
    pitch = 2.0 * pi / model.circular_spline.profile.teeth
    return _field(
        model,
        compliance.element,
        compliance.skeleton_displacement(state.circular_spline_force),
        state.circular_spline_force,
        np.asarray(pitch * (np.arange(model.circular_spline_teeth) + 0.5), float)
        + state.circular_spline_rotation,
        stress,
    )


def _field(
    model: SectorModel,
    element: Superelement,
    skeleton: Array,
    flank_force: Array,
    angle: Array,
    stress: Array,
) -> MemberField:
    """Field of a member in the global frame.

    Args:
        model: The 2D model.
        element: Condensed sector of the member.
        skeleton: Skeleton displacements in the sector frames (N, 2 n_a) [m].
        flank_force: Forces on the flank nodes in the sector frames (N, 2 n_b) [N].
        angle: Angles of the sector frames (N,) [rad].
        stress: Nodal stresses in the sector frames (N, n_nodes, 4) [Pa].
    """
    n, mesh = len(angle), element.mesh
    nodes = len(element.displacement_from_skeleton)
    moved = skeleton @ element.displacement_from_skeleton.reshape(2 * nodes, -1).T
    moved += flank_force @ element.displacement_from_flank.reshape(2 * nodes, -1).T
    points = rotate(element.mesh.mesh.p.T + moved.reshape(n, nodes, 2), angle[:, None])
    return MemberField(
        points=np.concatenate([rotate(points, turn) for turn in _turns(model)]),
        stress=np.concatenate(
            [turned_stress(stress, angle[:, None] + turn) for turn in _turns(model)]
        ),
        quads=np.asarray(mesh.mesh.t, dtype=np.int64),
        outline=np.concatenate([mesh.flank_right[::-1], mesh.flank_left]),
    )


def _turns(model: SectorModel) -> Array:
    """Rotations of the copies of the model that form the drive [rad]."""
    return np.asarray(2.0 * pi / model.copies * np.arange(model.copies), float)


def tooth_angles(model: SectorModel, state: State) -> Array:
    """Angles of the flexspline's teeth from the first lobe.

    They refer to the undeformed flexspline after its rotation.

    Args:
        model: The 2D model.
        state: An equilibrium.

    Returns:
        Angles (N,) [rad], counter-clockwise, from -pi to pi.
    """
    teeth = model.element.sectors
    place = np.asarray(2.0 * pi / teeth * np.arange(teeth), float)
    return _wrapped(place + state.rotation - state.wave_generator_angle, 2.0 * pi)


def tooth_forces(model: SectorModel, state: State) -> Array:
    """Normal force on the right and on the left flank of every tooth.

    The right flank is the clockwise one.

    Args:
        model: The 2D model.
        state: An equilibrium.

    Returns:
        Forces on all teeth of the drive, right flank first (N, 2) [N].
    """
    force = np.zeros((model.sectors, 2))
    if state.contacts is not None:
        np.add.at(
            force, (state.contacts.sector, state.contacts.side), state.tooth_force
        )
    return np.tile(force, (model.copies, 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveGeneratorContact:
    """Contact between wave generator and flexspline at the stations of the bore."""

    angle: Array
    """Angles of the stations from the first lobe, increasing from -pi to pi (n,)
    [rad]."""
    force: Array
    """Normal force at each station (n,) [N]."""
    line_load: Array
    """Force per length of the bore (n,) [N/m]. It is a moving average over two tooth
    pitches with triangular weights."""
    arcs: tuple[tuple[Arc, ...], ...]
    """Contact arcs of each lobe as angles from that lobe [rad]. A contact that extends
    from lobe to lobe is split half-way between them."""


def wave_generator_contact(
    model: SectorModel, state: State, lobes: int = 2
) -> WaveGeneratorContact:
    """Contact arcs and forces between wave generator and flexspline.

    Args:
        model: The 2D model.
        state: An equilibrium.
        lobes: Number of lobes of the wave generator.
    """
    points = model.bore_points(state).reshape(-1, 2)
    polar = np.arctan2(-points[:, 0], points[:, 1]) - state.wave_generator_angle
    angle = _wrapped((polar + _turns(model)[:, None]).ravel(), 2.0 * pi)
    force = np.tile(np.where(state.touching, state.pressure, 0.0).ravel(), model.copies)
    order = np.argsort(angle)
    angle, force = angle[order], force[order]

    per_pitch = points.shape[0] // model.sectors
    bore = float(np.hypot(*points.T).mean())
    pitch = 2.0 * pi / model.element.sectors
    mean = force
    for _ in range(2):
        mean = uniform_filter1d(mean, per_pitch, mode="wrap")
    window = 2.0 * pi / lobes
    loaded = angle[force > 0.0]
    from_lobe = _wrapped(loaded, window)
    lobe = np.round((loaded - from_lobe) / window).astype(int) % lobes
    return WaveGeneratorContact(
        angle=angle,
        force=force,
        line_load=mean * per_pitch / (pitch * bore),
        arcs=tuple(
            _arcs(np.sort(from_lobe[lobe == k]), ARC_GAP * pitch) for k in range(lobes)
        ),
    )


def _arcs(angles: Array, gap: float) -> tuple[Arc, ...]:
    """First and last angles of runs of sorted angles that no larger gap interrupts."""
    if not angles.size:
        return ()
    cuts = np.flatnonzero(np.diff(angles) > gap) + 1
    return tuple((float(a[0]), float(a[-1])) for a in np.split(angles, cuts))


@dataclass(frozen=True, kw_only=True, eq=False)
class RootStress:
    """Stress at one node of every tooth root over a turn; arrays are (n_states, N)."""

    lobe_position: Array
    """Angle from the node to the nearest lobe [rad]. It increases as the wave generator
    turns forward."""
    tensile: Array
    """Tensile stress [Pa]."""
    compressive: Array
    """Compressive stress as a magnitude [Pa]."""
    von_mises: Array
    """Von Mises stress [Pa]."""
    tooth: int
    """Index of the tooth that is farthest from its approaching lobe at the first state.
    Half a turn of a two-lobe wave generator moves a lobe past this tooth."""


def root_stress(
    model: SectorModel, states: Sequence[State], lobes: int = 2
) -> RootStress:
    """Stress at the tooth roots over a turn (thesis figures 4.18 to 4.20).

    The node is the one with the largest von Mises stress over all states and teeth. It
    is sought on both sides of the tooth below the middle of the dedendum.

    Args:
        model: The 2D model.
        states: Equilibria over a turn, at least one.
        lobes: Number of lobes of the wave generator.
    """
    mesh, profile = model.element.mesh, model.element.profile
    radius = np.hypot(*mesh.mesh.p[:, mesh.flank_right])
    low = radius < 0.5 * (profile.pitch_radius + profile.dedendum_radius)
    nodes = np.concatenate([mesh.flank_right[low], mesh.flank_left[low]])
    stress = np.array([flexspline_stress(model, state)[:, nodes] for state in states])
    maxima = stress_maxima(stress)  # three arrays (n_states, sectors, n_nodes)
    worst = int(np.argmax(maxima[2].max(axis=(0, 1))))
    tensile, compressive, mises = (
        np.tile(values[..., worst], (1, model.copies)) for values in maxima
    )
    x, y = mesh.mesh.p[:, nodes[worst]]
    from_lobe = np.array([tooth_angles(model, state) for state in states])
    position = _wrapped(-from_lobe - np.arctan2(-x, y), 2.0 * pi / lobes)
    turn = states[-1].wave_generator_angle - states[0].wave_generator_angle
    return RootStress(
        lobe_position=position,
        tensile=tensile,
        compressive=compressive,
        von_mises=mises,
        tooth=int(np.argmin(position[0] if turn >= 0.0 else -position[0])),
    )


def _wrapped(angle: Array, period: float) -> Array:
    """Angles wrapped into the range from -period/2 to period/2."""
    return np.asarray((angle + 0.5 * period) % period - 0.5 * period)
