"""The ``.swg`` file: what is written comes back, what is damaged is refused."""

from __future__ import annotations

import io
import json
import os
import struct
import time
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from messages import names, naming

from swgjoint.errors import InputError, MapFileError
from swgjoint.json_text import plain
from swgjoint.maps import file as map_file
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import MAX_BYTES, map_bytes, map_from_bytes
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import Jenkin

ARRAYS = ("torsion_knots", "orders", "potential", "end_stiffness", "kinematic_error")
MEMBERS = ("header.npy", *(f"{key}.npy" for key in ARRAYS))


def same(a: DriveMap, b: DriveMap) -> bool:
    """Bitwise equality of everything a map holds."""
    fields = set(a.__dataclass_fields__) - set(ARRAYS)
    return all(getattr(a, key) == getattr(b, key) for key in fields) and all(
        getattr(a, key).tobytes() == getattr(b, key).tobytes()
        and getattr(a, key).shape == getattr(b, key).shape
        for key in ARRAYS
    )


def repacked(data: bytes, compression: int = zipfile.ZIP_STORED, **members) -> bytes:
    """The archive with some members replaced, added or (None) left out."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    for key, value in members.items():
        content[f"{key}.npy"] = value
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, value in content.items():
            if value is not None:
                archive.writestr(name, value)
    return out.getvalue()


def npy(array: np.ndarray, **options) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array(out, np.asarray(array), **options)
    return out.getvalue()


def header_of(data: bytes) -> dict:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return json.loads(np.load(io.BytesIO(archive.read("header.npy"))).tobytes())


def header_npy(header: object) -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return npy(np.frombuffer(text, dtype=np.uint8))


def refusal(tmp_path: Path, data: bytes) -> str:
    """The one line with which a file is refused."""
    path = tmp_path / "hostile.swg"
    path.write_bytes(data)
    with pytest.raises(MapFileError) as caught:
        DriveMap.load(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"map {path}: ")
    assert len(message) < 500 + len(str(path))
    return message.removeprefix(f"map {path}: ")


def test_round_trip_is_bitwise(synthetic_map, tmp_path):
    """A saved map is loaded with every bit of its arrays and all its fields."""
    elements = (
        Jenkin(stiffness=1e3 / 3, yield_torque=0.1),
        Jenkin(stiffness=2e4, yield_torque=1 / 7),
    )
    friction = Friction(stiffness=1e2 / 3, coulomb=0.1, static=1 / 7, source="a guess")
    info = {"residual": {"torque_Nm": 1e-3}, "angles": 24}
    ratings = replace(synthetic_map.ratings, ratcheting_torque=700 / 3)
    drive = replace(
        synthetic_map,
        hysteresis=elements,
        friction=friction,
        ratings=ratings,
        info=info,
    )
    drive.save(tmp_path / "a.swg")
    assert same(DriveMap.load(tmp_path / "a.swg"), drive)
    assert os.listdir(tmp_path) == ["a.swg"]


def test_same_map_same_bytes(synthetic_map):
    """The content depends on the map alone, not on the clock."""
    assert map_bytes(synthetic_map) == map_bytes(replace(synthetic_map))


def test_a_map_too_large_to_be_read_is_not_written(
    synthetic_map, tmp_path, monkeypatch
):
    """The message states both sizes, and no file is left."""
    size = len(map_bytes(synthetic_map))
    monkeypatch.setattr(map_file, "MAX_BYTES", size - 1)
    with pytest.raises(MapFileError, match=naming(f"{size} bytes", f"{size - 1}")):
        synthetic_map.save(tmp_path / "large.swg")
    assert not os.listdir(tmp_path)
    monkeypatch.setattr(map_file, "MAX_BYTES", size)
    synthetic_map.save(tmp_path / "large.swg")
    assert same(DriveMap.load(tmp_path / "large.swg"), synthetic_map)


def test_numpy_reads_the_file_without_pickle(synthetic_map, tmp_path):
    """Any numpy reads the arrays; the header names the units."""
    synthetic_map.save(tmp_path / "a.swg")
    with np.load(tmp_path / "a.swg", allow_pickle=False) as arrays:
        assert np.array_equal(arrays["potential"], synthetic_map.potential)
        header = json.loads(arrays["header"].tobytes())
    assert header["units"]["torsion_knots"] == "rad"
    assert header["schema_version"] == 4


def test_info_that_is_no_number_becomes_null(synthetic_map, tmp_path):
    """NaN in the provenance is stored as null, never as invalid JSON."""
    replace(synthetic_map, info={"x": float("nan")}).save(tmp_path / "a.swg")
    assert DriveMap.load(tmp_path / "a.swg").info == {"x": None}


def test_every_truncation_is_refused(synthetic_map, tmp_path):
    """A file cut anywhere is refused in one line."""
    data = map_bytes(synthetic_map)
    for cut in [*range(0, 120), *range(120, len(data), 97), len(data) - 1]:
        refusal(tmp_path, data[:cut])


@settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(where=st.floats(0, 1, exclude_max=True), bits=st.integers(1, 255))
def test_a_changed_byte_never_gives_another_map(synthetic_map, tmp_path, where, bits):
    """A file with a flipped byte is refused, or the byte did not matter."""
    data = bytearray(map_bytes(synthetic_map))
    data[int(where * len(data))] ^= bits
    path = tmp_path / "flipped.swg"
    path.write_bytes(data)
    try:
        drive = DriveMap.load(path)
    except MapFileError as exc:
        assert "\n" not in str(exc)
    else:
        assert same(drive, synthetic_map)


def test_every_byte_of_the_directory(synthetic_map, tmp_path):
    """Each byte of the archive's directory set to 0 and to 255 is refused or idle."""
    data = map_bytes(synthetic_map)
    path = tmp_path / "flipped.swg"
    refused = 0
    for at in range(data.index(b"PK\x01\x02"), len(data)):
        for value in (0, 255):
            changed = bytearray(data)
            changed[at] = value
            path.write_bytes(changed)
            try:
                assert same(DriveMap.load(path), synthetic_map)
            except MapFileError as exc:
                assert "\n" not in str(exc)
                refused += 1
    assert refused > 300


