"""Disturbance observer: its first order, and what it takes off a joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import MotorPID
from swgjoint.control.observer import DisturbanceObserver
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Measured, ReadingAge

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)


class Still:
    """Gives no torque."""

    def start(self, task):
        """Keep the task."""
        self.task = task

    def torque(self, k, measured):
        """Nothing."""
        return np.zeros_like(measured.motor_angle)


def told(turn):
    """Task of the bench at rest."""
    spy = Still()
    turn(LINEAR, LINEAR, spy, speed=0.0, duration=0.5)
    return spy.task


@pytest.mark.parametrize("late", [0, 1, 2])
@pytest.mark.parametrize("sensed", [False, True])
def test_the_estimate_is_a_low_pass_of_the_disturbance(turn, sensed, late):
    """A free rotor under a constant torque: d (1 - exp(-L t)), two motions at once.

    Of readings that are some periods old that of then, as long as nothing is taken
    off.
    """
    task, d = told(turn), np.array([[0.1], [-0.3]])
    age = ReadingAge(motor=1e-3 * late)
    position = np.repeat(task.position[:, None], 2, axis=1)
    task = replace(task, position=position, reading_age=age)
    observer = DisturbanceObserver(Still(), bandwidth=5.0)
    observer.start(task)
    load = task.link_torque[0] / task.joints.ratio
    speed = np.zeros((2, 1))
    speeds = [speed] * (late + 1)
    for k in range(200):
        read = Measured(
            motor_angle=0.0 * speed,
            motor_speed=speeds[k],
            output_torque=task.link_torque[0] if sensed else None,
        )
        torque = observer.torque(k, read)
        expected = d * (1.0 - np.exp(-2.0 * np.pi * 5.0 * 1e-3 * max(k - late, 0)))
        assert (np.abs(observer.estimate - expected) <= 0.01 * np.abs(d)).all()
        speed = speed + 1e-3 * (torque + d - load) / task.joints.rotor_inertia
        speeds.append(speed)


def test_an_unknown_load_no_longer_moves_the_motor(turn):
    """A push of 10 N·m leaves pd off by torque over gain; with the observer nothing."""
    push = {"kind": "joint_pulse", "joint": "joint", "torque_Nm": -10.0,
            "start_s": 0.2, "duration_s": 5.0}  # fmt: skip
    off = []
    for observes in (False, True):
        controller = MotorPID(flexible_plan)
        if observes:
            controller = DisturbanceObserver(controller, bandwidth=3.0)
        run = turn(LINEAR, LINEAR, controller, speed=0.0, duration=2.0,
                   disturbance=[push])  # fmt: skip
        moved = (run.motor_position - run.motor_position[0])[-1, 0]
        off.append(abs(moved))
    inertia = 1e-4 + 1.0 / 3600.0
    expected = 10.0 / 60.0 / (inertia * (2.0 * np.pi * 8.0) ** 2)
    assert off[0] == pytest.approx(expected, rel=1e-3)
    assert off[1] < 1e-3 * off[0]


def test_a_bandwidth_beyond_the_period_is_refused(turn):
    """One line with the largest."""
    observer = DisturbanceObserver(Still(), bandwidth=100.0)
    with pytest.raises(
        InputError, match=naming("bandwidth", "100 Hz", "0.001 s", "> 0", "<= 39.8 Hz")
    ):
        observer.start(told(turn))
