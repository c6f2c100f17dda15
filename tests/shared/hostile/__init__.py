"""Hostile input files of every kind, drawn from a seed, and the laws they must keep.

``draw("design", 7)`` is always the same case: files and a cheap command that reads
them. :func:`hostile.laws.broken_laws` runs it in this process and says what it breaks.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from hostile import arms, maps, tables, toml_files
from hostile.case import Case

KINDS: dict[str, Callable[[np.random.Generator], tuple[dict[str, bytes], list[str]]]]
KINDS = {
    "map": maps.map_case,
    "map info": maps.info_case,
    "design": toml_files.design_case,
    "scene": toml_files.scene_case,
    "sweep": toml_files.sweep_case,
    "optimisation": toml_files.optimisation_case,
    "spec": toml_files.spec_case,
    "lot": toml_files.lot_case,
    "override": toml_files.override_case,
    "argument": toml_files.argument_case,
    "loop": tables.loop_case,
    "error": tables.error_case,
    "log": tables.log_case,
    "motion": tables.motion_case,
    "arm (MJCF)": arms.mjcf_case,
    "arm (URDF)": arms.urdf_case,
}
"""Per kind of input the function that draws files and arguments."""


def draw(kind: str, seed: int) -> Case:
    """One hostile input: the same files and arguments for the same seed."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    files, argv = KINDS[kind](rng)
    return Case(kind=kind, seed=seed, files=files, argv=tuple(argv))
