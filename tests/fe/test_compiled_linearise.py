"""Compiled linearisation of the 2D model against the numpy code that it repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.curve import Kind
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)
CASES = {
    "ellipse": ("reference-2d", True),
    "whole ring": ("reference-2d", False),
    "simplified": ("reference-2d-simplified", True),
    "parabolic": ("reference-2d-parabolic", True),
    "bearing": ("size-25-100", True),
    "fixed flexspline": ("reference-2d-flexspline-fixed", True),
}
FIELDS = "gradient hessian gap normal rotation_gradient flank fixed"
FRAMES = "angle position displacement deformation elongating spin gyration"


def near(ours, theirs, bound=1e-12):
    scale = np.abs(theirs).max()
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=bound * scale)


@pytest.fixture(scope="module", params=CASES)
def loaded(request):
    """Model, and a state off its equilibrium, so that no part of the gradient is zero.

    The wave generator is not centred, as with errors.
    """
    name, half = CASES[request.param]
    change = {"mesh.refinement": 0.5}
    if request.param == "bearing":
        change["wave_generator.bearing"] = dict(
            balls=22, ball_diameter_mm=5.0, race_thickness_mm=1.5
        )
    design = Design.load(name).with_changes(change)
    model = sector_model(design, half=half)
    follow = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    state = follow.to_torque(follow.engage(follow.deflect()), 5.0)
    assert state.outcome.ok
    rng = np.random.default_rng(6)
    moved = state.faces + 1e-6 * rng.normal(size=state.faces.shape)
    offset = None if model.race else np.array([2e-6, -1e-6])
    return (
        replace(model, wave_generator_offset=offset),
        replace(state, faces=moved, wave_generator_angle=0.3),
    )


@pytest.mark.fe
def test_linearisations_are_those_of_numpy(loaded, monkeypatch):
    """Gradient, tangent, gaps and frames, also of stations far from the outline."""
    model, state = loaded
    ours = linearise(model, state, 5.0)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    theirs = linearise(model, state, 5.0)
    for name in FIELDS.split():
        # round-off of a distance from the race is relative to the positions
        bound = 1e-11 if model.race and name == "gap" else 1e-12
        near(getattr(ours, name), getattr(theirs, name), bound)
    for name in FRAMES.split():
        # round-off of rigid motions is relative to the positions
        bound = 1e-12 if name != "deformation" else 1e-9
        near(getattr(ours.frames, name), getattr(theirs.frames, name), bound)


@pytest.mark.fe
@pytest.mark.parametrize("loops", ["compiled", "numpy"])
def test_a_kept_tangent_leaves_everything_else_as_it_is(loaded, monkeypatch, loops):
    """Only the tangent is that of the other state."""
    model, state = loaded
    if loops == "numpy":
        monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    wanted = linearise(model, state, 5.0)
    other = linearise(model, replace(state, wave_generator_angle=0.31), 5.0)
    before = other.hessian.copy()
    ours = linearise(model, state, 5.0, kept=other)
    assert np.array_equal(ours.hessian, before)
    assert not np.array_equal(ours.hessian, wanted.hessian)
    for name in FIELDS.replace("hessian ", "").split():
        near(getattr(ours, name), getattr(wanted, name))


@pytest.mark.fe
def test_gaps_after_a_step_are_those_of_numpy(loaded, monkeypatch):
    """Also in the last sector of a half model, whose end has the opposite sign."""
    model, state = loaded
    linear = linearise(model, state, 5.0)
    step = 1e-5 * np.random.default_rng(8).normal(size=linear.gradient.shape)
    ours = linear.gap_after(step)
    assert np.abs(ours - linear.gap).max() > 1e-6
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    near(ours, linear.gap_after(step))


@pytest.mark.fe
def test_exchanges_of_stations_are_those_of_numpy(loaded, monkeypatch):
    """Of some stations in every sector; the last one of a half ring has signs."""
    model, state = loaded
    ours, theirs = (linearise(model, state, 5.0) for _ in range(2))
    stations = np.random.default_rng(9).uniform(size=ours.gap.shape) < 0.3
    changed = ours.exchange(stations, state.touching)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    assert np.array_equal(changed, theirs.exchange(stations, state.touching))
    for name in ("gradient", "hessian"):
        near(getattr(ours, name), getattr(theirs, name))


@pytest.mark.fe
def test_frames_are_those_of_the_linearised_ring(loaded, monkeypatch):
    """In compiled code and in numpy."""
    model, state = loaded
    ours, linear = model.frames(state), linearise(model, state, 5.0)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    theirs = model.frames(state)
    for name in FRAMES.split():
        near(getattr(ours, name), getattr(linear.frames, name))
        bound = 1e-12 if name != "deformation" else 1e-9
        near(getattr(ours, name), getattr(theirs, name), bound)


def test_shapes_that_do_not_fit_are_refused():
    """Nothing is read or written beyond an array, whatever the caller passes."""
    native = kernels()
    for weights, stations in (
        (np.zeros((2, 3, 4)), 4),
        (np.zeros((2, 2, 3)), 4),
        (np.zeros((2, 2, 4)), 3),
        (np.zeros((0, 2, 4)), 0),
    ):
        with pytest.raises(ValueError):
            native.Bore(weights, stations)
    # two stations in each of two intervals, which follow two of three nodes
    bore = native.Bore(np.zeros((2, 2, 4)), 4)
    good = dict(
        spring=np.zeros((5, 4)),
        gap=np.zeros((5, 4)),
        normal=np.zeros((5, 4, 2)),
        curvature=np.zeros((5, 4)),
        into=np.arange(6),
        sign=np.ones((5, 7)),
        gradient=np.zeros((5, 7)),
        tangent=np.zeros((5, 7, 7)),
    )
    bore.forces(**good)
    bore.forces(**(good | dict(curvature=None, sign=None, tangent=None)))
    for name, wrong in (
        ("spring", np.zeros((5, 3))),
        ("sign", np.zeros((5, 6))),
        ("gap", np.zeros((4, 4))),
        ("normal", np.zeros((5, 4, 3))),
        ("curvature", np.zeros((5, 2))),
        ("into", np.arange(5)),
        ("into", np.arange(2, 8)),
        ("into", np.arange(-1, 5)),
        ("gradient", np.zeros((4, 7))),
        ("tangent", np.zeros((5, 7, 6))),
    ):
        with pytest.raises(ValueError):
            bore.forces(**(good | {name: wrong}))
    after = dict(
        gap=good["gap"],
        normal=good["normal"],
        into=good["into"],
        increment=np.zeros((5, 7)),
        result=np.zeros((5, 4)),
    )
    bore.gaps_after(**after)
    for name, wrong in (
        ("increment", np.zeros((5, 5))),
        ("increment", np.zeros((4, 7))),
        ("result", np.zeros((5, 3))),
    ):
        with pytest.raises(ValueError):
            bore.gaps_after(**(after | {name: wrong}))
    gaps = dict(
        nodes=np.ones((5, 3, 2)),
        touching=np.zeros((5, 4), bool),
        outline=np.array([[Kind.ELLIPSE, 0.03, 0.02, 0.0, 0.0, 0.0, 0.0]]),
        angle=0.1,
        offset=np.zeros(2),
        far=1e-3,
        gap=good["gap"],
        normal=good["normal"],
        curvature=good["curvature"],
    )
    bore.gaps(**gaps)
    for name, wrong in (
        ("nodes", np.ones((5, 4, 2))),
        ("touching", np.zeros((4, 4), bool)),
        ("offset", np.zeros(1)),
        ("outline", np.zeros((1, 6))),
        ("outline", np.zeros((0, 7))),
        ("outline", np.full((1, 7), 7.0)),
        ("outline", np.zeros((2, 7))),
        ("gap", np.zeros((5, 5))),
        ("normal", np.zeros((4, 4, 2))),
    ):
        with pytest.raises(ValueError):
            bore.gaps(**(gaps | {name: wrong}))


def sector_arrays():
    """Arguments of a sector of four nodes with two on each face."""
    return dict(
        skeleton=np.arange(8.0).reshape(4, 2),
        face=2,
        stiffness=np.eye(8),
        turning_parts=np.zeros((6, 64)),
        rim_slopes=np.zeros((1, 8)),
        elongation=np.zeros(8),
        flank_from_skeleton=np.zeros((6, 8)),
        flank_compliance=np.zeros((6, 6)),
    )


def test_sectors_that_do_not_fit_are_refused():
    native = kernels()
    sector = native.Sector(**sector_arrays())
    for name, wrong in (
        ("skeleton", np.zeros((4, 3))),
        ("face", 3),
        ("stiffness", np.eye(7)),
        ("turning_parts", np.zeros((6, 63))),
        ("rim_slopes", np.zeros((1, 7))),
        ("elongation", np.zeros(7)),
        ("flank_from_skeleton", np.zeros((6, 7))),
        ("flank_compliance", np.zeros((5, 5))),
    ):
        with pytest.raises(ValueError):
            native.Sector(**(sector_arrays() | {name: wrong}))
    good = dict(
        place=np.zeros(3),
        positions=np.ones((3, 4, 2)),
        force=np.zeros((3, 6)),
        dofs=np.arange(8),
        angle=np.zeros(3),
        gyration=np.zeros(3),
        kinematics=np.zeros((5, 3, 8)),
        flank=np.zeros((3, 6)),
        gradient=np.zeros((3, 9)),
        tangent=np.zeros((3, 9, 9)),
    )
    sector.tangents(**good)
    for name, wrong in (
        ("positions", np.ones((3, 3, 2))),
        ("force", np.zeros((3, 5))),
        ("dofs", np.arange(7)),
        ("dofs", np.arange(2, 10)),
        ("angle", np.zeros(2)),
        ("kinematics", np.zeros((5, 3, 7))),
        ("kinematics", np.zeros((4, 3, 8))),
        ("flank", np.zeros((2, 6))),
        ("gradient", np.zeros((2, 9))),
        ("tangent", np.zeros((3, 8, 9))),
    ):
        with pytest.raises(ValueError):
            sector.tangents(**(good | {name: wrong}))
