"""Torques of the table of a map, where the compliance jumps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import PPoly

from swgjoint.fe.common.columns.torque_choice import (
    FEWEST_TORQUES,
    KINK,
    MISSED_JUMPS,
    MOST_MISSED,
    TABLE_GOAL,
    common_torques,
)
from swgjoint.fe.common.load_path import LoadPath
from swgjoint.maps.fit.torsion_table import interpolate_on_knots
from swgjoint.maps.quartic import quartic_chain

COMPLIANCE, TOP, ANGLES = 6e-5, 40.0, 24
SOLVED = np.linspace(0.0, TOP, 9)


def paths(jump: float) -> list[LoadPath]:
    """Load paths of a drive whose compliance jumps in every interval.

    The place in the interval moves with the angle.

    Args:
        jump: Height of the jumps [rad/(N·m)].
    """
    curves = []
    for k in range(ANGLES):
        places = SOLVED[:-1] + np.diff(SOLVED) * (k + 0.5) / ANGLES
        over = np.maximum(SOLVED[:, None] - places, 0.0)
        before = np.minimum(SOLVED[:, None], places)
        apart = 0.5 * (SOLVED[:, None] ** 2 - before**2)
        curves.append(
            LoadPath(
                torque=SOLVED,
                output_error=-COMPLIANCE * SOLVED - jump * over.sum(axis=1),
                energy=0.5 * COMPLIANCE * SOLVED**2 + jump * apart.sum(axis=1),
                compliance=COMPLIANCE + jump * (over > 0.0).sum(axis=1),
            )
        )
    return curves


def chosen(jump: float, height: float, most: int) -> np.ndarray:
    """Torques of the table if the ripple grows from ``height`` [rad] to its tenfold."""
    return common_torques(
        paths(jump),
        {float(t) for t in SOLVED[1:]},
        0.0,
        most,
        (np.array([0.0, TOP]), height * np.array([1.0, 10.0])),
    )


def test_a_table_is_as_dense_as_the_jumps_require():
    """At most jumps the error of the map is below the goal; the solved torques stay."""
    jump, height = 2e-6, 5e-6
    table = chosen(jump, height, 500)
    assert set(SOLVED[1:]) <= set(table)
    assert FEWEST_TORQUES < table.size < 500
    place = np.sort(np.concatenate([curve.jumps[0] for curve in paths(jump)]))
    assert place.size == 8 * ANGLES
    ends = np.concatenate([[0.0], table])
    apart = np.diff(ends)[np.searchsorted(table, place)]
    part = KINK * jump * apart / (height * (1.0 + 9.0 * place / TOP))
    assert (part > TABLE_GOAL).sum() <= MISSED_JUMPS * ANGLES
    assert part.max() <= MOST_MISSED
    # denser where the ripple is small
    low, high = (
        np.median(np.diff(table[(table > part * TOP) & (table < (part + 0.25) * TOP)]))
        for part in (0.0, 0.75)
    )
    assert low < 0.5 * high


def test_jumps_of_many_angles_leave_torques_for_a_single_one():
    """All angles but one jump at the same torque, and that one 1 N·m further on."""
    jump, height = 3e-5, 5e-6
    solved = np.linspace(0.0, TOP, 3)
    curves = []
    for place in [21.7] * (ANGLES - 1) + [22.7]:
        over = np.maximum(solved - place, 0.0)
        apart = 0.5 * (solved**2 - np.minimum(solved, place) ** 2)
        curves.append(
            LoadPath(
                torque=solved,
                output_error=-COMPLIANCE * solved - jump * over,
                energy=0.5 * COMPLIANCE * solved**2 + jump * apart,
                compliance=COMPLIANCE + jump * (over > 0.0),
            )
        )
    heights = np.array([0.0, TOP]), np.full(2, height)
    table = common_torques(curves, {float(t) for t in solved[1:]}, 0.0, 200, heights)
    for place in (21.7, 22.7):
        after = np.searchsorted(table, place)
        apart = table[after] - table[after - 1]
        assert KINK * jump * apart / height <= MOST_MISSED
    assert table.size < FEWEST_TORQUES + 20


def test_a_table_stays_within_its_largest_size():
    """The largest number of added torques, and the fewest without jumps."""
    assert chosen(2e-5, 5e-6, 60).size <= 60 + SOLVED.size - 1
    assert chosen(0.0, 5e-6, 500).size <= FEWEST_TORQUES + SOLVED.size - 1
    assert chosen(2e-5, 5e-6, 10).size <= 10 + SOLVED.size - 1


@pytest.mark.parametrize("shift", [0.0, 0.13, 0.37, 0.5])
def test_a_map_rounds_a_kink_by_a_fraction_of_the_jump(shift):
    """Torque at a jump of the stiffness by 1, between knots that are 1 apart."""

    def kinked(x, place):
        over = np.maximum(x - place, 0.0)
        return np.array([0.5 * over**2, over, x > place], dtype=float)

    worst = []
    for place in np.linspace(0.01, 0.99, 50):
        sampled, knots = np.arange(-3.0, 5.0) + shift, np.arange(-2.0, 4.0)
        curve = kinked(sampled, place)[:, :, None]
        values = interpolate_on_knots(sampled[:, None], curve, knots)[0]
        x = np.linspace(-2.0, 3.0, 501)
        breaks, pieces = quartic_chain(knots, values)
        smooth = PPoly(pieces.T[::-1], breaks)(x, 1)
        worst.append(np.abs(smooth - kinked(x, place)[1]).max())
    assert 0.7 * KINK < max(worst) < 1.01 * KINK
