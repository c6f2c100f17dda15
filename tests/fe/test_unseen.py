"""Maps against finite elements at torques and angles that no map has seen."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from solved import coarse

from swgjoint.fe.common.sampling import SYMMETRIC, follower_in_plane, sample_map
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.fit import fit_map

PARTS = (0.02, 0.045, 0.1, 0.19, 0.31, 0.47, 0.63, 0.87)
"""Torques in parts of the repeated peak torque; no record of a map has any of them."""
ANGLES = 12
GOAL = (0.05, 0.02)
"""Largest and rms difference, in the peak to peak at the torque."""
SEEN = 0.7
"""Smallest part of the largest difference at these equilibria that a record states."""
LESS_SEEN = {"own 140/142": 0.6}
"""Designs whose record states less: 1.8 instead of 2.8 % of the input torque."""
PATHS = 0.004
"""Scatter of one equilibrium over the path to it, in the peak to peak: dca-80-to-1 at
16.6 N·m has 0.0033 of its 2.3 mN·m of input torque over five paths."""
DESIGNS = (
    "reference-2d",
    "reference-2d-dca",
    "reference-2d-dca-improved",
    "reference-2d-qca-improved",
    "reference-2d-involute",
    "reference-2d-flexspline-fixed",
    "dca-80-to-1",
    "reference-2d-simplified",
    "reference-2d-four-roller",
    "reference-2d-parabolic",
    "reference-2d-asymmetric",
)
OTHERS = {
    "own 100/102": {
        "drive.teeth_flexspline": 100,
        "drive.teeth_circular_spline": 102,
        "drive.module_mm": 0.4,
        "drive.face_width_mm": 6.5,
        "flexspline.rim_mm": 0.47,
        "wave_generator.kind": "cosine",
        "circular_spline.thickness_coefficient": 0.98,
        "ratings.rated_torque_Nm": 3.0,
    },
    "own 80/82": {
        "drive.teeth_flexspline": 80,
        "drive.teeth_circular_spline": 82,
        "drive.module_mm": 0.8,
        "flexspline.rim_mm": 0.7,
        "ratings.rated_torque_Nm": 6.0,
    },
    "own 140/142": {
        "drive.teeth_flexspline": 140,
        "drive.teeth_circular_spline": 142,
        "drive.module_mm": 0.5,
        "flexspline.rim_mm": 0.8,
        "wave_generator.kind": "simplified",
        "wave_generator.minor_axis_coefficient": 0.97,
        "ratings.rated_torque_Nm": 8.0,
    },
}
"""Other tooth counts, modules, wave generators, clearance."""


def scaled(changes: dict[str, object]) -> Design:
    """The reference design with changes, its arcs in proportion to the module."""
    lengths = {
        "tip_radius_mm": 0.3,
        "addendum_radius_mm": 1.0,
        "straight_mm": 0.2,
        "dedendum_radius_mm": 2.0,
        "root_radius_mm": 0.3,
    }
    module = float(changes["drive.module_mm"])  # type: ignore[arg-type]
    arcs = {
        f"{member}.profile.{key}": value * module
        for member in ("flexspline", "circular_spline")
        for key, value in lengths.items()
    }
    rim = {"circular_spline.rim_mm": 2.0 * module}
    return Design.load("reference-2d").with_changes({**arcs, **rim, **changes})


class Compared:
    """A map, and the finite elements of its design at any torque and angle."""

    def __init__(self, design: Design):
        samples = sample_map(design)
        self.drive = fit_map(samples)
        self.record = self.drive.info["validation"]
        self.follow = follower_in_plane(design)
        self.series = series_compliance(design, cup=True)
        self.rest = self.follow.engage(self.follow.deflect())
        zero = int(np.flatnonzero(samples.torque == 0.0)[0])
        self.offset = float(samples.output_error[zero].mean())

    def at(self, state, theta):
        """Equilibria at these angles under the torque of a state.

        Returns:
            Output error of the solves [rad], what the map misses; the same of the input
            torque [N·m] (4, n).
        """
        drive, follow, torque = self.drive, self.follow, state.torque
        error, moment = [], []
        for angle in theta:
            state = follow.to_angle(state, float(angle))
            assert state.outcome.ok
            error.append(follow.output_angle(state) - angle / follow.ratio)
            moment.append(follow.input_torque(state))
        psi = output_angle(drive, theta, np.full(len(theta), torque))
        on_input, on_output = drive.forces(theta, psi)
        apart = psi - theta / drive.ratio - (np.array(error) - torque * self.series)
        predicted = -on_input - (on_output - torque) / drive.ratio
        return np.array(
            [error, apart + self.offset, moment, predicted - np.array(moment)]
        )


def differences(found: Compared, design: Design) -> np.ndarray:
    """Differences of a map at unseen torques and angles.

    Returns:
        Rows of torque [N·m], then largest and rms difference of the loaded error and of
        the input torque, in the peak to peak of the finite elements at that torque (n,
        5).
    """
    rows = []
    theta = 2.0 * pi / design.periodicity * (np.arange(ANGLES) + 0.37) / ANGLES
    peak = ratings_of(design).repeated_peak
    signs = (1.0,) if design.wave_generator.kind in SYMMETRIC else (1.0, -1.0)
    for sign in signs:
        state = found.rest
        for part in PARTS:
            torque = sign * part * peak
            state = found.follow.to_torque(state, torque)
            error, apart, moment, missed = found.at(state, theta)
            # a constant angle has no meaning: each code counts from its own zero
            apart -= apart.mean()
            row = [torque]
            for values, wrong in ((error, apart), (moment, missed)):
                height = np.ptp(values)
                rms = np.sqrt(np.mean(wrong**2))
                row += [np.abs(wrong).max() / height, rms / height]
            rows.append(row)
    return np.array(rows)


def check(design: Design, seen: float = SEEN) -> None:
    """Hold a map to the goal, and its record too."""
    compared = Compared(design)
    found, record = differences(compared, design), compared.record
    largest, rms = GOAL
    assert found[:, [1, 3]].max() < largest
    assert found[:, [2, 4]].max() < rms
    for key, column, unit in (
        ("output_error", 1, "rad"),
        ("input_torque", 3, "Nm"),
    ):
        # the record sees as much as these equilibria, where it matters
        stated, worst = record[key], found[:, column].max()
        assert worst < 0.5 * GOAL[0] or stated["largest"] > seen * worst
        # and no more than there is: a solve of our own at the place that it names
        torque, theta = stated["at_Nm"], np.array([stated["input_angle_rad"]])
        state = compared.follow.to_torque(compared.rest, torque)
        wrong = compared.at(state, theta)[column][0]
        (row,) = (r for r in record["rows"] if r["torque_Nm"] == torque)
        own = abs(wrong) / row[f"{key}_pp_{unit}"]
        assert own == pytest.approx(stated["largest"], rel=0.1, abs=PATHS)
    assert record["solves"] > 100
    assert record["secant_stiffness"]["largest"] < GOAL[0]


@pytest.mark.fe
@pytest.mark.parametrize("name", ["reference-2d", "reference-2d-dca"])
def test_coarse_maps_meet_unseen_solves(name):
    """Two maps meet the goal at torques and angles between their samples."""
    check(coarse(name))


@pytest.mark.fe
@pytest.mark.slow
@pytest.mark.timeout(2400)  # conforming flanks: 2656 equilibria in 600 s
@pytest.mark.parametrize("name", DESIGNS)
def test_bundled_maps_meet_unseen_solves(name):
    """All bundled 2D designs meet the goal."""
    check(Design.load(name))


@pytest.mark.fe
@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_maps_meet_unseen_solves(name):
    """Drives of other sizes do so, too: other wave generators, teeth with clearance."""
    check(scaled(OTHERS[name]), LESS_SEEN.get(name, SEEN))
