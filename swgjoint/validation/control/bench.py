"""Motions of the bench joint for the comparison of controllers, and their figures.

The motions are a fast move (tracking), one slow output turn in one direction
(positioning), and a turn at constant speed after some turns of learning (ripple). Each
motion runs on one specimen of a drive. The controllers know only a part of the load.
The encoders are noisy, and their readings are one control period old.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.control.kinematic_error import (
    JointRecord,
    KinematicErrorTable,
    TurnRecorder,
)
from swgjoint.control.motor_side import MotorPID, rigid_plan
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Controller
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array
from swgjoint.units import arcmin
from swgjoint.validation.control.specimens import nominal, specimen
from swgjoint.view.run import run_scene

FREQUENCY = 20.0
"""Natural frequency of the motor loop of every controller [Hz]; the damping ratio is 1.
"""
LOAD, RECORD_LOAD = 0.3, 0.6
"""Known load of the motions, and of the record for identification, divided by the rated
torque [-]."""
UNKNOWN = 0.1
"""Largest magnitude of the unknown load, divided by the known load [-]."""
MOTOR_COUNTS, LINK_NOISE, DELAY = 2**17, 2.0, 1e-3
"""Counts per turn of the motor encoder, noise of the link encoder [arcsec], and age of
both readings [s]. The age is one control period, and the controllers know it."""
TWO_PER_TURN = ((2, 0), (0, 2), (1, 1))
"""Orders (p, q) of the ripple at about two periods per input turn."""

UNITS = {
    "tracking_rms": "arcmin",
    "tracking_peak": "arcmin",
    "positioning_pp": "arcmin",
    "ripple_rms": "% of rated torque",
    "two_per_turn": "N·m",
    "effort_rms": "N·m",
}
"""Figures of a controller with their units: rms and largest link error during the move,
peak-to-peak link error on the slow turn, ripple of the output torque at constant speed
and its component at 2 per turn, and rms motor torque during the move."""

MOVE: dict[str, Any] = {
    "trajectory": {
        "kind": "sweep",
        "hold_s": 0.3,
        "ramp_s": 0.25,
        "end_deg": {"joint": 20.0},
    },
    "simulation": {"duration_s": 1.3},
}
SLOW: dict[str, Any] = {
    "trajectory": {
        "kind": "constant_speed",
        "speed_deg_s": {"joint": 8.0},
        "settle_s": 1.0,
    },
    "simulation": {"duration_s": 46.0},
}
EVEN: dict[str, Any] = {
    "trajectory": {
        "kind": "constant_speed",
        "speed_deg_s": {"joint": 30.0},
        "settle_s": 15.0,
    },
    "simulation": {"duration_s": 27.0},
}
MOTIONS = {"move": MOVE, "slow": SLOW, "even": EVEN}


def record_turn(drive: DriveMap, seed: int) -> JointRecord:
    """Record a slow output turn of a specimen, from which its errors are identified.

    Load, noise and random part of the errors differ from those of the motions.

    Args:
        drive: Nominal drive.
        seed: Seed of the specimen.
    """
    recorder = TurnRecorder(MotorPID(rigid_plan, frequency=FREQUENCY))
    plant = specimen(drive, seed, random_seed=1)
    run_motion(drive, plant, recorder, "slow", seed + 1000, load=RECORD_LOAD)
    return recorder.record(skip=500)


def run_motion(
    drive: DriveMap,
    plant: DriveMap,
    controller: Controller,
    motion: str,
    seed: int,
    load: float = LOAD,
    delay: float = DELAY,
) -> Run:
    """Run one motion of a specimen with unknown load, and with delay and noise.

    Args:
        drive: Nominal drive, which the controller knows.
        plant: Specimen to move.
        controller: Controller of the joint.
        motion: Key of :data:`MOTIONS`.
        seed: Seed of unknown load and sensor noise.
        load: Known load divided by the rated torque [-].
        delay: Age of the encoder readings [s].
    """
    torque = load * drive.ratings.rated_torque
    more = UNKNOWN * torque * np.random.default_rng([seed, 2]).uniform(-1.0, 1.0)
    scene = Scene.from_data(
        {
            "name": f"control, {motion}",
            "arm": "bench",
            "defaults": {
                "drive": "specimen",
                "level": "full",
                "rotor_inertia_kgm2": 1e-4,
                "friction": drive.friction is not None,
            },
            "load": {"joint": {"torque_Nm": torque}},
            "disturbance": [
                {
                    "kind": "joint_pulse",
                    "joint": "joint",
                    "torque_Nm": -more,
                    "start_s": 0.0,
                    "duration_s": 1000.0,
                }
            ],
            "controller": {"feedback": "link"},
            "sensors": {
                "motor": {"counts_per_turn": MOTOR_COUNTS, "delay_s": delay},
                "link": {"noise_arcsec": LINK_NOISE, "delay_s": delay},
                "seed": seed,
            },
            **MOTIONS[motion],
        }
    )
    return run_scene(
        scene,
        drives={"specimen": plant},
        known_drives={"joint": nominal(drive)},
        controller=controller,
    )


def figures_of(runs: dict[str, Run]) -> dict[str, float]:
    """Figures of the given motions in the units of :data:`UNITS`.

    Args:
        runs: Runs by motion, a key of :data:`MOTIONS`.
    """
    figures = {}
    if move := runs.get("move"):
        moving = move.time >= MOVE["trajectory"]["hold_s"]
        off = (move.position - move.reference)[moving, 0] / arcmin
        figures["tracking_rms"] = float(np.sqrt(np.mean(off**2)))
        figures["tracking_peak"] = float(np.abs(off).max())
        figures["effort_rms"] = float(np.sqrt(np.mean(move.motor_torque[moving] ** 2)))
    if slow := runs.get("slow"):
        turned = (slow.position - slow.reference)[slow.steady, 0] / arcmin
        figures["positioning_pp"] = float(np.ptp(turned))
    if even := runs.get("even"):
        ripple = even.metrics()["joints"]["joint"]["ripple_rms_percent"]
        figures["ripple_rms"] = float(ripple)
        figures["two_per_turn"] = two_per_turn(even)
    return {key: figures[key] for key in UNITS if key in figures}


def two_per_turn(run: Run) -> float:
    """Torque ripple at 2 per turn: root sum of squares of its amplitudes [N·m]."""
    theta, psi, torque = (
        x[run.steady, 0] for x in (run.motor_position, run.position, run.output_torque)
    )
    law = run.assembly.transmissions[0].law
    assert law is not None
    angles = KinematicErrorTable(
        orders=np.array(TWO_PER_TURN), amplitudes=np.zeros((len(TWO_PER_TURN), 2))
    )
    phases = angles.apply_to(law.with_harmonics(np.zeros(len(law.orders), bool)))
    waves = phases.phases(theta, psi)[:, 1:]
    line = np.linspace(-1.0, 1.0, theta.size)[:, None]
    basis = np.hstack([np.ones_like(line), line, np.cos(waves), np.sin(waves)])
    weights = np.linalg.lstsq(basis, torque, rcond=None)[0][2:]
    return float(np.sqrt(weights @ weights))


def signals_of(runs: dict[str, Run]) -> dict[str, Array]:
    """Signals to plot, from the runs by motion."""
    move, slow, even = (runs[motion] for motion in MOTIONS)
    turn = slice(slow.steady.start, slow.steady.stop, 10)
    last = slice(even.time.size - 1000, even.time.size)
    torque = even.output_torque[last, 0]
    return {
        "time": move.time,
        "tracking": (move.position - move.reference)[:, 0] / arcmin,
        "output": np.degrees(slow.reference[turn, 0]),
        "positioning": (slow.position - slow.reference)[turn, 0] / arcmin,
        "even_time": even.time[last],
        "ripple": torque - torque.mean(),
    }
