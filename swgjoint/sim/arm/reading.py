"""Choices of a scene for an arm's file: moving hinges, and pose of held joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase


@dataclass(frozen=True, kw_only=True)
class ArmReading:
    """Choices that the file of an arm leaves open."""

    driven: tuple[str, ...] = ()
    """Names or patterns (``*``, ``?``) of the hinges that move; all if empty. Names may
    omit the suffix ``_joint``."""
    pose: str | None = None
    """Keyframe of the file at which the other joints are held; None holds them at the
    reference position."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Angles of held hinges that differ from ``pose`` [rad]."""
    balance_inertia: bool = False
    """Whether inertias that no rigid body can have are repaired: the mean replaces the
    three principal moments."""

    def drives(self, hinge: str) -> bool:
        """Whether a hinge moves."""
        return not self.driven or matches(hinge, self.driven)


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Whether a joint matches a pattern, with or without its suffix ``_joint``.

    The match is case-sensitive.

    Args:
        name: Name of the joint.
        patterns: Names or patterns (``*``, ``?``).
    """
    names = {name, name.removesuffix("_joint")}
    return any(fnmatchcase(one, pattern) for one in names for pattern in patterns)


def patterns_of(texts: Sequence[str]) -> tuple[str, ...]:
    """Patterns in comma-separated strings, e.g. ``["shoulder*,elbow", "wrist_1"]``."""
    parts = (part.strip() for text in texts for part in text.split(","))
    return tuple(dict.fromkeys(part for part in parts if part))
