"""Many sets of errors at once: guesses and left-out contacts change no result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from swgjoint.fe.common import strip_problems
from swgjoint.fe.common.indentation import Indentation, Strips
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.common.pivot_base import similar_sets
from swgjoint.fe.common.pivoting import TOLERANCE, exchange
from swgjoint.fe.tolerances import sampling, superposition
from swgjoint.fe.tolerances.near_contacts import NearContacts
from swgjoint.fe.tolerances.rest import Rest
from swgjoint.fe.tolerances.state_guess import NearbyPositions, StateGuess
from swgjoint.fe.tolerances.superposition import superpose_many, superpose_plainly

LAW = Indentation(softness=6e-10, patch=1.4e-4, radius=1.2e-3)
TEETH, SUPPORTS = 16, 24
SETS, CHUNK = 600, 100


def influence(seed: int = 1, torque: float = 0.0) -> Influence:
    """A drive whose teeth have one strip each; some contacts carry force.

    Half of the supports are pressed so much that no error lifts them off, and half of
    the open teeth are too far apart.
    """
    rng = np.random.default_rng(seed)
    contacts = TEETH + SUPPORTS
    mixed = rng.normal(size=(contacts, contacts))
    compliance = 1e-9 * (np.eye(contacts) + 0.05 * mixed @ mixed.T)
    loaded = np.where(np.arange(TEETH) % 3 == 0, rng.uniform(20.0, 90.0, TEETH), 0.0)
    strips = Strips(law=LAW, strip=np.arange(TEETH), force=loaded)
    force = np.concatenate([loaded, rng.uniform(10.0, 60.0, SUPPORTS)])
    force[TEETH::2] = 1e4
    force[TEETH + 1 :: 4] = 0.0
    closed = force > 0.0
    system = compliance.copy()
    system[:TEETH, :TEETH] += strips.linearise()[0]
    gap = np.where(closed, 0.0, rng.uniform(1e-8, 5e-7, contacts))
    gap[:TEETH][(loaded == 0.0) & (np.arange(TEETH) % 2 == 0)] = 1e-4
    matrix, forward = exchange(system, np.flatnonzero(closed))
    by_value = rng.normal(size=contacts)
    return Influence(
        sector=np.arange(TEETH),
        tooth=np.arange(TEETH),
        direction=np.zeros((2, TEETH, 2)),
        by_tilt=np.zeros((TEETH, 2)),
        closed=closed,
        torque=torque,
        matrix=matrix,
        slack=forward @ gap + np.where(closed, force, 0.0),
        by_gap=forward[:, :TEETH],
        by_torque=forward @ compliance @ rng.normal(size=contacts),
        angle=0.0,
        angle_by_value=by_value,
        angle_by_gap=np.where(closed[:TEETH], by_value[:TEETH], 0.0),
        angle_by_torque=-1e-4,
        strips=strips,
    )


def errors(count: int = SETS) -> np.ndarray:
    """Changes of the tooth gaps [m] that depend on five numbers, and some scatter."""
    rng = np.random.default_rng(2)
    few = rng.normal(size=(count, 5)) @ rng.normal(size=(5, TEETH))
    return 1e-7 * few + 1e-8 * rng.normal(size=(count, TEETH))


@pytest.fixture(params=[4, 64])
def few_first(request, monkeypatch) -> Iterator[int]:
    """Few sets from which to learn: with four, most changing contacts are missed."""
    monkeypatch.setattr(superposition, "FIRST", request.param)
    yield request.param


@pytest.mark.parametrize("how", ["", "numpy"])
@pytest.mark.parametrize("part", [16, 128])
def test_guesses_change_no_result(monkeypatch, few_first, how, part):
    """Angle, potential and compliance at two torques are those chunk by chunk.

    Parts smaller than a chunk are solved eight at a time.
    """
    monkeypatch.setenv("SWGJOINT_KERNELS", how)
    monkeypatch.setattr(strip_problems, "PART", part)
    change, ticks, before = errors(), [], []
    options = {"chunk": CHUNK, "tick": lambda: ticks.append(1)}
    for torque in (5.0, 8.0):
        at = influence(torque=torque)
        wanted = superpose_plainly(at, change, torque + 1.0, None, **options)
        assert 2.0 < wanted.active.sum(axis=1).mean() < 20.0
        ticks.clear()
        found = superpose_many(at, change, torque + 1.0, before, **options)
        assert len(ticks) == SETS // CHUNK
        before = [found.features]
        assert np.array_equal(found.active, wanted.active)
        for key in ("output_angle", "potential", "compliance"):
            ours, theirs = getattr(found, key), getattr(wanted, key)
            assert np.abs(ours - theirs).max() < 1e-7 * np.ptp(theirs)


def test_a_contact_that_is_missing_is_noticed():
    """Sets in which a left-out contact closes or opens are marked, and no others."""
    at, change = influence(), errors()
    whole = at.respond(change, 3.0)
    changing = whole.active.any(axis=0)
    assert NearContacts.choose(at, changing).respond(change, 3.0, None)[1].all()
    rare = np.flatnonzero(changing & (np.arange(len(changing)) >= TEETH))
    rare = rare[whole.active[:, rare].sum(axis=0).argmin()]
    changing[rare] = False
    near = NearContacts.choose(at, changing)
    assert rare in near.others
    found, right = near.respond(change, 3.0, None)
    assert 0 < (~right).sum() < SETS // 2
    assert np.array_equal(~right, whole.active[:, rare])
    # a single set, whose inputs have no range
    for k in [*np.flatnonzero(~right)[:5], *np.flatnonzero(right)[:5]]:
        assert near.respond(change[k : k + 1], 3.0, None)[1] == right[k]
    apart = np.abs(found.output_angle - whole.output_angle)
    good = apart < 1e-7 * np.ptp(whole.output_angle)
    assert good[right].all() and not good[~right].all()


@pytest.mark.parametrize(("part", "accepted"), [(0.5, True), (2.0, False)])
def test_a_left_out_contact_may_overlap_by_the_tolerance(part, accepted):
    """Single precision, which is too coarse to tell, decides about no set.

    In every set the gap of one open tooth is moved to an overlap of half or twice the
    tolerance.
    """
    at, change = influence(), errors()
    whole = at.respond(change, 3.0)
    near = NearContacts.choose(at, whole.active.any(axis=0))
    k = near.others[0]
    assert k < TEETH
    scale = np.sqrt(np.diag(at.matrix))
    begin = (at.slack + 3.0 * at.by_torque) / scale
    overlap = part * TOLERANCE * np.abs(begin).max()
    change[:, k] += scale[k] * (whole.margin[:, k] - overlap)
    _, right = near.respond(change, 3.0, None)
    assert np.array_equal(right, np.full(SETS, accepted))


def test_the_solution_before_makes_better_guesses():
    """Learned from a fifth of the sets; an equal share of active contacts is no guess.

    The drive before has other contacts.
    """
    change = errors()
    before = influence(seed=1, torque=0.0)
    earlier = before.respond(change, 1.0).margin
    at = replace(before, slack=before.slack * 1.1)
    margin = at.respond(change, 2.0).margin
    learn, other = slice(0, SETS // 5), slice(SETS // 5, None)
    features = StateGuess.fit(change[learn], [], earlier[learn]).features(earlier)
    wrong = []
    for known in ([], [features]):
        first, rest = ([one[part] for one in known] for part in (learn, other))
        guess = StateGuess.fit(change[learn], first, margin[learn])
        active = guess.active(change[other], rest)
        wrong.append((active != (margin[other] > 0.0)).sum(axis=1).mean())
    usual = (margin[learn] > 0.0).mean(axis=0) > 0.5
    plain = (usual != (margin[other] > 0.0)).sum(axis=1).mean()
    assert wrong[1] < 0.7 * wrong[0] < 0.7 * plain


def test_features_are_margins_in_steps_up_to_the_cut():
    """A margin at the cut is 127 steps, a larger one as many, a missing one none."""
    margin = influence().respond(errors(50), 2.0).margin
    guess = StateGuess.fit(errors(50), [], margin)
    cut = guess.most
    row = np.array([[0.6 * cut, -cut, 9.0 * cut, np.nan]])
    seen = replace(guess, varied=np.ones(4, dtype=bool)).features(row)
    assert seen.tolist() == [[76, -127, 127, 0]]


def test_contacts_close_to_a_change_are_guessed():
    """Margins of a thousandth of the cut, which features round to zero."""
    change = np.random.default_rng(6).normal(size=(400, 2))
    margin = change * [1e-3, 1.0]
    guess = StateGuess.fit(change, [], margin)
    assert not guess.features(margin)[:, 0].any()
    wrong = guess.active(change, []) != (margin > 0.0)
    assert (wrong.mean(axis=0) < 0.05).all()


def test_lines_of_the_strips_touch_the_law_at_usual_forces(monkeypatch):
    """The mean forces of the loaded strips of solved sets, and no set solved for them.

    The results are those with lines from a few sets of the same problems.
    """
    monkeypatch.setattr(strip_problems, "PART", 64)
    at, change = influence(), errors(200)
    whole = at.respond(change, 3.0)
    changing, force = whole.active.any(axis=0), whole.force.copy()
    force[3] = np.nan  # an unsolved set
    near = NearContacts.choose(at, changing, force).near
    loaded = np.nan_to_num(force)
    wanted = loaded.sum(axis=0) / np.maximum((loaded > 0.0).sum(axis=0), 1)
    assert near.strips.usual == pytest.approx(wanted, rel=1e-12)
    start = whole.active[:, NearContacts.choose(at, changing).contacts]
    plain = NearContacts.choose(at, changing).near.respond(
        change[:, near.sector], 3.0, start
    )
    monkeypatch.setattr(strip_problems, "SAMPLES", None)
    found = near.respond(change[:, near.sector], 3.0, start)
    apart = np.abs(found.output_angle - plain.output_angle).max()
    assert apart < 1e-7 * np.ptp(plain.output_angle)


def test_positions_nearby_are_those_before_and_of_the_next_pitch():
    """Features of the latest position and, one pitch on, of the first one."""
    rng = np.random.default_rng(3)
    stored = [rng.integers(-100, 100, size=(7, 4), dtype=np.int8) for _ in range(3)]
    nearby = NearbyPositions()
    assert nearby.features(5.0) == []
    for features in stored:
        nearby.store(5.0, features)
    before, next_pitch = nearby.features(5.0)
    assert np.array_equal(before, stored[2])
    assert np.array_equal(next_pitch[:-1], stored[0][1:])
    assert np.array_equal(next_pitch[-1], stored[0][0])
    assert nearby.features(8.0) == []


def position(slack: float) -> Rest:
    """A position of the drive, linearised at 0, 1 and 2 N·m of either sign."""
    state, at = SimpleNamespace(energy=0.0), influence()

    def under(torque: float) -> Influence:
        wider = slack * (1.0 + 0.05 * torque)
        return replace(at, torque=torque, slack=at.slack * wider)

    loaded = {t: (state, under(t)) for t in (-2.0, -1.0, 1.0, 2.0)}
    return Rest(state=state, at=under(0.0), loaded=loaded)


def test_positions_nearby_change_no_result(monkeypatch):
    """Superposition at a second position, with and without solutions of the first."""
    monkeypatch.setattr(sampling, "CHUNK", CHUNK)
    monkeypatch.setattr(superposition, "FIRST", 64)
    change, levels, nearby = errors(), np.array([1.0, 2.0]), NearbyPositions()
    rest = position(1.1)
    sampling.respond_over_torque(
        position(1.0), lambda _: change, levels, 0.1, nearby=nearby
    )
    assert {-2.0, -1.0, 0.0, 1.0, 2.0} <= set(nearby.latest)
    tables = [
        sampling.respond_over_torque(rest, lambda _: change, levels, 0.1, nearby=known)[
            0
        ]
        for known in (None, nearby)
    ]
    # without load, differences of nearly equal energies are left
    plain, guessed = (table[:, [0, 1, 3, 4]] for table in tables)
    apart = np.abs(guessed - plain).max(axis=-1)
    assert (apart < 1e-7 * np.ptp(plain, axis=-1)).all()
    assert nearby.latest[2.0] is not nearby.first[2.0]


def test_similar_sets_are_parts_of_all_rows():
    """Every row once, and sets in a part differ less than all sets do."""
    rng = np.random.default_rng(5)
    active = rng.normal(size=(300, 3)) @ rng.normal(size=(3, 40)) > 0.5
    parts = similar_sets(active, 20)
    assert sorted(np.concatenate(parts)) == list(range(300))
    assert max(map(len, parts)) <= 20
    inside = np.mean([active[part].var(axis=0).sum() for part in parts])
    assert inside < 0.5 * active.var(axis=0).sum()
    same = similar_sets(np.ones((50, 4), dtype=bool), 20)
    assert sorted(np.concatenate(same)) == list(range(50))
