"""Maps of drives whose teeth leave the unloaded output free."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from known_samples import samples_of
from solved import FEW_PITCH, FEW_TEETH, few_teeth, kept

from swgjoint.fe.common.clearance import FAINT, across_clearance, add_clearance
from swgjoint.fe.common.sampling import sample_map
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.samples import MapSamples
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


def test_a_growing_stiffness_stores_the_energy():
    """A tooth that touches early: contact begins at least 2 E/T before."""
    gap, torque, energy = 1e-3, 0.2, 1.0e-5
    rest = np.array([[0.0], [5.0], [np.inf], [0.0]])
    for sign in (1.0, -1.0):
        place = -sign * gap
        taken_up = np.array([[place], [5.0 + energy], [5e-5], [0.0]])
        _, table = across_clearance(rest, taken_up, sign * torque)
        # 3 T/2K is 1.5e-5 rad, over which a torque up to T does 3e-6 J of work at most
        assert table[0, 0] == pytest.approx(place + sign * 2.0 * energy / torque)


def early_tooth(early: float) -> MapSamples:
    """Equilibria of a soft tooth that touches before the stiff ones.

    Args:
        early: Largest rotation from the contact of the tooth to the others [rad].
    """
    gap, soft, stiff, small = 1.6e-4, 65.0, 2600.0, 0.013
    theta = 2.0 * pi / FEW_TEETH * np.arange(12) / 12
    begin = gap - 0.5 * early * (1.0 - np.cos(FEW_TEETH * theta))
    along = -0.5 * early * FEW_TEETH * np.sin(FEW_TEETH * theta)
    levels = np.array([1.0, 10.0, 20.0, 33.0, 50.0, 72.0, 102.0, 142.0]) * small

    def rows(torque: float, sign: float) -> np.ndarray:
        alone = begin + torque / soft
        both = (torque + soft * begin + stiff * gap) / (soft + stiff)
        x = np.where(alone < gap, alone, both)
        beyond = np.maximum(x - gap, 0.0)
        energy = 0.5 * soft * (x - begin) ** 2 + 0.5 * stiff * beyond**2
        slope = np.where(alone < gap, soft, soft + stiff)
        moment = -sign * torque / 60.0 - soft * (x - begin) * along
        return np.array([-sign * x, energy, 1.0 / slope, moment])

    table = {0.0: np.zeros((4, 12))}
    for torque in levels.tolist():
        table |= {sign * torque: rows(torque, sign) for sign in (1.0, -1.0)}
    add_clearance(table, [1.0, -1.0], small, FAINT)
    torque = np.array(sorted(table))
    error, energy, compliance, moment = np.array([table[t] for t in torque]).swapaxes(
        0, 1
    )
    return replace(
        samples_of(),
        order=(FEW_TEETH, 0),
        input_angle=theta,
        torque=torque,
        output_error=error,
        energy=energy,
        compliance=compliance,
        input_torque=moment,
        free=True,
        solved=None,
        solved_angles=None,
    )


@pytest.mark.parametrize("early", [1e-5, 3e-5, 7e-5])
def test_the_mean_torque_rises_where_one_tooth_touches_early(early):
    """Between the knots as well, and the sampled torques come back.

    A drive like size-8-30: 65 N·m/rad over 7e-5 rad until the next tooth touches.
    """
    given = early_tooth(early)
    found = fit_map(given, keep=0.0)
    knots = found.torsion_knots
    x = np.linspace(knots[0], knots[-1], 20_001)
    torque = np.array([found.coefficients(float(at), 1)[0, 0] for at in x])
    # round-off of a torque that is constant within the clearance
    assert np.diff(torque).min() > -1e-12 * torque.max()
    torsion = given.output_error[given.torque == 0.0] - given.output_error
    theta = np.broadcast_to(given.input_angle, torsion.shape)
    wrong = np.abs(found.torque(torsion, theta, theta / found.ratio).T - given.torque)
    # the common knots follow the ends of the clearance, which differ between angles
    near = np.abs(given.torque) < 0.1
    assert wrong[:, ~near].max() < 1e-12 * torque.max()
    assert wrong[:, near].max() < 1e-3
