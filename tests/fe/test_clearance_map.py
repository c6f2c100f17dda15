"""Maps of drives whose teeth leave the unloaded output free."""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np
import pytest
from solved import FEW_PITCH, FEW_TEETH, few_teeth, kept

from swgjoint.fe.common.clearance import across_clearance
from swgjoint.fe.common.sampling import sample_map
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.sheet.loop import torque_loop

pytestmark = pytest.mark.fe


@cache
def samples():
    """Teeth 5 % thinner than their spaces."""
    thin = {"flexspline.thickness_coefficient": 0.95}
    design = few_teeth("reference-2d-simplified", **thin)
    return kept("clearance map", lambda: sample_map(design, angles=7))


@cache
def drive():
    return fit_map(samples(), keep=0.0)


def at(torque):
    """Row of the samples nearest to a torque."""
    return int(np.argmin(np.abs(samples().torque - torque)))


def test_the_output_is_free_between_the_flanks():
    """No torque in the clearance, at any angle; the teeth hold beyond."""
    given, found = samples(), drive()
    assert given.free
    rated = found.ratings.rated_torque
    torsion = given.output_error[at(0.0)] - given.output_error
    begin = torsion[at(0.0) + 1].min()
    theta = np.linspace(0.0, FEW_PITCH, 25)
    inside = np.linspace(-begin, begin, 201)[:, None]
    torque = found.torque(inside, theta, theta / found.ratio)
    assert np.abs(torque).max() < 1e-5 * rated
    stiffness = found.stiffness(inside, theta, theta / found.ratio)
    assert np.abs(stiffness).max() < 1e-6 * found.mean_stiffness
    small = given.torque[at(0.01 * rated)]
    assert small == pytest.approx(0.01 * rated)
    beyond = torsion[at(small)].max() + 1e-5
    assert found.torque(beyond, 0.0, 0.0) > small


def test_clearance_is_that_of_the_teeth():
    """Lost motion has the size of what was taken off the teeth."""
    given = samples()
    free = np.ptp(given.output_error[[at(-0.2), at(0.2)]], axis=0).mean()
    # 5 % of half a pitch; the play of the conjugate paths and the torque make a little
    assert free == pytest.approx(0.05 * pi / FEW_TEETH, rel=0.1)


def test_the_loop_of_a_free_output_is_as_wide_as_its_clearance():
    """Unloaded it rests where the load left it; lost motion holds that."""
    given, loop = samples(), torque_loop(drive())
    loss = loop.hysteresis_loss()
    begin = given.output_error[at(0.0) - 1] - given.output_error[at(0.0) + 1]
    assert loss == pytest.approx(begin[0], abs=2e-5)
    assert loop.lost_motion(20.0) > loss


@pytest.mark.parametrize("part", [-1.0, -0.01, 0.01, 1.0])
def test_loaded_outputs_come_back(part):
    """The map's equilibrium under a torque is that of the finite elements."""
    given, found = samples(), drive()
    row = at(part * found.ratings.rated_torque)
    torque = given.torque[row]
    error = output_angle(found, given.input_angle, np.full(7, torque))
    error -= given.input_angle / found.ratio
    wanted = given.output_error[row] - given.output_error[at(0.0)].mean()
    # a percent of the rated torque over the stiffness beside the clearance
    assert np.abs(error - wanted).max() < 0.01 * 20.0 / 1.8e4


def test_energy_without_torque_is_flat():
    """Moving the output in its clearance takes no work."""
    given, found = samples(), drive()
    begin = given.output_error[at(0.0)] - given.output_error[at(0.0) + 1]
    x = np.linspace(-begin.min(), begin.min(), 51)
    energy = found.energy(x, np.zeros(51), np.zeros(51))
    # what the rated torque does over the clearance
    assert np.ptp(energy) < 1e-4 * 20.0 * begin.min()


def test_the_torque_does_not_fall_where_contact_begins():
    """Beside the clearance the torque rises, but for 1e-4 of the rated one."""
    x = np.linspace(0.0, 8e-4, 2001)[:, None]
    theta = np.linspace(0.0, FEW_PITCH, 25)
    torque = drive().torque(x, theta, theta / drive().ratio)
    assert (np.maximum.accumulate(torque) - torque).max() < 1e-4 * 20.0


def test_begin_of_contact_of_a_linear_spring():
    """A spring of stiffness K behind a gap: contact is found in the last 3 T/2K."""
    gap, stiffness, torque = 1e-3, 2e4, 0.2
    rest = np.array([[0.0], [5.0], [np.inf], [0.0]])
    place = -(gap + torque / stiffness)
    taken_up = np.array([[place], [5.0 + 1e-6], [1.0 / stiffness], [torque / 60.0]])
    begin, table = across_clearance(rest, taken_up, torque)
    assert begin == pytest.approx(1e-8 * torque)
    assert table[0, 0] == pytest.approx(-(gap - 0.5 * torque / stiffness), rel=1e-12)
    # a faint torque on the way, so that the energy is that of the middle
    assert table[1, 0] == pytest.approx(5.0 - 0.5 * begin * table[0, 0], rel=1e-12)
    assert table[2, 0] * begin == pytest.approx(-table[0, 0], rel=1e-12)
