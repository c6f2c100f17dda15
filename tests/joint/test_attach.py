"""Editing a model: what appears, where, and what is refused."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from messages import naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.joint import plugin
from swgjoint.joint.attach import attach
from swgjoint.joint.drive import prune
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import deg

ARM = """
<mujoco>
  <option timestep="0.001"/>
  <default><joint damping="3" armature="0.2" frictionloss="1"/>
    <tendon stiffness="7" damping="2" range="-1 1"/></default>
  <worldbody>
    <body name="upper" pos="0 0 1" euler="10 20 30">
      <joint name="shoulder" axis="0 1 .2" pos=".1 0 0"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".05"/>
      <frame euler="0 40 0" pos=".4 0 0">
        <body name="fore" pos="0 .1 0" euler="0 0 50">
          <joint name="elbow" axis="0 1 1" pos="0 0 .05" ref="30"/>
          <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/>
          <body name="slider"><joint name="slide" type="slide"/>
            <geom size=".05"/>
            <body name="ball"><joint name="ball" type="ball"/><geom size=".05"/></body>
          </body>
        </body>
      </frame>
      <body name="double"><joint name="first"/><joint name="second" axis="1 0 0"/>
        <geom size=".05"/></body>
    </body>
    <body name="loose"><freejoint name="free"/><geom size=".1"/></body>
  </worldbody>
  <actuator><motor name="old" joint="elbow"/></actuator>
</mujoco>
"""
QPOS = 0.3, 0.7, 0.01, 1, 0, 0, 0, 0.1, 0.2, 0, 0, 5, 1, 0, 0, 0


@pytest.fixture
def spec():
    return mujoco.MjSpec.from_string(ARM)


def test_full_adds_rotor_tendon_and_instance(spec, synthetic_map):
    """Names derive from the joint; nothing is inherited from the model's defaults."""
    got = attach(spec, joint="elbow", drive=synthetic_map, rotor_inertia=4e-5)
    assert (got.rotor, got.tendon, got.plugin) == (
        "elbow_rotor",
        "elbow_drive",
        "elbow_drive",
    )
    model = spec.compile()
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
    rotor, tendon = model.joint("elbow_rotor"), model.tendon("elbow_drive")
    dof = rotor.dofadr[0]
    assert model.dof_damping[dof] == model.dof_armature[dof] == 0
    assert model.dof_frictionloss[dof] == rotor.limited[0] == 0
    assert model.tendon_damping[tendon.id] == model.tendon_limited[tendon.id] == 0
    assert model.dof_armature[model.joint("elbow").dofadr[0]] == 0
    assert model.dof_armature[model.joint("shoulder").dofadr[0]] == 0.2
    assert model.nplugin == 1
    assert model.nu == 1


def test_rotor_stands_at_the_joint(spec, synthetic_map):
    """Anchor and axis of rotor and link coincide in any pose, frames included."""
    for name in ("shoulder", "elbow"):
        attach(spec, joint=name, drive=synthetic_map, rotor_inertia=4e-5)
    model = spec.compile()
    data = mujoco.MjData(model)
    for name in ("shoulder", "elbow"):
        data.joint(name).qpos = 0.7
        data.joint(name + "_rotor").qpos = -11.0
    mujoco.mj_kinematics(model, data)
    for name in ("shoulder", "elbow"):
        link, rotor = model.joint(name).id, model.joint(name + "_rotor").id
        np.testing.assert_allclose(data.xanchor[link], data.xanchor[rotor], atol=1e-12)
        np.testing.assert_allclose(data.xaxis[link], data.xaxis[rotor], atol=1e-12)


@pytest.mark.parametrize("level", ["linear", "full"])
def test_no_torsion_at_qpos0_with_ref(spec, level):
    """A joint whose reference is not 0 starts without torsion."""
    drive = DriveMap.linear(1e4)
    got = attach(spec, joint="elbow", drive=drive, level=level, rotor_inertia=4e-5)
    model = spec.compile()
    data = mujoco.MjData(model)
    assert data.joint("elbow").qpos[0] == pytest.approx(30 * deg)
    assert got.observe(model, data).torsion == pytest.approx(0.0, abs=1e-15)


