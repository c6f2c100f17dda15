"""Select the cheapest drives of an arm that meet a specification.

1. Drives whose ratings, input speed, stiffness or life the loads of the rigid arm
   exceed are dropped at their joint.
2. Sets of the others are simulated in the order of their cost, unless their predicted
   tool error is too large, until one meets the specification.
3. A drive that clearly misses a limit of its joint in a simulation is dropped at this
   joint. The deviation of its link replaces the predicted one.
4. If a simulation fails, each of its drives is simulated with the stiffest drives at
   the other joints, and dropped if that fails as well.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from decimal import Decimal

import mujoco
import numpy as np

from swgjoint.drives.references import given_drives
from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.select.evaluation import (
    RESONANCE,
    SimulatedSet,
    evaluate_set,
    scene_of_set,
)
from swgjoint.explore.select.loads import (
    RATINGS,
    LimitCheck,
    check_loads,
    find_excess,
    rigid_tasks,
)
from swgjoint.explore.select.options import DriveOption, check_options
from swgjoint.explore.select.prediction import (
    TRUST_SIMULATED,
    ToolPrediction,
    resonance_test,
)
from swgjoint.explore.select.result import (
    CAREFUL,
    DriveSelection,
    ScreenedDrive,
    describe_nearest,
    explain_failure,
)
from swgjoint.explore.select.search import (
    Cost,
    QuadraticBound,
    SetSearch,
    descend,
    predict_squared,
)
from swgjoint.progress import Progress, silent
from swgjoint.sim.figures.keys import LOWER, UPPER
from swgjoint.sim.figures.resonance import LOCKED, inertia_factors
from swgjoint.sim.scene.cycle_section import CycleTask
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import mm
from swgjoint.view.run import run_scene

_OF_OTHERS = ("von_mises_MPa", "wall_s", "fatigue_safety_factor", "real_time_factor")
LIMITED = tuple(key for key in (*UPPER, *LOWER) if key not in _OF_OTHERS)
"""Figures that a specification may limit."""
CLEAR = 1.05
"""Use of a limit above which a drive misses it in any set."""
OFTEN = 3
"""Number of sets in which a drive misses a limit of its joint, after which it is not
tried again."""
ALMOST = 0.99
"""Share of the limit of the resonance below which a set is not simulated. The
resonance of a set is that of its simulation, apart from the choice of poses."""
MOST = 300
"""Largest number of simulated sets."""
_STAGE = "simulated sets"

Places = tuple[int, ...]
"""Index of the option of every joint among those that carry the loads."""


def select_drives(
    scene: Scene,
    options: Sequence[DriveOption],
    *,
    spec: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> DriveSelection:
    """Select the cheapest set of drives that meets a specification in a scene.

    Among sets of equal cost, the one with the smaller largest use of a limit under the
    loads of the rigid arm, summed over the joints, is tried first.

    Args:
        scene: Arm, task and controller. Its drives are replaced; without a duty cycle,
            its motion is repeated for the life.
        options: Drives to select from, see
            :func:`swgjoint.explore.select.options.read_options`.
        spec: Limits by figure, of :data:`LIMITED`.
        progress: Called after every simulation.

    Raises:
        InputError: If the scene or an option cannot be used, or if the scene lacks a
            limited figure of the tool.
        ComputationError: If bodies collide, or if the search is too long.
    """
    check_options(options)
    if not scene.cycle:
        scene = scene.model_copy(update={"cycle": [CycleTask(name=scene.name)]})
    selector = _Selector(scene, tuple(options), {**RATINGS, **(spec or {})}, progress)
    with _quiet_engine():
        return selector.run()


@contextmanager
def _quiet_engine() -> Iterator[None]:
    """Hide warnings of the engine about runs that diverge, which are reported."""
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


class _Selector:
    """State of one selection."""

    def __init__(
        self,
        scene: Scene,
        options: tuple[DriveOption, ...],
        spec: dict[str, float],
        progress: Progress,
    ) -> None:
        self.scene, self.spec, self.progress = scene, spec, progress
        own, cycle = rigid_tasks(scene)
        self.joints = own.arm.joints
        self.drives: dict[str, tuple[ScreenedDrive, ...]] = {}
        for j, name in enumerate(self.joints):
            life = scene.joint_settings(name).life
            screened = []
            for option in options:
                checks = check_loads(own, cycle, j, option, spec, life)
                excess = find_excess(checks)
                screened.append(
                    ScreenedDrive(option=option, checks=checks, excess=excess)
                )
            self.drives[name] = tuple(screened)
        self.kept = [
            [one for one in drives if one.excess is None]
            for drives in self.drives.values()
        ]
        self.costs = [[_cost_of(one) for one in kept] for kept in self.kept]
        self.prediction: ToolPrediction | None = None
        self.keys: tuple[str, ...] = ()
        if all(self.kept) and own.arm.tool >= 0:
            self.prediction = ToolPrediction(
                own, [[one.option for one in kept] for kept in self.kept]
            )
            self.keys = tuple(key for key in self.prediction.keys if key in spec)
        levels = [scene.joint_settings(name).level for name in self.joints]
        self.soft = np.array([level not in LOCKED for level in levels])
        self.factors = inertia_factors(own.arm, own.trajectory.position, self.soft)
        self.ratio = dict.fromkeys(self.keys, 1.0)
        self.dropped: dict[str, dict[str, LimitCheck | str]] = {
            name: {} for name in self.joints
        }
        self.misses: dict[tuple[int, int], int] = {}
        self.tried: dict[Places, SimulatedSet] = {}

    def run(self) -> DriveSelection:
        """Find the cheapest set, or the reason why there is none."""
        for name, kept in zip(self.joints, self.kept, strict=True):
            if not kept:
                over = {one.option.drive: one.excess for one in self.drives[name]}
                why = f"no drive carries the task; {describe_nearest(over)}"
                return self._result(None, f"{name}: {why}")
        while len(self.tried) < MOST:
            chosen = self._cheapest()
            if chosen is None:
                chosen = self._most_accurate()
            if chosen is None:
                return self._result(
                    None,
                    explain_failure(
                        self.dropped, self._remaining(), self.tried.values()
                    ),
                )
            if chosen not in self.tried:
                self._simulate(chosen)
            if self.tried[chosen].met:
                self.progress(_STAGE, len(self.tried), len(self.tried))
                return self._result(self.tried[chosen], "")
            if self.tried[chosen].reasons:
                failure = self._test_drives(chosen)
                if failure:
                    return self._result(None, failure)
        self.progress(_STAGE, MOST, MOST)
        return self._result(
            None, f"none of the {MOST} simulated sets meets the spec; others may"
        )

    def _remaining(self) -> list[list[int]]:
        """Options that are not dropped, by joint."""
        return [
            [
                k
                for k, one in enumerate(kept)
                if one.option.drive not in self.dropped[name]
            ]
            for name, kept in zip(self.joints, self.kept, strict=True)
        ]

    def _cheapest(self) -> Places | None:
        """The cheapest set that is not known to miss a limit; None without one."""
        remaining = self._remaining()
        if not all(remaining):
            return None
        first = np.cumsum([0, *map(len, self.kept)])[:-1]
        rows = np.concatenate(
            [a + np.array(own) for a, own in zip(first, remaining, strict=True)]
        )
        bounds = []
        for key in self.keys:
            assert self.prediction is not None
            largest = self.spec[key] * mm / self.ratio[key]
            if len(self.tried) >= CAREFUL:
                largest = self.spec[key] * mm * TRUST_SIMULATED
            form = self.prediction.form_of(key)[np.ix_(rows, rows)]
            bounds.append(QuadraticBound(form=form, largest=largest**2))
        skipped = set()
        for chosen, one in self.tried.items():
            if not one.met and all(map(list.__contains__, remaining, chosen)):
                skipped.add(tuple(map(list.index, remaining, chosen)))
        costs = [
            [own[k] for k in indices]
            for own, indices in zip(self.costs, remaining, strict=True)
        ]
        found = SetSearch(costs, bounds).find_cheapest(
            skipped, self._resonance_test(remaining)
        )
        if found is None:
            return None
        return tuple(own[k] for own, k in zip(remaining, found, strict=True))

    def _resonance_test(
        self, remaining: Sequence[Sequence[int]]
    ) -> Callable[[dict[int, int]], bool]:
        """Whether some drives leave the resonance above its limit."""
        if RESONANCE not in self.spec or not self.soft.any():
            return lambda options: True
        stiffness = [
            [kept[k].option.map.mean_stiffness for k in own]
            for kept, own in zip(self.kept, remaining, strict=True)
        ]
        return resonance_test(
            self.factors, self.soft, stiffness, ALMOST * self.spec[RESONANCE]
        )

    def _most_accurate(self) -> Places | None:
        """The set of the least tool error or highest resonance, unless simulated.

        Its simulation proves that no set meets the limit, or corrects the prediction.
        """
        remaining = self._remaining()
        if not all(remaining):
            return None
        stiffest, sizes = self._stiffest(), list(map(len, self.kept))
        sets = [stiffest] if RESONANCE in self.spec else []
        for key in self.keys:
            assert self.prediction is not None
            form = self.prediction.form_of(key)
            sets.append(descend(form, sizes, remaining, stiffest))
        return next((one for one in sets if one not in self.tried), None)

    def _stiffest(self) -> Places:
        """The stiffest remaining drive of every joint, the cheaper one of equals."""
        return tuple(
            max(
                own,
                key=lambda k: (
                    kept[k].option.map.mean_stiffness,
                    -kept[k].option.cost,
                ),
            )
            for kept, own in zip(self.kept, self._remaining(), strict=True)
        )

    def _simulate(self, chosen: Places) -> None:
        """Simulate a set and learn from it."""
        options = [kept[k].option for kept, k in zip(self.kept, chosen, strict=True)]
        one = SimulatedSet(
            drives=dict(zip(self.joints, (o.drive for o in options), strict=True)),
            cost=float(sum((o.cost for o in options), Decimal(0))),
            predicted={key: self._predict(key, chosen) for key in self.keys},
        )
        scene = scene_of_set(self.scene, self.joints, options)
        known = given_drives({option.drive: option.map for option in options})
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore" if self.tried else "default")
                run = run_scene(scene, drives=known)
        except ComputationError as error:
            one = replace(one, reasons=(str(error),))
        else:
            one = evaluate_set(one, run, self.spec)
            self._require_tool_figures(one)
        self.tried[chosen] = one
        self._learn(chosen, one)
        self.progress(_STAGE, len(self.tried), MOST)

    def _require_tool_figures(self, one: SimulatedSet) -> None:
        """Check that the motion has all limited figures of the tool.

        Raises:
            InputError: If it has not, so that no set can meet the spec.
        """
        absent = [key for key, value in one.figures[""].items() if value is None]
        if absent and one.run is not None:
            missing = one.run.metrics()["tool"]["missing"]
            why = missing.get(absent[0].removeprefix("tool_"), missing.get("tool", ""))
            raise InputError(
                f"{absent[0]}: scene {self.scene.name!r} has no such figure"
                f"{': ' if why else ''}{why}"
            )

    def _predict(self, key: str, chosen: Places) -> float:
        """Predicted tool error [mm]."""
        assert self.prediction is not None
        form = self.prediction.form_of(key)
        sizes = list(map(len, self.kept))
        return float(np.sqrt(predict_squared(form, sizes, chosen))) / mm

    def _learn(self, chosen: Places, one: SimulatedSet) -> None:
        """Drop drives that miss a limit of their joint; correct the prediction."""
        for miss in one.missed:
            if miss.joint is None:
                continue
            j = self.joints.index(miss.joint)
            place = (j, chosen[j])
            self.misses[place] = self.misses.get(place, 0) + 1
            if miss.check.use > CLEAR or self.misses[place] >= OFTEN:
                self.dropped[miss.joint][one.drives[miss.joint]] = miss.check
        for name, fault in one.faults.items():
            self.dropped[name][one.drives[name]] = fault
        if one.run is None or self.prediction is None:
            return
        self.prediction.learn(chosen, one.run)
        for key in self.keys:
            # the deviations of all joints are now those of the run
            simulated, value = one.figures[""][key], self._predict(key, chosen)
            if simulated and value:
                self.ratio[key] = min(self.ratio[key], simulated / value)

    def _test_drives(self, chosen: Places) -> str:
        """Simulate the drives of a failed set among the stiffest drives.

        Returns:
            The reason if that is no test, because these fail as well; else empty.
        """
        if not all(self._remaining()):
            return ""
        best = self._stiffest()
        if best not in self.tried:
            self._simulate(best)
        if reasons := self.tried[best].reasons:
            return f"not even the stiffest drives can be simulated: {reasons[0]}"
        for j, k in enumerate(chosen):
            name, drive = self.joints[j], self.kept[j][k].option.drive
            trial = (*best[:j], k, *best[j + 1 :])
            if drive in self.dropped[name] or k == best[j]:
                continue
            if trial not in self.tried:
                self._simulate(trial)
            if reasons := self.tried[trial].reasons:
                self.dropped[name][drive] = reasons[0]
        return ""

    def _result(self, winner: SimulatedSet | None, failure: str) -> DriveSelection:
        run = None if winner is None else winner.run
        return DriveSelection(
            name=self.scene.name,
            spec=self.spec,
            drives=self.drives,
            simulated=tuple(self.tried.values()),
            dropped=self.dropped,
            winner=winner,
            scene=None if run is None else run.assembly.scene,
            failure=failure,
        )


def _cost_of(one: ScreenedDrive) -> Cost:
    """Cost of a drive, and its largest use of a limit for drives of equal cost."""
    use = max((check.use for check in one.checks), default=0.0)
    return one.option.cost, Decimal(f"{min(use, 1e6):.6f}")
