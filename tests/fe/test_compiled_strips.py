"""Problems with contact strips: their law, and the compiled loop against numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from swgjoint.fe.common import strip_problems
from swgjoint.fe.common.indentation import Indentation, Strips
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.common.pivot_base import next_to, similar_parts
from swgjoint.fe.common.pivoting import TOLERANCE, exchange
from swgjoint.fe.common.strip_problems import EXACT, FEW, PART, StripProblems
from swgjoint.kernels import kernels

LAW = Indentation(softness=6e-10, patch=1.4e-4, radius=1.2e-3)
TEETH, SUPPORTS, STATIONS = 12, 8, 3
"""Teeth with a strip of three points each, and contacts without a strip."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Contacts with gaps g = start + compliance F, and the problems around a state."""

    compliance: np.ndarray
    start: np.ndarray
    problems: StripProblems
    offset: np.ndarray


def drive(seed: int = 1) -> Drive:
    """Springs in parallel and on a common base; some teeth carry force at the start."""
    rng = np.random.default_rng(seed)
    teeth, contacts = TEETH * STATIONS, TEETH * STATIONS + SUPPORTS
    mixed = rng.normal(size=(contacts, contacts))
    compliance = 1e-9 * (np.eye(contacts) + 0.1 * mixed @ mixed.T)
    strip = np.repeat(np.arange(TEETH), STATIONS)
    loaded = np.where(np.arange(TEETH) % 3 == 0, rng.uniform(20.0, 90.0, TEETH), 0.0)
    strips = Strips(law=LAW, strip=strip, force=loaded)
    force = np.zeros(contacts)
    force[:teeth:STATIONS] = loaded
    force[teeth::2] = rng.uniform(10.0, 50.0, force[teeth::2].size)
    closed = force > 0.0
    system = compliance.copy()
    system[:teeth, :teeth] += strips.linearise()[0]
    gap = np.where(closed, 0.0, rng.uniform(1e-8, 5e-7, contacts))
    exchanged, forward = exchange(system, np.flatnonzero(closed))
    by_value, by_gap = rng.normal(size=contacts), rng.normal(size=teeth)
    load = compliance @ rng.normal(size=contacts) * 50.0
    return Drive(
        compliance=compliance,
        start=gap - compliance @ force,
        offset=forward @ (gap - system @ force),
        problems=StripProblems(
            matrix=exchanged,
            closed=closed,
            by_load=forward @ load,
            by_value=by_value,
            strips=strips,
            by_gap=forward[:, :teeth],
            output_by_gap=by_gap,
        ),
    )


def offsets(one: Drive, count: int, size: float = 4e-7) -> tuple[np.ndarray, ...]:
    """Changes of the gaps (count, n) [m] and the offsets that they give (count, m)."""
    rng = np.random.default_rng(2)
    changes = rng.normal(size=(count, TEETH * STATIONS)) * size
    return changes, one.offset + changes @ one.problems.by_gap.T


def test_forces_and_gaps_obey_the_law_of_the_strips():
    """Gaps follow from all forces and the approach; forces act where gaps are shut."""
    one = drive()
    changes, offset = offsets(one, 40)
    # what the linearised law adds at zero force belongs to the start of the system
    found = one.problems.solve(offset)
    assert found.solved.all()
    strips, m = one.problems.strips, len(one.start)
    slack = offset + found.value @ one.problems.matrix.T
    slack += found.approach @ one.problems.by_strip.T
    force = np.where(one.problems.closed, slack, found.value)
    force[np.abs(force) < 1e-6] = 0.0
    assert (force >= 0.0).all() and (force > 0.0).any(axis=0).sum() > 0.6 * m
    teeth, total = changes.shape[1], found.force
    assert np.ptp(total, axis=0).min() > 20.0
    gap = one.start + force @ one.compliance
    start_approach = strips.law.approach(strips.force)
    gap[:, :teeth] += changes
    gap[:, :teeth] += (strips.law.approach(total) - start_approach)[:, strips.strip]
    scale = np.abs(one.start).max()
    # the start has the approach of its own forces
    assert np.abs(gap[force > 0.0]).max() < 1e-7 * scale
    assert gap.min() > -1e-7 * scale


def test_slope_is_the_derivative_by_the_load():
    """By differences of the output, strips included."""
    one = drive()
    _, offset = offsets(one, 20)
    step, problems = 1e-5, one.problems

    def output(load: float) -> np.ndarray:
        there = problems.solve(offset + load * problems.by_load)
        b = problems.output_by_strip
        return there.value @ problems.by_value + there.approach @ b

    found = problems.solve(offset)
    slope = (output(step) - output(-step)) / (2.0 * step)
    assert np.median(np.abs(slope / found.slope - 1.0)) < 1e-5
    without = replace(problems, strips=None).solve(offset)
    assert np.abs(without.slope / found.slope - 1.0).max() > 0.05


