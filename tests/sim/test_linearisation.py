"""Linear models of scenes against closed forms, the engine and the scene itself."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from messages import naming
from scipy.linalg import solve_discrete_are

from swgjoint.errors import ComputationError, InputError
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.assembly import assemble
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.linearisation import linearise
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

UPRIGHT = {"shoulder": -90.0, "elbow": 20.0}
"""Posture in which gravity pulls a two-link arm away [deg]."""


def hold(arm="two-link", start=None, **overrides):
    """An arm that stands still, with catalogue drives without kinematic error."""
    data = {
        "name": "hold",
        "arm": arm,
        "defaults": {
            "drive": "CSG-17-100",
            "level": "full",
            "rotor_inertia_kgm2": 2e-5,
            "kinematic_error_arcmin": 0.0,
        },
        "trajectory": {
            "kind": "constant_speed",
            "speed_deg_s": {},
            "start_deg": start or {},
        },
        "controller": {"feedback": "link"},
        "simulation": {"duration_s": 0.2, "step_s": 1e-3},
    }
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}
    return Scene.from_data(data, overrides=dotted)


BEARING = {"unit": "CSG-17", "centre_mm": 20.0}
"""Output bearing beside the plane of the arm."""


class Torque:
    """Constant torques with a rectangular wave around them."""

    def __init__(self, plant, size):
        self.plant, self.size = plant, size

    def start(self, task):
        """Nothing is prepared."""
        assert task.period == self.plant.period

    def torque(self, k, measured):
        """Motor torques [N·m]."""
        return self.plant.input + self.wave(k)

    def wave(self, k):
        """Added torques at an instant [N·m]."""
        return self.size * np.array([1.0, -0.4]) * (1.0 if k // 10 % 2 == 0 else -1.0)


class FullState:
    """Full state feedback; link speeds are differences of link angles."""

    def __init__(self, plant, weights, effort):
        a, b, r = plant.A, plant.B, effort * np.eye(len(plant.inputs))
        p = solve_discrete_are(a, b, np.diag(weights), r)
        self.plant, self.gain = plant, np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)

    def start(self, task):
        """Nothing is prepared."""
        self.last = None

    def torque(self, k, measured):
        """Motor torques [N·m]."""
        link = measured.link_angle
        speed = 0.0 * link
        if self.last is not None:
            speed = (link - self.last) / self.plant.period
        self.last = link
        state = np.concatenate(
            [measured.motor_angle, link, measured.motor_speed, speed]
        )
        return self.plant.input - self.gain @ (state - self.plant.state)


def closed_form(plant, drive, damping):
    """Oscillation of rotor and link on a spring: angular frequency, damping ratio."""
    i, rotor, link = drive.ratio, 1e-4, 1.0
    torque = plant.outputs.index("joint.output_torque")
    angle = plant.states.index("joint.link_angle")
    inertia = 1.0 / (1.0 / link + 1.0 / (i * i * rotor))
    omega = np.sqrt(-plant.C[torque, angle] / inertia)
    return omega, 0.5 * damping / (inertia * omega)


@pytest.mark.parametrize("level", ["linear", "full"])
def test_one_joint_is_two_inertias_and_a_spring(level):
    """Vibration and rigid motion converge to the closed form, with the step."""
    misses = []
    for step in (1e-3, 5e-4, 2.5e-4):
        scene = hold(
            "bench",
            defaults__level=level,
            defaults__rotor_inertia_kgm2=1e-4,
            simulation__step_s=step,
            load__joint__torque_Nm=10.0,
        )
        plant = linearise(scene)
        assert plant.states == (
            "joint.motor_angle",
            "joint.link_angle",
            "joint.motor_speed",
            "joint.link_speed",
        )
        one = assemble(scene.with_friction(False)).transmissions[0]
        omega, zeta = closed_form(plant, one.drive, one.attached.damping)
        poles = sorted(plant.poles, key=abs)
        # two poles at zero: free motion, up to the square root of round-off
        assert abs(poles[1]) < 1e-3 * omega
        exact = omega * complex(-zeta, np.sqrt(1.0 - zeta * zeta))
        found = poles[3] if poles[3].imag > 0 else poles[2]
        misses.append(abs(found - exact) / omega)
        assert -plant.input[0] * abs(one.ratio) == pytest.approx(10.0, rel=1e-9)
        # the momentum that a torque gives, at the output
        i = one.ratio
        gained = plant.B[2, 0] * 1e-4 * i + plant.B[3, 0] * 1.0
        assert gained == pytest.approx(i * step, rel=1e-4)
    order = np.log2(misses[0] / misses[1]), np.log2(misses[1] / misses[2])
    assert min(order) > 0.9
    assert misses[-1] < (0.006 if level == "linear" else 0.004)


def test_derivatives_are_those_of_the_engine():
    """MuJoCo's own differences of one step; a longer period is a power of it."""
    scene = hold(start=UPRIGHT)
    plant = linearise(scene)
    assembly = assemble(scene.with_friction(False), controlled_by="test")
    model = assembly.model
    data = mujoco.MjData(model)
    set_start(assembly, data)
    data.ctrl[:] = control_inputs(assembly)[0]
    data.ctrl[:2] = plant.input
    a, b = np.zeros((8, 8)), np.zeros((8, 2))
    mujoco.mjd_transitionFD(model, data, 2e-5, True, a, b, None, None)
    order = np.r_[assembly.motor_velocity, assembly.link_velocity]
    order = np.r_[order, model.nv + order]
    scale = np.abs(a).max(axis=1)[order, None]
    # both leave out different parts of tiny forces
    assert (np.abs(plant.A - a[np.ix_(order, order)]) / scale).max() < 1e-5
    scale = np.abs(b).max(axis=1)[order, None]
    assert (np.abs(plant.B - b[order]) / scale).max() < 1e-3

    longer = linearise(hold(start=UPRIGHT, controller__control_period_s=3e-3))
    assert longer.period == pytest.approx(3e-3)
    power = np.linalg.matrix_power(plant.A, 3)
    scale = np.abs(power).max(axis=1, keepdims=True)
    assert (np.abs(longer.A - power) / scale).max() < 1e-4
    gain = sum(np.linalg.matrix_power(plant.A, k) @ plant.B for k in range(3))
    scale = np.abs(gain).max(axis=1, keepdims=True)
    assert (np.abs(longer.B - gain) / scale).max() < 1e-4


