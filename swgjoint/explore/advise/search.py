"""The settings that ``swgjoint advise`` tries, and the choice among them."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.advise.bound import ErrorBound
from swgjoint.explore.advise.reference import FullReference
from swgjoint.joint.attach import LEVELS
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress
from swgjoint.sim.accuracy import (
    SCENE_INTEGRATORS,
    Setting,
    Stepper,
    assemble_setting,
    attempt_assembled,
    errors,
    relative_cost,
    rigid_arm,
)
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.scene.scene import Scene

FLAT = 0.9
"""Threshold for the error divided by the error at the next longer step [-]. Above it
the model error of the level dominates, and shorter steps of that level are not tried.
"""
ALIKE = 1.05
"""Factor within which two costs count as equal, because timing cannot resolve smaller
differences [-]."""
FEWEST = {"discrete": 0.4, "RK4": 1.5}
"""Lower bound of the cost at a step of 1 ms, by integrator [-]; it determines the order
in which costs are measured."""


def choose_row(rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The cheapest row within the bound; None if no row is within it.

    Among rows of equal cost (see :data:`ALIKE`) the one with the lowest level wins,
    then the one with the smallest error. Scatter of the timing therefore rarely changes
    the advice.
    """
    within = [row for row in rows if row["within"]]
    least = min((row["cost"] for row in within), default=np.inf)
    return min(
        (row for row in within if row["cost"] <= ALIKE * least),
        key=lambda row: (LEVELS.index(row["level"]), row["error"]),
        default=None,
    )


@dataclass(frozen=True, kw_only=True)
class SettingSearch:
    """Search over the settings of one scene, from cheap to costly."""

    scene: Scene
    bound: ErrorBound
    drives: Mapping[str, DriveMap]
    """Maps by drive reference."""
    reference: FullReference

    def run(
        self, levels: Sequence[str], steps: Sequence[float], progress: Progress
    ) -> list[dict[str, Any]]:
        """Run settings in the order of their cost until one is within the bound.

        Settings whose cost equals that of this setting within :data:`ALIKE` are also
        run.

        Args:
            levels: Levels to try.
            steps: Steps to try [s].
            progress: Called after every run.

        Returns:
            One row per setting that was run or refused.
        """
        rigid = rigid_arm(self.scene, self.drives)
        settings = [
            Setting(level=level, integrator=integrator, step=step)
            for level in levels
            for integrator in SCENE_INTEGRATORS
            for step in steps
        ]
        heap = [
            (FEWEST[s.integrator] * 1e-3 / s.step, k, s) for k, s in enumerate(settings)
        ]
        heapq.heapify(heap)
        measured: dict[Setting, Assembly] = {}
        last: dict[tuple[str, str], float] = {}
        flat: set[tuple[str, str]] = set()
        rows: list[dict[str, Any]] = []
        most = np.inf
        stage = f"{self.scene.name}: settings"
        progress(stage, 0, len(settings))
        while heap:
            cost, k, setting = heapq.heappop(heap)
            if cost > most:
                break
            key = (setting.level, setting.integrator)
            if key in flat:
                continue
            if setting not in measured:
                try:
                    whole = assemble_setting(self.scene, setting, self.drives)
                except (ComputationError, InputError) as exc:
                    rows.append(self._row(setting, None, None, "refused", str(exc)))
                    continue
                measured[setting] = whole
                cost = relative_cost(Stepper.from_assembly(whole), rigid)
                heapq.heappush(heap, (cost, k, setting))
                continue
            row = self._try(setting, measured.pop(setting), cost)
            rows.append(row)
            progress(stage, len(rows), len(settings))
            if row["within"]:
                most = min(most, ALIKE * cost)
            error = row["error"]
            if error is None:
                continue
            # if a shorter step hardly reduces the error, the rest is that of the level
            if setting.level != "full" and error > FLAT * last.get(key, np.inf):
                flat |= {(setting.level, one) for one in SCENE_INTEGRATORS}
            last[key] = error
        progress(stage, len(settings), len(settings))
        return rows

    def _try(self, setting: Setting, whole: Assembly, cost: float) -> dict[str, Any]:
        got = attempt_assembled(whole)
        off = None if got.run is None else errors(got.run, self.reference.run)
        row = self._row(setting, off, cost, got.outcome, got.reason)
        return row | {"sub_steps": whole.sub_steps}

    def _row(
        self,
        setting: Setting,
        off: dict[str, float] | None,
        cost: float | None,
        outcome: str,
        reason: str | None,
    ) -> dict[str, Any]:
        found = {} if off is None else off
        error = found.get(self.bound.quantity)
        return {
            "level": setting.level,
            "integrator": setting.integrator,
            "step_s": setting.step,
            "sub_steps": None,
            "error": error,
            "unit": self.bound.unit,
            "link_angle_arcmin": found.get("link_angle"),
            "tool_position_mm": found.get("tool_position"),
            "cost": cost,
            "within": error is not None
            and error + self.reference.error <= self.bound.value,
            "outcome": outcome,
            "reason": reason,
        }
