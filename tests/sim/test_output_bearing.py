"""Output bearings: closed forms of the tilt, ratings and life, and no trace without."""

from __future__ import annotations

import json

import mujoco
import numpy as np
import pytest
from messages import naming

import swgjoint
from swgjoint.errors import InputError
from swgjoint.gear.bearing.output_bearing import OutputBearing, catalogue_bearing
from swgjoint.gear.catalogue import table
from swgjoint.joint.tilt import add_tilt_hinges, tilt_names
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import assemble
from swgjoint.sim.figures.output_bearing import bearing_loads
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

MASS, REACH, ARM, G = 3.0, 0.4, 0.6, 9.81
STIFFNESS = 40.0  # N·m/arcmin
LINEAR = DriveMap.linear(5e4, teeth_flexspline=120, teeth_circular_spline=122)
CANTILEVER = f"""
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="link">
      <joint name="joint" axis="0 0 1"/>
      <geom type="sphere" size="0.02" pos="{REACH} 0 0" mass="{MASS}" contype="0"
        conaffinity="0"/>
      <site name="tool" pos="{ARM} 0 0"/>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0.1"/></keyframe>
</mujoco>
"""
SCENE = """
name = "cantilever"
arm = "{arm}"
[defaults]
drive = "map"
level = "linear"
rotor_inertia_kgm2 = 1e-4
[trajectory]
kind = "constant_speed"
[trajectory.start_deg]
joint = {start}
[trajectory.speed_deg_s]
joint = {speed}
[simulation]
duration_s = 0.5
"""


@pytest.fixture
def cantilever(tmp_path):
    """Run a horizontal link about a vertical axis, whose weight tilts its bearing."""
    path = tmp_path / "cantilever.xml"
    path.write_text(CANTILEVER)

    def run(start=0.0, speed=0.0, bearing=True, **changes):
        text = SCENE.format(arm=path, start=start, speed=speed)
        stated = {"joints.joint.output_bearing.tilt_stiffness_Nm_arcmin": STIFFNESS}
        overrides = (stated if bearing else {}) | {
            key.replace("__", "."): value for key, value in changes.items()
        }
        scene = Scene.from_toml(text)
        return run_scene(scene, overrides=overrides, drives={"map": LINEAR})

    return run


@pytest.mark.parametrize("start", [0.0, 30.0, 200.0])
def test_cantilever_tilts_by_moment_over_stiffness(cantilever, start):
    """The tool drops by m g l / K times its reach, from the first instant on."""
    tilted, stiff = cantilever(start), cantilever(start, bearing=False)
    tilt = MASS * G * REACH / (STIFFNESS / arcmin)
    drop = tilted.tool_position - stiff.tool_position
    # 1e-3: the tilt is 3 arcmin, whose square is 1e-6, and the drive is not perfect
    assert drop[:, 2] == pytest.approx(-ARM * tilt, rel=1e-3)
    assert np.abs(drop[:, :2]).max() < 1e-3 * ARM * tilt
    figures = tilted.metrics()["joints"]["joint"]["output_bearing"]
    assert figures["tilt_arcmin"]["mean"] == pytest.approx(tilt / arcmin, rel=1e-3)
    assert figures["peak_moment_Nm"] == pytest.approx(MASS * G * REACH, rel=1e-3)
    assert tilted.metrics()["tool"]["path_rms_mm"] == pytest.approx(
        1e3 * ARM * tilt, rel=1e-3
    )


