"""Tuning of the user's controllers, and what is said of broken ones."""

from __future__ import annotations

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from messages import naming

import swgjoint
import swgjoint.envs
from swgjoint.control.motor_side import MotorPID, rigid_plan
from swgjoint.errors import InputError
from swgjoint.explore.tune import tune as run
from swgjoint.explore.tune.cost import Trials
from swgjoint.explore.tune.gains import PLANNED
from swgjoint.explore.tune.own import OwnController
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.tunable import GainParameter
from swgjoint.explore.tune.tune import tune
from swgjoint.json_text import json_text
from swgjoint.view.plots.tune import claims

NAME = "swgjoint/JointTracking-v0"
SHORT = {"episode_s": 0.5, "max_speed_rad_s": 0.3}
ARM = {"scene": "two-link", "episode_s": 0.5}


class Mine:
    """PD control of the motor along a rigid plan, with its own gains."""

    parameters = {  # noqa: RUF012  (as a user writes it)
        "stiffness_Nm_rad": (0.1, 20.0),
        "damping_Nms_rad": (0.005, 0.5, 0.02),
        "torque_share": (-0.5, 1.5, 1.0),
    }

    def __init__(self, *, stiffness_Nm_rad, damping_Nms_rad, torque_share):
        self.gains = stiffness_Nm_rad, damping_Nms_rad
        self.share = torque_share

    def start(self, task):
        """Plan the motion."""
        self.plan = rigid_plan(task)

    def torque(self, k, measured):
        """Feed-forward and PD."""
        kp, kd = self.gains
        plan = self.plan
        return (
            kp * (plan.angle[k] - measured.motor_angle)
            + kd * (plan.speed[k] - measured.motor_speed)
            + self.share * plan.torque[k]
        )


def settings(controller, **changes):
    """A run of few candidates, which ends in seconds."""
    keys = {
        "environment": NAME,
        "controller": controller,
        "evaluations": 24,
        "arguments": SHORT,
        "population": 6,
        "training": 2,
        "held_out": 2,
    }
    return TuneSettings(**(keys | changes))


def test_it_is_tuned_as_the_built_in_ones(tmp_path):
    """From its start or better, with the same result from the same seed."""
    runs = [tune(settings(Mine)) for _ in range(2)]
    names = [one.name for one in runs[0].candidates]
    assert names[:2] == ["pd by rule", "pd tuned"]
    assert names[2].endswith("Mine initial") and names[3].endswith("Mine tuned")
    first, best = runs[0].candidates[2:]
    assert first.values == {
        "stiffness_Nm_rad": pytest.approx(np.sqrt(2.0)),
        "damping_Nms_rad": 0.02,
        "torque_share": 1.0,
    }
    assert best.training.mean() <= first.training.mean()
    assert best.held_out.size == 2
    assert best.values == runs[1].best.values
    np.testing.assert_array_equal(best.held_out, runs[1].best.held_out)
    path = tmp_path / "tune.json"
    path.write_text(json_text(runs[0].to_json()))
    with pytest.raises(InputError, match=naming("Mine", "own=")):
        swgjoint.load_controller(path)
    got = swgjoint.load_controller(path, own=Mine)
    assert isinstance(got, Mine) and got.share == best.values["torque_share"]
    assert swgjoint.load_controller(path, "baseline").tunable.name == "pd"
    content = json.loads(path.read_text())
    content["best"]["parameters"].pop("torque_share")
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=naming("parameters", "torque_share")):
        swgjoint.load_controller(path, own=Mine)


def test_its_cost_is_that_of_the_same_law():
    """A function that returns the library's controller costs what that costs."""

    def make(*, frequency_Hz):
        return MotorPID(rigid_plan, frequency=frequency_Hz, damping_ratio=0.7)

    make.parameters = {"frequency_Hz": (2.0, 40.0)}
    arguments = SHORT | {"sensors": {"delay_periods": 0}}  # whose age both know
    trials = Trials(NAME, arguments, seeds=(4, 9), candidates=2)
    frequency = np.array([8.0, 20.0])
    own = OwnController.from_object(make)
    got = trials.costs(own, {"frequency_Hz": frequency})
    neutral = dict.fromkeys(PLANNED["pd-feedforward"].keys[3:5], np.ones(2))
    neutral |= {"integral_time_s": np.full(2, np.inf), "reading_age_s": np.zeros(2)}
    values = {"frequency_Hz": frequency, "damping_ratio": np.full(2, 0.7)} | neutral
    want = trials.costs(PLANNED["pd-feedforward"], values)
    np.testing.assert_allclose(got, want, rtol=1e-9)
    trials.close()


