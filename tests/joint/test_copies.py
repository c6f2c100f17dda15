"""A driven model is self-contained: copies, files and batches behave as one."""

from __future__ import annotations

import copy
import time
from dataclasses import replace

import mujoco
import mujoco.rollout
import numpy as np
import pytest
from messages import naming

from swgjoint.joint import plugin
from swgjoint.joint.attach import attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def start(b):
    """Some steps under load, so that the plugin's state is not zero."""
    b.place(0.1, -5e-4, 30.0, 0.5)
    b.data.qfrc_applied[b.v] = 0.2, -20.0
    mujoco.mj_step(b.model, b.data, 50)
    assert np.abs(b.data.plugin_state).min() > 0.0


def full_state(model, data):
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def run_on(model, data, steps=200):
    mujoco.mj_step(model, data, steps)
    return full_state(model, data)


def test_copies_continue_bitwise(bench, synthetic_map):
    """Copied, pickled state and set state continue with the same bits."""
    b = bench(synthetic_map)
    start(b)
    state = full_state(b.model, b.data)
    twin = copy.copy(b.data)
    fresh = mujoco.MjData(b.model)
    mujoco.mj_setState(b.model, fresh, state, STATE)
    used = mujoco.MjData(b.model)
    mujoco.mj_step(b.model, used, 7)
    mujoco.mj_copyData(used, b.model, b.data)
    want = run_on(b.model, b.data)
    for data in (twin, fresh, used):
        np.testing.assert_array_equal(run_on(b.model, data), want)


def test_copy_between_the_halves_of_a_step(bench, synthetic_map):
    """A copy taken between mj_step1 and mj_step2 completes the same step."""
    b = bench(synthetic_map)
    start(b)
    mujoco.mj_step1(b.model, b.data)
    twin = copy.copy(b.data)
    for data in (b.data, twin):
        mujoco.mj_step2(b.model, data)
    np.testing.assert_array_equal(run_on(b.model, twin), run_on(b.model, b.data))


@pytest.mark.parametrize("integrator", ["DISCRETE", "IMPLICITFAST"])
def test_a_fresh_copy_completes_the_step_of_a_specimen(
    bench, synthetic_map, friction_law, integrator
):
    """A copy into new data in mid-step ends it with the deviations of the tendon."""
    elements = (Jenkin(stiffness=1e4, yield_torque=3.0),)
    lossy = replace(synthetic_map, friction=friction_law, hysteresis=elements)
    b = bench(lossy, variable=True, step=2e-4)
    b.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    b.model.tendon_user[:] = 0.3, 0.2, 0.5, 0.1, 0.7
    b.place(0.1, -5e-4, 30.0, 0.5)
    mujoco.mj_step(b.model, b.data, 50)
    mujoco.mj_step1(b.model, b.data)
    twin = mujoco.MjData(b.model)
    mujoco.mj_copyData(twin, b.model, b.data)
    for data in (b.data, twin):
        mujoco.mj_step2(b.model, data)
    np.testing.assert_array_equal(
        full_state(b.model, twin), full_state(b.model, b.data)
    )


def test_a_copy_from_another_model_brings_its_state_alone(bench, synthetic_map):
    """With the state of a stiffer drive's data, a model moves with its own map."""
    soft = bench(synthetic_map)
    stiff = bench(replace(synthetic_map, potential=10.0 * synthetic_map.potential))
    start(stiff)
    want = mujoco.MjData(soft.model)
    mujoco.mj_setState(soft.model, want, full_state(stiff.model, stiff.data), STATE)
    mujoco.mj_copyData(soft.data, soft.model, stiff.data)
    np.testing.assert_array_equal(
        run_on(soft.model, soft.data), run_on(soft.model, want)
    )


def test_reset_starts_anew(bench, synthetic_map):
    """After a reset a run repeats bit by bit."""
    b = bench(synthetic_map)
    start(b)
    first = run_on(b.model, b.data)
    mujoco.mj_resetData(b.model, b.data)
    assert not b.data.plugin_state.any()
    start(b)
    np.testing.assert_array_equal(run_on(b.model, b.data), first)


def test_binary_model_holds_the_map(bench, synthetic_map, tmp_path):
    """A model written to mjb and read again steps with the same bits."""
    b = bench(synthetic_map)
    path = tmp_path / "joint.mjb"
    mujoco.mj_saveModel(b.model, str(path))
    # MuJoCo writes six digits
    again = mujoco.MjModel.from_binary_path(str(path))
    start(b)
    data = mujoco.MjData(again)
    mujoco.mj_setState(again, data, full_state(b.model, b.data), STATE)
    np.testing.assert_array_equal(run_on(again, data), run_on(b.model, b.data))


def test_rollout_on_threads_equals_loop(bench, synthetic_map):
    """Two threads of rollout give what the loop gives."""
    b = bench(synthetic_map)
    starts = []
    for k in range(4):
        mujoco.mj_resetData(b.model, b.data)
        b.place(0.1 * k, 3e-4 * k, 10.0, 0.2)
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(b.model, kind))
        mujoco.mj_getState(b.model, b.data, state, kind)
        starts.append(state)
    threads = [mujoco.MjData(b.model) for _ in range(2)]
    got, _ = mujoco.rollout.rollout(b.model, threads, np.array(starts), nstep=100)
    for k, state in enumerate(starts):
        mujoco.mj_resetData(b.model, b.data)
        mujoco.mj_setState(b.model, b.data, state, kind)
        mujoco.mj_step(b.model, b.data, 100)
        end = np.empty_like(state)
        mujoco.mj_getState(b.model, b.data, end, kind)
        np.testing.assert_array_equal(got[k, -1], end)


