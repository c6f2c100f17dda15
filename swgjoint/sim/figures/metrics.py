"""Figures of a run, with the keys and units of the JSON output.

Joint figures refer to the samples of :attr:`.Trajectory.steady`: the constant-speed
part of the motion, or another main part if no joint speed is constant, as in a chirp or
along a path of the tool.

Torque ripple of the moving arm is the output torque of the drive, minus the torque that
the rigid arm needs at the same instant of the commanded motion (its weight torque
changes with the pose), minus a straight line in time. The line removes the mean and the
slow effect of sag. It also reduces oscillations of one or two cycles per record, but
has almost no effect on faster ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.joint.step_error import LinearMotorLoop, step_error
from swgjoint.sim.figures.energy import joint_energy, run_energy
from swgjoint.sim.figures.line_source import (
    drive_order,
    order_strength,
    sharing_joints,
)
from swgjoint.sim.figures.orders import OrderLine, resample, strongest_lines
from swgjoint.sim.figures.output_bearing import bearing_figures
from swgjoint.sim.figures.rating_use import use_of_ratings
from swgjoint.sim.figures.ripple_validity import (
    HARMONIC_LEVELS,
    map_label,
    ripple_label,
)
from swgjoint.sim.figures.signals import error_figures, ripple_figures
from swgjoint.sim.figures.tool_metrics import joint_settling, tool_metrics
from swgjoint.sim.figures.verdict import PHASE_STEP, judge_run
from swgjoint.sim.gauges import gauge_figures
from swgjoint.sim.life.figures import cycle_figures, life_figures
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg, mm

if TYPE_CHECKING:
    from swgjoint.sim.figures.transmission import Transmission
    from swgjoint.sim.run import Run


NOISE = 1e-6
"""Amplitude, relative to rated torque or to 1 arcmin, below which lines are round-off.
"""
RIPPLE_OF = "arm in motion, rigid-arm torque and straight line removed"
"""Definition of the torque ripple in reports."""
NOT_STEADY = "no speed is constant, so it includes the dynamics of the motion"
"""Remark on the torque ripple of a motion without a constant speed."""


def run_metrics(run: Run) -> dict[str, Any]:
    """Figures of all joints and of the tool under the keys of the JSON output."""
    steady = _any_steady(run)
    joints = {name: joint_metrics(run, j) for j, name in enumerate(run.joints)}
    energy = run_energy(run)
    return {
        **judge_run(run, joints, energy),
        **({"cycle": cycle_figures(run)} if run.cycle else {}),
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
    """Figures of one joint under the keys of the JSON output.

    Torsion and transmission error of a joint at level ``rigid`` are zero.

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
        **ripple_figures(ripple, rated),
        **label,
        **map_label(run, j, told=label["ripple_missing"] is None),
        "orders": [
            {
                "order": line.order,
                "amplitude_Nm": line.amplitude,
                "amplitude_percent": 100.0 * line.amplitude / rated,
                "drive_order": drive_order(run, j, line.order),
                "shared_with": sharing_joints(run, j, line.order),
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
        **error_figures(run, j),
        "off_command_deg": _off_command(run, j),
        "input_turns": float(abs(angle[-1] - angle[0]) / (2.0 * np.pi)),
        "ratings": use_of_ratings(run, j),
        "motor": use_of_motor(run, j),
        "energy": joint_energy(run, j),
        "settling": joint_settling(run, j),
        **({"life": life_figures(run, j)} if run.cycle else {}),
        **(
            {"output_bearing": bearing_figures(run, j)}
            if run.joints[j] in run.assembly.bearings
            else {}
        ),
        **_gauges(run, j, rated),
        **(
            {"thermal": run.heat[run.joints[j]].figures()}
            if run.joints[j] in run.heat
            else {}
        ),
        **({} if untold is None else {"missing": {"orders": untold}}),
    }


def _gauges(run: Run, j: int, rated: float) -> dict[str, Any]:
    """Figures of the strain gauges of one joint; empty without any."""
    reading = run.gauge_torque(j)
    if reading is None:
        return {}
    torque = run.output_torque[run.steady, j]
    return {
        "gauges": gauge_figures(
            run.assembly.gauges[run.joints[j]],
            torque=torque,
            reading=reading[run.steady],
            rated=rated,
        )
    }


def _off_command(run: Run, j: int) -> float | None:
    """Largest deviation of a link from its command at constant speed [deg].

    The result is None for motions without a constant speed.
    """
    if not _any_steady(run):
        return None
    off = run.position[run.steady, j] - run.reference[run.steady, j]
    return float(np.abs(off).max() / deg)


def orders_untold(angle: Array, highest: float | None) -> str | None:
    """Reason why a record has no orders per input turn; None if it has.

    Args:
        angle: Input angle over the record [rad]. Shape (n,).
        highest: Highest order that the step resolves; None for a joint at rest.
    """
    if highest is None:
        return "the joint has no constant speed"
    if resample(angle, angle) is None:
        return "the input turns less than half a turn, or back and forth"
    return None


def _any_steady(run: Run) -> bool:
    """Whether a joint turns at constant speed, or no joint is commanded to move."""
    path = run.assembly.trajectory
    return bool(path.steady_velocity.any()) or not (
        path.velocity.any() or path.answer_speed is not None
    )


def use_of_motor(run: Run, j: int) -> dict[str, Any]:
    """Torque and current of one motor over the run, and the time it spends at a limit.

    Args:
        run: The run.
        j: Index of the joint.
    """
    torque = run.motor_torque[:, j]
    limits = run.assembly.loops.limits[j]
    use: dict[str, Any] = {
        "peak_Nm": float(np.abs(torque).max()),
        "rms_Nm": float(np.sqrt(np.mean(torque**2))),
    }
    if limits is None:
        return use
    lacking = np.abs(run.wanted_torque[:, j] - torque)
    step = run.assembly.scene.simulation.step_s
    limit = 1e-9 * max(use["peak_Nm"], 1e-300)
    use["at_limit_s"] = float(np.count_nonzero(lacking[1:] > limit) * step)
    constant = limits.torque_constant_Nm_A
    if constant is not None:
        use["current_peak_A"] = use["peak_Nm"] / constant
        use["current_rms_A"] = use["rms_Nm"] / constant
    return use


def torque_deviation(run: Run, j: int, part: slice = slice(None)) -> Array:
    """Output torque minus the torque that the rigid arm needs [N·m]. Shape (n,).

    Args:
        run: The run.
        j: Index of the joint.
        part: Samples to return, n of them; all by default.
    """
    return np.asarray(run.output_torque[part, j] - run.assembly.link_torque[part, j])


def torque_ripple(run: Run, j: int) -> Array:
    """Torque ripple of one joint in the constant-speed part [N·m]. Shape (n_window,).

    It is the torque deviation minus its mean and its linear trend in time.

    Args:
        run: The run.
        j: Index of the joint.
    """
    rest = torque_deviation(run, j, run.steady)
    rest = rest - rest.mean()
    line = np.linspace(-1.0, 1.0, rest.size)  # its mean is zero
    return np.asarray(rest - (line @ rest) / (line @ line) * line)


def highest_resolved_order(run: Run, j: int) -> float | None:
    """Highest order per input turn that the step resolves at the constant speed.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        Order per input turn; None for a joint without a constant speed.
    """
    speed = np.abs(run.assembly.ratio[j] * run.assembly.trajectory.steady_velocity[j])
    if speed == 0.0:
        return None
    return float(PHASE_STEP / (run.assembly.scene.simulation.step_s * speed))


def phase_step(run: Run, j: int) -> float:
    """Largest phase advance of the highest kept order in one engine step [rad].

    It refers to the part of the motion that the figures use. The commanded speed
    determines which harmonics are kept, but the rotor may turn faster. The result is
    zero at levels without harmonics.

    Args:
        run: The run.
        j: Index of the joint.
    """
    attached = run.assembly.transmissions[j].attached
    if attached.level not in HARMONIC_LEVELS:
        return 0.0
    order = max(attached.kept_orders, default=0.0)
    speed = float(np.abs(run.motor_velocity[run.steady, j]).max())
    return run.assembly.step * order * speed


def line_error(run: Run, j: int, order: float) -> float | None:
    """Relative amplitude error of a torque line that the time step causes.

    The estimate assumes that the joint moves alone, see
    :mod:`swgjoint.joint.step_error`.

    Args:
        run: The run.
        j: Index of the joint.
        order: Order of the line per input turn.

    Returns:
        Relative error [-]; None for lines that are not of the drive, and for
        integrators other than ``discrete``.
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
    """Whether the step leaves out the strongest harmonic, see :func:`order_strength`.

    Args:
        transmission: Drive of a joint.
    """
    attached = transmission.attached
    if not attached.unresolved:
        return False
    strength = order_strength(attached)
    lost = max(
        left.error + left.torque / attached.stiffness for left in attached.unresolved
    )
    return bool(lost > strength[1:].max(initial=0.0))


def against_rigid(run: Run, rigid: Run) -> dict[str, float]:
    """Distance between the tools of a run and of the rigid arm on the same motion [mm].

    Args:
        run: The run.
        rigid: Run of the same motion with rigid joints.

    Returns:
        Mean, root mean square and largest value over the whole run, and the
        peak-to-peak value ``pp_mm`` over the part that the joint figures use.
    """
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
    """Strongest lines of a signal; none for a joint without a constant speed."""
    if highest is None:
        return ()
    return strongest_lines(angle, signal, highest=highest, floor=floor)
