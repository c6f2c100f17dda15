r"""Strain of the wall in the linear 3D model, by order around the flexspline.

A load that varies as :math:`e^{i n\varphi}` around the flexspline deforms every sector
as the first one, times :math:`e^{i n\varphi_s}` at its angle phi_s. One sector whose
faces obey this condition therefore represents the whole flexspline:

.. math:: u_\text{last} = e^{2\pi i n/N} R\, u_\text{first}

with the rotation R by one pitch. The loads act on the bore: radial forces deflect the
flexspline, tangential ones twist it. They act in the middle of the face width of a cup,
and over the whole width of a ring without a cup, which is read on its rim.
"""

from __future__ import annotations

from math import pi

import numpy as np

from swgjoint.fe.solid.across import spread_forces
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.figures.deflected_wall import FIRST, cylindrical_strain
from swgjoint.fe.solid.strip.segment import StripSegment
from swgjoint.fe.solid.strip.strip import Strip
from swgjoint.gear.design.material import Material
from swgjoint.gear.gauges import WallStrain
from swgjoint.typing import Array, Complex, Index


def finite_element_strain(
    strip: Strip,
    material: Material,
    place: float,
    *,
    orders: Array,
    deflection: Complex,
) -> WallStrain:
    """Strain at the outside of the wall, as :meth:`.FlexsplineWall.strain` states it.

    The torque turns the rim against the bore of the diaphragm. The deflection is that
    of the bore of the rim in the middle of the face width.

    Args:
        strip: One condensed sector of a flexspline with a cup.
        material: Material of the flexspline.
        place: Distance of the section from the outside of the closed end [m].
        orders: Orders n around the flexspline (m,).
        deflection: Complex amplitudes w_n (m,) [m].
    """
    response = HarmonicResponse(strip, material)
    torsion = response.twist(place)[2].real
    columns = np.array([response.deflect(int(n), place) for n in orders])
    hoop, axial, shear = columns.T * deflection
    return WallStrain(
        torsion=float(torsion), orders=orders, hoop=hoop, axial=axial, shear=shear
    )