@settings(
    max_examples=100,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(junk=st.binary(max_size=400))
def test_junk_is_refused(tmp_path, junk):
    """Bytes that were never a map are refused in one line."""
    refusal(tmp_path, junk)
    refusal(tmp_path, b"PK\x03\x04" + junk)


def test_wrong_arrays(synthetic_map, tmp_path):
    """Wrong shape, dtype, order, NaN and pickled objects are refused."""
    data = map_bytes(synthetic_map)
    c = synthetic_map.potential
    nan = np.where(np.arange(c.size).reshape(c.shape) == 3, np.nan, c)
    cases = {
        ("potential", "[J]", "(5, 2, 7, 5)", "(5, 2, 8, 5)"): {
            "potential": npy(c[:, :, 1:])
        },
        ("potential", "(2, 8, 5)", "4"): {"potential": npy(c[0])},
        ("orders", "(0, 2)", "2"): {"orders": npy(np.zeros((0, 2), dtype=np.int64))},
        ("potential", "<f4", "<f8"): {"potential": npy(c.astype(np.float32))},
        ("potential", "[J]", "finite"): {"potential": npy(nan)},
        ("torsion knots", "[rad]", "two"): {
            "torsion_knots": npy(synthetic_map.torsion_knots[::-1])
        },
        ("potential", "array", "1.0"): {"potential": npy(np.asfortranarray(c))},
        ("potential", "format", "1.0"): {"potential": npy(c, version=(2, 0))},
        ("torque", "torsion"): {"potential": npy(-c)},
        ("end_stiffness", "1e60"): {
            "end_stiffness": npy(synthetic_map.end_stiffness * 1e90)
        },
        ("potential", "knot", "torsion"): {"potential": npy(c + np.arange(8)[:, None])},
        ("orders", "100000", "1e6"): {"orders": npy(synthetic_map.orders * 2**62)},
    }
    for parts, members in cases.items():
        assert names(refusal(tmp_path, repacked(data, **members)), *parts), parts
    pickled = npy(np.array([{"a": 1}], dtype=object), allow_pickle=True)
    assert names(
        refusal(tmp_path, repacked(data, potential=pickled)), "potential", "1.0"
    )


@pytest.mark.parametrize("jumps", ["potential", "torque"])
def test_a_small_jump_at_a_knot_is_refused(synthetic_map, tmp_path, jumps):
    """A thousandth of the largest energy or torque would be a blow on the joint."""
    c, knots = synthetic_map.potential.copy(), synthetic_map.torsion_knots
    if jumps == "potential":
        c[0, 0, 4:, 0] += 1e-3 * np.abs(c[..., 0]).max()
    else:  # one piece sags between its ends
        slope = 1e-3 * np.abs(c[..., 1]).max()
        c[0, 0, 4, 1] += slope
        c[0, 0, 4, 2] -= slope / (knots[5] - knots[4])
    said = refusal(tmp_path, repacked(map_bytes(synthetic_map), potential=npy(c)))
    assert names(said, jumps, "knot", "torsion")


def test_wrong_members(synthetic_map, tmp_path):
    """Missing, additional, doubled and compressed members are refused."""
    data = map_bytes(synthetic_map)
    assert names(refusal(tmp_path, repacked(data, potential=None)), "5", *MEMBERS)
    assert names(
        refusal(tmp_path, repacked(data, extra=npy(np.zeros(3)))), "7", *MEMBERS
    )
    swapped = repacked(data, potential=None, other=npy(np.zeros(3)))
    assert names(refusal(tmp_path, swapped), "other.npy", *MEMBERS)
    squeezed = repacked(data, zipfile.ZIP_DEFLATED)
    assert names(refusal(tmp_path, squeezed), "header.npy", "compressed")


def test_zip_bomb(synthetic_map, tmp_path):
    """A member that unpacks to 100 MB is refused without unpacking it."""
    data = map_bytes(synthetic_map)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        with zipfile.ZipFile(io.BytesIO(data)) as sound:
            for name in sound.namelist()[1:]:
                archive.writestr(name, sound.read(name))
        header = zipfile.ZipInfo("header.npy")
        header.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(header, "w") as member:
            for _ in range(10):
                member.write(bytes(10_000_000))
    tracemalloc.start()
    try:
        said = refusal(tmp_path, out.getvalue())
        assert names(said, "header.npy", "compressed")
        # the member would take 100 MB
        assert tracemalloc.get_traced_memory()[1] < 70_000_000
    finally:
        tracemalloc.stop()


def test_huge_claims(synthetic_map, tmp_path):
    """Sizes that are claimed and not there are refused before allocation."""
    data = map_bytes(synthetic_map)
    head = (
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (900000000000, 8, 1, 5), }"
    )
    claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + head.ljust(117) + b"\n"
    refused = refusal(tmp_path, repacked(data, potential=claim + bytes(40)))
    assert names(refused, "potential", "(900000000000, 8, 1, 5)", "40 bytes")
    # both sizes of the first entry of the directory: a member of 4 GB
    at = data.index(b"PK\x01\x02")
    large = data[: at + 20] + b"\xf0\xff\xff\xff" * 2 + data[at + 28 :]
    assert names(refusal(tmp_path, large), "members", "bytes", f"{len(large)}")
    with (tmp_path / "long.swg").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(
        MapFileError, match=naming("long.swg", f"{MAX_BYTES + 1} bytes", f"{MAX_BYTES}")
    ):
        DriveMap.load(tmp_path / "long.swg")


