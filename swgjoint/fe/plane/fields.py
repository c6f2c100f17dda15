"""Fields of equilibria as plain arrays, for tables and pictures; always whole drives.

Everything in the frame of the circular spline's outside, which does not turn. A half
model is completed by its own rotation of 180 deg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.ndimage import uniform_filter1d

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.ring import RingModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import (
    circular_spline_stress,
    flexspline_stress,
    turned_stress,
)
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.typing import Array, Index

Arc = tuple[float, float]

ARC_GAP = 1.5
"""Tooth pitches between nodes that belong to one contact arc: a rim touches its wave
generator once per tooth, in the middle below it or beside it, as the teeth stiffen it.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class MemberField:
    """Deformed mesh of a member and the stress at its nodes."""

    points: Array
    """Deformed positions of the nodes of every sector (N, n_nodes, 2) [m]."""
    stress: Array
    """xx, yy, xy in the global frame (N, n_nodes, 3) [Pa]."""
    quads: Index
    """Corners of the elements of a sector, counter-clockwise (4, n_elements)."""
    outline: Index
    """Nodes along the tooth of a sector, clockwise root to counter-clockwise root."""

    @property
    def maxima(self) -> tuple[Array, Array, Array]:
        """Tensile, compressive (as a magnitude) and von Mises (N, n_nodes) [Pa]."""
        return stress_maxima(self.stress)


def flexspline_field(model: RingModel, state: State) -> MemberField:
    """Deformed flexspline and its stress."""
    frames = model.frames(state)
    return _field(
        model,
        model.element,
        frames.displacement,
        state.flank_force,
        frames.angle,
        flexspline_stress(model, state),
    )


def circular_spline_field(model: RingModel, state: State) -> MemberField | None:
    """Deformed circular spline and its stress; None while it is rigid."""
    stress = circular_spline_stress(model, state)
    compliance = model.circular_spline.compliance
    if stress is None or compliance is None:
        return None
    # space 0 faces tooth 0 of the flexspline; tooth 0 stands half a pitch beside it
    pitch = 2.0 * pi / model.circular_spline.profile.teeth
    return _field(
        model,
        compliance.element,
        compliance.skeleton_displacement(state.ring_force),
        state.ring_force,
        np.asarray(pitch * (np.arange(model.ring_teeth) + 0.5), float)
        + state.ring_rotation,
        stress,
    )


def _field(
    model: RingModel,
    element: Superelement,
    skeleton: Array,
    flank_force: Array,
    angle: Array,
    stress: Array,
) -> MemberField:
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


def _turns(model: RingModel) -> Array:
    """Rotations that complete the drive from the model [rad]."""
    return np.asarray(2.0 * pi / model.copies * np.arange(model.copies), float)


def tooth_angles(model: RingModel, state: State) -> Array:
    """Where the flexspline's teeth stand, from the first lobe (N,) [rad].

    Of the undeformed, turned flexspline; counter-clockwise, from -pi to pi.
    """
    teeth = model.element.sectors
    place = np.asarray(2.0 * pi / teeth * np.arange(teeth), float)
    return _wrapped(place + state.rotation - state.wave_generator_angle, 2.0 * pi)


def tooth_forces(model: RingModel, state: State) -> Array:
    """Normal force on the right and on the left flank of every tooth (N, 2) [N].

    The right flank is the clockwise one; seen from the axis, teeth point outwards.
    """
    force = np.zeros((model.sectors, 2))
    if state.contacts is not None:
        np.add.at(
            force, (state.contacts.sector, state.contacts.side), state.tooth_force
        )
    return np.tile(force, (model.copies, 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveGeneratorContact:
    """Where the wave generator carries the flexspline."""

    angle: Array
    """Of the stations of the bore, from the first lobe, increasing, -pi to pi (n,)
    [rad]."""
    force: Array
    """Normal force at each of them (n,) [N]."""
    line_load: Array
    """Force per length of the bore, averaged over two tooth pitches with triangular
    weights (n,) [N/m]."""
    arcs: tuple[tuple[Arc, ...], ...]
    """Per lobe, contact arcs as angles from that lobe [rad]. A contact that reaches
    from lobe to lobe ends half-way between them."""


def wave_generator_contact(
    model: RingModel, state: State, lobes: int = 2
) -> WaveGeneratorContact:
    """Contact arcs and forces between wave generator and flexspline.

    Args:
        model: The ring.
        state: An equilibrium.
        lobes: Lobes of the wave generator.
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
    """Runs of sorted angles whose neighbours are closer than a gap."""
    if not angles.size:
        return ()
    cuts = np.flatnonzero(np.diff(angles) > gap) + 1
    return tuple((float(a[0]), float(a[-1])) for a in np.split(angles, cuts))


@dataclass(frozen=True, kw_only=True, eq=False)
class RootStress:
    """Stress at one node of every tooth root, over a turn (n_states, N)."""

    lobe_position: Array
    """Angle of the nearest lobe from the node; grows as the input turns forward [rad].
    """
    tensile: Array
    """[Pa]."""
    compressive: Array
    """As a magnitude [Pa]."""
    von_mises: Array
    """[Pa]."""
    tooth: int
    """The tooth that stands farthest behind a lobe at the first state, so that in half
    a turn of two lobes one of them passes below it."""


def root_stress(
    model: RingModel, states: Sequence[State], lobes: int = 2
) -> RootStress:
    """Stress at the tooth roots over a turn (thesis figures 4.18 to 4.20).

    The node is the one with the largest von Mises stress over all states and teeth, on
    the lower half of the dedendum at either side of a tooth.

    Args:
        model: The ring.
        states: Equilibria over a turn, at least one.
        lobes: Lobes of the wave generator.
    """
    mesh, profile = model.element.mesh, model.element.profile
    radius = np.hypot(*mesh.mesh.p[:, mesh.flank_right])
    low = radius < 0.5 * (profile.pitch_radius + profile.dedendum_radius)
    nodes = np.concatenate([mesh.flank_right[low], mesh.flank_left[low]])
    stress = np.array([flexspline_stress(model, state)[:, nodes] for state in states])
    found = stress_maxima(stress)  # three times (n_states, sectors, n_nodes)
    worst = int(np.argmax(found[2].max(axis=(0, 1))))
    tensile, compressive, mises = (
        np.tile(values[..., worst], (1, model.copies)) for values in found
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
    """Into -period/2 to period/2."""
    return np.asarray((angle + 0.5 * period) % period - 0.5 * period)
