r"""Elastic parts in series with the teeth: the cup and the mounting springs.

A boss spring connects the flexspline to its shaft or frame, a housing spring connects
the circular spline, and a coupling connects the wave generator. Each spring carries a
share s of the output torque T: s = 1 for the output member, :math:`s = 1/i` for the
input member, and :math:`s = 1 - 1/i` for the fixed member (:math:`z_{cs}/z_{fs}` with
the circular spline fixed).

If a member twists by :math:`s T/k`, the output turns by s times that angle. For
example, a fixed member that turns by :math:`\varphi` also turns the teeth relative to
the wave generator: :math:`\psi = \varphi + (\theta - \varphi)/i`. The compliance at
the output is therefore :math:`\sum s^2/k` and the stored energy
:math:`T^2 \sum s^2/2k`, so that :math:`T_{wg}\,d\theta - T\,d\psi = dU` is satisfied.

The shares are mean values over a tooth pitch. The ripple of the input torque on a
spring, and the small phase shift that it causes, are neglected.
"""

from __future__ import annotations

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design, MemberName


def torque_shares(design: Design) -> dict[MemberName, float]:
    """Torque in the mounting of each member, divided by the output torque [-]."""
    rest = 1.0 - 1.0 / design.ratio
    flexspline, circular_spline = {
        "circular_spline_fixed": (1.0, rest),
        "flexspline_fixed": (rest, 1.0),
        "wave_generator_fixed": (1.0 / design.ratio, 1.0),
    }[design.drive.layout]
    return {"flexspline": flexspline, "circular_spline": circular_spline}


def coupling_share(design: Design) -> float:
    """Torque in the coupling, divided by the output torque [-]."""
    if design.drive.layout == "wave_generator_fixed":
        return 1.0 - 1.0 / design.ratio
    return 1.0 / design.ratio


def series_compliance(design: Design, *, cup: bool) -> float:
    """Compliance, at the output, of the parts in series with the teeth.

    Args:
        design: The drive; without ``[boss]``, ``[housing]`` or ``[coupling]`` that part
            is rigid.
        cup: Whether to include the closed-form compliance of the cup, for models that
            do not contain the cup.

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
    """Torsional stiffness of the mounting springs by name [N·m/rad]; None without any.

    The validity label of a map lists them.
    """
    parts = {
        "boss": design.boss,
        "housing": design.housing,
        "coupling": design.coupling,
    }
    found = {
        name: part.torsional_stiffness_Nm_rad
        for name, part in parts.items()
        if part is not None
    }
    return found or None
