"""Exported MJCF: without a plugin, and within the error that the file states.

The exported files run in a process that cannot import swgjoint. What they do there is
compared with level ``full`` of the same drives, and with the numbers in the comment.
"""

from __future__ import annotations

import json
import re
import struct
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imsave
from messages import naming

import swgjoint
from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.joint.native_error import native_error
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.sheet.loop import torque_loop
from swgjoint.models_path import find
from swgjoint.sim.arm.opening import open_model
from swgjoint.units import arcmin

ROBOTS = Path(__file__).parents[1] / "robots" / "models"
XARM = ROBOTS / "ufactory_xarm7" / "xarm7.xml"
TETRAHEDRON = "v 0 0 0\nv .3 0 0\nv 0 .05 0\nv 0 0 .05\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
ONE_HINGE = """
<mujoco><compiler meshdir="parts"/><option timestep="0.001" gravity="0 0 0"/>
  <asset><mesh name="m" file="link.obj"/></asset>
  <worldbody><body name="link"><joint name="j" axis="0 0 1" ref="10"/>
    <geom type="mesh" mesh="m" mass="3" contype="0" conaffinity="0"/></body></worldbody>
  <keyframe><key name="home" qpos="1.2345678" qvel=".5"/></keyframe>
</mujoco>
"""
# without swgjoint: what a file does in a plain MuJoCo
LOOP = """
import numpy as np

def move(mujoco, model, joints, seconds=3.0, speed=0.02, rate=150.0):
    # motor and link angles in a slow motion of the motors, after gravity has set in
    data = mujoco.MjData(model)
    links = [model.joint(name) for name in joints]
    rotors = [model.joint(name + "_rotor") for name in joints]
    q, v = (
        np.array([[int(getattr(j, key)[0]) for j in row] for row in (rotors, links)])
        for key in ("qposadr", "dofadr")
    )
    tendons = [model.tendon(name + "_drive").id for name in joints]
    ratio = 1.0 / model.wrap_prm[model.tendon_adr[tendons]]
    model.dof_frictionloss[v[1]] = 0.0  # the torque is that of the weight
    start, gravity = data.qpos[q[0]].copy(), model.opt.gravity.copy()
    step = model.opt.timestep
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    inertia = np.diag(full)[v[0]]
    found = []
    for _ in range(round(seconds / step)):
        t = data.time
        model.opt.gravity[:] = gravity * 0.5 * (1.0 - np.cos(np.pi * min(t, 1.0)))
        wanted = start + ratio * speed * (1.0 - np.cos(np.pi * t)) / np.pi
        ahead = ratio * speed * np.sin(np.pi * t) - data.qvel[v[0]]
        pull = rate**2 * (wanted - data.qpos[q[0]]) + 2.0 * rate * ahead
        data.qfrc_applied[v[0]] = inertia * pull
        mujoco.mj_step(model, data)
        found.append(data.qpos[q] - 0.5 * step * data.qvel[v])
    return np.array(found[round(1.0 / step) :])
"""
PLAIN = (
    LOOP
    + """
import json, sys
sys.modules["swgjoint"] = None  # neither importable nor registered
import mujoco

path, joints = sys.argv[1], json.loads(sys.argv[2])
try:
    mujoco.MjModel.from_xml_string(
        '<mujoco><extension><plugin plugin="swgjoint.drive"/></extension></mujoco>'
    )
except ValueError:
    pass
else:
    raise SystemExit("the plugin is there")

def curve(model, joint, reach):
    # torques of the springs at torsions, motor at zero
    data = mujoco.MjData(model)
    torsion = np.linspace(-reach, reach, 4001)
    torque = []
    for x in torsion:
        mujoco.mj_resetData(model, data)
        data.joint(joint).qpos -= x
        mujoco.mj_forward(model, data)
        torque.append(float(data.qfrc_spring[model.joint(joint).dofadr[0]]))
    return torsion.tolist(), torque

def ring(joint):
    # frequency [Hz] and damping ratio of a free vibration, all else held
    model = mujoco.MjModel.from_xml_path(path)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    pair = [int(model.joint(n).dofadr[0]) for n in (joint, joint + "_rotor")]
    held = np.setdiff1d(np.arange(model.nv), pair)
    model.dof_armature[held] = 1e9
    model.dof_frictionloss[:] = 0.0
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    tendon = model.tendon(joint + "_drive").id
    data.joint(joint).qpos += 1e-6
    mujoco.mj_forward(model, data)
    rest, x = float(model.tendon_length0[tendon]), []
    for _ in range(20):
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        x.append(float(data.ten_length[tendon]) - rest)
    x = np.array(x[1:])
    a, b = np.linalg.lstsq(np.column_stack([x[1:-1], x[:-2]]), x[2:], rcond=None)[0]
    s = np.log(np.roots([1.0, -a, -b]).astype(complex)) / model.opt.timestep
    size = np.sqrt(abs(s[0] * s[1]))
    return size / (2.0 * np.pi), -np.real(s[0] + s[1]) / (2.0 * size)

model = mujoco.MjModel.from_xml_path(path)
reach = float(sys.argv[3])
print(json.dumps({
    "curves": {joint: curve(model, joint, reach) for joint in joints},
    "rings": {joint: ring(joint) for joint in joints},
    "moved": move(mujoco, model, joints).tolist(),
}))
"""
)


