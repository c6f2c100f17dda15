"""Indentation of the flanks: a closed form against meshes that resolve the strip."""

from __future__ import annotations

from dataclasses import replace
from math import log, pi

import numpy as np
import pytest
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP2,
    ElementVector,
    FacetBasis,
    LinearForm,
)
from skfem.helpers import ddot, sym_grad, trace
from solved import coarse

from swgjoint.fe.common.contact_patch import half_length
from swgjoint.fe.common.indentation import (
    CENTRE_OVER_PATCH,
    Indentation,
    Strips,
    relative_radius,
    softness_of,
    strain_energy,
)
from swgjoint.fe.common.sampling import follower_in_plane
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.drive2d import sector, sector_model
from swgjoint.fe.plane.sector_mesh import sector_mesh
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.units import mm

LAW = Indentation(softness=6e-10, patch=1.4e-4, radius=1.2e-3)
FORCE = np.geomspace(1e-3, 3e3, 25)


def test_slope_and_energy_belong_to_the_approach():
    """dh/dF and F dh/dF are the derivatives of approach and energy."""
    step = 1e-4 * FORCE
    ends = FORCE + step, FORCE - step
    slope = np.subtract(*(LAW.approach(f) for f in ends)) / (2.0 * step)
    work = np.subtract(*(LAW.energy(f) for f in ends)) / (2.0 * step)
    assert slope == pytest.approx(LAW.slope(FORCE), rel=1e-7)
    assert work == pytest.approx(FORCE * LAW.slope(FORCE), rel=1e-7)
    assert LAW.energy(np.zeros(1)) == LAW.approach(np.zeros(1)) == 0.0


def test_approach_follows_the_half_width_of_hertz():
    """Where the strip is narrow h is k F (ln a/b + c) with b^2 = 2 k F R."""
    force = np.array([10.0, 40.0])
    b = np.sqrt(2.0 * LAW.softness * force * LAW.radius)
    wanted = LAW.softness * force * (np.log(LAW.patch / b) + CENTRE_OVER_PATCH)
    # the width without force takes 2 % at the first one
    assert LAW.approach(force) == pytest.approx(wanted, rel=0.025)


def test_flanks_that_conform_do_not_indent():
    """An infinite radius of relative curvature leaves the patch alone."""
    flat = replace(LAW, radius=np.inf)
    for values in (flat.approach(FORCE), flat.slope(FORCE), flat.energy(FORCE)):
        assert not values.any()


def test_average_over_the_weights_of_a_patch():
    """The logarithm over (1 - x^2)^3 twice is ln 2 - 1727/840."""
    x, w = np.polynomial.legendre.leggauss(60)
    weight = w * (1.0 - x**2) ** 3
    weight /= weight.sum()
    # int (1 - t^2)^3 ln|x - t| dt, its singularity taken out in closed form
    smooth = (1.0 - x**2) ** 3 * 35.0 / 32.0
    apart = np.abs(x[:, None] - x) + np.eye(x.size)
    rest = (np.log(apart) * (smooth - smooth[:, None])) @ w
    line = (1 - x) * np.log(1 - x) + (1 + x) * np.log(1 + x) - 2.0
    assert weight @ (rest + smooth * line) == pytest.approx(
        log(2.0) - 1727.0 / 840.0, abs=1e-4
    )


def contacts(places: list[tuple[int, int, int]]) -> Contacts:
    """Points on the flanks (sector, side, tooth), all else zero."""
    none = Contacts.none(4, 4)
    sector, side, tooth = np.array(places).T
    n = len(places)
    blank = {
        key: np.zeros((n, *getattr(none, key).shape[1:]))
        for key in none.__dataclass_fields__
    }
    return Contacts(**{**blank, "sector": sector, "side": side, "tooth": tooth})


