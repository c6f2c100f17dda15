"""Arguments of the environment in which an arm tracks a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from swgjoint.envs.arguments import check_flag, check_number, format_value
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import SpecimenTolerances
from swgjoint.errors import InputError

ACTIONS = ("torque", "setpoint")
"""Accepted kinds of actions."""


@dataclass(frozen=True, kw_only=True)
class ArmSettings:
    """Arguments of ``ArmTracking-v0``.

    :class:`~swgjoint.envs.arm_tracking.ArmTrackingEnv` describes them.
    """

    scene: str | Path = "ur5e-circle"
    """Name or path of a scene or of an arm."""
    level: str = "full"
    """Level of the drives: ``full`` or ``linear``."""
    friction: bool = True
    """Whether drives have the friction of their maps."""
    kinematic_error_arcmin: float | None = None
    """Peak-to-peak kinematic error over one output turn [arcmin], or None."""
    action: str = "torque"
    """Kind of the actions, one of :data:`ACTIONS`."""
    authority_of_rated: float = 0.2
    """Largest added motor torque relative to rated torque over ratio [-]."""
    shift_arcmin: float = 10.0
    """Largest shift of the set-points [arcmin]."""
    episode_s: float = 2.0
    """Duration of an episode [s]."""
    sensors: Mapping[str, float] | Sensors | None = None
    """Sensors of every joint; None: the default sensors."""
    randomise: bool | Mapping[str, float] | SpecimenTolerances = False
    """Whether, or with which tolerances, drives and loads vary."""
    normalise: bool = True
    """Whether observations lie between -1 and 1, or have SI units."""
    error_scale_mm: float = 1.0
    """Error scale of the reward [mm]."""
    effort_weight: float = 0.1
    """Effort weight of the reward [-]."""

    def __post_init__(self) -> None:
        for key, unit in (
            ("authority_of_rated", ""),
            ("shift_arcmin", "arcmin"),
            ("episode_s", "s"),
            ("error_scale_mm", "mm"),
        ):
            check_number(key, getattr(self, key), unit, zero=False)
        check_number("effort_weight", self.effort_weight, "", zero=True)
        error = self.kinematic_error_arcmin
        if error is not None:
            check_number("kinematic_error_arcmin", error, "arcmin", zero=True)
        check_flag("friction", self.friction)
        check_flag("normalise", self.normalise)
        if not isinstance(self.scene, str | Path):
            raise InputError(
                f"scene {format_value(self.scene)}; accepted: a name or path of a scene"
                " or of an arm"
            )
        if self.action not in ACTIONS:
            raise InputError(f"action {self.action!r}; accepted: {', '.join(ACTIONS)}")
        if self.level not in ("full", "linear"):
            raise InputError(
                f"level {self.level!r} of an environment; accepted: full, linear"
            )
