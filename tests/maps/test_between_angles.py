"""Samples at unequally spaced angles: transfer to equal steps, doubts, mirror image."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.maps.fit.between_angles import (
    FADED,
    SHORTEST,
    doubt_between,
    even_steps,
    finer_steps,
    missed_by_neighbours,
    spread_evenly,
    steps_to_divide,
    with_mirrored_torques,
)

COUNT = 24
UNEVEN = np.sort(np.append(np.arange(COUNT) / COUNT, [4.5 / COUNT, 5.5 / COUNT]))


def corner(parts, place):
    """A wave with a corner of its slope at one place."""
    return np.cos(2.0 * np.pi * parts) + np.abs(np.sin(np.pi * (parts - place)))


def test_equal_steps_keep_samples_and_follow_a_wave():
    """Samples are unchanged; between them a wave is met to the order of the spline."""
    values = np.stack([np.cos(2 * np.pi * UNEVEN), np.sin(4 * np.pi * UNEVEN)], axis=1)
    even = even_steps(UNEVEN, COUNT)
    assert even == 2 * COUNT
    spread = spread_evenly(UNEVEN, values, even)
    own = np.round(UNEVEN * even).astype(int)
    assert (spread[own] == values).all()
    at = np.arange(even) / even
    wanted = np.stack([np.cos(2 * np.pi * at), np.sin(4 * np.pi * at)], axis=1)
    # fourth power of the step: 5/384 (2 pi / 12)^4 = 1e-3 of the faster wave
    assert np.abs(spread - wanted).max() < 1e-3
    # linear in the samples, so that e stays the slope of G over the torque
    twice = spread_evenly(UNEVEN, values @ np.array([2.0, -3.0]), even)
    assert twice == pytest.approx(spread @ np.array([2.0, -3.0]), abs=1e-13)


def test_equally_spaced_samples_are_returned_as_they_are():
    """Maps without additional angles keep their tables to the last bit."""
    parts = np.arange(COUNT) / COUNT
    values = np.random.default_rng(3).normal(size=(COUNT, 2))
    assert even_steps(parts, COUNT) == COUNT
    assert spread_evenly(parts, values, COUNT) is values
    assert (finer_steps(parts, COUNT) == 1.0).all()


def test_shorter_steps_are_counted_on_both_sides():
    """The samples next to an additional one have a short step, too."""
    finer = finer_steps(UNEVEN, COUNT)
    assert (finer == np.isin(UNEVEN * COUNT, [4, 4.5, 5, 5.5, 6]) + 1.0).all()


def test_neighbours_predict_a_cubic():
    """Away from the ends of the period, where it is not periodic."""
    cubic = 1.0 + UNEVEN - 3.0 * UNEVEN**2 + 2.5 * UNEVEN**3
    missed = missed_by_neighbours(UNEVEN, cubic)
    assert np.abs(missed[2:-2]).max() < 1e-13
    assert np.abs(missed[[0, 1, -2, -1]]).min() > 1e-3


@pytest.mark.parametrize("place", [10.5, 3.3, 23.6])
def test_steps_at_a_corner_are_divided(place):
    """The step that contains it, or the one next to it, comes first."""
    parts = np.arange(COUNT) / COUNT
    flat = np.zeros(COUNT)
    doubt = doubt_between(
        parts, 1.0, np.stack([flat, corner(parts, place / COUNT)]), (1, 1)
    )
    worst = int(doubt.argmax())
    assert abs((worst + 0.5 - place + 12.0) % COUNT - 12.0) < 1.0
    (divided,) = steps_to_divide(parts, doubt, 0.0, COUNT, 1)
    assert divided * COUNT == pytest.approx(worst + 0.5)
    assert steps_to_divide(parts, doubt, 1.01 * doubt.max(), COUNT, 9) == []
    assert steps_to_divide(parts, doubt, 0.0, COUNT, -1) == []
    # steps that are already short stay as they are
    fine = np.arange(SHORTEST * COUNT) / (SHORTEST * COUNT)
    assert steps_to_divide(fine, np.ones(fine.size), 0.0, COUNT, 9) == []


def test_mirrored_tables_agree_without_load_and_keep_the_loaded_ones():
    """Interpolated angles shift the unloaded table only: at load, M would change."""
    count, even = COUNT, 2 * COUNT
    theta = 2.0 * np.pi * np.arange(even) / even
    odd, even_part = np.sin(theta), np.cos(theta)
    table = np.stack([odd, even_part, 2.0 + even_part, odd])
    rest = table.copy()
    rest[0, 9] += 1e-3  # an angle that was solved; its mirror image was not
    tables = {0.0: rest, 0.5 * FADED: table, 1.0: table}
    found = with_mirrored_torques(tables, count)
    back = np.roll(found[0.0][:, ::-1], 1, axis=1)
    assert found[0.0][0] == pytest.approx(-back[0], abs=1e-15)
    assert found[1.0] == pytest.approx(table, abs=1e-12)
    assert found[0.5 * FADED][0, 9] - table[0, 9] == pytest.approx(-0.25e-3)
    # a difference at equally spaced angles shifts all tables
    rest[0, 9] -= 1e-3
    rest[0, 8] += 1e-3
    found = with_mirrored_torques({0.0: rest, 1.0: table}, count)
    assert found[1.0][0, 8] - table[0, 8] == pytest.approx(-0.5e-3)