KINDS = ("truncated", "shape", "not a number", "huge", "pickle", "bomb", "header")


def hostile(data: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """A file of one kind, another one at every call."""
    drive = map_from_bytes(data, DriveMap)
    key = str(rng.choice(ARRAYS))
    array = getattr(drive, key)
    if kind == "truncated":
        return data[: int(rng.integers(0, len(data)))]
    if kind == "shape":
        size = int(rng.integers(1, 40))
        wrong = [array[:-1], array[None], np.zeros((size,) * 2, array.dtype)]
        return repacked(data, **{key: npy(wrong[int(rng.integers(3))])})
    if kind == "not a number":
        floats = [k for k in ARRAYS if k != "orders"]
        key = str(rng.choice(floats))
        array = getattr(drive, key).copy()
        array.flat[int(rng.integers(array.size))] = rng.choice(
            [np.nan, np.inf, -np.inf]
        )
        return repacked(data, **{key: npy(array)})
    if kind == "huge":
        shape = tuple(int(n) for n in 10 ** rng.integers(4, 9, array.ndim))
        text = f"{{'descr': '{array.dtype.str}', 'fortran_order': False, "
        text += f"'shape': {shape}, }}"
        claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118)
        claim += text.encode().ljust(117) + b"\n"
        return repacked(data, **{key: claim + bytes(int(rng.integers(8, 800)))})
    if kind == "pickle":
        values = [{"a": 1}, print, b"x", [1, (2,)], None]
        one = np.array([values[int(rng.integers(5))]], dtype=object)
        return repacked(data, **{key: npy(one, allow_pickle=True)})
    if kind == "bomb":
        zeros = npy(np.zeros(int(rng.integers(1e5, 1e6))))
        name = str(rng.choice(["extra", *ARRAYS]))
        return repacked(data, zipfile.ZIP_DEFLATED, **{name: zeros})
    header = header_of(data)
    name = str(rng.choice(sorted(header)))
    values = [float("1e400"), [], {"x": 1}, -7, "\x00" * 50, [[[]]] * 9, None, True]
    wrong = values[int(rng.integers(len(values)))]
    if wrong is None and name in ("friction", "fields_period_rad"):
        wrong = 3
    if name in ("name", "level") and isinstance(wrong, str):
        wrong = 3  # any text is a name
    if name in ("units", "versions", "info") and isinstance(wrong, dict):
        wrong = 3
    if name == "hysteresis" and wrong == []:
        wrong = 3
    return repacked(data, header=header_npy({**header, name: wrong}))


