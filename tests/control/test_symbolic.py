"""The joint as CasADi expressions against the plugin and its numpy twin."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import casadi
import mujoco
import numpy as np
import pytest
from messages import naming
from solved import few_teeth, kept

from swgjoint.control import symbolic
from swgjoint.control.symbolic import (
    joint_forces,
    joint_step,
    potential,
    relaxed_history,
    smooth_forces,
)
from swgjoint.errors import MissingExtraError
from swgjoint.joint.attach import attach
from swgjoint.joint.reference import TwinMotion, gradient_force
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

LAYOUTS = ["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]
ELEMENTS = (
    Jenkin(stiffness=2e4, yield_torque=2.0),
    Jenkin(stiffness=5e3, yield_torque=4.0),
)
TWO_MASS = """
<mujoco>
  <option timestep="1e-5" integrator="RK4" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="j" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia=".4 .4 .4"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(params=["synthetic", "catalogue"])
def conservative(request, synthetic_map) -> DriveMap:
    """Side bands and tooth orders, or three lines with rounded corners."""
    if request.param == "synthetic":
        return synthetic_map
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)
    return replace(drive, friction=None, hysteresis=())


@pytest.fixture
def lossy(friction_law):
    """Gives a drive a layout, friction and elements."""

    def with_losses(drive: DriveMap, layout: str) -> DriveMap:
        changes = {"friction": friction_law, "hysteresis": ELEMENTS}
        return replace(drive, layout=layout, **changes)

    return with_losses


def bench(drive: DriveMap):
    """Two masses with the drive: model, data, attached drive, rotor first."""
    spec = mujoco.MjSpec.from_string(TWO_MASS)
    rotor = 0.144 / drive.ratio**2
    got = attach(
        spec,
        joint="j",
        drive=drive,
        rotor_inertia=rotor,
        damping_ratio=0.02,
        friction=True,
    )
    model = spec.compile()
    joints = [model.joint(name) for name in (got.rotor, "j")]
    order = np.array([int(j.dofadr[0]) for j in joints])
    return model, mujoco.MjData(model), got, order


def random_state(drive: DriveMap, rng):
    """Torsions to 1.5 of the outer knots; elements and bristle stick or slip."""
    theta = rng.uniform(-8, 8)
    psi = theta / drive.ratio + 1.5 * rng.uniform(-1, 1) * drive.torsion_knots[-1]
    speed = rng.normal() * 10 ** rng.uniform(-2, 1.5)
    v = np.array([speed, speed / drive.ratio + rng.normal(0, 0.1)])
    history = relaxed_history(drive, theta, psi)
    history[:2] = drive.torsion(theta, psi) + 2e-4 * rng.standard_normal(2)
    history[2:] += 2e-3 * rng.standard_normal(len(history) - 2)
    return np.array([theta, psi]), v, history


def assert_forces_agree(drive: DriveMap, states: int) -> None:
    model, data, got, order = bench(drive)
    forces = joint_forces(drive, damping=got.damping)
    rng = np.random.default_rng(3)
    for _ in range(states):
        q, v, history = random_state(drive, rng)
        rests = tuple(history[: len(drive.hysteresis)])
        motion = TwinMotion(
            theta=q[0],
            psi=q[1],
            theta_rate=v[0],
            psi_rate=v[1],
            rest=rests,
            relaxed=history[-1],
        )
        found, torsion = forces(q, v, history)
        ours = found.full().ravel()
        twin = gradient_force(drive, motion, damping=got.damping)
        np.testing.assert_allclose(ours, twin, rtol=0.0, atol=1e-9)
        data.qpos[order], data.qvel[order] = q, v
        known = np.array([0.0, 0.0, *history, 1.0])
        data.plugin_state[: known.size] = known
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(ours, data.qfrc_passive[order], rtol=0.0, atol=1e-9)
        assert float(torsion) == pytest.approx(float(drive.torsion(*q)), abs=1e-14)


def test_loaded_forces_equal_twin_and_plugin(conservative, lossy):
    """The same with yield torques that depend on the elastic torque."""
    drive = lossy(conservative, LAYOUTS[0])
    curves = ((10.0, 4.0), (60.0, 0.5)), ((40.0, 6.0),)
    elements = tuple(
        replace(element, stiffness=20 * element.stiffness, yield_curve=curve)
        for element, curve in zip(drive.hysteresis, curves, strict=True)
    )
    assert_forces_agree(replace(drive, hysteresis=elements), 50)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_forces_equal_twin_and_plugin(conservative, layout, lossy):
    """Forces on rotor and link within 1e-9 N·m of both, beyond the knots, too."""
    assert_forces_agree(lossy(conservative, layout), 100)


def test_forces_of_a_large_map(monkeypatch, synthetic_map, lossy):
    """What is computed by matrices, for maps of many harmonics, is the same."""
    monkeypatch.setattr(symbolic, "LARGE", 0)
    drive = lossy(synthetic_map, LAYOUTS[0])
    assert joint_forces(drive, damping=1.0).is_a("MXFunction")
    assert_forces_agree(drive, 30)


@pytest.mark.fe
@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_forces_of_a_map_of_finite_elements(toleranced_map, layout, lossy):
    """Kinematic error, cogging and ripple as finite elements give them: 1e-9 N·m."""
    assert len(toleranced_map.orders) > 5
    assert_forces_agree(lossy(toleranced_map, layout), 50)


