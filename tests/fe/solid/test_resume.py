"""Equilibria in space in files: they come back, and a pattern goes on from them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.fe.common.mesh_cycle import Effort, solve_mesh_cycle
from swgjoint.fe.common.state_arrays import copy_contiguous, pack, unpack
from swgjoint.fe.solid.checkpoint import Checkpoint
from swgjoint.maps import unfinished
from swgjoint.maps.unfinished import Unfinished, UnfinishedSeries
from swgjoint.store import arrays_file

pytestmark = pytest.mark.fe


def assert_same(one: object, other: object) -> None:
    """Equal to the last bit, all parts of the same type."""
    assert type(one) is type(other)
    if is_dataclass(one):
        for item in fields(one):
            assert_same(getattr(one, item.name), getattr(other, item.name))
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other or (one != one and other != other)


def test_a_state_comes_back_from_a_file(loaded, tmp_path, caplog):
    """By both ways; a damaged one is solved again, or refused where going on is asked.

    The user who says ``--resume`` relies on the states that are there.
    """
    keep = Unfinished(folder=tmp_path / "map")
    keep.write("a", pack(loaded, "state"))
    found = keep.read("a", lambda arrays: unpack(arrays, "state"))
    assert_same(found, copy_contiguous(loaded))
    kept = Checkpoint.open(tmp_path / "run", {"steps": 2}, resume=False)
    kept.write("a", loaded)
    asked = Checkpoint.open(tmp_path / "run", {"steps": 2}, resume=True)
    same = Checkpoint.open(tmp_path / "run", {"steps": 2}, resume=False)
    path = tmp_path / "run" / "a.npz"
    for again in (asked, same):
        assert_same(again.read("a"), copy_contiguous(loaded))
        assert again.read("b") is None
    for damaged in (path.read_bytes()[:-99], arrays_file({"state.kind": "State"})):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=naming("--resume", str(path))):
            asked.read("a")
        caplog.clear()
        assert same.read("a") is None
        assert names(caplog.text, str(path), "computed again")


def test_nothing_in_a_folder_of_states_is_removed(tmp_path):
    """The same run goes on; another one, its damaged record and foreign files stay."""
    folder = tmp_path / "states"
    folder.mkdir()
    (folder / "precious.npz").write_text("mine")
    with pytest.raises(InputError, match=naming("precious.npz", "--resume", "--out")):
        Checkpoint.open(folder, {"steps": 2}, resume=False)
    assert [path.name for path in folder.iterdir()] == ["precious.npz"]
    run = tmp_path / "run"
    Checkpoint.open(run, {"steps": 2}, resume=False)
    (run / "meshed.npz").write_text("hours of work")
    for resume in (False, True):
        assert Checkpoint.open(run, {"steps": 2}, resume=resume).count == 1
    record = (run / "run.json").read_bytes()
    for resume in (False, True):
        with pytest.raises(InputError, match=naming("steps", "--resume", "--out")):
            Checkpoint.open(run, {"steps": 3}, resume=resume)
        for damaged in (b"[]", b'{"steps": 2}', record.replace(b"2", b"3")):
            (run / "run.json").write_bytes(damaged)
            with pytest.raises(InputError, match=naming("run.json", "--out")):
                Checkpoint.open(run, {"steps": 2}, resume=resume)
        (run / "run.json").write_bytes(record)
    assert {path.name for path in run.iterdir()} == {"run.json", "meshed.npz"}
    with pytest.raises(InputError, match=naming("--resume", "none")):
        Checkpoint.open(tmp_path / "none", {"steps": 2}, resume=True)


class Stop(Exception):
    """An interruption."""


@pytest.mark.slow
def test_a_pattern_in_space_goes_on_bit_for_bit(monkeypatch, small_drive, tmp_path):
    """Interrupted at the second equilibrium of the third position; none is lost."""
    period = 2.0 * np.pi / 42
    effort = Effort(angles=4, most_angles=4, solves=0, unseen=(1, 1), torques=4)
    solves = 0

    def tick() -> None:
        nonlocal solves
        solves += 1

    def stop() -> None:
        tick()
        if solves == 6:
            raise Stop

    def solve(tick, **options):
        return solve_mesh_cycle(
            small_drive,
            period,
            [5.0],
            effort,
            small=0.05,
            rated=5.0,
            symmetric=True,
            tick=tick,
            **options,
        )

    monkeypatch.setattr(unfinished, "SHARED", 0.0)
    keep = Unfinished(folder=tmp_path)
    with pytest.raises(Stop):
        solve(stop, keep=UnfinishedSeries(keep=keep, name="solve-{}"))
    kept = len(list(tmp_path.iterdir()))
    solves = 0
    found = solve(tick, keep=UnfinishedSeries(keep=keep, name="solve-{}"))
    written = len(list(tmp_path.iterdir())) - kept
    # one of the next pitch, the mirror image that no progress counts, one to judge
    # with its torque and another one
    assert (kept, solves, written) == (6, 12, 7)
    whole = solve(tick)
    np.testing.assert_array_equal(found.table, whole.table)
    assert found.info == whole.info
