"""Controllers with the gains that a tuning run has written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.control.motor_side import MotorPID, MotorPlan
from swgjoint.errors import InputError
from swgjoint.explore.tune.gains import (
    CONTROLLERS,
    Tunable,
    build,
    parts_of,
    weight_plan,
)
from swgjoint.files import read_regular
from swgjoint.sim.controller import Measured, ReadingAge, Task
from swgjoint.typing import Array


class TunedController:
    """A controller of :data:`~swgjoint.explore.tune.gains.CONTROLLERS` with its values.

    It drives a scene, a single environment or a batch. Its natural frequency and
    damping ratio are those of the tuning run, so the gains follow the inertias of each
    joint.
    """

    def __init__(self, tunable: Tunable, values: Mapping[str, float]) -> None:
        """Set the values.

        Args:
            tunable: Kind of the controller.
            values: Value of every parameter by key, in the unit of the key.
        """
        self.tunable, self.values = tunable, dict(values)
        self._loop: MotorPID | None = None

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


def load_controller(path: str | Path, candidate: str = "best") -> TunedController:
    """Controller with the gains that ``swgjoint tune`` has written.

    Args:
        path: ``tune.json`` of a tuning run, or the output of its option ``--json``.
        candidate: ``best``, ``baseline``, or the name of a candidate in the file.

    Returns:
        The controller, for ``swgjoint.run_scene`` or a loop over an environment.

    Raises:
        InputError: If the file is not the result of a tuning run, or if it has no such
            candidate.
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
    if (kind := row.get("controller")) not in CONTROLLERS:
        raise InputError(
            f"{path}: controller {kind!r}; accepted: {', '.join(CONTROLLERS)}"
        )
    tunable = CONTROLLERS[kind]
    values = row.get("parameters")
    if not isinstance(values, dict) or set(values) != set(tunable.keys):
        raise InputError(
            f"{path}: parameters of {candidate!r}; accepted: {', '.join(tunable.keys)}"
        )
    if values.get("integral_time_s", 0.0) is None:  # JSON has no infinity
        values["integral_time_s"] = np.inf
    for key, value in values.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not value >= 0.0:
            raise InputError(f"{path}: {key} {value!r}; accepted: a number >= 0")
    return TunedController(tunable, values)
