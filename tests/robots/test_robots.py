"""Robots of many makers: correct figures, or a verdict that says why not.

``manifest.toml`` lists the files, where they come from and what each command must make
of them. Bounds, and why they are what they are:

* Torsion: a drive is at least as stiff as the first slope K1 of its catalogue row, so
  the mean of a torsion is below the largest torque over K1, and its travel, which may
  go from one sign to the other, below twice that; hysteresis and kinematic error add
  what the catalogue states (:func:`torsion_bound`).
* Energy: nothing but actuators adds energy to a robot; gravity and springs only turn
  it over. :data:`ENERGY` is what a step of some ms may add, and a soft contact gives
  back the weight times its depth (:data:`OVERLAP`).
* Stiff drives: with 1e6 N·m/rad and the rotor as armature the links move as in the
  file without drives within 1e-3 rad (:data:`SAME`), from the first keyframe with its
  controls and random speeds. A robot that falls is chaotic: compared is the first
  second. Contacts, limits and friction of joints are off in both: the engine softens
  them by the inertia of the link alone, without the rotor behind the spring.
"""

from __future__ import annotations

import json
import math
import tomllib
import warnings
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from messages import names, naming

import swgjoint
from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.explore.advise import search
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.accuracy import relative_cost
from swgjoint.units import arcmin

HERE = Path(__file__).parent
ROBOTS: dict[str, dict[str, Any]] = {
    robot["name"]: robot
    for robot in tomllib.loads((HERE / "manifest.toml").read_text())["robot"]
}
DRIVE = "CSG-25-100"
TIME = 2.0
"""Of a simulation in a loop of one's own [s]."""
SHORT = 1.0
"""Of a comparison of links, before the motion of a falling robot is chaotic [s]."""
SPEED = 0.5
"""Of the joints at its start, at most [rad/s]."""
SETTLED = 5
"""Steps after which the integrator has let go of speeds that it was given."""
SAME = 1e-3
"""Distance of links that move alike [rad]."""
STIFF = DriveMap.linear(1e6)
"""A drive that is as good as rigid."""
ARMATURE = 0.01
"""Inertia of a rotor at its joint where a file states none [kg·m²]."""
EVERY = 20
"""Steps from one look at the drives to the next."""
ENERGY = 0.02
"""Energy that may come from nowhere, of the largest that went to and fro [-]."""
OVERLAP = 1e-3
"""Depth of shapes in each other at the start that is that of soft contact [m]."""
ROUND = 1e-6
"""Torsion that is nothing, whatever the torque [rad]."""
TOOL = 10.0
"""Error of the tool that drives within their ratings do not make [mm]."""


def cases(*keys: str) -> list[Any]:
    """Names of robots, those without ``quick`` for the second tier."""
    return [
        pytest.param(name, marks=[] if robot.get("quick") else [pytest.mark.slow])
        for name, robot in ROBOTS.items()
        if all(key in robot for key in keys)
    ]


def path(name: str) -> str:
    """The file of a robot."""
    return str(HERE / "models" / name / ROBOTS[name]["file"])


# --- drives in a model of one's own -------------------------------------------------


@dataclass(frozen=True)
class Driven:
    """A model with drives, and what was said when they were put in."""

    spec: mujoco.MjSpec
    drives: dict[str, Any]
    notes: str


def attach_all(spec: mujoco.MjSpec, drives: dict[str, Any], **keys: Any) -> Driven:
    """Drives on hinges by name or pattern, with the file's own integrator."""
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        got = swgjoint.attach(spec, drives, **keys)
    return Driven(spec, got, "\n".join(str(note.message) for note in notes))


def start(model: mujoco.MjModel, drives: dict[str, Any]) -> mujoco.MjData:
    """The first keyframe, or the reference position inside the limits."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        for j in np.flatnonzero(hinges & model.jnt_limited.astype(bool)):
            q = model.jnt_qposadr[j]
            data.qpos[q] = np.clip(data.qpos[q], *model.jnt_range[j])
        for joint, drive in drives.items():
            data.joint(drive.rotor).qpos = drive.ratio * data.joint(joint).qpos
    mujoco.mj_forward(model, data)
    return data


def trouble(data: mujoco.MjData) -> dict[str, int]:
    """Warnings of the engine that mean that its figures are wrong, and how many."""
    kinds = ("INERTIA", "BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
    counts = {
        kind: int(data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{kind}")].number)
        for kind in kinds
    }
    return {kind: count for kind, count in counts.items() if count}


def torsion_bound(drive: DriveMap, torque: float) -> float:
    """Largest torsion that a torque can make, hysteresis and error included [rad]."""
    loss = sum(2.0 * element.torque for element in drive.hysteresis)
    error = float(np.hypot(*drive.kinematic_error.T).sum())
    return (torque + loss) / drive.info["stated"]["K1_Nm_rad"] + 2.0 * error + ROUND


@pytest.fixture
def quiet_engine():
    """Keep the engine's warnings off the terminal: the tests read their counts."""
    mujoco.set_mju_user_warning(lambda message: None)
    yield
    mujoco.set_mju_user_warning(None)