def test_points_of_a_pair_of_flanks_are_one_strip():
    """Where a force is divided between two points of a pair nothing changes."""
    one, two = contacts([(3, 0, 4)]), contacts([(3, 0, 4), (3, 0, 4)])
    other = contacts([(3, 0, 4), (3, 1, 5)])
    whole = strain_energy(LAW, one, np.array([100.0]))
    assert strain_energy(LAW, two, np.array([30.0, 70.0])) == pytest.approx(whole)
    assert strain_energy(LAW, other, np.array([30.0, 70.0])) < 0.8 * whole
    strips = Strips.from_contacts(LAW, two, one, np.array([100.0]))
    there = strips.compliance @ np.array([30.0, 70.0]) + strips.offset
    assert there == pytest.approx(LAW.approach(np.full(2, 100.0)))
    assert strips.error(np.array([30.0, 70.0])) < 1e-18
    assert strips.error(np.array([40.0, 70.0])) > 1e-12


def test_energy_beyond_the_lines_is_the_work_of_the_approach_beyond_them():
    """By differences over the force; nothing at the forces of the lines or below zero.

    A strip without force keeps the energy that it has there, beside loaded ones.
    """
    strips = Strips(law=LAW, strip=np.arange(3), force=np.array([0.0, 40.0, 10.0]))
    assert strips.excess_energy(strips.force) == pytest.approx(0.0, abs=1e-18)
    rng = np.random.default_rng(8)
    force, step = rng.uniform(5.0, 80.0, size=(20, 3)), 1e-3
    force[::4, 1] = 0.0
    for j in range(3):
        move = step * (np.arange(3) == j)
        ends = [strips.excess_energy(force + part * move) for part in (1.0, -1.0)]
        slope = force[:, j] * strips.excess(force)[1][:, j]
        loaded = force[:, j] > 0.0
        change = (ends[0] - ends[1])[loaded] / (2.0 * step)
        assert change == pytest.approx(slope[loaded], rel=1e-5, abs=1e-12)
    below = np.where(force > 0.0, force, -3.0)
    assert np.array_equal(strips.excess_energy(below), strips.excess_energy(force))


def test_curvature_of_a_drive():
    """Arcs of one module against the straight flank and the arcs beside it."""
    flanks = [
        tooth_profile(Design.load("reference-2d"), member)
        for member in ("flexspline", "circular_spline")
    ]
    # relative curvatures near the pitch point are 2, 1 and 0.5 per module
    assert 0.5 * mm < relative_radius(*flanks) < 2.0 * mm
    assert relative_radius(flanks[0], flanks[1]) == pytest.approx(
        relative_radius(flanks[1], flanks[0]), rel=0.02
    )
    straight = Design.load("reference-2d-involute")
    flanks = [tooth_profile(straight, m) for m in ("flexspline", "circular_spline")]
    assert relative_radius(*flanks) > 100.0 * mm


# -- a tooth that resolves the strip ---------------------------------------------------


