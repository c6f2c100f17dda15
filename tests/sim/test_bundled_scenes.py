"""The scenes that come with the package, whole, as ``swgjoint run NAME`` has them."""

import numpy as np
import pytest

from swgjoint.models_path import bundled_names
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene


def test_there_are_enough_and_each_says_what_it_is():
    """Names are those of the files, and each has its line of description."""
    names = bundled_names("scenes", ".toml")
    assert len(names) >= 10
    for name in names:
        scene = Scene.load_file(name)
        assert scene.name == name
        assert scene.description


def test_the_iso_scene_gives_thirty_approaches_of_five_poses():
    """Sag makes the accuracy; repeatability is round-off, for nothing is random."""
    run = run_scene("ur5e-iso9283")
    tool = run.metrics()["tool"]
    assert [pose["approaches"] for pose in tool["poses"]] == [30] * 5
    assert 0.2 < tool["ap_mm"] < 2.0
    assert tool["rp_mm"] < 1e-6
    assert tool["missing"].keys() == {"at_mm", "rt_mm"}


def test_the_circle_scene_gives_path_accuracy():
    """Three turns are compared; what a turn misses the next one misses again."""
    tool = run_scene("ur5e-circle").metrics()["tool"]
    assert tool["passes"] == 3
    assert 0.2 < tool["at_mm"] < 2.0
    assert tool["rt_mm"] < 0.01 * tool["at_mm"]


def test_the_step_scene_has_all_its_features():
    """Motors reach their current limit, the unknown payload leaves an error."""
    run = run_scene("ur5e-payload-step")
    assert {"motor_limits", "payload", "sensors", "disturbances"} <= set(run.contains)
    result = run.metrics()
    for name in ("shoulder_lift_joint", "elbow_joint"):
        motor = result["joints"][name]["motor"]
        assert motor["current_peak_A"] == pytest.approx(10.0)
        assert motor["at_limit_s"] > 0.0
        # below the critically damped loop's 6.6 / w = 0.13 s twice over
        assert 0.05 < result["joints"][name]["settling"]["settling_s"] < 0.3
        assert result["joints"][name]["ratings"]["within"]
    assert result["tool"]["ap_mm"] > 2.0


def test_the_chirp_scene_shakes_the_load():
    """The drive carries J w² A at the end of the sweep, a little more by its spring."""
    run = run_scene("bench-chirp")
    late = (run.time > 9.0) & (run.time < 9.5)
    frequency = 0.5 + 11.5 * (9.25 - 0.5) / 10.0
    rigid = 1.0 * (2.0 * np.pi * frequency) ** 2 * np.deg2rad(1.0)
    got = np.ptp(run.output_torque[late, 0]) / 2.0
    assert rigid < got < 1.25 * rigid