@pytest.mark.usefixtures("quiet_engine")
@pytest.mark.parametrize("name", cases())
def test_drives_on_every_hinge_hold_for_two_seconds(name):
    """From the first keyframe: no divergence, torsion as of the torque, no energy."""
    robot = ROBOTS[name]
    spec = mujoco.MjSpec.from_file(path(name))
    if "attach_refused" in robot:
        with pytest.raises(InputError, match=naming(*robot["attach_refused"])):
            swgjoint.attach(spec, {"*": DRIVE})
        return
    driven = attach_all(spec, {"*": DRIVE})
    assert len(driven.drives) == robot["hinges"], driven.notes
    assert names(driven.notes, *robot.get("left_out", [])), driven.notes
    model = driven.spec.compile()
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = start(model, driven.drives)

    overlap = any(contact.dist < -OVERLAP for contact in data.contact)
    torsion, torque = np.zeros((2, len(driven.drives)))
    first, step = float(data.energy.sum()), float(model.opt.timestep)
    work, excess, turnover = 0.0, 0.0, 1.0
    for k in range(math.ceil(TIME / step)):
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        work += step * float(data.qfrc_actuator @ (0.5 * (before + data.qvel)))
        excess = max(excess, float(data.energy.sum()) - first - work)
        turnover = max(turnover, abs(work), abs(float(data.energy[0]) - first))
        if k % EVERY == 0:
            got = [drive.observe(model, data) for drive in driven.drives.values()]
            torsion = np.maximum(torsion, [abs(float(g.torsion)) for g in got])
            torque = np.maximum(torque, [abs(float(g.torque)) for g in got])
    assert trouble(data) == {}
    assert np.isfinite(data.qpos).all()
    if not (model.nmocap or overlap):  # a weld to one moves the robot
        weight = -float(model.body_mass.sum() * model.opt.gravity[2])
        assert excess < ENERGY * turnover + OVERLAP * weight
    for drive, moved, most in zip(driven.drives.values(), torsion, torque, strict=True):
        assert moved < 2.0 * torsion_bound(drive.drive, most), drive.joint


@pytest.mark.usefixtures("quiet_engine")
@pytest.mark.parametrize("name", cases("hinges"))
def test_stiff_drives_leave_the_robot_as_it_is(name):
    """Rotor as armature, 1e6 N·m/rad: links move as without drives."""
    spec, plain = (mujoco.MjSpec.from_file(path(name)) for _ in range(2))
    model = plain.compile()
    takes = attach_all(spec.copy(), {"*": DRIVE}).drives
    by_armature: dict[float, dict[str, DriveMap]] = {}
    for joint in plain.joints:
        if joint.name in takes:
            own = float(model.dof_armature[model.joint(joint.name).dofadr[0]])
            by_armature.setdefault(own or ARMATURE, {})[joint.name] = STIFF
    drives = {}
    for armature, joints in by_armature.items():
        inertia = armature / STIFF.ratio**2
        driven = attach_all(
            spec, joints, level="linear", rotor="lumped", rotor_inertia=inertia
        )
        drives |= driven.drives
        for joint in driven.drives:
            plain.joint(joint).armature = armature
    plain.option.integrator = spec.option.integrator
    plain.option.iterations = spec.option.iterations
    model, twin = plain.compile(), spec.compile()
    for each in (model, twin):
        each.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, twin_data = start(model, {}), start(twin, drives)
    speeds = SPEED * np.random.default_rng(1).uniform(-1.0, 1.0, len(drives))
    for drive, speed in zip(drives.values(), speeds, strict=True):
        data.joint(drive.joint).qvel = twin_data.joint(drive.joint).qvel = speed
        twin_data.joint(drive.rotor).qvel = drive.ratio * speed
    own = [model.joint(joint).qposadr[0] for joint in drives]
    of_twin = [twin.joint(joint).qposadr[0] for joint in drives]
    worst = 0.0
    for k in range(math.ceil(SHORT / model.opt.timestep)):
        mujoco.mj_step(model, data)
        mujoco.mj_step(twin, twin_data)
        if k >= SETTLED:
            apart = data.qpos[own] - twin_data.qpos[of_twin]
            worst = max(worst, float(np.abs(apart).max()))
    assert trouble(twin_data) == trouble(data) == {}
    assert worst < SAME


# --- commands -----------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What a command gave."""

    status: int
    result: dict[str, Any]
    errors: str


