"""A measured torque-torsion loop over the one that a map predicts.

The map is led along the torques of the record, input locked, so that both loops have
the same path and are read by the same rules. The zero of a torsion sensor says nothing:
the measured loop is shifted onto the prediction where both load directions agree best
below T1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.loop_match import readings
from swgjoint.maps.hysteresis import Sliders
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import NO_WIDTH, REST, TorqueLoop
from swgjoint.typing import Array
from swgjoint.units import arcmin

COMPARED = ("hysteresis_loss_arcmin", "lost_motion_arcmin")
"""What is read about zero torque from both loops."""
APART = 0.1
"""Part by which such a reading may be off without a warning."""
_GRID = 9
"""Torques from zero to T1 over which the zeros of the loops are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlay:
    """Two loops along the same torques."""

    measured: TorqueLoop
    """As measured, its zero moved onto that of the prediction."""
    predicted: TorqueLoop
    shift: float
    """By which the measured torsion was moved [rad]."""
    history: str
    """What the drive did before the record: ``at rest`` or ``run before``."""
    edges: tuple[float, float, float]
    """T1, T2 and the largest torque of the record [N·m]."""
    rated_torque: float
    """Rated torque that defines the lost motion [N·m]."""
    beyond_range: bool
    """Whether the record leaves the torques for which the map was made."""

    @property
    def residual(self) -> Array:
        """Measured less predicted torsion [rad]. Shape (n,)."""
        return self.measured.torsion - self.predicted.torsion

    def segments(self) -> list[dict[str, Any]]:
        """Residual and stiffness on 0..T1, T1..T2, T2..Tmax, both signs together.

        Stiffness is None where the record does not reach or jumps across, residuals
        without samples.
        """
        size = np.abs(self.measured.torque)
        rows = []
        for k, (low, high) in enumerate(pairwise((0.0, *self.edges)), 1):
            high = max(low, high)
            inside = (size >= low if k == 1 else size > low) & (size <= high)
            rest = self.residual[inside] / arcmin
            rows.append(
                {
                    "segment": f"K{k}",
                    "from_Nm": low,
                    "to_Nm": high,
                    "samples": int(inside.sum()),
                    "rms_arcmin": float(np.sqrt(np.mean(rest**2)))
                    if rest.size
                    else None,
                    "largest_arcmin": float(np.abs(rest).max()) if rest.size else None,
                    "K_measured_Nm_rad": self._stiffness(self.measured, low, high),
                    "K_predicted_Nm_rad": self._stiffness(self.predicted, low, high),
                }
            )
        return rows

    def _stiffness(self, loop: TorqueLoop, low: float, high: float) -> float | None:
        """Chord of the mid-line; at the end of the record up to where both signs go."""
        torque = self.measured.torque
        both = min(float(torque.max()), -float(torque.min()))
        if high == self.edges[2] and both > low:
            high = both
        if not high > low or not self._sampled(low, high):
            return None
        value = loop.stiffness(low, high)
        return value if np.isfinite(value) else None

    def _sampled(self, low: float, high: float) -> bool:
        """Whether samples lie between two torques on every side that reaches them."""
        sides = [sign * self.measured.torque for sign in (1.0, -1.0)]
        return all(
            bool(((side > low) & (side <= high)).any())
            for side in sides
            if side.max() >= high
        )

    def warnings(self) -> list[str]:
        """Readings of the prediction that are more than a tenth off; a line each.

        A prediction without hysteresis has no loss that could be off.
        """
        ours, theirs = (
            readings(loop, self.rated_torque)
            for loop in (self.predicted, self.measured)
        )
        pairs = {
            "hysteresis loss": (ours.hysteresis_loss, theirs.hysteresis_loss),
            "lost motion": (ours.lost_motion, theirs.lost_motion),
        }
        least = NO_WIDTH * float(np.ptp(self.predicted.torsion))
        return [
            f"{name} predicted {own / arcmin:.4g} arcmin, measured"
            f" {value / arcmin:.4g} arcmin: {abs(own / value - 1.0):.0%} apart"
            for name, (own, value) in pairs.items()
            if own > least and value > 0.0 and abs(own / value - 1.0) > APART
        ]

    def as_dict(self) -> dict[str, Any]:
        """Plain values: figures of both loops, residuals in all and by segment.

        What is read about zero is None without samples within T1 on either side.
        """
        rest = self.residual / arcmin
        pair = {"measured": self.measured, "predicted": self.predicted}
        about_zero = self._sampled(0.0, self.edges[0])

        def of_both(values: dict[str, float]) -> dict[str, float | None]:
            return {
                k: float(v) / arcmin if about_zero and np.isfinite(v) else None
                for k, v in values.items()
            }

        return {
            "samples": int(rest.size),
            "torque_range_Nm": [
                float(self.measured.torque.min()),
                float(self.measured.torque.max()),
            ],
            "beyond_range": self.beyond_range,
            "shift_arcmin": self.shift / arcmin,
            "history": self.history,
            "rms_arcmin": float(np.sqrt(np.mean(rest**2))),
            "largest_arcmin": float(np.abs(rest).max()),
            "segments": self.segments(),
            "warnings": self.warnings(),
            "hysteresis_loss_arcmin": of_both(
                {name: _width(loop) for name, loop in pair.items()}
            ),
            "lost_motion_arcmin": of_both(
                {
                    name: loop.lost_motion(self.rated_torque)
                    for name, loop in pair.items()
                }
            ),
        }