def test_rigid_reflects_inertia(spec, synthetic_map):
    """Level rigid is an armature i²J, no degree of freedom, tendon or plugin."""
    before = spec.copy().compile()
    got = attach(
        spec, joint="elbow", drive=synthetic_map, level="rigid", rotor_inertia=4e-5
    )
    model = spec.compile()
    assert (model.nv, model.ntendon, model.nplugin) == (before.nv, 0, 0)
    assert model.opt.integrator == before.opt.integrator
    dof = model.joint("elbow").dofadr[0]
    assert model.dof_armature[dof] == pytest.approx(60**2 * 4e-5)
    assert got.rotor is got.tendon is got.plugin is None


def test_rigid_torque_is_what_the_link_gets(synthetic_map):
    """Motor torque times i less the reflected inertia's share moves the link."""
    spec = mujoco.MjSpec.from_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j"/>
        <inertial pos="0 0 0" mass="1" diaginertia=".5 .5 .5"/></body></worldbody>
        </mujoco>"""
    )
    got = attach(
        spec, joint="j", drive=synthetic_map, level="rigid", rotor_inertia=1e-4
    )
    motor = spec.add_actuator(name="motor", target=got.joint)
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    motor.gear[0] = got.ratio
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[0] = -0.5
    mujoco.mj_step(model, data)
    signals = got.observe(model, data)
    assert signals.torque == pytest.approx(0.5 * data.qacc[0])
    assert signals.torque == pytest.approx(30 * 0.5 / (0.5 + 60**2 * 1e-4))
    assert signals.torsion == signals.transmission_error == 0.0


def test_keyframes_grow_by_the_rotor(spec, synthetic_map):
    """Every keyframe keeps its joints and gets the rotor without torsion."""
    spec.add_key(name="a", qpos=QPOS, qvel=np.arange(14.0))
    spec.add_key(name="b")
    before = spec.copy().compile()
    for name in ("elbow", "shoulder"):
        attach(spec, joint=name, drive=DriveMap.linear(1e4), rotor_inertia=4e-5)
    model = spec.compile()
    data = mujoco.MjData(model)
    old = mujoco.MjData(before)
    mujoco.mj_resetDataKeyframe(before, old, 0)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name in ("shoulder", "elbow", "slide", "ball", "first", "second", "free"):
        np.testing.assert_array_equal(data.joint(name).qpos, old.joint(name).qpos)
        np.testing.assert_array_equal(data.joint(name).qvel, old.joint(name).qvel)
    for name in ("shoulder", "elbow"):
        rotor = data.joint(name + "_rotor")
        assert rotor.qpos == pytest.approx(-100 * data.joint(name).qpos)
        assert rotor.qvel == pytest.approx(-100 * data.joint(name).qvel)


def test_damping_is_a_share_of_critical(bench):
    """The free torsion oscillation decays with the damping ratio that was asked for."""
    b = bench(DriveMap.linear(2e4), integrator="RK4", step=2e-5, damping_ratio=0.03)
    b.place(0.0, 1e-3)
    lows = []
    previous = (1e-3, 1e-3)
    for _ in range(4000):
        mujoco.mj_step(b.model, b.data)
        x = float(b.data.qpos[b.q] @ [1 / b.drive.ratio, -1])
        if previous[0] > previous[1] < x:
            lows.append(previous[1])
        previous = (previous[1], x)
    assert lows[0] < 0 and len(lows) > 4
    decrement = np.log(lows[0] / lows[4]) / 4
    zeta = decrement / np.hypot(2 * np.pi, decrement)
    assert zeta == pytest.approx(0.03, rel=2e-3)  # peaks are read at whole steps


@pytest.mark.parametrize(
    ("joint", "says"),
    [
        ("wrist", ("shoulder", "elbow", "slide", "ball", "first", "second", "free")),
        ("slide", ("slide joint", "hinge")),
        ("ball", ("ball joint", "hinge")),
        ("free", ("free joint", "hinge")),
        ("second", ("first", "'double'")),
    ],
)
def test_joint_that_takes_no_drive(spec, synthetic_map, joint, says):
    """A joint that cannot be driven is named with what would be accepted."""
    before = spec.to_xml()
    with pytest.raises(InputError, match=naming(f"'{joint}'", *says)):
        attach(spec, joint=joint, drive=synthetic_map, rotor_inertia=4e-5)
    assert spec.to_xml() == before


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"rotor_inertia": 0.0}, ("rotor_inertia", "0.0 kg·m²", "> 0")),
        ({"rotor_inertia": float("nan")}, ("rotor_inertia", "nan kg·m²", "> 0")),
        (
            {"level": "soft"},
            ("level", "'soft'", "rigid", "kinematic", "linear", "native", "full"),
        ),
        ({"damping_ratio": -0.1}, ("damping_ratio", "-0.1", "'elbow'", "0", "1")),
        ({"max_input_speed": 0.0}, ("max_input_speed", "0.0 rad/s", "> 0")),
    ],
)
def test_bad_value_is_refused(spec, synthetic_map, keys, says):
    """A value outside its range gives one line with value and unit."""
    with pytest.raises(InputError, match=naming(*says)):
        attach(
            spec,
            joint="elbow",
            drive=synthetic_map,
            **{"rotor_inertia": 4e-5, **keys},
        )


def test_second_drive_on_a_joint_is_refused(spec, synthetic_map):
    """A joint takes one drive."""
    attach(spec, joint="elbow", drive=synthetic_map, rotor_inertia=4e-5)
    with pytest.raises(InputError, match=naming("joint", "'elbow'", "drive")):
        attach(spec, joint="elbow", drive=synthetic_map, rotor_inertia=4e-5)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        (
            "inertiafromgeom",
            mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE,
            ("true", "auto", "false"),
        ),
        ("settotalmass", 20.0, ("20.0 kg", "not set")),
        ("boundinertia", 1e-3, ("0.001 kg·m²", "4e-05 kg·m²")),
    ],
)
def test_compiler_that_changes_the_rotor(spec, synthetic_map, key, value, says):
    """A compiler setting that would change the rotor's inertia is refused by name."""
    setattr(spec.compiler, key, value)
    with pytest.raises(InputError, match=naming("compiler", key, *says)):
        attach(spec, joint="elbow", drive=synthetic_map, rotor_inertia=4e-5)


