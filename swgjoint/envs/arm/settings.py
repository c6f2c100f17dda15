"""Arguments of the environment in which an arm tracks a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from pathlib import Path
from typing import Any

from swgjoint.envs.arguments import check_flag, check_number, format_value, is_number
from swgjoint.envs.arm.paths import CURVES
from swgjoint.envs.references import KINDS, QUICKEST
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import SpecimenTolerances
from swgjoint.errors import InputError

ACTIONS = ("torque", "setpoint")
"""Accepted kinds of actions."""
OF_SCENE = "scene"
"""Reference that is the path of the scene."""
HEAVIEST, FARTHEST = 1e3, 1e4
"""Largest mass of a payload [kg], and largest distance of its centre [mm]."""
SHORTEST, LONGEST = 0.5, 600.0
"""Range of the duration of episodes on drawn paths [s]."""


@dataclass(frozen=True, kw_only=True)
class ArmSettings:
    """Arguments of ``ArmTracking-v0``.

    :class:`~swgjoint.envs.arm_tracking.ArmTrackingEnv` describes them.
    """

    scene: str | Path = "ur5e-circle"
    """Name or path of a scene or of an arm."""
    reference: str | tuple[str, ...] = OF_SCENE
    """``scene``, or one or several names in
    :data:`~swgjoint.envs.references.KINDS` and
    :data:`~swgjoint.envs.arm.paths.CURVES`."""
    max_speed_rad_s: float = 0.6
    """Largest joint speed of drawn paths [rad/s]."""
    max_angle_rad: float = 0.5
    """Largest deviation of joint angles from the start on drawn paths [rad]."""
    max_distance_mm: float = 100.0
    """Largest distance of the tool from its start on drawn curves [mm]."""
    payload_kg: float | tuple[float, float] | None = None
    """Payload at the tool, or range of drawn payloads [kg]; None: that of the scene."""
    payload_centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of mass of ``payload_kg`` in the frame of the tool [mm]."""
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
            ("max_speed_rad_s", "rad/s"),
            ("max_angle_rad", "rad"),
            ("max_distance_mm", "mm"),
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
        self._check_reference()
        self._check_payload()

    def _check_reference(self) -> None:
        """Reject what is neither the path of the scene nor kinds of drawn paths."""
        several = isinstance(self.reference, tuple | list) and self.reference
        names = self.reference if several else [self.reference]
        known = (*KINDS, *CURVES)
        fits = all(isinstance(one, str) and one in known for one in names)
        if not fits and self.reference != OF_SCENE:
            raise InputError(
                f"reference {format_value(self.reference)}; accepted: {OF_SCENE!r}, or"
                f" one or several of {', '.join(known)}"
            )
        if fits and not SHORTEST <= self.episode_s <= LONGEST:
            raise InputError(
                f"episode_s {self.episode_s} s with drawn paths; accepted:"
                f" {SHORTEST:g} to {LONGEST:g} s"
            )

    def _check_payload(self) -> None:
        """Reject anything but a mass, a range of masses, or a point."""
        mass, centre = self.payload_kg, self.payload_centre_mm
        if mass is not None:
            ranged = isinstance(mass, tuple | list)
            pair: Any = mass if ranged else (mass, mass)
            good = len(pair) == 2 and all(map(is_number, pair))
            good = good and 0.0 <= pair[0] <= pair[1] <= HEAVIEST
            if not good or (ranged and pair[1] == 0.0):
                raise InputError(
                    f"payload_kg {format_value(mass)} kg; accepted: None, a number from"
                    f" 0 to {HEAVIEST:g}, or a range (smallest, largest) of such"
                    " numbers"
                )
        point = isinstance(centre, tuple | list) and len(centre) == 3
        if not (point and all(map(is_number, centre)) and hypot(*centre) <= FARTHEST):
            raise InputError(
                f"payload_centre_mm {format_value(centre)} mm; accepted: three numbers,"
                f" up to {FARTHEST:g} mm from the tool"
            )
        if mass is None and any(centre):
            raise InputError(
                f"payload_centre_mm {format_value(centre)} mm without payload_kg;"
                " accepted: with payload_kg"
            )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of drawn paths, of which each episode draws one; none for the scene."""
        names = self.reference
        if names == OF_SCENE:
            return ()
        return (names,) if isinstance(names, str) else tuple(names)

    @property
    def payload_bounds(self) -> tuple[float, float]:
        """Smallest and largest stated payload [kg]."""
        mass: Any = self.payload_kg or 0.0
        low, high = mass if isinstance(mass, tuple | list) else (mass, mass)
        return float(low), float(high)

    @property
    def draws_payload(self) -> bool:
        """Whether each episode draws a payload."""
        return isinstance(self.payload_kg, tuple | list)

    @property
    def max_acceleration(self) -> float:
        """Largest joint acceleration of drawn paths [rad/s²]."""
        return self.max_speed_rad_s / QUICKEST
