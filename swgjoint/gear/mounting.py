r"""Compliance in series with the teeth: the cup and the springs of the mounting.

A boss spring connects the flexspline to its shaft or frame, a housing spring connects
the circular spline to its frame or shaft, and a coupling connects the wave generator to
its shaft. Each carries the torque of its member, which is a signed share s of the
output torque T:

* s = 1 for the output member;
* :math:`s = 1 - 1/i` for the fixed member, because the wave generator takes the rest
  (:math:`z_{cs}/z_{fs}` with the circular spline fixed);
* :math:`s = 1/i` for the input member.

If the spring of a member, with the stiffness k, twists by :math:`s T/k`, the output
turns by s times that angle. For example, a fixed member that turns by :math:`\varphi`
also changes the angle of the wave generator relative to it, so the output angle is
:math:`\psi = \varphi + (\theta - \varphi)/i`. The compliance at the output is therefore
:math:`\sum s^2/k` and the stored energy :math:`T^2 \sum s^2/2k`, so that
:math:`T_{wg}\,d\theta - T\,d\psi = dU` remains exact.

The shares are means over a pitch. The model neglects the ripple of the input torque on
a spring, and the small rotation of the spring due to this ripple, which would shift the
results along theta.
"""

from __future__ import annotations

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design, MemberName


def torque_shares(design: Design) -> dict[MemberName, float]:
    """Signed torque on each toothed member's mounting over the output torque [-]."""
    rest = 1.0 - 1.0 / design.ratio
    flexspline, circular_spline = {
        "circular_spline_fixed": (1.0, rest),
        "flexspline_fixed": (rest, 1.0),
        "wave_generator_fixed": (1.0 / design.ratio, 1.0),
    }[design.drive.layout]
    return {"flexspline": flexspline, "circular_spline": circular_spline}


def coupling_share(design: Design) -> float:
    """Signed torque on the coupling, divided by the output torque [-]."""
    if design.drive.layout == "wave_generator_fixed":
        return 1.0 - 1.0 / design.ratio
    return 1.0 / design.ratio


def series_compliance(design: Design, *, cup: bool) -> float:
    """Compliance of all parts in series with the toothed members, at the output.

    Args:
        design: The drive; absent ``[boss]``, ``[housing]`` and ``[coupling]`` tables
            mean rigid connections.
        cup: Whether to add the closed-form compliance of the cup, for models that do
            not contain the cup.

    Returns:
        Compliance [rad/(N·m)].
    """
    share = torque_shares(design)
    behind_teeth = 0.0
    if cup and design.cup is not None:
        behind_teeth += 1.0 / cup_torsional_stiffness(design)
    if design.boss is not None:
        behind_teeth += 1.0 / design.boss.torsional_stiffness_Nm_rad
    around = 0.0
    if design.housing is not None:
        around = 1.0 / design.housing.torsional_stiffness_Nm_rad
    before = 0.0
    if design.coupling is not None:
        before = 1.0 / design.coupling.torsional_stiffness_Nm_rad
    return (
        share["flexspline"] ** 2 * behind_teeth
        + share["circular_spline"] ** 2 * around
        + coupling_share(design) ** 2 * before
    )


def springs_of(design: Design) -> dict[str, float] | None:
    """Torsional stiffness of each spring by name [N·m/rad]; None without springs.

    The names are ``boss``, ``housing`` and ``coupling``.
    """
    parts = {
        "boss": design.boss,
        "housing": design.housing,
        "coupling": design.coupling,
    }
    springs = {
        name: part.torsional_stiffness_Nm_rad
        for name, part in parts.items()
        if part is not None
    }
    return springs or None
