r"""Load case of the article "stress and fatigue": four forces, no wave generator.

Forces on four small areas of the bore, at :math:`\pm\beta` from both ends of the major
axis, press the cup outward until the largest radial displacement of the teeth is
:math:`w_0`. Equal tangential forces on 11 teeth around each end of the major axis
replace tooth contact and carry the torque. While the torque rises, the displacement of
the areas remains constant. If the forces remained constant instead, the teeth would
move by twice :math:`w_0` at 60 N·m, whereas the article reports 0.001 mm per N·m.
Deflections are assumed to be small, so that the load cases superpose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from swgjoint.fe.solid.figures.pinched_cup import PinchedCup
from swgjoint.typing import Array
from swgjoint.units import deg

ANGLE = 25.0 * deg
"""Angle beta of the article [rad]."""
TEETH = 11
"""Number of teeth around each end of the major axis that carry the torque; the article
uses 11 nodes."""
HALF_WIDTH, HALF_LENGTH = 2.5 * deg, 0.2
"""Half of the size of the areas around the bore [rad] and along the axis, in face
widths [-]. The article states only that the areas are small."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FourForces:
    """Response of half a cup to four forces and a torque, in the frames of the teeth.

    The other half responds equally.
    """

    force: Array
    """Outward forces on the areas at beta and at pi - beta from the major axis, without
    torque (2,) [N]."""
    force_by_torque: Array
    """Derivative of these forces by the torque (2,) [N/(N·m)]."""
    radial: Array
    """Outward displacement of the nodes of the toothed segments, without torque
    (N, n_nodes) [m]."""
    radial_by_torque: Array
    """Derivative of this displacement by the torque (N, n_nodes) [m/(N·m)]."""
    stress: Mapping[str, Array]
    """Stress xx, yy, zz, xy, yz, zx at the nodes by segment, without torque
    (N, n_nodes, 6) [Pa]."""
    stress_by_torque: Mapping[str, Array]
    """Derivative of this stress by the torque (N, n_nodes, 6) [Pa/(N·m)]."""

    def largest_radial(self, torque: float) -> float:
        """Largest outward displacement of the teeth [m] at a torque [N·m]."""
        return float((self.radial + torque * self.radial_by_torque).max())

    def stresses(self, torque: float) -> dict[str, Array]:
        """Nodal stress by segment (N, n_nodes, 6) [Pa] at a torque [N·m]."""
        return {
            k: s + torque * self.stress_by_torque[k] for k, s in self.stress.items()
        }


def four_forces(cup: PinchedCup, deflection: float) -> FourForces:
    """Apply the load case of the article to a cup.

    Args:
        cup: A cup with teeth.
        deflection: Largest outward displacement of the teeth without torque [m].
    """
    # outward directions at all nodes, and positions of the loaded ones
    teeth = cup.segments[0]
    points = np.asarray(teeth.mesh.mesh.p).T
    out = points * np.array([1.0, 1.0, 0.0])
    out /= np.linalg.norm(out, axis=-1)[:, None]
    nodes = teeth.loaded[::3] // 3
    at, outward = points[nodes], out[nodes]
    bore = np.arange(len(at)) < cup.bore
    angle = pi * np.arange(cup.sectors) / cup.sectors

    # unit loads: the forces of both areas, and the torque
    width = np.ptp(cup.strip.teeth.z)
    area = bore & (np.abs(at[:, 2]) <= (HALF_LENGTH + 1e-9) * width)
    cases = []
    for centre in (ANGLE, pi - ANGLE):
        pressed = np.abs(angle - centre) <= HALF_WIDTH + 1e-9
        load = np.zeros((cup.sectors, len(at), 3))
        load[np.ix_(pressed, area)] = outward[area] / (pressed.sum() * area.sum())
        cases.append(load.reshape(cup.sectors, -1))
    meshing = np.argsort(np.minimum(angle, pi - angle), kind="stable")[:TEETH]
    load = np.zeros_like(load)
    around = np.stack([-outward[:, 1], outward[:, 0], outward[:, 2]], axis=-1)
    lever = float(np.hypot(at[~bore, 0], at[~bore, 1]).sum())
    # the half model carries half of the torque
    load[np.ix_(meshing, ~bore)] = 0.5 / (TEETH * lever) * around[~bore]
    cases.append(load.reshape(cup.sectors, -1))

    responses = [cup.respond(case) for case in cases]
    radial = np.array([np.einsum("sni,ni->sn", u, out) for u, _ in responses])
    # mean displacement of each area, weighted with its load
    moved = np.array(
        [
            [np.sum(case * u[:, nodes].reshape(cup.sectors, -1)) for u, _ in responses]
            for case in cases[:2]
        ]
    )
    # equal forces without torque; with torque, forces that keep the areas in place
    both = radial[0] + radial[1]
    without = deflection / float(both.max()) * np.array([1.0, 1.0, 0.0])
    by_torque = np.append(-np.linalg.solve(moved[:, :2], moved[:, 2]), 1.0)

    def summed(parts: Array) -> dict[str, Array]:
        return {
            name: np.asarray(
                sum(f * s[name] for f, (_, s) in zip(parts, responses, strict=True))
            )
            for name in responses[0][1]
        }

    return FourForces(
        force=without[:2],
        force_by_torque=by_torque[:2],
        radial=np.einsum("k,ksn->sn", without, radial),
        radial_by_torque=np.einsum("k,ksn->sn", by_torque, radial),
        stress=summed(without),
        stress_by_torque=summed(by_torque),
    )