@pytest.mark.parametrize("bearing", [{}, {"joints__elbow__output_bearing": BEARING}])
def test_it_predicts_the_scene(bearing):
    """Angles, speeds, output torques and tool follow the linear model for 0.2 s."""
    scene = hold(start={"shoulder": 40.0, "elbow": -70.0}, **bearing)
    plant = linearise(scene)
    law = Torque(plant, 1e-4)
    run = run_scene(scene.with_friction(False), controller=law)
    assert len(plant.states) == 8 + 4 * len(bearing)
    x, outputs = np.zeros(len(plant.states)), []
    for k in range(len(run.time)):
        outputs.append(plant.output + plant.C @ x)
        x = plant.A @ x + plant.B @ law.wave(k)
    measured = np.column_stack(
        [
            run.motor_position,
            run.motor_velocity,
            run.position,
            run.output_torque,
            run.tool_position,
        ]
    )
    assert plant.outputs == (
        *(f"{j}.motor_{k}" for k in ("angle", "speed") for j in run.joints),
        *(f"{j}.link_angle" for j in run.joints),
        *(f"{j}.output_torque" for j in run.joints),
        "tool.x",
        "tool.y",
        "tool.z",
    )
    predicted = np.array(outputs)
    moved = np.abs(measured - plant.output).max(axis=0)
    moved[plant.outputs.index("tool.y")] = 1.0  # the arm is planar
    assert (np.abs(measured - predicted).max(axis=0) / moved).max() < 0.01