@pytest.fixture
def command(capsys, tmp_path, monkeypatch):
    """Run a command in a folder that is not the repository."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Outcome:
        with warnings.catch_warnings():
            warnings.simplefilter("default")  # of the command: lines on stderr
            status = main([*arguments, "--json"])
        out, err = capsys.readouterr()
        return Outcome(status, json.loads(out) if out else {}, err)

    return run


@pytest.mark.parametrize("name", cases())
def test_run_with_drives_by_rule(name, command):
    """Figures within bounds, or the verdict or refusal that the manifest predicts."""
    check_run(name, "run", command("run", path(name)))


@pytest.mark.parametrize("name", cases())
def test_run_with_one_drive_everywhere(name, command):
    """The same with CSG-25-100 in every joint."""
    check_run(name, "run_drive", command("run", path(name), "--drive", DRIVE))


@pytest.mark.parametrize("name", cases("balanced"))
def test_repaired_inertia_lets_a_robot_run(name, command):
    """What is refused for an inertia runs with ``--balance-inertia``."""
    check_run(name, "balanced_run", command("run", path(name), "--balance-inertia"))


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in ROBOTS if "same_robot" not in ROBOTS[n]])
def test_advise(name, command, monkeypatch):
    """A setting within the error, or the refusal that the manifest predicts.

    Of a robot in several files once: ``run`` tests what is made of each file. One
    timing of each setting suffices: no bound is on the cost.
    """
    monkeypatch.setattr(search, "relative_cost", partial(relative_cost, pairs=1))
    robot = ROBOTS[name]
    error = 1.0 if robot["kind"] == "arm" else 10.0  # of many joints it takes minutes
    brief = ("--set", "simulation.duration_s=2.0")
    got = command("advise", path(name), "--error", f"{error}arcmin", *brief)
    if "advise" in robot:
        assert got.status == {"stopped": 1, "refused": 2}[robot["advise"]], got.errors
        assert names(got.errors, *robot["advise_names"]), got.errors
        return
    assert got.status == 0, got.errors
    assert 0.0 < got.result["expected_error_arcmin"] <= error
    assert got.result["cost"] > 0.0


def check_run(name: str, key: str, got: Outcome) -> None:
    """Hold what a run gave to the manifest.

    ``VALID``: figures within the bounds. ``NOT VALID``: status 1 and reasons that name
    what the manifest says. ``stopped`` and ``refused``: status 1 and 2, and one line.
    """
    robot = ROBOTS[name]
    wanted, said = robot.get(key, "VALID"), robot.get(f"{key}_names", [])
    if wanted in ("stopped", "refused"):
        assert got.status == {"stopped": 1, "refused": 2}[wanted], got.errors
        lines = [x for x in got.errors.splitlines() if x.startswith("swgjoint run:")]
        assert len(lines) == 1, got.errors
        assert names(lines[0], *said), got.errors
        return
    assert got.result, got.errors
    assert got.result["verdict"] == wanted, got.result["reasons"]
    if wanted == "NOT VALID":
        assert got.status == 1
        assert names(json.dumps(got.result["reasons"]), *said), got.result["reasons"]
        return
    assert got.status == 0
    if "hinges" in robot:
        assert len(got.result["joints"]) == robot.get("moving", robot["hinges"])
    for joint, figures in got.result["joints"].items():
        check_joint(joint, figures)
    check_energy(name, got.result["energy"])
    tool = got.result["tool"]
    assert 0.0 <= tool["path_rms_mm"] <= tool["path_max_mm"] < TOOL


def check_joint(joint: str, figures: dict[str, Any]) -> None:
    """Torsion as of the torque, no teeth that skip, nothing outside the map."""
    drive = catalogue(figures["drive"])
    ratings, torsion = figures["ratings"], figures["torsion_arcmin"]
    bound = torsion_bound(drive, ratings["peak_Nm"]) / arcmin
    assert abs(torsion["mean"]) < bound, joint
    assert torsion["pp"] < 2.0 * bound, joint
    assert ratings["within_map"], joint
    assert ratings["ratcheting"] is None, joint


@cache
def catalogue(name: str) -> DriveMap:
    """A catalogue drive, made once."""
    return DriveMap.from_catalogue(name)


def check_energy(name: str, energy: dict[str, float]) -> None:
    """Works, storage and losses balance but for what a file's own joints rub away."""
    turnover = sum(
        abs(energy[key])
        for key in ("motor_work_J", "load_work_J", "stored_J", "dissipated_J")
    )
    bound = ENERGY * turnover + 1e-3
    assert energy["balance_error_J"] > -bound
    if "balanced" not in ROBOTS[name]:
        model = mujoco.MjModel.from_xml_path(path(name))
        if not (model.dof_damping.any() or model.dof_frictionloss.any()):
            assert energy["balance_error_J"] < bound
