"""Results of every command, frozen: what a change of the code's form must leave alone.

    python tests/golden/golden.py [--freeze] [--only NAME,...]

Without ``--freeze`` every case is run again and compared byte for byte, as a change
that moves or renames code has to leave it on one machine. The tests compare within
round-off instead, because processors and libraries round differently.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import math
import os
import shutil
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.cli.main import main
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import models_path
from swgjoint.provenance import provenance

FOLDER = Path(__file__).parent
FROZEN = FOLDER / "frozen"
CASES: dict[str, dict[str, list[str]]] = tomllib.loads(
    (FOLDER / "cases.toml").read_text(encoding="utf-8")
)
VOLATILE = ("wall_s", "cpu_s", "_per_s", "seconds", "version", "machine", "commit")
VOLATILE += ("work_s", "speed_up", "real_time", "memory", "date", "folder", "path")
VOLATILE += ("created", "von_mises_at")
"""Parts of keys whose values are those of one machine or one run.

The largest stress of a symmetric drive occurs at several places; round-off picks one.
"""

SETTING = ("level", "integrator", "step_s")
"""Keys of a row of a search, which is in the order of its cost."""

LONG_TABLE = 60
"""Rows of a table beyond which its columns are summed."""


def run(name: str, argv: list[str], folder: Path) -> dict[str, Any]:
    """Exit status, result and maps of one command that runs in a folder."""
    shutil.copytree(FOLDER / "inputs", folder, dirs_exist_ok=True)
    out, here = io.StringIO(), Path.cwd()
    cache = os.environ.get("SWGJOINT_CACHE")
    os.environ["SWGJOINT_CACHE"] = str(folder / "cache")
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out):
            status = main([*argv, "--json"])
    finally:
        os.chdir(here)
        if cache is None:
            del os.environ["SWGJOINT_CACHE"]
        else:
            os.environ["SWGJOINT_CACHE"] = cache
    result = json.loads(out.getvalue()) if out.getvalue() else None
    if whole := name in CASES["tables"]:
        result = {k: v for k, v in result.items() if k not in ("computations", "files")}
    kept = stable(result, str(folder), whole)
    frozen = {"command": argv, "status": status, "result": kept}
    for path in sorted(folder.glob("*.swg")):
        frozen[path.name] = map_content(path)
    for path in sorted(folder.glob("out/*.csv")) + sorted(folder.glob("out/*.dxf")):
        frozen[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return frozen


def stable(value: Any, folder: str, whole: bool = False) -> Any:
    """A result without the folder and, unless whole, times, versions and sentences."""
    if isinstance(value, dict):
        timed = {"cost", "efficiency"} if {"cost", "work_s"} & set(value) else set()
        return {
            key: stable(item, folder, whole)
            for key, item in value.items()
            if whole or (key not in timed and not any(part in key for part in VOLATILE))
        }
    if isinstance(value, list):
        if any(isinstance(item, dict) and "cost" in item for item in value):
            # a search by cost: the timing decides what else is tried, and its order
            value = [item for item in value if item.get("within", True)]
            value.sort(key=lambda item: [str(item.get(k)) for k in SETTING])
        items = [stable(item, folder, whole) for item in value]
        return summed(items) if len(items) > LONG_TABLE and not whole else items
    if isinstance(value, str):
        # sentences may improve; what they must name is tested where they arise
        if value.count(" ") > 2 and not whole:
            return "(prose)"
        return value.replace(folder, "FOLDER").replace(str(models_path()), "MODELS")
    return value


def summed(rows: list[Any]) -> Any:
    """A long table by its columns: sums of numbers, counts of words, and a hash."""
    if not all(isinstance(row, dict) for row in rows):
        return rows
    columns: dict[str, Any] = {"rows": len(rows)}
    for key in dict.fromkeys(key for row in rows for key in row):
        cells = [row.get(key) for row in rows]
        numbers = [abs(c) for c in cells if type(c) in (int, float)]
        words = Counter(c for c in cells if isinstance(c, str))
        columns[key] = {"sum": math.fsum(numbers), "of": len(numbers)}
        if len(words) <= LONG_TABLE // 4:
            columns[key] |= words
    content = json.dumps(rows, sort_keys=True).encode()
    return columns | {"sha256": hashlib.sha256(content).hexdigest()}


def map_content(path: Path) -> dict[str, Any]:
    """Arrays of a map by their sums, and a hash of all their bytes."""
    drive = DriveMap.load(path)
    arrays = {k: v for k, v in vars(drive).items() if isinstance(v, np.ndarray)}
    # energies instead of coefficients, of which the highest are round-off over a short
    # interval to the fourth power
    interval = np.diff(drive.torsion_knots)[:, None]
    energies = {"potential": drive.potential * interval ** np.arange(5)}
    digest = hashlib.sha256()
    for key in sorted(arrays):
        digest.update(key.encode() + np.ascontiguousarray(arrays[key]).tobytes())
    return {
        "sums": {
            key: [list(array.shape), float(np.abs(array).sum())]
            for key, array in sorted((arrays | energies).items())
        },
        "sha256": digest.hexdigest(),
        "info": stable(json.loads(json.dumps(drive.info, default=str)), str(path)),
    }


def design_hashes() -> dict[str, str]:
    """``content_hash`` of every bundled design."""
    return {
        path.stem: Design.load(str(path)).content_hash()
        for path in sorted((models_path() / "drives").glob("*.toml"))
    }


def differences(frozen: Any, found: Any, where: str = "") -> Iterator[str]:
    """Places at which two results differ by more than round-off."""
    if isinstance(frozen, dict) and isinstance(found, dict):
        for key in [*frozen, *(k for k in found if k not in frozen)]:
            if key == "sha256":  # of figures, each of which rounds
                continue
            if key not in frozen or key not in found:
                yield f"{where}.{key}: {'new' if key in found else 'missing'}"
            else:
                yield from differences(frozen[key], found[key], f"{where}.{key}")
    elif isinstance(frozen, list) and isinstance(found, list):
        if len(frozen) != len(found):
            yield f"{where}: {len(frozen)} items, now {len(found)}"
        for i, (one, other) in enumerate(zip(frozen, found, strict=False)):
            yield from differences(one, other, f"{where}[{i}]")
    elif isinstance(frozen, float) and isinstance(found, float | int):
        # 1e-6: what solvers leave of a figure; 1e-9: residuals and other noise
        if not math.isclose(frozen, found, rel_tol=1e-6, abs_tol=1e-9):
            yield f"{where}: {frozen!r:.60}, now {found!r:.60}"
    elif frozen != found:
        yield f"{where}: {frozen!r:.60}, now {found!r:.60}"


def text(content: Any) -> str:
    """As it is written to a file."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def stamped(content: Any) -> Any:
    """With the date and the commit at which it is frozen."""
    found = provenance()
    when = {"date": found["date"][:10], "commit": found["commit"]}
    return {"frozen": when, **content}