@pytest.mark.skipif(kernels() is None, reason="built without compiled loops")
@pytest.mark.parametrize("indents", [True, False])
@pytest.mark.parametrize("few", [0, FEW])
def test_compiled_loop_gives_what_numpy_gives(monkeypatch, indents, few):
    """Unknowns, active sets, approaches and slopes, also from a guess or a base."""
    monkeypatch.setattr(strip_problems, "FEW", few)
    one = drive()
    problems = one.problems
    if not indents:
        problems = replace(problems, strips=None)
    _, offset = offsets(one, PART + 7)
    ours = problems.solve(offset)
    again = problems.solve(offset, ours.active)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    theirs = problems.solve(offset)
    assert np.array_equal(ours.active, theirs.active)
    assert ours.active.any() and theirs.solved.all()
    for one_of in (ours, again):
        for key in ("value", "approach", "force", "slope"):
            wanted = getattr(theirs, key)
            scale = np.abs(wanted).max(initial=1e-300)
            # both end when an approach is right to 1e-14 m of 1e-7 m
            limit = (1e-6 if indents else 1e-11) * scale
            assert np.abs(getattr(one_of, key) - wanted).max(initial=0.0) < limit


@pytest.mark.parametrize("guessed", [False, True])
def test_results_do_not_depend_on_the_number_of_threads(monkeypatch, guessed):
    """Groups of fixed length are solved one after another."""
    import os

    monkeypatch.setattr(strip_problems, "GROUP", 2)
    monkeypatch.setattr(strip_problems, "TOGETHER", PART)
    one = drive()
    _, offset = offsets(one, 5 * PART)
    start = one.problems.solve(offset).active if guessed else None
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    alone = one.problems.solve(offset, start)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert np.array_equal(one.problems.solve(offset, start).value, alone.value)


def test_parts_are_similar():
    """Every problem once; the spread in a part is a fraction of that of all."""
    rng = np.random.default_rng(3)
    place = rng.normal(size=(500, 2))
    offset = place @ rng.normal(size=(2, 40))
    parts = similar_parts(offset, 20)
    assert sorted(np.concatenate(parts).tolist()) == list(range(500))
    assert max(map(len, parts)) <= 20
    inside = np.mean([place[part].var(axis=0).sum() for part in parts])
    assert inside < 0.15 * place.var(axis=0).sum()


@pytest.mark.parametrize("how", ["", "numpy"])
def test_unsolvable_problems_are_nan(monkeypatch, how):
    """A singular matrix, beside a problem that needs no exchange."""
    monkeypatch.setenv("SWGJOINT_KERNELS", how)
    problems = StripProblems(
        matrix=np.array([[1.0, 1.0], [1.0, 1.0]]),
        closed=np.zeros(2, dtype=bool),
        by_load=np.ones(2),
        by_value=np.ones(2),
        strips=None,
        by_gap=np.eye(2),
        output_by_gap=np.ones(2),
    )
    found = problems.solve(np.array([[1.0, 1.0], [-1.0, -1.0]]))
    assert found.solved[0] and not found.value[0].any() and not found.active[0].any()
    assert not found.solved[1] and np.isnan(found.slope[1])


def test_each_problem_comes_after_the_nearest_that_is_known():
    """Prim's tree against a search of all pairs; the first row has none before it."""
    offset = np.random.default_rng(4).normal(size=(23, 5))
    order, before = next_to(offset)
    assert sorted(order) == list(range(23)) and order[0] == 0 and before[0] == -1
    apart = np.linalg.norm(offset[order, None] - offset[order], axis=-1)
    for k in range(1, 23):
        known = apart[:k, k:]
        assert apart[before[k], k] == known.min()
    assert [one.tolist() for one in next_to(offset[:1])] == [[0], [-1]]


def test_offsets_of_a_base_are_those_of_the_exchanged_problems():
    """The exchanged unknowns and slacks solve the same equations."""
    one = drive()
    rng, origin = np.random.default_rng(6), one.problems._origin
    ends = rng.uniform(size=len(origin.matrix)) < 0.4
    base = origin.exchange(ends)
    value = rng.normal(size=(3, ends.size))
    offset = rng.normal(size=value.shape)
    slack = offset + value @ origin.matrix.T
    unknown, result = np.where(ends, slack, value), np.where(ends, value, slack)
    found = base.offset_of(offset) + unknown @ base.matrix.T
    assert np.abs(found - result).max() < 1e-12 * np.abs(result).max()
    assert np.array_equal(origin.offset_of(offset), offset)


