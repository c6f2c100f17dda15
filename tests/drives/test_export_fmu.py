"""Exported FMUs: the law of the twin, in both kinds and both versions of FMI."""

from __future__ import annotations

import ctypes
import warnings
import zipfile
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from fmi3 import Fmu
from messages import names, naming

import swgjoint
from swgjoint.errors import InputError
from swgjoint.joint.hysteresis_step import move_rests, yield_torsions
from swgjoint.joint.reference import (
    TwinMotion,
    gradient_force,
    metric_of,
    other_acceleration,
    relax_state,
    rest_after,
    scheme_force,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.sheet.loop import torque_loop

ROTOR, LOAD = 4e-5, 0.5
"""Inertias [kg·m²]."""
STATES = ("motor_angle", "output_angle", "motor_speed", "output_speed")
VERSIONS = ("3.0", "2.0")


@pytest.fixture
def lossy(synthetic_map, friction_law):
    """Harmonics, friction and two elements, one of them dependent on the load."""
    elements = (
        Jenkin(stiffness=6e4, yield_torque=2.0, yield_curve=((50.0, 4.0),)),
        Jenkin(stiffness=2e4, yield_torque=1.0),
    )
    return replace(synthetic_map, friction=friction_law, hysteresis=elements)


def twin_motion(drive, torques, *, h, rotor, load, damping, start=(0.0, 0.0)):
    """States after each step of the twin, with constant torques in each step."""
    inertia = np.array([rotor, load])
    x, v = np.array(start, float), np.zeros(2)
    motion = TwinMotion(
        theta=x[0],
        psi=x[1],
        theta_rate=0.0,
        psi_rate=0.0,
        rotor_weight=1.0 / rotor,
        link_weight=1.0 / load,
        rest=(0.0,) * len(drive.hysteresis),
    )
    found = []
    for torque in torques:
        force = scheme_force(drive, motion, timestep=h, damping=damping)
        metric = np.diag(inertia) + metric_of(drive, force, timestep=h)
        f = np.array([force.theta, force.psi]) + torque
        end = v + np.linalg.solve(metric, h * f)
        x = x + 0.5 * h * (v + end)
        rates = {"theta_rate": float(end[0]), "psi_rate": float(end[1])}
        other = other_acceleration(drive, motion, force, timestep=h, **rates)
        relaxed = None
        if drive.friction is not None:
            relaxed = relax_state(drive, motion, force, timestep=h, **rates)
        motion = replace(
            motion,
            theta=float(x[0] + 0.5 * h * end[0]),
            psi=float(x[1] + 0.5 * h * end[1]),
            rotor_acceleration=float(other[0]),
            link_acceleration=float(other[1]),
            rest=rest_after(drive, motion, force, timestep=h, **rates),
            limit=force.reach,
            relaxed=relaxed,
            **rates,
        )
        v = end
        found.append([*x, *v])
    return np.array(found)


def fmu_of(drive, tmp_path, *, by_steps, **options):
    path = tmp_path / "drive.fmu"
    options = {"rotor_inertia": ROTOR, "load_inertia": LOAD} | options
    swgjoint.export_fmu(drive, path, **options)
    return Fmu(path, by_steps=by_steps)


def follow(fmu, torques, h):
    """States after each communication step."""
    found = []
    for k, (motor, load) in enumerate(torques):
        assert fmu.set(motor_torque=motor, load_torque=load)
        assert fmu.step(k * h, h), fmu.said
        found.append(fmu.get(*STATES))
    return np.array(found)


BENCH = """<mujoco><option timestep="{h}" gravity="0 0 0"/><worldbody><body>
<joint name="link" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="{load} {load} {load}"/>
</body></worldbody></mujoco>"""


def test_angles_of_mujoco_are_half_a_step_ahead(synthetic_map, tmp_path):
    """The angles of an FMU are those of its times, and the speeds of both agree."""
    h, n, torque = 2e-4, 1000, 0.015
    spec = mujoco.MjSpec.from_string(BENCH.format(h=h, load=LOAD))
    options = {"joint": "link", "drive": synthetic_map, "rotor_inertia": ROTOR}
    rotor = swgjoint.attach(spec, **options, rotor="lumped").rotor
    model = spec.compile()
    data = mujoco.MjData(model)
    names_of = (rotor, "link")
    data.joint(rotor).qfrc_applied[:] = torque
    theirs = []
    for _ in range(n):
        mujoco.mj_step(model, data)
        theirs.append([getattr(data.joint(j), k)[0] for k in ("qpos", "qvel")
                       for j in names_of])  # fmt: skip
    fmu = fmu_of(synthetic_map, tmp_path, by_steps=True, step=h)
    assert fmu.start()
    ours = follow(fmu, [(torque, 0.0)] * n, h)
    angle, speed = np.hsplit(np.array(theirs), 2)
    size = np.abs(angle).max(axis=0)
    apart = np.abs(ours[:, :2] - angle).max(axis=0) / size
    shifted = np.abs(ours[:, :2] - (angle - 0.5 * h * speed)).max(axis=0) / size
    assert (apart > 5e-4).all() and (shifted < 1e-11).all()
    np.testing.assert_allclose(ours[:, 2:], speed, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("varies", [True, False])
def test_a_chirp_equals_the_twin(lossy, tmp_path, varies):
    """Motor torque of 5 to 80 Hz: the same motion within 1e-9 of its size.

    The step resolves the orders of the map; with steps that do not, the motion with
    friction is chaotic and amplifies round-off.
    """
    drive = lossy if varies else replace(lossy, hysteresis=lossy.hysteresis[1:])
    h, n = 2e-4, 2000
    t = h * np.arange(n)
    motor = 0.15 * np.sin(2.0 * np.pi * (5.0 * t + 0.5 * 75.0 / t[-1] * t**2))
    torques = np.column_stack([motor, 5.0 * np.sin(3.0 * t)])
    fmu = fmu_of(drive, tmp_path, by_steps=True)
    assert fmu.start()
    [damping] = fmu.get("damping")
    found = follow(fmu, torques, h)
    twin = twin_motion(drive, torques, h=h, rotor=ROTOR, load=LOAD, damping=damping)
    assert np.ptp(found[:, 0]) > 1.0
    size = np.abs(twin).max(axis=0)
    assert (np.abs(found - twin).max(axis=0) < 1e-9 * size).all()


def test_the_output_torque_accelerates_the_load_with_friction(tmp_path):
    """Friction keeps to its yield torque while the load on a slip grows.

    In the scheme, the bristle is at the yield torque of the middle of the step, which
    is then smaller than that of the state. With the bristle damping of a sticking
    bristle, the output torque is wrong by 9 of 22 N·m.
    """
    law = Friction(stiffness=70.0, coulomb=0.07, static=0.07, load=0.07, damping=0.07)
    drive = replace(DriveMap.linear(3e4), friction=law)
    h, n = 1e-3, 600
    motor = 0.25 * np.sin(8.0 * np.pi * h * np.arange(n))
    fmu = fmu_of(drive, tmp_path, by_steps=True)
    assert fmu.start()
    torque, speed = [], []
    for k in range(n):
        assert fmu.set(motor_torque=motor[k]) and fmu.step(k * h, h), fmu.said
        for values, name in ((torque, "output_torque"), (speed, "output_speed")):
            values += fmu.get(name)
    # the mean torque of two steps is that of the state between them
    wanted = LOAD * (np.array(speed[2:]) - speed[:-2]) / (2.0 * h)
    # 2 % = curvature of the torque over two steps and the step in which it sticks
    assert np.abs(torque[1:-1] - wanted).max() < 0.03 * np.abs(wanted).max()


def test_a_stiffness_loop_equals_the_twin(lossy, tmp_path):
    """Locked rotor, slow load to rated torque and back: torsion within 1e-9 rad.

    Its width at zero torque is that of the loop of the map plus what the damping adds,
    within 1 %.
    """
    drive = replace(lossy, friction=None)
    rated, h, rotor = drive.ratings.rated_torque, 2e-3, 1e6
    path = np.sin(2.0 * np.pi * np.arange(1, 4001) / 2000)
    torques = np.column_stack([0.0 * path, -rated * path])
    fmu = fmu_of(drive, tmp_path, by_steps=True, rotor_inertia=rotor, step=h)
    assert fmu.start()
    [damping] = fmu.get("damping")
    found, once = follow(fmu, torques, h), torques[:2000]
    twin = twin_motion(drive, once, h=h, rotor=rotor, load=LOAD, damping=damping)
    assert np.abs(found[:2000] - twin)[:, :2].max() < 1e-9
    # a step has the torque of its middle: zero is half a step before its end
    falling, rising = (found[[k - 1, k], 1].mean() for k in (2999, 3999))
    up_to = replace(drive.ratings, repeated_peak=rated, T2=0.5 * rated)
    loop = torque_loop(replace(drive, ratings=up_to))
    slope = float(drive.coefficients(0.0, 2)[0, 0])
    damped = damping * np.abs(found[[2999, 3999], 3]).sum() / slope
    expected = loop.hysteresis_loss() + damped
    assert abs(falling - rising) == pytest.approx(expected, rel=0.01)


def test_derivatives_equal_the_twin(lossy, tmp_path):
    """Model exchange: torques at states, memory moves on at the end of a step."""
    fmu = fmu_of(lossy, tmp_path, by_steps=False)
    assert fmu.start(motor_torque=0.1, load_torque=-2.0)
    [damping] = fmu.get("damping")
    b = np.array(lossy.friction_direction, float)
    rest, relaxed = (0.0, 0.0), None
    h, x = 2e-4, np.array([0.1, 0.1 / lossy.ratio, 0.0, 0.0])
    moved = set()
    for _ in range(1000):
        motion = TwinMotion(
            **dict(zip(("theta", "psi", "theta_rate", "psi_rate"), x, strict=True)),
            rest=rest,
            relaxed=relaxed,
        )
        on = np.array(gradient_force(lossy, motion, damping=damping))
        on += [0.1, -2.0]
        rates = np.array([x[2], x[3], *(on / [ROTOR, LOAD])])
        found = np.array(fmu.rates(x))
        size = np.abs([on[0], 10.0]).max() / np.array([ROTOR, LOAD])
        assert np.abs(found[2:] - rates[2:]).max() < 1e-9 * size.max()
        np.testing.assert_array_equal(found[:2], rates[:2])
        x = x + h * found
        x[:2] += 0.5 * h**2 * found[2:]
        fmu.rates(x)
        fmu.complete()
        # the slip of the elements and of the bristle at the end of the step
        torsion = float(lossy.torsion(*x[:2]))
        elastic = float(lossy.torque(torsion, *x[:2]))
        reach = yield_torsions(lossy.hysteresis, elastic)
        rest = move_rests(rest, reach, torsion)
        slipping = sum(
            e.stiffness * np.clip(torsion - r, -d, d)
            for e, r, d in zip(lossy.hysteresis, rest, reach, strict=True)
        )
        law, turned = lossy.friction, float(b @ x[:2])
        slip = law.yield_torque(float(b @ x[2:]), (elastic + slipping) / lossy.ratio)
        far = float(slip) / law.stiffness
        relaxed = turned if relaxed is None else relaxed
        relaxed = float(np.clip(relaxed, turned - far, turned + far))
        moved.add(rest)
    assert len(moved) > 10


def test_internal_steps_divide_a_communication_step(lossy, tmp_path):
    """A step of 4 ms with internal steps of 1 ms is four of them, bit for bit."""
    ends = []
    for h, n in ((4e-3, 25), (1e-3, 100)):
        fmu = fmu_of(lossy, tmp_path, by_steps=True, step=1e-3)
        assert fmu.start()
        ends.append(follow(fmu, [(0.2, -3.0)] * n, h)[-1])
    np.testing.assert_allclose(*ends, rtol=1e-12)


def test_states_and_reset(lossy, tmp_path):
    """A restored state and a reset instance continue as before, bit for bit."""
    fmu = fmu_of(lossy, tmp_path, by_steps=True)
    assert fmu.start()
    torques = [(0.3, -4.0)] * 50
    first = follow(fmu, torques, 1e-3)
    kept = ctypes.c_void_p()
    assert fmu.call("GetFMUState", ctypes.byref(kept))
    on = follow(fmu, torques, 1e-3)
    assert fmu.call("SetFMUState", kept)
    np.testing.assert_array_equal(follow(fmu, torques, 1e-3), on)
    assert fmu.call("FreeFMUState", ctypes.byref(kept))
    assert fmu.call("Reset")
    assert fmu.start()
    np.testing.assert_array_equal(follow(fmu, torques, 1e-3), first)


def test_outputs_are_those_of_the_law(lossy, tmp_path):
    """Torsion, errors and torques at the states of a motion; power is balanced."""
    fmu = fmu_of(replace(lossy, friction=None, hysteresis=()), tmp_path, by_steps=True)
    assert fmu.start(damping=0.0)
    follow(fmu, [(0.3, -4.0)] * 100, 1e-3)
    theta, psi, *_ = fmu.get(*STATES)
    on_rotor, on_load = lossy.forces(theta, psi)
    names = ("torsion", "transmission_error", "input_torque", "output_torque", "ratio")
    torsion, error, rotor, load, ratio = fmu.get(*names)
    assert torsion == pytest.approx(float(lossy.torsion(theta, psi)), rel=1e-9)
    assert error == pytest.approx(psi - theta / ratio, rel=1e-12)
    assert (rotor, load) == pytest.approx((float(on_rotor), float(on_load)), rel=1e-9)
    assert ratio == lossy.ratio


def test_parameters_change_the_drive(lossy, tmp_path):
    """Friction, elements and deviations by their variables equal those of a map."""
    other = replace(
        lossy,
        friction=replace(lossy.friction, viscous=3e-3, coulomb=0.05),
        hysteresis=(Jenkin(stiffness=3e4, yield_torque=1.5),),
    )
    lossy = replace(lossy, hysteresis=lossy.hysteresis[1:])
    torques = [(0.3, -4.0)] * 100
    ends = []
    for drive, values in (
        (other, {}),
        (
            lossy,
            {
                "friction.viscous": 3e-3,
                "friction.coulomb": 0.05 + lossy.friction.bending,
                "hysteresis[1].stiffness": 3e4,
                "hysteresis[1].yield_torque": 1.5,
            },
        ),
        (lossy, {"stiffness_deviation": 0.2, "loss_deviation": -0.5}),
    ):
        fmu = fmu_of(drive, tmp_path, by_steps=True)
        assert fmu.put(values) and fmu.start()
        ends.append(follow(fmu, torques, 1e-3)[-1])
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-12)
    assert np.abs(ends[2] / ends[0] - 1.0).max() > 1e-3


def test_what_cannot_be_is_an_error(synthetic_map, tmp_path):
    """Parameters in motion, values out of range, another token: a message each."""
    fmu = fmu_of(synthetic_map, tmp_path, by_steps=True)
    assert not fmu.start(rotor_inertia=0.0) and "rotor_inertia" in fmu.said[-1]
    assert fmu.call("Reset") and fmu.start()
    assert not fmu.set(damping=1.0) and not fmu.set(motor_torque=float("nan"))
    assert not fmu.step(0.0, 0.0) and "step" in fmu.said[-1]
    assert fmu.step(0.0, 1e-3)
    other = Fmu(tmp_path / "drive.fmu", by_steps=False, token="{another}")
    assert other.instance is None and "another FMU" in other.said[-1]


def test_equal_drives_give_equal_files(synthetic_map, tmp_path):
    """Byte for byte; the library does not need MuJoCo or Python."""
    files = []
    for name in ("a.fmu", "b.fmu"):
        swgjoint.export_fmu(synthetic_map, tmp_path / name, rotor_inertia=ROTOR)
        files.append((tmp_path / name).read_bytes())
    assert files[0] == files[1]
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        (library,) = (n for n in archive.namelist() if n.startswith("binaries"))
        content = archive.read(library)
    assert b"libmujoco" not in content and b"libpython" not in content
    assert b"fmi2DoStep" in content and b"fmi3DoStep" in content


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"version": "1.0"}, ("1.0", "3.0, 2.0")),
        ({"rotor_inertia": 0.0}, ("rotor_inertia", "kg·m²", "1e-30")),
        ({"rotor_inertia": 1e-310}, ("rotor_inertia", "1e-310 kg·m²", "1e-30")),
        ({"load_inertia": 1e-310}, ("load_inertia", "1e-310 kg·m²", "1e-30")),
        ({"load_inertia": float("nan")}, ("load_inertia", "nan kg·m²")),
        ({"step": -1.0}, ("step", "-1 s")),
    ],
)
def test_bad_values_are_refused(synthetic_map, tmp_path, options, parts):
    """In one line, and without a file."""
    options = {"rotor_inertia": ROTOR} | options
    with pytest.raises(InputError, match=naming(*parts)):
        swgjoint.export_fmu(synthetic_map, tmp_path / "a.fmu", **options)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def fmpy():
    pytest.importorskip("fmpy", reason="fmpy is not installed")
    import fmpy.validation

    return fmpy