def test_two_hundred_hostile_files(synthetic_map, tmp_path):
    """30 of each kind, no two alike: every one refused in one line.

    A refusal takes about as long as reading the whole file: 1.3 times here.
    """
    data = map_bytes(synthetic_map)
    rng = np.random.default_rng(3)
    seen = set()
    took = 0.0
    for kind in KINDS:
        for _ in range(30):
            file = hostile(data, kind, rng)
            seen.add(file)
            begin = time.process_time()
            refusal(tmp_path, file)
            took += time.process_time() - begin
    whole = tmp_path / "whole.swg"
    whole.write_bytes(data)
    begin = time.process_time()
    for _ in seen:
        DriveMap.load(whole)
    assert took < 10.0 * (time.process_time() - begin)
    assert len(seen) > 150


def test_wrong_headers(synthetic_map, tmp_path):
    """A header of another schema, with wrong types or no JSON is refused."""
    data = map_bytes(synthetic_map)
    header = header_of(data)
    ratings = header["ratings"]
    cases = {
        ("schema version", "6", "1", "5", "swgjoint map"): {
            **header,
            "schema_version": 6,
        },
        ("schema version", "0", "1", "4", "swgjoint map"): {
            **header,
            "schema_version": 0,
        },
        ("header", "layout"): {k: v for k, v in header.items() if k != "layout"},
        ("header", "code", "damping_ratio", "versions"): {**header, "code": "x"},
        ("header", "teeth_flexspline", "120.5", "integer"): {
            **header,
            "teeth_flexspline": 120.5,
        },
        ("teeth", "120", "0", "flexspline", "circular"): {
            **header,
            "teeth_circular_spline": 120,
        },
        (
            "layout",
            "'x'",
            "circular_spline_fixed",
            "flexspline_fixed",
            "wave_generator_fixed",
        ): {**header, "layout": "x"},
        ("ratings", "-1.0", "N·m", "> 0 N·m"): {
            **header,
            "ratings": {**ratings, "T1": -1.0},
        },
        ("header", "ratings.rated_torque", "number"): {
            **header,
            "ratings": {**ratings, "rated_torque": 10**400},
        },
        ("damping ratio", "-1.0", "0", "10"): {**header, "damping_ratio": -1},
        ("header", "JSON", "object"): [1, 2],
        ("header", "JSON", "line 1", "column 2"): b"{" * 100_000,
        ("header", "JSON", "NaN"): b'{"a": NaN}',
        ("header", "JSON", "4300 digits"): b'{"a": ' + b"9" * 100_000 + b"}",
        ("header", "JSON", "'utf-8'", "position 7"): b'{"a": "\xff"}',
    }
    for parts, changed in cases.items():
        message = refusal(tmp_path, repacked(data, header=header_npy(changed)))
        assert names(message, *parts), message


@pytest.mark.parametrize(
    ("version", "new"),
    [
        (1, {"hysteresis", "friction", "fields_period_rad"}),
        (2, {"friction", "fields_period_rad"}),
        (3, {"fields_period_rad"}),
    ],
)
def test_an_older_file_is_read_without_what_is_new(
    synthetic_map, tmp_path, version, new
):
    """A map from before hysteresis, friction and ratcheting, or fields, has none."""
    data = map_bytes(synthetic_map)
    header = {k: v for k, v in header_of(data).items() if k not in new}
    del header["ratings"]["ratcheting_torque"]
    path = tmp_path / "old.swg"
    old = header_npy({**header, "schema_version": version})
    path.write_bytes(repacked(data, header=old))
    assert same(DriveMap.load(path), synthetic_map)