class FineTooth:
    """A tooth on triangles that grow from a place of its flank, held as a sector is."""

    def __init__(self, design: Design, member: str, part: float, finest: float):
        self.width = design.drive.face_width_mm * mm
        profile = tooth_profile(design, member)
        rim = getattr(design, member).rim_mm * mm
        given = sector_mesh(profile, rim, 3.0)
        low, high = profile.contact_range
        wanted = low + part * (high - low)
        at = np.abs(given.flank_stations - wanted).argmin()
        self.station = given.flank_stations[at]
        self.place = given.mesh.p[:, given.flank_right[at]]
        self.normal = profile.evaluate(np.array([self.station]))[1][0]
        mesh = given.mesh.to_meshtri()
        while True:
            corners = mesh.p[:, mesh.t]
            sides = corners - np.roll(corners, 1, axis=1)
            size = np.hypot(*sides).max(axis=0)
            apart = np.hypot(*(corners.mean(axis=1) - self.place[:, None]))
            coarse = (size > np.maximum(finest, 0.22 * apart)) & (apart < 0.8 * mm)
            if not coarse.any():
                break
            mesh = mesh.refined(np.flatnonzero(coarse))
        facets = mesh.boundary_facets()
        middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
        inner = np.hypot(*given.mesh.p[:, given.bore]).mean()
        on_face = np.abs(np.abs(np.arctan2(*middle)) - given.half_pitch) < 1e-7
        held = on_face | (np.abs(np.hypot(*middle) - inner) < 0.02 * rim)
        self.free = facets[~held]
        self.mesh = mesh
        self.basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
        material = design.material_of(member)
        modulus, nu = material.youngs_modulus, material.poisson_ratio
        first, second = modulus * nu / (1 - nu**2), modulus / (1 + nu)

        @BilinearForm
        def stiffness(u, v, _):
            strain, other = sym_grad(u), sym_grad(v)
            return second * ddot(strain, other) + first * trace(strain) * trace(other)

        fixed = self.basis.get_dofs(facets[held]).all()
        self.inside = np.setdiff1d(np.arange(self.basis.N), fixed)
        matrix = self.width * stiffness.assemble(self.basis)
        self.factor = splu(
            matrix[self.inside][:, self.inside].tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            options={"SymmetricMode": True},
        )

    def facets_within(self, reach: float) -> np.ndarray:
        """Of the free surface, about the place."""
        middle = self.mesh.p[:, self.mesh.facets[:, self.free]].mean(axis=1)
        return self.free[np.hypot(*(middle - self.place[:, None])) < reach]

    def along(self, x: np.ndarray) -> np.ndarray:
        """Distance along the flank of points near the place."""
        tangent = np.array([self.normal[1], -self.normal[0]])
        return np.einsum("i...,i->...", x - self._at(x), tangent)

    def _at(self, x: np.ndarray) -> np.ndarray:
        return self.place.reshape(2, *(1,) * (x.ndim - 1))

    def load(self, pressure, reach: float) -> np.ndarray:
        """Nodal forces of a pressure along the flank [N/m], onto the steel."""

        @LinearForm
        def form(v, w):
            p = pressure(self.along(w.x))
            return -p * (self.normal[0] * v[0] + self.normal[1] * v[1])

        facets = self.facets_within(reach)
        basis = FacetBasis(self.mesh, self.basis.elem, facets=facets, intorder=12)
        return form.assemble(basis)

    def moved(self, force: np.ndarray) -> np.ndarray:
        """Displacement into the steel at the vertices [m]."""
        u = np.zeros(self.basis.N)
        u[self.inside] = self.factor.solve(force[self.inside])
        return -self.normal @ u[self.basis.nodal_dofs]

    def total(self, force: np.ndarray) -> float:
        """Of nodal forces, into the steel [N]."""
        rigid = np.zeros(self.basis.N)
        for component, value in enumerate(self.normal):
            rigid[self.basis.nodal_dofs[component]] = value
            rigid[self.basis.facet_dofs[component]] = value
        return float(-rigid @ force)


def of_patch(design: Design, member: str, tooth: FineTooth) -> tuple[float, float]:
    """Compliance [m/N] of the condensed tooth at the same place, half length [m]."""
    element = sector(design, member, tooth_profile(design, member))
    row = np.zeros((2, element.flank_size, 2))
    row[0] = element.spline(tooth.station)[:, None] * tooth.normal
    row = row.ravel()
    compliance = float(row @ element.flank_compliance @ row)
    return compliance, half_length(element.spline.x)


@pytest.mark.parametrize("member", ["flexspline", "circular_spline"])
@pytest.mark.parametrize("part", [0.25, 0.55, 0.8])
def test_tooth_under_a_narrow_strip(member, part):
    """Patch and logarithm give the centre of a strip of 10 and 20 µm half width."""
    design = Design.load("reference-2d")
    tooth = FineTooth(design, member, part, 1.7e-6)
    patch, a = of_patch(design, member, tooth)
    k = softness_of(design.material_of(member).youngs_modulus, tooth.width)
    centre = np.hypot(*(tooth.mesh.p - tooth.place[:, None])).argmin()
    for b in (10e-6, 20e-6):

        def hertz(x, b=b):
            return 2.0 / (pi * b) * np.sqrt(np.maximum(0.0, 1.0 - (x / b) ** 2))

        force = tooth.load(hertz, 1.5 * b + 2e-6)
        wanted = tooth.moved(force)[centre] / tooth.total(force)
        found = patch + k * (log(a / b) + CENTRE_OVER_PATCH)
        assert found == pytest.approx(wanted, rel=0.02)
        assert patch < 0.8 * wanted