@pytest.mark.filterwarnings("ignore")  # of fmpy and what it imports
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_finds_no_fault(fmpy, lossy, tmp_path, version):
    """Its validator reports nothing, with every kind of parameter and with none."""
    path = tmp_path / "drive.fmu"
    for drive in (lossy, replace(lossy, hysteresis=lossy.hysteresis[1:])):
        swgjoint.export_fmu(drive, path, version=version, rotor_inertia=ROTOR)
        assert fmpy.validation.validate_fmu(str(path)) == []
    swgjoint.export_fmu(
        DriveMap.linear(1e4), path, version=version, rotor_inertia=ROTOR
    )
    assert fmpy.validation.validate_fmu(str(path)) == []


@pytest.mark.filterwarnings("ignore")
def test_fmpy_runs_both_kinds_of_both_versions(fmpy, synthetic_map, tmp_path):
    """Equal numbers in both versions; both kinds tend to the same motion.

    Model exchange is integrated by fmpy with a relative tolerance of 1e-8, and
    co-simulation with steps of 0.02 ms.
    """
    found = {}
    for version in VERSIONS:
        path = tmp_path / f"{version}.fmu"
        swgjoint.export_fmu(
            synthetic_map,
            path,
            version=version,
            rotor_inertia=ROTOR,
            load_inertia=LOAD,
            step=2e-5,
        )
        for kind in ("CoSimulation", "ModelExchange"):
            rows = fmpy.simulate_fmu(
                str(path),
                fmi_type=kind,
                stop_time=0.1,
                output_interval=1e-3,
                relative_tolerance=1e-8,
                start_values={"load_torque": -1.0, "motor_torque": 0.0},
                output=[*STATES, "torsion"],
            )
            found[version, kind] = np.array(rows.tolist())
    for kind in ("CoSimulation", "ModelExchange"):
        np.testing.assert_array_equal(found["3.0", kind], found["2.0", kind])
    one, other = found["3.0", "CoSimulation"], found["3.0", "ModelExchange"]
    size = np.abs(other).max(axis=0)
    assert (np.abs(one - other).max(axis=0) < 2e-3 * size).all()


@pytest.mark.parametrize(("step", "said"), [(3e-3, False), (4e-3, True), (1.0, True)])
def test_a_step_beyond_the_vibration_is_named(tmp_path, step, said):
    """CSG-25-100 vibrates at 54 Hz: five steps per period are 3.7 ms.

    With a step of 1 s and a communication step of 0.1 s, the output turned by 0.0003
    rad in the first 0.1 s instead of -0.045 rad.
    """
    path = tmp_path / "drive.fmu"
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        swgjoint.export_fmu("CSG-25-100", path, step=step)
    assert path.exists()
    lines = [str(one.message) for one in found]
    assert [
        names(line, f"step {step:g} s", "54.21 Hz", "0.0037 s") for line in lines
    ] == ([True] if said else [])
