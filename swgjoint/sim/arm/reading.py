"""How a scene reads the file of an arm: what moves, and where the rest is held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase


@dataclass(frozen=True, kw_only=True)
class ArmReading:
    """Choices that the file of an arm leaves open."""

    driven: tuple[str, ...] = ()
    """Names or patterns (``*``, ``?``) of the hinges that move; none: all. The ending
    ``_joint`` of a name may be left out."""
    pose: str | None = None
    """Keyframe of the file at which the other joints are held; None: the reference
    position."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Angles of hinges, for those that are held elsewhere than in ``pose`` [rad]."""
    balance_inertia: bool = False
    """Whether the engine repairs inertias that no rigid body can have: the three
    principal moments become their mean."""

    def drives(self, hinge: str) -> bool:
        """Whether a hinge is among those that move."""
        return not self.driven or matches(hinge, self.driven)


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Whether a joint fits one of the patterns, with or without its ending ``_joint``.

    Upper and lower case differ.
    """
    names = {name, name.removesuffix("_joint")}
    return any(fnmatchcase(one, pattern) for one in names for pattern in patterns)


def patterns_of(texts: Sequence[str]) -> tuple[str, ...]:
    """Patterns of comma-separated texts, e.g. ``["shoulder*,elbow", "wrist_1"]``."""
    parts = (part.strip() for text in texts for part in text.split(","))
    return tuple(dict.fromkeys(part for part in parts if part))
