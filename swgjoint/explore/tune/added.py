"""Controllers that only add torques to motor loops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swgjoint.control.error_compensation import ErrorCompensation
from swgjoint.explore.tune.tunable import Act, GainParameter, WithoutGains
from swgjoint.sim.controller import KnownJoints, KnownLoop, Task
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class LoopAlone(WithoutGains):
    """No torque in addition to that of the motor loops."""

    name: str = "motor loop"
    untuned, content = "", ""
    needs: Mapping[str, Any] = field(default_factory=dict)

    def parameters(
        self, joints: KnownJoints, loop: KnownLoop | None
    ) -> tuple[GainParameter, ...]:
        """None.

        Args:
            joints: Unused.
            loop: Unused.
        """
        return ()

    def begin(
        self, values: Mapping[str, Array], task: Task, kept: dict[str, Any]
    ) -> Act:
        """Torques of zero.

        Args:
            values: Empty.
            task: Motions of all episodes.
            kept: Unused.
        """
        zero = np.zeros(task.position.shape[1:])
        return lambda k, measured, alive: zero


@dataclass(frozen=True, kw_only=True)
class Compensation(WithoutGains):
    """Compensation of the kinematic error that ``RippleSuppression-v0`` estimates."""

    name: str = "compensation"
    text: str = (
        "compensation of the kinematic error that RippleSuppression-v0 estimates"
    )
    keys: tuple[str, ...] = (
        "share_order_2",
        "share_order_4",
        "load_share",
        "lead_s",
    )
    """Keys of the tuned parameters."""
    untuned, content = "by rule", ""
    needs: Mapping[str, Any] = field(default_factory=lambda: {"identify": True})

    def parameters(
        self, joints: KnownJoints, loop: KnownLoop | None
    ) -> tuple[GainParameter, ...]:
        """Shares of the two orders and of the torque of the drive, and a lead.

        Args:
            joints: Unused.
            loop: Unused.
        """
        *shares, lead = self.keys
        return (
            *(GainParameter(key=key, low=0.2, high=2.0, neutral=1.0) for key in shares),
            GainParameter(key=lead, low=0.0, high=5e-3, neutral=0.0),
        )

    def controller(self, values: Mapping[str, float]) -> ErrorCompensation:
        """Controller with the given values."""
        return ErrorCompensation(**values)

    def begin(
        self, values: Mapping[str, Array], task: Task, kept: dict[str, Any]
    ) -> Act:
        """Begin the episodes of all candidates.

        Args:
            values: Values of the candidates by key. Shape (n_candidates,) each.
            task: Motions of all episodes.
            kept: Unused.
        """
        count = task.position.shape[1] // len(values["lead_s"])
        each = {key: np.repeat(x, count)[:, None] for key, x in values.items()}
        controller = ErrorCompensation(**each)
        controller.start(task)
        return lambda k, measured, alive: controller.torque(k, measured)


LOOP, COMPENSATION = LoopAlone(), Compensation()
