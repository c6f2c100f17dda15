"""A run skips the search for contacts only where nothing can touch."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from swgjoint.sim import simulation
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.stepping import skip_contact_search
from swgjoint.view.run import run_scene

CONTACT = mujoco.mjtDisableBit.mjDSBL_CONTACT
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
    same = skip_contact_search(model)
    assert same is model
    data = mujoco.MjData(same)
    mujoco.mj_step(same, data, 1000)
    assert data.qpos[2] == pytest.approx(0.1, abs=5e-3)


def test_a_ball_that_touches_nothing_falls_with_the_same_bits():
    """The copy skips the search; the model remains as it was."""
    model = ball_on_floor(FREE, FREE)
    quick = skip_contact_search(model)
    assert quick.opt.disableflags & CONTACT
    assert not model.opt.disableflags & CONTACT
    ends = []
    for one in (model, quick):
        data = mujoco.MjData(one)
        mujoco.mj_step(one, data, 100)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)
    assert ends[0][2] < 0.2


@pytest.mark.parametrize("period", [None, 1e-3])
def test_a_run_has_the_same_bits_with_the_search(monkeypatch, period):
    """The continuous and the sampled controller of an arm without obstacles."""
    changes = {"simulation.duration_s": 1.8}
    if period:
        changes["controller.control_period_s"] = period
    scene = Scene.load_file("ur5e-catalogue", changes)
    quick = run_scene(scene)
    monkeypatch.setattr(simulation, "skip_contact_search", lambda model: model)
    np.testing.assert_array_equal(run_scene(scene).position, quick.position)