def test_options_that_break_the_scheme(spec, synthetic_map):
    """PGS is refused; noslip and implicitfast warn; RK4 is kept."""
    keys = {"joint": "elbow", "drive": synthetic_map, "rotor_inertia": 4e-5}
    pgs = spec.copy()
    pgs.option.solver = mujoco.mjtSolver.mjSOL_PGS
    with pytest.raises(InputError, match=naming("solver", "PGS", "Newton", "CG")):
        attach(pgs, **keys)
    noslip = spec.copy()
    noslip.option.noslip_iterations = 3
    with pytest.warns(UserWarning, match=naming("noslip_iterations", "0")):
        attach(noslip, **keys)
    fast = spec.copy()
    fast.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    with pytest.warns(
        UserWarning, match=naming("integrator", "implicitfast", "discrete", "RK4")
    ):
        attach(fast, level="linear", **keys)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    attach(spec, **keys)
    assert spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4


def test_engine_without_the_metric_is_refused(spec, synthetic_map, monkeypatch):
    """If the engine ignores the metric, discrete is refused and RK4 still works."""
    monkeypatch.setattr(plugin, "metric_error", lambda: 0.3)
    plugin.require_metric.cache_clear()
    try:
        keys = {"joint": "elbow", "drive": synthetic_map, "rotor_inertia": 4e-5}
        with pytest.raises(
            ComputationError,
            match=naming("MuJoCo", mujoco.__version__, "integrator", "RK4", "3.0e-01"),
        ):
            attach(spec, **keys)
        assert spec.joint("elbow_rotor") is None
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        attach(spec, **keys)
    finally:
        plugin.require_metric.cache_clear()


def test_other_mujoco_version_is_named(monkeypatch):
    """Another MuJoCo is refused with the version that is needed."""
    plugin.load()
    monkeypatch.setattr(mujoco, "__version__", "3.3.0")
    with pytest.raises(
        ComputationError, match=naming("3.3.0", "4.0.0", "pip install mujoco==4.0.0")
    ):
        plugin.load.__wrapped__()
    monkeypatch.undo()
    monkeypatch.setattr(plugin, "library", lambda: plugin.Path("nowhere.so"))
    with pytest.raises(
        ComputationError,
        match=naming(
            "nowhere.so",
            "4.0.0",
            "C++",
            "'rigid'",
            "'kinematic'",
            "'linear'",
            "'native'",
        ),
    ):
        plugin.load.__wrapped__()


