"""Feed-forward through the elastic drive: closed form, exact following, its order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.control.flexible import flexible_plan, motor_angle
from swgjoint.control.motor_side import MotorPID, rigid_plan
from swgjoint.errors import ComputationError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import KnownJoints, Task
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene

K, C, JM, JL, LOAD = 2e4, 8.0, 1e-4, 1.0, 20.0
LINEAR = DriveMap.linear(K, teeth_flexspline=120, teeth_circular_spline=122)


def sine_task(amplitude: float, omega: float, drive: DriveMap = LINEAR) -> Task:
    """A link that swings under a constant load, two motions side by side."""
    t = 1e-3 * np.arange(1001)[:, None, None]
    size = np.array([[amplitude], [0.5 * amplitude]])
    position = size * np.sin(omega * t)
    acceleration = -(omega**2) * position
    one = np.ones(1)
    return Task(
        period=1e-3,
        position=position,
        velocity=omega * size * np.cos(omega * t),
        acceleration=acceleration,
        link_torque=LOAD + JL * acceleration,
        joints=KnownJoints(
            names=("joint",),
            drives=(drive,),
            rotor_inertia=JM * one,
            link_inertia=JL * one,
            damping=C * one,
            torque_limit=np.inf * one,
        ),
    )


def test_constant_stiffness_gives_the_closed_form():
    """Spong's inversion of two masses on a spring and a damper, derivatives written."""
    omega, i = 12.0, LINEAR.ratio
    task = sine_task(0.1, omega)
    plan = flexible_plan(task)
    # T = K x + C x', T - load is a sine: its phasor over (K + j C w), per rad of psi
    t = 1e-3 * np.arange(1001)[:, None, None]
    phasor = -JL * omega**2 / (K + 1j * C * omega)
    turn = np.array([[0.1], [0.05]]) * np.exp(1j * omega * t)
    torsion = LOAD / K + (phasor * turn).imag
    bend = i * ((1.0 + phasor) * -(omega**2) * turn).imag
    np.testing.assert_allclose(
        plan.angle, i * (task.position + torsion), rtol=0, atol=1e-9
    )
    expected = JM * bend + task.link_torque / i
    np.testing.assert_allclose(plan.torque, expected, rtol=0, atol=1e-8)
    # the speed is what an encoder reads at the instant: half a period old
    middle = i * ((1.0 + phasor) * 1j * omega * turn * np.exp(-0.5e-3j * omega)).imag
    np.testing.assert_allclose(plan.speed[1:], middle[1:], rtol=1e-5, atol=1e-4)


def test_the_motor_stands_where_the_map_exerts_the_torque(synthetic_map):
    """Output torque of the found angles is the wanted one, all over map and angles."""
    rng = np.random.default_rng(1)
    psi = rng.uniform(-3.0, 3.0, 3000)
    torque = rng.uniform(-150.0, 150.0, 3000)  # the map is sampled to 300 N·m
    theta = motor_angle(synthetic_map, psi, torque)
    np.testing.assert_allclose(synthetic_map.forces(theta, psi)[1], torque, atol=1e-7)


def test_a_torque_that_the_map_cannot_give_is_refused():
    """One line that says which."""
    weak = replace(LINEAR, end_stiffness=np.zeros((1, 2, 2)))
    with pytest.raises(
        ComputationError, match=naming("'linear'", "torque", "300.0 N·m")
    ):
        motor_angle(weak, np.zeros(1), np.array([300.0]))


def follow(drive, plan, step, delay=0.0, **keys):
    scene = Scene.from_data(
        {
            "name": "follow",
            "arm": "bench",
            "defaults": {"drive": "map", "level": "full", "rotor_inertia_kgm2": JM},
            "trajectory": {
                "kind": "sweep",
                "hold_s": 0.4,
                "ramp_s": 0.2,
                "end_deg": {"joint": 10.0},
            },
            "load": {"joint": {"torque_Nm": LOAD}},
            "controller": {"feedback": "link"},
            "sensors": {"motor": {"delay_s": delay}},
            "simulation": {"duration_s": 1.4, "step_s": step, **keys},
        }
    )
    run = run_scene(scene, drives={"map": drive}, controller=MotorPID(plan))
    moving = run.time > 0.4  # the scene starts where its own loop would stand
    return np.abs(run.position - run.reference)[moving].max() / arcmin


def test_the_link_follows_and_the_error_falls_with_the_square_of_the_step(
    synthetic_map,
):
    """Nominal map, exact sensors: 4 arcmin of wind-up and lag become below 0.001."""
    smooth = synthetic_map.with_harmonics(synthetic_map.orders[:, 0] < 100)
    for drive in (LINEAR, smooth):
        rigid = follow(drive, rigid_plan, 1e-3)
        coarse, fine = (follow(drive, flexible_plan, h) for h in (1e-3, 5e-4))
        assert rigid > 3.5
        assert coarse < 1e-3
        assert fine < 0.35 * coarse


@pytest.mark.parametrize("periods", [1, 2])
def test_a_known_delay_is_no_error(synthetic_map, periods):
    """Readings held against the plan of then: the link follows as without delay."""
    smooth = synthetic_map.with_harmonics(synthetic_map.orders[:, 0] < 100)
    for drive in (LINEAR, smooth):
        late = follow(drive, flexible_plan, 1e-3, delay=1e-3 * periods)
        assert late < 1.2 * follow(drive, flexible_plan, 1e-3)


def test_another_integrator_leaves_the_first_order(synthetic_map):
    """RK4 has speeds of the instant: a quarter of an arcmin at 1 ms, falls with it."""
    keys = {"integrator": "RK4"}
    coarse, fine = (follow(LINEAR, flexible_plan, h, **keys) for h in (1e-3, 5e-4))
    assert coarse < 0.3
    assert fine == pytest.approx(0.5 * coarse, rel=0.1)


def test_an_arm_follows_up_to_what_moves_its_rotors():
    """Two links under gravity; a rotor that its own link carries is not planned for."""
    scene = Scene.from_data(
        {
            "name": "arm",
            "arm": "two-link",
            "defaults": {"drive": "map", "level": "full", "rotor_inertia_kgm2": 1e-5},
            "trajectory": {
                "kind": "sweep",
                "hold_s": 0.4,
                "ramp_s": 0.2,
                "start_deg": {"shoulder": 20.0, "elbow": 30.0},
                "end_deg": {"shoulder": 30.0, "elbow": 10.0},
            },
            "controller": {"feedback": "link"},
            "simulation": {"duration_s": 1.4},
        }
    )
    worst = []
    for plan in (rigid_plan, flexible_plan):
        pid = MotorPID(plan)
        run = run_scene(scene, drives={"map": LINEAR}, controller=pid)
        off = (run.position - run.reference)[run.time > 0.4]
        worst.append(np.abs(off).max(axis=0) / arcmin)
    # the shoulder carries the rotor of the elbow along, which then is 0.04 arcmin off
    assert worst[1][0] < 0.01 * worst[0][0]
    assert worst[1][1] < 0.08 * worst[0][1]
