"""Contact forces of one of our states on the same flexspline in CalculiX."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import calculix
import numpy as np
from calculix import Fields
from numpy.typing import NDArray
from quadratic_ring import Chain, QuadraticRing, quadratic_ring

from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import flexspline_stress
from swgjoint.gear.design.design import Design
from swgjoint.units import mm

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MPa, um = 1e6, 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Forces:
    """What acts on the flexspline besides its own stiffness, global frame."""

    bore_angle: Array
    """Of the bore nodes of a sector [rad]. Shape (n,)."""
    bore: Array
    """Wave generator, and the torque of the load (N, n, 2) [N]."""
    station: Array
    """Of the flank nodes of a sector [m]. Shape (k,)."""
    flank: Array
    """Tooth forces, right then left (N, 2, k, 2) [N]."""

    @classmethod
    def of(cls, model: SectorModel, state: State) -> Forces:
        """Forces of a converged state."""
        mesh = model.element.mesh
        bore = model.wave_generator_force(state) + load_on_bore(model, state)
        flank = state.flank_force.reshape(model.sectors, 2, -1, 2)
        x, y = mesh.mesh.p[:, mesh.bore[:-1]]
        return cls(
            bore_angle=np.arctan2(-x, y),
            bore=bore,
            station=mesh.flank_stations[:-1],
            flank=rotate(flank, model.frames(state).angle[:, None, None]),
        )

    def halved_on_axes(self, place: Array) -> Forces:
        """On an axis of symmetry only half of a force belongs to the quarter."""
        on_axis = np.isclose(np.sin(2.0 * (place[:, None] + self.bore_angle)), 0.0)
        share = np.where(on_axis, 0.5, 1.0)[..., None]
        return replace(self, bore=share * self.bore)

    def on(self, ring: QuadraticRing) -> Array:
        """Work-equivalent nodal forces (n, 2) [N] on a mesh of the same sectors."""
        nodal = np.zeros_like(ring.points)
        _spread(nodal, ring.bore, self.bore_angle, self.bore)
        for side, chain in enumerate(ring.flanks):
            _spread(nodal, chain, self.station, self.flank[:, side])
        return nodal


def load_on_bore(model: SectorModel, state: State) -> Array:
    """What the load exerts on the bore nodes, conjugate to their best-fit rotation.

    Returns:
        Forces (N, n, 2) [N].
    """
    nodes = model.skeleton(state)[:, model.bore_nodes]
    _, gradient = model.best_fit_rotation(nodes)
    return np.asarray(state.holding_torque / model.copies * gradient)


def _spread(nodal: Array, chain: Chain, parameter: Array, force: Array) -> None:
    nodes, weights = chain.at(parameter)
    there = nodes[..., 0] >= 0
    share = weights[..., None] * force[:, :, None, :]
    np.add.at(nodal, nodes[there], share[there])


def _seen(values: Array, chain: Chain, parameter: Array) -> Array:
    """Nodal values at points of a chain, NaN outside the part."""
    nodes, weights = chain.at(parameter)
    found = np.einsum("nw,snwi->sni", weights, values[nodes])
    found[nodes[..., 0] < 0] = np.nan
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """One state in both codes."""

    model: SectorModel
    state: State
    ring: QuadraticRing
    fields: Fields
    """What CalculiX found, in mm and MPa."""
    forces: Forces
    nodal: Array
    """The forces at its nodes (n, 2) [N]."""
    quarter: bool
    """Whether axes of symmetry hold the ring."""

    @cached_property
    def shape(self) -> tuple[Array, Array]:
        """CalculiX minus ours at our bore nodes, radial and tangential (n,) [m].

        Where no axis of symmetry holds the ring, without the rigid rotation, of which
        the forces say nothing.
        """
        nodes = self.model.bore_nodes
        start = self.model.reference[:, nodes]
        ours = self.model.skeleton(self.state)[:, nodes] - start
        theirs = _seen(self.fields.displacement, self.ring.bore, self.forces.bore_angle)
        there = ~np.isnan(theirs[..., 0])
        start, difference = start[there], (theirs * mm - ours)[there]
        unit = start / np.hypot(*start.T)[:, None]
        radial = np.einsum("ni,ni->n", difference, unit)
        tangential = np.einsum("ni,ni->n", difference, rotate_right_angle(unit))
        if not self.quarter:
            tangential = tangential - tangential.mean()
        return radial, tangential

    @property
    def angle(self) -> Array:
        """Of the nodes of the shape from the +y axis, increasing (n,) [rad]."""
        x, y = np.moveaxis(self.model.reference[:, self.model.bore_nodes], -1, 0)
        nodes, _ = self.ring.bore.at(self.forces.bore_angle)
        return np.unwrap(np.arctan2(-x, y)[nodes[..., 0] >= 0])

    @property
    def two_lobe(self) -> float:
        """Radial difference a cos 2 phi from the lobes; a < 0: ours is softer [m]."""
        phi = self.angle - self.state.wave_generator_angle
        return float(self.shape[0] @ np.cos(2 * phi) / np.sum(np.cos(2 * phi) ** 2))

    @cached_property
    def root_stress(self) -> tuple[float, float]:
        """Largest principal stress of the root fillets, ours and CalculiX [Pa]."""
        return self._ours_root(), self._theirs_root()

    def _ours_root(self) -> float:
        mesh = self.model.element.mesh
        root = mesh.flank_stations >= root_start(self.model)
        nodes = np.concatenate([mesh.flank_right[root], mesh.flank_left[root]])
        stress = flexspline_stress(self.model, self.state)[:, nodes]
        return float(stress_maxima(stress)[0].max())

    def _theirs_root(self) -> float:
        found = []
        for chain in self.ring.flanks:
            side = chain.nodes[:, chain.parameter[:-1] >= root_start(self.model)]
            nodes = np.unique(side[side >= 0])
            found.append(stress_maxima(self.fields.stress[nodes])[0].max())
        return float(max(found)) * MPa

    @property
    def rotation(self) -> float:
        """Best-fit rotation of the bore in CalculiX [rad]."""
        chain, angle = self.ring.bore, self.forces.bore_angle
        moved = _seen(self.fields.displacement, chain, angle) * mm
        start = self.model.reference[:, self.model.bore_nodes]
        return self.model.best_fit_rotation(start + moved)[0]

    @property
    def moment(self) -> float:
        """Moment of all forces about the axis in CalculiX's deformed shape [N m]."""
        place = self.ring.points + self.fields.displacement * mm
        return float(np.einsum("ni,ni->", rotate_right_angle(place), self.nodal))


