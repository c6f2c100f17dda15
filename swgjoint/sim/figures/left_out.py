"""Parts of a drive that a compiled model leaves out, each with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swgjoint.joint.prescribed import ratio_variation
from swgjoint.maps.hysteresis import vary_with_load
from swgjoint.maps.sheet.no_width import why_no_friction
from swgjoint.sim.figures.ripple_validity import HARMONIC_LEVELS
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.sim.figures.transmission import Transmission

LOSSY = ("native", "full")
"""Levels with hysteresis and friction."""
ERRING = ("kinematic", "full")
"""Levels with kinematic error."""
_LEFT_OUT = {
    "rigid": "torsion, kinematic error and torque ripple (level rigid)",
    "kinematic": "torsion and the torque ripple of the stiffness (level kinematic)",
    "linear": "kinematic error, torque ripple and hardening (level linear)",
    "native": "kinematic error and torque ripple (level native)",
}


def parts_left_out(transmission: Transmission) -> list[dict[str, str]]:
    """Parts of a drive that the model leaves out, each with the reason.

    Args:
        transmission: Drive of one joint.
    """
    attached = transmission.attached
    items = []
    if attached.level in _LEFT_OUT:
        reason = (
            "no native form"
            if attached.level == "native"
            else f"not at level {attached.level}; use joints.*.level = 'full'"
        )
        items.append({"part": _LEFT_OUT[attached.level], "reason": reason})
    label = transmission.drive.info.get("label")
    if isinstance(label, dict) and (parts := label.get("left_out")):
        reason = f"not in maps of the model {label.get('model')}"
        items.append({"part": str(parts), "reason": reason})
    if isinstance(label, dict) and label.get("friction") and attached.level == "full":
        part = "effect of the friction of the teeth on the ripple"
        reason = "maps carry it as hysteresis, which is the same at all input angles"
        if why := why_no_friction(transmission.drive):
            part, reason = "hysteresis", why
        items.append({"part": part, "reason": reason})
    lossless = f"not at level {attached.level}; use level native or full"
    if attached.drive.hysteresis and attached.level not in LOSSY:
        part = f"hysteresis ({len(attached.drive.hysteresis)} elements)"
        items.append({"part": part, "reason": lossless})
    if attached.level == "native" and vary_with_load(attached.drive.hysteresis):
        part = "change of the hysteresis with the load"
        items.append({"part": part, "reason": "no native form"})
    if count := transmission.drive.info.get("hysteresis_left_out"):
        part = f"hysteresis ({count} elements)"
        items.append({"part": part, "reason": "joints.*.hysteresis = false"})
    items += _weak_harmonics(transmission)
    if why := _no_error(transmission):
        items.append({"part": "kinematic error of the drive", "reason": why})
    if (pruned := transmission.drive.info.get("pruned")) and pruned["dropped"]:
        bounds = (
            f"at most {pruned['output_angle_bound_arcmin']:.3g} arcmin and"
            f" {pruned['torque_bound_Nm']:.3g} N·m in all, below the tolerance of"
            f" {pruned['tolerance_arcmin']:.3g} arcmin"
        )
        part = f"{len(pruned['dropped'])} harmonics of the map"
        items.append({"part": part, "reason": bounds})
    friction = transmission.drive.friction
    if friction and not (attached.drive.friction and attached.level in LOSSY):
        off = attached.level in LOSSY
        reason = "joints.*.friction = false" if off else lossless
        items.append({"part": "friction of the drive", "reason": reason})
    elif not friction and attached.level in LOSSY:
        items += _no_friction(transmission.drive)
    if attached.level == "kinematic" and attached.kept_orders:
        share = 100.0 * ratio_variation(attached.drive)
        items.append(
            {
                "part": f"ratio variation in the torque, up to {share:.2g} %",
                "reason": "the error is prescribed on the commanded motion",
            }
        )
    if attached.native is not None and attached.native.note:
        items.append({"part": "the stiffness curve", "reason": attached.native.note})
    if attached.native is not None and attached.native.friction_note:
        part = f"part of the friction law: {attached.native.friction_note}"
        items.append({"part": part, "reason": "no native form"})
    if attached.unresolved:
        left = [f"{u.order:.4g}" for u in attached.unresolved]
        orders = f"orders {left[0]} to {left[-1]}" if left[1:] else f"order {left[0]}"
        items.append(
            {
                "part": f"{orders} per input turn ({len(left)} harmonics)",
                "reason": "the step cannot resolve them at the speed of this joint",
            }
        )
    return items


def _weak_harmonics(transmission: Transmission) -> list[dict[str, str]]:
    """Harmonics of tooth errors that the map dropped, with their possible ripple."""
    drive, attached = transmission.drive, transmission.attached
    error = (drive.info.get("tolerances") or {}).get("dropped_error_rms_rad", 0.0)
    share = 100.0 * attached.stiffness * error / drive.ratings.rated_torque
    if attached.level not in HARMONIC_LEVELS or not round(share, 2) > 0.0:
        return []
    part = f"weak harmonics of the tooth errors ({error / arcmin:.2g} arcmin rms)"
    reason = (
        f"the map does not contain them; they could add up to {share:.2g} % of rated"
        " torque to the ripple (rms)"
    )
    return [{"part": part, "reason": reason}]


def _no_error(transmission: Transmission) -> str | None:
    """Reason why a catalogue drive has no kinematic error although its level can."""
    drive = transmission.drive
    if (
        transmission.level not in ERRING
        or drive.level != "catalogue"
        or drive.kinematic_error[1:].any()
    ):
        return None
    return str(drive.info.get("kinematic_error", "joints.*.kinematic_error_arcmin = 0"))


def _no_friction(drive: DriveMap) -> list[dict[str, str]]:
    """Entry for the map of a real drive without friction, which turns without loss."""
    why = (drive.info.get("missing") or {}).get("efficiency_percent")
    if not isinstance(why, str):
        return []
    part = "friction of the turning drive, whose efficiency is therefore 100 %"
    return [{"part": part, "reason": why}]