def load(name: str) -> Any:
    """What was frozen of a case."""
    return json.loads((FROZEN / f"{name}.json").read_text(encoding="utf-8"))


def result_of(content: Any) -> Any:
    """What was frozen, without when."""
    return {key: value for key, value in content.items() if key != "frozen"}


def command_line() -> int:
    """Freeze cases or compare them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--freeze", action="store_true")
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    FROZEN.mkdir(exist_ok=True)
    changed = 0
    cases = {name: argv for tier in CASES.values() for name, argv in tier.items()}
    compared = [name for name in cases if name not in CASES["tables"]]
    for name in given.only.split(",") if given.only else [*compared, "designs"]:
        start = time.process_time()
        if name == "designs":
            now = design_hashes()
        else:
            with tempfile.TemporaryDirectory() as folder:
                now = run(name, cases[name], Path(folder))
        path = FROZEN / f"{name}.json"
        if given.freeze:
            stamp = name != "designs"
            path.write_text(text(stamped(now) if stamp else now), encoding="utf-8")
        same = path.exists() and text(result_of(load(name))) == text(now)
        changed += not same
        print(f"{name:24} {time.process_time() - start:7.1f} s", file=sys.stderr)
        if not same:
            print(f"  differs: {name}")
            for line in list(differences(result_of(load(name)), now))[:10]:
                print("   ", line)
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(command_line())
