"""Learning compensation: rate of convergence, what forgetting leaves, the plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.kinematic_error import KinematicErrorTable
from swgjoint.control.learning import LearningCompensation
from swgjoint.control.motor_side import MotorPID
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Measured, ReadingAge
from swgjoint.units import arcmin

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
TABLE = KinematicErrorTable(
    orders=[(2, 0), (0, 2)], amplitudes=np.array([[0.1, 0.06], [0.0, 0.12]]) * arcmin
)


class Spy:
    """Gives no torque and keeps what it is told."""

    def start(self, task):
        """Keep the task."""
        self.task, self.seen = task, []

    def torque(self, k, measured):
        """Keep the reading."""
        self.seen.append(measured)
        return np.zeros_like(measured.motor_angle)


@pytest.fixture(scope="module")
def even_task(turn):
    """An output turn and nearly one more at constant speed, sixteen samples a wave."""
    spy = Spy()
    turn(LINEAR, LINEAR, spy, speed=30.0, duration=24.0, step=2e-3,
         controller__control_period_s=6e-3)  # fmt: skip
    return spy.task


@pytest.mark.parametrize(
    ("rate", "forgetting", "late"),
    [(0.5, 0.0, 0), (0.8, 0.0, 0), (0.3, 0.1, 0), (0.8, 0.0, 3)],
)
def test_every_block_multiplies_the_distance(even_task, rate, forgetting, late):
    """On a link that answers as the model says: by 1 - rho - mu, to rho/(rho + mu).

    Of readings that are three periods old as well, a fifth of a wave.
    """
    spy = Spy()
    learning = LearningCompensation(
        spy, orders=[(2, 0), (0, 2)], rate=rate, forgetting=forgetting, turns=15.0
    )
    task = replace(even_task, reading_age=ReadingAge(link=6e-3 * late))
    learning.start(task)
    # a quarter of an output turn: 2 alpha and 2 beta are half a wave apart
    d = np.array([2e-5 + 1e-5j, -1e-5 + 3e-5j])
    waves = np.exp(1j * task.position * np.array([-120.0, -122.0]))
    fixed = -rate / (rate + forgetting) * d
    off, blocks = [np.abs(learning.learned - fixed).max()], 0
    last = len(task.position) - 25
    for k in range(last + 1):
        then = max(k - late, 0)
        wave = ((learning.learned + d) * waves[then]).real.sum(axis=-1)
        link = task.position[then] + wave
        learning.torque(
            k, Measured(motor_angle=link, motor_speed=link, link_angle=link)
        )
        if learning.blocks > blocks:
            blocks = learning.blocks
            off.append(np.abs(learning.learned - fixed).max())
    assert blocks == 7
    ratios = np.array(off[1:]) / off[:-1]
    # the ridge and what is common to the two orders leave a few percent
    np.testing.assert_allclose(ratios[:2], 1.0 - rate - forgetting, atol=0.06)
    assert off[-1] < 2.0 * (1.0 - rate - forgetting) ** 7 * off[0] + 0.01 * off[0]
    # the inner controller sees the link without the learned motion
    seen = spy.seen[-1].link_angle - task.position[last - late]
    np.testing.assert_allclose(seen, (d * waves[last - late]).real.sum(), atol=1e-12)


def ripple(run, orders, window):
    """Amplitudes of orders in the output torque at the end of a run [N·m]."""
    w = slice(-window, None)
    theta, psi, torque = (
        x[w, 0] for x in (run.motor_position, run.position, run.output_torque)
    )
    phases = np.array([p * theta + q * (theta - psi) for p, q in orders]).T
    basis = np.hstack([np.ones((window, 1)), np.cos(phases), np.sin(phases)])
    pairs = np.linalg.lstsq(basis, torque, rcond=None)[0][1:].reshape(2, -1)
    return np.hypot(*pairs)


@pytest.mark.parametrize("signal", ["link_angle", "output_torque"])
def test_the_ripple_of_two_per_turn_falls_tenfold(turn, signal):
    """At constant speed, from a noisy link encoder or torque sensor."""
    orders = [(2, 0)]
    plant = KinematicErrorTable(orders=orders, amplitudes=TABLE.amplitudes[:1])
    keys = {"sensors__link__noise_arcsec": 2.0}
    if signal == "output_torque":
        keys["sensors__torque__noise_Nm"] = 0.2
    found = []
    for learns in (False, True):
        controller = MotorPID(flexible_plan, frequency=20.0)
        if learns:
            controller = LearningCompensation(
                controller, orders=orders, signal=signal, rate=0.8, turns=1.0
            )
        run = turn(plant.apply_to(LINEAR), LINEAR, controller, speed=30.0, duration=1.8,
                   **keys)  # fmt: skip
        found.append(ripple(run, orders, 600)[0])
    assert found[0] > 0.1  # N·m
    assert found[1] < 0.1 * found[0]


def test_ramps_are_not_learned_from(turn):
    """A block in which the commanded speed changes is left out."""
    learning = LearningCompensation(Spy(), orders=[(2, 0)], turns=1.0)
    sweep = {"kind": "sweep", "ramp_s": 0.5, "hold_s": 0.1, "end_deg": {"joint": 60.0}}
    with pytest.raises(
        InputError,
        match=naming(
            "output_torque", "controller.feedback", "'link'", "sensors.torque"
        ),
    ):
        turn(LINEAR, LINEAR, LearningCompensation(Spy(), signal="output_torque"),
             speed=30.0, duration=0.1)  # fmt: skip
    turn(LINEAR, LINEAR, learning, speed=0.0, duration=1.3, trajectory=sweep)
    assert len(learning._ends) >= 9
    assert learning.blocks == 0 and not learning.learned.any()


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (
            {"rate": 0.0},
            ("rate 0", "0 < rate <= 1", "0 <= forgetting < 1", "turns >= 1"),
        ),
        (
            {"forgetting": 1.0},
            ("forgetting 1", "0 < rate <= 1", "0 <= forgetting < 1", "turns >= 1"),
        ),
        (
            {"turns": 0.5},
            ("0.5 turns", "0 < rate <= 1", "0 <= forgetting < 1", "turns >= 1"),
        ),
        ({"signal": "sound"}, ("signal", "'sound'", "link_angle", "output_torque")),
    ],
)
def test_rates_that_do_not_learn_are_refused(bad, says):
    """One line with what is accepted."""
    with pytest.raises(InputError, match=naming(*says)):
        LearningCompensation(Spy(), **bad)
