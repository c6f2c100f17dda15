"""CalculiX: write a deck of blocks, run it, read displacement and stress back.

Lengths in mm, forces in N, stresses in MPa.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONTROLS = """*CONTROLS, PARAMETERS=FIELD
1e-7, 1e-5, , , , , 1e-9
"""
"""Residual 1e-7 of the mean force and last correction 1e-5 of the increment: the
defaults, 5e-3 and 1e-2, leave errors of micrometres in the shape."""

OUTPUT = """*NODE FILE, OUTPUT=2D
U
*EL FILE, OUTPUT=2D
S
"""


def available() -> bool:
    """Whether there is a ``ccx`` to run."""
    return shutil.which("ccx") is not None


def version() -> str:
    """What ``ccx -v`` says, without the words around it."""
    text = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout
    return text.split("Version")[-1].strip()


def numbered(first: int, rows: Iterable[Sequence[object]]) -> str:
    """Lines of a block, each led by its number."""
    return "".join(
        ", ".join(map(str, (first + i, *row))) + "\n" for i, row in enumerate(rows)
    )


def node_block(points: Array, first: int = 1, name: str = "") -> str:
    """Nodes at plane points [mm]."""
    header = "*NODE" + (f", NSET={name}" if name else "") + "\n"
    rows = ((f"{x:.12g}", f"{y:.12g}", "0.0") for x, y in points)
    return header + numbered(first, rows)


def element_block(
    kind: str, elements: NDArray[np.int64], name: str, first: int = 1, node: int = 1
) -> str:
    """Elements with node numbers from ``node``."""
    return f"*ELEMENT, TYPE={kind}, ELSET={name}\n" + numbered(
        first, (elements + node).tolist()
    )


def load_block(forces: Array) -> str:
    """Nodal forces [N] as *CLOAD, zeros left out."""
    lines = [
        f"{i + 1}, {k + 1}, {forces[i, k]:.12g}\n"
        for i, k in zip(*np.nonzero(forces), strict=True)
    ]
    return "*CLOAD\n" + "".join(lines)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fields:
    """Results at the last increment, by node."""

    displacement: Array
    """(n, 2) [mm]."""
    stress: Array
    """xx, yy, xy (n, 3) [MPa]; in space (n, 3) and xx, yy, zz, xy, yz, zx (n, 6)."""
    reaction: Array | None = None
    """Forces at held nodes, where the deck writes them; in space (n, 3) [N]."""


def run(deck: str, folder: Path, nodes: int, name: str = "job") -> Fields:
    """Run a plane deck in a folder and read its last results.

    Raises:
        RuntimeError: If ccx stops before the end of the last step.
    """
    found = run_solid(deck, folder, nodes, name)
    return Fields(
        displacement=found.displacement[:, :2], stress=found.stress[:, [0, 1, 3]]
    )


def run_solid(deck: str, folder: Path, nodes: int, name: str = "job") -> Fields:
    """The same with all components of a solid.

    Raises:
        RuntimeError: If ccx stops before the end of the last step.
    """
    (folder / f"{name}.inp").write_text(deck)
    done = subprocess.run(
        ["ccx", "-i", name],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    (folder / f"{name}.log").write_text(done.stdout)
    if done.returncode or "Job finished" not in done.stdout:
        raise RuntimeError(f"ccx failed:\n{done.stdout[-2000:]}{done.stderr}")
    blocks = _last_blocks(folder / f"{name}.frd", nodes)
    return Fields(
        displacement=blocks["DISP"],
        stress=blocks["STRESS"],
        reaction=blocks.get("FORC"),
    )


def _last_blocks(path: Path, nodes: int) -> dict[str, Array]:
    """Nodal fields of an .frd file; later increments replace earlier ones."""
    blocks: dict[str, Array] = {}
    current: Array | None = None
    with path.open() as file:
        for line in file:
            key = line[:3]
            if key == " -4":
                name, width = line.split()[1], {"DISP": 3, "STRESS": 6, "FORC": 3}
                current = None
                if name in width:
                    current = blocks[name] = np.full((nodes, width[name]), np.nan)
            elif key == " -3":
                current = None
            elif key == " -1" and current is not None:
                node = int(line[3:13]) - 1
                if node < nodes:
                    current[node] = [
                        float(line[13 + 12 * k : 25 + 12 * k])
                        for k in range(current.shape[1])
                    ]
    return blocks
