"""Designs, scenes, sweeps, optimisations, specs, lots, changes of keys, arguments."""

from __future__ import annotations

import functools
import json
import re
import tomllib
from typing import Any

import numpy as np

from hostile.tree import Raw, changed, hostile_value, new_key, places, text_of
from hostile.values import TEXTS, flipped, pick
from swgjoint.explore.sweep.plan import MOST
from swgjoint.models_path import models_path

Drawn = tuple[dict[str, bytes], list[str]]

DRIVE = "CSG-25-100"
"""Quick: its map comes from the catalogue."""
SHORT = [
    *("--set", "simulation.duration_s=0.05"),
    *("--set", "simulation.step_s=0.001"),
]
LONGEST_S, REFUSED_S = 20.0, 1e6
"""Simulated time of a scene."""
FIGURES = ("ripple_rms_percent", "K1_Nm_rad", "tool_path_rms_mm", "wall_s")
LOT_FIGURES = (
    "transmission_accuracy_arcmin",
    "ripple_rms_percent",
    "torsional_stiffness_Nm_rad",
)
KEYS = (
    *("simulation.duration_s", "simulation.step_s", "controller.kind", "load.joint"),
    *("trajectory.speed_deg_s.joint", "defaults.level", "name", "payload.mass_kg"),
    *("joints.joint.drive", "disturbance", "recording.pose_rate_Hz", "x", "", "."),
    *("trajectory", "simulation.integrator", "sensors.noise", "a.b.c.d", "arm"),
)


@functools.cache
def bundled(folder: str) -> dict[str, str]:
    """Text of the bundled files of one folder by name."""
    files = sorted((models_path() / folder).glob("*.toml"))
    return {file.stem: file.read_text(encoding="utf-8") for file in files}


def bundled_text(rng: np.random.Generator, folder: str) -> str:
    """Text of one of the bundled files."""
    texts = bundled(folder)
    return texts[pick(rng, list(texts))]


def file_of(rng: np.random.Generator, data: dict[str, Any], most: int = 2) -> bytes:
    """A TOML file, hostile by its values, and sometimes by its text."""
    what = int(rng.integers(20))
    if what > 9 or what < 7:
        return encoded(text_of(changed(rng, data, most)))
    text = text_of(data)
    lines = text.splitlines()
    at = int(rng.integers(len(lines)))
    if what == 7:
        return flipped(rng, text.encode())
    if what == 8:
        line = pick(
            rng,
            [
                lines[at],  # a key or a table twice
                "a." * int(rng.integers(2, 3000)) + "a = 1",
                "[" + ".".join("ab") * int(rng.integers(1, 500)) + "]",
                f'"{pick(rng, TEXTS)!r}" = 1',
                "[[plan]]",
                "= 1",
                "x" * 100_000 + " = 1",
                "# " + "c" * 100_000,
                "x = [" + "1, " * 20_000 + "]",
            ],
        )
        return encoded("\n".join([*lines[:at], line, *lines[at:]]))
    return pick(
        rng,
        [
            b"\xef\xbb\xbf" + text.encode(),
            text.replace("\n", "\r\n").encode(),
            text.encode("utf-16"),
            text.replace(lines[at], lines[at] + " \u0000").encode(),
            (text + "# \xe9").encode("latin-1", errors="replace"),
            b"",
            b"\n",
            text.encode() + b"\xff\xfe",
        ],
    )


def encoded(text: str) -> bytes:
    """Bytes of a text that may hold lone surrogates."""
    return text.encode("utf-8", errors="surrogatepass")


def design_case(rng: np.random.Generator) -> Drawn:
    """A design, through the commands that need no finite elements."""
    data = tomllib.loads(bundled_text(rng, "drives"))
    argv = pick(
        rng,
        [
            ["design", "check", "d.toml", "--json"],
            ["design", "check", "d.toml"],
            ["design", "check", "d.toml", "--json"],
            ["profile", "d.toml", "--json"],
            ["spec", "d.toml", "--only", "rated_torque_Nm,momentary_peak_Nm", "--json"],
            ["design", "export", "d.toml", "--out", "out"],
            ["design", "new", "d.toml", "--teeth", "160/162", "-o", "out.toml"],
        ],
    )
    return {"d.toml": file_of(rng, data)}, list(argv)


