"""A feature that was taken out of a scene leaves nothing: bytes, modules, files."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.sim.assembly import assemble
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.scene.scene import Scene

PULSE = {
    "kind": "joint_pulse",
    "joint": "shoulder",
    "torque_Nm": 1.0,
    "start_s": 0.1,
    "duration_s": 0.1,
}
MOTOR = {"stall_torque_Nm": 1.0, "no_load_speed_rpm": 3000.0}

FEATURES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "payload": ({"payload.mass_kg": 2.0}, {"payload": None}),
    "motor limits": ({"defaults.motor": MOTOR}, {"defaults.motor": None}),
    "current limit of one joint": (
        {"joints.elbow.motor": {"torque_constant_Nm_A": 0.1, "current_limit_A": 2.0}},
        {"joints.elbow": {}},
    ),
    "sensor delay": ({"sensors.motor.delay_s": 0.002}, {"sensors": None}),
    "sensor resolution": ({"sensors.motor.counts_per_turn": 4096}, {"sensors": None}),
    "disturbance": ({"disturbance": [PULSE]}, {"disturbance": []}),
    "load": ({"load.elbow.torque_Nm": 3.0}, {"load": {}}),
    "sampled controller": (
        {"controller.control_period_s": 0.002},
        {"controller.control_period_s": None},
    ),
    "integral": ({"controller.kind": "pid"}, {"controller.kind": "pd"}),
    "computed torque": (
        {"controller.kind": "computed_torque"},
        {"controller.kind": "pd"},
    ),
    "link feedback": (
        {"controller.feedback": "link", "sensors.link.counts_per_turn": 100_000},
        {"controller.feedback": "motor", "sensors": None},
    ),
    "damping": ({"defaults.damping_ratio": 0.1}, {"defaults.damping_ratio": None}),
    "lumped rotors": ({"defaults.rotor": "lumped"}, {"defaults.rotor": None}),
    "hysteresis": ({"defaults.hysteresis": True}, {"defaults.hysteresis": False}),
    "harmonics below a tolerance": (
        {"defaults.harmonics_tolerance_arcmin": 1.0},
        {"defaults.harmonics_tolerance_arcmin": None},
    ),
    "friction": ({"defaults.friction": True}, {"defaults.friction": False}),
    "plugin level": ({"defaults.level": "full"}, {"defaults.level": "linear"}),
    "native level": ({"defaults.level": "native"}, {"defaults.level": "linear"}),
}
"""Keys that bring a feature into a scene, and those that take it out again."""

SCENE = """
name = "plain"
arm = "two-link"
[defaults]
drive = "map"
level = "LEVEL"
rotor_inertia_kgm2 = 1e-4
[trajectory]
kind = "sweep"
hold_s = 0.02
ramp_s = 0.1
[trajectory.end_deg]
shoulder = 2.0
[controller]
natural_frequency_Hz = 8.0
damping_ratio = 1.0
[simulation]
duration_s = 0.3
"""
ELEMENTS = (Jenkin(stiffness=1e3, yield_torque=2.0),)


def plain_scene(feature: str) -> Scene:
    """The scene that never had the feature; levels above it are features, too."""
    level = "linear" if feature.endswith("level") else "full"
    return Scene.from_toml(SCENE.replace("LEVEL", level))


def without(scene: Scene, feature: str) -> tuple[Scene, Scene]:
    """A scene with the feature, and that without it again."""
    there, gone = FEATURES[feature]
    have = scene.with_changes(there)
    return have, have.with_changes(gone)


def saved(model: mujoco.MjModel) -> bytes:
    """The compiled model as it is written to a file."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def maps_for(feature: str, drive: DriveMap, law: Friction) -> tuple[DriveMap, DriveMap]:
    """Drives of the scene with the feature and of the one that never had it."""
    if feature == "hysteresis":
        return replace(drive, hysteresis=ELEMENTS), drive
    if feature == "friction":
        return replace(drive, friction=law), drive
    return drive, drive


@pytest.mark.parametrize("feature", FEATURES)
def test_a_model_does_not_remember_a_feature(feature, synthetic_map, friction_law):
    """Bytes, contents and samples equal those of a scene that never had it."""
    scene = plain_scene(feature)
    have, again = without(scene, feature)
    rich, bare = maps_for(feature, synthetic_map, friction_law)
    there = assemble(have, drives={"map": rich})
    gone = assemble(again, drives={"map": rich})
    never = assemble(scene, drives={"map": bare})
    assert saved(gone.model) == saved(never.model)
    assert gone.loops.sampled == never.loops.sampled
    for key in ("feedforward", "link_torque", "load", "prescribed"):
        np.testing.assert_array_equal(getattr(gone, key), getattr(never, key))
    left = contents(gone)
    if rich is bare:
        assert left == contents(never)
    else:
        assert any(feature in item["part"] for item in left["left_out"])
    # else there would be nothing to take away
    assert saved(there.model) != saved(never.model) or contents(there) != left
    json.dumps(left)


def swinging(drive: DriveMap) -> DriveMap:
    """Harmonics that exceed the mean stiffness: no tolerance bounds an angle."""
    size = np.where(np.any(drive.orders != 0, axis=1), 1e3, 1.0)
    return replace(drive, potential=size[:, None, None, None] * drive.potential)


