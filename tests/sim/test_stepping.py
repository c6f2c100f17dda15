"""A run skips the search for contacts and the sensors only where there are none."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from swgjoint import attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim import simulation
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.stepping import skip_idle_stages
from swgjoint.view.run import run_scene

CONTACT = mujoco.mjtDisableBit.mjDSBL_CONTACT
SENSOR = mujoco.mjtDisableBit.mjDSBL_SENSOR
FREE = 'contype="0" conaffinity="0"'


def ball_on_floor(ball: str, floor: str, pair: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" {floor}/>
        <body pos="0 0 .2"><freejoint/><geom name="ball" size=".1" {ball}/></body>
        </worldbody><contact>{pair}</contact></mujoco>"""
    )


@pytest.mark.parametrize(
    "model",
    [
        ball_on_floor("", ""),
        ball_on_floor('contype="0"', 'conaffinity="0"'),
        ball_on_floor(FREE, FREE, '<pair geom1="ball" geom2="floor"/>'),
    ],
    ids=["both", "one way", "pair"],
)
def test_a_ball_that_may_touch_the_floor_rests_on_it(model):
    """The model itself is stepped, and the ball stays above the floor."""
    same = skip_idle_stages(model)
    assert same is model
    data = mujoco.MjData(same)
    mujoco.mj_step(same, data, 1000)
    assert data.qpos[2] == pytest.approx(0.1, abs=5e-3)


def test_a_ball_that_touches_nothing_falls_with_the_same_bits():
    """The copy skips the search; the model remains as it was."""
    model = ball_on_floor(FREE, FREE)
    quick = skip_idle_stages(model)
    assert quick.opt.disableflags & CONTACT
    assert not model.opt.disableflags & CONTACT
    ends = []
    for one in (model, quick):
        data = mujoco.MjData(one)
        mujoco.mj_step(one, data, 100)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)
    assert ends[0][2] < 0.2


@pytest.mark.parametrize("sensor", [False, True])
def test_the_sensors_of_an_arm_with_a_drive_keep_their_readings(sensor):
    """A model with a sensor still reads it; one without skips the stages."""
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><body><joint name="elbow" axis="0 1 0"/>
        <geom size=".1" mass="1" pos=".3 0 0"/></body></worldbody></mujoco>"""
    )
    if sensor:
        spec.add_sensor(
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname="elbow",
        )
    attach(spec, joint="elbow", drive=DriveMap.linear(2e4), rotor_inertia=1e-4)
    model = spec.compile()
    quick = skip_idle_stages(model)
    assert bool(quick.opt.disableflags & SENSOR) is not sensor
    data = mujoco.MjData(quick)
    mujoco.mj_step(quick, data, 100)
    assert abs(data.joint("elbow").qpos[0]) > 1e-6
    if sensor:
        mujoco.mj_forward(quick, data)
        assert data.sensordata[0] == data.joint("elbow").qpos[0]


@pytest.mark.parametrize("period", [None, 1e-3])
def test_a_run_has_the_same_bits_with_all_stages(monkeypatch, period):
    """The continuous and the sampled controller of an arm without obstacles."""
    changes = {"simulation.duration_s": 1.8}
    if period:
        changes["controller.control_period_s"] = period
    scene = Scene.load_file("ur5e-catalogue", changes)
    quick = run_scene(scene)
    monkeypatch.setattr(simulation, "skip_idle_stages", lambda model: model)
    np.testing.assert_array_equal(run_scene(scene).position, quick.position)