def scene_case(rng: np.random.Generator) -> Drawn:
    """A scene with a catalogue drive in every joint, for some milliseconds."""
    name = pick(rng, ["bench", "bench", "bench-chirp", "ur5e-circle", "ur5e-sweep"])
    data = cheap_scene(bundled("scenes")[name])
    argv = ["run", "s.toml", "--json"]
    if rng.random() < 0.1:
        argv = ["compare", DRIVE, "--scene", "s.toml", "--json"]
    elif name == "bench":
        argv += SHORT
    return {"s.toml": bounded(file_of(rng, data))}, argv


def bounded(scene: bytes) -> bytes:
    """The scene with an hour of motion shortened, which is work and no hang.

    Durations beyond :data:`REFUSED_S` stay: they do not fit in memory.
    """

    def shorter(found: re.Match[bytes]) -> bytes:
        within = LONGEST_S < float(found[1]) < REFUSED_S
        return b"duration_s = %.1f" % LONGEST_S if within else found[0]

    return re.sub(rb"(?m)^duration_s = (\d+(?:\.\d*)?(?:e\+?\d+)?)$", shorter, scene)


def cheap_scene(text: str) -> dict[str, Any]:
    """A bundled scene with drives of the catalogue; short where it is the bench."""
    data = tomllib.loads(text)
    data["defaults"]["drive"] = DRIVE
    for joint in data.get("joints", {}).values():
        joint.pop("drive", None)
    if data["arm"] == "bench" and "settle_s" in data["trajectory"]:
        data["trajectory"]["settle_s"] = 0.01
        data["simulation"]["duration_s"] = 0.05
    return data


def sweep_case(rng: np.random.Generator) -> Drawn:
    """A sweep; what its designs give is put in by the laws."""
    data = tomllib.loads(bundled_text(rng, "sweeps"))
    argv = ["sweep", "s.toml", "--jobs", "1", "--json"]
    file = fewer_designs(file_of(rng, data))
    return {"s.toml": file}, argv + pick(rng, [[], [], ["--out", "out"]])


def fewer_designs(plan: bytes) -> bytes:
    """The plan with thousands of designs cut to 64, which is work and no hang.

    Counts that are refused stay.
    """

    def fewer(found: re.Match[bytes]) -> bytes:
        within = 64 < int(found[2]) <= MOST
        return found[1] + b" = 64" if within else found[0]

    return re.sub(rb"\b(count|designs) = (\d{3,9})\b", fewer, plan)


def optimisation_case(rng: np.random.Generator) -> Drawn:
    """A search of two generations; what its designs give is put in by the laws."""
    data = tomllib.loads(bundled_text(rng, "optimisations"))
    data["plan"] |= {"designs": 16, "population": 8}
    data["confirm"] |= {"designs": 2}
    argv = ["optimise", "o.toml", "--jobs", "1", "--json"]
    file = fewer_designs(file_of(rng, data))
    return {"o.toml": file}, argv + pick(rng, [[], [], ["--out", "out"]])


def spec_case(rng: np.random.Generator) -> Drawn:
    """Limits of a comparison."""
    data = {"spec": {pick(rng, FIGURES): 1.0, pick(rng, FIGURES): 0.5}}
    argv = ["compare", DRIVE, "--spec", "spec.toml", "--json", *SHORT]
    argv += ["--set", "trajectory.settle_s=0.01"]
    if rng.random() < 0.5:
        return {"spec.toml": file_of(rng, data, most=1)}, argv
    return {"spec.toml": file_of(rng, {"spec": dict.fromkeys(FIGURES, 1.0)})}, argv


def lot_case(rng: np.random.Generator) -> Drawn:
    """Limits of a lot, and its design; the drives are put in by the laws."""
    data = {"spec": {pick(rng, LOT_FIGURES): 1.0, pick(rng, LOT_FIGURES): 0.5}}
    design = tomllib.loads(bundled("drives")["reference-2d-tolerances"])
    spec, drive = text_of(data).encode(), text_of(design).encode()
    if rng.random() < 0.6:
        spec = file_of(rng, data)
    else:
        drive = file_of(rng, design, most=2)
    argv = ["lot", "d.toml", "--drives", "2", "--jobs", "1", "--spec", "spec.toml"]
    return {"spec.toml": spec, "d.toml": drive}, [*argv, "--json"]


