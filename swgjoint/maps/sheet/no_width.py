"""Reasons why the torque loop of a map lacks hysteresis."""

from __future__ import annotations

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import LOST_MOTION_TORQUE, TorqueLoop
from swgjoint.units import arcmin

HELD = 0.001
"""Torque by which a map with manufacturing errors holds the output in a clearance, as a
fraction of the rated torque [-], see :mod:`swgjoint.fe.common.clearance`."""
SOFT = 10.0
"""Compliance up to that torque, relative to the compliance up to the torque of the lost
motion, above which the output counts as held in a clearance [-]."""


def why_no_width(drive: Potential) -> str:
    """Reason why the loop of a map has no width at zero torque."""
    if not drive.hysteresis:
        return "the torque loop is conservative: the map has no hysteresis"
    return (
        "the loop of the map has no width at zero torque: its hysteresis elements do"
        " not slip there"
    )


def why_no_friction(drive: Potential) -> str | None:
    """Reason why the friction of the teeth is not in the map of a design that has it.

    The loop of such a map may have a width nevertheless, that of a clearance.

    Args:
        drive: The map.

    Returns:
        The reason; None if the map has the friction, or if the design has none.
    """
    label, stated = drive.info.get("label"), drive.info.get("missing")
    rubs = isinstance(label, dict) and bool(label.get("friction"))
    if drive.hysteresis or not rubs or not isinstance(stated, dict):
        return None
    reason = stated.get("hysteresis_loss_arcmin")
    return None if reason is None else str(reason)


def hysteresis_source(drive: Potential) -> str:
    """Source of the hysteresis of a map; ``none``, with a reason if it should have any.

    Args:
        drive: The map.
    """
    if drive.hysteresis:
        return str(drive.info.get("hysteresis", "given"))
    why = why_no_friction(drive)
    return "none" if why is None else f"none: {why}"


def held_clearance_text(drive: Potential, loop: TorqueLoop) -> str:
    """Remark on a clearance in which the map holds the output; empty without one.

    The output of such a drive rests at either end of its clearance, which is a part of
    the hysteresis loss. A map with manufacturing errors holds it in the middle.

    Args:
        drive: The map.
        loop: Its torque loop.
    """
    rated = drive.ratings.rated_torque
    held, load = HELD * rated, LOST_MOTION_TORQUE * rated
    high, low = output_angle(drive, 0.0, [-held, held])
    width = float(high - low)
    beyond = (loop.lost_motion(rated) - width) / (load - held)
    if not width > SOFT * beyond * held:
        return ""
    return (
        "; the clearance is no part of the loss, because a map with manufacturing"
        f" errors holds the output in it ({width / arcmin:.2g} arcmin at"
        f" {100.0 * HELD:g} % of the rated torque); for a design, --only"
        " hysteresis_loss_arcmin computes the loss without these errors"
    )
