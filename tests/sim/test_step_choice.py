"""The step of an arm's scene carries the ripple of its drives."""

import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import scene_of_arm
from swgjoint.sim.step_choice import STEPS, needed_order, resolving_step
from swgjoint.view.run import run_scene


def test_the_needed_order_leaves_little_above_it(synthetic_map: DriveMap):
    """Of the synthetic map the teeth; of a map without harmonics none."""
    assert needed_order(synthetic_map) == 122.0
    assert needed_order(DriveMap.linear(2e4)) == 0.0


def test_ripple_of_a_drive_of_ones_own_is_there_by_default(synthetic_map, tmp_path):
    """In an arm at its default step: as at a tenth of the step, within 10 %."""
    drive = tmp_path / "own.swg"
    synthetic_map.save(drive)
    scene = scene_of_arm("two-link", drive=str(drive))
    step = scene.simulation.step_s
    assert step == resolving_step(scene, RigidArm("two-link")) < STEPS[0]
    runs = [
        run_scene(scene.with_changes({"simulation.step_s": h}))
        for h in (step, 0.1 * step)
    ]
    default, fine = (run.metrics()["joints"] for run in runs)
    for name, joint in default.items():
        assert not joint["unresolved"] and not joint["ripple_is_lower_bound"]
        assert joint["ripple_rms_percent"] == pytest.approx(
            fine[name]["ripple_rms_percent"], rel=0.1
        )


def test_a_step_that_is_given_stays(synthetic_map, tmp_path):
    """An override wins; drives that need no finer step keep a millisecond."""
    drive = tmp_path / "own.swg"
    synthetic_map.save(drive)
    keep = {"simulation.step_s": 0.002}
    scene = scene_of_arm("two-link", drive=str(drive), overrides=keep)
    assert scene.simulation.step_s == 0.002
    assert scene_of_arm("two-link", drive="CSG-25-100").simulation.step_s == 1e-3
