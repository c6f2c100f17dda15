r"""What is in series with the drive: its cup and the springs that it is mounted to.

A boss spring lies between the flexspline and its shaft or frame, a housing spring
between the circular spline and its own, a coupling between the wave generator and its
own. Each carries the torque of its member, as a
share s of the output torque T: 1 of the member that is the output, :math:`1 - 1/i` of
the fixed one, because the wave generator takes the rest (with the circular spline fixed
:math:`z_{cs}/z_{fs}`), :math:`1/i` of the input. Where a member
twists by :math:`s T/k`, the output turns by s times that: a fixed member that turns by
:math:`\varphi` turns the teeth against the wave generator, :math:`\psi = \varphi +
(\theta - \varphi)/i`. So the output yields :math:`\sum s^2/k` per torque, and
:math:`T^2 \sum s^2/2k` is stored; :math:`T_{wg}\,d\theta - T\,d\psi = dU` stays closed.

The shares are those of the mean over a pitch: ripple of the input torque on a spring,
and the small turn by which it shifts the pattern over theta, are left out.
"""

from __future__ import annotations

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design, MemberName


def torque_shares(design: Design) -> dict[MemberName, float]:
    """Torque that each member's mounting carries, as a part of the output torque."""
    rest = 1.0 - 1.0 / design.ratio
    flexspline, circular_spline = {
        "circular_spline_fixed": (1.0, rest),
        "flexspline_fixed": (rest, 1.0),
        "wave_generator_fixed": (1.0 / design.ratio, 1.0),
    }[design.drive.layout]
    return {"flexspline": flexspline, "circular_spline": circular_spline}


def coupling_share(design: Design) -> float:
    """Torque that the coupling carries, as a part of the output torque."""
    if design.drive.layout == "wave_generator_fixed":
        return 1.0 - 1.0 / design.ratio
    return 1.0 / design.ratio


def series_compliance(design: Design, *, cup: bool) -> float:
    """Compliance at the output of what is in series with the toothed members.

    Args:
        design: The drive; ``[boss]``, ``[housing]`` and ``[coupling]`` that are absent
            do not yield.
        cup: Whether the closed-form cup counts, where the model has none of its own.

    Returns:
        [rad/(N·m)].
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
    """Stiffness of the springs by name, for the validity label [N·m/rad]."""
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
