"""Material of a member, in SI."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Material:
    """Isotropic linear elastic material of one member."""

    youngs_modulus: float
    """E [Pa]."""
    poisson_ratio: float
    density: float
    """[kg/m³]."""
    fatigue_limit_bending: float | None
    """Endurance limit in reversed bending [Pa], where known."""
    fatigue_limit_torsion: float | None
    """Endurance limit in reversed torsion [Pa], where known."""

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
