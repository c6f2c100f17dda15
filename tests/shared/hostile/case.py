"""One input of the command."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Case:
    """Files of a fresh folder and the arguments of a command that reads them."""

    kind: str
    seed: int
    files: dict[str, bytes]
    argv: tuple[str, ...]
