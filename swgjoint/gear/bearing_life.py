r"""Life of the wave-generator bearing after the manufacturers' formula.

.. math:: L = L_n \left(\frac{T_N}{T_{av}}\right)^p \frac{n_N}{n_{av}}, \quad
    T_{av} = \left(\frac{\sum |n_k| t_k |T_k|^p}{\sum |n_k| t_k}\right)^{1/p}, \quad
    n_{av} = \frac{\sum |n_k| t_k}{\sum t_k}

with the exponent p = 3, the rated torque T_N, the rated input speed n_N and the rated
life L_n, which half of the bearings exceed (L50) or nine out of ten (L10). The sum of
the times in the mean speed includes pauses.

Source:
    Harmonic Drive LLC, "CSF & CSG Series", The Life of a Wave Generator, equation 8;
    Harmonic Drive AG (2014), "Engineering Data CSD-2A", 1019659, equations 18.2 and
    18.5 (means), 20.2 (L50) and 20.3 (L10 is about L50/5), table 20.1.
"""

from __future__ import annotations

from dataclasses import dataclass

from swgjoint.gear.catalogue import table
from swgjoint.units import hour, rpm

L50_OVER_L10 = 5.0
"""Ratio of the two lives in the manufacturers' formula [-]."""
RATED_SPEED = 2000.0 * rpm
"""Input speed to which manufacturers refer the rated torque [rad/s]."""
EXPONENT = 3.0
"""Exponent of the torque for ball bearings [-]."""


@dataclass(frozen=True, kw_only=True)
class RatedLife:
    """Life of a wave-generator bearing at its rated torque and rated speed."""

    L50: float
    """Life that half of the bearings exceed [s]."""
    L10: float
    """Life that nine out of ten bearings exceed [s]."""
    speed: float = RATED_SPEED
    """Rated input speed [rad/s]."""
    exponent: float = EXPONENT
    """Exponent p of the torque [-]."""
    source: str = "given"
    """Origin of the values."""

    def factor(self, rated_torque: float, torque: float, speed: float) -> float:
        """Life divided by the rated life; inf without torque or speed [-].

        Args:
            rated_torque: Rated torque at the output [N·m].
            torque: Mean output torque T_av [N·m].
            speed: Mean input speed n_av [rad/s].
        """
        if torque == 0.0 or speed == 0.0:
            return float("inf")
        return float((rated_torque / torque) ** self.exponent) * self.speed / speed


def catalogue_life(series: str) -> RatedLife | None:
    """Rated life of a catalogue series from ``life.csv``; None if it is not listed.

    Args:
        series: Catalogue series, such as ``CSG``.
    """
    for row in table("life"):
        if row["series"] == series:
            values = {k: v for k, v in row.items() if isinstance(v, float)}
            return RatedLife(
                L50=values["L50_h"] * hour,
                L10=values["L10_h"] * hour,
                speed=values["rated_speed_rpm"] * rpm,
                exponent=values["torque_exponent"],
                source=f"catalogue {series}",
            )
    return None
