"""What a run keeps: whole, checked, and nothing left behind."""

from __future__ import annotations

import hashlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pytest

from swgjoint.files import whole, write_whole
from swgjoint.store import (
    DamagedError,
    arrays_content,
    arrays_file,
    cache_folder,
    join_arrays,
    json_content,
    json_file,
    read_kept,
    split_arrays,
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """What a store may keep."""

    outcome: str
    figures: Mapping[str, float | None]


ROW = Row(outcome="Größe", figures={"a": 0.1 + 0.2, "b": None})
ARRAYS = {"x": np.arange(5.0) / 3.0, "name": "Größe"}
JSON, NPZ = json_file(asdict(ROW)), arrays_file(ARRAYS)


def read_json(data: bytes) -> Row:
    return json_content(data, Row)


KINDS = pytest.mark.parametrize(
    ("data", "read"),
    [
        pytest.param(JSON, read_json, id="json"),
        pytest.param(NPZ, arrays_content, id="npz"),
    ],
)


def test_content_comes_back_and_other_programs_read_it():
    """The same numbers to the last bit; the files are plain JSON and NPZ."""
    assert read_json(JSON) == ROW
    found = arrays_content(NPZ)
    assert np.array_equal(found["x"], ARRAYS["x"]) and str(found["name"]) == "Größe"
    plain = json.loads(JSON)
    assert len(plain.pop("sha256")) == 64 and plain == asdict(ROW)
    assert np.array_equal(np.load(io.BytesIO(NPZ))["x"], ARRAYS["x"])


def test_joined_arrays_come_back():
    """Types, shapes and bits, whatever the sizes."""
    arrays = {
        **ARRAYS,
        "number": 0.1 + 0.2,
        "none": np.zeros((0, 3)),
        "mask": np.eye(3, dtype=bool).T,
        "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3) / 7.0),
        "count": np.int64(7),
        "zeros": np.array([0.0, -0.0, 0.0, 2.5, 0.0]),
    }
    stored = arrays_file(join_arrays(arrays), level=0)
    found = split_arrays(arrays_content(stored))
    assert list(found) == list(arrays)
    for key, value in arrays.items():
        assert found[key].dtype == np.asarray(value).dtype
        assert found[key].shape == np.shape(value)
        assert found[key].tobytes() == np.asarray(value).tobytes()
        assert found[key].flags.writeable


def test_zeros_of_joined_arrays_take_no_space():
    """Most entries of the equilibria of a map are zero."""
    sparse = np.zeros(80000)
    sparse[::1000] = 1.0
    assert len(arrays_file(join_arrays({"sparse": sparse}), level=0)) < 20000


@KINDS
def test_every_flipped_bit_is_noticed(data, read):
    """No single bit may change without the file being refused as damaged."""
    for k in range(len(data)):
        for bit in range(0, 8, 3):
            flipped = bytearray(data)
            flipped[k] ^= 1 << bit
            with pytest.raises(DamagedError):
                read(bytes(flipped))


@KINDS
def test_half_a_file_is_noticed(data, read):
    """However much of it is missing."""
    for k in range(len(data)):
        with pytest.raises(DamagedError):
            read(data[:k])


@pytest.mark.parametrize(
    "body",
    [
        b"[]",
        b"3",
        b'{"outcome": 3, "figures": {}}',
        b'{"outcome": "ok"}',
        b'{"outcome": "ok", "figures": {"a": "0.3"}}',
        b'{"outcome": "ok", "figures": ' + b"[" * 5000 + b"]" * 5000 + b"}",
        b'{"outcome": "\xff", "figures": {}}',
    ],
)
def test_other_types_are_damage(body):
    """The checksum is right, the content is not what a run keeps."""
    digest = hashlib.sha256(b"{" + body[1:]).hexdigest().encode()
    with pytest.raises(DamagedError):
        read_json(b'{\n  "sha256": "%s",' % digest + body[1:])


@pytest.mark.parametrize(
    "error", [RecursionError, MemoryError, NotImplementedError, EOFError, KeyError]
)
def test_whatever_a_reader_raises_is_one_warning(tmp_path, caplog, error):
    """A store computes again what it cannot use, for any reason."""
    path = tmp_path / "a.json"
    path.write_bytes(JSON)
    assert read_kept(path, read_json) == ROW and not caplog.records

    def broken(data: bytes) -> Row:
        raise error

    assert read_kept(path, broken) is None
    (record,) = caplog.records
    assert str(path) in record.getMessage()
    caplog.clear()
    assert read_kept(tmp_path / "none.json", read_json) is None
    assert not caplog.records


def test_a_pipe_is_not_waited_for(tmp_path):
    """A kept file that is not regular counts as damaged: a pipe would never end."""
    os.mkfifo(tmp_path / "pipe")
    assert read_kept(tmp_path / "pipe", read_json) is None


KILLED = """
import os, sys
from pathlib import Path
from swgjoint.files import whole

with whole(Path(sys.argv[1])) as beside:
    beside.write_bytes(b"half")
    os.kill(os.getpid(), 9)
"""


def test_the_next_write_clears_what_a_killed_one_left(tmp_path):
    """Only temporary files of this target, and not those of a process that runs."""
    target = tmp_path / "a.json"
    subprocess.run([sys.executable, "-P", "-c", KILLED, str(target)], check=False)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".a.json.")
    other = tmp_path / left.name.replace("a.json", "b.json")
    other.write_bytes(b"of another target")
    with whole(target) as running:
        assert not left.exists()
        running.write_bytes(b"first")
        write_whole(target, b"second")
    assert target.read_bytes() == b"first"
    assert sorted(tmp_path.iterdir()) == [other, target]


@pytest.mark.parametrize("mask", [0o002, 0o027, 0o077])
def test_files_follow_the_umask(tmp_path, mask):
    """The mode is that of any file that a program makes."""
    before = os.umask(mask)
    try:
        path = write_whole(tmp_path / "a", b"x")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


def test_platform_folder(monkeypatch):
    """Without the variable the folder follows the platform; relative XDG is ignored."""
    monkeypatch.delenv("SWGJOINT_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x/cache")
    assert cache_folder() == Path("/x/cache/swgjoint")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache_folder() == Path.home() / ".cache" / "swgjoint"
