"""Compiled search for tooth contact against the numpy code that it repeats."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from swgjoint.fe.plane.compiled_search import CompiledSearch
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.gear.design.design import Design
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)
CASES = {
    "elastic": ("reference-2d", {}),
    "parabolic": ("reference-2d-parabolic", {}),
    "rigid circular spline": ("reference-2d", {"elastic_circular_spline": False}),
    "asymmetric": ("reference-2d-asymmetric", {}),
    "fixed flexspline": ("reference-2d-flexspline-fixed", {}),
    "involute": ("reference-2d-involute", {}),
    "conjugate": ("dca-80-to-1", {}),
    "friction": ("reference-2d", {"friction": 0.1}),
    "whole ring": ("reference-2d", {"half": False}),
}


@pytest.fixture(scope="module", params=CASES)
def contact(request):
    """Search of a loaded drive with its flanks, and the scale of its lobe."""
    name, options = CASES[request.param][0], dict(CASES[request.param][1])
    change = {"mesh.refinement": 0.5}
    if "friction" in options:
        change["friction.tooth_coefficient"] = options.pop("friction")
    design = Design.load(name).with_changes(change)
    model = sector_model(design, **({"half": "auto"} | options))
    follow = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    state = follow.to_torque(follow.engage(follow.deflect()), 15.0)
    assert state.outcome.ok
    linear = linearise(model, state, state.torque)
    return linear.search, linear.flank, state, model.lobe_height


def both(monkeypatch, search):
    """The same search compiled and in numpy."""
    compiled = replace(search)
    assert isinstance(compiled._compiled, CompiledSearch)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    reference = replace(search)
    assert reference._compiled is None
    return compiled, reference


@pytest.mark.fe
def test_search_of_some_flanks_finds_their_candidates_only(contact, monkeypatch):
    """Candidates of every third flank are those of a search of all flanks there."""
    search, flank, _, height = contact
    some = np.arange(2 * len(flank)).reshape(-1, 2) % 3 == 0
    for one in both(monkeypatch, search):
        wanted = one.search(flank, 0.1 * height, None)
        wanted = wanted.chosen(np.flatnonzero(some[wanted.sector, wanted.side]))
        found = one.search(flank, 0.1 * height, None, searched=some)
        assert len(found) > 2
        for field in fields(wanted):
            same = getattr(found, field.name), getattr(wanted, field.name)
            np.testing.assert_allclose(*same, rtol=1e-9, atol=1e-12)


@pytest.mark.fe
@pytest.mark.parametrize("thorough", [False, True])
@pytest.mark.parametrize("reach", [0.02, 0.1])
def test_candidates_are_those_of_numpy(contact, monkeypatch, thorough, reach):
    """The same points to a picometre, with the same weights, gaps and normals."""
    search, flank, state, height = contact
    found, wanted = (
        one.search(flank, reach * height, state.contacts, thorough=thorough)
        for one in both(monkeypatch, search)
    )
    assert len(wanted) > 5
    np.testing.assert_allclose(found.station, wanted.station, rtol=0.0, atol=1e-12)
    for field in fields(wanted):
        ours, theirs = getattr(found, field.name), getattr(wanted, field.name)
        # the minimum of conforming flanks is flat: the points are 7e-15 m apart, at
        # which weights differ by 4e-11, whatever their size
        scale = np.abs(theirs).max(initial=0.0)
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * scale + 1e-12)


@pytest.mark.fe
def test_far_displaced_flanks_omit_no_candidate(contact, monkeypatch):
    """Teeth of the circular spline moved by up to a third of the lobe height."""
    search, flank, _, height = contact
    if not search.circular_spline.flank_dofs:
        return  # rigid teeth do not move
    rng = np.random.default_rng(5)
    nodes = search.circular_spline_flank
    shift = rng.uniform(-0.3, 0.3, (len(nodes), 1, 2)) * height
    moved = (nodes.reshape(len(nodes), -1, 2) + shift).reshape(nodes.shape)
    search = replace(search, circular_spline_flank=moved)
    found, wanted = (
        one.search(flank, 0.02 * height, None) for one in both(monkeypatch, search)
    )
    assert len(wanted) > 5
    for field in ("sector", "side", "station", "gap"):
        ours, theirs = getattr(found, field), getattr(wanted, field)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)


@pytest.mark.fe
def test_no_candidate_has_the_same_columns(contact, monkeypatch):
    """Flanks that all stay apart, as in a wide clearance."""
    search, flank, _, height = contact
    found, wanted = (
        one.search(flank, -height, None) for one in both(monkeypatch, search)
    )
    assert len(found) == len(wanted) == 0
    for field in fields(wanted):
        assert getattr(found, field.name).shape == getattr(wanted, field.name).shape


@pytest.mark.fe
def test_contacts_without_derivatives_are_the_same(contact):
    """All columns except the derivatives of the gaps, which are omitted."""
    search, flank, _, height = contact
    found = search.search(flank, 0.02 * height, None)
    assert len(found) > 5
    at = found.sector, found.side, found.station, flank
    whole, bare = search.gather(*at), search.gather(*at, weighted=False)
    assert bare.weight.size == bare.circular_spline_weight.size == 0
    for field in fields(whole):
        if not field.name.endswith("weight"):
            ours, theirs = getattr(bare, field.name), getattr(whole, field.name)
            np.testing.assert_array_equal(ours, theirs)


@pytest.mark.fe
def test_feet_of_any_point_are_those_of_numpy(contact, monkeypatch):
    """Also beyond the ends of the flank, at corners, and far from any flank."""
    search, _, _, height = contact
    rng = np.random.default_rng(7)
    n = 4000
    low, high = search.element.flank_range
    points, outward, _ = search.element.profile.evaluate(rng.uniform(low, high, n))
    points = points + height * rng.normal(0.0, 0.5, (n, 2))
    sector = rng.integers(0, len(search.angle), n)
    side = rng.integers(0, 2, n)
    corners = 0
    for rigid in (False, True):
        found, wanted = (
            one.find_feet(points, outward, sector, side, rigid=rigid)
            for one in both(monkeypatch, search)
        )
        monkeypatch.delenv("SWGJOINT_KERNELS")
        assert np.array_equal(found.tooth, wanted.tooth)
        assert np.array_equal(found.feet.corner, wanted.feet.corner)
        corners += int(wanted.feet.corner.sum())
        for ours, theirs in (
            (found.feet.gap, wanted.feet.gap),
            (found.feet.normal, wanted.feet.normal),
            (found.feet.curvature * height, wanted.feet.curvature * height),
            (found.feet.rest, wanted.feet.rest),
            (found.normal, wanted.normal),
            (found.rest, wanted.rest),
        ):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
        assert (found.feet.station is None) == (wanted.feet.station is None)
    elastic = search.circular_spline.flank_dofs > 0
    assert (corners > 100) == elastic


@pytest.mark.fe
def test_minima_are_refined_as_in_numpy(contact, monkeypatch):
    """Also where the closest point of the other flank is its corner."""
    search, _, _, height = contact
    rng = np.random.default_rng(11)
    n, nodes = 2000, search.element.flank_size
    low, high = search.element.flank_range
    station, spacing = rng.uniform(low, high, n), 0.05 * (high - low)
    # flanks shifted as a whole, so that some reach beyond the ends of the other one
    mirrored = np.repeat(0.3 * height * rng.normal(size=(n, 1, 2)), nodes, axis=1)
    sector = rng.integers(0, len(search.angle), n)
    side = rng.integers(0, 2, n)
    given = station, mirrored, sector, side, spacing
    compiled, reference = both(monkeypatch, search)
    wanted = reference._refine(*given)
    np.testing.assert_allclose(compiled._refine(*given), wanted, rtol=0.0, atol=1e-12)
    point, tangent, _ = reference._displaced(wanted, mirrored)
    outward = np.stack([-tangent[:, 1], tangent[:, 0]], -1)
    corner = reference.find_feet(point, outward, sector, side).feet.corner
    assert (corner.sum() > 100) == (search.circular_spline.flank_dofs > 0)


def test_arrays_that_do_not_fit_are_refused(contact):
    """Nothing is read or written beyond an array, whatever the caller passes."""
    search = contact[0]._compiled.search
    points, index = np.zeros((3, 2)), np.zeros(3, dtype=np.int64)
    real, corner = np.zeros((3, 11)), np.zeros(3, dtype=bool)

    def see(**other):
        given = dict(points=points, outward=points, sector=index, side=index)
        given |= dict(rigid=True, start=None, steps=3)
        search.see(
            **(given | dict(real=real, corner=corner, tooth=index.copy()) | other)
        )

    see()
    for wrong in (
        dict(points=np.zeros((3, 3))),
        dict(outward=np.zeros((2, 2))),
        dict(sector=np.full(3, 10**6)),
        dict(sector=np.full(3, -1)),
        dict(side=np.full(3, 2)),
        dict(real=np.zeros((3, 8))),
        dict(corner=np.zeros(2, dtype=bool)),
        dict(start=np.zeros(2)),
    ):
        with pytest.raises(ValueError):
            see(**wrong)
    for wrong in (dict(points=points.astype(np.float32)), dict(real=real[:, ::2])):
        with pytest.raises(TypeError):
            see(**wrong)
    with pytest.raises(ValueError):
        search.refine(np.zeros(3), np.zeros((3, 2, 2)), index, index, 1e-5)
    flank = np.ascontiguousarray(contact[1].reshape(len(contact[1]), 2, -1, 2))
    every = np.ones((len(flank), 2), dtype=bool)
    for wrong in (
        (flank[1:], every[1:], 2, 8),
        (flank[:, :, 1:].copy(), every, 2, 8),
        (flank, every[1:], 2, 8),
        (flank, every, 1, 8),
    ):
        with pytest.raises(ValueError):
            search.minima(*wrong, 1e-5, 0.01)
    own, other = contact[0]._compiled.nodes
    given = dict(
        flank=flank,
        sector=index,
        side=index,
        station=np.zeros(3),
        real=np.zeros((3, 8)),
        tooth=index.copy(),
        weight=np.zeros((3, 2, own, 2)),
        circular_weight=np.zeros((3, 2, other, 2)),
        sliding=np.zeros((0, 2, own, 2)),
        circular_sliding=np.zeros((0, 2, other, 2)),
    )
    search.meet(**given)
    for name, wrong in (
        ("flank", flank[1:]),
        ("sector", np.full(3, 10**6)),
        ("side", np.full(3, -1)),
        ("station", np.zeros(2)),
        ("real", np.zeros((3, 7))),
        ("tooth", np.zeros(2, dtype=np.int64)),
        ("weight", np.zeros((2, 2, own, 2))),
        ("circular_weight", np.zeros((3, 2, other + 1, 2))),
        ("sliding", np.zeros((2, 2, own, 2))),
    ):
        with pytest.raises(ValueError):
            search.meet(**(given | {name: wrong}))
    arrays = np.zeros((2, 11)), np.zeros((0, 6))
    curves = np.array([0, 2]), np.arange(3.0), np.zeros((2, 6, 2))
    kernels().Flank(*arrays, *curves, 1.0)
    for k, wrong in (
        (0, np.zeros((2, 3))),
        (0, np.zeros((0, 11))),
        (1, np.zeros((1, 5))),
        (2, np.array([0, 3])),
        (2, np.array([3, -1])),
        (2, np.array([2])),
        (3, np.arange(2.0)),
        (4, np.zeros((2, 5, 2))),
    ):
        given = [*arrays, *curves]
        given[k] = wrong
        with pytest.raises(ValueError):
            kernels().Flank(*given, 1.0)
