"""The table ``[losses]`` of a design file, and its values in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Annotated, Literal

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.gear.bearing.base_oil import THICKEST, BaseOil
from swgjoint.units import ZERO_CELSIUS, mm

Viscosity = Annotated[float, Field(ge=2, le=10_000)]
COLDEST, HOTTEST = -20.0, 80.0
"""Range of lubricant temperatures [°C]."""
Temperature = Annotated[float, Field(ge=COLDEST, le=HOTTEST)]


class LossesSection(Section):
    """Lubricant, seals and steel, which determine the losses of a turning drive.

    With this table a map has the friction of bearing, teeth, seals and bending steel at
    speed; without it, only the hysteresis of the teeth. Coulomb friction of the teeth
    and of the rim on its race is ``friction.tooth_coefficient``.
    """

    base_oil_40C_mm2_s: Viscosity
    """Kinematic viscosity of the base oil of the grease at 40 °C [mm²/s]."""
    base_oil_100C_mm2_s: Viscosity
    """Kinematic viscosity at 100 °C [mm²/s]; below that at 40 °C."""
    grease: Literal["run_in", "flooded"] = "run_in"
    """State of the grease in the bearing: ``run_in``, pushed aside by the balls, or
    ``flooded``, where they churn it as if the bearing was full of base oil. A real
    bearing is between the two limits."""
    temperature_C: Temperature = 20.0
    """Temperature of the lubricant."""
    bending_loss_factor: Annotated[float, Field(ge=0, le=0.1)] = 1e-3
    """Loss factor of the flexspline and of the outer race in cyclic bending; the
    default is the order of magnitude of steel at large stress, assumed."""
    seal_torque_mNm: Annotated[float, Field(ge=0, le=100_000)] = 0.0
    """Friction torque of the seals at the input, at any speed."""

    @model_validator(mode="after")
    def _thinner_when_hot(self) -> LossesSection:
        if self.base_oil_100C_mm2_s >= self.base_oil_40C_mm2_s:
            raise Fault(
                (
                    "base_oil_100C_mm2_s",
                    f"{self.base_oil_100C_mm2_s:g} mm²/s; accepted: below"
                    f" base_oil_40C_mm2_s = {self.base_oil_40C_mm2_s:g} mm²/s",
                )
            )
        own = LossConditions.from_section(self)
        if own.temperature < own.coldest:
            nu = own.base_oil.viscosity(own.temperature) / mm**2
            raise Fault(
                (
                    "temperature_C",
                    f"{self.temperature_C:g} °C: the base oil has {nu:.3g} mm²/s, more"
                    f" than the {THICKEST / mm**2:g} mm²/s of the drag model; accepted:"
                    f" >= {own.coldest - ZERO_CELSIUS:.1f} °C, or grease = 'run_in'",
                )
            )
        return self


@dataclass(frozen=True, kw_only=True)
class LossConditions:
    """Lubricant, seals and steel of a drive in SI units."""

    base_oil: BaseOil
    """Base oil of the grease."""
    flooded: bool
    """Whether the balls churn the grease."""
    temperature: float
    """Absolute temperature of the lubricant [K]."""
    loss_factor: float
    """Loss factor of bending steel [-]."""
    seal_torque: float
    """Friction torque of the seals at the input [N·m]."""

    @classmethod
    def from_section(cls, section: LossesSection) -> LossConditions:
        """Values of the table of a design file."""
        return cls(
            base_oil=BaseOil(
                at_40=section.base_oil_40C_mm2_s * mm**2,
                at_100=section.base_oil_100C_mm2_s * mm**2,
            ),
            flooded=section.grease == "flooded",
            temperature=section.temperature_C + ZERO_CELSIUS,
            loss_factor=section.bending_loss_factor,
            seal_torque=1e-3 * section.seal_torque_mNm,
        )

    @property
    def coldest(self) -> float:
        """Lowest temperature for which the losses are modelled [K]."""
        lowest = COLDEST + ZERO_CELSIUS
        if not self.flooded:
            return lowest
        return max(lowest, self.base_oil.temperature(THICKEST))

    def temperatures(self, step: float = 2.5) -> list[float]:
        """Temperatures from the coldest to the hottest one [K].

        Args:
            step: Largest distance between two of them [K].
        """
        span = HOTTEST + ZERO_CELSIUS - self.coldest
        count = ceil(span / step)
        return [self.coldest + span * k / count for k in range(count + 1)]
