"""The ``.swg`` file: a drive map as an uncompressed npz with a JSON header.

Members: ``header.npy`` (JSON text as bytes), the arrays of
:class:`~swgjoint.maps.drive_map.DriveMap` and, where the map has them, those of its
:class:`~swgjoint.maps.fields.DriveFields`. The reader trusts no file: it rejects
compressed and pickled members, compares sizes with the number of bytes before it
allocates memory, and accepts only a map with finite values and a continuous torque that
does not decrease with the torsion.
"""

from __future__ import annotations

import io
import json
import platform
import re
import stat
import struct
import zipfile
from dataclasses import asdict
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from swgjoint import __version__
from swgjoint.errors import InputError, MapFileError
from swgjoint.faults import validate
from swgjoint.files import write_whole
from swgjoint.gear.ratings import Ratings
from swgjoint.json_text import json_text
from swgjoint.maps.checks import check_map
from swgjoint.maps.fields import DriveFields
from swgjoint.maps.file_header import (
    FRICTION_KEYS,
    MAX_NAME,
    FrictionHeader,
    Header,
    JenkinHeader,
)
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import vary_with_load
from swgjoint.maps.info import check_texts, sound_info
from swgjoint.maps.potential import Potential

SCHEMA_VERSION = 5
"""Version 2 added ``hysteresis``, 3 ``friction`` and the ratcheting torque, 4 the
fields for display, 5 the yield curve of the hysteresis. A file of an older version
is read as a map without these parts. A map without yield curves is written as version
4."""
_READABLE = (1, 2, 3, 4, SCHEMA_VERSION)
MAX_BYTES = 1_000_000_000
"""Largest file that is read or written [B]. 1000 harmonics with 100 knots take about 10
MB, the 16,439 harmonics of ``size-25-100-bought`` in 2D with 205 knots 276 MB."""

_ARRAYS: dict[str, tuple[str, int, str]] = {
    "torsion_knots": ("<f8", 1, "rad"),
    "orders": ("<i8", 2, "cycles per turn of alpha, beta"),
    "potential": ("<f8", 4, "J/rad^k"),
    "end_stiffness": ("<f8", 3, "N·m/rad"),
    "kinematic_error": ("<f8", 2, "rad"),
}
_FIELDS: dict[str, tuple[str, int, str]] = {
    f"fields_{key}": (dtype, len(DriveFields.SHAPES[key]), unit)
    for key, dtype, unit in (
        ("torque", "<f8", "N·m"),
        ("first_place", "<f8", "rad"),
        ("points", "<f8", "m"),
        ("triangles", "<i8", "nodes"),
        # single precision suffices for display
        ("displacement", "<f4", "m"),
        ("von_mises", "<f4", "Pa"),
        ("tooth_force", "<f4", "N"),
        ("wave_generator_force", "<f4", "N"),
        ("wave_generator", "<f8", "m"),
        ("circular_spline", "<f8", "m"),
    )
}
_NPY = re.compile(
    rb"\x93NUMPY\x01\x00(?P<length>..)\{'descr': '(?P<dtype>[<|][fiuc][0-9]{1,2})', "
    rb"'fortran_order': False, 'shape': \((?P<shape>[0-9, ]{1,60})\), \} *\n",
    re.DOTALL,
)
_END = struct.Struct("<4s4H2LH")  # end of the central directory, PKZIP APPNOTE 4.3.16

Map = TypeVar("Map", bound=Potential)


