r"""Validity of the torque ripple of a joint.

The ripple results from the harmonics of the maps, which :func:`map_label` assesses. A
run without harmonics has no ripple, only vibration and round-off. A run whose step
cannot resolve some harmonics leaves them out and has less ripple than the drive.

The missing part is estimated from the map. At high frequency the inertias on both sides
of the drive hardly move, so order n of the kinematic error, with amplitude
:math:`e_n`, becomes torsion. With the amplitude of the same order in the output torque
at rated torque, :math:`|\partial_\Delta V_n|`, the amplitude of the torque is

.. math:: T_n = K e_n + |\partial_\Delta V_n|.

If r is the recorded rms, the rms of the ripple of the drive is at least r, and about
:math:`\sqrt{r^2 + \sum T_n^2/2}`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.maps.sheet.map_validity import LIMIT, MapValidation, map_validation
from swgjoint.sim.figures.verdict import PHASE_STEP
from swgjoint.typing import Array
from swgjoint.units import deg

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


HARMONIC_LEVELS = ("kinematic", "full")
"""Levels at which the model contains harmonics of the map."""
SHARE = 0.05
"""Relative increase of the ripple by the omitted orders above which the recorded ripple
is reported as a lower bound."""
ABOVE_NOISE = 3.0
"""Smallest ratio of ripple to integration noise at which the ripple is reported."""
ROUND_OFF = 1e-6
"""Rms of the ripple, relative to the rated torque, below which it is not reported."""


def ripple_label(run: Run, j: int, ripple: Array) -> dict[str, Any]:
    """Validity of the torque ripple of one joint.

    Args:
        run: The run.
        j: Index of the joint.
        ripple: Torque ripple of the joint [N·m]. Shape (n_window,).

    Returns:
        ``ripple_missing``: reason why no ripple is reported; None if it is reported.
        ``ripple_noise_percent``: rms of the integration noise, relative to the rated
        torque. ``ripple_left_out_percent``: estimated rms of the orders that the step
        leaves out, relative to the rated torque. ``ripple_is_lower_bound``: whether
        these orders are significant. ``resolving``: see :func:`find_resolving_step`.
    """
    transmission = run.assembly.transmissions[j]
    rated = transmission.drive.ratings.rated_torque
    rms = float(np.sqrt(np.mean(ripple**2)))
    noise = integration_noise(ripple)
    left = left_out_torque(run, j)
    missing = None
    if not any(has_harmonics(run, k) for k in range(len(run.joints))):
        missing = "no drive of the run has a kinematic error or harmonics at its level"
    elif rms < max(ABOVE_NOISE * noise, ROUND_OFF * rated):
        missing = "below the noise of the integration"
        if left:
            missing = "the step resolves none of its orders"
    whole = float(np.hypot(rms, left))
    return {
        "ripple_missing": missing,
        "ripple_noise_percent": 100.0 * noise / rated,
        "ripple_left_out_percent": 100.0 * left / rated,
        "ripple_is_lower_bound": bool(left > 0.0 and whole > (1.0 + SHARE) * rms),
        "resolving": find_resolving_step(run, j),
    }


def map_label(run: Run, j: int, *, told: bool) -> dict[str, Any]:
    """Validity of the map of one joint at the torques of the run.

    The validation record of the map is evaluated over the torques of the part of the
    motion that the figures use.

    Args:
        run: The run.
        j: Index of the joint.
        told: Whether the run reports a ripple of the joint.

    Returns:
        ``ripple_valid``: whether the differences of the map from finite elements are
        within the limit; None if there is no ripple to assess or no record.
        ``map_difference``: the largest differences under ``input_torque`` and
        ``output_error``, the torques of the run under ``torque_range_Nm`` and, of a map
        that is not valid there, under ``valid_from_Nm`` the torque from which on it is
        (None if it is not at its largest torque either); None without a record.
        ``map_difference_missing``: the reason for None.
    """
    transmission = run.assembly.transmissions[j]
    record, reason = map_validation(transmission.drive)
    if transmission.level != "full":
        record, reason = None, f"level {transmission.level} has no ripple of a map"
    elif not transmission.attached.kept_orders:
        record, reason = None, "the step resolves no order of the map"
    if record is None:
        return {
            "ripple_valid": None,
            "map_difference": None,
            "map_difference_missing": reason,
        }
    torque = run.output_torque[run.steady, j]
    low, high = float(torque.min()), float(torque.max())
    differences = record.worst_between(low, high)
    worst = max(one.largest for one in differences.values())
    return {
        "ripple_valid": worst <= LIMIT if told else None,
        "map_difference": {
            **{key: one.to_json() for key, one in differences.items()},
            "torque_range_Nm": [low, high],
            **({"valid_from_Nm": valid_from(record)} if worst > LIMIT else {}),
        },
        "map_difference_missing": None,
    }


def valid_from(record: MapValidation) -> float | None:
    """Smallest torque from which on a map is valid up to the end of its record [N·m].

    Between two rows of the record the differences are interpolated linearly.

    Args:
        record: The validation record of the map.

    Returns:
        The torque; None if the map is not valid at the largest torque of its record.
    """
    start = 0.0
    for rows in record.rows.values():
        # the larger difference of torques of either sign
        largest: dict[float, float] = {}
        for torque, value, _ in rows:
            largest[abs(torque)] = max(value, largest.get(abs(torque), 0.0))
        torques = sorted(largest)
        values = [largest[torque] for torque in torques]
        bad = [k for k, value in enumerate(values) if value > LIMIT]
        if not bad:
            continue
        if (k := bad[-1]) == len(torques) - 1:
            return None
        share = (values[k] - LIMIT) / (values[k] - values[k + 1])
        start = max(start, torques[k] + share * (torques[k + 1] - torques[k]))
    return start


def has_harmonics(run: Run, j: int) -> bool:
    """Whether a joint has a level with harmonics and a map that contains some.

    Args:
        run: The run.
        j: Index of the joint.
    """
    attached = run.assembly.transmissions[j].attached
    return attached.level in HARMONIC_LEVELS and bool(
        len(attached.drive.orders) > 1 or attached.unresolved
    )


def integration_noise(signal: Array) -> float:
    r"""Rms of the sample-to-sample noise of a signal, in the unit of the signal.

    White noise of standard deviation s has second differences of standard deviation
    :math:`\sqrt 6\, s`, whereas the second differences of a wave that the step resolves
    are almost zero.

    Args:
        signal: Samples at equal intervals. Shape (n,).
    """
    if signal.size < 3:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(signal, 2) ** 2) / 6.0))


def left_out_torque(run: Run, j: int) -> float:
    """Estimated rms of the torque ripple of the unresolved orders [N·m].

    Args:
        run: The run.
        j: Index of the joint.
    """
    attached = run.assembly.transmissions[j].attached
    return float(
        np.sqrt(
            sum(
                0.5 * (attached.stiffness * order.error + order.torque) ** 2
                for order in attached.unresolved
            )
        )
    )


def may_exceed(joint: Mapping[str, Any], ripple: float) -> bool:
    """Whether a joint with the orders that the step leaves out may exceed a ripple.

    Args:
        joint: Figures of the joint.
        ripple: Rms ripple, relative to the rated torque [%].
    """
    left = float(joint["ripple_left_out_percent"])
    whole = float(np.hypot(joint["ripple_rms_percent"], left))
    return left > 0.0 and whole > (1.0 + SHARE) * ripple


def find_resolving_step(run: Run, j: int) -> dict[str, float] | None:
    """Strongest order that the step leaves out, and what would resolve it.

    Args:
        run: The run.
        j: Index of the joint.

    Returns:
        ``order``: order per input turn. ``step_s``: longest step that resolves it at
        the speed of the run [s]. ``speed_deg_s``: largest joint speed at which the step
        of the run resolves it [deg/s]. None if no order is left out.
    """
    transmission = run.assembly.transmissions[j]
    attached = transmission.attached
    speed = float(run.assembly.trajectory.top_speed[j])
    if not attached.unresolved or speed == 0.0:
        return None
    strongest = max(
        attached.unresolved, key=lambda u: attached.stiffness * u.error + u.torque
    )
    step = run.assembly.scene.simulation.step_s
    per_radian = strongest.order * abs(transmission.ratio)
    return {
        "order": strongest.order,
        "step_s": PHASE_STEP / (per_radian * speed),
        "speed_deg_s": PHASE_STEP / (per_radian * step) / deg,
    }
