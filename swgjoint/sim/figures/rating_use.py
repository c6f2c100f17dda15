"""Use of the drive ratings in a run: peak, cubed mean torque, ratcheting, map range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.typing import Array
from swgjoint.units import rpm

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


SLACK = 1.01
"""Tolerance factor on ratings, which catalogues state with two or three digits. With
it, a run at rated torque is within the ratings."""
AT_REST = 1e-9
"""Largest commanded speed of a joint that counts as resting [rad/s]. It is larger than
the round-off of a motion through equal points."""


def use_of_ratings(run: Run, j: int) -> dict[str, Any]:
    """Torques and speed of one joint over the whole run, compared with its ratings.

    The cubed mean torque is weighted with the speed; for a joint at rest it is weighted
    with time.

    Args:
        run: The run.
        j: Index of the joint.
    """
    transmission = run.assembly.transmissions[j]
    ratings = transmission.drive.ratings
    torque = np.abs(run.output_torque[:, j])
    speed = np.abs(run.velocity[:, j])
    moving = run.assembly.trajectory.top_speed[j] > AT_REST and speed.any()
    cubed = cubed_mean(torque, speed if moving else np.ones_like(speed))
    peak = float(torque.max())
    skips = ratings.ratcheting_torque
    return {
        "rated_Nm": ratings.rated_torque,
        "repeated_peak_Nm": ratings.repeated_peak,
        "momentary_peak_Nm": ratings.momentary_peak,
        "ratcheting_Nm": skips,
        "source": ratings.source,
        "peak_Nm": peak,
        "arm_losses_Nm": arm_loss_torque(run, j),
        "cubed_mean_Nm": cubed,
        "input_speed_rpm": float(np.abs(run.motor_velocity[:, j]).max() / rpm),
        "within": bool(
            cubed <= SLACK * ratings.rated_torque
            and peak <= SLACK * ratings.repeated_peak
        ),
        "ratcheting_margin": None if skips is None else skips / max(peak, 1e-300),
        "ratcheting": first_ratcheting(run.time, run.output_torque[:, j], skips),
        **_use_of_map(run, j),
    }


def _use_of_map(run: Run, j: int) -> dict[str, Any]:
    """Torque range of the map of one joint, and whether the run stays within it."""
    transmission = run.assembly.transmissions[j]
    if transmission.level == "rigid":
        why = "level rigid uses no map"
        none = dict.fromkeys(("map_range_Nm", "within_map"))
        return {**none, "missing": dict.fromkeys(none, why)}
    low, high = transmission.drive.torque_range
    torque = run.output_torque[:, j]
    return {
        "map_range_Nm": [low, high],
        "within_map": bool(low <= torque.min() and torque.max() <= high),
    }


def arm_loss_torque(run: Run, j: int) -> float:
    r"""Largest torque of damping and dry friction that the arm's file gives a joint.

    .. math:: f + |v| (c_1 + c_2 |v| + c_3 v^2)

    The drive carries this torque besides its own losses.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        Torque about the joint [N·m], zero if the file states neither.
    """
    model, speed = run.assembly.arm.model, np.abs(run.velocity[:, j]).max()
    factors = model.dof_damping[j], *model.dof_dampingpoly[j]
    damping = sum(c * speed**k for k, c in enumerate(factors, start=1))
    return float(damping + model.dof_frictionloss[j] * bool(speed))


def first_ratcheting(
    time: Array, torque: Array, limit: float | None
) -> dict[str, Any] | None:
    """First instant at which teeth would skip; None if they would not.

    The simulation itself continues with the elastic law, without a skipped tooth.

    Args:
        time: Times of the samples [s]. Shape (n,).
        torque: Output torque [N·m]. Shape (n,).
        limit: Ratcheting torque [N·m]; None if it is not known.
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
    """Mean load torque by catalogue definition, (sum |T|³ |n| / sum |n|)^(1/3) [N·m].

    Args:
        torque: Output torque at equal time steps [N·m]. Shape (n,).
        speed: Output speed in any unit, not all zero. Shape (n,).
    """
    weight = np.abs(speed)
    return float(np.average(np.abs(torque) ** 3, weights=weight) ** (1.0 / 3.0))