class HarmonicResponse:
    """Response of a flexspline to loads of one order around it."""

    def __init__(self, strip: Strip, material: Material) -> None:
        """Assemble the stiffness of one sector.

        Args:
            strip: One condensed sector of a flexspline.
            material: Material of the flexspline.
        """
        self.strip, self.material = strip, material
        size = 3 * strip.masters.size
        self.stiffness = np.zeros((size, size))
        for segment in strip.segments:
            rows = _dofs(segment.masters)
            self.stiffness[np.ix_(rows, rows)] += segment.stiffness
        # loaded bore nodes, with their directions and shares of the load
        z = strip.bore[:, 2]
        share = np.where(np.abs(z) < np.abs(z).min() + FIRST, 1.0, 0.0)
        if len(strip.segments) == 1:
            planes = strip.mesh.teeth.z
            even = np.gradient(planes)
            even[[0, -1]] *= 0.5
            force = np.linalg.solve(spread_forces(planes, 1).toarray(), even)
            share = np.repeat(force, len(z) // len(planes))
        self.share = share / share.sum()
        x, y = strip.bore[:, 0], strip.bore[:, 1]
        self.angle = np.arctan2(-x, y)
        away = np.stack([x, y, 0.0 * x], axis=-1)
        self.radius = float(np.hypot(x, y).max())
        self.out = away / self.radius

    def twist(self, place: float, order: int = 0) -> Complex:
        """Complex amplitudes of the three strains per torque (3,) [1/(N·m)].

        The tangential forces of an order n vary as cos n phi around the flexspline, as
        tooth forces do that follow the lobes, with the amplitude of the forces of the
        torque. The wave generator holds the radial deflection of this order.

        Args:
            place: Distance of the section from the outside of the closed end [m].
            order: Order n around the flexspline; 0 for a torque.
        """
        out, side = self._forces(order)
        around, moved_by_side = self._solve(order, side)
        away, moved_by_out = self._solve(order, out)
        hold = self._deflection(order, moved_by_side)
        hold /= self._deflection(order, moved_by_out)
        strain = self._strain(around - hold * away, order, place, side - hold * out)
        return np.asarray(strain / (self.strip.sectors * self.radius))

    def deflect(self, order: int, place: float) -> Complex:
        """Complex amplitudes of the three strains per deflection (3,) [1/m].

        Args:
            order: Order n around the flexspline.
            place: Distance of the section from the outside of the closed end [m].
        """
        out, _ = self._forces(order)
        away, bore = self._solve(order, out)
        strain = self._strain(away, order, place, out)
        return np.asarray(strain / self._deflection(order, bore))

    def _forces(self, order: int) -> tuple[Complex, Complex]:
        """Radial and tangential forces on the bore of a sector that sum to one."""
        phase = self.share * np.exp(1j * order * self.angle)
        out = phase[:, None] * self.out
        side = np.stack([-out[:, 1], out[:, 0], out[:, 2]], axis=-1)
        return out.ravel(), side.ravel()

    def _deflection(self, order: int, bore: Complex) -> complex:
        """Radial deflection of the loaded bore, referred to the angle zero."""
        radial = np.sum(bore.reshape(-1, 3) * self.out, axis=1)
        return complex(radial @ (self.share * np.exp(-1j * order * self.angle)))

    def _solve(self, order: int, force: Complex) -> tuple[Complex, Complex]:
        """Displacements of masters and bore nodes under forces on the bore [m]."""
        strip, teeth = self.strip, self.strip.teeth
        face = 3 * strip.masters.face_size
        size = len(self.stiffness)
        pitch = 2.0 * pi / strip.sectors
        turn = np.kron(np.eye(face // 3), about_z(np.array(pitch)))
        follow = np.zeros((size, size - face), complex)
        follow[: size - face] = np.eye(size - face)
        follow[size - face :, :face] = np.exp(1j * order * pitch) * turn
        flank = strip.flank_dofs
        push = np.zeros(size, complex)
        push[_dofs(teeth.masters)] = force @ teeth.loaded_from_masters[flank:]
        free = np.arange(size - face)
        if len(strip.segments) > 1:  # a ring without a cup is free
            free = np.setdiff1d(free, _dofs(strip.masters.held))
        basis = follow[:, free]
        matrix = basis.conj().T @ self.stiffness @ basis
        u = basis @ np.linalg.solve(matrix, basis.conj().T @ push)
        bore = teeth.loaded_from_masters[flank:] @ u[_dofs(teeth.masters)]
        return u, bore + teeth.compliance[flank:, flank:] @ force

    def _strain(self, u: Complex, order: int, place: float, force: Complex) -> Complex:
        """Hoop, axial and shear strain at the outside, referred to the angle zero."""
        segments = self.strip.segments
        closed = max(float(s.mesh.mesh.p[2].max()) for s in segments)
        depths, values = [], []
        for segment in segments[1:] or segments:
            moved = segment.nodal @ u[_dofs(segment.masters)]
            if segment.loaded.size:
                flank = self.strip.flank_dofs
                moved = moved + segment.nodal_from_force[:, flank:] @ force
            for z, strain in _outside_strains(segment, moved, order, self.material):
                depths.append(closed - z)
                values.append(strain)
        # sections between segments have two values, of which the mean is taken
        x, which = np.unique(np.round(depths, 9), return_inverse=True)
        mean = np.zeros((len(x), 3), complex)
        np.add.at(mean, which, np.array(values))
        mean /= np.bincount(which)[:, None]
        return np.array([np.interp(place, x, part) for part in mean.T])


def _dofs(masters: Index) -> Index:
    return np.asarray((3 * masters[:, None] + np.arange(3)).ravel())


def _outside_strains(
    segment: StripSegment, moved: Complex, order: int, material: Material
) -> list[tuple[float, Complex]]:
    """Coordinate z and strains of all rows of nodes at the outside of a cylinder.

    Segments other than cylinders have none.
    """
    points = np.asarray(segment.mesh.mesh.p).T
    radius = np.hypot(points[:, 0], points[:, 1])
    outside = radius > radius.max() - FIRST
    stress = segment.stress @ moved
    stress = stress.reshape(-1, 6)[outside]
    points = points[outside]
    phi = np.arctan2(-points[:, 0], points[:, 1])
    strain = cylindrical_strain(stress, phi, material)
    strain = strain * np.exp(-1j * order * phi)[:, None]
    rows = np.unique(np.round(points[:, 2], 9))
    if len(rows) < 2:
        return []  # the fillet meets the cylinder at one section
    return [
        (float(z), strain[np.abs(points[:, 2] - z) < FIRST].mean(axis=0)) for z in rows
    ]
