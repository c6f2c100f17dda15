"""Columns of numbers: measured loops and errors, logs of benches, motions."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from hostile.toml_files import DRIVE, bundled, cheap_scene, file_of
from hostile.tree import text_of
from hostile.values import NUMBERS, factor, flipped, pick

Array = NDArray[np.float64]
Drawn = tuple[dict[str, bytes], list[str]]
CELLS = ("", "nan", "inf", "-inf", "1e308", "5e-324", "1e999", "1,5", "x", "'1'", "-0")
TEETH = ["--measured-teeth", "200/202", "--measured-rated", "50"]


def table_of(rng: np.random.Generator, header: list[str], rows: Array) -> bytes:
    """The table with wrong units, order, cells, separators or length."""
    rows, header = rows.copy(), list(header)
    for _ in range(int(rng.integers(1, 3))):
        _spoil(rng, header, rows)
        rows = _cut(rng, rows)
    separator = pick(rng, [*[","] * 8, ";", "\t", " ", "|"])
    lines = [separator.join(header)]
    lines += [separator.join(f"{cell:.9g}" for cell in row) for row in rows]
    what, at = int(rng.integers(30)), int(rng.integers(len(lines)))
    if what == 0:
        cells = lines[at].split(separator)
        cells[int(rng.integers(len(cells)))] = pick(rng, CELLS)
        lines[at] = separator.join(cells)
    elif what == 1:
        lines[at] += separator + "1"
    elif what == 2:
        lines[at] = lines[at][: len(lines[at]) // 2]
    elif what == 3:
        lines = lines[1:]
    elif what == 4:
        lines = [lines[0], *lines]
    elif what == 5:
        lines[at] = "x" * 100_000
    text = "\n".join(lines) + "\n"
    if what == 6:
        return flipped(rng, text.encode())
    if what == 7:
        return pick(rng, [b"", b"\n\n", b"\xef\xbb\xbf" + text.encode(), b"\0" * 100])
    if what == 8:
        return text.encode("utf-16")
    if what == 9:
        return ("# comment\n" * 20 + "# " + text).encode()
    return text.encode()


def _spoil(rng: np.random.Generator, header: list[str], rows: Array) -> None:
    """One column or the header in another way than it should be."""
    k = int(rng.integers(len(header)))
    if not len(rows):
        return
    at = int(rng.integers(len(rows)))
    what = int(rng.integers(12))
    if what < 3:
        rows[:, k] *= factor(rng)
    elif what == 3:
        rows[:, k] = rows[0, k]  # it rests
    elif what == 4:
        rows[:, k] = rows[::-1, k]
    elif what == 5:
        rows[at:, k] = rows[at, k]
    elif what == 6:
        rows[at, k] = pick(rng, NUMBERS)
    elif what == 7:
        rows[:, k] = pick(rng, NUMBERS)
    elif what == 8:
        rows[:, k] += pick(rng, [1e-12, 1.0, 1e6, 1e15, -1e3, 1e300])
    elif what == 9:
        rows[:, k] = rng.standard_normal(len(rows)) * pick(rng, [1e-9, 1.0, 1e9])
    elif what == 10 and rng.random() < 0.3:
        name = header[k]
        header[k] = pick(rng, ["", name + "s", name.upper(), "x" * 5000, header[0]])
    elif what == 11:
        units = {"_arcmin": "_rad", "_deg": "_rad", "_rad": "_deg", "_Nm": "_mNm"}
        for old, new in units.items():
            if header[k].endswith(old):
                header[k] = header[k].removesuffix(old) + new
                break


def _cut(rng: np.random.Generator, rows: Array) -> Array:
    """Fewer rows, rows twice, in another order, or all of them."""
    what = int(rng.integers(20))
    if what == 0:
        return rows[: int(rng.integers(0, 8))]
    if what == 1:
        return np.repeat(rows, 2, axis=0)
    if what == 2:
        return rows[rng.permutation(len(rows))]
    if what == 3:
        return rows[: max(len(rows) // 2, 1)]
    if what == 4:
        return rows[::-1]
    return rows


@functools.cache
def loop() -> Array:
    """Torque [N·m] and torsion [arcmin] of a stiffening loop, once around."""
    torque = np.concatenate([np.linspace(a, b, 40) for a, b in _LAPS])
    side = np.concatenate([np.full(40, np.sign(a - b)) for a, b in _LAPS])
    torsion = torque / 12.0 - (torque / 100.0) ** 3 + 0.2 * side
    return np.column_stack([torque, torsion])


_LAPS = ((0.0, 100.0), (100.0, -100.0), (-100.0, 100.0))


@functools.cache
def error() -> Array:
    """Output angle [deg] and kinematic error [arcmin] over one output turn."""
    angle = np.linspace(0.0, 360.0, 400)
    alpha = np.radians(angle) * 101.0
    return np.column_stack(
        [angle, 0.3 * np.sin(2 * alpha) + 0.1 * np.cos(np.radians(angle))]
    )


@functools.cache
def log() -> Array:
    """Bench log: time, motor and link angle [deg], output and motor torque."""
    time = np.arange(0.0, 2.0, 2e-3)
    motor = np.degrees(20.0 * (1.0 - np.cos(3.0 * time)))
    torque = 30.0 * np.sin(2.0 * time)
    link = -motor / 100.0 - np.degrees(torque / 3e4)
    drive = 0.01 * np.sign(np.sin(3.0 * time)) + 1e-4 * 180.0 * np.cos(3.0 * time)
    return np.column_stack([time, motor, link, torque, drive - torque / 100.0])


def loop_case(rng: np.random.Generator) -> Drawn:
    """A measured loop, as a map or laid over a catalogue drive."""
    files = {"loop.csv": table_of(rng, ["torque_Nm", "torsion_arcmin"], loop())}
    if rng.random() < 0.3:
        return files, ["spec", DRIVE, "--measured", "loop.csv", "--json"]
    return files, ["map", "loop.csv", "-o", "out.swg", "--json", *TEETH]


def error_case(rng: np.random.Generator) -> Drawn:
    """A measured kinematic error beside a sound loop."""
    lines = "".join(f"{a:.9g},{b:.9g}\n" for a, b in loop())
    files = {
        "loop.csv": b"torque_Nm,torsion_arcmin\n" + lines.encode(),
        "error.csv": table_of(rng, ["output_deg", "error_arcmin"], error()),
    }
    argv = ["map", "loop.csv", "-o", "out.swg", "--json", *TEETH]
    return files, [*argv, "--measured-error", "error.csv"]


def log_case(rng: np.random.Generator) -> Drawn:
    """The log of a bench."""
    names = ["time_s", "motor_angle_deg", "link_angle_deg"]
    names += ["output_torque_Nm", "motor_torque_Nm"]
    files = {"log.csv": table_of(rng, names, log())}
    argv = ["identify", "log.csv", "--teeth", "200/202", "--rated", "50", "--json"]
    if rng.random() < 0.1:
        argv += ["--out", "out"]
    return files, argv


def motion_case(rng: np.random.Generator) -> Drawn:
    """A motion of the bench joint through points of a file."""
    time = np.linspace(0.0, 0.08, 9)
    points = np.column_stack([time, 2.0 * np.sin(2.0 * np.pi * time / 0.16)])
    motion = table_of(rng, ["time_s", "joint_deg"], points)
    scene = cheap_scene(bundled("scenes")["bench"])
    scene["trajectory"] = {"kind": "csv", "file": "motion.csv"}
    scene["simulation"]["duration_s"] = 0.4
    content = text_of(scene).encode()
    if rng.random() < 0.1:
        content = file_of(rng, scene)
    return {"motion.csv": motion, "s.toml": content}, ["run", "s.toml", "--json"]