def test_xml_and_attached_copy_keep_the_drive(synthetic_map):
    """Written as XML, copied and attached under a prefix, the joint moves alike."""
    text = """<mujoco><option timestep="0.001" gravity="1 0 0"/><worldbody>
      <body name="link"><joint name="j" axis="0 0 1"/>
      <inertial pos=".2 .1 0" mass="3" diaginertia=".3 .3 .3"/></body>
      </worldbody></mujoco>"""
    spec = mujoco.MjSpec.from_string(text)
    attach(spec, joint="j", drive=synthetic_map, rotor_inertia=4e-5)
    want = run_on_spec(spec, "j")
    np.testing.assert_array_equal(run_on_spec(spec.copy(), "j"), want)
    # MuJoCo writes six digits
    again = mujoco.MjSpec.from_string(spec.to_xml())
    np.testing.assert_allclose(run_on_spec(again, "j"), want, rtol=1e-5)
    parent = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="0.001" integrator="discrete" gravity="1 0 0"/>'
        "<worldbody/></mujoco>"
    )
    for prefix in ("left_", "right_"):
        frame = parent.worldbody.add_frame()
        parent.attach(spec.copy(), prefix=prefix, frame=frame)
    model = parent.compile()
    assert model.nplugin == 2
    np.testing.assert_array_equal(run_on_spec(parent, "right_j"), want)


def run_on_spec(spec, joint):
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    return np.array([data.joint(joint).qpos[0], data.joint(joint + "_rotor").qpos[0]])


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("ratio", "-60 x", ("finite",)),
        ("ratio", "0", ("0",)),
        ("ratio", "-60 1", ("2", "1")),
        ("orders", "0 0 2", ("pairs",)),
        ("orders", "2 0 0 0", ("mean", "(0 0)")),
        ("orders", "0 0 2.5 0", ("integer", "1e6")),
        ("knots", "0 0", ()),
        ("knots", "0", ("two",)),
        ("knots", "0 nan", ("finite",)),
        ("knots", "0 1e999", ("finite",)),
        ("potential", "1 2 3", ("3", "10")),
        ("potential", "base64:AAAAAAAA8D8=", ("1", "10")),  # the number 1
        ("potential", "base64:AAAAAAAA8H8=", ("finite",)),  # infinite
        ("potential", "base64:AAAAAAAA8D8", ("finite",)),  # without its padding
        ("potential", "base64:AAAAAA==8D8=", ("finite",)),  # padding inside
        ("potential", "base64:AAAAAAAA 8D8", ("finite",)),
        ("potential", "base64:AAAAAAAA", ("finite",)),  # six bytes
        ("potential", "base64:====", ("finite",)),
        ("potential", "base64:", ("finite",)),
        ("end_stiffness", "", ("list", "finite")),
        ("kinematic_error", "0 0 0", ("3", "2")),
        ("damping", "-1", ("one", ">= 0")),
        ("damping", "1,5", ("one", ">= 0")),
        ("contact_damping", "-1", ("one", ">= 0")),
        ("numerical_damping", "2", ("0..1",)),
        ("passes", "1.5", ("integer", "1..20")),
    ],
)
def test_bad_attribute_is_rejected(key, value, says):
    """A bad attribute gives no model, and an error that names it."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = DriveMap.linear(1e4)
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5)
    spec.compile()
    [instance] = spec.plugins
    instance.config = {**plugin.config(drive, damping=1.0), key: value}
    with pytest.raises(ValueError, match=naming("'j_drive'", f"'{key}'", *says)):
        spec.compile()


def seconds_of_data(orders: int) -> float:
    """CPU seconds of simulation data for a map of so many orders, the least of two."""
    drive = DriveMap.linear(1e4)
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5)
    [instance] = spec.plugins
    flat = plugin.config(drive, damping=1.0)
    names = " ".join(f"{7 * k % 9973} {k % 3 if k else 0}" for k in range(orders))
    instance.config = (
        flat
        | {"orders": names}
        | {
            key: flat[key] + (orders - 1) * len(flat[key].split()) * " 0"
            for key in ("potential", "end_stiffness", "kinematic_error")
        }
    )
    model, spent = spec.compile(), []
    for _ in range(2):
        began = time.process_time()
        mujoco.MjData(model)
        spent.append(time.process_time() - began)
    return min(spent)


def test_data_of_thousands_of_harmonics_do_not_take_the_cube_of_their_number():
    """Eight times as many orders take less than 128 times as long, not 512 times."""
    assert seconds_of_data(4000) < 128.0 * seconds_of_data(500)


def test_a_tendon_of_the_other_sense_is_rejected():
    """The coefficient of the rotor must be 1/ratio, its sign included."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    drive = DriveMap.linear(1e4)
    attach(spec, joint="j", drive=drive, rotor_inertia=4e-5)
    [instance] = spec.plugins
    settings = plugin.config(drive, damping=1.0)
    instance.config = settings | {"ratio": f"{-drive.ratio:.17g}"}
    with pytest.raises(ValueError, match=naming("'j_drive'", "rotor", "ratio", "link")):
        spec.compile()
