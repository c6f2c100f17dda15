"""A model in its user's own loop says where it leaves the integrator's region."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import names, naming

from swgjoint.joint.attach import attach, attach_all
from swgjoint.joint.fitting import Fitting
from swgjoint.joint.region import check_region
from swgjoint.joint.watch import NUMERIC, limits
from swgjoint.maps.drive_map import DriveMap

PAIR = """
<mujoco>
  <option timestep="{step}" integrator="discrete" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="a" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia=".4 .4 .4"/></body>
    <body><joint name="b" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia=".4 .4 .4"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def said():
    """What the engine warns of."""
    lines: list[str] = []
    mujoco.set_mju_user_warning(lines.append)
    yield lines
    mujoco.set_mju_user_warning(None)


def watched(drive, step=5e-4, watch=True, **keys):
    """Two joints with a drive each: spec and what attach returned."""
    spec = mujoco.MjSpec.from_string(PAIR.format(step=step))
    fitting = Fitting(drive=drive, rotor_inertia=4e-5, **keys)
    return spec, attach_all(spec, dict.fromkeys("ab", fitting), watch=watch)


@pytest.mark.parametrize("level", ["full", "linear"])
def test_a_step_outside_at_rest_gives_one_warning(level):
    """It names a joint, the step and the one that would do; a native spring has none.

    That step is accepted.
    """
    drive = DriveMap.linear(2e4)
    if level == "linear":
        watched(drive, step=0.02, level=level)
        return
    with pytest.warns(
        UserWarning, match=naming("'a'", "20 ms", "a step of 5 ms would do")
    ) as caught:
        watched(drive, step=0.02, level=level)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    watched(drive, step=0.005, level=level)


def test_a_warning_as_error_leaves_the_spec(synthetic_map):
    """Whole or not at all, also where the warning is raised."""
    spec = mujoco.MjSpec.from_string(PAIR.format(step=0.02))
    before = spec.to_xml()
    with pytest.raises(UserWarning):
        attach(spec, joint="a", drive=synthetic_map, rotor_inertia=4e-5, watch=True)
    assert spec.to_xml() == before


def test_bounds_in_the_model_are_those_of_the_region(synthetic_map):
    """Inside every scheme's bound is ok, outside is not; further drives tighten it."""
    spec, got = watched(synthetic_map)
    *steps, phase = spec.compile().numeric(NUMERIC).data
    np.testing.assert_array_equal([*steps, phase], limits(got.values()))
    for step, name in zip(steps, ("discrete", "RK4", "implicitfast"), strict=True):
        inside = check_region(got["a"], timestep=step, integrator=name)
        outside = check_region(got["a"], timestep=1.001 * step, integrator=name)
        assert inside.ok and not outside.ok
    spec = mujoco.MjSpec.from_string(PAIR.format(step=1e-3))
    alone = {}
    for joint, stiffness in (("a", 1e4), ("b", 4e4)):
        one = {"drive": DriveMap.linear(stiffness), "rotor_inertia": 4e-5}
        alone[joint] = attach(spec, joint=joint, watch=True, **one)
    stored = spec.compile().numeric(NUMERIC).data
    np.testing.assert_array_equal(stored, limits([alone["b"]]))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"timestep": 0.02}, ("20 ms", "a step of 5 ms")),
        (
            {"integrator": mujoco.mjtIntegrator.mjINT_IMPLICITFAST, "timestep": 4e-3},
            ("4 ms", "discrete"),
        ),
        ({"integrator": mujoco.mjtIntegrator.mjINT_RK4, "timestep": 0.01}, ("10 ms",)),
    ],
)
def test_a_step_that_is_changed_later_is_said_once(said, change, says):
    """Once for two joints and three simulations; the step before said nothing."""
    spec, _ = watched(DriveMap.linear(2.1e4), step=1.01e-3)
    model = spec.compile()
    data = [mujoco.MjData(model) for _ in range(3)]
    for one in data:
        mujoco.mj_step(model, one, 3)
    assert said == []
    for key, value in change.items():
        setattr(model.opt, key, value)
    for one in data:
        mujoco.mj_step(model, one, 3)
    [line] = said
    assert names(line, "'a_drive'", *says)


def test_a_speed_that_the_step_cannot_carry_is_said_once(said, synthetic_map):
    """Order 122 at 0.51 ms: 7.8 rad/s are carried, 9 are not; pruned all are."""
    for keys, loud in (({}, True), ({"max_input_speed": 20.0}, False)):
        spec, _ = watched(synthetic_map, step=5.1e-4, **keys)
        model = spec.compile()
        data = mujoco.MjData(model)
        rotor = model.joint("a_rotor").dofadr[0]
        for speed in (0.49 / 122 / 5.1e-4, 0.52 / 122 / 5.1e-4, 9.0):
            data.qvel[rotor] = speed
            mujoco.mj_forward(model, data)
            if speed < 8.0:
                assert said == []
        assert len(said) == loud
        if loud:
            assert names(said.pop(), "'a_drive'", "order 122", "0.5", "max_input_speed")


def test_the_bounds_travel_with_the_model(said, synthetic_map):
    """Through XML and under a prefix; without ``watch`` there is nothing to say."""
    outer = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="5e-4" integrator="discrete" gravity="0 0 0"/>'
        "<worldbody/></mujoco>"
    )
    inner, _ = watched(synthetic_map)
    outer.attach(inner, prefix="left_", frame=outer.worldbody.add_frame())
    outer.option.timestep = 0.021
    model = mujoco.MjModel.from_xml_string(outer.to_xml())
    mujoco.mj_step(model, mujoco.MjData(model))
    [line] = said
    assert names(line, "'left_a_drive'", "21 ms")
    said.clear()
    quiet, _ = watched(synthetic_map, step=0.022, watch=False)
    model = quiet.compile()
    mujoco.mj_step(model, mujoco.MjData(model))
    assert said == [] and model.nnumeric == 0


def test_watching_changes_no_motion(synthetic_map, friction_law):
    """The same bits with and without."""
    drive, ends = replace(synthetic_map, friction=friction_law), []
    for watch in (False, True):
        model = watched(drive, watch=watch)[0].compile()
        data = mujoco.MjData(model)
        data.qvel[:] = 0.02
        mujoco.mj_step(model, data, 100)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)