def override_case(rng: np.random.Generator) -> Drawn:
    """Changes of a scene, a design or limits on the command line."""
    data = cheap_scene(bundled("scenes")["bench"])
    keys = [".".join(map(str, path)) for path in places(data)]
    key = pick(rng, [*keys, *KEYS])
    if rng.random() < 0.15:
        key = new_key(rng, key)
    value = hostile_value(rng, pick(rng, [1.0, 2, "full", [1.0, 2.0], True]))
    text = value if isinstance(value, str) else json.dumps(value)
    if rng.random() < 0.05:
        text = pick(rng, ["[" * 5000, "{" * 3000, "'" * 7, "1\n2", "[[[1]]]", "\x00"])
    change = (f"{key}={text}") if rng.random() < 0.95 else text
    change = str(Raw(change))[:100_000]
    if key == "simulation.duration_s":  # hours are honest work
        return {"s.toml": text_of(data).encode()}, [
            "run",
            "s.toml",
            "--set",
            change,
            "--json",
            *SHORT,
        ]
    argv = pick(
        rng,
        [
            ["run", "s.toml", "--json", *SHORT, "--set", change],
            ["run", "s.toml", "--json", *SHORT, "--set", change],
            ["design", "new", "reference-2d", "-o", "out.toml", "--set", change],
            [*("compare", DRIVE, "--scene", "s.toml", "--json"), "--limit", change],
        ],
    )
    return {"s.toml": text_of(data).encode()}, list(argv)


def argument_case(rng: np.random.Generator) -> Drawn:
    """Names that are no names, in every place of a command that takes one."""
    name = pick(rng, [*TEXTS, "y" * 250 + ".toml", "d/" * 2000, "z" * 252 + ".swg"])
    name += pick(rng, ["", "", ".toml", ".swg", ".csv", ".xml", ".urdf"])
    argv = pick(
        rng,
        [
            ["design", "check", name, "--json"],
            ["design", "show", name, "--out", "out"],
            ["profile", name, "--json"],
            ["profile", "reference-2d", "--out", name],
            ["spec", name, "--only", "rated_torque_Nm", "--json"],
            ["spec", DRIVE, "--only", name],
            ["spec", DRIVE, "--out", name],
            ["spec", DRIVE, "--measured", name],
            ["run", name, "--drive", DRIVE, "--json"],
            ["run", "bench", "--drive", name, "--json", *SHORT],
            ["run", "two-link", "--joints", name, "--drive", DRIVE],
            ["run", "two-link", "--pose", name, "--drive", DRIVE],
            ["run", "two-link", "--motion", name, "--drive", DRIVE],
            ["compare", name, "--json", *SHORT],
            ["compare", DRIVE, "--spec", name],
            ["compare", DRIVE, "--sort", name],
            ["compare", DRIVE, "--joints", name, *SHORT],
            ["map", name, "-o", "out.swg", "--measured-teeth", "200/202"],
            ["map", "loop.csv", "-o", name],
            ["map", "reference-2d", "-o", "out.swg", "--measured-teeth", name],
            ["identify", name, "--teeth", "200/202", "--rated", "50"],
            ["identify", "log.csv", "--teeth", name, "--rated", "50"],
            ["identify", "log.csv", "--teeth", "200/202", "--rated", name],
            ["sweep", name, "--jobs", "1"],
            ["sweep", "bench-speed", "--jobs", "1", "--out", name],
            ["optimise", name, "--jobs", "1"],
            ["lot", name, "--drives", "1"],
            ["tune", name],
            ["advise", name, "--error", "1arcmin"],
            ["advise", "bench", "--error", name],
            ["study", name],
            ["list", name],
            ["schema", name],
            ["view", name],
            ["design", "new", "reference-2d", "-o", "out.toml", "--name", name],
            ["design", "new", "reference-2d", "-o", name],
            ["design", "new", "reference-2d", "-o", "out.toml", "--teeth", name],
            [name, "x"],
        ],
    )
    return {}, [part.replace("\0", "") for part in argv]
