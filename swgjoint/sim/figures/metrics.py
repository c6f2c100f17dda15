"""Figures of a run, defined once; keys and units are those of the JSON output.

Joint figures are taken over the constant-speed part of the motion, at every step; a
motion without such a part (a chirp, a path of the tool) gives them over the motion.

Torque ripple of the arm in motion: output torque of the drive, less the torque that
the rigid arm needs at the same instant of the commanded motion (its weight changes
with the pose), less the straight line that remains. The line holds the mean and the
slow effect of sagging; nothing above half a cycle per record is touched.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.joint.step_error import LinearMotorLoop, step_error
from swgjoint.sim.figures.energy import joint_energy, run_energy
from swgjoint.sim.figures.orders import OrderLine, resample, strongest_lines
from swgjoint.sim.figures.ripple_validity import (
    HARMONIC_LEVELS,
    map_label,
    ripple_label,
)
from swgjoint.sim.figures.tool_metrics import joint_settling, tool_metrics
from swgjoint.sim.figures.verdict import PHASE_STEP, judge_run
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg, mm, rpm

if TYPE_CHECKING:
    from swgjoint.sim.figures.transmission import Transmission
    from swgjoint.sim.run import Run


NOISE = 1e-6
"""Lines below this share of the rated torque, or of one arcmin, are round-off."""
SLACK = 1.01
"""Ratings have two or three digits; a run at rated torque is within them."""
RIPPLE_OF = "arm in motion, rigid-arm torque and straight line removed"
NOT_STEADY = "whole motion, no speed is constant: no ripple alone, but dynamics too"


def run_metrics(run: Run) -> dict[str, Any]:
    """Figures of all joints and of the tool under the keys of the JSON output."""
    steady = _any_steady(run)
    joints = {name: joint_metrics(run, j) for j, name in enumerate(run.joints)}
    energy = run_energy(run)
    return {
        **judge_run(run, joints, energy),
        "joints": joints,
        "tool": tool_metrics(run),
        "window_s": [float(t) for t in run.time[run.steady][[0, -1]]],
        "window_of": "constant speed" if steady else "motion",
        "ripple_of": RIPPLE_OF if steady else f"{RIPPLE_OF}; {NOT_STEADY}",
        "energy": energy,
        "sub_steps": run.assembly.sub_steps,
        "steps_per_s": run.steps_per_second,
    }


def joint_metrics(run: Run, j: int) -> dict[str, Any]:
    """Figures of one joint; torsion and error are zero, never absent, if rigid.

    Args:
        run: The run.
        j: Index of the joint.
    """
    transmission = run.assembly.transmissions[j]
    drive, window = transmission.drive, run.steady
    rated = drive.ratings.rated_torque
    angle = run.motor_position[window, j]
    ripple = torque_ripple(run, j)
    highest = highest_resolved_order(run, j)
    error = run.transmission_error[window, j] / arcmin
    lines = _lines(angle, ripple, highest, floor=NOISE * rated)
    error_lines = _lines(angle, error, highest, floor=NOISE)
    untold = orders_untold(angle, highest)
    label = ripple_label(run, j, ripple)
    return {
        "level": transmission.level,
        "drive": drive.name,
        "source": drive.level,
        "ripple_rms_percent": float(100.0 * np.sqrt(np.mean(ripple**2)) / rated),
        "ripple_pp_percent": float(100.0 * np.ptp(ripple) / rated),
        **label,
        **map_label(run, j, told=label["ripple_missing"] is None),
        "orders": [
            {
                "order": line.order,
                "amplitude_Nm": line.amplitude,
                "amplitude_percent": 100.0 * line.amplitude / rated,
                "drive_order": drive_order(run, j, line.order),
                "step_error": line_error(run, j, line.order),
            }
            for line in lines
        ],
        "transmission_error_orders": [
            {"order": line.order, "amplitude_arcmin": line.amplitude}
            for line in error_lines
        ],
        "unresolved": [
            {
                "order": left.order,
                "error_arcmin": left.error / arcmin,
                "torque_Nm": left.torque,
            }
            for left in transmission.attached.unresolved
        ],
        "highest_resolved_order": highest,
        "phase_step_rad": phase_step(run, j),
        "transmission_error_arcmin": signal_statistics(error),
        "torsion_arcmin": signal_statistics(run.torsion[window, j] / arcmin),
        "off_command_deg": _off_command(run, j),
        "input_turns": float(abs(angle[-1] - angle[0]) / (2.0 * np.pi)),
        "ratings": use_of_ratings(run, j),
        "motor": use_of_motor(run, j),
        "energy": joint_energy(run, j),
        "settling": joint_settling(run, j),
        **({} if untold is None else {"missing": {"orders": untold}}),
    }


def _off_command(run: Run, j: int) -> float | None:
    """Largest distance of a link from its command; None without a constant speed."""
    if not _any_steady(run):
        return None
    off = run.position[run.steady, j] - run.reference[run.steady, j]
    return float(np.abs(off).max() / deg)


def orders_untold(angle: Array, highest: float | None) -> str | None:
    """Why a record has no orders per input turn; None where it has.

    Args:
        angle: Input angle over the record [rad]. Shape (n,).
        highest: Highest order that the step resolves; None at rest.
    """
    if highest is None:
        return "the joint has no constant speed"
    if resample(angle, angle) is None:
        return "the input turns less than half a turn, or to and fro"
    return None


def _any_steady(run: Run) -> bool:
    """Whether a joint turns at constant speed, or none is commanded to move at all."""
    path = run.assembly.trajectory
    return bool(path.steady_velocity.any()) or not (
        path.velocity.any() or path.answer_speed is not None
    )


def use_of_motor(run: Run, j: int) -> dict[str, Any]:
    """Torque and current of one motor over the run, and how long it was at a limit.

    Args:
        run: The run.
        j: Index of the joint.
    """
    torque = run.motor_torque[:, j]
    limits = run.assembly.loops.limits[j]
    found: dict[str, Any] = {
        "peak_Nm": float(np.abs(torque).max()),
        "rms_Nm": float(np.sqrt(np.mean(torque**2))),
    }
    if limits is None:
        return found
    lacking = np.abs(run.wanted_torque[:, j] - torque)
    step = run.assembly.scene.simulation.step_s
    limit = 1e-9 * max(found["peak_Nm"], 1e-300)
    found["at_limit_s"] = float(np.count_nonzero(lacking[1:] > limit) * step)
    constant = limits.torque_constant_Nm_A
    if constant is not None:
        found["current_peak_A"] = found["peak_Nm"] / constant
        found["current_rms_A"] = found["rms_Nm"] / constant
    return found


def torque_deviation(run: Run, j: int, part: slice = slice(None)) -> Array:
    """Output torque less what the rigid arm needs at that instant [N·m]. Shape (n,).

    Args:
        run: The run.
        j: Number of the joint.
        part: Samples, all by default.
    """
    return np.asarray(run.output_torque[part, j] - run.assembly.link_torque[part, j])


def torque_ripple(run: Run, j: int) -> Array:
    """Ripple of one joint over the constant-speed part [N·m]. Shape (n_window,).

    Deviation of the torque less its mean and its straight line in time.

    Args:
        run: The run.
        j: Index of the joint.
    """
    rest = torque_deviation(run, j, run.steady)
    rest = rest - rest.mean()
    line = np.linspace(-1.0, 1.0, rest.size)  # its mean is zero
    return np.asarray(rest - (line @ rest) / (line @ line) * line)


def highest_resolved_order(run: Run, j: int) -> float | None:
    """Highest order per input turn that the step carries; None for a joint at rest.

    Args:
        run: The run.
        j: Index of the joint.
    """
    speed = np.abs(run.assembly.ratio[j] * run.assembly.trajectory.steady_velocity[j])
    if speed == 0.0:
        return None
    return float(PHASE_STEP / (run.assembly.scene.simulation.step_s * speed))


def phase_step(run: Run, j: int) -> float:
    """Largest phase of the highest kept order in one step of the engine [rad].

    Over the part of the motion that the figures are taken from. Harmonics are kept by
    the commanded speed; a rotor may turn faster than that. Levels without harmonics
    have no such phase.
    """
    attached = run.assembly.transmissions[j].attached
    if attached.level not in HARMONIC_LEVELS:
        return 0.0
    order = max(attached.kept_orders, default=0.0)
    speed = float(np.abs(run.motor_velocity[run.steady, j]).max())
    return run.assembly.step * order * speed


def drive_order(run: Run, j: int, order: float) -> float | None:
    """The order of the joint's own drive that a line belongs to, None for others.

    Others are vibrations of the arm, products of two orders, and the orders of other
    joints, which reach this one through the arm.

    Args:
        run: The run.
        j: Index of the joint.
        order: Order per turn of the input.
    """
    attached = run.assembly.transmissions[j].attached
    if attached.level not in HARMONIC_LEVELS or not attached.kept_orders:
        return None
    near = min(attached.kept_orders, key=lambda kept: abs(kept - order))
    turns = np.ptp(run.motor_position[run.steady, j]) / (2.0 * np.pi)
    return near if abs(near - order) <= 0.5 / turns else None


def line_error(run: Run, j: int, order: float) -> float | None:
    """Relative error of a torque line by the step, the joint moving alone.

    See :mod:`swgjoint.joint.step_error`; None for lines that are not of the drive.
    """
    if run.assembly.scene.simulation.integrator != "discrete":
        return None
    known = drive_order(run, j, order)
    if known is None:
        return None
    loops = run.assembly.loops
    time, angle = run.time[run.steady], run.motor_position[run.steady, j]
    return step_error(
        run.assembly.transmissions[j].attached,
        order=known,
        speed=float((angle[-1] - angle[0]) / (time[-1] - time[0])),
        torque=float(run.output_torque[run.steady, j].mean()),
        timestep=run.assembly.step,
        link_inertia=float(run.assembly.link_inertia[j]),
        loop=LinearMotorLoop(
            stiffness=float(loops.stiffness[j]),
            damping=float(loops.damping[j]),
            sampled=loops.sampled,
        ),
    )


def strongest_left_out(transmission: Transmission) -> bool:
    """Whether the strongest harmonic of a drive is among those left out.

    Strength as angle: amplitude in the kinematic error, plus that in the torque at
    rated torque over the stiffness.
    """
    attached = transmission.attached
    if not attached.unresolved:
        return False
    kept, stiffness = attached.drive, attached.stiffness
    torsion = kept.mean_torsion(kept.ratings.rated_torque)
    strength = np.hypot(*kept.kinematic_error.T)
    strength = strength + np.hypot(*kept.coefficients(torsion, 1).T) / stiffness
    lost = max(left.error + left.torque / stiffness for left in attached.unresolved)
    return bool(lost > strength[1:].max(initial=0.0))


AT_REST = 1e-9
"""Commanded speed of a joint that rests [rad/s]: the round-off of a motion through
equal points is below it."""


def signal_statistics(values: Array) -> dict[str, float]:
    """Mean, root mean square and peak to peak of a signal, in its unit."""
    return {
        "mean": float(np.mean(values)),
        "rms": float(np.sqrt(np.mean(values**2))),
        "pp": float(np.ptp(values)),
    }


def use_of_ratings(run: Run, j: int) -> dict[str, Any]:
    """Torques and speed of one joint over the whole run against the ratings.

    At rest the cubed mean is that over time.
    """
    transmission = run.assembly.transmissions[j]
    ratings = transmission.drive.ratings
    torque = np.abs(run.output_torque[:, j])
    speed = np.abs(run.velocity[:, j])
    moving = run.assembly.trajectory.top_speed[j] > AT_REST and speed.any()
    cubed = cubed_mean(torque, speed if moving else np.ones_like(speed))
    peak = float(torque.max())
    low, high = transmission.drive.torque_range
    skips = ratings.ratcheting_torque
    return {
        "rated_Nm": ratings.rated_torque,
        "repeated_peak_Nm": ratings.repeated_peak,
        "momentary_peak_Nm": ratings.momentary_peak,
        "ratcheting_Nm": skips,
        "source": ratings.source,
        "peak_Nm": peak,
        "cubed_mean_Nm": cubed,
        "input_speed_rpm": float(np.abs(run.motor_velocity[:, j]).max() / rpm),
        "within": bool(
            cubed <= SLACK * ratings.rated_torque
            and peak <= SLACK * ratings.repeated_peak
        ),
        "ratcheting_margin": None if skips is None else skips / max(peak, 1e-300),
        "ratcheting": first_ratcheting(run.time, run.output_torque[:, j], skips),
        "map_range_Nm": [low, high],
        "within_map": bool(
            low <= run.output_torque[:, j].min()
            and run.output_torque[:, j].max() <= high
        ),
    }


def first_ratcheting(
    time: Array, torque: Array, limit: float | None
) -> dict[str, Any] | None:
    """The first instant at which teeth would skip; None where they do not.

    The simulation goes on with the elastic law: what follows is no skipped tooth.

    Args:
        time: [s]. Shape (n,).
        torque: At the output [N·m]. Shape (n,).
        limit: Ratcheting torque [N·m], None where it is not known.
    """
    above = np.flatnonzero(np.abs(torque) > (np.inf if limit is None else limit))
    if not above.size:
        return None
    first = int(above[0])
    return {
        "time_s": float(time[first]),
        "torque_Nm": float(torque[first]),
        "after_it": "elastic, without the skipped tooth",
    }


def cubed_mean(torque: Array, speed: Array) -> float:
    """Mean load torque as catalogues define it, (sum |T|³ |n| / sum |n|)^(1/3) [N·m].

    Args:
        torque: Output torque at equal steps of time [N·m]. Shape (n,).
        speed: Output speed, any unit, not zero throughout. Shape (n,).
    """
    weight = np.abs(speed)
    return float(np.average(np.abs(torque) ** 3, weights=weight) ** (1.0 / 3.0))


def against_rigid(run: Run, rigid: Run) -> dict[str, float]:
    """Distance of the tool from that of the rigid arm on the same motion [mm]."""
    error = run.tool_error(rigid) / mm
    steady = error[run.steady]
    return {
        "mean_mm": float(error.mean()),
        "rms_mm": float(np.sqrt(np.mean(error**2))),
        "max_mm": float(error.max()),
        "pp_mm": float(np.ptp(steady)),
    }


def _lines(
    angle: Array, signal: Array, highest: float | None, *, floor: float
) -> tuple[OrderLine, ...]:
    if highest is None:
        return ()
    return strongest_lines(angle, signal, highest=highest, floor=floor)