@pytest.mark.parametrize("level", ["rigid", "linear", "native"])
def test_a_level_without_harmonics_needs_no_tolerance(level, synthetic_map):
    """The map that level full refuses to prune is the same as without the key."""
    scene = plain_scene("payload").with_level(level)
    have, again = without(scene, "harmonics below a tolerance")
    drives = {"map": swinging(synthetic_map)}
    there, gone = (assemble(one, drives=drives) for one in (have, again))
    assert saved(there.model) == saved(gone.model)
    assert contents(there) == contents(gone)
    for other in ("kinematic", "full"):
        with pytest.raises(
            InputError,
            match=naming("'synthetic'", "N·m/rad", "rigid", "linear", "native"),
        ):
            assemble(have.with_level(other), drives=drives)


def test_what_was_pruned_before_is_in_the_contents(synthetic_map):
    """A scene that drops more harmonics of a pruned map tells of all of them."""
    once = synthetic_map.pruned(0.5)
    scene = plain_scene("payload").with_changes(
        {"defaults.harmonics_tolerance_arcmin": 1e3}
    )
    listed = contents(assemble(scene, drives={"map": once}))["left_out"]
    count = len(synthetic_map.orders) - 1
    assert 0 < len(once.orders) - 1 < count
    told = [item for item in listed if item["part"] == f"{count} harmonics of the map"]
    assert told and all("tolerance of 1e+03 arcmin" in item["reason"] for item in told)


@pytest.mark.parametrize(
    ("feature", "part"),
    [
        ("payload", "payload"),
        ("motor limits", "motor limits"),
        ("sensor delay", "sensors"),
        ("disturbance", "disturbances"),
        ("load", "load torques"),
        ("integral", "integral of the error"),
        ("sampled controller", "sampled controller"),
        ("plugin level", "engine plugin"),
    ],
)
def test_contents_say_what_is_absent_and_why(feature, part, synthetic_map):
    """A part is either in the model or listed as absent with its reason."""
    scene = plain_scene(feature)
    have, again = without(scene, feature)
    listed = [
        {item["part"]: item["reason"] for item in contents(found)["absent"]}
        for found in (assemble(s, drives={"map": synthetic_map}) for s in (have, again))
    ]
    assert part not in listed[0]
    assert listed[1][part]


PROBE = """
import contextlib, importlib, json, os, sys, tempfile
from pathlib import Path
import mujoco, numpy
from swgjoint.maps.drive_map import DriveMap
from swgjoint.view.run import run_scene
from swgjoint.sim.scene.scene import Scene

cases = json.load(sys.stdin)
out = {}
# What the plainest run loads of numpy and scipy is loaded here, once for all others.
# That run comes again at its place, so all are compared as loaded from here on.
for name, (text, steps, record) in [("linear", cases["linear"]), *cases.items()]:
    if len(out) == 1:
        for module in out["linear"]["modules"]:
            if module.partition(".")[0] in ("numpy", "scipy"):
                with contextlib.suppress(ImportError):
                    importlib.import_module(module)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        opened = []
        def audit(event, args):
            if event == "open" and isinstance(args[0], str):
                opened.append(args[0])
        sys.addaudithook(audit)
        scene = Scene.from_toml(text)
        for step in steps:
            scene = scene.with_changes(step)
        drives = {"map": DriveMap.linear(2e4)}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.rrd" if record else None
            run_scene(scene, drives=drives, recording=path)
        maps = {line.split()[-1] for line in open("/proc/self/maps")}
        ours = ("/proc", tempfile.gettempdir())
        files = [path for path in opened if not path.startswith(ours)]
        found = {
            "modules": sorted(sys.modules),
            "files": sorted(set(files)),
            "libraries": sorted(m for m in maps if ".so" in m),
        }
        with os.fdopen(write, "w") as pipe:
            json.dump(found, pipe)
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        out[name] = json.load(pipe)
    os.waitpid(child, 0)
json.dump(out, sys.stdout)
"""


@pytest.fixture(scope="module")
def used() -> dict[str, dict[str, list[str]]]:
    """Modules, files and libraries of runs in processes that ran nothing else."""
    plain = {level: SCENE.replace("LEVEL", level) for level in ("linear", "full")}
    cases: dict[str, Any] = {
        feature: (plain[plain_scene(feature).defaults.level or ""], changes, False)
        for feature, changes in FEATURES.items()
    }
    cases |= {level: (text, [], False) for level, text in plain.items()}
    cases["there"] = (plain["linear"], FEATURES["plugin level"][:1], False)
    cases["recording"] = (plain["full"], [], True)
    got = subprocess.run(
        # -P: the installed package, not the sources in this folder
        [sys.executable, "-P", "-c", PROBE],
        input=json.dumps(cases),
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return json.loads(got.stdout)


@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_that_was_taken_out_is_not_loaded(feature, used):
    """The same modules, files and libraries as in a run that never had it."""
    assert used[feature] == used[plain_scene(feature).defaults.level]


def test_a_scene_loads_only_what_it_asks_for(used):
    """No viewer without a recording, no gear without finite elements.

    The engine plugin is registered wherever MuJoCo is imported, so that saved models
    load; instances of it are counted by ``contains``.
    """
    viewer = {"swgjoint.view.recording.recording", "rerun"}
    for case, found in used.items():
        modules = set(found["modules"])
        assert viewer & modules == (viewer if case == "recording" else set())
        assert not {"skfem", "swgjoint.fe", "casadi", "pinocchio"} & modules
