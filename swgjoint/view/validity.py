"""Quantified validity of the results of a run.

Three things limit the accuracy of a figure: the map (its level, its torque range and
the harmonics that its fit omitted), the orders that the step cannot resolve, and the
integration error of the step. A second run of the same motion, with the same orders and
half the step, estimates the integration error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.errors import SwgError
from swgjoint.maps.sheet.map_validity import map_validation, validation_summary
from swgjoint.maps.sheet.validity_marks import joint_doubt
from swgjoint.sim.figures.metrics import torque_ripple
from swgjoint.sim.figures.signals import error_figures, ripple_figures
from swgjoint.sim.other_step import at_step
from swgjoint.sim.simulation import simulate
from swgjoint.units import arcmin, deg
from swgjoint.view.ratings_text import rule_mark

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.run import Run

STEP_KEYS = {
    "ripple_rms_percent": ("ripple_rms_percent",),
    "ripple_pp_percent": ("ripple_pp_percent",),
    "transmission_error_arcmin": ("transmission_error_arcmin", "pp"),
    "torsion_arcmin": ("torsion_arcmin", "mean"),
}
"""Path of each reported figure in the metrics of a joint."""
OFF_COMMAND, LAG = 0.1, 3.0
"""A warning is given if a link deviates from its command by more than ``OFF_COMMAND``
[deg] and by more than ``LAG`` times the transmission error of its drive [-], taken as
the absolute mean plus the peak to peak."""
MAX_STEPS = 400_000
"""Largest number of steps of the finer run, which take a few seconds to compute."""


def step_error(run: Run) -> dict[str, Any]:
    """Change of the figures of a run when its step is halved.

    The finer run has the same orders as the coarser one, so that the change contains
    only the integration error. The metrics of a run list the orders that its step
    leaves out, with their amplitudes, under ``unresolved``.

    Returns:
        ``step_s``, the step of the finer run [s], and ``joints``, the absolute change
        of each figure of :data:`STEP_KEYS` by joint; ``reason`` instead of ``joints``
        if the finer run would take too many steps, needs an external controller or
        fails.
    """
    step = 0.5 * run.assembly.step
    steps = run.assembly.scene.simulation.duration_s / step
    if steps > MAX_STEPS:
        return {"step_s": step, "reason": f"not run: it would take {steps:.3g} steps"}
    if (controller := run.assembly.controlled_by) is not None:
        why = f"the scene does not contain its controller, {controller}"
        return {"step_s": step, "reason": f"not run: {why}"}
    try:
        finer = _as_far_as_used(at_step(run.assembly, step))
        fine = simulate(finer, name=f"{run.name} at half the step")
    except SwgError as exc:
        return {"step_s": step, "reason": f"not run: {exc}"}
    joints = {}
    for j, joint in enumerate(run.joints):
        here, there = _step_figures(run, j), _step_figures(fine, j)
        joints[joint] = {
            key: abs(_at(here, path) - _at(there, path))
            for key, path in STEP_KEYS.items()
        }
    return {"step_s": step, "joints": joints}


def _as_far_as_used(assembly: Assembly) -> Assembly:
    """The motion up to the end of the part that the figures use, without the tool."""
    path, parts = assembly.trajectory, assembly.sub_steps
    kept = slice(-(-(path.steady.stop - 1) // parts) * parts + 1)  # whole steps
    return replace(
        assembly,
        arm=assembly.arm.without_tool(),
        trajectory=replace(
            path,
            time=path.time[kept],
            position=path.position[kept],
            velocity=path.velocity[kept],
            acceleration=path.acceleration[kept],
        ),
        link_torque=assembly.link_torque[kept],
        feedforward=assembly.feedforward[kept],
        prescribed=assembly.prescribed[kept],
        prescribed_rate=assembly.prescribed_rate[kept],
    )


def _step_figures(run: Run, j: int) -> dict[str, Any]:
    """The metrics of a joint that :data:`STEP_KEYS` names."""
    rated = run.assembly.transmissions[j].drive.ratings.rated_torque
    ripple = torque_ripple(run, j)
    return {**ripple_figures(ripple, rated), **error_figures(run, j)}


def _at(joint: Mapping[str, Any], path: tuple[str, ...]) -> float:
    value: Any = joint
    for key in path:
        value = value[key]
    return float(value)


def map_error(drive: DriveMap) -> list[str]:
    """Result of the validation and known errors of a map, one line each.

    Records of the map that are missing or not finite are omitted.
    """
    info = drive.info
    validation, reason = map_validation(drive)
    lines = [reason or ""] if validation is None else [validation_summary(validation)]
    if validation is not None and validation.reason:
        lines.append(f"sampling ended before its goal: {validation.reason}")
    perfect = info.get("perfect_teeth")
    source = perfect if isinstance(perfect, Mapping) else info
    values = _numbers(source.get("energy_check"), "relative")
    if values is not None:
        lines.append(
            "the input torque of the map differs from that of the finite elements,"
            " which the fit did not use, by up to"
            f" {100.0 * values[0]:.2g} % of its peak to peak"
        )
    keys = ("threshold", "torque_Nm", "kinematic_error_rad")
    values = _numbers(source.get("residual"), *keys)
    if values is not None:
        lines.append(
            f"harmonics below {100.0 * values[0]:.2g} % of the strongest one are"
            f" omitted; largest residual {values[1]:.2g} N·m in torque,"
            f" {values[2] / arcmin:.2g} arcmin in kinematic error"
        )
    stiffness = info.get("stiffness_range_Nm_rad")
    if isinstance(stiffness, list | tuple) and len(stiffness) == 2:
        values = _numbers(dict(enumerate(stiffness)), 0, 1)
        if values is not None:
            low, high = values
            lines.append(
                f"tangent stiffness {low:.4g} to {high:.4g} N·m/rad within the torque"
                " range of the map"
            )
    return lines


def _numbers(table: Any, *keys: Any) -> list[float] | None:
    """Values of a table in a map, by key; None unless all are finite numbers."""
    values = [table.get(key) for key in keys] if isinstance(table, Mapping) else []
    numbers = [
        float(one)
        for one in values
        if isinstance(one, float | int) and abs(one) < 1e300
    ]
    return numbers if len(numbers) == len(keys) else None


def warnings_of(joints: Mapping[str, Any]) -> list[str]:
    """Warnings about the results of a run, one line each.

    Conditions that invalidate a run are listed in the ``reasons`` of its metrics
    instead, see :mod:`swgjoint.sim.figures.verdict`.

    Args:
        joints: Figures by joint, see :meth:`swgjoint.sim.run.Run.metrics`.
    """
    lines = _doubts(joints)
    for name, joint in joints.items():
        if joint["ripple_is_lower_bound"] and (carries := joint["resolving"]):
            lines.append(
                f"{name}: ripple is a lower bound: the step leaves out orders with"
                f" about {joint['ripple_left_out_percent']:.2g} % of rated torque"
                f" (rms); order {carries['order']:.4g} needs a step of"
                f" {1e3 * carries['step_s']:.2g} ms or a speed of"
                f" {carries['speed_deg_s']:.2g} deg/s"
            )
        off, drive = joint["off_command_deg"], joint["transmission_error_arcmin"]
        share = (abs(drive["mean"]) + drive["pp"]) * arcmin / deg
        if off is not None and off > max(OFF_COMMAND, LAG * share):
            lines.append(
                f"{name}: the link deviates from its command by up to {off:.2g} deg at"
                f" constant speed; the drive accounts for at most {share:.2g} deg of"
                " this, the control loop for the rest (friction, gains, motor limits)"
            )
        ratings, source = joint["ratings"], joint["ratings"]["source"]
        if not ratings["within"]:
            lines.append(
                f"{name}: ratings exceeded: cubic mean torque"
                f" {ratings['cubed_mean_Nm']:.3g} N·m (rated"
                f" {ratings['rated_Nm']:.3g} N·m{rule_mark('rated_torque_Nm', source)}"
                f"), peak torque {ratings['peak_Nm']:.3g} N·m (repeated peak"
                f" {ratings['repeated_peak_Nm']:.3g} N·m"
                f"{rule_mark('repeated_peak_Nm', source)})"
            )
        bearing = joint.get("output_bearing")
        if bearing is not None and bearing["within"] is False:
            lines.append(
                f"{name}: output bearing: moment of up to"
                f" {bearing['peak_moment_Nm']:.3g} N·m (permissible"
                f" {bearing['permissible_moment_Nm']:.3g} N·m)"
            )
    return lines


def shared_orders(joints: Mapping[str, Any]) -> list[str]:
    """Joints that cannot tell their orders from those of others, one line per group.

    Args:
        joints: As in :func:`warnings_of`.
    """
    groups = set()
    for name, joint in joints.items():
        lines = [line for line in joint["orders"] if line["drive_order"]]
        others = {other for line in lines for other in line["shared_with"]}
        if others and joint["ripple_missing"] is None:
            groups.add(", ".join(sorted({name} | others)))
    return [
        f"{names}: these drives have orders at the same frequencies, so the ripple of"
        " each joint includes what the others send through the arm; to see one joint"
        " alone, add --set joints.NAME.kinematic_error_arcmin=0 for each of the others"
        for names in sorted(groups)
    ]


def limits_of(run: Run, joints: Mapping[str, Any]) -> list[str]:
    """Joints that cannot be told apart, and effects that the model leaves out.

    There is one line per effect and reason; it names no joints if all are affected.

    Args:
        run: The run.
        joints: As in :func:`warnings_of`.
    """
    shared = shared_orders(joints)
    affected: dict[tuple[str, str], list[str]] = {}
    for item in run.contains["left_out"]:
        affected.setdefault((item["part"], item["reason"]), []).append(item["joint"])
    return shared + [
        "left out"
        + ("" if len(names) == len(run.joints) else f" in {', '.join(names)}")
        + f": {part}: {reason}"
        for (part, reason), names in affected.items()
    ]


def left_out_share(run: Run, j: int) -> float:
    """Combined torque amplitude at rated torque of the orders that the step leaves out.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        Root of the sum of the squared amplitudes [N·m].
    """
    left = run.assembly.transmissions[j].attached.unresolved
    return float(np.sqrt(sum(item.torque**2 for item in left)))


def _doubts(joints: Mapping[str, Any]) -> list[str]:
    """Joints with an uncertain ripple, one line for each reason."""
    reasons: dict[str, list[str]] = {}
    for name, joint in joints.items():
        doubt = joint_doubt(joint)
        if doubt is not None and joint["ripple_valid"]:
            low, high = joint["map_difference"]["torque_range_Nm"]
            reason = f"the map of {joint['drive']} {doubt}"
            where = f"{name} ({low:.4g} to {high:.4g} N·m)"
            reasons.setdefault(reason, []).append(where)
    return [
        f"{', '.join(where)}: torque ripple is uncertain: {reason}"
        for reason, where in reasons.items()
    ]
