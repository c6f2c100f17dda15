"""Comparison of a measured torque-torsion loop with the prediction of a map.

The map follows the torques of the record with a locked input, so that both loops have
the same path and are read by the same rules. The zero of a torsion sensor is arbitrary.
The measured loop is therefore shifted so that its mid-line agrees with that of the
prediction on average between -T1 and T1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from swgjoint.maps.equilibrium import move_sliders, output_angle
from swgjoint.maps.fit.loop_match import readings
from swgjoint.maps.hysteresis import total_yield
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import NO_WIDTH, REST, TorqueLoop
from swgjoint.maps.sliders import Sliders
from swgjoint.typing import Array
from swgjoint.units import arcmin

COMPARED = ("hysteresis_loss_arcmin", "lost_motion_arcmin")
"""Keys of the figures that are read around zero torque from both loops."""
APART = 0.1
"""Relative difference of such a figure above which a warning is given [-]."""
_GRID = 9
"""Number of torques from zero to T1 at which the zeros of the loops are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlay:
    """A measured and a predicted loop along the same torques."""

    measured: TorqueLoop
    """Measured loop, with its zero shifted onto that of the prediction."""
    predicted: TorqueLoop
    """Loop of the map along the torques of the record."""
    shift: float
    """Shift that was added to the measured torsion [rad]."""
    history: str
    """State of the drive before the record: ``at rest`` or ``run before``."""
    edges: tuple[float, float, float]
    """T1, T2 and the largest torque of the record [N·m]."""
    rated_torque: float
    """Rated torque that defines the lost motion [N·m]."""
    beyond_range: bool
    """Whether the record exceeds the sampled torque range of the map."""

    @property
    def residual(self) -> Array:
        """Measured minus predicted torsion [rad]. Shape (n,)."""
        return self.measured.torsion - self.predicted.torsion

    @property
    def _rms(self) -> float:
        """Root mean square of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    def segments(self) -> list[dict[str, Any]]:
        """Residual and stiffness on 0..T1, T1..T2 and T2..Tmax, both signs together.

        The stiffness of a segment is None if the record does not cover the segment or
        has no samples in it. The residuals are None if it has no samples in it.
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
        """Chord of the mid-line [N·m/rad]; the last one ends at the smaller peak."""
        torque = self.measured.torque
        both = min(float(torque.max()), -float(torque.min()))
        if high == self.edges[2] and both > low:
            high = both
        if not high > low or not self._sampled(low, high):
            return None
        value = loop.stiffness(low, high)
        return value if np.isfinite(value) else None

    def _sampled(self, low: float, high: float) -> bool:
        """Whether each sign that reaches ``high`` has a sample in low..high."""
        sides = [sign * self.measured.torque for sign in (1.0, -1.0)]
        return all(
            bool(((side > low) & (side <= high)).any())
            for side in sides
            if side.max() >= high
        )

    def warnings(self) -> list[str]:
        """One line for each of the figures that differs by more than :data:`APART`.

        The hysteresis loss is not compared if the prediction has none. The last line
        concerns the loops as a whole.
        """
        predicted, measured = (
            readings(loop, self.rated_torque)
            for loop in (self.predicted, self.measured)
        )
        pairs = {
            "hysteresis loss": (predicted.hysteresis_loss, measured.hysteresis_loss),
            "lost motion": (predicted.lost_motion, measured.lost_motion),
        }
        least = NO_WIDTH * float(np.ptp(self.predicted.torsion))
        lines = [
            f"{name} predicted {ours / arcmin:.4g} arcmin, measured"
            f" {theirs / arcmin:.4g} arcmin: {abs(ours / theirs - 1.0):.0%} apart"
            for name, (ours, theirs) in pairs.items()
            if ours > least and theirs > 0.0 and abs(ours / theirs - 1.0) > APART
        ]
        rest, torsion = self._rms, float(np.std(self.measured.torsion))
        if rest > APART * torsion:
            lines.append(
                f"the loops differ by {rest / arcmin:.4g} arcmin rms,"
                f" {rest / torsion:.0%} of the measured torsion: noise, drift, play, a"
                " width that depends on the load, or another stiffness"
            )
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Figures of both loops, and residuals in total and by segment; JSON values.

        Figures around zero torque are None unless each sign that reaches T1 has samples
        between zero and T1.
        """
        rest = self.residual / arcmin
        pair = {"measured": self.measured, "predicted": self.predicted}
        about_zero = self._sampled(0.0, self.edges[0])

        def of_both(values: dict[str, float]) -> dict[str, float | None]:
            """A figure of both loops [arcmin]; None where it is unknown."""
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
            "rms_arcmin": self._rms / arcmin,
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
    """Compare a measured loop with the prediction of a map.

    If the map has hysteresis, the prediction is computed twice: from rest, and after a
    first pass along the path. The one with the smaller residual is returned.

    Args:
        drive: The map.
        measured: Measured loop, whose torsion has the sign of the torque and an
            arbitrary zero.
        theta: Angle at which the input is locked in the prediction [rad].
    """
    ratings = drive.ratings
    first, again = _played(drive, measured, theta)
    choices = [("at rest", first)]
    if drive.hysteresis:
        choices.append(("run before", again))
    overlays = []
    for history, torsion in choices:
        predicted = TorqueLoop(torque=measured.torque, torsion=torsion)
        shift = _shift(measured, predicted, ratings.T1)
        moved = TorqueLoop(torque=measured.torque, torsion=measured.torsion + shift)
        overlays.append(
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
    return min(overlays, key=lambda one: float(np.sum(one.residual**2)))


def _played(
    drive: Potential, measured: TorqueLoop, theta: float
) -> tuple[Array, Array]:
    """Torsion of the map along a torque path, from rest and on a second pass [rad].

    Between two reversals the path counts as monotone even if the torque is noisy.
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
            sliders = move_sliders(drive, sliders, theta, float(psi[end]))
        rounds.append(free - psi)
    return rounds[0], rounds[1]


def _width(loop: TorqueLoop) -> float:
    """Hysteresis loss [rad]; zero if it results only from the torque :data:`REST`."""
    width, travel = loop.hysteresis_loss(), float(np.ptp(loop.torsion))
    return 0.0 if abs(width) < NO_WIDTH * travel else width


def from_its_side(torque: Array, rest: float) -> Array:
    """Torque path whose zeros are replaced by a small torque of the preceding sign.

    The reason is that a free output stays where the last load left it. Zeros at the
    start of the path remain zero.

    Args:
        torque: Torque along the path [N·m]. Shape (n,).
        rest: Magnitude of the torque that replaces a zero [N·m].
    """
    known = np.where(torque == 0.0, 0, np.arange(torque.size))
    before = np.sign(torque[np.maximum.accumulate(known)])
    return np.where(torque == 0.0, rest * before, torque)


def _shift(measured: TorqueLoop, predicted: TorqueLoop, top: float) -> float:
    """Shift of the measured torsion onto the prediction [rad].

    The shift averages the mid-lines at +T and -T, so that a stiffness error has no
    effect, over a grid of torques up to T1, so that noise is reduced.
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
    """Whether a record exceeds the torques of the map, including its hysteresis."""
    low, high = drive.torque_range
    low -= total_yield(drive.hysteresis, low)
    high += total_yield(drive.hysteresis, high)
    reach = 1.0 + 1e-6
    return bool(
        measured.torque.max() > reach * high or measured.torque.min() < reach * low
    )
