"""Equilibria in space in files: they come back, and a pattern goes on from them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from swgjoint.errors import InputError
from swgjoint.fe.pattern import Effort, solve_pattern
from swgjoint.fe.solid.checkpoint import Checkpoint
from swgjoint.fe.state_arrays import packed, settled, unpacked
from swgjoint.maps.unfinished import Unfinished

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


def test_a_state_comes_back_from_a_file(loaded, tmp_path):
    """By both ways, and a run of meshing refuses a file that is damaged."""
    keep = Unfinished(folder=tmp_path / "map")
    keep.write("a", packed(loaded, "state"))
    assert_same(unpacked(keep.read("a"), "state"), settled(loaded))
    kept = Checkpoint.open(tmp_path / "run", {"steps": 2}, resume=False)
    kept.write("a", loaded)
    again = Checkpoint.open(tmp_path / "run", {"steps": 2}, resume=True)
    assert_same(again.read("a"), settled(loaded))
    assert again.read("b") is None
    path = tmp_path / "run" / "a.npz"
    path.write_bytes(path.read_bytes()[:-99])
    with pytest.raises(InputError, match=r"a\.npz"):
        again.read("a")


class Stop(Exception):
    """An interruption."""


@pytest.mark.slow
def test_a_pattern_in_space_goes_on_bit_for_bit(small_drive, tmp_path):
    """Interrupted at the second position, which alone is solved again."""
    period = 2.0 * np.pi / 42
    effort = Effort(angles=2, most_angles=2, solves=0, unseen=(1, 1), torques=4)
    solves = 0

    def tick() -> None:
        nonlocal solves
        solves += 1

    def stop() -> None:
        tick()
        if solves == 3:
            raise Stop

    def solve(tick, **options):
        return solve_pattern(
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

    keep = Unfinished(folder=tmp_path)
    with pytest.raises(Stop):
        solve(stop, keep=keep)
    solves, restored = 0, []
    found = solve(tick, keep=keep, restored=restored.append)
    # the second position, one of the next pitch, one to judge with its torque
    assert (solves, restored) == (6, [2])
    whole = solve(tick)
    np.testing.assert_array_equal(found.table, whole.table)
    assert found.info == whole.info