@pytest.mark.parametrize(
    ("elements", "says"),
    [
        (
            [{"stiffness_Nm_rad": -1.0, "yield_torque_Nm": 1.0}],
            ("hysteresis", "stiffness", "-1.0 N·m/rad", "> 0"),
        ),
        (
            [{"stiffness_Nm_rad": 1.0, "yield_torque_Nm": 0.0}],
            ("hysteresis", "yield_torque", "0.0 N·m", "> 0"),
        ),
        (
            [{"stiffness_Nm_rad": 1e99, "yield_torque_Nm": 1.0}],
            ("hysteresis", "stiffness", "1e+99 N·m/rad", "> 0"),
        ),
        (
            [{"stiffness_Nm_rad": 1.0}],
            ("hysteresis[0].yield_torque_Nm", "number", "N·m"),
        ),
        (
            [{"stiffness_Nm_rad": 1.0, "yield_torque_Nm": "1"}],
            ("hysteresis[0].yield_torque_Nm", "'1'", "number"),
        ),
        (
            [{"stiffness_Nm_rad": 1.0, "yield_torque_Nm": 1.0}] * 65,
            ("hysteresis", "'synthetic'", "64"),
        ),
        ("much", ("header", "hysteresis", "'much'", "list")),
    ],
)
def test_hostile_hysteresis(synthetic_map, tmp_path, elements, says):
    """Elements that cannot be, or too many of them, are refused in one line."""
    data = map_bytes(synthetic_map)
    header = header_npy({**header_of(data), "hysteresis": elements})
    assert names(refusal(tmp_path, repacked(data, header=header)), *says)


_RUBS = {
    "stiffness_Nm_rad": 50.0,
    "coulomb_Nm": 0.05,
    "static_Nm": 0.07,
    "stribeck_speed_rad_s": 1.0,
    "viscous_Nms_rad": 1e-3,
    "load": 0.1,
    "bending_Nm": 0.0,
    "damping_Nms_rad": 0.0,
    "source": "given",
}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stiffness_Nm_rad": 0.0}, ("friction", "stiffness", "0.0 N·m/rad", "> 0")),
        ({"coulomb_Nm": -0.1}, ("friction", "coulomb", "-0.1 N·m", ">= 0")),
        (
            {"static_Nm": 0.01},
            ("friction", "static", "0.01 N·m", "coulomb", "0.05 N·m"),
        ),
        ({"viscous_Nms_rad": 1e99}, ("friction", "viscous", "1e+99 N·m·s/rad", ">= 0")),
        ({"load": "much"}, ("header", "friction.load", "'much'", "number")),
        ({"source": 1.0}, ("header", "friction.source", "1", "string")),
        ({"more": 1.0}, ("header", "friction.more", *_RUBS)),
        ({"bending_Nm": None}, ("header", "friction.bending_Nm", "number", "N·m")),
    ],
)
def test_hostile_friction(synthetic_map, tmp_path, change, says):
    """Friction that cannot be, or of other keys, is refused in one line."""
    data = map_bytes(synthetic_map)
    friction = {k: v for k, v in {**_RUBS, **change}.items() if v is not None}
    header = header_npy({**header_of(data), "friction": friction})
    assert names(refusal(tmp_path, repacked(data, header=header)), *says)


def test_hostile_ratcheting(synthetic_map, tmp_path):
    """A ratcheting torque that is none is refused in one line."""
    data = map_bytes(synthetic_map)
    header = header_of(data)
    header["ratings"]["ratcheting_torque"] = -3.0
    message = refusal(tmp_path, repacked(data, header=header_npy(header)))
    assert names(message, "ratcheting torque", "-3.0 N·m", "> 0 N·m")


def test_what_is_not_a_file(tmp_path):
    """A folder, a missing file and a device are refused in one line."""
    with pytest.raises(MapFileError, match=naming(str(tmp_path), "file")):
        DriveMap.load(tmp_path)
    with pytest.raises(MapFileError, match=naming("none.swg", "No such file")):
        DriveMap.load(tmp_path / "none.swg")
    with pytest.raises(MapFileError, match=naming("/dev/zero", "file")):
        DriveMap.load("/dev/zero")


