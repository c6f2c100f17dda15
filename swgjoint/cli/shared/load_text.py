"""Which joints of an arm carry the most, and the designs of the size of its drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_SHOWN = 3
"""Largest number of joints that the line on the load names."""


FAINT = 0.01
"""Losses of the arm's file below this fraction of the rated torque are not named."""


def loss_line(joints: Mapping[str, Any]) -> str:
    """Name the joints whose damping and dry friction in the arm's file load the drives.

    Robot files often use them for a servo or for the gear, which the drive replaces.

    Args:
        joints: Figures by joint, see :meth:`swgjoint.sim.run.Run.metrics`.
    """
    use = {name: joint["ratings"] for name, joint in joints.items()}
    shares = {name: one["arm_losses_Nm"] / one["rated_Nm"] for name, one in use.items()}
    named = ", ".join(
        f"{name} up to {use[name]['arm_losses_Nm']:.3g} N·m or {100.0 * share:.2g} %"
        for name, share in sorted(shares.items(), key=lambda item: -item[1])
        if share >= FAINT
    )
    return named and (
        "losses in the file of the arm: damping and frictionloss of its joints load the"
        f" drives, {named} of the rated torque; set them to zero in the file if they"
        " stand for a servo or for the gear, whose losses are those of the drive"
    )


def load_line(joints: Mapping[str, Any]) -> str:
    """Name the most loaded joints, relative to their ratings; empty for one joint.

    Args:
        joints: Figures by joint, see :meth:`swgjoint.sim.run.Run.metrics`.
    """
    if len(joints) < 2:
        return ""
    loads = {
        name: joint["ratings"]["peak_Nm"] / joint["ratings"]["rated_Nm"]
        for name, joint in joints.items()
    }
    first, *others = sorted(loads, key=lambda name: -loads[name])[:_SHOWN]
    shares = {
        name: f"{100.0 * load:.{'0f' if load >= 1.0 else '2g'}} %"
        for name, load in loads.items()
    }
    rest = ", ".join(f"{name} {shares[name]}" for name in others)
    return (
        f"load: {first} carries the most, up to"
        f" {joints[first]['ratings']['peak_Nm']:.3g} N·m or {shares[first]} of its"
        f" rated torque; then {rest}"
    )


def design_line(choice: Mapping[str, Any]) -> str:
    """Name the designs with size and ratio of the selected catalogue drives.

    Args:
        choice: JSON objects of the selected drives by joint.
    """
    names_by_design: dict[str, list[str]] = {}
    for joint, one in choice.items():
        _, size, ratio = one["drive"].split("-")[:3]
        names_by_design.setdefault(f"size-{size}-{ratio}", []).append(joint)
    designs = ", ".join(
        f"{design} ({', '.join(joints)})" for design, joints in names_by_design.items()
    )
    return (
        "designs of these sizes, whose teeth you can change (swgjoint design new NAME"
        f" -o FILE) and run in seconds with --model ring: {designs}"
    )
