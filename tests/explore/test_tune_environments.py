"""Tuning in the environments whose actions are added to motor loops."""

from __future__ import annotations

import json

import gymnasium
import numpy as np
import pytest
from messages import naming

import swgjoint
import swgjoint.envs
from swgjoint.control.error_compensation import ErrorCompensation
from swgjoint.errors import InputError
from swgjoint.explore.tune.added import LOOP
from swgjoint.explore.tune.cost import Trials
from swgjoint.explore.tune.gains import PLANNED
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.tune import tune
from swgjoint.json_text import json_text
from swgjoint.units import arcmin, mm
from swgjoint.view.plots.tune import claims, write_files

ARM = {"scene": "two-link", "episode_s": 0.5, "reference": ("multisine", "sinusoid")}
RIPPLE = {"episode_s": 1.8, "period_s": 2e-3}
SHORT = {
    # without a load, which would turn a free link beyond its limit
    "swgjoint/JointTracking-v0": {"episode_s": 0.5, "load_of_rated": 0.0},
    "swgjoint/RippleSuppression-v0": RIPPLE,
    "swgjoint/ArmTracking-v0": ARM,
}
EACH = pytest.mark.parametrize("name", SHORT)
ADDED = pytest.mark.parametrize("name", list(SHORT)[1:])
RIGID = PLANNED["pd-feedforward"]


def settings(name, **changes):
    """A run of few candidates, which ends in seconds."""
    keys = {
        "environment": name,
        "controller": "pd-feedforward",
        "evaluations": 24,
        "arguments": SHORT[name],
        "population": 6,
        "training": 2,
        "held_out": 3,
    }
    return TuneSettings(**(keys | changes))


def run(name, act, *, seed=4, **keys):
    """Cost of an episode by its definition, from rewards and infos, in SI units."""
    env = gymnasium.make(name, **SHORT[name], **keys).unwrapped
    observation, _ = env.reset(seed=seed)
    core, s, terms, over = env.core, env.core.settings, [], False
    while not over:
        action = act(env, observation)
        observation, reward, _, over, info = env.step(action)
        if not info.get("steady", True):
            continue
        share = info["motor_torque_Nm"] / core.limits.motor_torque[0]
        effort = share**2 if name.startswith("swgjoint/Joint") else np.mean(action**2)
        error = 1.0 / (reward + s.effort_weight * effort) - 1.0
        terms.append(error + s.effort_weight * effort)
    unit = mm if hasattr(s, "error_scale_mm") else arcmin
    scale = getattr(s, "error_scale_mm", None) or s.error_scale_arcmin
    return scale * unit * np.sqrt(np.mean(terms))


@EACH
def test_costs_follow_from_the_rewards(name):
    """The reward is 1/(1 + q) - w u; the cost s sqrt(mean(q + w u))."""
    trials = Trials(name, SHORT[name], seeds=(4, 9), candidates=1)
    got = trials.costs(LOOP, {})[0]
    trials.close()
    for cost, seed in zip(got, (4, 9), strict=True):
        still = run(name, lambda env, _: np.zeros(env.action_space.shape), seed=seed)
        # an error of the tiniest reward is a difference of nearly equal numbers
        assert cost == pytest.approx(still, rel=1e-6)


@ADDED
def test_a_plan_with_the_gains_of_the_loop_adds_what_the_loop_lacks(name):
    """Without friction a rigid plan adds nothing; a plan of the torsion adds some."""
    trials = Trials(name, SHORT[name] | {"friction": False}, seeds=(4,), candidates=1)

    def neutral(tunable):
        known = tunable.parameters(trials.joints, trials.loop)
        return {p.key: np.array([p.neutral]) for p in known}

    still = trials.costs(LOOP, {})[0, 0]
    rigid = trials.costs(RIGID, neutral(RIGID))[0, 0]
    assert rigid == pytest.approx(still, rel=1e-6)
    flexible = PLANNED["pd-flexible"]
    # nominal drives, whose error and torsion the plan knows
    assert trials.costs(flexible, neutral(flexible))[0, 0] < 0.5 * still
    trials.close()


