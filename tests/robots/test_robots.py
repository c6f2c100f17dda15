"""Robots of many makers: correct figures, or a verdict that says why not.

``manifest.toml`` lists the files, where they come from and what each command must make
of them. Bounds, and why they are what they are:

* Torsion: a drive is at least as stiff as the first slope K1 of its catalogue row, so
  the mean of a torsion is below the largest torque over K1, and its travel, which may
  go from one sign to the other, below twice that; hysteresis and kinematic error add
  what the catalogue states (:func:`torsion_bound`).
* Energy: nothing but actuators adds energy to a robot; gravity and springs only turn
  it over. :data:`ENERGY` is what soft contacts and a step of some ms may add.
* Stiff drives: with 1e6 N·m/rad and the rotor as armature the links move as in the
  file without drives within 1e-3 rad (:data:`SAME`). Robots with a free base fall and
  hit the floor, hands hit themselves: there a difference of round-off grows to any
  size, so that these are compared before, over :data:`SHORT`.
"""

from __future__ import annotations

import json
import math
import tomllib
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from messages import names

import swgjoint
from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import arcmin

HERE = Path(__file__).parent
ROBOTS: dict[str, dict[str, Any]] = {
    robot["name"]: robot
    for robot in tomllib.loads((HERE / "manifest.toml").read_text())["robot"]
}
DRIVE = "CSG-25-100"
ROTOR = 1e-4
"""Rotor with the wave generator of size 25 [kg·m²]: 2 x 0.413e-4, rounded up."""
TIME = 2.0
"""Of a simulation in a loop of one's own [s]."""
SHORT = 0.1
SAME = 1e-3
STIFF = 1e6
"""Stiffness of a drive that is as good as rigid [N·m/rad]."""
ENERGY = 0.02
"""Energy that may come from nowhere, of the largest that went to and fro [-]."""
TOOL = 50.0
"""Error of the tool above which no arm is worth simulating [mm]."""


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
    """A model with drives, and the joints that took one."""

    spec: mujoco.MjSpec
    drives: dict[str, Any]
    refused: dict[str, str]
    notes: list[str]


def attach_all(name: str, drive: DriveMap | dict[str, DriveMap], **keys: Any) -> Driven:
    """Drives on all hinges that can take one, with the file's own integrator."""
    spec = mujoco.MjSpec.from_file(path(name))
    drives, refused = {}, {}
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        for joint in [j.name for j in spec.joints]:
            own = drive[joint] if isinstance(drive, dict) else drive
            settings = {
                key: value[joint] if isinstance(value, dict) else value
                for key, value in keys.items()
            }
            try:
                drives[joint] = swgjoint.attach(
                    spec, joint=joint, drive=own, **settings
                )
            except InputError as error:
                refused[joint] = str(error)
    return Driven(spec, drives, refused, sorted({str(n.message) for n in notes}))