@pytest.fixture(scope="module")
def toleranced_map() -> DriveMap:
    """Of a coarse drive: any map with all these parts will do."""
    from swgjoint.fe.common.sampling import sample_map
    from swgjoint.maps.fit.fit import fit_map

    errors = {"tolerances.circular_spline_cumulative_pitch_um": 10.0}
    return kept(
        "coarse map, pitch error of 10 um, 4 angles",
        lambda: fit_map(sample_map(few_teeth(**errors), angles=4)),
    )


def assert_trajectory_agrees(drive: DriveMap, chunks: int) -> None:
    """RK4 at 1e-5 s in both, loaded, in chunks of 0.01 s."""
    model, data, got, order = bench(drive)
    i = drive.ratio
    data.qpos[order] = 0.2, 0.2 / i
    data.qvel[order] = abs(i) / 3.0, abs(i) / 3.0 / i
    applied = np.array([-20.0 / i, 25.0])
    data.qfrc_applied[order] = applied
    q, v = data.qpos[order].copy(), data.qvel[order].copy()
    history = relaxed_history(drive, *q)
    if drive.friction:
        data.plugin_state[-2:] = history[-1], 1.0
    step = joint_step(
        drive,
        damping=got.damping,
        rotor_inertia=got.rotor_inertia,
        link_inertia=got.link_inertia,
        timestep=1e-5,
    )
    state = ["i0", "i1", "i2"], ["o0", "o1", "o2"]
    many, held = step.mapaccum("many", 1000, *state), np.tile(applied, (1000, 1)).T
    for _ in range(chunks):
        q, v, history = (values[:, -1] for values in many(q, v, history, held))
        mujoco.mj_step(model, data, 1000)
        # output side: the angle of the rotor over the ratio
        off = (q.full().ravel() - data.qpos[order]) / [i, 1.0]
        assert np.abs(off).max() < 1e-6
    assert np.ptp(data.qpos[order]) > 0.0


@pytest.mark.parametrize("losses", [False, True])
def test_trajectory_equals_plugin(conservative, losses, lossy):
    """Within 1e-6 rad over 0.1 s, with elements that slip and bristles that stick."""
    drive = lossy(conservative, LAYOUTS[0]) if losses else conservative
    assert_trajectory_agrees(drive, 10)


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_long_trajectory_equals_plugin(conservative, layout):
    """Within 1e-6 rad over 0.3 s, a turn of the rotor, in every layout."""
    assert_trajectory_agrees(replace(conservative, layout=layout), 30)


def test_hessian_is_symmetric_and_the_slope_of_the_forces(synthetic_map):
    """Second derivatives exist inside and beyond the knots and agree with differences.

    Newton-type solvers take them.
    """
    q = casadi.SX.sym("q", 2)
    x = symbolic.torsion(synthetic_map, q[0], q[1])
    energy = potential(synthetic_map, x, q[0], q[1])
    hessian, gradient = casadi.hessian(energy, q)
    both = casadi.Function("both", [q], [hessian, gradient])
    rng = np.random.default_rng(5)
    ratio, d = synthetic_map.ratio, np.array([1e-5, 1e-7])
    for part in (-1.3, -0.4, 0.2, 0.9, 1.4):
        theta = rng.uniform(-3, 3)
        at = np.array([theta, theta / ratio - part * synthetic_map.torsion_knots[-1]])
        H = both(at)[0].full()
        np.testing.assert_array_equal(H, H.T)
        for k in range(2):
            step = d[k] * np.eye(2)[k]
            slope = (both(at + step)[1] - both(at - step)[1]).full().ravel() / 2 / d[k]
            np.testing.assert_allclose(
                H[:, k], slope, rtol=0.0, atol=1e-5 * np.abs(H[:, k]).max()
            )


def test_smooth_law_is_the_whole_law_at_speed(synthetic_map, friction_law):
    """Without elements, and where the bristle slips, both laws are one to 0.1 %.

    Static and sliding friction differ in the smooth law as in the other; at rest the
    smooth law has none.
    """
    drive = replace(synthetic_map, friction=friction_law)
    whole = joint_forces(drive, damping=2.0)
    smooth = smooth_forces(drive, damping=2.0)
    bare = joint_forces(synthetic_map, damping=2.0)
    q = np.array([0.7, 0.7 / drive.ratio - 1e-3])
    behind = [float(np.dot(drive.friction_direction, q)) - 1.0]
    for speed in (-20.0, -1.0, 1.0, 20.0):
        v = np.array([speed, speed / drive.ratio])
        past = behind if speed > 0 else [behind[0] + 2.0]
        none = bare(q, v, [])[0]
        rubs = (whole(q, v, past)[0] - none).full()
        assert abs(rubs[0, 0]) > 0.04
        np.testing.assert_allclose((smooth(q, v)[0] - none).full(), rubs, rtol=1e-3)
    rest = np.zeros(2)
    np.testing.assert_allclose(smooth(q, rest)[0].full(), bare(q, rest, [])[0].full())


def test_missing_casadi_says_what_installs_it(monkeypatch, synthetic_map):
    """One line with the extra."""

    def absent(name: str):
        if name == "casadi":
            raise ImportError(name)
        return import_module(name)

    monkeypatch.setattr(symbolic, "import_module", absent)
    with pytest.raises(
        MissingExtraError, match=naming("casadi", "pip install 'swgjoint[control]'")
    ):
        joint_forces(synthetic_map, damping=1.0)
