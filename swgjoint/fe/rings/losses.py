r"""Losses of a turning drive over load, speed and temperature, from its design.

The input torque of friction is the sum of what the parts take on their own,

.. math:: F(T, n, \vartheta) = \mu W_\mu(T) + M_b(T, n, \nu(\vartheta))
    + M_d(n, \nu(\vartheta)) + \eta B(T) + M_s, \qquad
    \text{efficiency} = \frac{|T/i|}{|T/i| + F},

with Coulomb friction of teeth and race, rolling and sliding balls, drag of the balls in
churning grease, bending steel (rim, race and, in closed form, the wall of the cup) and
seals. Only the viscosity depends on the temperature. Means are over the passage of
balls and teeth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.errors import DesignError
from swgjoint.fe.rings.loading import positions
from swgjoint.fe.rings.model import check_modelled, thin_ring
from swgjoint.fe.rings.running import (
    RunningFriction,
    running_friction,
    running_over_load,
)
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.rolling_friction import GreasedBearing
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.catalogue_stated import StatedLosses
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.losses import LossConditions
from swgjoint.maps.cache import recall
from swgjoint.maps.fit.friction_bending import cup_bending_energy
from swgjoint.maps.fit.friction_fit import FilmFriction
from swgjoint.maps.sheet.efficiency import (
    LOADS,
    SPEEDS,
    TEMPERATURES,
    EfficiencyTable,
)
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import ZERO_CELSIUS, rpm

LOADED_POSITIONS = 4
"""Number of wave-generator angles under load; eight change the loss of size 25, ratio
100 by 0.1 %."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LossModel:
    """Friction of the parts of a drive under several loads."""

    load: Array
    """Output torques, beginning with zero and ending at rated torque (n,) [N·m]."""
    cases: tuple[RunningFriction, ...]
    """Friction under each of these loads."""
    ratio: float
    """Signed ratio i [-]."""
    mu: float
    """Coefficient of friction of the teeth and of the rim on its race [-]."""
    conditions: LossConditions
    """Lubricant, seals and steel."""
    cup_bending: float = 0.0
    """Input torque that bending of the cup takes, per loss factor [N·m]."""

    def parts(self, speed: float, temperature: float) -> dict[str, Array]:
        """Mean friction torques at the input by part, each (n,) [N·m].

        Args:
            speed: Speed of the input [rad/s].
            temperature: Absolute temperature of the lubricant [K].
        """
        own, nu = self.conditions, self.conditions.base_oil.viscosity(temperature)
        drag = self.cases[0].drag_torque(speed, nu) if own.flooded else 0.0
        balls = [float(one.ball_torque(speed, nu).mean()) for one in self.cases]
        return {
            "teeth": self.mu * np.array([one.teeth.mean() for one in self.cases]),
            "race": self.mu * np.array([one.race.mean() for one in self.cases]),
            "balls": np.array(balls),
            "drag": np.full(self.load.size, drag),
            "bending": own.loss_factor
            * np.array([one.bending.mean() + self.cup_bending for one in self.cases]),
            "seals": np.full(self.load.size, own.seal_torque),
        }

    def friction(self, speed: float, temperature: float) -> Array:
        """Mean friction torque at the input (n,) [N·m].

        Args:
            speed: Speed of the input [rad/s].
            temperature: Absolute temperature of the lubricant [K].
        """
        return np.asarray(sum(self.parts(speed, temperature).values()))

    def efficiency(self, speed: float, temperature: float) -> Array:
        """Output work over input work, zero without load (n,) [-].

        Args:
            speed: Speed of the input [rad/s].
            temperature: Absolute temperature of the lubricant [K].
        """
        used = np.abs(self.load / self.ratio)
        return np.asarray(used / (used + self.friction(speed, temperature)))

    def table(self) -> EfficiencyTable:
        """Efficiency over load, speed and temperature."""
        modelled = TEMPERATURES[TEMPERATURES >= self.conditions.coldest]
        return EfficiencyTable(
            load=self.load[1:],
            speed=SPEEDS,
            temperature=modelled,
            efficiency=np.array(
                [
                    [self.efficiency(speed, T)[1:] for speed in SPEEDS.tolist()]
                    for T in modelled.tolist()
                ]
            ),
        )

    def starting_torque(self) -> float:
        """Smallest input torque that keeps the unloaded drive turning [N·m].

        It is the torque at the worst angle and includes the frictionless torque.
        """
        own, free = self.conditions, self.cases[0]
        rest = free.ball_torque(0.0, own.base_oil.viscosity(own.temperature))
        steel = own.loss_factor * (free.bending + self.cup_bending)
        worst = free.elastic + self.mu * free.per_mu + rest + steel
        return float(worst.max()) + own.seal_torque

    def catalogue_losses(self, temperature: float) -> StatedLosses:
        """Losses as a catalogue states them, at a temperature [K].

        The starting torque is the mean friction at rest; the worst angle of a map adds
        its cogging. The back-driving torque is not determined (zero).
        """
        running = self.friction(RUNNING_SPEED, temperature)
        return StatedLosses(
            rated_torque=float(self.load[-1]),
            efficiency=float(self.efficiency(RUNNING_SPEED, temperature)[-1]),
            no_load_running=float(running[0]),
            starting=float(self.friction(0.0, temperature)[0]),
            back_driving=0.0,
        )

    def film(self, temperature: float) -> FilmFriction:
        """Friction at rest if a film of lubricant separated balls and races.

        Args:
            temperature: Absolute temperature of the lubricant [K].
        """
        free = self.cases[0]
        greased = GreasedBearing.from_bearing(
            free.bearing, self.conditions.base_oil.viscosity(temperature)
        )
        lobes = free.lobe_force
        film = sum(greased.film_torque(force) for force in lobes.ravel().tolist())
        parts = self.parts(0.0, temperature)
        others = sum(float(part[0]) for key, part in parts.items() if key != "balls")
        return FilmFriction(
            starting=film / len(lobes) + others, speed=greased.film_speed
        )

    def as_dict(self) -> dict[str, Any]:
        """Parts of the friction at 2000 rpm over the load, and its conditions."""
        own = self.conditions
        parts = self.parts(RUNNING_SPEED, own.temperature)
        total = np.asarray(sum(parts.values()))
        return {
            "temperature_C": round(own.temperature - ZERO_CELSIUS, 9),
            "speed_rpm": RUNNING_SPEED / rpm,
            "base_oil_mm2_s": 1e6 * own.base_oil.viscosity(own.temperature),
            "grease": "flooded" if own.flooded else "run_in",
            "coefficient": self.mu,
            "loss_factor": own.loss_factor,
            "load_Nm": self.load.tolist(),
            "friction_Nm": {key: part.tolist() for key, part in parts.items()},
            "bending_share": (parts["bending"] / total).tolist(),
            "lobe_force_N": [float(one.lobe_force.mean()) for one in self.cases],
        }


