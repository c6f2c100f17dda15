"""Drives on many joints at once: the same model as one by one, whole or not at all."""

from __future__ import annotations

import warnings
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach, attach_all
from swgjoint.joint.fitting import Fitting
from swgjoint.maps.drive_map import DriveMap

ARM = """
<mujoco>
  <option timestep="0.001" integrator="{integrator}"/>
  <default><joint armature="0.2" damping="1"/></default>
  <worldbody>
    <body name="base"><freejoint name="free"/><geom size=".1"/>
      <body name="upper" pos="0 0 .2" euler="10 20 30">
        <joint name="shoulder" axis="0 1 .2" pos=".1 0 0"/>
        <geom type="capsule" fromto="0 0 0 .4 0 0" size=".05"/>
        <body name="fore" pos=".4 .1 0" euler="0 0 50">
          <joint name="elbow" axis="0 1 1" ref="30"/>
          <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/>
          <body name="hand" pos=".3 0 0"><joint name="wrist" axis="1 0 1"/>
            <geom pos=".05 .02 0" size=".05"/></body>
        </body>
      </body>
      <body name="left" pos="0 .3 0"><joint name="finger" axis="1 0 0"/>
        <geom pos="0 0 .1" size=".05"/></body>
    </body>
  </worldbody>
  <actuator>
    <position joint="shoulder" kp="400" dampratio="1"/>
    <position joint="elbow" kp="300" dampratio="0.7"/>
    <position joint="wrist" kp="50" dampratio="0.9" armature=".05"/>
    <motor joint="finger"/>
  </actuator>
  <keyframe>
    <key name="a" qpos="0 0 1 1 0 0 0 .3 .5 .7 .9"
      qvel="0 0 0 0 0 0 .1 .2 .3 .4"/>
    <key name="b"/>
  </keyframe>
</mujoco>
"""
JOINTS = ("shoulder", "elbow", "wrist", "finger")


def arm(integrator="discrete"):
    return mujoco.MjSpec.from_string(ARM.format(integrator=integrator))


def numbers(model, name):
    """A field of a model as numbers; text attributes of the plugin are parsed."""
    values = getattr(model, name)
    if name != "plugin_attr":
        return np.asarray(values, float)
    words = bytes(values.astype(np.uint8)).replace(b"\0", b" ").split()
    return np.array([float(word) for word in words])


def assert_equal_models(one, other):
    """Every field, to round-off."""
    assert one.nq == other.nq
    fields = [n for n in dir(one) if isinstance(getattr(one, n), np.ndarray)]
    # round-off changes the length of a number as text
    fields = [n for n in fields if n not in ("_sizes", "plugin_attradr")]
    assert {"body_mass", "key_qpos", "actuator_biasprm", "plugin_attr"} < set(fields)
    for name in fields:
        np.testing.assert_allclose(
            numbers(one, name),
            numbers(other, name),
            rtol=1e-9,
            atol=1e-12,
            err_msg=name,
        )


@pytest.fixture
def rubbing(synthetic_map, friction_law):
    return replace(synthetic_map, friction=friction_law)


@pytest.mark.parametrize("rotor", ["gyroscopic", "lumped"])
@pytest.mark.parametrize("level", ["rigid", "linear", "full"])
def test_together_is_one_by_one_in_the_order_of_the_model(level, rotor, rubbing):
    """Compiled models are equal, damping ratios and keyframes too, in any order given.

    A heavy rotor, so that what the drives before a joint add to its inertia counts.
    """
    keys = {"drive": rubbing, "rotor_inertia": 2e-2, "level": level, "rotor": rotor}
    single, together = arm(), arm()
    one = {name: attach(single, joint=name, **keys) for name in JOINTS}
    fittings = {name: Fitting(**keys) for name in reversed(JOINTS)}
    got = attach_all(together, fittings)
    assert tuple(got) == JOINTS
    for name in JOINTS:
        assert got[name].damping == pytest.approx(one[name].damping, rel=1e-12)
        assert got[name].link_inertia == pytest.approx(one[name].link_inertia)
        for key in ("rotor", "tendon", "plugin", "motors", "ratio"):
            assert getattr(got[name], key) == getattr(one[name], key)
    assert_equal_models(together.compile(), single.compile())


@pytest.mark.parametrize("count", [2, 4])
def test_many_drives_take_two_compilations(monkeypatch, count):
    """One for the places and one for the keyframes, however many joints."""
    compile_, seen = mujoco.MjSpec.compile, []
    monkeypatch.setattr(
        mujoco.MjSpec, "compile", lambda self: (seen.append(1), compile_(self))[1]
    )
    fitting = Fitting(drive=DriveMap.linear(1e4), rotor_inertia=1e-4)
    attach_all(arm(), dict.fromkeys(JOINTS[:count], fitting))
    assert len(seen) == 2


