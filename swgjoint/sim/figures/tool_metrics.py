r"""Figures of the tool: pose and path accuracy by ISO 9283 (1998), and settling.

A pose with the commanded position :math:`x_c` is approached n times. With the attained
positions :math:`x_j`, their barycentre :math:`\bar x` and the distances
:math:`l_j = |x_j - \bar x|`, pose accuracy AP and pose repeatability RP are

.. math:: AP = |\bar x - x_c|, \qquad
    RP = \bar l + 3 \sqrt{\textstyle\sum_j (l_j - \bar l)^2 / (n - 1)}

Path accuracy AT and path repeatability RT are the largest values of the same quantities
along a path, measured in planes perpendicular to the commanded path. Only positions are
evaluated, not orientations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.typing import Array
from swgjoint.units import arcmin, mm

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


PATH_POINTS = 50
"""Number of planes along a path in which the passes are compared."""
ON_PLANE = 1e-9
"""Largest distance of an accepted crossing from its plane [m]."""
REST = 16
"""Smallest number of samples at rest from which settling is determined."""


def pose_accuracy(attained: Array, commanded: Array) -> float:
    """Pose accuracy AP: distance from the commanded to the mean attained position.

    Args:
        attained: Attained positions, one row per approach. Shape (n, 3).
        commanded: Commanded position. Shape (3,).

    Returns:
        Distance in the unit of the positions.
    """
    return float(np.linalg.norm(attained.mean(axis=0) - commanded))


def pose_repeatability(attained: Array) -> float:
    """Pose repeatability RP: mean distance from the barycentre plus three deviations.

    Args:
        attained: Attained positions of two or more approaches. Shape (n, 3).

    Returns:
        Mean plus three standard deviations of the distance, in the unit of the
        positions.
    """
    distance = np.linalg.norm(attained - attained.mean(axis=0), axis=-1)
    return float(distance.mean() + 3.0 * distance.std(ddof=1))


def path_accuracy(attained: Array, commanded: Array) -> float:
    """Path accuracy AT: largest distance of the mean attained from the commanded path.

    Args:
        attained: Attained crossings of the planes. Shape (n_passes, n_planes, 3).
        commanded: Commanded crossings. Shape (n_planes, 3).

    Returns:
        Distance in the unit of the crossings.
    """
    off = np.linalg.norm(attained.mean(axis=0) - commanded, axis=-1)
    return float(off.max())


def path_repeatability(attained: Array) -> float:
    """Path repeatability RT: largest RP of the crossings of any plane.

    Args:
        attained: Attained crossings of two or more passes. Shape
            (n_passes, n_planes, 3).

    Returns:
        Repeatability in the unit of the crossings.
    """
    return max(pose_repeatability(crossings) for crossings in attained.swapaxes(0, 1))


def crossings(run: Run) -> tuple[Array, Array] | None:
    """Crossings of planes perpendicular to the commanded path, in every pass [m].

    The search for each crossing starts at the commanded instant. A lag along the path
    only delays the crossing, so it does not count as a path error.

    Args:
        run: Run of a motion with passes at constant tool speed.

    Returns:
        Attained crossings, shape (n_passes, n_planes, 3), and commanded crossings,
        shape (n_planes, 3); None if the tool misses a plane.
    """
    from scipy.interpolate import CubicSpline

    path = run.assembly.trajectory
    tool = CubicSpline(run.time, run.tool_position)
    command = CubicSpline(run.time, run.tool_reference)
    # leave out the ends of a pass, where a lag would move the crossing out of the pass
    offsets = np.linspace(0.02, 0.98, PATH_POINTS) * path.pass_time
    attained = []
    for begin in path.passes:
        planes, speed = command(begin + offsets), command(begin + offsets, 1)
        along = speed / np.linalg.norm(speed, axis=1)[:, None]
        instant = begin + offsets
        for _ in range(20):
            ahead = ((tool(instant) - planes) * along).sum(axis=1)
            rate = (tool(instant, 1) * along).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):  # a tool at rest
                instant = instant - ahead / rate
            instant = np.clip(instant, run.time[0], run.time[-1])
        crossed = tool(instant)
        ahead = ((crossed - planes) * along).sum(axis=1)
        if not (np.abs(ahead) <= ON_PLANE).all():
            return None
        attained.append(crossed)
    return np.array(attained), np.asarray(command(path.passes[0] + offsets))


def settling_time(time: Array, distance: Array, arrival: float, band: float) -> Any:
    """Time from the end of the command until the distance stays within a band.

    Args:
        time: Times of the samples [s]. Shape (n,).
        distance: Distance from the final pose, any unit. Shape (n,).
        arrival: Time at which the command reaches its end [s].
        band: Half width of the band, in the unit of the distance.

    Returns:
        Settling time [s]; None if the run ends too soon after the command or the signal
        does not settle.
    """
    rest = time >= arrival - 1e-9
    if np.count_nonzero(rest) < REST:
        return None
    outside = np.flatnonzero(rest & (distance > band))
    if not outside.size:
        return 0.0
    # the last sample, the final pose, is always inside the band; therefore the signal
    # must remain inside for the last tenth of the rest
    if time[-1] - time[outside[-1]] < 0.1 * (time[-1] - arrival):
        return None
    return float(time[outside[-1] + 1] - arrival)


def joint_settling(run: Run, j: int) -> dict[str, Any]:
    """Settling of one link about its final angle, after the end of the command.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        ``settling_band_arcmin`` and ``settling_s`` [s]; the latter is None, with the
        reason under ``missing``, if the link does not settle.
    """
    band = run.assembly.scene.metrics.settle_band_arcmin
    off = np.abs(run.position[:, j] - run.position[-1, j]) / arcmin
    return {"settling_band_arcmin": band, **_settling(run, off, band)}


def _settling(run: Run, off: Array, band: float) -> dict[str, Any]:
    """``settling_s`` of a signal about its final value, or the reason for None."""
    arrival = run.assembly.trajectory.arrival
    if arrival is None:
        return {"settling_s": None, "missing": {"settling_s": "no rest at the end"}}
    settled = settling_time(run.time, off, arrival, band)
    if settled is not None:
        return {"settling_s": settled}
    return {
        "settling_s": None,
        "missing": {"settling_s": "rest too short, or still outside the band"},
    }


def tool_metrics(run: Run) -> dict[str, Any]:
    """Errors of the tool relative to its command, under the keys of the JSON output.

    A figure that does not exist is None, with the reason under ``missing``.
    """
    keys = ("ap_mm", "rp_mm", "at_mm", "rt_mm", "path_rms_mm")
    if run.tool_position.shape[1] == 0:
        return {
            **dict.fromkeys(keys),
            "missing": {"tool": "the arm has no tool site"},
        }
    band = run.assembly.scene.metrics.settle_band_mm
    off = np.linalg.norm(run.tool_position - run.tool_position[-1], axis=1) / mm
    parts = [
        _poses(run),
        _path(run),
        _passes(run),
        {"settling_band_mm": band, **_settling(run, off, band)},
    ]
    missing: dict[str, str] = {}
    for part in parts:
        missing |= part.pop("missing", {})
    figures: dict[str, Any] = dict.fromkeys(keys)
    for part in parts:
        figures |= part
    return {"site": run.assembly.scene.tool_site, **figures, "missing": missing}


def _poses(run: Run) -> dict[str, Any]:
    """AP and RP of the poses of a cycle, or AP of the final pose of other motions."""
    path = run.assembly.trajectory
    if not path.visits:
        once = {"rp_mm": "repeatability needs repeated approaches of a pose"}
        if path.arrival is None:
            return {"missing": once | {"ap_mm": "the motion reaches no pose"}}
        return {
            "ap_mm": float(run.tool_error()[-1] / mm),
            "against": "commanded path; ap_mm at the last pose, approached once",
            "missing": once,
        }
    poses: list[dict[str, Any]] = []
    for number in sorted({number for number, _ in path.visits}):
        ends = [end for visited, end in path.visits if visited == number]
        samples = np.searchsorted(run.time, np.array(ends) + 1e-9) - 1
        attained = run.tool_position[samples]
        poses.append(
            {
                "pose": number,
                "approaches": len(ends),
                "ap_mm": pose_accuracy(attained, run.tool_reference[samples[0]]) / mm,
                "rp_mm": pose_repeatability(attained) / mm if len(ends) > 1 else None,
            }
        )
    repeated = [pose["rp_mm"] for pose in poses if pose["rp_mm"] is not None]
    return {
        "ap_mm": max(pose["ap_mm"] for pose in poses),
        "rp_mm": max(repeated) if repeated else None,
        "poses": poses,
        "against": "commanded poses; ap_mm and rp_mm are the largest of all poses",
        "missing": {} if repeated else {"rp_mm": "one cycle; needed: two or more"},
    }


def _path(run: Run) -> dict[str, Any]:
    """Distance between tool and command at the same instant."""
    if run.assembly.trajectory.answer_speed is not None:
        return {"missing": {"path_rms_mm": "a step commands no path"}}
    error = run.tool_error() / mm
    return {
        "path_rms_mm": float(np.sqrt(np.mean(error**2))),
        "path_max_mm": float(error.max()),
    }


def _passes(run: Run) -> dict[str, Any]:
    """AT and RT of a path that the tool follows at constant speed."""
    count = len(run.assembly.trajectory.passes)
    if not count:
        reason = "no pass along a path of the tool at constant speed"
        return {"missing": {"at_mm": reason, "rt_mm": reason}}
    crossed = crossings(run)
    if crossed is None:
        reason = "the tool does not cross the planes of the path"
        return {"passes": count, "missing": {"at_mm": reason, "rt_mm": reason}}
    attained, commanded = crossed
    figures: dict[str, Any] = {
        "passes": count,
        "at_mm": path_accuracy(attained, commanded) / mm,
    }
    if count < 2:
        return {**figures, "missing": {"rt_mm": "one pass; needed: two or more"}}
    return {**figures, "rt_mm": path_repeatability(attained) / mm}