def test_an_unsound_map_is_not_written(synthetic_map, tmp_path):
    """What the reader would refuse is not written, and nothing is left behind."""
    falling = replace(synthetic_map, potential=-synthetic_map.potential)
    with pytest.raises(ValueError, match=naming("torque", "torsion")):
        falling.save(tmp_path / "a.swg")
    with pytest.raises(
        InputError, match=naming(str(tmp_path / "none" / "a.swg"), "No such file")
    ):
        synthetic_map.save(tmp_path / "none" / "a.swg")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("pruned", "x"),
        ("pruned", {"dropped": [[3, 1]]}),
        ("residual", [1]),
        ("energy_check", 3),
        ("stiffness_range_Nm_rad", ["a", "b"]),
        ("stated", "x"),
        ("stated", {"transmission_accuracy_arcmin": "x"}),
        ("missing", ["x"]),
        ("label", 1e308),
        ("sampled_torque_Nm", [1.0]),
        ("kinematic_error", {}),
        ("hysteresis_left_out", "two"),
    ],
)
def test_a_record_of_another_kind_is_left_out(synthetic_map, tmp_path, key, value):
    """One warning names the key; the drive, its other keys and its figures stay."""
    file = tmp_path / "map.swg"
    replace(synthetic_map, info={"note": [1, "x"], key: value}).save(file)
    with pytest.warns(UserWarning, match=f"info {key} ignored") as told:
        drive = DriveMap.load(file)
    assert len(told) == 1
    assert drive.info == {"note": [1, "x"]}
    assert drive.pruned(1.0).info["pruned"]["harmonics"] >= 0


def test_a_record_of_this_package_is_kept(synthetic_map, tmp_path):
    """What pruning and the catalogue write is read without a warning."""
    for name, drive in (
        ("pruned", synthetic_map.pruned(1.0)),
        ("catalogue", DriveMap.from_catalogue("CSG-25-100")),
    ):
        drive.save(tmp_path / f"{name}.swg")
        assert DriveMap.load(tmp_path / f"{name}.swg").info == plain(drive.info)


@pytest.mark.parametrize(
    ("value", "says"),
    [("\\udc80", ("not", "Unicode")), ("[" * 40 + "]" * 40, ("nested", "30"))],
)
def test_a_header_that_cannot_be_written_is_refused(
    synthetic_map, tmp_path, value, says
):
    """Half a character and records without end are one line."""
    text = f'"{value}"' if value.startswith("\\") else value
    data = map_bytes(replace(synthetic_map, info={"note": "@"}))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = np.load(io.BytesIO(members["header.npy"])).tobytes()
    header = header.replace(b'"@"', text.encode())
    buffer = io.BytesIO()
    np.save(buffer, np.frombuffer(header, dtype=np.uint8))
    members["header.npy"] = buffer.getvalue()
    file = tmp_path / "map.swg"
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(MapFileError, match=naming("map.swg", *says)):
        DriveMap.load(file)


def test_a_map_that_cannot_be_read_is_not_written(synthetic_map, tmp_path):
    """The writer refuses in one line what the reader would."""
    drive = replace(synthetic_map, kinematic_error=synthetic_map.kinematic_error + 4.0)
    with pytest.raises(InputError, match=naming("'synthetic'", "half a turn")):
        drive.save(tmp_path / "a.swg")
    assert list(tmp_path.iterdir()) == []


def test_yield_curves_come_back_and_only_they_change_the_version(synthetic_map):
    """Elements with a curve return equal; a map without has no trace of the key."""
    loaded = Jenkin(
        stiffness=9e4, yield_torque=0.0, yield_curve=((15.0, 5.0), (60.0, 1.0))
    )
    plain = Jenkin(stiffness=2e4, yield_torque=2.0)
    data = map_bytes(replace(synthetic_map, hysteresis=(loaded, plain)))
    assert map_from_bytes(data, DriveMap).hysteresis == (loaded, plain)
    assert header_of(data)["schema_version"] == 5
    assert "yield_curve_Nm" not in header_of(data)["hysteresis"][1]
    old = header_of(map_bytes(replace(synthetic_map, hysteresis=(plain,))))
    assert old["schema_version"] == 4
    assert set(old["hysteresis"][0]) == {"stiffness_Nm_rad", "yield_torque_Nm"}
