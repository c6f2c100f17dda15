"""Maps against finite elements at torques and angles that no map has seen.

Most meshes have half as many elements in each direction as those of the designs, and
designs that need many angles have fewer teeth: a map takes 0.1 to 0.6 of the time.
``map_accuracy.py`` measures the figures of the designs themselves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from map_accuracy import DESIGNS, OTHERS, Compared, differences, scaled
from solved import few_teeth

from swgjoint.gear.design.design import Design

GOAL = (0.05, 0.02)
"""Largest and rms difference, in the peak to peak at the torque."""
FOUND = {
    "reference-2d of few teeth": (0.43, 0.37, 0.81),
    "reference-2d-dca of few teeth": (0.65, 0.42, 0.24),
    "reference-2d": (0.56, 0.30, 0.16),
    "reference-2d-dca": (0.78, 0.62, 0.099),
    "reference-2d-dca-improved": (0.89, 0.63, 0.050),
    "reference-2d-qca-improved": (0.96, 0.66, 0.052),
    "reference-2d-involute": (0.79, 0.41, 0.13),
    "reference-2d-flexspline-fixed": (0.94, 0.44, 0.052),
    "dca-80-to-1": (0.60, 0.94, 0.0038),
    "reference-2d-simplified of few teeth": (0.35, 0.29, 0.59),
    "reference-2d-four-roller": (0.53, 1.10, 0.036),
    "reference-2d-parabolic": (0.83, 1.35, 0.031),
    "reference-2d-asymmetric of few teeth": (1.95, 1.00, 0.14),
    "own-100 of few teeth": (0.47, 0.22, 0.011),
    "own-80": (0.20, 0.41, 0.49),
    "own-140 of few teeth": (0.60, 0.33, 0.094),
}
"""Rms difference of output error and of input torque, in the peak to peak [%], and
difference of the mean torsion [%], each at the worst torque. The goal alone would allow
an error of 5 % in the strongest harmonic."""
WORSE, LEAST = 1.4, 0.05
"""Factor by which these differences may grow, and what is always accepted [%]."""
OWN_MESH = ("dca-80-to-1", "reference-2d-parabolic")
"""Designs that need their own mesh: on the coarser one, maps are off by 7 and 12 % of
the input torque at small torques instead of 1.6 and 2.8 %. Flanks of few nodes need
more angles than the largest number of equilibria allows."""


def teeth(flexspline: int) -> dict[str, Any]:
    """Changes of a design of two lobes to a number of teeth."""
    return {
        "drive.teeth_flexspline": flexspline,
        "drive.teeth_circular_spline": flexspline + 2,
    }


COARSE: dict[str, Any] = {"mesh.refinement": 0.5}
FEW_TEETH: dict[str, dict[str, Any]] = {
    "reference-2d-simplified": COARSE | teeth(60),
    "reference-2d-asymmetric": {  # on its own mesh
        **teeth(60),
        "wave_generator.left.parabola_coefficient_per_mm": 0.0215,
        "wave_generator.left.connector_radius_mm": 5.0,
        "wave_generator.right.parabola_coefficient_per_mm": 0.0215,
        "wave_generator.right.connector_radius_mm": 6.0,
    },
    "own-100": COARSE | teeth(60),
    "own-140": COARSE | teeth(80),
}
"""Changes of the designs that need one to three minutes with all of their teeth."""
SCATTER = {"dca-80-to-1": 0.003}
"""Difference between equilibria at one position that were found from several starts, in
the peak to peak at the torque: points of conforming flanks replace each other. Three
starts gave errors of 7.00, 7.26 and 7.36 % of the input torque at 5.7 N·m."""
SEEN = 0.7
"""Smallest part of the largest difference at these equilibria that a record states."""


def check(name: str, design: Design) -> None:
    """Hold a map to the goal and to its own figures, and its record too."""
    compared = Compared(design)
    found, record = differences(compared, design), compared.record
    largest, rms = GOAL
    assert found[:, [1, 3]].max() < largest
    assert found[:, [2, 4]].max() < rms
    own = 100.0 * found[:, [2, 4, 5]].max(axis=0)
    assert (own < np.maximum(WORSE * np.array(FOUND[name]), LEAST)).all(), own
    for key, column, unit in (
        ("output_error", 1, "rad"),
        ("input_torque", 3, "Nm"),
    ):
        # the record sees as much as these equilibria, where it matters
        stated, worst = record[key], found[:, column].max()
        assert worst < 0.5 * GOAL[0] or stated["largest"] > SEEN * worst
        # and no more than there is: a solve of our own at the place that it names
        torque, theta = stated["at_Nm"], stated["input_angle_rad"]
        state = compared.follow.to_position(compared.rest, torque, theta)
        wrong = compared.at(state, np.array([theta]))[column][0]
        (row,) = (r for r in record["rows"] if r["torque_Nm"] == torque)
        # 0.2 % with involute flanks
        assert abs(wrong) / row[f"{key}_pp_{unit}"] == pytest.approx(
            stated["largest"], rel=0.02, abs=SCATTER.get(name, 0.0)
        )
    assert record["solves"] > 100
    assert record["secant_stiffness"]["largest"] < GOAL[0]


@pytest.mark.fe
@pytest.mark.parametrize("name", ["reference-2d", "reference-2d-dca"])
def test_small_maps_meet_unseen_solves(name):
    """Two maps of few teeth meet the goal between their samples."""
    check(f"{name} of few teeth", few_teeth(name))


@pytest.mark.fe
@pytest.mark.slow
@pytest.mark.timeout(2400)  # conforming flanks: 2656 equilibria
@pytest.mark.parametrize("name", (*DESIGNS, *OTHERS))
def test_maps_meet_unseen_solves(name):
    """All bundled 2D designs meet the goal, and drives of other sizes do so, too."""
    few = name in FEW_TEETH
    changes = FEW_TEETH.get(name, {} if name in OWN_MESH else COARSE)
    if name in OTHERS:
        design = scaled({**OTHERS[name], **changes})
    else:
        design = Design.load(name).with_changes(changes)
    check(f"{name} of few teeth" if few else name, design)