def test_a_force_at_the_tool_adds_its_moment(cantilever):
    """Downwards at the tool: F ARM / K more, after the vibration has decayed."""
    force = {"kind": "tool_force", "force_N": [0.0, 0.0, -20.0], "start_s": 0.1}
    run = cantilever(
        disturbance=[force | {"duration_s": 2.0}],
        simulation__duration_s=1.5,
        joints__joint__output_bearing__damping_ratio=1.0,
    )
    tilt = (MASS * G * REACH + 20.0 * ARM) / (STIFFNESS / arcmin)
    stiff = cantilever(bearing=False)
    drop = run.tool_position[-1, 2] - stiff.tool_position[-1, 2]
    assert drop == pytest.approx(-ARM * tilt, rel=1e-3)
    _, axial, moment = bearing_loads(run)["joint"][-100:-10].mean(0)
    assert axial == pytest.approx(MASS * G + 20.0, rel=1e-3)
    assert moment == pytest.approx(MASS * G * REACH + 20.0 * ARM, rel=1e-3)


def test_centre_of_the_bearing_is_the_pivot(cantilever, tmp_path):
    """A pivot above the link: the tool moves outwards or inwards as it drops."""
    run = cantilever(joints__joint__output_bearing__centre_mm=100.0)
    stiff = cantilever(bearing=False)
    tilt = MASS * G * REACH / (STIFFNESS / arcmin)
    moved = run.tool_position[-1] - stiff.tool_position[-1]
    assert moved == pytest.approx(
        [-0.1 * tilt, 0.0, -ARM * tilt], abs=2e-3 * ARM * tilt
    )


def test_loads_of_a_turning_arm(cantilever):
    """Weight is axial, centrifugal force radial; the life follows by hand."""
    run = cantilever(
        speed=90.0,
        joints__joint__output_bearing__dynamic_rating_N=5000.0,
        joints__joint__output_bearing__pitch_diameter_mm=50.0,
        joints__joint__output_bearing__damping_ratio=1.0,
    )
    got = run.metrics()["joints"]["joint"]["output_bearing"]
    rate = np.pi / 2
    assert got["mean_axial_N"] == pytest.approx(MASS * G, rel=1e-3)
    assert got["mean_radial_N"] == pytest.approx(MASS * rate**2 * REACH, rel=0.02)
    assert got["mean_moment_Nm"] == pytest.approx(MASS * G * REACH, rel=0.02)
    across = got["mean_radial_N"] + 2 * got["mean_moment_Nm"] / 0.05
    load = 1.2 * (across + 0.45 * got["mean_axial_N"])
    hours = 1e6 / (60 * got["mean_speed_rpm"]) * (5000.0 / load) ** (10 / 3)
    assert got["L10_h"] == pytest.approx(hours, rel=1e-9)
    assert got["mean_speed_rpm"] == pytest.approx(15.0, rel=0.01)


def test_load_factors_change_with_the_axial_share():
    """X and Y on both sides of F_a / (F_r + 2M/d) = 1.5."""
    bearing = OutputBearing(
        tilt_stiffness=1e5, dynamic_rating=1e4, pitch_diameter=0.05, load_factor=1.0
    )
    rate = 2 * np.pi / 60  # one turn a minute
    radial = bearing.life(100.0, 150.0, 0.0, rate) / 60
    assert radial == pytest.approx(1e6 * (1e4 / (100.0 + 67.5)) ** (10 / 3))
    axial = bearing.life(100.0, 200.0, 0.0, rate) / 60
    assert axial == pytest.approx(1e6 * (1e4 / (0.67 * 300.0)) ** (10 / 3))
    assert bearing.life(100.0, 0.0, 0.0, 0.0) == np.inf
    assert OutputBearing(tilt_stiffness=1e5).life(1.0, 1.0, 1.0, 1.0) is None