def test_all_or_none(rubbing):
    """Two joints that cannot take a drive are listed; no other gets one."""
    spec = arm()
    before = spec.to_xml()
    fitting = Fitting(drive=rubbing, rotor_inertia=1e-4)
    with pytest.raises(InputError) as caught:
        attach_all(spec, dict.fromkeys(["shoulder", "ankle", "free"], fitting))
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert names(lines[0], "'ankle'", "elbow") and names(lines[1], "'free'", "hinge")
    assert spec.to_xml() == before
    with warnings.catch_warnings(), pytest.raises(UserWarning):
        warnings.simplefilter("error")
        attach_all(fast := arm("implicitfast"), {"elbow": fitting})
    assert fast.to_xml() == arm("implicitfast").to_xml()


@pytest.mark.parametrize("integrator", ["implicit", "implicitfast"])
@pytest.mark.parametrize("level", ["linear", "full"])
def test_an_integrator_that_diverges_is_replaced_with_one_line(integrator, level):
    """Discrete takes its place, said once for a model; ``keep`` leaves it."""
    spec, kept = arm(integrator), arm(integrator)
    keys = {"drive": DriveMap.linear(1e4), "rotor_inertia": 1e-4, "level": level}
    with pytest.warns(
        UserWarning, match=naming("integrator", integrator, "discrete", "'keep'")
    ) as caught:
        for name in JOINTS:
            attach(spec, joint=name, **keys)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    assert spec.option.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
    attach(kept, joint="elbow", integrator="keep", **keys)
    assert kept.option.integrator == arm(integrator).option.integrator
    rigid = arm(integrator)
    attach(rigid, joint="elbow", **{**keys, "level": "rigid"})
    assert rigid.option.integrator == kept.option.integrator
    with pytest.raises(InputError, match=naming("'euler'", "discrete", "keep")):
        attach(kept, joint="wrist", integrator="euler", **keys)


FLOOR = """
<mujoco>
  <option timestep="0.004" iterations="{iterations}" tolerance="{tolerance}"/>
  <worldbody><geom type="plane" size="1 1 1"/>
    <body pos="0 0 .9"><freejoint/><geom size=".1"/>
      <body name="l" pos="0 .1 0"><joint name="l" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/>
        <body pos="0 0 -.3"><joint name="ll" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/></body></body>
      <body name="r" pos="0 -.1 0"><joint name="r" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/>
        <body pos="0 0 -.3"><joint name="rl" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/></body></body>
    </body></worldbody>
  <keyframe><key qpos="0 0 .6 1 0 0 0 .2 -.3 -.1 .2"/></keyframe>
</mujoco>
"""


@pytest.mark.parametrize(
    ("iterations", "tolerance", "loud"),
    [(1, 1e-8, True), (3, 1e-8, True), (100, 1e-3, True), (100, 1e-8, False)],
)
def test_a_solver_that_ends_too_early_is_given_more(iterations, tolerance, loud):
    """The torques of few iterations are those of many, and the engine has no doubt.

    One line says so; ``keep`` keeps them and says what to use.
    """
    told = {"iterations": iterations, "tolerance": tolerance}
    fitting = Fitting(drive=DriveMap.linear(2e4), rotor_inertia=1e-4)
    torques = []
    for values in (told, {"iterations": 1000, "tolerance": 1e-14}):
        spec = mujoco.MjSpec.from_string(FLOOR.format(**values))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            got = attach_all(spec, dict.fromkeys(["l", "ll", "r", "rl"], fitting))
        lines = [str(one.message) for one in caught]
        assert len(lines) == (loud and values is told)
        for line in lines:
            assert names(line, f"iterations {iterations}", f"{tolerance:g}")
            assert names(line, "100", "1e-08")
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_step(model, data, 25)
        assert not any(warning.number for warning in data.warning)
        torques.append([float(one.observe(model, data).torque) for one in got.values()])
    assert np.abs(torques).max() > 1.0
    np.testing.assert_allclose(*torques, rtol=1e-4, atol=1e-4)
    kept = mujoco.MjSpec.from_string(FLOOR.format(**told))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        attach_all(kept, {"l": fitting}, integrator="keep")
    assert (kept.option.iterations, kept.option.tolerance) == (iterations, tolerance)


