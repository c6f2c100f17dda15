"""Equilibria with the tolerances of maps: of conforming flanks and of tiny drives."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from solved import few_teeth

from swgjoint.fe.common.ring_factor import RingFactor
from swgjoint.fe.common.sampling import follower_in_plane
from swgjoint.fe.plane import equilibrium
from swgjoint.fe.plane.equilibrium import NewtonSolver
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.scaling import scaled_design

PART = 0.02
"""Torque in parts of the repeated peak, where the ripple is smallest: 0.43 mN·m peak to
peak, 1 urad of output error."""
PLACES = (np.arange(4, 11) + 0.37) / 12
"""Angles in parts of the pitch."""


def followed(follow, torques, theta):
    """Output angles [rad] and input torques [N·m] along a path (n, 2)."""
    rows = []
    state = follow.engage(follow.deflect(float(theta[0])))
    for torque in torques:
        state = follow.to_torque(state, torque)
        for angle in theta:
            state = follow.to_angle(state, float(angle))
            assert state.outcome.ok
            rows.append((follow.output_angle(state), follow.input_torque(state)))
    return np.array(rows)


@pytest.mark.fe
def test_equilibria_of_conforming_flanks_are_converged():
    """Output and input torque are those of a solver with a 500 times finer tolerance.

    With the tolerance for flanks that touch at one point they are off by 8.5 nrad and
    19 uN·m, 4 % of the ripple.
    """
    design = Design.load("dca-80-to-1")
    torque = PART * ratings_of(design).repeated_peak
    theta = 2.0 * pi / design.periodicity * PLACES
    follow = follower_in_plane(design)
    found, exact = (
        followed(replace(follow, solver=solver), [torque], theta)
        for solver in (follow.solver, NewtonSolver())
    )
    output, moment = np.abs(found - exact).max(axis=0)
    assert output < 1e-9
    assert moment < 5e-6


@pytest.mark.fe
@pytest.mark.parametrize("name", ["dca-80-to-1", "reference-2d-simplified"])
def test_a_short_reach_after_small_steps_omits_no_contact(name, monkeypatch):
    """Equilibria are those of a search with the long reach at every step."""
    design = Design.load(name)
    peak = ratings_of(design).repeated_peak
    theta = 2.0 * pi / design.periodicity * PLACES[:3]
    torques = [PART * peak, 0.4 * peak]
    found = followed(follower_in_plane(design), torques, theta)
    monkeypatch.setattr(equilibrium, "FOLLOWED", np.inf)
    exact = followed(follower_in_plane(design), torques, theta)
    output, moment = np.abs(found - exact).max(axis=0)
    assert output < 1e-12
    assert moment < 1e-8


@pytest.mark.fe
@pytest.mark.parametrize("name", ["dca-80-to-1", "reference-2d", "size-25-100"])
def test_kept_tangents_lead_to_the_same_equilibria(name, monkeypatch):
    """Every step ends with fewer factors, within a tenth of the error of maps."""
    design = Design.load(name)
    theta = 2.0 * pi / design.periodicity * PLACES[:3]
    torque, factors = PART * ratings_of(design).repeated_peak, [0]
    make = RingFactor.__init__

    def count(self, *given):
        factors[0] += 1
        make(self, *given)

    monkeypatch.setattr(RingFactor, "__init__", count)
    found = []
    follow = follower_in_plane(design)
    for keep in (follow.solver.keep_below, 0.0):
        factors[0] = 0
        solver = replace(follow.solver, keep_below=keep)
        found.append(
            (followed(replace(follow, solver=solver), [torque], theta), factors[0])
        )
    (kept, few), (renewed, many) = found
    output, moment = np.abs(kept - renewed).max(axis=0)
    assert output < 1e-10
    assert moment < 5e-7
    assert few < many


@pytest.mark.fe
@pytest.mark.parametrize("torque", [12.0, 17.0])
def test_positions_at_once_are_as_accurate_as_those_by_steps(torque):
    """Far from the start, the tolerances of maps alone leave 0.1 uN·m."""
    design = Design.load("reference-2d")
    follow, angle = follower_in_plane(design), 0.2 * pi / design.periodicity
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    start = follow.predict(state, angle)
    exact = replace(follow, solver=NewtonSolver()).load(start, torque, angle)
    wanted = follow.input_torque(exact)
    loose = follow.input_torque(follow.load(start, torque, angle))
    found = follow.input_torque(follow.to_position(state, torque, angle))
    assert abs(found - wanted) < 1e-8 < abs(loose - wanted)


@pytest.mark.fe
def test_equilibria_of_tiny_drives_are_to_scale():
    """A fiftieth of the module, 1.2 mm of diameter: angles as before, torques by size.

    With the tolerances of larger drives, they are off by 0.14 and 0.25 % of the ripple.
    """
    design, torque = few_teeth(), 2.0
    theta = 2.0 * pi / design.periodicity * np.arange(8) / 8 + 0.01
    rows = []
    for module in (0.2, 0.02):
        part = scaled_design(design, name="to scale", module=module).design
        found = followed(follower_in_plane(part), [torque * module**3], theta)
        rows.append(found / np.array([1.0, module**3]))
    difference = np.abs(rows[1] - rows[0]).max(axis=0)
    ripple = np.ptp(rows[0] - np.outer(theta, [1.0 / design.ratio, 0.0]), axis=0)
    # lengths are rounded
    assert (difference < np.array([1e-4, 5e-4]) * ripple).all(), difference / ripple