@pytest.mark.parametrize("low", [0.1, -0.5])
def test_positions_between_bounds_are_reversible(low):
    """On the logarithmic and on the linear scale; bounds are at 0 and 1."""
    one = GainParameter(key="a", low=low, high=2.0, neutral=0.7)
    np.testing.assert_allclose(one.value(np.array([0.0, 1.0])), [low, 2.0])
    assert one.value(np.array(one.start)) == pytest.approx(0.7)
    assert one.place(1.2) == pytest.approx(
        (1.2 + 0.5) / 2.5 if low < 0.0 else np.log(12.0) / np.log(20.0)
    )


def test_values_beyond_the_bounds_are_kept_if_they_cost_less(monkeypatch):
    """As no integral, which no search reaches: then the start is the result."""
    own = OwnController.from_object(Mine)
    wrong = GainParameter(key="torque_share", low=-3.0, high=-2.0, neutral=1.0)
    bounds = (*own.bounds[:2], wrong)
    monkeypatch.setattr(
        run, "controller_named", lambda name: replace(own, bounds=bounds)
    )
    found = tune(settings("any", environment="ArmTracking-v0", arguments=ARM))
    _, first, best = found.candidates
    assert first.values["torque_share"] == 1.0
    assert best.values == first.values and best.name == "Mine tuned"
    np.testing.assert_array_equal(best.held_out, first.held_out)


@pytest.mark.parametrize("name", ["RippleSuppression-v0", "ArmTracking-v0"])
def test_its_torque_is_added_to_motor_loops(name):
    """No torque is the motor loop alone; all joints of an arm take part."""

    class Nothing:
        parameters = {"unused": (1.0, 2.0)}  # noqa: RUF012

        def __init__(self, *, unused):
            pass

        def start(self, task):
            assert task.loop is not None and task.position.ndim == 2
            self.joints = task.position.shape[1]

        def torque(self, k, measured):
            assert measured.motor_angle.shape == (self.joints,)
            return np.zeros(self.joints)

    arguments = {"episode_s": 1.6, "period_s": 4e-3}
    if name.startswith("Arm"):
        arguments = ARM
    found = tune(settings(Nothing, environment=name, arguments=arguments))
    loop, first, best = found.candidates
    np.testing.assert_array_equal(first.training, loop.training)
    np.testing.assert_array_equal(best.held_out, loop.held_out)
    assert "Nothing: no parameter changes any cost" in claims(found)
    assert not any("exceeds" in one for one in claims(found))


def test_broken_limits_are_told():
    """Of each candidate, with the number of its held-out episodes."""

    class Pushing:
        parameters = {"torque_Nm": (5.0, 9.0)}  # noqa: RUF012

        def __init__(self, *, torque_Nm):
            self.torque_Nm = torque_Nm

        def start(self, task):
            pass

        def torque(self, k, measured):
            return np.full(1, self.torque_Nm)

    lines = claims(tune(settings(Pushing)))
    assert "Pushing tuned: exceeds a limit in 2 of 2 held-out episodes" in lines
    assert not any("pd by rule: exceeds" in one for one in lines)


def made(**changes):
    """A class like ``Mine`` with other members."""
    return type("Broken", (Mine,), changes)


def failing(self, *_, **__):
    raise RuntimeError("first line\nsecond line")


def leaving(self, *_, **__):
    raise SystemExit(0)


def nan_later(self, k, measured):
    return np.full(1, np.nan if k == 7 else 0.0)


