"""Compiled contact forces of a Newton step against the numpy code that they repeat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.common.ring_factor import RingFactor
from swgjoint.fe.plane import newton_step
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.fe.plane.newton_step import Load, NewtonProblem
from swgjoint.gear.design.design import Design
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)
LOADS = {
    "torque": Load(torque=12.0),
    "rotation": Load(rotation=-3e-4),
    "turns": Load(torque=12.0, rotation=1e-5),
}


@pytest.fixture(scope="module", params=["reference-2d", "reference-2d-parabolic"])
def loaded(request):
    """Model, state under load, and candidates for tooth contact."""
    design = Design.load(request.param).with_changes({"mesh.refinement": 0.5})
    model = sector_model(design, half=True)
    follow = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    state = follow.to_torque(follow.engage(follow.deflect()), 15.0)
    linear = linearise(model, state, 15.0)
    reach = 0.05 * model.lobe_height
    contacts = linear.search.search(linear.flank, reach, state.contacts)
    assert len(contacts) > len(state.contacts) > 1
    return model, state, contacts


def solved(loaded, load, pressing):
    model, state, contacts = loaded
    linear = linearise(model, state, load.on_flexspline)
    problem = NewtonProblem.from_candidates(model, state, linear, load, contacts)
    return problem.solve(pressing)


@pytest.mark.fe
@pytest.mark.parametrize(
    ("name", "pressing"),
    [(name, None) for name in LOADS]
    # without contacts, nothing would hold a circular spline that turns
    + [(name, guess) for name in ("torque", "rotation") for guess in ("none", "all")],
)
def test_steps_are_those_of_numpy(loaded, monkeypatch, name, pressing):
    """From any first guess, with the same active contacts."""
    count = len(loaded[2])
    guess = {"none": np.zeros(0, int), "all": np.arange(count)}.get(pressing)
    with monkeypatch.context() as only:
        only.setattr(newton_step, "solve_condensed", None)
        ours = solved(loaded, LOADS[name], guess)
    monkeypatch.setattr(RingFactor, "solve_contacts", lambda *_, **__: None)
    theirs = solved(loaded, LOADS[name], guess)
    assert np.array_equal(ours.active, theirs.active)
    assert 0 < len(ours.active) < count
    for field in ("line_force", "increment", "gap"):
        one, other = getattr(ours, field), getattr(theirs, field)
        size = np.abs(other).max()
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-10 * size)
    for field in ("torque", "holding_torque", "compliance", "circular_spline_turn"):
        assert getattr(ours, field) == pytest.approx(getattr(theirs, field), rel=1e-9)


@pytest.mark.fe
def test_the_largest_increment_of_a_step_has_any_sign(loaded):
    """That of a node, not of its sign."""
    step = solved(loaded, LOADS["torque"], None)
    size = np.abs(step.increment)
    for increment in (size, -size):
        assert replace(step, increment=increment).largest == size.max()


def problem_of(rng, rows):
    """Factor of a small ring and arguments of its contact problem."""
    n, sectors = 7, 4
    base = rng.normal(size=(sectors, n, n))
    blocks = base @ base.transpose(0, 2, 1) + n * np.eye(n)
    return RingFactor(blocks, 2), dict(
        loads=rng.normal(size=(sectors, n, 3)),
        sector=rng.integers(0, sectors, rows),
        rows=rng.normal(size=(rows, n)),
        gaps=(
            rng.normal(size=rows),
            rng.normal(size=rows),
            np.eye(rows),
            np.array([50.0, 0.0, 0.0]),
        ),
        turns=False,
        held=False,
        active=np.zeros(rows, bool),
        result=np.empty(rows + 3),
    )


@pytest.mark.parametrize("seed", range(10))
def test_neighbouring_contacts_are_found(seed):
    """Forces and gaps of many contacts on a soft surface are non-negative."""
    rng, rows = np.random.default_rng(seed), 40
    factor, given = problem_of(rng, rows)
    given["rows"] *= 1e-6
    x = np.sort(rng.random(rows))
    gap, arm, compliance, _ = given["gaps"]
    gap[:] = 3.0 * x**2 - 1.0 + 0.02 * np.cos(40.0 * x)
    compliance[:] = np.exp(-(((x[:, None] - x) / 0.3) ** 2)) + 1e-5 * np.eye(rows)
    arm[:], given["active"][:] = 0.0, True
    found = factor.solve_contacts(**given)
    assert found is not None
    force = given["result"][:rows]
    moved = np.einsum("kn,kn->k", given["rows"], found[0][given["sector"]])
    assert (force >= 0.0).all() and 2 <= np.count_nonzero(force) < 10
    assert (gap + moved + compliance @ force >= -1e-10).all()


def test_singular_contacts_are_left_to_numpy():
    """A line without compliance that moves nothing."""
    factor, given = problem_of(np.random.default_rng(1), 3)
    assert factor.solve_contacts(**given) is not None
    given["rows"][1], given["gaps"][2][1, 1], given["active"][1] = 0.0, 0.0, True
    assert factor.solve_contacts(**given) is None


def test_shapes_that_do_not_fit_are_refused():
    """Nothing is read or written beyond an array, whatever the caller passes."""
    factor, good = problem_of(np.random.default_rng(2), 3)
    gap, arm, compliance, numbers = good["gaps"]
    for name, wrong in (
        ("loads", np.zeros((4, 7, 2))),
        ("sector", np.full(3, 4)),
        ("rows", np.zeros((2, 7))),
        ("gaps", (gap[1:], arm, compliance, numbers)),
        ("gaps", (gap, arm[1:], compliance, numbers)),
        ("gaps", (gap, arm, compliance[1:], numbers)),
        ("gaps", (gap, arm, compliance, numbers[1:])),
        ("active", np.zeros(2, bool)),
        ("result", np.zeros(5)),
    ):
        with pytest.raises(ValueError):
            factor.solve_contacts(**(good | {name: wrong}))
