"""Loss of bending rings: closed form, balance of energies, rotation, load."""

from __future__ import annotations

import numpy as np
import pytest
from solved import hundred_elements

from swgjoint.fe.rings.bending import bending_torque_per_loss_factor, harmonic_energies
from swgjoint.fe.rings.hermite_ring import HermiteRing
from swgjoint.fe.rings.loading import solve_loaded, without_torque
from swgjoint.fe.rings.model import thin_ring
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.friction_bending import bending_torque

RING = HermiteRing(radius=0.03, elements=200, stretching=2e6, bending=0.1)
HEIGHT = 2e-5


def test_two_lobes_as_in_closed_form():
    """Energy pi EI w0^2 (n^2-1)^2 / (2 r^3), all of it in n = 2."""
    around = 2.0 * np.pi * np.arange(RING.elements) / RING.elements
    q = RING.two_lobes(HEIGHT, around, 0.7).ravel()
    closed = 0.5 * np.pi * RING.bending * (3.0 * HEIGHT) ** 2 / RING.radius**3
    energy = harmonic_energies(RING, q)
    # 1e-3: elements, and large rotations of order w0/r = 1/1500
    assert energy[2] == pytest.approx(closed, rel=1e-3)
    assert energy[1] + energy[3:].sum() < 1e-3 * closed


def test_undeformed_and_turned_rings_lose_nothing():
    """Rotation is no strain; a ring that only breathes does not cycle."""
    turned = RING.reference.reshape(-1, 2) @ np.array([[0.6, -0.8], [0.8, 0.6]])
    assert harmonic_energies(RING, turned.ravel()).sum() < 1e-20
    breathing = harmonic_energies(RING, 1.001 * RING.reference)
    assert breathing[0] > 0.0
    assert breathing[1:].sum() < 1e-12 * breathing[0]


@pytest.fixture(scope="module")
def loaded():
    """Model of the family's 50:1 drive, unloaded and loaded equilibrium."""
    design = Design.preset("size-25-50")
    with hundred_elements():
        model = thin_ring(design)
        free = without_torque(model, 0.3)
        return design, model, free, solve_loaded(model, free, 30.0)


def test_harmonics_add_up_to_the_energy_of_the_rings(loaded):
    """Parseval, whatever the shape: the sum is the strain energy of the ring."""
    _, model, *states = loaded
    for state in states:
        rim, race = np.split(state.q, [model.rim.size])
        for ring, q in ((model.rim, rim), (model.race, race)):
            # 1 %: values amid the elements instead of Gauss points
            assert harmonic_energies(ring, q).sum() == pytest.approx(
                ring.energy(q), rel=0.01
            )


def test_rim_with_teeth_exceeds_the_plain_rim_by_its_stiffness(loaded):
    """Unloaded, rim alone: closed form times EI with teeth over EI without, 15 %.

    The clearance of the bearing takes a part of the deflection, and the balls add
    harmonics above the second.
    """
    design, model, free, _ = loaded
    rim, _ = np.split(free.q, [model.rim.size])
    own = 2.0 * float(
        np.arange(model.rim.elements // 2 + 1) @ harmonic_energies(model.rim, rim)
    )
    steel = design.material_of("flexspline").youngs_modulus
    wide, rim_mm = design.drive.face_width_mm, design.flexspline.rim_mm
    plain = steel * wide * rim_mm**3 * 1e-12 / 12.0
    closed = bending_torque(design, 1.0) * model.rim.bending / plain
    radius = design.flexspline_inner_radius + 0.5e-3 * rim_mm
    closed *= (radius / model.rim.radius) ** 3
    assert own == pytest.approx(closed, rel=0.15)


def test_load_bends_more(loaded):
    """Tooth forces add bending between the lobes: more loss under load."""
    _, model, free, under = loaded
    losses = [bending_torque_per_loss_factor(model, s) for s in (free, under)]
    assert losses[1] > 1.05 * losses[0] > 0.0
