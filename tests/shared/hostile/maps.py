"""Maps of drives: archives, headers, arrays and records that no writer wrote."""

from __future__ import annotations

import functools
import io
import json
import struct
import zipfile
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from hostile.toml_files import DRIVE, SHORT
from hostile.tree import Raw, changed
from hostile.values import NUMBERS, SURROGATE, TEXTS, factor, flipped, pick
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import map_bytes

Drawn = tuple[dict[str, bytes], list[str]]
INFO: dict[str, Any] = {
    "source": "drawn",
    "design_hash": "0" * 64,
    "label": {"stress_state": "plane stress"},
    "pruned": {
        "tolerance_arcmin": 0.1,
        "dropped": [[3, 1]],
        "output_angle_bound_arcmin": 0.05,
        "kinematic_error_bound_arcmin": 0.01,
        "torque_bound_Nm": 0.2,
        "harmonics": 3,
    },
    "residual": {"threshold": 1e-3, "torque_Nm": 0.1, "kinematic_error_rad": 1e-6},
    "energy_check": {"relative": 1e-6},
    "stiffness_range_Nm_rad": [1e4, 2e4],
    "stated": {"transmission_accuracy_arcmin": 1.0, "K1_Nm_rad": 1e4},
    "missing": {"hysteresis_loss_arcmin": "nothing rubs"},
    "kinematic_error": "assumed: 1 arcmin at 2 and 4 per turn, seed 0",
    "hysteresis": "given",
    "hysteresis_left_out": 2,
    "manufacturing_errors": "left out",
    "sampled_torque_Nm": [-100.0, 100.0],
    "perfect_teeth": {"energy_check": {"relative": 1e-6}},
    "ratings_source": "rule",
    "friction": "given",
    "friction_loop": {"samples": 3},
    "harmonics": [{"alpha": 0, "beta": 0}],
    "fit": {"loop": {"rms_arcmin": 0.1, "warnings": []}},
    "validation": {"solves": 4, "rows": [{"torque_Nm": 1.0}]},
    "tolerances": {"seed": 1},
    "sampling": {"angles": 8},
    "mirror": {"share": 0.0},
}
"""Keys that this package reads or writes, with values of the right type."""


@functools.cache
def sound() -> DriveMap:
    """A catalogue drive with all keys of a record."""
    drive = DriveMap.from_catalogue(DRIVE)
    return replace(drive, info={**INFO, **drive.info})


@functools.cache
def members() -> dict[str, bytes]:
    """Members of the file of :func:`sound`."""
    with zipfile.ZipFile(io.BytesIO(map_bytes(sound()))) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def archive_of(content: dict[str, bytes], **options: Any) -> bytes:
    """A ``.swg`` file with right checksums."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", **options) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def array_of(data: bytes) -> np.ndarray[Any, Any]:
    """The array of a member."""
    return np.load(io.BytesIO(data), allow_pickle=False)


def bytes_of(array: np.ndarray[Any, Any]) -> bytes:
    """A member of an array."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def header() -> dict[str, Any]:
    """The JSON header of :func:`sound`."""
    found: dict[str, Any] = json.loads(array_of(members()["header.npy"]).tobytes())
    return found


def header_bytes(content: Any) -> bytes:
    """A header member; what JSON does not have becomes what Python writes."""
    text = json.dumps(content, default=str)
    return bytes_of(np.frombuffer(text.encode(), dtype=np.uint8))