def loss_model(design: Design, *, progress: Progress = silent) -> LossModel:
    """Losses of a design with a table ``[losses]``.

    The equilibria of the thin rings are cached; they depend neither on the losses nor
    on the coefficient of friction.

    Args:
        design: The drive; its wave generator must have a ball bearing.
        progress: Called while equilibria are solved.

    Raises:
        ValueError: If the design has no ``[losses]``.
        DesignError: If the thin rings cannot model the design.
        ComputationError: If an equilibrium cannot be solved.
    """
    if design.losses is None:
        raise ValueError(f"{design.drive.name} has no [losses]")
    try:
        check_modelled(design)
    except DesignError as error:
        raise DesignError(
            f"{design.drive.name}: losses are computed in thin rings, which need a ball"
            " bearing of the wave generator, an elliptical, cosine or table outline and"
            " a fixed circular spline"
        ) from error

    def solve() -> dict[str, Any]:
        angles = positions(thin_ring(plain), LOADED_POSITIONS)
        cases = (
            running_friction(plain),
            *running_over_load(plain, loads[1:], angles=angles, progress=progress),
        )
        return {"cases": [one.to_json() for one in cases]}

    rated = ratings_of(design).rated_torque
    loads = [0.0, *(part * rated for part in LOADS)]
    plain = design.with_changes({"losses": None, "friction.tooth_coefficient": 0.0})
    parts = {"figure": "losses", "design": plain.content_hash(), "loads": loads}
    found = recall("figures", parts, dict[str, Any], solve)["cases"]
    bearing = BallBearing.from_design(design)
    return LossModel(
        load=np.array(loads),
        cases=tuple(RunningFriction.from_json(one, bearing) for one in found),
        ratio=design.ratio,
        mu=design.friction.tooth_coefficient,
        conditions=LossConditions.from_section(design.losses),
        cup_bending=2.0 * design.lobes * cup_bending_energy(design),
    )