def test_metric_reaches_the_engine():
    """One step equals (M + h² p g g')⁻¹ h f with the twin's p and g."""
    assert plugin.metric_error() < 1e-12


def test_unresolved_harmonics_are_listed(spec, synthetic_map):
    """Orders that the step cannot carry are left out, with their amplitudes."""
    spec.option.timestep = 2e-3
    got = attach(
        spec,
        joint="elbow",
        drive=synthetic_map,
        rotor_inertia=4e-5,
        max_input_speed=60.0,
    )
    # h n v <= 0.5: n up to 4.17 stays, (3, 1) is 4 - 1/i = 4 + 1/60
    assert [u.order for u in got.unresolved] == [122.0]
    assert got.kept_orders == pytest.approx((2.0, 4.0, 4.0 + 1 / 60))
    [left] = got.unresolved
    assert left.error == pytest.approx(np.hypot(*synthetic_map.kinematic_error[3]))
    x = synthetic_map.mean_torsion(50.0)
    phase = np.linspace(0, 2 * np.pi, 400)
    alone = synthetic_map.coefficients(x, 1)[3] @ [np.cos(phase), np.sin(phase)]
    assert left.torque == pytest.approx(np.ptp(alone) / 2, rel=1e-4)
    assert len(got.drive.orders) == 4


def test_equal_harmonics_make_one_map(synthetic_map):
    """Two speeds that the same orders carry share a map; a third one does not."""
    steps = {"timestep": 2e-3, "max_phase_step": 0.5}
    first, second, third = (
        prune(synthetic_map, max_input_speed=speed, **steps)
        for speed in (60.0, 61.0, 120.0)
    )
    assert second[0] is first[0] and second[1] == first[1]
    assert len(first[0].orders) == 4 and len(third[0].orders) == 2
    assert [left.order for left in third[1]] == pytest.approx([4.0, 4 + 1 / 60, 122.0])


TURNTABLE = """
<mujoco>
  <option timestep="1e-4" gravity="0 0 0" integrator="RK4"/>
  <worldbody>
    <body name="table"><joint name="turn" axis="0 0 1"/>
      <joint name="tilt" axis="0 1 0"/>
      <geom size=".1" mass="1"/>
      <body name="link" pos="0 0 .1"><joint name="joint" axis="1 0 0"/>
        <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".1"/></body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(("rotor", "part"), [("gyroscopic", 1.0), ("lumped", 0.0)])
def test_a_spinning_rotor_resists_turning_unless_lumped(rotor, part):
    """Turning a spin J w about z by W takes J w W about y; lumped it takes nothing."""
    spec = mujoco.MjSpec.from_string(TURNTABLE)
    inertia, spin, turn = 2e-4, 300.0, 0.7
    attach(
        spec,
        joint="joint",
        drive=DriveMap.linear(1e4),
        level="linear",
        rotor_inertia=inertia,
        rotor=rotor,
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("turn").qvel = turn
    mujoco.mj_forward(model, data)
    still = data.joint("tilt").qfrc_bias.copy()
    data.joint("joint_rotor").qvel = spin
    mujoco.mj_forward(model, data)
    moment = data.joint("tilt").qfrc_bias - still
    assert abs(moment[0]) == pytest.approx(part * inertia * spin * turn, abs=1e-9)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    dof = int(model.joint("joint_rotor").dofadr[0])
    assert mass[dof, dof] == pytest.approx(inertia, rel=1e-12)


def test_an_unknown_rotor_is_refused(spec, synthetic_map):
    """One line; the spec is unchanged."""
    with pytest.raises(
        InputError, match=naming("rotor", "'stiff'", "gyroscopic", "lumped")
    ):
        attach(
            spec, joint="elbow", drive=synthetic_map, rotor_inertia=1e-5, rotor="stiff"
        )
    assert spec.body("elbow_rotor") is None


def test_a_second_hinge_of_a_body_says_what_is_accepted():
    """A body of its own, or no drive."""
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="wrist"><geom size=".1"/>'
        '<joint name="yaw"/><joint name="roll"/></body></worldbody></mujoco>'
    )
    with pytest.raises(InputError, match=naming("'roll'", "'wrist'", "--joints")):
        attach(spec, joint="roll", drive=DriveMap.linear(1e4), rotor_inertia=1e-5)
