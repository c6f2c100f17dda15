"""Tuned gains that are read back drive environments and scenes as in the tuning run."""

from __future__ import annotations

import json

import gymnasium
import numpy as np
import pytest
from messages import naming

import swgjoint
import swgjoint.envs
from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import MotorPID
from swgjoint.errors import InputError
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.tune import tune
from swgjoint.json_text import json_text
from swgjoint.units import arcmin

NAME = "swgjoint/JointTracking-v0"
ARGUMENTS = {"episode_s": 0.5, "max_speed_rad_s": 0.3}


@pytest.fixture(scope="module")
def tuned():
    """JSON of a short tuning run."""
    settings = TuneSettings(
        environment="JointTracking-v0",
        evaluations=24,
        arguments=ARGUMENTS,
        population=6,
        training=2,
        held_out=2,
    )
    return json_text(tune(settings).to_json())


@pytest.fixture
def file(tuned, tmp_path):
    """The same as a file."""
    path = tmp_path / "tune.json"
    path.write_text(tuned)
    return path


def cost(controller, result, seed):
    """Cost of one episode in the single environment [arcmin]."""
    env = gymnasium.make(NAME, **result["arguments"]).unwrapped
    observation, _ = env.reset(seed=seed)
    limit = env.task.joints.torque_limit
    controller.start(env.task)
    squares = np.zeros(2)
    steps = len(env.task.position) - 1
    for k in range(steps):
        torque = controller.torque(k, env.read_measurements(observation))
        observation, *_, info = env.step(np.clip(torque / limit, -1.0, 1.0))
        effort = info["motor_torque_Nm"] / limit[0]
        squares += np.square([info["link_error_arcmin"], effort])
    mean = squares / steps
    scale = result["error_scale_arcmin"] ** 2 * result["effort_weight"]
    return np.sqrt(mean[0] + scale * mean[1])


def test_costs_are_those_of_the_file(file, tuned):
    """Of every candidate on the held-out seeds, with every kind of controller."""
    result = json.loads(tuned)
    for row in result["candidates"]:
        controller = swgjoint.load_controller(file, row["name"])
        for seed, expected in zip(
            result["seeds"]["held_out"], row["held_out_costs_arcmin"], strict=True
        ):
            assert cost(controller, result, seed) == pytest.approx(expected, rel=1e-9)
    best = swgjoint.load_controller(file)
    assert best.values == result["best"]["parameters"]
    assert swgjoint.load_controller(file, "baseline").tunable.name == "pd"


def test_it_drives_a_scene(file):
    """Without tuning it is the flexible plan with the gains of the rule."""
    untuned = swgjoint.load_controller(file, "pd-flexible by rule")
    values = untuned.values
    same = MotorPID(
        flexible_plan,
        frequency=values["frequency_Hz"],
        damping_ratio=values["damping_ratio"],
    )
    scene = swgjoint.Scene.from_data(
        {
            "name": "chirp",
            "arm": "two-link",
            "defaults": {"drive": "CSG-17-100", "rotor_inertia_kgm2": 2e-5},
            "trajectory": {
                "kind": "sweep",
                "start_deg": {"shoulder": -20.0, "elbow": 30.0},
                "end_deg": {"shoulder": 10.0},
            },
            "simulation": {"duration_s": 3.0, "step_s": 1e-3},
        }
    )
    runs = [swgjoint.run_scene(scene, controller=each) for each in (untuned, same)]
    np.testing.assert_allclose(
        runs[0].position, runs[1].position, rtol=0, atol=1e-4 * arcmin
    )


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda r: [], ("candidates", "tune.json")),
        (lambda r: r | {"candidates": 3}, ("candidates", "tune.json")),
        (lambda r: r | {"best": None}, ("'best'", "pd by rule", "baseline")),
        (lambda r: r | {"best": r["best"] | {"controller": "pi"}}, ("'pi'", "pd")),
        (
            lambda r: r | {"best": r["best"] | {"parameters": {"frequency_Hz": 1}}},
            ("parameters", "damping_ratio"),
        ),
        (
            lambda r: (
                r
                | {
                    "best": r["best"]
                    | {"parameters": r["best"]["parameters"] | {"damping_ratio": -1.0}}
                }
            ),
            ("damping_ratio", "-1.0", ">= 0"),
        ),
    ],
)
def test_other_files_are_refused(file, tuned, change, match):
    """In one line that names the file and what is accepted."""
    file.write_text(json.dumps(change(json.loads(tuned))))
    with pytest.raises(InputError, match=naming("tune.json", *match)) as error:
        swgjoint.load_controller(file)
    assert "\n" not in str(error.value)


def test_no_json_is_refused(tmp_path, file):
    """A missing file, other text, an unknown candidate, and a step before the start."""
    (tmp_path / "text").write_text("x")
    for name in ("missing.json", "text"):
        with pytest.raises(InputError, match=naming(name, "read")):
            swgjoint.load_controller(tmp_path / name)
    with pytest.raises(InputError, match=naming("'none'", "pd tuned")):
        swgjoint.load_controller(file, "none")
    with pytest.raises(InputError, match=naming("start")):
        swgjoint.load_controller(file).torque(0, None)
