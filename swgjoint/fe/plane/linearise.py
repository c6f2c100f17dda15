"""Gradient and tangent of the ring of sectors at one state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.bore_contact import BoreStations
from swgjoint.fe.plane.compiled_tangent import (
    CompiledBore,
    add_blocks,
    add_sector_tangents,
)
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.contact_tangent import add_contact_tangents
from swgjoint.fe.plane.corotation import (
    Frames,
    elastic_force,
    project_to_frames,
    rotate,
    rotate_right_angle,
    tangent,
)
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

FAR = 0.03
"""Gap above which all stations of a bore interval share the values of its middle, in
lobe heights [-]. Within an interval the gaps differ from the middle one by at most
0.006 lobe heights for parabolas and 0.011 for arcs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """The ring linearised at one state, with n degrees of freedom per sector.

    :attr:`SectorModel.sector_dofs` defines n. Vectors are in the global frame. At the
    end of a half ring their sign is reversed, so that the shared unknowns agree with
    those of the first sector.
    """

    element: Superelement
    """Condensed sector of the flexspline."""
    frames: Frames
    """Kinematics of the sectors."""
    dofs: Index
    """Degrees of freedom of the skeleton within a sector (2 n_a,)."""
    face_dofs: int
    """Number of degrees of freedom that neighbouring sectors share."""
    sign: Array
    """-1 at the end of a half ring, 1 elsewhere (N, n)."""
    gradient: Array
    """Gradient of energy and load potential (N, n) [N]."""
    hessian: Array
    """Tangent: second derivative of energy and load potential with the anchor spring
    (N, n, n) [N/m]. Rows and columns of fixed degrees of freedom are zero except for
    their diagonal."""
    gap: Array
    """Gap at the stations of the bore (N, q) [m]."""
    gap_dofs: Index
    """Degrees of freedom of a sector that change the gaps of its stations (k,)."""
    stations: BoreStations
    """Stations of the bore."""
    normal: Array
    """Outward normal of wave generator or race at the stations (N, q, 2)."""
    race_rows: Array | None
    """Derivatives of the gaps with respect to ``gap_dofs`` (N, q, k) [-]; None without
    a race."""
    fixed: Mask
    """Whether each degree of freedom is fixed, which occurs on a race only (N, n)."""
    rotation: float
    """Best-fit rotation of the bore [rad]."""
    rotation_gradient: Array
    """Gradient of that rotation (N, n) [rad/m]."""
    anchor: Array
    """Direction of the anchor spring, tangential at the first node of sector 0 (N, n).
    """
    anchor_stiffness: float
    """Stiffness of the anchor spring [N/m]."""
    flank: Array
    """Displacements of the flank nodes in the sector frames, including manufacturing
    errors (N, 2 n_b) [m]."""
    circular_spline_elastic: Array
    """Elastic displacements of the circular spline's flanks (N_c, 2 n_c) [m]."""
    search: ToothContact
    """Search for tooth contacts at the state."""

    @property
    def no_contacts(self) -> Contacts:
        """An empty set of candidates."""
        circular_spline = self.search.circular_spline
        return Contacts.none(self.flank.shape[1], circular_spline.flank_dofs)

    def gap_gradient(self, contacts: Contacts) -> Array:
        """Derivatives of tooth gaps with respect to their sectors' degrees of freedom.

        Shape (n_contacts, n) [-].
        """
        s, frames = contacts.sector, self.frames
        count, n = len(s), frames.spin.shape[1]
        carried = contacts.weight @ self.element.flank_from_skeleton
        j_y = rotate_right_angle(frames.position[s].reshape(count, n // 2, 2)).reshape(
            count, n
        )
        arm = np.einsum("ki,ki->k", contacts.normal, rotate_right_angle(contacts.point))
        lever = arm - np.einsum("kn,kn->k", carried, j_y)
        seen = (carried + frames.spin[s] * lever[:, None]).reshape(count, n // 2, 2)
        rows = np.zeros((count, self.gradient.shape[1]))
        rows[:, self.dofs] = rotate(seen, frames.angle[s][:, None]).reshape(count, n)
        return np.asarray(rows * self.sign[s])

    def rotate_to_global(self, increment: Array) -> Array:
        """Shifts of the skeleton nodes (N, n_a, 2) [m] by an increment (N, n) [m]."""
        skeleton = (increment * self.sign)[:, self.dofs]
        return np.asarray(skeleton.reshape(len(skeleton), -1, 2))

    def gap_after(self, increment: Array) -> Array:
        """Gaps of the stations (N, q) [m] after an increment (N, n) [m]."""
        seen = increment * self.sign
        moved = seen[:, self.gap_dofs]
        if self.race_rows is not None:
            return np.asarray(self.gap + (self.race_rows @ moved[..., None])[..., 0])
        if (bore := CompiledBore.for_stations(self.stations)) is not None:
            return bore.gaps_after(self.gap, self.normal, self.gap_dofs, seen)
        shift = self.stations.positions(moved.reshape(len(moved), -1, 2))
        return np.asarray(self.gap + np.einsum("sqi,sqi->sq", shift, self.normal))

    def exchange(self, stations: Mask, touching: Mask) -> Index:
        """Invert the contact state of some stations, in place.

        The curvature of wave generator or race is neglected, because the gap of a
        station that opens or closes is almost zero.

        Args:
            stations: Whether to switch each station (N, q).
            touching: Whether each station is in contact before the change (N, q).

        Returns:
            Sectors whose forces and tangents changed (k,).
        """
        sectors, into = np.flatnonzero(stations.any(axis=1)), self.gap_dofs
        sector, station = np.nonzero(stations)
        change = np.where(touching[sector, station], -1.0, 1.0)
        spring = np.zeros(stations.shape)
        spring[sector, station] = change * self.stations.stiffness[station]
        compiled = CompiledBore.for_stations(self.stations)
        if self.race_rows is None and compiled is not None:
            at = spring, self.gap, self.normal, into, self.gradient, self.hessian
            compiled.add_forces(*at, sign=self.sign)
            return sectors
        k, normal = spring[sectors], self.normal[sectors]
        push = k * self.gap[sectors]
        if self.race_rows is None:
            forces = self.stations.forces_of(push[..., None] * normal)
            springs = self.stations.stiffness_of(normal, k)
        else:
            rows = self.race_rows[sectors]
            forces = np.einsum("sq,sqm->sm", push, rows)
            springs = np.swapaxes(rows, 1, 2) @ (k[..., None] * rows)
        sign = self.sign[sectors][:, into]
        forces = forces.reshape(sectors.size, -1)
        self.gradient[sectors[:, None], into] += sign * forces
        self.hessian[sectors[:, None, None], into[:, None], into] += (
            sign[:, :, None] * springs * sign[:, None, :]
        )
        _hold(self.hessian, sectors, self.fixed[sectors], self.anchor_stiffness)
        return sectors

    def mean_gap_gradient(self, sector: Index, weight: Array) -> Array:
        """Derivatives of weighted means of station gaps (k, n) [-].

        Args:
            sector: Sector of each mean (k,).
            weight: Weights of the stations of that sector (k, q).
        """
        into = self.gap_dofs
        if self.race_rows is None:
            # the nodal forces equivalent to the weights as forces along the normals
            forces = weight[..., None] * self.normal[sector]
            means = self.stations.forces_of(forces).reshape(len(sector), into.size)
        else:
            means = np.einsum("kq,kqm->km", weight, self.race_rows[sector])
        rows = np.zeros((len(sector), self.gradient.shape[1]))
        rows[:, into] = means * self.sign[sector[:, None], into]
        return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bore:
    """Gaps of the bore at its stations, see :class:`Linearised`."""

    gap: Array
    normal: Array
    fixed: Mask | bool = False
    rows: Array | None = None


def linearise(
    model: SectorModel,
    state: State,
    torque: float | None,
    *,
    kept: Linearised | None = None,
) -> Linearised:
    """Linearise the ring at a state.

    Args:
        model: The 2D model.
        state: Positions, contact state of the bore, and tooth forces.
        torque: Torque of the flexspline on its load, whole drive [N·m]; None if the
            rotation of the flexspline is prescribed.
        kept: The ring linearised at a near state with the same contact of the bore,
            whose tangent is kept; None computes the tangent of the state.
    """
    sign, dofs, x = model.signs, model.dofs, model.skeleton(state)
    gradient = np.zeros(sign.shape)
    hessian = np.empty((*sign.shape, sign.shape[1])) if kept is None else None
    frames, flank = _add_sectors(model, state, x, gradient, hessian)
    bore = _add_bore(model, state, x, gradient, hessian)
    fixed = np.zeros(sign.shape, dtype=bool)
    fixed[:, model.contact_dofs] = bore.fixed

    rotation, slope = model.best_fit_rotation(x[:, model.bore_nodes])
    rotation_gradient = np.zeros(sign.shape)
    into = dofs.reshape(-1, 2)[model.bore_nodes].ravel()
    rotation_gradient[:, into] = slope.reshape(model.sectors, -1)
    if torque is not None:
        gradient += torque / model.copies * rotation_gradient

    anchor = np.zeros(sign.shape)
    anchor[0, dofs[:2]] = rotate_right_angle(x[0, 0]) / np.hypot(*x[0, 0])
    stiffness = model.element.mean_stiffness
    flank = model.shift_flank(flank, model.tooth_shift)
    elastic = model.circular_spline_displacement(state)
    facing = model.shift_flank(elastic, model.circular_spline_tooth_shift)
    centre = frames.position.reshape(model.sectors, -1, 2).mean(axis=1)
    angle = frames.angle - state.circular_spline_rotation
    search = ToothContact(
        rubs=model.friction is not None,
        element=model.element,
        circular_spline=model.circular_spline,
        circular_spline_flank=facing,
        angle=angle,
        bearing=angle - np.arctan2(centre[:, 0], centre[:, 1]),
    )
    if hessian is None:
        assert kept is not None
        hessian = kept.hessian
    else:
        # the contact points slide, and the forces follow their normals
        if model.nonlinear and state.contacts is not None and len(state.contacts):
            at = model.element, search, frames, flank, state.contacts
            add_contact_tangents(*at, state.tooth_force, dofs, hessian)
        # signs other than 1 occur in the last sector only
        hessian[-1] *= np.outer(sign[-1], sign[-1])
        hessian[0] += stiffness * np.outer(anchor[0], anchor[0])
        _hold(hessian, np.arange(len(hessian)), fixed, stiffness)
    return Linearised(
        element=model.element,
        frames=frames,
        dofs=dofs,
        face_dofs=model.face_dofs,
        sign=sign,
        gradient=sign * gradient,
        hessian=hessian,
        gap=bore.gap,
        gap_dofs=model.contact_dofs,
        stations=model.stations,
        normal=bore.normal,
        race_rows=bore.rows,
        fixed=fixed,
        rotation=rotation,
        rotation_gradient=sign * rotation_gradient,
        anchor=anchor,
        anchor_stiffness=stiffness,
        flank=flank,
        circular_spline_elastic=elastic,
        search=search,
    )


def _hold(hessian: Array, sectors: Index, fixed: Mask, stiffness: float) -> None:
    """Uncouple the fixed degrees of freedom (k, n) of k sectors, in place."""
    k, dof = np.nonzero(fixed)
    hessian[sectors[k], dof] = hessian[sectors[k], :, dof] = 0.0
    hessian[sectors[k], dof, dof] = stiffness


def _add_sectors(
    model: SectorModel, state: State, x: Array, gradient: Array, hessian: Array | None
) -> tuple[Frames, Array]:
    """Add the elastic forces and tangents of the sectors.

    Tooth forces enter only the tangent, because they are unknowns of the step; here
    they turn with the frames of their sectors.

    Args:
        model: The 2D model.
        state: State at which to linearise.
        x: Skeleton nodes (N, n_a, 2) [m].
        gradient: Gradient to add to (N, n) [N].
        hessian: Tangent to fill (N, n, n) [N/m]; None adds the forces only.

    Returns:
        Frames of the sectors, and flank displacements in these frames (N, 2 n_b) [m].
    """
    element, force, dofs = model.element, state.flank_force, model.dofs
    if model.nonlinear and kernels() is not None:
        return add_sector_tangents(
            element, model.place, x, force, dofs, gradient, hessian
        )
    frames = model.frames(state)
    elastic = elastic_force(element, frames)
    seen = project_to_frames(frames, elastic).reshape(x.shape)
    gradient[:, dofs] = rotate(seen, frames.angle[:, None]).reshape(len(x), -1)
    if hessian is not None:
        total = elastic - force @ element.flank_from_skeleton
        hessian.fill(0.0)
        hessian[:, dofs[:, None], dofs] = tangent(element, frames, total, frames.angle)
    flank = frames.displacement @ element.flank_from_skeleton.T
    return frames, flank + force @ element.flank_compliance


def _add_bore(
    model: SectorModel, state: State, x: Array, gradient: Array, hessian: Array | None
) -> _Bore:
    """Add the forces and tangents of the contact of the bore, see `_add_sectors`."""
    into = model.contact_dofs
    if model.race is not None and state.race is not None:
        race = model.race.forces(
            state.race,
            state.wave_generator_angle,
            x[:, model.bore_nodes],
            state.touching,
        )
        gradient[:, into] += race.gradient
        if hessian is not None:
            add_blocks(race.hessian, into, hessian)
        return _Bore(gap=race.gap, normal=race.normal, rows=race.rows, fixed=race.fixed)
    # a rigid wave generator supports the bore through the compliant layer
    stations, touching = model.stations, state.touching
    gap, normal, curvature = _gaps(model, state)
    if (bore := CompiledBore.for_stations(stations)) is not None:
        spring = np.where(touching, stations.stiffness, 0.0)
        at = spring, gap, normal, into, gradient, hessian
        bore.add_forces(*at, curvature=curvature)
        return _Bore(gap=gap, normal=normal)
    # only sectors in contact exert a force
    on = np.flatnonzero(touching.any(axis=1))
    k = np.where(touching[on], stations.stiffness, 0.0)
    push = (k * gap[on])[..., None] * normal[on]
    gradient[on[:, None], into] += stations.forces_of(push).reshape(on.size, -1)
    if hessian is not None:
        # sliding over a curved outline turns the contact force
        bend = k * gap[on] * curvature[on]
        springs = stations.stiffness_of(normal[on], k)
        springs += stations.stiffness_of(rotate_right_angle(normal[on]), bend)
        hessian[on[:, None, None], into[:, None], into] += springs
    return _Bore(gap=gap, normal=normal)


def _gaps(model: SectorModel, state: State) -> tuple[Array, Array, Array]:
    """Gap, normal and curvature at the stations, see ``wave_generator_gap``.

    If no station of an interval is in contact and the gap in its middle exceeds
    :data:`FAR`, all its stations get the values of the middle: none is near contact.
    """
    stations, alpha = model.stations, state.wave_generator_angle
    nodes = model.station_nodes(model.skeleton(state))
    far = FAR * model.lobe_height
    bore, outline = CompiledBore.for_stations(stations), model.wave_generator.rows
    if bore is not None and outline is not None:
        centre = model.wave_generator_offset
        return bore.gaps(nodes, state.touching, outline, alpha, centre, far)
    points = stations.positions(nodes)
    p = stations.per_interval
    shaped = points.reshape(model.sectors, -1, p, 2)
    middle = model.wave_generator_gap(shaped[:, :, p // 2], alpha)
    near = middle[0] < far
    near |= state.touching.reshape(shaped.shape[:3]).any(axis=2)
    if near.all():
        return model.wave_generator_gap(points, alpha)
    gaps = []
    exact = model.wave_generator_gap(shaped[near], alpha)
    for coarse, fine in zip(middle, exact, strict=True):
        values = np.repeat(coarse[:, :, None], p, axis=2)
        values[near] = fine
        gaps.append(values.reshape(*points.shape[:2], *coarse.shape[2:]))
    return gaps[0], gaps[1], gaps[2]
