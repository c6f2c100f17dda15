"""Material of a member in SI units."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Material:
    """Isotropic linear elastic material of one member."""

    youngs_modulus: float
    """Young's modulus E [Pa]."""
    poisson_ratio: float
    """Poisson's ratio nu [-]."""
    density: float
    """Mass density [kg/m³]."""
    fatigue_limit_bending: float | None
    """Endurance limit in reversed bending [Pa]; None if unknown."""
    fatigue_limit_torsion: float | None
    """Endurance limit in reversed torsion [Pa]; None if unknown."""

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
