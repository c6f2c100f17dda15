"""Controllers with the gains that a tuning run has written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.control.motor_side import MotorPlan
from swgjoint.errors import InputError
from swgjoint.explore.tune.added import LOOP
from swgjoint.explore.tune.gains import (
    CONTROLLERS,
    AddedPID,
    PlannedControl,
    build,
    parts_of,
    weight_plan,
)
from swgjoint.explore.tune.own import OwnController
from swgjoint.files import read_regular
from swgjoint.sim.controller import Controller, Measured, ReadingAge, Task
from swgjoint.typing import Array


class TunedController:
    """A controller of :data:`~swgjoint.explore.tune.gains.CONTROLLERS` with its values.

    It drives a scene, a single environment or a batch. In environments with motor
    loops, its torques are those to be added to the loops. Its natural frequency and
    damping ratio are those of the tuning run, so the gains follow the inertias of each
    joint.
    """

    def __init__(self, tunable: PlannedControl, values: Mapping[str, float]) -> None:
        """Set the values.

        Args:
            tunable: Kind of the controller.
            values: Value of every parameter by key, in the unit of the key.
        """
        self.tunable, self.values = tunable, dict(values)
        self._loop: AddedPID | None = None

    def start(self, task: Task) -> None:
        """Plan the motion with the tuned shares."""
        values = {key: np.asarray(value) for key, value in self.values.items()}
        alone = task.position.ndim == 2
        # plans have an axis of episodes; a scene is one episode
        several = task
        if alone:
            several = replace(
                task,
                position=task.position[:, None],
                velocity=task.velocity[:, None],
                acceleration=task.acceleration[:, None],
                link_torque=task.link_torque[:, None],
            )
        plan = weight_plan(parts_of(self.tunable, several), several, values)
        if alone:
            plan = MotorPlan(
                angle=plan.angle[:, 0], speed=plan.speed[:, 0], torque=plan.torque[:, 0]
            )
        self._loop = build(plan, values, task.joints.torque_limit)
        # the age of the readings is among the tuned values
        self._loop.start(replace(task, reading_age=ReadingAge()))

    def torque(self, k: int, measured: Measured) -> Array:
        """Motor torques [N·m]. Shape (..., n_joints).

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """
        if self._loop is None:
            raise InputError("no motion has begun; call start(task) first")
        return self._loop.torque(k, measured)


def load_controller(
    path: str | Path, candidate: str = "best", *, own: Any = None
) -> Controller:
    """Controller with the gains that ``swgjoint tune`` has written.

    Args:
        path: ``tune.json`` of a tuning run, or the output of its option ``--json``.
        candidate: ``best``, ``baseline``, or the name of a candidate in the file.
        own: Class or function with ``parameters`` that was tuned, if it was your own.
            A file does not tell which code to run.

    Returns:
        The controller, for ``swgjoint.run_scene`` or a loop over an environment. In
        environments with motor loops, its torques are added to those of the loops.

    Raises:
        InputError: If the file is not the result of a tuning run, if it has no such
            candidate, or if the values do not belong to ``own``.
    """
    try:
        content = json.loads(read_regular(Path(path)))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {error}") from error
    rows = content.get("candidates") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{path}: no candidates; accepted: tune.json of swgjoint tune")
    named: dict[Any, Any] = {row.get("name"): row for row in rows}
    named |= {key: content.get(key) for key in ("best", "baseline")}
    if not isinstance(row := named.get(candidate), dict):
        raise InputError(
            f"{path}: candidate {candidate!r}; accepted: {', '.join(map(str, named))}"
        )
    kind = row.get("controller")
    if kind == LOOP.name:
        others = (str(key) for key, one in named.items() if one != row)
        raise InputError(
            f"{path}: {candidate!r} is the {LOOP.name} alone, which adds no torque;"
            f" accepted: {', '.join(others)}"
        )
    if kind in CONTROLLERS:
        tunable = CONTROLLERS[kind]
        values = _values_of(row, tunable.keys, f"{path}: ", candidate, least=0.0)
        if isinstance(tunable, PlannedControl):
            return TunedController(tunable, values)
        return tunable.controller(values)
    if own is None:
        raise InputError(
            f"{path}: controller {kind!r}; accepted: {', '.join(CONTROLLERS)}, or one"
            " of your own with load_controller(path, own=ITS_CLASS)"
        )
    mine = OwnController.from_object(own, str(kind))
    keys = tuple(one.key for one in mine.bounds)
    return mine.controller(_values_of(row, keys, f"{path}: ", candidate, least=-np.inf))


def _values_of(
    row: dict[str, Any], keys: tuple[str, ...], where: str, name: str, *, least: float
) -> dict[str, float]:
    """Checked parameter values of a candidate."""
    values = row.get("parameters")
    if not isinstance(values, dict) or set(values) != set(keys):
        raise InputError(f"{where}parameters of {name!r}; accepted: {', '.join(keys)}")
    if values.get("integral_time_s", 0.0) is None:  # JSON has no infinity
        values["integral_time_s"] = np.inf
    for key, value in values.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not value >= least:
            what = f"a number >= {least:g}" if np.isfinite(least) else "a number"
            raise InputError(f"{where}{key} {value!r}; accepted: {what}")
    return {key: values[key] for key in keys}