@pytest.mark.parametrize("radius", [0.5 * mm, 2.0 * mm])
def test_a_loaded_pair_of_flanks(radius):
    """A flank on a rigid one, its strip resolved, approaches as the law says."""
    design = Design.load("reference-2d")
    tooth = FineTooth(design, "flexspline", 0.4, 2.5e-6)
    patch, a = of_patch(design, "flexspline", tooth)
    k = softness_of(design.material_of("flexspline").youngs_modulus, tooth.width)
    law = Indentation(softness=k, patch=a, radius=radius)

    facets = tooth.facets_within(45e-6)
    nodes = np.unique(tooth.mesh.facets[:, facets])
    x = tooth.along(tooth.mesh.p[:, nodes])
    nodes, x = nodes[np.argsort(x)], np.sort(x)
    hats = [
        tooth.load(lambda s, k=k: np.interp(s, x, np.eye(x.size)[k]), 60e-6)
        for k in range(1, x.size - 1)
    ]
    nodes, x = nodes[1:-1], x[1:-1]
    share = np.array([tooth.total(hat) for hat in hats])
    compliance = np.array([tooth.moved(hat)[nodes] for hat in hats]).T / share
    compliance = 0.5 * (compliance + compliance.T)
    for force in (40.0, 150.0):
        closed = np.ones(x.size, dtype=bool)
        while True:
            # forces and the approach: gaps close, the forces add up
            own = np.flatnonzero(closed)
            n = own.size
            system = np.ones((n + 1, n + 1))
            system[:n, :n], system[n, n] = compliance[np.ix_(own, own)], 0.0
            system[:n, n] = -1.0
            right = np.append(-(x[own] ** 2) / (2.0 * radius), force)
            *load, approach = np.linalg.solve(system, right)
            if min(load) >= 0.0:
                break
            closed[own[np.array(load) < 0.0]] = False
        assert not closed[[0, -1]].any()
        found = patch * force + law.approach(np.array(force))
        assert found == pytest.approx(approach, rel=0.02)
        assert patch * force < 0.85 * approach


@pytest.mark.fe
def test_indentation_makes_a_drive_softer_and_conserves_its_energy():
    """At a fixed input dU = -T dpsi, with strips as without, but more of it."""
    follow = follower_in_plane(coarse())
    plain = replace(follow, model=replace(follow.model, indentation=None))
    found = {}
    for name, one in (("strips", follow), ("patch", plain)):
        state = one.engage(one.deflect())
        low, high = (one.to_torque(state, t) for t in (19.0, 21.0))
        torsion = low.rotation - high.rotation
        # the mean torque; the compliance hardly changes over the interval
        assert high.energy - low.energy == pytest.approx(20.0 * torsion, rel=1e-4)
        found[name] = torsion
    assert 1.01 * found["patch"] < found["strips"] < 1.2 * found["patch"]


@pytest.mark.fe
def test_indentation_is_that_of_the_elastic_members():
    """A rigid circular spline halves the softness; the plane's modulus counts."""
    both = sector_model(coarse()).indentation
    one = sector_model(coarse(), elastic_circular_spline=False).indentation
    confined = sector_model(coarse(**{"mesh.stress_state": "plane_strain"})).indentation
    assert both is not None and one is not None and confined is not None
    assert one.softness == pytest.approx(0.5 * both.softness)
    nu = Design.load("reference-2d").material.poisson_ratio
    assert confined.softness == pytest.approx((1 - nu**2) * both.softness)
