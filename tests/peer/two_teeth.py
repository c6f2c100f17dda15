"""Two neighbouring teeth of a state in space on finer meshes, in both codes.

A quarter of a cup on a finer mesh is beyond CalculiX on an ordinary machine. Two teeth
are not: their outer faces and the section to the cup move as our masters say, the bore
carries the forces of our wave generator, and the root between them is free. So each
code shows how much its mesh changes the stress there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree
from skfem import MeshHex
from solid_replay import CORNERS, INSIDE, MPa

from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.strip.elasticity import solid, stress_maxima
from swgjoint.fe.solid.strip.masters import Orders, strip_masters
from swgjoint.fe.solid.strip.mesh import StripMesh, flexspline_strip
from swgjoint.gear.design.design import Design
from swgjoint.units import mm

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoTeeth:
    """Mesh, prescribed motion and forces in a frame that turns with both teeth."""

    mesh: MeshHex
    held: Index
    motion: Array
    """Of the held nodes (n_held, 3) [m]."""
    force: Array
    """On all nodes (n, 3) [N]."""
    root: Index
    """Surface of the root between the teeth."""

    def ours(self, design: Design) -> Array:
        """Nodal stress in our elements, small displacements (n, 6) [Pa].

        By conjugate gradients: so much is held that they need no better preconditioner.
        """
        steel = design.material_of("flexspline")
        body = solid(self.mesh, steel.youngs_modulus, steel.poisson_ratio)
        u = np.zeros(self.force.size)
        held = (3 * self.held[:, None] + np.arange(3)).ravel()
        u[held] = self.motion.ravel()
        free = np.setdiff1d(np.arange(len(u)), held)
        matrix = body.stiffness.tocsc()
        rest = self.force.ravel()[free] - matrix[free][:, held] @ u[held]
        system = matrix[free][:, free].tocsr()
        scale = sparse.diags_array(1.0 / system.diagonal())
        u[free], failed = cg(system, rest, rtol=1e-8, M=scale)
        assert not failed
        return np.asarray(body.stress @ u).reshape(-1, 6)

    def theirs(self, design: Design, folder: Path) -> Array:
        """The same in C3D8I of CalculiX, large displacements."""
        steel = design.material_of("flexspline")
        points = np.asarray(self.mesh.p).T / mm
        deck = "*NODE\n" + calculix.numbered(
            1, ([f"{x:.12g}" for x in point] for point in points)
        )
        deck += calculix.element_block(
            "C3D8I", np.asarray(self.mesh.t).T[:, CORNERS], "TEETH"
        )
        deck += (
            "*MATERIAL, NAME=STEEL\n*ELASTIC\n"
            f"{steel.youngs_modulus / MPa:.12g}, {steel.poisson_ratio:.12g}\n"
            "*SOLID SECTION, ELSET=TEETH, MATERIAL=STEEL\n"
            "*STEP, NLGEOM\n*STATIC\n1.0, 1.0\n" + calculix.CONTROLS + "*BOUNDARY\n"
        )
        for node, move in zip(self.held, self.motion / mm, strict=True):
            deck += "".join(
                f"{node + 1}, {k + 1}, {k + 1}, {value:.12g}\n"
                for k, value in enumerate(move)
            )
        deck += calculix.load_block(self.force)
        deck += "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
        return calculix.run_solid(deck, folder, len(points)).stress * MPa

    def root_stress(self, stress: Array) -> float:
        """Largest principal stress between the teeth [Pa]."""
        return float(stress_maxima(stress[self.root])[0].max())


def two_teeth(
    design: Design,
    ring: SolidSectorModel,
    state: SolidState,
    sector: int,
    *,
    refinement: float,
    orders: Orders | None = None,
) -> TwoTeeth:
    """Teeth of a sector and of the next one.

    Args:
        design: The drive.
        ring: Its model.
        state: Without tooth contact.
        sector: The clockwise one of both.
        refinement: Of the mesh.
        orders: Those of the model.
    """
    finer = design.with_changes({"mesh.refinement": refinement})
    strip = flexspline_strip(finer, ring.strip.profile)
    follow = strip_masters(strip, orders).segments[0]
    teeth, frames = ring.strip.teeth, ring.frames(state)[0]
    assert len(follow.masters) == len(teeth.masters)
    pitch = 2.0 * np.pi / ring.strip.sectors
    turn = about_z(pitch * np.array([-0.5, 0.5]))
    both = slice(sector, sector + 2)
    # the frame that fits the masters of both teeth best
    still = np.einsum("sij,aj->sai", turn, teeth.position).reshape(-1, 3)
    now = ring.masters(state)[both][:, teeth.masters].reshape(-1, 3)
    centres = still.mean(axis=0), now.mean(axis=0)
    left, _, right = np.linalg.svd((now - centres[1]).T @ (still - centres[0]))
    frame = left @ right
    moved = (now - centres[1]) @ frame - (still - centres[0])
    moved = moved.reshape(2, -1, 3)
    force = teeth.nodal_force(ring.loads(state))[both, ring.strip.flank_dofs :]
    force = force.reshape(2, -1, 3)
    force = np.einsum("sij,spj->spi", frames.turn[both], force) @ frame
    spread = _spread(ring.strip.mesh, strip)

    segment, size = strip.teeth.segment, strip.teeth.segment.mesh.p.shape[1]
    points = np.asarray(segment.mesh.p).T
    every = np.concatenate([points @ part.T for part in turn])
    apart = cKDTree(every).query_ball_point(every, 1e-9)
    leader = np.array([min(group) for group in apart])
    used, number = np.unique(leader, return_inverse=True)
    cells = np.concatenate([np.asarray(segment.mesh.t).T + k * size for k in (0, 1)])
    nodal, motion = np.zeros((len(used), 3)), np.full((len(used), 3), np.nan)
    assert segment.end is not None
    for k, outer in enumerate((segment.first, segment.last)):
        bore = number[strip.teeth.bore.ravel() + k * size]
        np.add.at(nodal, bore, spread @ force[k])
        at = np.union1d(outer, segment.end.ravel())
        row = follow.weight[np.searchsorted(follow.boundary, at)]
        motion[number[at + k * size]] = row @ moved[k]
    held = np.flatnonzero(np.isfinite(motion[:, 0]))
    flank = strip.teeth.plane
    surface = np.concatenate([flank.flank_right, flank.flank_left])
    inside = strip.teeth.nodes[np.abs(strip.teeth.z) <= INSIDE + 1e-9][:, surface]
    root = np.unique(number[np.concatenate([inside.ravel(), inside.ravel() + size])])
    p = every[used]
    between = np.abs(np.arctan2(p[root, 0], p[root, 1])) < 0.5 * pitch
    return TwoTeeth(
        mesh=MeshHex(np.ascontiguousarray(p.T), number[cells].T.copy()),
        held=held,
        motion=motion[held],
        force=nodal,
        root=root[between],
    )


def _spread(coarse: StripMesh, fine: StripMesh) -> Array:
    """Nodal forces on a finer bore from those on a coarse one (n_fine, n_coarse).

    Each force acts as a pressure that falls linearly to the neighbours; sums stay.
    """

    def hats(x: Array, y: Array) -> Array:
        near = np.array([np.interp(y, x, unit) for unit in np.eye(len(x))])
        return np.asarray((near / near.sum(axis=1, keepdims=True)).T)

    def around(strip: StripMesh) -> Array:
        x, y = np.asarray(strip.teeth.plane.mesh.p)[:, strip.teeth.plane.bore]
        return np.sort(np.arctan2(x, y))

    turned = hats(around(coarse), around(fine))[1:-1, 1:-1]
    assert np.abs(turned.sum(axis=0) - 1.0).max() < 1e-9
    order = [
        np.argsort(np.arctan2(*np.asarray(s.teeth.plane.mesh.p)[:, s.teeth.plane.bore]))
        for s in (coarse, fine)
    ]
    rank = [np.argsort(part)[1:-1] - 1 for part in order]
    turned = turned[np.ix_(rank[1], rank[0])]
    return np.kron(hats(coarse.teeth.z, fine.teeth.z), turned)
