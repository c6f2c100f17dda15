"""Hostile files and arguments: one line, status 0, 1 or 2, whatever they hold."""

from __future__ import annotations

import pytest
from hostile import KINDS, draw
from hostile.laws import answer, broken_laws

COUNT = 32
"""Inputs of each kind."""


@pytest.mark.parametrize("kind", KINDS)
def test_laws_of_bad_input(kind, tmp_path):
    """No exception, no long line, no NaN in JSON and no litter for any input."""
    faults = []
    for seed in range(COUNT):
        case = draw(kind, seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        for law in broken_laws(case, answer(case, folder)):
            faults.append(f"{kind} {seed}: {' '.join(case.argv)[:100]}: {law}")
    assert not faults, "\n".join(faults)