def plain(value: Any) -> Any:
    """Text instead of values that are raw text of TOML."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [plain(one) for one in value]
    return str(value)[:100] if isinstance(value, Raw) else value


def commands(rng: np.random.Generator) -> list[str]:
    """A command that reads the map."""
    quick = ["--json", *SHORT, "--set", "trajectory.settle_s=0.01"]
    what = rng.random()
    if what < 0.35:
        return ["run", "bench", "--drive", "m.swg", *quick]
    if what < 0.5:
        return ["compare", "m.swg", *quick]
    if what < 0.55:
        return ["run", "bench", "--drive", "m.swg", *quick, "--out", "out", "--report"]
    if what < 0.6:
        return ["spec", "m.swg", "--out", "out"]
    keys = "K1_Nm_rad,rated_torque_Nm,hysteresis_loss_arcmin,lost_motion_arcmin"
    return ["spec", "m.swg", "--only", keys, *(["--json"] * (what < 0.9))]


def info_case(rng: np.random.Generator) -> Drawn:
    """A sound map whose name and record hold anything."""
    content = header()
    content["info"] = plain(changed(rng, content["info"], most=4))
    if rng.random() < 0.3:
        content["name"] = pick(rng, [*TEXTS, SURROGATE])
    if rng.random() < 0.2:
        content["ratings"]["source"] = pick(rng, [*TEXTS, SURROGATE])
    if rng.random() < 0.1:
        key = pick(rng, list(content["info"]) or ["x"])
        content["info"][key] = pick(rng, [SURROGATE, float("nan"), 10**400, None])
    data = archive_of({**members(), "header.npy": header_bytes(content)})
    return {"m.swg": data}, commands(rng)


def map_case(rng: np.random.Generator) -> Drawn:
    """A map damaged in one of many ways."""
    content = dict(members())
    what = int(rng.integers(10))
    if what == 0:
        data = flipped(rng, map_bytes(sound()))
    elif what == 1:
        name = pick(rng, list(content))
        content[name] = flipped(rng, content[name])
        data = archive_of(content)
    elif what == 2:
        content["header.npy"] = header_bytes(plain(changed(rng, header())))
        data = archive_of(content)
    elif what == 3:
        text = pick(
            rng, [b"", b"[]", b"null", b"[" * 90_000, b"{}", b'"x"', b"1" * 9999]
        )
        content["header.npy"] = bytes_of(np.frombuffer(text + b" ", dtype=np.uint8))
        data = archive_of(content)
    elif what == 4:
        data = archive_of(_other_members(rng, content))
    elif what == 5:
        data = archive_of(content, compression=pick(rng, [zipfile.ZIP_DEFLATED, 14]))
    elif what == 6:
        data = _lying(rng, archive_of(content))
    else:
        data = archive_of(_other_arrays(rng, content))
    return {"m.swg": data}, commands(rng)


def _other_members(
    rng: np.random.Generator, content: dict[str, bytes]
) -> dict[str, bytes]:
    name = pick(rng, list(content))
    what = int(rng.integers(5))
    if what == 0:
        del content[name]
    elif what == 1:
        content[pick(rng, ["../x.npy", "/x.npy", "x" * 5000, " ", "a\nb"])] = b"x"
    elif what == 2:
        content[pick(rng, ["../x", "fields_torque.npy", "é.npy"])] = content.pop(name)
    elif what == 3:
        content[name] = b""
    else:
        content["extra.npy"] = content[name]
    return content


def _other_arrays(
    rng: np.random.Generator, content: dict[str, bytes]
) -> dict[str, bytes]:
    """An array with another type, shape or values."""
    name = pick(rng, [one for one in content if one != "header.npy"])
    array = array_of(content[name])
    what = int(rng.integers(9))
    if what == 0:
        array = array.astype(
            pick(rng, ["<f4", ">f8", "<i4", "<c16", "<U8", "?", "<u8"])
        )
    elif what == 1:
        array = array.reshape(-1)
    elif what == 2:
        array = array[: int(rng.integers(0, 2))]
    elif what == 3:
        array = np.concatenate([array, array])
    elif what == 4:
        array = array[::-1].copy()
    elif what == 5 and array.size:
        array = array.copy()
        array.flat[int(rng.integers(array.size))] = _number(rng, array)
    elif what == 6:
        array = np.full_like(array, _number(rng, array))
    elif what == 7:
        array = (array * factor(rng)).astype(array.dtype)
    else:
        array = np.asfortranarray(array)
    content[name] = bytes_of(np.asarray(array))
    return content


def _number(rng: np.random.Generator, array: np.ndarray[Any, Any]) -> Any:
    if array.dtype.kind == "i":
        return pick(rng, [0, -1, 1, 10**6, 2**62, -(2**63)])
    return pick(rng, NUMBERS)


def _lying(rng: np.random.Generator, data: bytes) -> bytes:
    """An archive whose directory says other sizes, counts or places."""
    content = bytearray(data)
    marks = (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06")
    at = content.find(pick(rng, list(marks)))
    place = at + int(rng.integers(4, 42))
    size = pick(rng, [2, 4])
    value = pick(rng, [0, 1, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, zlib.crc32(b"x")])
    content[place : place + size] = struct.pack("<I", value)[:size]
    return bytes(content)
