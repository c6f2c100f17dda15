"""The largest torque with the wave generator locked: laws of the path to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swgjoint.errors import Outcome
from swgjoint.fe.plane.figures.ratcheting import RatchetingPath, ratcheting_path
from swgjoint.gear.design.design import Design

OVAL = {"circular_spline.outer_rim": "free", "mesh.refinement": 0.6}
"""A circular spline whose outside can become oval, as thick as stated below."""


def drive(size: int) -> Design:
    """Member of the family, similar in every length."""
    design = Design.preset(f"size-{size}-50")
    return design.with_changes({**OVAL, "circular_spline.rim_mm": 0.4 * size})


@pytest.fixture(scope="module")
def short():
    """The first steps of the path."""
    return ratcheting_path(drive(25), step=0.02, upto=0.12)


def test_the_work_of_the_torque_is_the_energy(short):
    """T is the derivative of the strain energy by the turned angle; no limit yet."""
    # without the first step, in which teeth come in one by one
    x = short.turned[1:]
    work = CubicSpline(x, short.torque[1:]).antiderivative()
    gain = short.energy[2:] - short.energy[1]
    # 5e-4: a cubic through few points
    assert gain == pytest.approx(work(x[1:]) - work(x[0]), rel=5e-4)
    assert not short.passed
    assert short.outcome is Outcome.CONVERGED
    assert (np.diff(short.torque) > 0.0).all()
    assert (np.diff(short.pairs) > 0).all()


def test_torque_grows_with_the_size_cubed(short):
    """A drive of twice all lengths holds eight times the torque at the same angle."""
    twice = ratcheting_path(drive(50), step=0.02, upto=0.02)
    # 1e-5: profiles of the family are rounded to a nanometre
    assert twice.torque[1] == pytest.approx(8.0 * short.torque[1], rel=1e-5)


def test_the_limit_is_the_top_of_a_parabola(short):
    """Through the largest torque and its neighbours; without a fall a lower bound."""
    x = np.array([0.0, 1.0, 2.5, 3.0])
    made = RatchetingPath(
        turned=x,
        torque=10.0 - (x - 2.2) ** 2,
        energy=x,
        pairs=np.arange(4),
        pitch=1.0,
        outcome=Outcome.CONVERGED,
    )
    assert made.passed
    assert made.limit == pytest.approx(10.0, rel=1e-12)
    ended = replace(made, torque=x, outcome=Outcome.ACTIVE_SET_CYCLES)
    assert not ended.passed
    assert ended.limit == 3.0


@pytest.mark.slow
def test_the_path_passes_a_limit():
    """The torque falls at last, and up to there its work is still the energy."""
    path = ratcheting_path(drive(25))
    assert path.passed
    assert path.limit == pytest.approx(path.torque.max(), rel=0.01)
    assert (np.diff(path.torque)[:-1] > 0.0).all()
    x = path.turned[1:]
    work = CubicSpline(x, path.torque[1:]).integrate(x[0], x[-1])
    # 2e-3: at the end the circular spline moves by a lobe height
    assert path.energy[-1] - path.energy[1] == pytest.approx(work, rel=2e-3)


def test_backlash_is_no_limit():
    """Within the play no tooth touches: round-off that falls does not end the path."""
    members = ("flexspline", "circular_spline")
    thin = {f"{member}.thickness_coefficient": 0.9 for member in members}
    design = Design.preset("reference-2d-simplified")
    design = design.with_changes({**thin, "mesh.refinement": 0.5})
    path = ratcheting_path(design, step=0.04, upto=0.12)
    assert path.pairs[1] == 0 < path.pairs[2]
    # round-off, and falling; thousands of N·m are to come
    assert path.torque[:2] == pytest.approx(0.0, abs=1e-4)
    assert path.torque[1] < path.torque[0]
    assert path.torque[3] > 1.0
    assert not path.passed
    loose = replace(path, torque=-np.arange(path.turned.size), pairs=0 * path.pairs)
    assert not loose.passed
