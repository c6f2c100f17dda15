"""The tables ``[[cycle]]`` of a scene file: the tasks of a duty cycle."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from swgjoint.faults import Fault, Section
from swgjoint.sim.scene.feature_sections import Payload
from swgjoint.sim.scene.sections import LoadSection
from swgjoint.sim.scene.trajectory_sections import TrajectorySection

LONGEST = 1_000_000
"""Largest number of occurrences of a task."""


class CycleTask(Section):
    """One task of the duty cycle; absent keys have the values of the scene itself."""

    name: str = ""
    """Name of the task in results."""
    duration_s: Annotated[float, Field(gt=0, le=10_000)] | None = None
    """Duration of one occurrence; if omitted, ``simulation.duration_s``."""
    times: Annotated[int, Field(ge=1, le=LONGEST)] = 1
    """Number of consecutive occurrences in a cycle; the task is simulated once."""
    rest: bool = False
    """Whether the joints stand still on their brakes. A rest has no turns and no load
    changes, so only the mean speed includes it. It needs ``duration_s``."""
    trajectory: TrajectorySection | None = None
    """Commanded motion of this task."""
    load: dict[str, LoadSection] | None = None
    """Constant torques of the load during this task, by joint name."""
    payload: Payload | None = None
    """Body that the arm carries during this task."""

    @model_validator(mode="after")
    def _rests(self) -> Self:
        if self.rest:
            faults = [
                (key, "not used at rest; accepted: without rest = true")
                for key in ("trajectory", "load", "payload")
                if getattr(self, key) is not None
            ]
            if self.duration_s is None:
                faults.append(("duration_s", "missing; a rest needs it"))
            if faults:
                raise Fault(*faults)
        return self

    @property
    def changes(self) -> dict[str, object]:
        """Tables of the scene that this task replaces, by key."""
        return self.model_dump(
            include={"trajectory", "load", "payload"},
            exclude_unset=True,
            exclude_none=True,
        )


def _turning(tasks: list[CycleTask]) -> list[CycleTask]:
    """Check that a duty cycle does not consist of rests only."""
    if tasks and all(task.rest for task in tasks):
        raise ValueError("only rests; accepted: at least one task without rest = true")
    return tasks


Cycle = Annotated[list[CycleTask], AfterValidator(_turning)]
"""Duty cycle: tasks of which at least one is not a rest."""
