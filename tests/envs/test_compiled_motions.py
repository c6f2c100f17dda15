"""Compiled motions and plans of the environments have the bits of the numpy code."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.envs.references import KINDS, Instants, draw_motion
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)
LIMITS = {"max_speed": 0.6, "max_angle": 1.0, "max_acceleration": 50.0}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [11, 37, 500, 2001])
def test_motions_are_those_of_numpy(monkeypatch, kind, count):
    """Whole motions and parts of them, also of few instants."""
    instants = Instants(np.linspace(0.0, 1.9, count + 1))
    parts = [slice(None), slice(count // 3, count), slice(count, count + 1)]

    def draw(seed):
        rng = np.random.default_rng(seed)
        drawn, values = draw_motion(instants, rng, kinds=(kind,), **LIMITS)
        rows = [values, *(drawn.sample(instants, part) for part in parts)]
        return [one for row in rows for one in row]

    compiled = [draw(seed) for seed in range(20)]
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    for seed, got in enumerate(compiled):
        for one, want in zip(got, draw(seed), strict=True):
            np.testing.assert_array_equal(one, want, strict=True)


@pytest.mark.parametrize("first", [0, 1, 40, 50])
def test_plans_are_those_of_numpy(first):
    """The motion begins late, or never within the plan."""
    rng, n = np.random.default_rng(first), 50
    motion = rng.normal(size=(3, n - first))
    ramp, load, inertia = rng.uniform(size=n), -31.7, 1.3
    plan = np.full((n, 5), np.nan)
    kernels().write_plan(*motion, load, ramp, inertia, plan)
    want = np.zeros((n, 5))
    want[first:, :3] = motion.T
    want[:, 3] = load * ramp
    want[:, 4] = want[:, 3] + inertia * want[:, 2]
    np.testing.assert_array_equal(plan, want)


def test_wrong_shapes_are_refused():
    """A wrong shape would read or write beyond the end of an array."""
    native, row, motion = kernels(), np.zeros(4), np.zeros((3, 4))
    waves, step = np.zeros((2, 4)), np.ones(4)
    for arguments in (
        (waves, waves[:1], row[:2], row[:2], 0.0, row, row, row, motion),
        (waves, waves, row[:3], row[:2], 0.0, row, row, row, motion),
        (waves, waves, row[:2], row[:2], 0.0, row[:3], row, row, motion),
        (waves, waves, row[:2], row[:2], 0.0, row, row, row, motion[:2]),
        (waves[:0], waves[:0], row[:0], row[:0], 0.0, row, row, row, motion),
    ):
        with pytest.raises(ValueError, match=r"sin, cos|ramp|result"):
            native.grow_oscillation(*arguments)
    for arguments in ((row, step[:3], step, motion), (row[:3], step, step, motion)):
        with pytest.raises(ValueError, match=r"there|result"):
            native.move_back(*arguments)
    for arguments in (
        (row, row, row[:3], 0.0, row, 1.0, np.zeros((4, 5))),
        (row, row, row, 0.0, row[:3], 1.0, np.zeros((3, 5))),
        (row, row, row, 0.0, row, 1.0, np.zeros((4, 4))),
    ):
        with pytest.raises(ValueError, match=r"position|result"):
            native.write_plan(*arguments)
