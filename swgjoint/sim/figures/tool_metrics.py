r"""Figures of the tool: pose and path accuracy after ISO 9283 (1998), settling.

With attained positions :math:`x_j` of n approaches of one pose, their barycentre
:math:`\bar x` and :math:`l_j = |x_j - \bar x|`,

.. math:: AP = |\bar x - x_c|, \qquad
    RP = \bar l + 3 \sqrt{\textstyle\sum_j (l_j - \bar l)^2 / (n - 1)}

and along a path the same in planes square to the command, the largest value along it:
AT and RT. Positions only, no orientations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.typing import Array
from swgjoint.units import arcmin, mm

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


PATH_POINTS = 50
"""Planes along a path in which the passes are compared."""
ON_PLANE = 1e-9
"""Distance from its plane within which a crossing is found [m]."""
REST = 16
"""Least number of samples at rest from which settling is determined."""


def pose_accuracy(attained: Array, commanded: Array) -> float:
    """AP: from the commanded to the mean attained position, in their unit.

    Args:
        attained: One row per approach. Shape (n, 3).
        commanded: Shape (3,).
    """
    return float(np.linalg.norm(attained.mean(axis=0) - commanded))


def pose_repeatability(attained: Array) -> float:
    """RP: mean distance from the barycentre and three standard deviations of it.

    Args:
        attained: One row per approach, two or more. Shape (n, 3).
    """
    distance = np.linalg.norm(attained - attained.mean(axis=0), axis=-1)
    return float(distance.mean() + 3.0 * distance.std(ddof=1))


def path_accuracy(attained: Array, commanded: Array) -> float:
    """AT: largest distance of the mean attained path from the commanded one.

    Args:
        attained: Where passes cross the planes. Shape (n_passes, n_planes, 3).
        commanded: Shape (n_planes, 3).
    """
    off = np.linalg.norm(attained.mean(axis=0) - commanded, axis=-1)
    return float(off.max())


def path_repeatability(attained: Array) -> float:
    """RT: largest RP of the crossings of one plane; two passes or more."""
    return max(pose_repeatability(crossings) for crossings in attained.swapaxes(0, 1))


def crossings(run: Run) -> tuple[Array, Array] | None:
    """Where the tool crosses planes square to the commanded path, in every pass [m].

    The crossing is looked for from the commanded instant on, so a lag along the path is
    no error of the path.

    Returns:
        Attained, shape (n_passes, n_planes, 3), and commanded, shape (n_planes, 3);
        None where the tool misses a plane.
    """
    from scipy.interpolate import CubicSpline

    path = run.assembly.trajectory
    tool = CubicSpline(run.time, run.tool_position)
    command = CubicSpline(run.time, run.tool_reference)
    # a lag must not look beyond the pass: keep off its ends
    offsets = np.linspace(0.02, 0.98, PATH_POINTS) * path.pass_time
    attained = []
    for begin in path.passes:
        asked, speed = command(begin + offsets), command(begin + offsets, 1)
        along = speed / np.linalg.norm(speed, axis=1)[:, None]
        instant = begin + offsets
        for _ in range(20):
            ahead = ((tool(instant) - asked) * along).sum(axis=1)
            rate = (tool(instant, 1) * along).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):  # a tool at rest
                instant = instant - ahead / rate
            instant = np.clip(instant, run.time[0], run.time[-1])
        found = tool(instant)
        ahead = ((found - asked) * along).sum(axis=1)
        if not (np.abs(ahead) <= ON_PLANE).all():
            return None
        attained.append(found)
    return np.array(attained), np.asarray(command(path.passes[0] + offsets))


def settling_time(time: Array, distance: Array, arrival: float, band: float) -> Any:
    """From the command's arrival to the last leaving of a band; None: not told.

    Args:
        time: [s]. Shape (n,).
        distance: From the end pose, any unit. Shape (n,).
        arrival: When the command reaches its end [s].
        band: Half width, unit of the distance.
    """
    rest = time >= arrival - 1e-9
    if np.count_nonzero(rest) < REST:
        return None
    outside = np.flatnonzero(rest & (distance > band))
    if not outside.size:
        return 0.0
    # the end pose is its own: only what stays inside for a tenth of the rest settles
    if time[-1] - time[outside[-1]] < 0.1 * (time[-1] - arrival):
        return None
    return float(time[outside[-1] + 1] - arrival)


def joint_settling(run: Run, j: int) -> dict[str, Any]:
    """Settling of one link about its last angle, after the end of the command."""
    band = run.assembly.scene.metrics.settle_band_arcmin
    off = np.abs(run.position[:, j] - run.position[-1, j]) / arcmin
    return {"settling_band_arcmin": band, **_settling(run, off, band)}


def _settling(run: Run, off: Array, band: float) -> dict[str, Any]:
    arrival = run.assembly.trajectory.arrival
    if arrival is None:
        return {"settling_s": None, "missing": {"settling_s": "no rest at the end"}}
    found = settling_time(run.time, off, arrival, band)
    if found is not None:
        return {"settling_s": found}
    return {
        "settling_s": None,
        "missing": {"settling_s": "rest too short, or still outside the band"},
    }


def tool_metrics(run: Run) -> dict[str, Any]:
    """Errors of the tool against its command; None with the reason in ``missing``."""
    keys = ("ap_mm", "rp_mm", "at_mm", "rt_mm", "path_rms_mm")
    if run.tool_position.shape[1] == 0:
        return {
            **dict.fromkeys(keys),
            "missing": {"tool": "the arm has no such site"},
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
    found: dict[str, Any] = dict.fromkeys(keys)
    for part in parts:
        found |= part
    return {**found, "missing": missing}


def _poses(run: Run) -> dict[str, Any]:
    """AP and RP, of the cycle's poses or of the last one."""
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
        "against": "commanded poses; ap_mm and rp_mm of the worst of them",
        "missing": {} if repeated else {"rp_mm": "one cycle; needed: two or more"},
    }


def _path(run: Run) -> dict[str, Any]:
    """Distance from the commanded tool at the same instant."""
    if run.assembly.trajectory.answer_speed is not None:
        return {"missing": {"path_rms_mm": "a step commands no path"}}
    error = run.tool_error() / mm
    return {
        "path_rms_mm": float(np.sqrt(np.mean(error**2))),
        "path_max_mm": float(error.max()),
    }


def _passes(run: Run) -> dict[str, Any]:
    """AT and RT, where one path is run at constant speed."""
    count = len(run.assembly.trajectory.passes)
    if not count:
        reason = "no pass along a path of the tool at constant speed"
        return {"missing": {"at_mm": reason, "rt_mm": reason}}
    crossed = crossings(run)
    if crossed is None:
        reason = "the tool does not cross the planes of the path"
        return {"passes": count, "missing": {"at_mm": reason, "rt_mm": reason}}
    attained, commanded = crossed
    found: dict[str, Any] = {
        "passes": count,
        "at_mm": path_accuracy(attained, commanded) / mm,
    }
    if count < 2:
        return {**found, "missing": {"rt_mm": "one pass; needed: two or more"}}
    return {**found, "rt_mm": path_repeatability(attained) / mm}