MENAGERIE = """
<mujoco model="arm">
  <compiler angle="radian" autolimits="true"/>
  <option integrator="implicitfast"/>
  <default>
    <default class="arm">
      <joint axis="0 1 0" range="-2.9 2.9" armature="0.1"/>
      <general gaintype="fixed" biastype="affine" gainprm="2000"
        biasprm="0 -2000 -200" ctrlrange="-2.9 2.9" forcerange="-150 150"/>
      <default class="small">
        <joint axis="0 0 1"/>
        <general gainprm="500" biasprm="0 -500 -50" forcerange="-28 28"/>
      </default>
    </default>
  </default>
  <worldbody>
    <body name="base" childclass="arm"><inertial pos="0 0 0" mass="4"
        diaginertia=".02 .02 .01"/>
      <body name="l1" pos="0 0 .2"><inertial pos="0 0 .05" mass="4"
          diaginertia=".02 .02 .01"/><joint name="j1" axis="0 0 1"/>
        <body name="l2"><inertial pos="0 0 .2" mass="8" diaginertia=".2 .2 .02"/>
          <joint name="j2"/>
          <body name="l3" pos="0 0 .4"><inertial pos="0 0 .2" mass="2.3"
              diaginertia=".03 .03 .003"/><joint name="j3"/>
            <body name="l4" pos="0 0 .4"><inertial pos="0 .1 0" mass="1.2"
                diaginertia=".003 .003 .003"/>
              <joint name="j4" class="small" axis="0 1 0"/>
              <body name="l5" pos="0 .1 0"><inertial pos="0 0 .1" mass="1.2"
                  diaginertia=".003 .003 .003"/><joint name="j5" class="small"/>
                <body name="l6" pos="0 0 .1"><inertial pos="0 .05 0" mass=".2"
                    diaginertia="1e-4 1e-4 1e-4"/>
                  <joint name="j6" class="small" axis="0 1 0"/></body>
              </body></body></body></body></body></body>
  </worldbody>
  <actuator>
    <general class="arm" joint="j1"/><general class="arm" joint="j2"/>
    <general class="arm" joint="j3"/><general class="small" joint="j4"/>
    <general class="small" joint="j5"/><general class="small" joint="j6"/>
  </actuator>
  <keyframe><key name="home" qpos="-1.57 -1 1.57 -1.57 -1.57 0"
    ctrl="-1.57 -1 1.57 -1.57 -1.57 0"/></keyframe>
</mujoco>
"""


def test_an_arm_that_says_implicitfast_runs_for_two_seconds():
    """With stiff drives on all hinges its links move as in the file without drives."""
    spec = mujoco.MjSpec.from_string(MENAGERIE)
    joints = [joint.name for joint in spec.joints]
    bare = spec.copy().compile()
    # rotors as heavy as the armature of the file, and a thousandth of its servos' sag
    drive = DriveMap.linear(2e6)
    fitting = Fitting(drive=drive, rotor_inertia=0.1 / drive.ratio**2)
    with pytest.warns(UserWarning, match=naming("implicitfast", "discrete")):
        attach_all(spec, dict.fromkeys(joints, fitting))
    model = spec.compile()
    runs = []
    for m in (bare, model):
        data = mujoco.MjData(m)
        mujoco.mj_resetDataKeyframe(m, data, 0)
        path = []
        for k in range(round(2.0 / m.opt.timestep)):
            data.ctrl[:] = m.key_ctrl[0] + 0.1 * np.sin(np.pi * data.time)
            mujoco.mj_step(m, data)
            if k % 20 == 0:
                path.append([data.joint(name).qpos[0] for name in joints])
        assert data.time == pytest.approx(2.0)
        assert not any(warning.number for warning in data.warning)
        runs.append(np.array(path))
    assert np.ptp(runs[0], axis=0).min() > 0.1
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-3)


def test_user_data_of_the_defaults_do_not_reach_a_drive(rubbing):
    """Five numbers in ``<default><tendon user>`` would be taken for deviations."""
    plain = mujoco.MjSpec.from_string(ARM.format(integrator="discrete"))
    told = mujoco.MjSpec.from_string(
        ARM.format(integrator="discrete")
        .replace("<default>", '<size nuser_tendon="6"/><default>')
        .replace("</default>", '<tendon user="1 .5 .1 .2 3 4"/></default>')
    )
    for spec in (plain, told):
        attach(spec, joint="elbow", drive=rubbing, rotor_inertia=1e-4)
    model = told.compile()
    assert not model.tendon_user.any()
    ends = []
    for one in (plain.compile(), model):
        data = mujoco.MjData(one)
        mujoco.mj_step(one, data, 50)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)


def test_limits_of_iterations_are_raised_once(rubbing):
    """Few iterations, as files for other solvers state them, would end the solve."""
    spec = arm()
    spec.option.iterations, spec.option.ls_iterations = 3, 200
    fittings = {name: Fitting(drive=rubbing, rotor_inertia=1e-4) for name in JOINTS}
    with pytest.warns(UserWarning, match=naming("3", "100", "discrete")) as said:
        attach_all(spec, fittings)
    assert len(said) == 1
    assert (spec.option.iterations, spec.option.ls_iterations) == (100, 200)


def test_limits_of_iterations_stay_without_the_discrete_integrator(rubbing):
    """RK4 solves for no stiffness: the file's limits are the user's affair."""
    spec = arm("RK4")
    spec.option.iterations = 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        attach(spec, joint="elbow", drive=rubbing, rotor_inertia=1e-4)
    assert spec.option.iterations == 3