def test_other_lines_of_the_strips_change_no_solution():
    """Slacks and outputs by the approaches beyond the new lines, also exchanged."""
    problems = drive().problems
    rng, origin = np.random.default_rng(7), problems._origin
    force = rng.uniform(10.0, 80.0, size=(5, TEETH))
    base = problems._with_lines_at(force)
    line = problems.strips.line + base.line
    assert line == pytest.approx(LAW.slope(force.mean(axis=0)), rel=1e-12)
    load = rng.normal(size=(3, 1))
    value = rng.normal(size=(3, len(origin.matrix)))
    beyond = rng.normal(size=(3, TEETH)) * 1e-7
    # the load alone, approaches alone, all together
    value[:2], beyond[0], load[1] = 0.0, 0.0, 0.0
    closed = problems.closed
    by_contact = np.zeros((TEETH, closed.size))
    by_contact[problems.strips.strip, np.arange(TEETH * STATIONS)] = 1.0
    by_contact *= problems._scale ** np.where(closed, 1.0, -1.0)
    # w = q + M v + B (line F + beyond), with the forces F of the slacks and unknowns
    taken = origin.by_strip * base.line
    right = load * origin.by_load + beyond @ origin.by_strip.T
    right += value @ (origin.matrix + taken @ (by_contact * ~closed)).T
    system = np.eye(closed.size) - taken @ (by_contact * closed)
    slack = np.linalg.solve(system, right.T).T
    approach = beyond + base.line * (np.where(closed, slack, value) @ by_contact.T)
    output = value @ origin.by_value + approach @ origin.output_by_strip
    for one in (base, base.exchange(rng.uniform(size=closed.size) < 0.4)):
        inside = np.isin(np.arange(closed.size), one.inside)
        unknown, wanted = np.where(inside, [slack, value], [value, slack])
        offset = one.offset_of(load * origin.by_load)
        limit = 1e-11 * np.abs(offset).max()
        assert offset == pytest.approx(load * one.by_load, abs=limit)
        found = offset + unknown @ one.matrix.T + beyond @ one.by_strip.T
        assert found == pytest.approx(wanted, abs=1e-11 * np.abs(wanted).max())
        outputs = unknown @ one.by_value + beyond @ one.output_by_strip
        outputs += one.slope * load[:, 0]
        assert outputs == pytest.approx(output, rel=1e-9)


@pytest.mark.skipif(kernels() is None, reason="built without compiled loops")
def test_problems_with_good_guesses_are_solved_together():
    """None of them is left to the solver for one problem."""
    problems = drive().problems
    _, offset = offsets(drive(), 40)
    found = problems.solve(offset)
    usual = found.active.mean(axis=0) > 0.5
    base = problems._with_lines_at(found.force).exchange(usual)
    scaled = offset / problems._scale
    tolerance, none = TOLERANCE * np.abs(scaled).max(axis=1), np.zeros(0, np.int64)
    own = base.offset_of(scaled)
    values, approach = np.empty(own.shape), np.empty((40, TEETH))
    slope, solved = np.empty(40), np.empty(40, dtype=bool)
    outputs = found.active ^ usual, values, approach, slope, solved
    options = EXACT, 20, 60, none
    together = problems._native(base).solve(own, tolerance, *options, *outputs)
    assert together == 40 and solved.all()
    assert slope + base.slope == pytest.approx(found.slope, rel=1e-6)


@pytest.mark.skipif(kernels() is None, reason="built without compiled loops")
@pytest.mark.parametrize("size", [1e-6, 1e-4])
def test_problems_solved_together_are_as_if_alone(size):
    """Good and wild guesses side by side; errors small and beyond those of the base."""
    problems = drive().problems
    _, offset = offsets(drive(), 2 * PART, size)
    wild = np.random.default_rng(3).uniform(size=offset.shape) < 0.5
    wild[::3] = problems.solve(offset[::3]).active
    found = problems.solve(offset, wild)
    alone = [problems.solve(offset[k : k + 1]) for k in range(0, len(offset), 5)]
    assert found.solved.all()
    for key in ("active", "value", "approach", "slope"):
        wanted = np.concatenate([getattr(one, key) for one in alone]).astype(float)
        ours = getattr(found, key)[::5].astype(float)
        assert np.abs(ours - wanted).max() <= 1e-6 * np.abs(wanted).max()