def test_state_feedback_stabilises_the_scene():
    """An arm that falls with constant torques returns after a blow, with friction."""
    scene = hold(
        start=UPRIGHT,
        simulation__duration_s=1.5,
        disturbance=[
            {
                "kind": "joint_pulse",
                "joint": "elbow",
                "torque_Nm": 10.0,
                "start_s": 0.05,
                "duration_s": 0.02,
            }
        ],
    )
    plant = linearise(scene)
    assert np.abs(np.linalg.eigvals(plant.A)).max() > 1.001
    law = FullState(plant, np.repeat([0.0, 1e3, 0.0, 1.0], 2), 1.0)
    closed = np.linalg.eigvals(plant.A - plant.B @ law.gain)
    assert np.abs(closed).max() < 0.999
    ends = []
    for scene_now, controller in (
        (scene.with_friction(False), Torque(plant, 0.0)),
        (scene.with_friction(False), law),
        (scene, law),
    ):
        run = run_scene(scene_now, controller=controller)
        off = np.abs(run.position - run.position[0])
        ends.append(
            (off.max(), off[-1].max(), np.ptp(run.position[-200:], axis=0).max())
        )
    (fallen, *_), (peak, left, _), (_, stuck, moving) = ends
    assert fallen > 10.0 * peak
    assert left < 0.01 * peak
    # friction holds the arm beside its place, and at rest
    assert stuck < 0.5 * peak and moving < 0.01 * peak


@pytest.mark.parametrize("level", ["rigid", "kinematic"])
def test_joints_without_a_rotor(level):
    """A rigid joint is an inertia with its rotor, which the motor turns directly."""
    plant = linearise(hold("bench", defaults__level=level))
    assert plant.states == ("joint.link_angle", "joint.link_speed")
    assert "joint.output_torque" not in plant.outputs
    inertia = 1.0 + 100.0**2 * 2e-5
    h = plant.period
    np.testing.assert_allclose(plant.A, [[1.0, h], [0.0, 1.0]], rtol=0, atol=1e-9)
    ratio = plant.C[plant.outputs.index("joint.motor_angle"), 0]
    assert plant.C[plant.outputs.index("joint.motor_speed"), 1] == pytest.approx(ratio)
    expected = ratio * h / inertia
    np.testing.assert_allclose(plant.B[:, 0], [h * expected, expected], rtol=1e-6)
    assert abs(ratio) == pytest.approx(100.0)


def test_postures():
    """Another posture is what a scene that starts there gives."""
    there = linearise(hold(start=UPRIGHT))
    posture = {name: np.deg2rad(angle) for name, angle in UPRIGHT.items()}
    asked = linearise(hold(), posture=posture)
    np.testing.assert_allclose(asked.A, there.A, rtol=0, atol=1e-9)
    np.testing.assert_allclose(asked.input, there.input, rtol=1e-9)
    assert np.abs(asked.A - linearise(hold()).A).max() > 1e-6


def test_what_has_no_linear_model_is_refused():
    """Each in one line: an unknown joint, its range, a torque limit."""
    with pytest.raises(InputError, match=naming("posture", "wrist", "elbow")):
        linearise(hold(), posture={"wrist": 0.0})
    with pytest.raises(InputError, match=naming("elbow", "range")):
        linearise(hold(), posture={"elbow": 3.0})
    with pytest.raises(InputError, match=naming("posture", "finite")):
        linearise(hold(), posture={"elbow": np.nan})
    weak = hold(defaults__motor={"torque_limit_Nm": 1e-3})
    with pytest.raises(ComputationError, match=naming("shoulder", "torque limit")):
        linearise(weak)


def test_natural_frequencies_tell_whether_poles_are_aliased():
    """Short steps have them as poles; long steps have slower ones, and say so."""
    fine = linearise(hold(defaults__level="linear", simulation__step_s=2e-5))
    coarse = linearise(hold(defaults__level="linear", simulation__step_s=5e-3))
    fastest = fine.natural_Hz[-1]
    np.testing.assert_allclose(coarse.natural_Hz, fine.natural_Hz)
    found = [np.abs(plant.poles.imag).max() / (2.0 * np.pi) for plant in (fine, coarse)]
    assert found[0] == pytest.approx(fastest, rel=0.01)
    assert not fine.aliased and coarse.aliased
    assert found[1] < 0.5 / coarse.period + 1e-9 < fastest
    # two drives: two elastic modes, and two in which motors and links turn together
    assert (fine.natural_Hz[:2] < 1e-3 * fastest).all() and fine.natural_Hz[2] > 10.0