def test_energy_missing_from_a_vibration_is_the_damping_of_the_step(cantilever):
    """A released force: lost energies are as damping ratio and numerical damping ratio.

    The integrator damps a tilt of angular frequency w by h w/2 of critical.
    """
    force = {"kind": "tool_force", "force_N": [0.0, 0.0, -30.0], "start_s": 0.05}
    rate = np.sqrt(STIFFNESS / arcmin / (MASS * REACH**2))
    for step in (2e-4, 5e-5):
        run = cantilever(
            disturbance=[force | {"duration_s": 0.1}], simulation__step_s=step
        )
        metrics = run.metrics()
        assert metrics["verdict"] == "VALID"
        energy = metrics["energy"]
        ratio = energy["balance_error_J"] / energy["dissipated_J"]
        left_out = run.contains["left_out"]
        assert any("tilt" in item["part"] for item in left_out) == (step > 1e-4)
        # 20 %: work of the force in the steps in which it begins and ends
        assert ratio == pytest.approx(0.5 * step * rate / 0.02, rel=0.2)
        assert np.ptp(run.tilt[-400:], axis=0).max() < 0.1 * np.ptp(run.tilt)


def test_catalogue_units_are_ordered():
    """Larger units are stiffer and carry more; the values have their units."""
    rows = table("output_bearings")
    for series in ("CSG", "SHG"):
        own = [row for row in rows if row["series"] == series]
        for key in own[0]:
            if key not in ("series", "flange_distance_mm"):
                values = [row[key] for row in own]
                assert values == sorted(values)
    one = catalogue_bearing("CSG-25")
    assert one.tilt_stiffness == pytest.approx(70.0 / arcmin)
    assert (one.permissible_moment, one.pitch_diameter) == (156.0, 0.062)


def saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def test_a_scene_without_it_has_no_trace(synthetic_map):
    """Byte for byte the same model as with the step left out, and no figures."""
    scene = Scene.load_file("ur5e-sweep")
    drives = {"reference-2d": synthetic_map}
    assembly = assemble(scene, drives=drives)
    names = {assembly.model.joint(k).name for k in range(assembly.model.njnt)}
    assert not any("tilt" in name for name in names)
    spec = mujoco.MjSpec.from_string(CANTILEVER)
    before = saved(spec.compile())
    add_tilt_hinges(spec, {})
    assert saved(spec.compile()) == before
    tilted = assemble(
        scene.with_changes({"joints.elbow_joint.output_bearing.unit": "CSG-25"}),
        drives=drives,
    )
    assert tilted.model.nv == assembly.model.nv + 2
    assert tilted.bearings.keys() == {"elbow_joint"}


def test_keyframes_keep_their_pose():
    """Keyframes gain untilted bearings."""
    spec = mujoco.MjSpec.from_string(CANTILEVER)
    add_tilt_hinges(spec, {"joint": OutputBearing(tilt_stiffness=1e5)})
    model = spec.compile()
    assert model.key_qpos[0].tolist() == [0.1, 0.0, 0.0]
    for name in tilt_names("joint"):
        assert model.joint(name).axis[2] == 0.0


def test_ur5e_feels_its_bearings_at_the_tool(synthetic_map):
    """At the start the tool moves by the sum of tilt times lever of all bearings."""
    scene = Scene.load_file("ur5e-sweep", ["simulation.duration_s=4.0"])
    drives = {"reference-2d": synthetic_map}
    stiff = run_scene(scene, drives=drives)
    soft = run_scene(
        scene.with_changes({"defaults.output_bearing": {"unit": "CSG-20"}}),
        drives=drives,
    )
    assert soft.metrics()["verdict"] == "VALID"
    arm = soft.assembly.arm
    data = mujoco.MjData(arm.model)
    data.qpos[:] = soft.assembly.trajectory.position[0]
    mujoco.mj_kinematics(arm.model, data)
    mujoco.mj_comPos(arm.model, data)
    expected, moments = np.zeros(3), {}
    for joint in arm.joints:
        hinge = arm.model.joint(joint)
        body, anchor = int(hinge.bodyid[0]), data.xanchor[hinge.id]
        weight = arm.model.body_subtreemass[body] * arm.model.opt.gravity
        moment = np.cross(data.subtree_com[body] - anchor, weight)
        axis = data.xaxis[hinge.id]
        moment -= (moment @ axis) * axis
        moments[joint] = np.linalg.norm(moment)
        lever = data.site_xpos[arm.tool] - anchor
        expected += np.cross(moment / (37.0 / arcmin), lever)
    moved = soft.tool_position[0] - stiff.tool_position[0]
    # 1 %: the sag of the drives changes the pose
    assert moved == pytest.approx(expected, abs=0.01 * np.linalg.norm(expected))
    joints = soft.metrics()["joints"]
    for joint, moment in moments.items():
        peak = joints[joint]["output_bearing"]["peak_moment_Nm"]
        assert peak > 0.99 * moment


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"damping_ratio": 0.1}, "tilt_stiffness_Nm_arcmin"),
        ({"unit": "CSG-99"}, "unit"),
        (
            {"tilt_stiffness_Nm_arcmin": -1.0},
            "tilt_stiffness_Nm_arcmin = -1 N·m/arcmin",
        ),
        ({"unit": "CSG-25", "load_factor": 0.5}, "load_factor"),
        ({"unit": "CSG-25", "stiffness": 1.0}, "stiffness"),
    ],
)
def test_faults_name_their_key(changes, key):
    """One line that names the key."""
    with pytest.raises(InputError, match=naming(key)) as error:
        Scene.load_file("bench", {"joints.joint.output_bearing": changes})
    assert "\n" not in str(error.value)


