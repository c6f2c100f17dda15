"""A compiled scene at another step is the one that the compiler makes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from swgjoint.sim.assembly import assemble
from swgjoint.sim.other_step import at_step
from swgjoint.sim.own_drives import scene_of_run
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.simulation import simulate

ARRAYS = ("link_torque", "feedforward", "prescribed", "prescribed_rate")
SIGNALS = ("position", "motor_velocity", "output_torque", "torsion", "tool_position")
SHORT = {"simulation.duration_s": 0.2, "trajectory.settle_s": 0.05}


@pytest.mark.parametrize(
    "changes",
    [
        {"defaults.level": "rigid"},
        {"defaults.level": "kinematic"},
        {"defaults.level": "linear"},
        {"defaults.level": "native"},
        {"defaults.level": "full"},
        {"controller.control_period_s": 0.002, "simulation.step_s": 0.002},
        {"simulation.integrator": "RK4", "simulation.max_sub_steps": 20},
    ],
    ids=lambda changes: "-".join(map(str, changes.values())),
)
def test_the_model_and_the_run_are_those_of_a_new_compilation(synthetic_map, changes):
    """All arrays of the model, of the motion and of the run are the same bits."""
    scene = Scene.load_file("bench", {**SHORT, **changes})
    coarse = assemble(scene, drives={"reference-2d": synthetic_map})
    step = 0.5 * coarse.step
    own, drives = scene_of_run(coarse)
    compiled = assemble(
        own.with_changes({"simulation.step_s": step}),
        drives=drives,
    )
    changed = at_step(coarse, step)
    models = compiled.model, changed.model
    size = mujoco.mj_sizeModel(models[0])
    images = [np.empty(size, np.uint8) for _ in models]
    # runs and the changed model skip idle stages
    idle = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_SENSOR
    for model, image in zip(models, images, strict=True):
        model.opt.disableflags |= idle
        mujoco.mj_saveModel(model, None, image)
    np.testing.assert_array_equal(*images)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(changed, name), getattr(compiled, name))
    runs = [simulate(one, name="bench") for one in (compiled, changed)]
    for name in SIGNALS:
        np.testing.assert_array_equal(*(getattr(run, name) for run in runs))
    assert coarse.step == 2.0 * step == 2.0 * changed.step