def run_plain(path: Path, joints: list[str], reach: float) -> dict:
    program = [sys.executable, "-P", "-c", PLAIN, str(path), json.dumps(joints)]
    done = subprocess.run(
        [*program, str(reach)], capture_output=True, text=True, cwd=path.parent
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def stated(path: Path) -> dict[str, dict[str, float]]:
    """Numbers in the comment of a file: bounds [rad], resonance [Hz, -]."""
    comment = re.match(r"<!--(.*?)-->", path.read_text(), re.DOTALL)[1]
    found = {}
    for part in re.split(r"\n  joint ", comment)[1:]:
        numbers = {
            key: float(re.search(rf"\n    {key}: \D*([0-9.e+-]+)", part)[1])
            for key in ("torque", "torsion", "link angle")
        }
        mode = re.search(r"resonance: (\S+) Hz, damping ratio (\S+);", part)
        found[part.partition(":")[0]] = numbers | {
            "mode": tuple(map(float, mode.groups()))
        }
    return found


ARMS = {
    "ur5e": ("ur5e", {"shoulder_*": "CSG-32-100", "*": "CSG-17-120"}),
    "xarm7": (str(XARM), {"*": "CSG-25-160"}),
}


@pytest.fixture(scope="module", params=ARMS)
def both(request, tmp_path_factory):
    """File of an arm, what it does in plain MuJoCo, and the same arm at ``full``."""
    arm, drives = ARMS[request.param]
    path = tmp_path_factory.mktemp("plain") / "arm.xml"
    spec = open_model(find(arm, "arms", ".xml", what="arm"))
    spec.option.timestep = 1e-3
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the arm asks for implicitfast
        swgjoint.export_mjcf(arm, path, drives, step=1e-3)
        full = swgjoint.attach(spec, drives, level="full")
    here: dict = {}
    exec(LOOP, here)
    moved = here["move"](mujoco, spec.compile(), list(full))
    return path, full, run_plain(path, list(full), 8e-3), moved


def test_the_springs_are_within_the_stated_torsion(both):
    """Over the torque range, against the mean curve of the map."""
    path, full, plain, _ = both
    for name, numbers in stated(path).items():
        law, top = full[name].drive, numbers["torque"]
        torsion, torque = map(np.array, plain["curves"][name])
        loads = np.linspace(-top, top, 101)
        found = np.interp(loads, torque, torsion)
        mean = [law.mean_torsion(load) for load in loads]
        assert np.abs(found - mean).max() <= numbers["torsion"] * arcmin
        assert torque[-1] > top


def test_the_link_is_within_the_stated_angle(both):
    """At any motor angle and torque, without and in a slow motion under weight.

    The bound is not generous: the largest difference at rest is 95 % of it.
    """
    path, full, plain, moved = both
    far = np.array(plain["moved"]) - moved  # (n, 2, n_joints)
    for k, (name, numbers) in enumerate(stated(path).items()):
        drive, bound = full[name], numbers["link angle"] * arcmin
        torsion, torque = map(np.array, plain["curves"][name])
        loads = np.linspace(-1.0, 1.0, 21) * numbers["torque"]
        theta = np.linspace(0.0, 2.0 * np.pi, 721)[:, None]
        psi = output_angle(drive.drive, theta, loads)
        off = psi - theta / drive.ratio + np.interp(loads, torque, torsion)
        assert 0.95 * bound < np.abs(off).max() <= bound
        assert np.abs(far[:, 1, k] - far[:, 0, k] / drive.ratio).max() <= bound


def test_the_resonance_is_the_stated_one(both):
    """Of a pair with everything else held, within 1 %."""
    path, _, plain, _ = both
    for name, numbers in stated(path).items():
        assert plain["rings"][name] == pytest.approx(numbers["mode"], rel=0.01)


@pytest.fixture
def lossy(synthetic_map, friction_law):
    """A map with friction and hysteresis whose yield torque depends on the load."""
    curve = ((synthetic_map.ratings.rated_torque, 4.0),)
    jenkin = Jenkin(stiffness=1e4, yield_torque=2.0, yield_curve=curve)
    return replace(synthetic_map, friction=friction_law, hysteresis=(jenkin,))


def make_arm(folder: Path) -> Path:
    (folder / "parts").mkdir(parents=True)
    (folder / "parts" / "link.obj").write_text(TETRAHEDRON)
    (folder / "arm.xml").write_text(ONE_HINGE)
    return folder / "arm.xml"


def test_numbers_of_a_drive_keep_all_digits(tmp_path, lossy):
    """The file read back has the rotor, springs and motor of the attached spec."""
    arm, path = make_arm(tmp_path / "a"), tmp_path / "out.xml"
    lossy = replace(lossy, layout="flexspline_fixed")
    swgjoint.export_mjcf(arm, path, lossy, rotor_inertia=1.2345678e-5, motors=True)
    spec = open_model(arm)
    drive = attach(
        spec, joint="j", drive=lossy, rotor_inertia=1.2345678e-5, level="native"
    )
    one, other = spec.compile(), mujoco.MjModel.from_xml_path(str(path))
    for key in (
        *("tendon_stiffness", "tendon_damping", "tendon_lengthspring", "wrap_prm"),
        *("tendon_springyield", "dof_frictionloss", "dof_damping", "dof_armature"),
        *("key_qpos", "key_qvel", "qpos0"),
    ):
        np.testing.assert_allclose(
            getattr(other, key), getattr(one, key), rtol=1e-15, err_msg=key
        )
    assert drive.ratio % 1.0 == 0.0 and other.tendon("j_drive") is not None
    assert other.actuator("j_motor").gear[0] == 1.0
    assert other.actuator_trnid[0, 0] == other.joint("j_rotor").id


def test_meshes_move_with_the_file(tmp_path):
    """They lie beside it; an export of another mesh leaves those of before."""
    arm, path = make_arm(tmp_path / "a"), tmp_path / "b" / "out.xml"
    path.parent.mkdir()
    first = swgjoint.export_mjcf(arm, path, "CSG-17-100")
    mesh = tmp_path / "a" / "parts" / "link.obj"
    mesh.write_text(TETRAHEDRON.replace(".3", ".4"))
    second = swgjoint.export_mjcf(arm, path, "CSG-17-100")
    assert first.assets != second.assets
    assert all(asset.is_file() for asset in (*first.assets, *second.assets))
    moved = path.parent.rename(tmp_path / "c") / "out.xml"
    mesh.unlink()
    model = mujoco.MjModel.from_xml_path(str(moved))
    sizes = np.linalg.norm(model.mesh_vert[:, None] - model.mesh_vert, axis=2)
    assert sizes.max() == pytest.approx(np.hypot(0.4, 0.05))


def test_files_of_every_kind_are_found(tmp_path):
    """Mesh of an included file, textures of one and six, a height field, a skin."""
    arm = make_arm(tmp_path / "a")
    # a triangle, and a bone with its name, frame and vertices
    skin = struct.pack("<4i9f3i", 3, 0, 1, 1, *range(9), *range(3))
    skin += struct.pack("<40s7f4i3f", b"link", *range(7), 3, *range(3), 1, 1, 1)
    (tmp_path / "a" / "parts" / "s.skn").write_bytes(skin)
    for name, grey in (("x", 0.2), ("y", 0.8)):
        imsave(tmp_path / "a" / f"{name}.png", np.full((8, 8, 3), grey))
    (tmp_path / "a" / "parts" / "x.png").write_bytes(
        (tmp_path / "a" / "y.png").read_bytes()
    )
    mesh = '<asset><mesh name="m" file="link.obj"/></asset>'
    (tmp_path / "a" / "more.xml").write_text(f"<mujoco>{mesh}</mujoco>")
    sides = " ".join(
        f'file{side}="{name}.png"'
        for side, name in zip(
            ("right", "left", "up", "down", "front", "back"), "xyxyxy", strict=True
        )
    )
    assets = f"""<include file="more.xml"/><asset>
      <texture name="one" type="2d" file="deep/x.png"/><texture type="skybox" {sides}/>
      <hfield name="h" file="x.png" size="1 1 .1 .1"/><skin file="s.skn"/></asset>"""
    text = ONE_HINGE.replace(mesh, assets)
    arm.write_text(text.replace("<compiler", '<compiler strippath="true"'))
    result = swgjoint.export_mjcf(arm, tmp_path / "out.xml", "CSG-17-100")
    assert len(result.assets) == 5  # two files x.png of different content
    one, other = (
        mujoco.MjModel.from_xml_path(str(path)) for path in (arm, result.path)
    )
    assert (other.nmesh, other.ntex, other.nhfield, other.nskin) == (1, 2, 1, 1)
    np.testing.assert_array_equal(other.tex_data, one.tex_data)
    np.testing.assert_array_equal(other.mesh_vert, one.mesh_vert)


@pytest.mark.parametrize("fault", ["mesh", "step", "itself", "drive", "folder"])
def test_nothing_is_written_when_it_fails(tmp_path, fault):
    """Neither the file nor its meshes."""
    arm, path = make_arm(tmp_path / "a"), tmp_path / "out.xml"
    drive, step, parts = "CSG-17-100", None, ("out_assets",)
    if fault == "mesh":
        (tmp_path / "a" / "parts" / "link.obj").unlink()
        parts = ("link.obj",)
    elif fault == "step":
        step, parts = -1.0, ("-1 s", "accepted")
    elif fault == "itself":
        path, parts = arm, ("arm.xml", "itself")
    elif fault == "drive":
        drive, parts = "CSG-17-101", ("CSG-17-101",)
    else:
        (tmp_path / "out_assets").write_text("in the way")
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    with pytest.raises(InputError, match=naming(*parts)):
        swgjoint.export_mjcf(arm, path, drive, step=step)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_loops_are_within_the_stated_torsion(lossy):
    """With yield torques that depend on the load, which native tendons lack."""
    spec = mujoco.MjSpec.from_string(ONE_HINGE)
    for element in (*spec.keys, *spec.geoms, *spec.meshes):
        spec.delete(element)
    body = spec.body("link")
    body.mass, body.inertia, body.explicitinertial = 3.0, [0.3] * 3, True
    drive = attach(spec, joint="j", drive=lossy, rotor_inertia=4e-5, level="native")
    error = native_error(drive, timestep=1e-3)
    model = spec.compile()
    # held motor, slow torque on the link up to the largest of the standard loop
    mean = lossy.with_harmonics(np.arange(len(lossy.orders)) == 0)
    loop = torque_loop(mean)
    frozen, link = model.joint("j_rotor"), model.joint("j")
    model.dof_armature[frozen.dofadr[0]], model.dof_frictionloss[:] = 1e6, 0.0
    model.dof_damping[link.dofadr[0]] = 150.0  # about critical
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    found = []
    for _ in range(2):
        for torque in loop.torque:
            data.qfrc_applied[link.dofadr[0]] = -torque
            mujoco.mj_step(model, data, 80)
            found.append(data.qpos[frozen.qposadr[0]] / drive.ratio)
            found[-1] -= float(data.qpos[link.qposadr[0]])
    rest = float(
        model.qpos0[frozen.qposadr[0]] / drive.ratio - model.qpos0[link.qposadr[0]]
    )
    torsion = np.array(found[loop.torque.size :]) - rest
    within = np.abs(loop.torque) <= error.torque
    off = np.abs(torsion - loop.torsion)[within].max()
    assert 0.9 * error.torsion < off < 1.01 * error.torsion  # settled to 1 %
    elastic = native_error(
        replace(drive, drive=replace(lossy, hysteresis=())), timestep=1e-3
    )
    assert error.torsion > 3.0 * elastic.torsion


def test_a_linear_drive_is_exact():
    """Nothing is left out of a spring without friction."""
    spec = mujoco.MjSpec.from_file(str(find("ur5e", "arms", ".xml", what="arm")))
    drive = attach(
        spec,
        joint="elbow_joint",
        drive=DriveMap.linear(1e4),
        rotor_inertia=4e-5,
        level="native",
    )
    error = native_error(drive, timestep=1e-3)
    for value in (error.torsion, error.ripple, error.link):
        assert value == pytest.approx(0.0, abs=1e-12)
