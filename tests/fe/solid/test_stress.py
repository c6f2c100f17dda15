"""Stress recovery in space: frames of neighbours, the closure of a half model."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.stress import average_faces, average_sections
from swgjoint.fe.solid.strip.elasticity import COLUMNS, ROWS


@pytest.mark.parametrize("half", [False, True])
def test_one_stress_seen_from_every_sector_stays(half):
    """A uniform stress in frames that turn unevenly is its own average, all around."""
    rng = np.random.default_rng(4)
    stress = rng.normal(size=(3, 3))
    stress += stress.T
    stress[2, :2] = stress[:2, 2] = 0.0  # half a turn maps it onto itself
    angle = np.arange(6) * np.pi / (6 if half else 3) + 0.05 * rng.normal(size=6)
    turn = about_z(angle)
    seen = np.einsum("sji,jk,skl->sil", turn, stress, turn)
    parts = np.stack([seen[:, i, j] for i, j in zip(ROWS, COLUMNS, strict=True)], -1)
    nodal = np.repeat(parts[:, None], 4, axis=1)
    sign = -1.0 if half else 1.0
    closure = np.array([sign, sign, 1.0])
    averaged = nodal.copy()
    average_faces(averaged, turn, np.array([0, 1]), np.array([2, 3]), closure)
    assert averaged == pytest.approx(nodal, abs=1e-12)


def test_faces_get_the_mean_of_their_sectors():
    """Without turns a shared node has the mean of the two values, others stay."""
    nodal = np.arange(3 * 3 * 6, dtype=float).reshape(3, 3, 6)
    averaged = nodal.copy()
    turn = np.broadcast_to(np.eye(3), (3, 3, 3)).copy()
    average_faces(averaged, turn, np.array([0]), np.array([2]), np.ones(3))
    mean = 0.5 * (nodal[:, 2] + np.roll(nodal[:, 0], -1, axis=0))
    assert averaged[:, 2] == pytest.approx(mean)
    assert averaged[:, 0] == pytest.approx(np.roll(mean, 1, axis=0))
    assert averaged[:, 1] == pytest.approx(nodal[:, 1])


def test_sections_get_the_mean_of_their_segments():
    """One stress seen in two frames stays; another one moves half-way to it."""
    rng = np.random.default_rng(5)
    stress = rng.normal(size=(3, 3))
    stress += stress.T
    turns = tuple(np.linalg.qr(rng.normal(size=(4, 3, 3)))[0] for _ in range(2))
    one, other = (
        np.repeat(
            np.stack([seen[:, i, j] for i, j in zip(ROWS, COLUMNS, strict=True)], -1)[
                :, None
            ],
            3,
            axis=1,
        )
        for seen in (turn.transpose(0, 2, 1) @ stress @ turn for turn in turns)
    )
    sections = np.array([0, 1]), np.array([2, 0])
    before = one.copy(), other.copy()
    average_sections(one, other, turns, sections)
    assert one == pytest.approx(before[0], abs=1e-12)
    assert other == pytest.approx(before[1], abs=1e-12)
    other[:, 2] *= 3.0
    average_sections(one, other, turns, sections)
    assert one[:, 0] == pytest.approx(2.0 * before[0][:, 0])
    assert other[:, 2] == pytest.approx(2.0 * before[1][:, 2])
    assert one[:, 1:] == pytest.approx(before[0][:, 1:])
    assert other[:, :2] == pytest.approx(before[1][:, :2])