@ADDED
def test_a_run_compares_with_the_loop_alone(name, tmp_path):
    """Its tuned cost is at most the untuned one; other seeds are reported beside it."""
    found = tune(settings(name, controller="pd-flexible"), folder=tmp_path)
    loop, ruled, best = found.candidates
    assert [one.name for one in found.candidates] == [
        "motor loop",
        "pd-flexible by rule",
        "pd-flexible tuned",
    ]
    assert loop is found.baseline and not loop.values
    assert best.training.mean() <= ruled.training.mean()
    assert best.held_out.shape == (3,) and np.isfinite(best.held_out).all()
    again = tune(settings(name, controller="pd-flexible"))
    texts = []
    for one in (found, again):
        figures = one.to_json()
        figures.pop("wall_s")
        texts.append(json_text(figures))
    assert texts[0] == texts[1]
    unit = "mm" if name.endswith("ArmTracking-v0") else "arcmin"
    assert f"held_out_cost_{unit}" in figures["best"]
    training, held_out = found.settings.seeds
    assert not set(training) & set(held_out)
    lines = claims(found)
    assert unit in lines[0] and "motor loop" in lines[0]
    assert len(write_files(found, tmp_path)) == 3
    page = (tmp_path / "report.html").read_text()
    assert unit in page and "Cost by held-out seed" in page
    # resumed at once
    resumed = tune(settings(name, controller="pd-flexible"), folder=tmp_path)
    assert resumed.best.values == best.values


@ADDED
def test_a_file_drives_the_environment_as_the_run_did(name, tmp_path):
    """Held-out costs again, with the torque that the file's controller adds."""
    found = tune(settings(name, evaluations=12))
    path = tmp_path / "tune.json"
    path.write_text(json_text(found.to_json()))
    result = json.loads(path.read_text())
    row = result["best"]
    controller = swgjoint.load_controller(path)
    unit = "mm" if name.endswith("ArmTracking-v0") else "arcmin"
    for seed, want in zip(
        result["seeds"]["held_out"], row[f"held_out_costs_{unit}"], strict=True
    ):
        k = -1

        def act(env, observation):
            nonlocal k
            k += 1
            if k == 0:
                controller.start(env.task)
            torque = controller.torque(k, env.read_measurements(observation))
            return np.clip(torque / env.core.authority, -1.0, 1.0)

        got = run(name, act, seed=seed, randomise=True)
        assert got / (mm if unit == "mm" else arcmin) == pytest.approx(want, rel=1e-6)
    with pytest.raises(InputError, match=naming("motor loop", "no torque", "tuned")):
        swgjoint.load_controller(path, "baseline")


def test_the_compensation_of_an_estimate_is_tuned(tmp_path):
    """It observes the estimate, lowers the cost of every specimen, and is read back."""
    name = "swgjoint/RippleSuppression-v0"
    found = tune(settings(name, controller="compensation"))
    loop, ruled, best = found.candidates
    assert (best.held_out < 0.8 * loop.held_out).all()
    assert best.training.mean() <= ruled.training.mean()
    path = tmp_path / "tune.json"
    path.write_text(json_text(found.to_json()))
    assert json.loads(path.read_text())["arguments"]["identify"] is True
    assert isinstance(swgjoint.load_controller(path), ErrorCompensation)
    found = naming("compensation", "JointTracking-v0", "RippleSuppression-v0")
    with pytest.raises(InputError, match=found):
        other = "swgjoint/JointTracking-v0"
        tune(settings(other, controller="compensation", arguments={}))


def test_set_points_are_not_tuned():
    """Controllers give torques."""
    name = "swgjoint/ArmTracking-v0"
    found = naming("action", "'setpoint'", "torque")
    with pytest.raises(InputError, match=found):
        tune(settings(name, arguments=ARM | {"action": "setpoint"}))
    with pytest.raises(InputError, match=naming("'drive'", "scene", "payload_kg")):
        tune(settings(name, arguments={"drive": "CSG-14-50"}))