@pytest.mark.skipif(kernels() is None, reason="built without compiled loops")
@pytest.mark.parametrize("teeth", [1, 5])
def test_factors_are_kept_over_many_changes_of_contact(teeth):
    """Solutions from far starts, with errors of all sizes, are those from near ones."""
    problems = drive().problems
    sizes = 10.0 ** np.linspace(-8.0, -5.0, 40)
    offset = np.concatenate([offsets(drive(), 8, size)[1] for size in sizes])
    ours = problems.solve(offset)
    far = np.random.default_rng(teeth).uniform(size=ours.active.shape) < 0.2 * teeth
    again = problems.solve(offset, far)
    assert ours.solved.all() and again.solved.all()
    assert np.array_equal(ours.active, again.active)
    assert np.ptp(ours.active.sum(axis=1)) > 15
    scale = np.abs(ours.value).max(axis=1)
    # an approach is right to EXACT, a force to EXACT by the stiffness of a contact
    limit = 1e-6 * scale + EXACT / np.diag(drive().compliance).min()
    assert (np.abs(again.value - ours.value).max(axis=1) <= limit).all()
    slack = offset + ours.value @ problems.matrix.T
    slack += ours.approach @ problems.by_strip.T
    size = np.sqrt(np.diag(problems.matrix))
    residual = np.abs(np.where(ours.active, slack, 0.0) / size).max(axis=1)
    assert (residual <= 1e-12 * np.abs(offset / size).max(axis=1)).all()


def path_problem(seed: int, contacts: int = 30) -> Influence:
    """A linearised drive, half of whose contacts carry force."""
    rng = np.random.default_rng(seed)
    mixed = rng.normal(size=(contacts, contacts))
    compliance = 1e-9 * (np.eye(contacts) + 0.1 * mixed @ mixed.T)
    closed = np.arange(contacts) % 2 == 0
    force = np.where(closed, rng.uniform(1.0, 50.0, contacts), 0.0)
    gap = np.where(closed, 0.0, rng.uniform(1e-9, 2e-7, contacts))
    matrix, forward = exchange(compliance, np.flatnonzero(closed))
    return Influence(
        sector=np.arange(contacts),
        tooth=np.arange(contacts),
        direction=np.zeros((2, contacts, 2)),
        by_tilt=np.zeros((contacts, 2)),
        closed=closed,
        torque=0.0,
        matrix=matrix,
        slack=forward @ (gap - compliance @ force),
        by_gap=forward,
        by_torque=forward @ compliance @ rng.normal(size=contacts) * 2.0,
        angle=0.0,
        angle_by_value=rng.normal(size=contacts),
        angle_by_gap=np.zeros(contacts),
        angle_by_torque=-1e-4,
    )


@pytest.mark.skipif(kernels() is None, reason="no compiled loops")
@pytest.mark.parametrize("seed", range(20))
def test_the_compiled_path_over_torque_is_that_of_numpy(seed, monkeypatch):
    """The same contacts change at the same torques, with the same compliances."""
    drive, numbers = path_problem(seed), np.arange(30)
    found = drive.changes(-60.0, 60.0, numbers)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    twin = drive.changes(-60.0, 60.0, numbers)
    assert len(found.contact) > 10
    np.testing.assert_array_equal(found.contact, twin.contact)
    np.testing.assert_allclose(found.torque, twin.torque, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.compliance, twin.compliance, rtol=1e-9)


def test_a_path_of_contacts_that_hold_nothing_is_refused():
    """Two contacts that do the same cannot both carry force."""
    drive = path_problem(1)
    same = replace(
        drive,
        matrix=np.zeros_like(drive.matrix),
        slack=np.zeros(30),
        by_torque=np.where(np.arange(30) == 3, -1.0, 1.0),
    )
    with pytest.raises(np.linalg.LinAlgError):
        same.changes(-1.0, 1.0, np.arange(30))


def test_contacts_change_back_while_as_many_others_change(monkeypatch):
    """Five contacts become active in the place of five others, and back again."""
    rng = np.random.default_rng(4)
    count, kept, moved = 44, 12, 5
    mixed = rng.normal(size=(count, count))
    none = np.zeros((count, 0))
    problems = StripProblems(
        matrix=np.eye(count) + 1e-3 * mixed @ mixed.T,
        closed=np.zeros(count, dtype=bool),
        by_load=rng.normal(size=count),
        by_value=rng.normal(size=count),
        strips=None,
        by_gap=none,
        output_by_gap=none[0],
    )
    both, first, second = (np.zeros(count, dtype=bool) for _ in range(3))
    both[:kept] = True
    second[kept : kept + moved] = True
    first[kept + moved : kept + 2 * moved] = True
    active = np.array([both | first, both | second, both | first])
    offset = np.where(active, -1.0, 1.0) * rng.uniform(0.9, 1.0, size=active.shape)
    start = active.copy()
    start[0] = both
    ours = problems.solve(offset, start)
    assert np.array_equal(ours.active, active)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    theirs = problems.solve(offset, start)
    assert ours.value == pytest.approx(theirs.value, rel=1e-12)
    assert ours.slope == pytest.approx(theirs.slope, rel=1e-12)
