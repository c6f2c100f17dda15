"""3D drive without errors over the torque, at positions within a pitch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swgjoint.fe.common.columns.angle_columns import SolvedColumns
from swgjoint.fe.common.following import Unloaded
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.tolerances.rest import loaded_states, unloaded_positions
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors
from swgjoint.gear.wave_generators.wave_generator import has_mirror_symmetry
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PerfectSolid:
    """Equilibria of the 3D drive without errors at positions within a pitch.

    Unlike the drive with errors, it need not be linearised, so that a half model
    suffices.
    """

    follow: SolidContinuation
    """Solver of the drive."""
    positions: Sequence[Unloaded[SolidState]]
    """The drive without load."""
    loaded: Sequence[Mapping[float, SolidState]] = ()
    """States of all positions by torque [N·m] that are known; empty for none."""
    symmetric: bool = False
    """Whether the drive has mirror symmetry, so that only positive torques are solved.
    """

    @classmethod
    def from_design(
        cls, design: Design, phases: int, tick: Callable[[], None] = lambda: None
    ) -> PerfectSolid:
        """The unloaded drive at positions within a pitch.

        Args:
            design: The drive; its errors are ignored.
            phases: Number of positions, equally spaced over a pitch.
            tick: Called after every position.
        """
        ideal, positions = without_errors(design), []
        model = solid_sector_model(ideal, half="auto")
        follow = SolidContinuation(
            model=model, ratio=ideal.ratio, layout=ideal.drive.layout
        )
        for position in unloaded_positions(follow, ideal, phases):
            positions.append(position)
            tick()
        symmetric = has_mirror_symmetry(ideal)
        return cls(follow=follow, positions=positions, symmetric=symmetric)

    @classmethod
    def from_columns(
        cls,
        solved: SolvedColumns[SolidState],
        phases: int,
        tick: Callable[[], None] = lambda: None,
    ) -> PerfectSolid | None:
        """The drive at positions within a pitch that are solved already.

        Args:
            solved: Equilibria over a pitch.
            phases: Number of positions, equally spaced over a pitch.
            tick: Called after every position.

        Returns:
            None if a position is missing.
        """
        places = [solved.finest * k / phases for k in range(phases)]
        if not solved.columns.keys() >= set(places):
            return None
        columns = [solved.columns[place] for place in places]
        for _ in columns:
            tick()
        assert isinstance(solved.follow, SolidContinuation)
        return cls(
            follow=solved.follow,
            positions=[column.rest for column in columns],
            loaded=[column.states for column in columns],
            symmetric=solved.signs == [1.0],
        )

    def under_both_signs(
        self, levels: Array, tick: Callable[[int], None] = lambda parts: None
    ) -> list[dict[float, SolidState]]:
        """States of all positions by torque [N·m], of both signs.

        The mirror image of a position is the one as far before the end of the pitch, or
        itself at the first one, at the opposite torque.

        Args:
            levels: Magnitudes of the torques, increasing (n_levels,) [N·m].
            tick: Called with the number of torques that are done or left out.
        """
        found = list[dict[float, SolidState]]()
        for k, rest in enumerate(self.positions):
            both = rest.sides or (rest.state, rest.state)
            starts = both[:1] if self.symmetric else both
            before = found[-1] if found else None
            known = self.loaded[k] if self.loaded else {}
            states = loaded_states(self.follow, starts, levels, tick, before, known)
            found.append(dict(states))
        if self.symmetric:
            images = [self._mirror(found[-k], k, tick) for k in range(len(found))]
            found = [a | b for a, b in zip(found, images, strict=True)]
        return found

    def _mirror(
        self,
        states: Mapping[float, SolidState],
        number: int,
        tick: Callable[[int], None],
    ) -> dict[float, SolidState]:
        """States of a position by negative torque [N·m]: the mirror images of others.

        Args:
            states: States of the mirrored position by positive torque [N·m].
            number: Number of the position.
            tick: Called with the number of torques.
        """
        angle = self.follow.input_angle(self.positions[number].state)
        images = {}
        for torque, state in states.items():
            image = self.follow.mirror(state)
            assert image is not None
            # whole pitches apart
            images[-torque] = self.follow.predict(image, angle)
        tick(len(states))
        return images

    def table(
        self, loaded: Sequence[Mapping[float, SolidState]], levels: Array
    ) -> Array:
        """Output angle, strain energy and compliance at all torques of both signs.

        They are those of a drive that is linearised at every torque and superposed
        without errors, see :func:`swgjoint.fe.tolerances.sampling.respond_over_torque`.

        Args:
            loaded: States of all positions by torque, see :meth:`under_both_signs`.
            levels: Magnitudes of the torques, increasing (n_levels,) [N·m].

        Returns:
            Output angle [rad], strain energy [J] and compliance [rad/(N·m)]
            (3, n_torques, n_positions).
        """
        columns = [
            _over_torque(self.follow, rest, states, levels)
            for rest, states in zip(self.positions, loaded, strict=True)
        ]
        return np.stack(columns, axis=-1)

    def whole(self, state: SolidState) -> SolidState:
        """State of the whole drive."""
        return state.of_both_halves() if self.follow.model.half else state


def midway(up: Array, down: Array, small: float) -> Array:
    """Middle of a clearance: output angle, strain energy and compliance (3, ...).

    Args:
        up: The same quantities under the torque that takes up the clearance (3, ...).
        down: Those under the opposite torque (3, ...).
        small: That torque [N·m].
    """
    middle = 0.5 * (up + down)
    middle[1] -= 0.5 * small**2 * middle[2]  # energy stored by the small torque
    middle[2] = 0.5 * (down[0] - up[0]) / small
    return np.asarray(middle)


def _over_torque(
    follow: SolidContinuation,
    rest: Unloaded[SolidState],
    loaded: Mapping[float, SolidState],
    levels: Array,
) -> Array:
    """One position, see :meth:`Perfect.table` (3, n_torques)."""

    def figures(state: SolidState) -> Array:
        return np.array([follow.output_angle(state), state.energy, state.compliance])

    unloaded = figures(rest.state)
    if rest.sides is not None:
        up, down = (figures(side) for side in rest.sides)
        unloaded = midway(up, down, rest.small)
    sides = []
    for sign, start in zip((1.0, -1.0), rest.sides or (rest.state,) * 2, strict=True):
        row, rows, last = figures(start), [], start.torque
        for torque in (sign * levels).tolist():
            if torque in loaded:
                row = figures(loaded[torque])
            else:
                # beyond a failed solve, the drive is linear
                added, c = torque - last, row[2]
                row = row + c * np.array([-added, (last + 0.5 * added) * added, 0.0])
            last = torque
            rows.append(row)
        sides.append(rows)
    return np.stack([*sides[1][::-1], unloaded, *sides[0]], axis=1)
