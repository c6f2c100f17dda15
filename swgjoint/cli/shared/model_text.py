"""What a run says about its model and about the tool."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from swgjoint.view.words import NOISE_NOTE, above_noise


def rotor_lines(
    joints: Mapping[str, dict[str, Any]], assumed: Collection[str], option: str
) -> list[str]:
    """Format the assumed rotor inertias, grouped by joints that share them.

    Args:
        joints: Values of the joints by name, with ``rotor_inertia_kgm2``.
        assumed: Names of the joints whose rotor inertia is assumed.
        option: Option that states another one.
    """
    names_by_inertia: dict[float, list[str]] = {}
    for name, joint in joints.items():
        if name not in assumed:
            continue
        names_by_inertia.setdefault(joint["rotor_inertia_kgm2"], []).append(name)
    if not names_by_inertia:
        return []
    every = len(names_by_inertia) == 1 and len(assumed) == len(joints)
    values = "; ".join(
        f"{inertia:g} kg·m²" + ("" if every else f" ({', '.join(names)})")
        for inertia, names in names_by_inertia.items()
    )
    return [
        f"rotor inertia: {values}; assumed for the drive of the joint; another:"
        f" {option}"
    ]


def assumed_lines(contains: dict[str, Any]) -> list[str]:
    """Format kinematic errors with assumed parts, grouped by joints that share them."""
    names_by_error: dict[str, list[str]] = {}
    for name, joint in contains["joints"].items():
        error, _, _ = str(joint["kinematic_error"]).partition(", joint ")
        if "assumed:" in error:
            names_by_error.setdefault(error, []).append(name)
    return [
        f"kinematic error {error}"
        + ("" if len(names) == len(contains["joints"]) else f" ({', '.join(names)})")
        for error, names in names_by_error.items()
    ]


def left_out_lines(contains: dict[str, Any]) -> list[str]:
    """Format what the model omits and why, grouped by joints with the same omission."""
    joints_by_part: dict[tuple[str, str], list[str]] = {}
    for item in contains["left_out"]:
        key = (item["part"], item["reason"])
        joints_by_part.setdefault(key, []).append(item["joint"])
    count = len(contains["joints"])
    return [
        f"not simulated: {part}: {reason}"
        + ("" if len(joints) == count else f" ({', '.join(joints)})")
        for (part, reason), joints in joints_by_part.items()
    ]


def sub_step_line(contains: dict[str, Any]) -> str:
    """State the number of sub-steps per step and its reason; empty if it is 1."""
    if contains["sub_steps"] == 1:
        return ""
    why = ", ".join(
        f"{name}: {reason}" for name, reason in contains["sub_stepped_for"].items()
    )
    return (
        f"every step is divided into {contains['sub_steps']} sub-steps, because the"
        f" full step is outside the stability region of the integrator ({why})"
    )


def tool_line(tool: dict[str, Any], *, random: bool) -> str:
    """Format the tool errors that are defined for the motion in one line.

    Args:
        tool: Figures of the tool [mm].
        random: Whether the scene contains random effects that differ from cycle to
            cycle; without them the repeatability is meaningless and is not shown.
    """
    parts = []
    if tool["path_rms_mm"] is not None:
        parts.append(
            f"deviation from the commanded path {_mm(tool['path_rms_mm'])} rms,"
            f" {_mm(tool['path_max_mm'])} maximum"
        )
    if tool["rp_mm"] is not None:
        repeats = (
            _mm(tool["rp_mm"]) if random else "- (the scene has no random effects)"
        )
        parts.append(f"AP {_mm(tool['ap_mm'])}, RP {repeats}")
    elif tool["ap_mm"] is not None:
        parts.append(f"error at the end {_mm(tool['ap_mm'])}")
    for key, name in (("at_mm", "AT"), ("rt_mm", "RT")):
        if tool.get(key) is not None:
            parts.append(f"{name} {_mm(tool[key])}")
    name = "tool" if tool["site"] == "tool" else f"tool {tool['site']}"
    # a tool on the axis of the last joint does not move
    values = (tool.get(f"{key}_mm") for key in ("path_rms", "ap", "at", "rt"))
    faint = any(value is not None and above_noise(value) is None for value in values)
    note = f" ({NOISE_NOTE})" if faint else ""
    return f"{name}: {', '.join(parts)}{note}" if parts else ""


def _mm(value: float) -> str:
    """Text of a tool error [mm]; a dash below the noise."""
    return "-" if above_noise(value) is None else f"{value:.4f} mm"
