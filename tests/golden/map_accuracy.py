"""Maps of 2D designs against equilibria to which they were not fitted.

    python tests/golden/map_accuracy.py [NAME ...]

Builds the map of each design and compares it with finite elements at the torques and
angles of the tests and at many others. Results in ``frozen`` keep the figures of each
design with date and commit; ``guide_tables.py`` writes the tables of the guide from
them. Without names, all designs are compared.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from golden import FROZEN, stamped, text
from numpy.typing import NDArray

from swgjoint.fe.common.sampling import follower_in_plane, sample_map
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.gear.wave_generators.wave_generator import has_mirror_symmetry
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.fit import fit_map

Array = NDArray[np.float64]

PARTS = (0.02, 0.045, 0.1, 0.19, 0.31, 0.47, 0.63, 0.87)
"""Torques in parts of the repeated peak torque; no record of a map has any of them."""
ANGLES = 12
MANY_PARTS = tuple(float(part) for part in np.linspace(0.02, 0.98, 36))
MANY_ANGLES = 40
"""Of the comparison that shows how much of the largest difference a record states."""
BESIDE = (0.99, 0.997, 1.003, 1.01)
BESIDE_ANGLES = 180
"""Of the comparison beside the torque that a record names, in parts of that torque."""
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
OTHERS: dict[str, dict[str, Any]] = {
    "own-100": {
        "drive.teeth_flexspline": 100,
        "drive.teeth_circular_spline": 102,
        "drive.module_mm": 0.4,
        "drive.face_width_mm": 6.5,
        "flexspline.rim_mm": 0.47,
        "wave_generator.kind": "cosine",
        "circular_spline.thickness_coefficient": 0.98,
        "ratings.rated_torque_Nm": 3.0,
    },
    "own-80": {
        "drive.teeth_flexspline": 80,
        "drive.teeth_circular_spline": 82,
        "drive.module_mm": 0.8,
        "flexspline.rim_mm": 0.7,
        "ratings.rated_torque_Nm": 6.0,
    },
    "own-140": {
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


def scaled(changes: dict[str, Any]) -> Design:
    """The reference design with changes, its arcs in proportion to the module."""
    lengths = {
        "tip_radius_mm": 0.3,
        "addendum_radius_mm": 1.0,
        "straight_mm": 0.2,
        "dedendum_radius_mm": 2.0,
        "root_radius_mm": 0.3,
    }
    module = float(changes["drive.module_mm"])
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

    def at(self, state: Any, theta: Array) -> Array:
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


def differences(
    found: Compared,
    design: Design,
    parts: Sequence[float] = PARTS,
    angles: int = ANGLES,
) -> Array:
    """Differences of a map at unseen torques of both signs, see :func:`at_torques`."""
    peak = ratings_of(design).repeated_peak
    signs = (1.0,) if has_mirror_symmetry(design) else (1.0, -1.0)
    rows = [
        at_torques(found, design, sign * peak * np.array(parts), angles)
        for sign in signs
    ]
    return np.concatenate(rows)


def at_torques(
    found: Compared, design: Design, torques: Sequence[float] | Array, angles: int
) -> Array:
    """Differences of a map at unseen torques [N·m] and angles.

    Returns:
        Rows of torque [N·m], then largest and rms difference of the loaded error and of
        the input torque, in the peak to peak of the finite elements at that torque, and
        the difference of the mean torsion, in the mean torsion (n, 6).
    """
    rows = []
    theta = 2.0 * pi / design.periodicity * (np.arange(angles) + 0.37) / angles
    state = found.rest
    for torque in torques:
        state = found.follow.to_torque(state, float(torque))
        error, apart, moment, missed = found.at(state, theta)
        torsion = error.mean() - torque * found.series - found.offset
        mean = apart.mean()
        # a constant angle has no meaning: each code counts from its own zero
        apart -= mean
        row = [float(torque)]
        for values, wrong in ((error, apart), (moment, missed)):
            height = np.ptp(values)
            rms = np.sqrt(np.mean(wrong**2))
            row += [np.abs(wrong).max() / height, rms / height]
        rows.append([*row, abs(mean / torsion)])
    return np.array(rows)


def figures(name: str) -> dict[str, Any]:
    """Map of a design, its differences, and what its record states."""
    design = scaled(OTHERS[name]) if name in OTHERS else Design.load(name)
    start = time.process_time()
    found = Compared(design)
    cpu = time.process_time() - start
    few = differences(found, design)
    many = differences(found, design, MANY_PARTS, MANY_ANGLES)
    sampling = found.drive.info["sampling"]
    result: dict[str, Any] = {
        "design": name,
        "teeth": design.drive.teeth_flexspline,
        "wave_generator": design.wave_generator.kind,
        "angles": sampling["angles"],
        "solves": sampling["solves"],
        "cpu_s": cpu,
        "torques_Nm": few[:, 0].tolist(),
        "sampled_range_Nm": list(found.drive.info["sampled_torque_Nm"]),
    }
    for key, column in (("input_torque", 3), ("output_error", 1)):
        worst = int(many[:, column].argmax())
        place = found.record[key]["at_Nm"]
        beside = at_torques(found, design, place * np.array(BESIDE), BESIDE_ANGLES)
        result[key] = {
            "largest": float(few[:, column].max()),
            "rms": float(few[:, column + 1].max()),
            "record": found.record[key]["largest"],
            "record_at_Nm": found.record[key]["at_Nm"],
            "largest_of_many": float(many[worst, column]),
            "largest_of_many_at_Nm": float(many[worst, 0]),
            "largest_beside_record": float(beside[:, column].max()),
        }
    return result


def main() -> int:
    """Compare designs and keep their figures."""
    for name in sys.argv[1:] or (*DESIGNS, *OTHERS):
        command = ["python", "tests/golden/map_accuracy.py", name]
        found = stamped({"command": command, "result": figures(name)})
        print(name, found, flush=True)
        path = FROZEN / f"map-accuracy-{name}.json"
        path.write_text(text(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
