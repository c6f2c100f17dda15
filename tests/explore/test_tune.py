"""Tuning: the textbook rule, cost, budget, resumption, and what it gains."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from messages import naming

import swgjoint.envs  # noqa: F401
from swgjoint.control.motor_side import MotorPID, ideal_plan
from swgjoint.errors import InputError
from swgjoint.explore.tune.cost import Trials, environment_named
from swgjoint.explore.tune.gains import (
    PLANNED,
    anti_resonance,
    parts_of,
    weight_plan,
)
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.search import JOURNAL
from swgjoint.explore.tune.tune import tune
from swgjoint.json_text import json_text
from swgjoint.sim.controller import ReadingAge
from swgjoint.units import arcmin
from swgjoint.view.plots.tune import claims, picture, write_files

NAME = "swgjoint/JointTracking-v0"
SHORT = {"episode_s": 0.5, "max_speed_rad_s": 0.3}
PD, FLEXIBLE = PLANNED["pd"], PLANNED["pd-flexible"]


@pytest.fixture(scope="module")
def trials():
    """Three candidates on two seeds."""
    made = Trials(NAME, {"randomise": True, **SHORT}, seeds=(4, 9), candidates=3)
    yield made
    made.close()


def settings(**changes):
    """A run of few candidates, which ends in seconds."""
    keys = {
        "environment": "JointTracking-v0",
        "controller": "pd-feedforward",
        "evaluations": 24,
        "arguments": SHORT,
        "population": 6,
        "training": 2,
        "held_out": 3,
    }
    return TuneSettings(**(keys | changes))


def test_textbook_gains_by_hand(trials):
    """A third of sqrt(K/J_l), damping 0.7, on motor and link together."""
    joints = trials.joints
    stiffness, link, rotor = joints.drives[0].mean_stiffness, 1.0, 1e-4
    omega = np.sqrt(stiffness / link) / 3.0
    inertia = rotor + link / 100.0**2
    assert anti_resonance(joints) == pytest.approx(3.0 * omega / (2.0 * np.pi))
    rule = {p.key: np.array([p.neutral]) for p in PD.parameters(joints, None)}
    gains = PD.gains(rule, joints)
    assert gains["stiffness_Nm_rad"] == pytest.approx(inertia * omega**2)
    assert gains["damping_Nms_rad"] == pytest.approx(1.4 * omega * inertia)
    # poles of the rigid joint under these gains
    poles = np.roots(
        [inertia, gains["damping_Nms_rad"][0], gains["stiffness_Nm_rad"][0]]
    )
    np.testing.assert_allclose(np.abs(poles), omega)
    np.testing.assert_allclose(-poles.real / omega, 0.7)


def test_cost_is_that_of_the_single_environment(trials):
    """Candidates side by side cost what each costs alone, by the stated formula."""
    frequency = np.array([8.0, 14.0, 30.0])
    values = {"frequency_Hz": frequency, "damping_ratio": np.full(3, 0.7)}
    got = trials.costs(PD, values)
    env = gymnasium.make(NAME, randomise=True, **SHORT).unwrapped
    observation, _ = env.reset(seed=9)
    task, terms = env.task, []
    controller = MotorPID(ideal_plan, frequency=14.0, damping_ratio=0.7)
    # nobody tells a tuned controller how old its readings are
    controller.start(replace(task, reading_age=ReadingAge()))
    for k in range(500):
        torque = controller.torque(k, env.read_measurements(observation))
        action = torque / task.joints.torque_limit
        observation, _, _, over, info = env.step(action)
        share = info["motor_torque_Nm"] / task.joints.torque_limit[0]
        terms.append(info["link_error_arcmin"] ** 2 + 0.1 * (3.0 * share) ** 2)
    assert over
    np.testing.assert_allclose(got[1, 1], np.sqrt(np.mean(terms)) * arcmin, rtol=1e-9)
    np.testing.assert_array_equal(trials.costs(PD, values), got)


def test_broken_limits_cost_a_finite_worst(trials):
    """A loop that diverges costs more than any that does not, and it is a number."""
    values = {
        "frequency_Hz": np.array([14.0, 400.0, 4000.0]),
        "damping_ratio": np.array([0.7, 0.001, 30.0]),
    }
    costs, trace = trials.cost_and_traces(PD, values)
    assert np.isfinite(costs).all() and costs.max() <= trials.worst
    assert (costs[1:].min(axis=0) > 50.0 * costs[0]).all()
    broken = np.isnan(trace.error).any(axis=0).reshape(3, 2)
    assert broken.tolist() == [[False] * 2, [True] * 2, [True] * 2]


def test_what_is_not_a_number_costs_the_worst(trials, monkeypatch):
    """Readings that are lost do not spread to the cost."""
    core = trials.env.core
    error, effort = core.deviation()
    lost = np.full_like(error, np.nan), effort
    monkeypatch.setattr(core, "deviation", lambda: lost)
    values = {"frequency_Hz": np.full(3, 14.0), "damping_ratio": np.full(3, 0.7)}
    costs = trials.costs(PD, values)
    np.testing.assert_allclose(costs, trials.worst)


def test_shares_of_one_are_the_plan_itself(trials):
    """Without tuning, the weighted plan is that of the control package."""
    neutral = {
        p.key: np.full((1, 1), p.neutral)
        for p in FLEXIBLE.parameters(trials.joints, None)
    }
    trials.env.reset(seed=[4, 9] * 3)
    task = trials.env.task
    plan = weight_plan(parts_of(FLEXIBLE, task), task, neutral)
    wanted = FLEXIBLE.plan(task)
    for name in ("angle", "speed", "torque"):
        # last digits of angles of tens of rad, through sums in another order
        np.testing.assert_allclose(
            getattr(plan, name), getattr(wanted, name), rtol=0, atol=1e-10
        )


@pytest.mark.parametrize(("level", "friction"), [("linear", True), ("full", False)])
def test_a_search_knows_the_drive_that_is_simulated(level, friction):
    """Gains are tuned about a plan without the friction that the episodes lack."""
    arguments = {"level": level, "friction": friction, **SHORT}
    made = Trials(NAME, arguments, seeds=(4,), candidates=1)
    made.env.reset(seed=[4])
    (drive,) = made.env.task.joints.drives
    assert drive.friction is None
    assert bool(drive.kinematic_error.any()) == (level == "full")
    made.close()


def test_old_readings_are_held_against_the_plan_of_then(trials):
    """An age of one period is the plan of one period before, to second order."""
    trials.env.reset(seed=[4, 9] * 3)
    task = trials.env.task
    plan = FLEXIBLE.plan(task)
    got = weight_plan(
        parts_of(FLEXIBLE, task), task, {"reading_age_s": np.full((6, 1), task.period)}
    )
    # second order: a share of a period over the time that the motion takes to change
    for name, share in (("angle", 0.05), ("speed", 0.1)):
        now, then = getattr(plan, name)[1:], getattr(plan, name)[:-1]
        off, moved = getattr(got, name)[1:] - then, now - then
        assert np.abs(off).max() < share * np.abs(moved).max()
    np.testing.assert_allclose(got.torque, plan.torque, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "optimiser",
    ["de", *(pytest.param(name, marks=pytest.mark.slow) for name in ("cma", "optuna"))],
)
def test_same_seed_same_result_and_resumed_runs_too(optimiser, tmp_path):
    """A run that was interrupted ends with the same bits as one that was not."""
    if optimiser != "de":
        pytest.importorskip(optimiser)

    def interrupted(stage, done, total):
        if stage == "tuning pd-feedforward" and done >= 12:
            raise KeyboardInterrupt

    chosen = settings(optimiser=optimiser)
    whole = tune(chosen, folder=tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        tune(chosen, folder=tmp_path / "cut", progress=interrupted)
    begun = np.load(tmp_path / "cut" / JOURNAL)
    assert begun["named.places"].shape == (2, 6, 6)
    resumed = tune(chosen, folder=tmp_path / "cut", resume=True)
    texts = []
    for found in (whole, resumed):
        figures = found.to_json()
        figures.pop("wall_s")
        texts.append(json_text(figures))
    assert texts[0] == texts[1]
    for name, search in whole.searches.items():
        other = resumed.searches[name]
        np.testing.assert_array_equal(search.places, other.places)
        np.testing.assert_array_equal(search.costs, other.costs)
    assert figures["evaluations"] == 24
    assert {k: s.evaluations for k, s in whole.searches.items()} == {
        "pd": 6,
        "named": 18,
    }


def test_the_error_has_a_share_of_its_own(trials):
    """Without kinematic error, the plan is that of the mean curve alone."""
    trials.env.reset(seed=[4, 9] * 3)
    task = trials.env.task
    even, uneven = parts_of(FLEXIBLE, task)
    got = weight_plan((even, uneven), task, {"error_share": np.zeros((6, 1))})
    np.testing.assert_allclose(got.angle, even.angle, rtol=0, atol=1e-12)
    assert np.abs(uneven.angle).max() > 1e-3
    assert not parts_of(PD, task)[1].angle.any()


def test_seeds_differ():
    """Another seed begins another search, on other episodes."""
    one, other = (settings(seed=k, controller="pd", evaluations=12) for k in (0, 1))
    assert not set(sum(one.seeds, ())) & set(sum(other.seeds, ()))
    best = [tune(x).best.values for x in (one, other)]
    assert best[0] != best[1]


def test_minutes_end_a_search():
    """Time that is too short for more is one generation each, and the figures."""
    found = tune(settings(evaluations=None, minutes=0.01))
    assert {k: s.evaluations for k, s in found.searches.items()} == {
        "pd": 6,
        "named": 6,
    }
    # the start is among them, but for what no logarithmic scale reaches: integral time
    # without end and readings of now
    _, _, ruled, best = (one.training.mean() for one in found.candidates)
    assert best <= 1.02 * ruled


def test_report_states_what_feed_forward_alone_brings(tmp_path):
    """Page, picture and figures; the claim is taken apart."""
    found = tune(settings())
    names = [one.name for one in found.candidates]
    assert names == [
        "pd by rule",
        "pd tuned",
        "pd-feedforward by rule",
        "pd-feedforward tuned",
    ]
    for one in found.candidates:
        assert one.held_out.shape == (3,) and np.isfinite(one.held_out).all()
    training, held_out = found.settings.seeds
    assert not set(training) & set(held_out)
    lines = claims(found)
    assert "pd-feedforward by rule" in lines[2] and "gains of PD alone" in lines[1]
    files = write_files(found, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "Cost by held-out seed" in page and "data:image/png" in page
    assert "Joints" not in page and len(files) == 3
    assert (tmp_path / "tune.png").read_bytes()[:4] == b"\x89PNG"


def test_the_picture_shows_every_cost(monkeypatch):
    """Also one far above that of the baseline, and costs that are all equal."""
    figures = []
    monkeypatch.setattr(
        "swgjoint.view.plots.tune.png", lambda f, **_: figures.append(f)
    )
    found = tune(settings())
    bad = replace(found.candidates[2], held_out=1e3 * found.baseline.held_out)
    far = (*found.candidates[:2], bad, found.best)
    search = list(found.searches.values())[-1]
    level = found.baseline.training.mean()
    search = replace(search, costs=[np.full_like(x, level) for x in search.costs])
    pair = (found.baseline, found.best)
    same = {"candidates": pair, "searches": {"pd-feedforward": search}}
    for changes in ({"candidates": far}, same):
        picture(replace(found, **changes))
        for ax in figures[-1].axes[:2]:
            low, high = ax.get_ylim()
            assert 1.1 * low < high
            for line in ax.lines:
                y = np.asarray(line.get_ydata(), float)
                assert np.all((low < y) & (y < high))


def test_names_that_are_not_there():
    """Unknown environments, controllers and optimisers name what is accepted."""
    assert environment_named(NAME) == environment_named("JointTracking-v0") == NAME
    for changes, text in (
        (
            {"environment": "JointTraking-v0"},
            ("environment", "'JointTraking-v0'", "JointTracking-v0"),
        ),
        (
            {"environment": "Ripple"},
            ("environment", "'Ripple'", "RippleSuppression-v0", "ArmTracking-v0"),
        ),
        (
            {"controller": "lqr"},
            ("controller", "'lqr'", "pd", "pd-feedforward", "pd-flexible", "FILE.py"),
        ),
        ({"arguments": {"gear": 3}}, ("'gear'", "drive", "effort_weight")),
    ):
        with pytest.raises(InputError, match=naming(*text)):
            tune(settings(**changes))
    for changes, text in (
        ({"optimiser": "adam"}, ("optimiser", "'adam'", "de", "cma", "optuna")),
        ({"evaluations": 11}, ("evaluations", "11", "12", "6")),
        ({"minutes": 1.0}, ("minutes", "evaluations")),
        (
            {"evaluations": None, "minutes": float("nan")},
            ("minutes", "nan", "> 0", "<= 1440"),
        ),
        ({"seed": -1}, ("seed", "-1", "0", "999999")),
    ):
        with pytest.raises(InputError, match=naming(*text)):
            settings(**changes)


@pytest.mark.slow
def test_tuned_gains_hold_on_seeds_that_they_were_not_tuned_on():
    """A small budget: 30 % below the textbook's PD, and below untuned feed-forward."""
    found = tune(
        TuneSettings(
            environment="JointTracking-v0",
            evaluations=160,
            population=8,
            training=6,
            held_out=8,
            arguments={"episode_s": 1.0},
        )
    )
    _, pd, ruled, best = found.candidates
    assert found.improvement(best) >= 0.3
    assert found.improvement(pd) > 0.0
    assert best.held_out.mean() < ruled.held_out.mean()