def root_start(model: SectorModel) -> float:
    """Arc length at which the fillet of the flexspline's teeth begins [m]."""
    return model.element.profile.range_of("root", "root")[0]


def replay(
    design: Design,
    model: SectorModel,
    state: State,
    folder: Path,
    *,
    element: str,
    refinement: float,
    quarter: bool,
) -> Replay:
    """Apply the contact forces of a state to the same flexspline.

    Args:
        design: The drive.
        model: Its model, half of the ring or all.
        state: A converged state.
        folder: Where the files of CalculiX go.
        element: CPE8R converges fastest in the shape, CPE8 in stress at a surface.
        refinement: Of its mesh.
        quarter: Whether the state is symmetric to both axes; then a quarter is enough.
    """
    ring = quadratic_ring(
        model.element.profile,
        design.flexspline.rim_mm * mm,
        refinement,
        sectors=model.sectors,
        quarter=quarter,
    )
    forces = Forces.of(model, state)
    if quarter:
        forces = forces.halved_on_axes(model.place)
    nodal = forces.on(ring)
    if quarter:
        supports = symmetry(ring)
    else:
        # the image of a node carries its load in the half that is left out
        nodal, supports = closure(ring, nodal, model.closure)
    deck = flexspline_deck(design, ring, element) + supports
    deck += "*STEP, NLGEOM, INC=100\n*STATIC\n1.0, 1.0\n" + calculix.CONTROLS
    deck += calculix.load_block(nodal) + calculix.OUTPUT + "*END STEP\n"
    fields = calculix.run(deck, folder, len(ring.points))
    return Replay(
        model=model,
        state=state,
        ring=ring,
        fields=fields,
        forces=forces,
        nodal=nodal,
        quarter=quarter,
    )


def flexspline_deck(design: Design, ring: QuadraticRing, element: str) -> str:
    """Nodes, elements, material and thickness.

    Plane-strain elements with the constants E (1 + 2 nu)/(1 + nu)^2 and nu/(1 + nu) are
    in plane stress, exactly. CalculiX's own CPS8 becomes a solid element of the given
    thickness, which restrains the anticlastic bending of a rim ten times wider than
    thick: 5.5 % too stiff here (55 micrometres), and right only for a slice thinner
    than the mesh is fine.
    """
    steel = design.material_of("flexspline")
    nu = steel.poisson_ratio
    modulus = steel.youngs_modulus * (1.0 + 2.0 * nu) / (1.0 + nu) ** 2
    return (
        calculix.node_block(ring.points / mm)
        + calculix.element_block(element, ring.elements, "FLEXSPLINE")
        + f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{modulus / MPa:.12g}, "
        + f"{nu / (1.0 + nu):.12g}\n"
        + "*SOLID SECTION, ELSET=FLEXSPLINE, MATERIAL=STEEL\n"
        + f"{design.drive.face_width_mm:.12g}\n"
    )


def symmetry(ring: QuadraticRing) -> str:
    """Nodes of a quarter stay on the axes."""
    lines = ["*BOUNDARY"]
    for axis in (0, 1):
        on_axis = np.flatnonzero(np.abs(ring.points[:, axis]) < 1e-12)
        lines += [f"{node + 1}, {axis + 1}" for node in on_axis]
    return "\n".join(lines) + "\n"


def closure(ring: QuadraticRing, nodal: Array, sign: float) -> tuple[Array, str]:
    """Close half a ring by a rotation of 180 deg, and hold one node tangentially.

    A whole ring (no last face) is held at two opposite nodes, without being strained.
    """
    lines = []
    last, first = ring.last_face, ring.first_face
    if (last >= 0).all():
        nodal = nodal.copy()
        nodal[first] += sign * nodal[last]
        nodal[last] = 0.0
        for a, b in zip(last, first, strict=True):
            for axis in (1, 2):
                lines += ["*EQUATION", "2", f"{a + 1},{axis},1.0,{b + 1},{axis},1.0"]
    top = int(np.argmin(np.abs(ring.points - [0.0, ring.points[:, 1].max()]).sum(1)))
    lines += ["*BOUNDARY", f"{top + 1}, 1"]
    return nodal, "\n".join(lines) + "\n"