@pytest.mark.parametrize(
    ("own", "match"),
    [
        (made(parameters=None), ("parameters", "low", "high")),
        (made(parameters={}), ("parameters", "low", "high")),
        (made(parameters={"a": 3.0}), ("'a'", "3.0", "low", "high")),
        (made(parameters={"a": (2.0, 1.0)}), ("'a'", "(2.0, 1.0)", "low", "high")),
        (made(parameters={"a": (1.0, 2.0, 3.0)}), ("'a'", "(1.0, 2.0, 3.0)")),
        (made(parameters={"a": (1.0, np.inf)}), ("'a'", "inf")),
        (made(parameters={"a": (1.0, 2.0)}), ("a = ", "TypeError")),
        (made(__init__=failing), ("RuntimeError", "first line", "torque_share = 1")),
        (made(start=failing), ("start", "RuntimeError", "first line")),
        (made(torque=failing), ("torque", "instant 0", "RuntimeError", "first line")),
        (made(torque=nan_later), ("torque", "instant 7", "nan", "finite")),
        (made(torque=lambda self, k, m: np.zeros(2)), ("torque", "(2,)", "(1,)")),
        (made(torque=lambda self, k, m: None), ("torque", "None", "(1,)")),
        (made(torque=lambda self, k, m: "x"), ("torque", "'x'", "(1,)")),
        (made(torque=lambda self, k, m: ["1.0"]), ("torque", "['1.0']", "(1,)")),
        (made(torque=lambda self, k, m: np.array([1j])), ("torque", "1.j", "(1,)")),
        (made(torque=leaving), ("torque", "SystemExit", "0")),
        (made(torque=None), ("start", "torque", "methods")),
        (type("pd", (Mine,), {}), ("'pd'", "name", "pd-flexible")),
        (3, ("controller", "3", "class", "pd-flexible")),
    ],
)
def test_broken_controllers_give_one_line(own, match):
    """What failed, with which values, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)) as error:
        tune(settings(own))
    assert "\n" not in str(error.value)


def test_what_happens_after_the_end_of_an_episode_is_not_asked():
    """A controller that breaks a limit costs a lot, and is not called again."""
    calls = []

    class Wild:
        parameters = {"torque_Nm": (1.0, 2.0)}  # noqa: RUF012

        def __init__(self, *, torque_Nm):
            pass

        def start(self, task):
            self.limit = task.joints.torque_limit

        def torque(self, k, measured):
            calls.append(k)
            return self.limit

    trials = Trials(NAME, SHORT, seeds=(4,), candidates=1)
    cost = trials.costs(OwnController.from_object(Wild), {"torque_Nm": np.ones(1)})
    assert 0.5 * trials.worst < cost[0, 0] <= trials.worst
    assert calls == list(range(len(calls))) and len(calls) < 400
    trials.close()


FILE = """
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(kw_only=True)
class Own:
    stiffness_Nm_rad: float

    def start(self, task):
        self.angle = task.joints.ratio * task.position

    def torque(self, k, measured):
        return self.stiffness_Nm_rad * (self.angle[k] - measured.motor_angle)


Own.parameters = {"stiffness_Nm_rad": (0.01, 0.5)}
none = 3
"""


def test_a_file_names_a_controller(tmp_path):
    """As FILE.py:NAME; a changed file does not continue the search of another."""
    path, out = tmp_path / "own.py", tmp_path / "out"
    path.write_text(FILE)
    chosen = settings(f"{path}:Own", evaluations=12)
    found = tune(chosen, folder=out)
    assert found.best.name == "own.py:Own tuned"
    assert found.to_json()["controller"] == "own.py:Own"
    path.write_text(FILE.replace("(0.01, 0.5)", "(0.01, 0.6)"))
    with pytest.raises(InputError, match=naming("controller_content", "files")):
        tune(chosen, folder=out)
    for name, match in (
        (f"{path}:Other", ("own.py", "'Other'", "Own")),
        (f"{path}:none", ("3", "class")),
        (f"{tmp_path / 'missing.py'}:Own", ("missing.py", "read")),
    ):
        with pytest.raises(InputError, match=naming(*match)):
            tune(settings(name))
    for text, match in (
        (
            "import nothing_of_this_name",
            ("ModuleNotFoundError", "nothing_of_this_name"),
        ),
        ("raise SystemExit(0)", ("SystemExit", "0")),
        ("", ("'Own'", "class", "parameters")),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=naming("own.py", *match)):
            tune(chosen)


def test_environments_drive_it_as_trials_do():
    """The single environment and the trials call it with the same arrays."""
    values = {"stiffness_Nm_rad": 2.0, "damping_Nms_rad": 0.03, "torque_share": 0.9}
    trials = Trials(NAME, SHORT, seeds=(4,), candidates=1)
    arrays = {key: np.array([value]) for key, value in values.items()}
    costs, trace = trials.cost_and_traces(OwnController.from_object(Mine), arrays)
    env = gymnasium.make(NAME, **SHORT).unwrapped
    observation, _ = env.reset(seed=4)
    mine, torques = Mine(**values), []
    mine.start(env.task)
    for k in range(500):
        torque = mine.torque(k, env.read_measurements(observation))
        observation, *_, info = env.step(torque / env.task.joints.torque_limit)
        torques.append(info["motor_torque_Nm"])
    np.testing.assert_array_equal(trace.torque[:, 0], torques)
    assert costs.shape == (1, 1)
    trials.close()


def test_signals_that_are_not_finite_cost_the_most(monkeypatch):
    """Error of all links at their limits and full effort, which is ``worst``."""
    arguments = {**SHORT, "error_scale_arcmin": 5e3, "effort_weight": 0.5}
    trials = Trials(NAME, arguments, seeds=(1, 2), candidates=1)
    assert trials.worst > 1.01 * trials.error_scale * trials._limit**0.5
    lost = np.full(2, np.nan)
    monkeypatch.setattr(trials.env.core, "deviation", lambda: (lost, lost))
    tunable = PLANNED["pd"]
    values = {
        one.key: np.array([one.neutral])
        for one in tunable.parameters(trials.joints, trials.loop)
    }
    np.testing.assert_allclose(trials.costs(tunable, values), trials.worst, rtol=1e-12)
