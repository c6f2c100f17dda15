"""The drive as thin rings: fast, plane, with the bearing of the wave generator."""

from swgjoint.fe.thin_ring.torsion import RingTorsion, torsion_curve

__all__ = ["RingTorsion", "torsion_curve"]