def overlay(drive: Potential, measured: TorqueLoop, *, theta: float = 0.0) -> Overlay:
    """Lay a measured loop over the prediction of a map.

    With hysteresis the prediction starts at rest, or has been along the path once
    before; which of the two the record shows, its residual tells.

    Args:
        drive: The map.
        measured: Torque and torsion of one sign, any zero of the torsion.
        theta: Where the input is locked in the prediction [rad].
    """
    ratings = drive.ratings
    first, again = _played(drive, measured, theta)
    choices = [("at rest", first)]
    if drive.hysteresis:
        choices.append(("run before", again))
    found = []
    for history, torsion in choices:
        predicted = TorqueLoop(torque=measured.torque, torsion=torsion)
        shift = _shift(measured, predicted, ratings.T1)
        moved = TorqueLoop(torque=measured.torque, torsion=measured.torsion + shift)
        found.append(
            Overlay(
                measured=moved,
                predicted=predicted,
                shift=shift,
                history=history,
                edges=(ratings.T1, ratings.T2, float(np.abs(measured.torque).max())),
                rated_torque=ratings.rated_torque,
                beyond_range=_beyond(drive, measured),
            )
        )
    return min(found, key=lambda one: float(np.sum(one.residual**2)))


def _played(
    drive: Potential, measured: TorqueLoop, theta: float
) -> tuple[Array, Array]:
    """Torsion of the map along a path of the torque, from rest and once more [rad].

    Between two turns of the path the direction is one, also where samples jitter.
    """
    free = float(output_angle(drive, theta, 0.0))
    sliders = Sliders.relax(drive.hysteresis, float(drive.torsion(theta, free)))
    torque = from_its_side(measured.torque, REST * drive.ratings.rated_torque)
    rounds = []
    for _ in range(2):
        psi = np.full(torque.size, free)
        for begin, end in measured.turns():
            leg = slice(begin, end + 1)
            psi[leg] = output_angle(drive, theta, torque[leg], sliders)
            sliders = sliders.move_to(float(drive.torsion(theta, psi[end])))
        rounds.append(free - psi)
    return rounds[0], rounds[1]


def _width(loop: TorqueLoop) -> float:
    """Hysteresis loss [rad], zero where only the torque left at zero shows."""
    width, travel = loop.hysteresis_loss(), float(np.ptp(loop.torsion))
    return 0.0 if abs(width) < NO_WIDTH * travel else width


def from_its_side(torque: Array, rest: float) -> Array:
    """Zeros of a path as the rest of the torque before them: a free output stays.

    Args:
        torque: Along the path (n,) [N·m].
        rest: What is left of it at zero [N·m].
    """
    known = np.where(torque == 0.0, 0, np.arange(torque.size))
    before = np.sign(torque[np.maximum.accumulate(known)])
    return np.where(torque == 0.0, rest * before, torque)


def _shift(measured: TorqueLoop, predicted: TorqueLoop, top: float) -> float:
    """By which to move the measured torsion [rad].

    Mid-lines at +T and -T together, so that a wrong stiffness moves nothing; a grid
    of torques up to T1, so that noise is averaged.
    """
    torque = np.linspace(0.0, top, _GRID)
    apart = np.stack(
        [
            predicted.mid_line(s * torque) - measured.mid_line(s * torque)
            for s in (1, -1)
        ]
    ).mean(axis=0)
    return float(np.mean(apart[np.isfinite(apart)]))


def _beyond(drive: Potential, measured: TorqueLoop) -> bool:
    low, high = drive.torque_range
    slipping = sum(element.yield_torque for element in drive.hysteresis)
    reach = 1.0 + 1e-6
    return bool(
        measured.torque.max() > reach * (high + slipping)
        or measured.torque.min() < reach * (low - slipping)
    )
