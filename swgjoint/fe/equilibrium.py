"""Equilibrium of the flexspline between wave generator and circular spline.

Newton's method on the corotational ring. Contact with the wave generator is a
primal-dual active set on the normal displacement of the bore nodes; tooth contact is a
small complementarity problem on the frozen tangent; everything in the frame of the
circular spline, which is rigid and fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import Outcome
from swgjoint.fe.complementarity import ActiveSetError, solve_mixed
from swgjoint.fe.corotation import (
    Frames,
    elastic_energy,
    projected,
    rotate,
    sector_frames,
    tangent,
    turned,
)
from swgjoint.fe.cyclic import CyclicFactor, SingularRingError
from swgjoint.fe.superelement import Superelement
from swgjoint.fe.tooth_contact import Contacts, ToothContact
from swgjoint.gear.profile import ToothProfile
from swgjoint.gear.wave_generator import WaveGenerator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """One equilibrium, or the start of the search for one. Global frame, SI."""

    faces: Array
    """Positions of the first face of each sector (N, n_face, 2) [m]."""
    bores: Array
    """Positions of the bore nodes inside the sectors (N, n_bore, 2) [m]."""
    pressure: Array
    """Normal force of the wave generator on its nodes (N, n_bore + 1) [N]."""
    touching: Mask
    """Which of those nodes touch."""
    flank_force: Array
    """Tooth forces as nodal forces in the sector frames (N, 2 n_b) [N]."""
    contacts: Contacts | None = None
    tooth_force: Array = field(default_factory=lambda: np.zeros(0))
    """Normal force of every contact [N]. Shape (n_contacts,)."""
    wave_generator_angle: float = 0.0
    rotation: float = 0.0
    """Best-fit rotation of the bore [rad]."""
    torque: float = 0.0
    """Torque T that the flexspline exerts on its load, whole drive [N·m]."""
    wave_generator_torque: float = 0.0
    """External torque on the wave generator, whole drive [N·m]."""
    tooth_moment: float = 0.0
    """Moment of the tooth forces on the flexspline, whole drive [N·m]."""
    energy: float = 0.0
    """Strain energy, whole drive [J]."""
    compliance: float = 0.0
    """Rotation per torque at the active contacts, whole drive [rad/(N·m)]."""
    outcome: Outcome = Outcome.CONVERGED
    history: tuple[float, ...] = ()
    """Largest displacement increment of every iteration [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RingModel:
    """Flexspline ring, wave generator and rigid circular spline."""

    element: Superelement
    wave_generator: WaveGenerator
    circular_spline: ToothProfile
    lobe_height: float
    """Radial deflection at the lobes [m]."""
    half: bool = False
    """Half of the ring, closed by a rotation of 180 deg."""
    nonlinear: bool = True
    max_iterations: int = 80
    step_tolerance: float = 2e-12
    """Displacement increment at which the iteration ends [m]; about 1e-5 of the
    smallest effect of interest, a tenth of a micrometre."""

    @property
    def sectors(self) -> int:
        """Sectors in the model."""
        return self.element.sectors // (2 if self.half else 1)

    @property
    def copies(self) -> int:
        """How many times the model repeats in the drive."""
        return 2 if self.half else 1

    @property
    def closure(self) -> float:
        """Sign that closes the ring: the half model continues as its opposite."""
        return -1.0 if self.half else 1.0

    @cached_property
    def place(self) -> Array:
        """Angles of the sectors in the undeformed ring [rad]."""
        return np.asarray(
            2.0 * pi / self.element.sectors * np.arange(self.sectors), float
        )

    @cached_property
    def reference(self) -> Array:
        """Undeformed skeleton nodes in the global frame (N, n_a, 2) [m]."""
        skeleton = np.broadcast_to(
            self.element.skeleton, (self.sectors, *self.element.skeleton.shape)
        )
        return rotate(skeleton, self.place[:, None])

    @cached_property
    def _bore_nodes(self) -> NDArray[np.int64]:
        size = self.element.face_size
        return np.arange(size - 1, size + self.element.bore_size)

    def skeleton(self, state: State) -> Array:
        """Positions of all skeleton nodes per sector (N, n_a, 2) [m]."""
        last = np.roll(state.faces, -1, axis=0)
        last[-1] *= self.closure
        return np.concatenate([state.faces, state.bores, last], axis=1)

    def frames(self, state: State) -> Frames:
        """Sector frames; at the linear level they turn with the flexspline only."""
        fixed = None
        if not self.nonlinear:
            fixed = np.full(self.sectors, state.rotation)
        return sector_frames(
            self.element, self.skeleton(state), self.place, fixed=fixed
        )

    def at_rest(self, alpha: float = 0.0, rotation: float = 0.0) -> State:
        """Start of a search: the inextensional two-lobe shape of a thin ring.

        Radial w0 cos 2 phi, tangential -w0/2 sin 2 phi, cross-sections turned by
        3 w0 sin 2 phi/(2 r); phi from the major axis.
        """
        element = self.element
        x = self.reference
        radius = np.hypot(x[..., 0], x[..., 1])
        bore = float(radius.min())
        phi = np.arctan2(-x[..., 0], x[..., 1]) - (alpha - rotation)
        w0 = self.lobe_height
        turn = 1.5 * w0 * np.sin(2 * phi) / bore
        radial = w0 * np.cos(2 * phi)
        tangential = -0.5 * w0 * np.sin(2 * phi) + (radius - bore) * turn
        unit = x / radius[..., None]
        moved = x + radial[..., None] * unit + tangential[..., None] * turned(unit)
        moved = rotate(moved, rotation)
        size, inside = element.face_size, element.bore_size
        nodes = moved[:, self._bore_nodes]
        gap, _, _ = self._wave_generator(nodes, alpha)
        return State(
            faces=moved[:, :size],
            bores=moved[:, size : size + inside],
            pressure=np.zeros(gap.shape),
            touching=gap < 0.01 * w0,
            flank_force=np.zeros((self.sectors, 4 * element.flank_size)),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

    def _wave_generator(self, nodes: Array, alpha: float) -> tuple[Array, Array, Array]:
        flat = rotate(nodes.reshape(-1, 2), -alpha)
        gap, normal, curvature = self.wave_generator.signed_distance(flat)
        return (
            gap.reshape(nodes.shape[:-1]),
            rotate(normal, alpha).reshape(nodes.shape),
            (curvature / (1.0 + curvature * gap)).reshape(nodes.shape[:-1]),
        )

    def _rotation(self, nodes: Array) -> tuple[float, Array]:
        """Best-fit rotation of the bore nodes and its gradient (N, n_bore + 1, 2)."""
        x0 = self.reference[:, self._bore_nodes]
        sine = float(np.einsum("sni,sni->", turned(x0), nodes))
        cosine = float(np.einsum("sni,sni->", x0, nodes))
        gradient = (cosine * turned(x0) - sine * x0) / (sine**2 + cosine**2)
        return float(np.arctan2(sine, cosine)), gradient

    def moved(self, state: State, alpha: float, rotation: float) -> State:
        """Predictor: the field turned with the wave generator and the flexspline.

        Displacements in polar components travel with the wave generator through the
        teeth, interpolated between sectors; the flexspline turns rigidly.
        """
        n = self.sectors
        pitch = 2.0 * pi / self.element.sectors
        d_rotation = rotation - state.rotation
        shift = (alpha - state.wave_generator_angle - d_rotation) / pitch
        whole = int(np.floor(shift))
        part = shift - whole
        size, inside = self.element.face_size, self.element.bore_size

        def travel(values: Array, sign: float) -> Array:
            def at(k: int) -> Array:
                out = np.roll(values, k, axis=0).copy()
                turns = (np.arange(n) - k) // n
                out[turns % 2 != 0] *= sign
                return out

            # cubic Lagrange between four neighbouring sectors
            t = part
            return (
                t * (t + 1) * (t - 1) / 6 * at(whole + 2)
                - t * (t - 2) * (t + 1) / 2 * at(whole + 1)
                + (t - 1) * (t - 2) * (t + 1) / 2 * at(whole)
                - t * (t - 1) * (t - 2) / 6 * at(whole - 1)
            )

        local = rotate(
            np.concatenate([state.faces, state.bores], axis=1),
            -(self.place + state.rotation)[:, None],
        )
        # displacements in sector frames repeat after half a turn
        local = (
            travel(local - self.element.skeleton[: size + inside], 1.0)
            + self.element.skeleton[: size + inside]
        )
        x = rotate(local, (self.place + rotation)[:, None])
        nearest = int(np.round(shift))
        return replace(
            state,
            faces=x[:, :size],
            bores=x[:, size:],
            pressure=travel(state.pressure, 1.0),
            touching=np.roll(state.touching, nearest, axis=0),
            flank_force=travel(state.flank_force, 1.0),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

    def solve(
        self,
        start: State,
        *,
        torque: float | None = None,
        rotation: float | None = None,
        teeth: bool = True,
    ) -> State:
        """Equilibrium at the wave-generator angle of ``start``.

        Args:
            start: First guess.
            torque: T that the flexspline exerts on its load [N·m], or
            rotation: the best-fit rotation of the bore [rad]; exactly one of them.
            teeth: Whether the teeth touch.

        Returns:
            The state, with its outcome; not converged states are returned too.
        """
        if (torque is None) == (rotation is None):
            raise ValueError("give either torque or rotation")
        try:
            return self._newton(start, torque, rotation, teeth)
        except ActiveSetError as error:
            bad = (
                Outcome.SINGULAR
                if "singular" in str(error)
                else Outcome.ACTIVE_SET_CYCLES
            )
            return replace(start, outcome=bad)
        except SingularRingError:
            return replace(start, outcome=Outcome.SINGULAR)

    def _newton(
        self,
        state: State,
        torque: float | None,
        rotation: float | None,
        teeth: bool,
    ) -> State:
        element = self.element
        size, n_bore = element.face_size, element.bore_size
        n_a = len(element.skeleton)
        n = 2 * n_a
        bore_nodes = self._bore_nodes
        alpha = state.wave_generator_angle
        anchor_stiffness = float(np.mean(np.diag(element.stiffness)))
        history: list[float] = []
        unchanged = False
        previous: list[bytes] = []

        for iteration in range(self.max_iterations):
            frames = self.frames(state)
            x = self.skeleton(state)
            nodes = x[:, bore_nodes]
            wg_gap, wg_normal, wg_curvature = self._wave_generator(nodes, alpha)
            touching = state.touching

            # elastic forces and tangent in the sector frames
            compliance_force = state.flank_force @ element.flank_compliance
            d_b = frames.displacement @ element.flank_from_skeleton.T + compliance_force
            elastic = frames.displacement @ element.stiffness
            total = elastic - state.flank_force @ element.flank_from_skeleton
            gradient = projected(frames, elastic)
            hessian = tangent(element, frames, total)

            # bases: sector frame -> global, or (normal, tangent) at the bore nodes
            basis = np.broadcast_to(np.eye(2), (self.sectors, n_a, 2, 2)).copy()
            bore = slice(size - 1, size + n_bore)
            basis[:, bore, :, 0] = wg_normal
            basis[:, bore, :, 1] = turned(wg_normal)
            last = np.roll(basis[:, :size], -1, axis=0)
            last[-1] *= self.closure
            basis[:, n_a - size :] = last
            turn = np.moveaxis(
                rotate(np.moveaxis(basis, 3, 2), -frames.angle[:, None, None]), 2, 3
            )
            gradient = _to_basis(turn, gradient)
            hessian = np.einsum(
                "snia,snimj,smjb->snamb",
                turn,
                hessian.reshape(self.sectors, n_a, 2, n_a, 2),
                turn,
                optimize=True,
            ).reshape(self.sectors, n, n)
            # sliding over a curved wave generator turns the contact force
            normal_dof, tangent_dof = 2 * bore_nodes, 2 * bore_nodes + 1
            hessian[:, tangent_dof, tangent_dof] -= (
                np.where(touching, state.pressure, 0.0) * wg_curvature
            )

            psi, psi_gradient = self._rotation(nodes)
            psi_column = np.zeros((self.sectors, n))
            in_basis = np.stack(
                [
                    np.einsum("sni,sni->sn", psi_gradient, wg_normal),
                    np.einsum("sni,sni->sn", psi_gradient, turned(wg_normal)),
                ],
                axis=-1,
            )
            psi_column.reshape(self.sectors, n_a, 2)[:, bore_nodes] = in_basis
            if torque is not None:
                gradient = gradient + torque / self.copies * psi_column

            # normal displacement of the touching nodes is known
            known = np.zeros((self.sectors, n), dtype=bool)
            value = np.zeros((self.sectors, n))
            known[:, normal_dof] = touching
            value[:, normal_dof] = np.where(touching, -wg_gap, 0.0)
            corner = 2 * (n_a - 1)
            known[:, corner] = np.roll(touching[:, 0], -1)
            value[:, corner] = np.roll(value[:, normal_dof[0]], -1)

            anchor = np.zeros((self.sectors, n))
            direction = turned(x[0, 0]) / np.hypot(*x[0, 0])
            anchor[0, :2] = direction
            masked = hessian.copy()
            masked[0, :2, :2] += anchor_stiffness * np.outer(direction, direction)
            masked[known] = 0.0
            masked.transpose(0, 2, 1)[known] = 0.0
            diagonal = np.einsum("sii->si", masked)
            diagonal[known] = anchor_stiffness
            factor = CyclicFactor(masked, 2 * size)

            # candidates of tooth contact
            contacts = None
            rows = np.zeros((0, n))
            if teeth:
                centre = frames.position.reshape(self.sectors, n_a, 2).mean(axis=1)
                search = ToothContact(
                    element=element,
                    circular_spline=self.circular_spline,
                    angle=frames.angle,
                    bearing=frames.angle - np.arctan2(centre[:, 0], centre[:, 1]),
                )
                contacts = search.search(
                    d_b, 2e-5 if iteration > 2 else 1e-4, state.contacts
                )
                rows = self._gap_gradient(frames, contacts, turn)

            m = len(rows)
            free_rows = np.zeros((self.sectors, n, m + 2))
            if contacts is not None:
                free_rows[contacts.sector, :, np.arange(m)] = rows
            free_rows[:, :, m] = anchor
            free_rows[:, :, m + 1] = psi_column
            rhs = -gradient - np.einsum("sij,sj->si", hessian, value)
            columns = np.concatenate([rhs[:, :, None], free_rows], axis=2)
            columns[known] = 0.0
            solved = factor.solve(columns)
            base = solved[:, :, 0] + value
            response = solved[:, :, 1:]

            # unknowns: contact forces, displacement of the anchor, torque multiplier
            matrix = np.empty((m + 2, m + 2))
            offset = np.empty(m + 2)
            if contacts is not None and m:
                matrix[:m] = np.einsum("kn,knl->kl", rows, response[contacts.sector])
                local = contacts.weight @ element.flank_compliance
                same = contacts.sector[:, None] == contacts.sector[None, :]
                matrix[:m, :m] += np.where(same, local @ contacts.weight.T, 0.0)
                offset[:m] = (
                    contacts.gap
                    - np.einsum(
                        "kb,kb->k",
                        contacts.weight,
                        compliance_force[contacts.sector],
                    )
                    + np.einsum("kn,kn->k", rows, base[contacts.sector])
                )
            matrix[m:] = np.einsum("snf,snl->fl", free_rows[:, :, m:], response)
            matrix[:m, m:] = matrix[m:, :m].T
            matrix[m, m] -= 1.0 / anchor_stiffness
            offset[m:] = np.einsum("snf,sn->f", free_rows[:, :, m:], base)
            offset[m + 1] += psi - (rotation or 0.0)
            count = m + (2 if rotation is not None else 1)
            guess = np.zeros(m, dtype=bool)
            if contacts is not None and m:
                guess = offset[:m] < 0.0
                if state.contacts is not None and len(state.tooth_force):
                    guess = _match(contacts, state.contacts)
            multipliers, active = solve_mixed(
                matrix[:count, :count], offset[:count], m, count - m - 1, guess
            )
            force = multipliers[:m]

            step = base + response[:, :, :count] @ multipliers
            shift = np.einsum(
                "snia,sna->sni", basis, step.reshape(self.sectors, n_a, 2)
            )
            largest = float(np.abs(shift).max())
            history.append(largest)
            if not np.isfinite(largest) or largest > 0.1:
                return replace(state, outcome=Outcome.DIVERGED, history=tuple(history))
            damping = min(1.0, self.lobe_height / largest)

            # wave-generator forces from the rows of the known displacements
            residual = gradient + np.einsum("sij,sj->si", hessian, step)
            if m and contacts is not None:
                np.subtract.at(residual, contacts.sector, force[:, None] * rows)
            if rotation is not None:
                residual -= multipliers[m + 1] * psi_column
            pressure = residual[:, normal_dof]
            pressure[:, 0] += np.roll(residual[:, corner], 1)
            pressure = np.where(touching, pressure, 0.0)
            after = wg_gap + step[:, normal_dof]
            wrong = np.where(touching, -pressure / anchor_stiffness, -after)
            bad = wrong > 1e-15
            if iteration >= 25 and bad.any():
                bad = wrong == wrong.max()
            new_touching = touching ^ bad
            unchanged = not bad.any()

            flank_force = np.zeros_like(state.flank_force)
            if contacts is not None and m:
                np.add.at(
                    flank_force, contacts.sector, force[:, None] * contacts.weight
                )
            held = np.flatnonzero(active)
            holding = np.append(held, m)
            reach = matrix[holding, m + 1]
            compliance = matrix[m + 1, m + 1] - reach @ np.linalg.solve(
                matrix[np.ix_(holding, holding)], reach
            )
            # faces and bores of each sector; a shared face appears once
            moved = x + damping * shift
            state = replace(
                state,
                faces=moved[:, :size],
                bores=moved[:, size : size + n_bore],
                pressure=pressure,
                touching=new_touching,
                flank_force=flank_force,
                contacts=contacts.chosen(held) if contacts is not None else None,
                tooth_force=force[held],
                rotation=psi,
                compliance=float(compliance) / self.copies,
                torque=(
                    torque
                    if torque is not None
                    else -self.copies * float(multipliers[m + 1])
                ),
            )
            previous.append(new_touching.tobytes())
            if unchanged and damping == 1.0 and largest < self.step_tolerance:
                return self._finished(state, Outcome.CONVERGED, history)
        cycles = not unchanged
        return self._finished(
            state,
            Outcome.ACTIVE_SET_CYCLES if cycles else Outcome.MAX_ITERATIONS,
            history,
        )

    def _gap_gradient(self, frames: Frames, contacts: Contacts, turn: Array) -> Array:
        """Derivative of the gaps by the skeleton in the given bases (n_contacts, n)."""
        s = contacts.sector
        spin, n = frames.spin[s], frames.spin.shape[1]
        carried = contacts.weight @ self.element.flank_from_skeleton
        j_y = turned(frames.position[s].reshape(len(s), -1, 2)).reshape(len(s), n)
        arm = np.einsum("ki,ki->k", contacts.normal, turned(contacts.point))
        row = carried + spin * (arm - np.einsum("kn,kn->k", carried, j_y))[:, None]
        return _to_basis(turn[s], row)

    def _finished(self, state: State, outcome: Outcome, history: list[float]) -> State:
        frames = self.frames(state)
        nodes = self.skeleton(state)[:, self._bore_nodes]
        _, normal, _ = self._wave_generator(nodes, state.wave_generator_angle)
        arm = np.einsum("sni,sni->sn", turned(nodes), normal)
        psi, _ = self._rotation(nodes)
        moment = 0.0
        if state.contacts is not None:
            c = state.contacts
            arms = np.einsum("ki,ki->k", turned(c.point), c.normal)
            moment = float(state.tooth_force @ arms)
        energy = float(elastic_energy(self.element, frames, state.flank_force).sum())
        return replace(
            state,
            outcome=outcome,
            history=tuple(history),
            rotation=psi,
            wave_generator_torque=self.copies * float(np.sum(state.pressure * arm)),
            tooth_moment=self.copies * moment,
            energy=self.copies * energy,
        )


def _to_basis(turn: Array, rows: Array) -> Array:
    """Row vectors per sector or contact into the bases of the nodes."""
    shaped = rows.reshape(len(rows), -1, 2)
    return np.asarray(np.einsum("sni,snia->sna", shaped, turn)).reshape(rows.shape)


def _match(new: Contacts, old: Contacts) -> Mask:
    """Which of the new candidates lie on a flank that touched before."""
    before = set(zip(old.sector.tolist(), old.side.tolist(), strict=True))
    return np.array(
        [
            key in before
            for key in zip(new.sector.tolist(), new.side.tolist(), strict=True)
        ],
        dtype=bool,
    )