def map_bytes(drive: Potential) -> bytes:
    """Content of a ``.swg`` file; equal maps and software versions give equal bytes."""
    header = {
        "format": "swgjoint drive map",
        "schema_version": SCHEMA_VERSION if vary_with_load(drive.hysteresis) else 4,
        "units": {key: unit for key, (_, _, unit) in (_ARRAYS | _FIELDS).items()}
        | {"ratings": "N·m"},
        "versions": {
            "swgjoint": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "name": drive.name,
        "level": drive.level,
        "layout": drive.layout,
        "teeth_flexspline": drive.teeth_flexspline,
        "teeth_circular_spline": drive.teeth_circular_spline,
        "damping_ratio": float(drive.damping_ratio),
        "ratings": {key: _plain(value) for key, value in asdict(drive.ratings).items()},
        "hysteresis": [JenkinHeader.from_element(e) for e in drive.hysteresis],
        "friction": drive.friction
        and {
            key: _plain(getattr(drive.friction, name))
            for key, name in FRICTION_KEYS.items()
        },
        "fields_period_rad": drive.fields and float(drive.fields.period),
        "info": dict(drive.info),
    }
    text = json_text(header, indent=None).encode()
    members = {"header": np.frombuffer(text, dtype=np.uint8)}
    members |= {
        key: np.ascontiguousarray(getattr(drive, key), dtype=dtype)
        for key, (dtype, _, _) in _ARRAYS.items()
    }
    if drive.fields is not None:
        members |= {
            key: np.ascontiguousarray(
                getattr(drive.fields, key.removeprefix("fields_")), dtype=dtype
            )
            for key, (dtype, _, _) in _FIELDS.items()
        }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for key, array in members.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)
            # the default date of ZipInfo keeps the bytes independent of the clock
            archive.writestr(zipfile.ZipInfo(f"{key}.npy"), member.getvalue())
    return out.getvalue()


def _plain(value: object) -> object:
    return float(value) if isinstance(value, Real) else value


def write_map(drive: Potential, path: str | Path) -> None:
    """Write a ``.swg`` file atomically.

    Args:
        drive: The map.
        path: File to write, ``.swg``.

    Raises:
        InputError: If the file cannot be written.
        MapFileError: If the map is not valid or too large, so that it could not be read
            again.
    """
    try:
        check_map(drive)
    except ValueError as exc:
        raise MapFileError(f"map {drive.name!r} is not valid: {exc}") from None
    data = map_bytes(drive)
    if len(data) > MAX_BYTES:
        raise MapFileError(
            f"map {drive.name!r}: {len(data)} bytes; accepted: at most {MAX_BYTES}"
        )
    write_whole(path, data)


def read_map(path: str | Path, cls: type[Map]) -> Map:
    """Read a ``.swg`` file.

    Args:
        path: File to read, ``.swg``.
        cls: Class of the map to return.

    Raises:
        MapFileError: If the file is missing, damaged, malicious or of an unknown schema
            version. The message has one line.
    """
    where = str(path) if len(str(path)) <= MAX_NAME else f"{str(path)[:57]}..."
    try:
        return map_from_bytes(_content(Path(path)), cls)
    except OSError as exc:
        raise MapFileError(f"map {where}: cannot be read: {exc.strerror}") from None
    # zipfile raises NotImplementedError for methods of compression it does not support
    except (ValueError, zipfile.BadZipFile, NotImplementedError, EOFError) as exc:
        lines = str(exc).splitlines() or [type(exc).__name__]
        more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
        raise MapFileError(f"map {where}: {lines[0]}{more}") from None


def map_from_bytes(data: bytes, cls: type[Map]) -> Map:
    """A map from the content of a ``.swg`` file.

    Args:
        data: Bytes of the file.
        cls: Class of the map to return.

    Raises:
        ValueError: If the content is not a valid map.
    """
    members = _members(data)
    header = _header(members.pop("header"))
    arrays: dict[str, Any] = {
        key: _array(members[key], key, dtype, ndim)
        for key, (dtype, ndim, _) in _ARRAYS.items()
    }
    period, fields = header.fields_period_rad, None
    if (period is None) != (len(members) == len(_ARRAYS)):
        raise MapFileError(
            f"fields_period_rad {period} with {len(members)} arrays; accepted: null"
            " without fields, a number with them"
        )
    if period is not None:
        shown: dict[str, Any] = {
            key.removeprefix("fields_"): _array(members[key], key, dtype, ndim)
            for key, (dtype, ndim, _) in _FIELDS.items()
        }
        fields = DriveFields(period=period, **shown)
    drive = cls(
        name=header.name,
        level=header.level,
        layout=header.layout,
        teeth_flexspline=header.teeth_flexspline,
        teeth_circular_spline=header.teeth_circular_spline,
        damping_ratio=header.damping_ratio,
        ratings=Ratings(**header.ratings.model_dump()),
        hysteresis=tuple(element.element() for element in header.hysteresis),
        friction=_friction(header.friction),
        fields=fields,
        info=sound_info(header.info, name=header.name),
        **arrays,
    )
    check_map(drive)
    return drive