def start(model: mujoco.MjModel, drives: dict[str, Any]) -> mujoco.MjData:
    """The first keyframe, or the reference position inside the limits."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        for j in range(model.njnt):
            if model.jnt_limited[j] and model.jnt_type[j] >= 2:
                low, high = model.jnt_range[j]
                q = model.jnt_qposadr[j]
                data.qpos[q] = np.clip(data.qpos[q], low, high)
        for joint, drive in drives.items():
            if drive.rotor:
                data.joint(drive.rotor).qpos = drive.ratio * data.joint(joint).qpos
    mujoco.mj_forward(model, data)
    return data


def trouble(data: mujoco.MjData) -> list[str]:
    """Warnings of the engine that mean that a simulation is lost."""
    bad = ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
    return [
        kind
        for kind in bad
        if data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{kind}")].number
    ]


def torsion_bound(drive: DriveMap, torque: float) -> float:
    """Largest torsion that a torque can make, hysteresis and error included [rad]."""
    stated = drive.info["stated"]
    loss = sum(2.0 * element.torque for element in drive.hysteresis)
    error = float(np.hypot(*drive.kinematic_error.T).sum())
    return (torque + loss) / stated["K1_Nm_rad"] + 2.0 * error


@pytest.mark.parametrize("name", cases())
def test_drives_on_every_hinge_hold_for_two_seconds(name):
    """From the first keyframe: no divergence, torsion as of the torque, no energy."""
    robot = ROBOTS[name]
    drive = DriveMap.from_catalogue(robot.get("size", DRIVE))
    driven = attach_all(name, drive, rotor_inertia=ROTOR)
    assert len(driven.drives) == robot["hinges"], driven.refused
    for joint, reason in driven.refused.items():
        assert names(reason, joint), reason
    model = driven.spec.compile()
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = start(model, driven.drives)

    first = float(data.energy.sum())
    work, turnover = 0.0, 1.0
    torsion = np.zeros(len(driven.drives))
    torque = np.zeros(len(driven.drives))
    excess = 0.0
    steps = math.ceil(TIME / model.opt.timestep)
    every = max(1, round(0.005 / model.opt.timestep))
    for k in range(steps):
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        power = data.qfrc_actuator @ (0.5 * (before + data.qvel))
        work += power * model.opt.timestep
        turnover = max(turnover, abs(work), abs(float(data.energy[0]) - first))
        excess = max(excess, float(data.energy.sum()) - first - work)
        if k % every == 0:
            got = [d.observe(model, data) for d in driven.drives.values()]
            torsion = np.maximum(torsion, [abs(float(g.torsion)) for g in got])
            torque = np.maximum(torque, [abs(float(g.torque)) for g in got])
    assert trouble(data) == []
    assert np.isfinite(data.qpos).all()
    assert excess < ENERGY * turnover
    for joint, moved, most in zip(driven.drives, torsion, torque, strict=True):
        assert moved < 2.0 * torsion_bound(drive, most), joint


@pytest.mark.parametrize("name", cases())
def test_stiff_drives_leave_the_robot_as_it_is(name):
    """Rotor as armature, 1e6 N·m/rad: links move as without drives."""
    plain = mujoco.MjSpec.from_file(path(name))
    model = plain.compile()
    reflected = {
        joint.name: float(model.dof_armature[model.joint(joint.name).dofadr[0]])
        for joint in plain.joints
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE
    }
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    for joint in reflected:
        dof = model.joint(joint).dofadr[0]
        reflected[joint] = max(reflected[joint], 0.01 * mass[dof, dof])
    drive = DriveMap.linear(STIFF)
    ratio = drive.ratio
    driven = attach_all(
        name,
        drive,
        level="linear",
        rotor="lumped",
        rotor_inertia={j: a / ratio**2 for j, a in reflected.items()} | others(plain),
    )
    for joint in driven.drives:
        plain.joint(joint).armature = reflected[joint]
    plain.option.integrator = driven.spec.option.integrator
    model, twin = plain.compile(), driven.spec.compile()
    data, twin_data = start(model, {}), start(twin, driven.drives)
    time = TIME if ROBOTS[name].get("kind") == "arm" else SHORT
    worst = 0.0
    for _ in range(math.ceil(time / model.opt.timestep)):
        mujoco.mj_step(model, data)
        mujoco.mj_step(twin, twin_data)
        for joint in driven.drives:
            apart = data.joint(joint).qpos[0] - twin_data.joint(joint).qpos[0]
            worst = max(worst, abs(apart))
    assert trouble(twin_data) == trouble(data) == []
    assert worst < SAME


def others(spec: mujoco.MjSpec) -> dict[str, float]:
    """A rotor for joints that are no hinges and refuse it."""
    return {j.name: 1e-6 for j in spec.joints if j.type != mujoco.mjtJoint.mjJNT_HINGE}


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


@pytest.mark.parametrize("name", cases())
def test_advise(name, command):
    """A setting within the error, or the refusal that the manifest predicts."""
    got = command("advise", path(name), "--error", "1arcmin")
    wanted = ROBOTS[name].get("advise", "VALID")
    if wanted != "VALID":
        assert got.status == {"NOT VALID": 1, "refused": 2}[wanted], got.errors
        assert names(got.errors, *ROBOTS[name]["advise_names"]), got.errors
        return
    assert got.status == 0, got.errors
    assert 0.0 < got.result["expected_error_arcmin"] <= 1.0
    assert got.result["cost"] > 0.0


def check_run(name: str, key: str, got: Outcome) -> None:
    """Hold what a run gave to the manifest."""
    robot = ROBOTS[name]
    wanted = robot.get(key, "VALID")
    said = robot.get(f"{key}_names", [])
    if wanted == "refused":
        assert got.status == 2, got.errors
        lines = [
            line
            for line in got.errors.splitlines()
            if not line.startswith("swgjoint: warning:")
        ]
        assert len(lines) == 1, got.errors
        assert names(lines[0], *said), got.errors
        return
    assert got.result, got.errors
    assert got.result["verdict"] == wanted, got.result.get("reasons")
    if wanted == "NOT VALID":
        assert got.status == 1
        reasons = "\n".join(map(str, got.result["reasons"]))
        assert names(reasons, *said), reasons
        return
    assert got.status == 0
    assert set(got.result["joints"]) == set(robot["joints"])
    for joint, figures in got.result["joints"].items():
        check_joint(joint, figures)
    check_energy(got.result["energy"])
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


def check_energy(energy: dict[str, float]) -> None:
    """Works, storage and losses balance."""
    turnover = sum(
        abs(energy[key])
        for key in ("motor_work_J", "load_work_J", "stored_J", "dissipated_J")
    )
    assert abs(energy["balance_error_J"]) < ENERGY * turnover + 1e-3