def test_explicit_integrators_are_refused():
    """RK4 would need steps far below those of a scene."""
    changes = {
        "defaults.drive": "CSG-20-100",
        "defaults.output_bearing.unit": "CSG-20",
        "simulation.integrator": "RK4",
    }
    with pytest.raises(InputError, match=naming("simulation.integrator")):
        run_scene("bench", overrides=changes)


def test_attach_adds_the_bearing():
    """The link of any model tilts under its weight, at every level."""
    for level in ("linear", "rigid"):
        spec = mujoco.MjSpec.from_string(CANTILEVER)
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        swgjoint.attach(
            spec,
            joint="joint",
            drive=LINEAR,
            level=level,
            rotor_inertia=1e-4,
            output_bearing=OutputBearing(
                tilt_stiffness=STIFFNESS / arcmin, damping_ratio=1.0
            ),
        )
        model = spec.compile()
        data = mujoco.MjData(model)
        for _ in range(500):
            mujoco.mj_step(model, data)
        tilt = MASS * G * REACH / (STIFFNESS / arcmin)
        drop = data.site("tool").xpos[2]
        assert drop == pytest.approx(-ARM * tilt, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"output_bearing": "CSG-99"}, "CSG-25"),
        ({"output_bearing": 5.0}, "output_bearing"),
        ({"output_bearing": "CSG-25", "level": "rigid"}, "mjINT_DISCRETE"),
        ({"output_bearing": "CSG-25", "integrator": "keep"}, "mjINT_DISCRETE"),
    ],
)
def test_attach_rejects_what_it_cannot_step(options, key):
    """The spec is unchanged."""
    spec = mujoco.MjSpec.from_string(CANTILEVER)
    before = saved(spec.compile())
    with pytest.raises(InputError, match=naming(key)):
        swgjoint.attach(
            spec, joint="joint", drive=LINEAR, rotor_inertia=1e-4, **options
        )
    assert saved(spec.compile()) == before


def test_commands_show_the_bearing(tmp_path, capsys):
    """``run`` prints tilt and moment, and the report has a table."""
    from swgjoint.cli.main import main

    out = tmp_path / "out"
    arguments = ["run", "bench", "--drive", "CSG-20-100", "--report", "--out", str(out)]
    more = ["simulation.duration_s=1.0", "defaults.output_bearing.unit=CSG-20"]
    for text in more:
        arguments += ["--set", text]
    assert main(arguments) == 0
    assert "output bearing" in capsys.readouterr().out
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Output bearings of bench" in page
    assert main([*arguments[:4], "--set", more[0], "--json"]) == 0
    joint = json.loads(capsys.readouterr().out)["joints"]["joint"]
    assert "output_bearing" not in joint