def _friction(header: FrictionHeader | None) -> Friction | None:
    if header is None:
        return None
    return Friction(**{FRICTION_KEYS[key]: v for key, v in header.model_dump().items()})


def _content(path: Path) -> bytes:
    """The bytes of a regular file of at most :data:`MAX_BYTES`."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise MapFileError("not a regular file")
    if status.st_size > MAX_BYTES:
        raise MapFileError(f"{status.st_size} bytes; accepted: at most {MAX_BYTES}")
    with path.open("rb") as file:
        # the buffer has the size that is passed
        return file.read(status.st_size)


def _members(data: bytes) -> dict[str, bytes]:
    """Bytes of every member of the archive, checked against its directory."""
    names = {f"{key}.npy" for key in ("header", *_ARRAYS)}
    more = names | {f"{key}.npy" for key in _FIELDS}
    if len(data) < _END.size or not data.startswith(b"PK\x03\x04"):
        raise MapFileError(f"not a .swg file ({len(data)} bytes)")
    signature, disk, first, here, entries, size, _, comment = _END.unpack(
        data[-_END.size :]
    )
    if signature != b"PK\x05\x06" or comment or disk or first or here != entries:
        raise MapFileError("truncated or damaged: end of the archive not found")
    zip64 = data[-_END.size - 20 : -_END.size].startswith(b"PK\x06\x07")
    if entries not in (len(names), len(more)) or size > 4096 or zip64:
        raise MapFileError(f"{entries} members; accepted: {', '.join(sorted(names))}")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        infos = archive.infolist()
        if {info.filename for info in infos} not in (names, more):
            found = ", ".join(sorted(info.filename[:40] for info in infos))
            raise MapFileError(f"members {found}; expected {', '.join(sorted(names))}")
        for info in infos:
            if info.compress_type != zipfile.ZIP_STORED or info.flag_bits & 1:
                raise MapFileError(f"member {info.filename} is compressed or encrypted")
            if info.compress_size != info.file_size:
                raise MapFileError(f"member {info.filename} has inconsistent sizes")
        claimed = sum(info.file_size for info in infos)
        if claimed > len(data):
            raise MapFileError(f"members of {claimed} bytes in a file of {len(data)}")
        # read() checks the CRC of each member
        return {info.filename[:-4]: archive.read(info) for info in infos}


def _array(data: bytes, name: str, dtype: str, ndim: int) -> NDArray[Any]:
    """One array; its shape and dtype must agree with its number of bytes.

    The header of the member is matched as text and never evaluated.
    """
    head = _NPY.match(data)
    if head is None or int.from_bytes(head["length"], "little") != head.end() - 10:
        raise MapFileError(f"{name}: not a plain array of format 1.0")
    stated = head["dtype"].decode()
    if stated != dtype:
        raise MapFileError(f"{name} has dtype {stated}; expected {dtype}")
    shape = tuple(int(n) for n in head["shape"].decode().split(",") if n.strip())
    if len(shape) != ndim or 0 in shape:
        raise MapFileError(f"{name} has shape {shape}; expected {ndim} non-empty axes")
    body = memoryview(data)[head.end() :]
    needed = np.dtype(dtype).itemsize
    for n in shape:
        needed *= n
    if needed != len(body):
        raise MapFileError(f"{name} has shape {shape} but {len(body)} bytes")
    return np.frombuffer(body, dtype=dtype).reshape(shape)


def _header(data: bytes) -> Header:
    """The checked JSON header."""
    text = _array(data, "header", "|u1", 1).tobytes()
    try:
        content = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as exc:
        raise MapFileError(f"header is not JSON: {exc}") from None
    if not isinstance(content, dict):
        raise MapFileError("header is not a JSON object")
    check_texts(content)
    version = content.get("schema_version")
    if version not in _READABLE:
        raise MapFileError(
            f"schema version {str(version)[:20]}; accepted:"
            f" {', '.join(map(str, _READABLE))}; build the map again with 'swgjoint"
            " map'"
        )
    return validate(Header, content, where="header", error=MapFileError)


def _refuse(constant: str) -> None:
    raise InputError(f"{constant} is not a finite number")
