"""The batched environment is faster than gymnasium's loop over single ones."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "env_throughput.py"


@pytest.mark.slow
@pytest.mark.parametrize("randomise", [False, True])
def test_batched_is_at_least_three_times_as_fast(randomise):
    """256 environments in one run, the same actions in turns; a median of rounds."""
    compare = runpy.run_path(str(BENCHMARK))["compare"]
    got = compare(256, 2, rounds=3, steps=50, randomise=randomise)
    assert got["ratio"] > 3.0
