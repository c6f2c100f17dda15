"""Full solves against the harmonics of tooth errors that a map of thin rings keeps.

Prints how far output error and input torque differ from full solves at random positions
of the cycle, with the harmonics above 1 % of the strongest one, with those that the map
keeps, and with all. Run from the root of a checkout (about two CPU minutes):

    python tests/benchmarks/weak_harmonics.py [POSITIONS]
"""

from __future__ import annotations

import sys
from unittest.mock import patch

import numpy as np

from swgjoint.fe.plane.drive2d import in_plane
from swgjoint.fe.rings import tolerances
from swgjoint.fe.rings.contacts import race_on_balls
from swgjoint.fe.rings.loading import SMALL, solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.passage import ball_passage
from swgjoint.fe.rings.sampling import sample_thin_rings
from swgjoint.fe.tolerances.cycle import pitch_of
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors

DESIGN = "size-25-100-bought-coarse"
LEVELS = (6.12, 30.6, 87.72)
"""Sampled torques [N·m]."""


def sampled(design):
    """Complex amplitudes, torques [N·m], orders, and the waves that the map keeps."""
    seen = []
    choose = tolerances.main_harmonics

    def watched(spectrum, torque, orders, *, free):
        waves, dropped = choose(spectrum, torque, orders, free=free)
        seen.append((spectrum, torque, orders, waves))
        return waves, dropped

    with patch.object(tolerances, "main_harmonics", watched):
        sample_thin_rings(design)
    return seen[0]


def solved(design, pitches):
    """Pitches that were solved, and output error and input torque there (n, 2, 4)."""
    perfect, model = without_errors(design), thin_ring(in_plane(design))
    passage = ball_passage(perfect, thin_ring(perfect))
    small = SMALL * ratings_of(design).rated_torque
    cage = -passage.carried_as / passage.per_cage_turn
    found = {}
    for k in pitches.tolist():
        theta = pitch_of(design) * k
        state = solve_unloaded(model, theta, (cage - model.cage_lag) * theta)
        states = [solve_loaded(model, state, t) for t in (-small, small)]
        for torque in LEVELS:
            states.append(solve_loaded(model, states[-1], torque))
        if not all(one.outcome.ok for one in (state, *states)):
            continue
        rolled = [race_on_balls(model, s, s.q[model.rim.size :]) for s in states]
        rows = np.array(
            [
                [s.rotation - theta / model.ratio for s in states],
                [
                    r.input_torque + (cage - model.cage_lag) * r.cage_torque
                    for r in rolled
                ],
            ]
        )
        rows[:, 1] = rows[:, :2].mean(axis=1)  # the middle of the clearance
        found[k] = rows[:, 1:]
    return np.array(list(found)), np.array(list(found.values()))


def main():
    """Print the table."""
    design, count = Design.preset(DESIGN), int(sys.argv[1]) if sys.argv[1:] else 240
    spectrum, torque, orders, waves = sampled(design)
    cycle = round(design.periodicity / orders[1])
    rng = np.random.default_rng(11)
    drawn = rng.integers(0, cycle, count) + rng.uniform(0.0, 1.0, count)
    pitches, full = solved(design, drawn)
    size = np.abs(spectrum[0, :, 1:])
    largest = size.max(axis=1, keepdims=True)
    single = 1 + np.flatnonzero((size > 0.01 * largest).any(axis=0))
    sets = {"single": single, "kept": waves[1:], "all": np.arange(1, orders.size)}
    print(f"{len(pitches)} positions; differences in % of the standard deviation")
    for quantity, name in enumerate(("output error", "input torque")):
        for j, load in enumerate((0.0, *LEVELS)):
            if quantity and not load:
                continue
            row = int(np.argmin(np.abs(torque - load)))
            error, energy = spectrum[:, row]
            wave = (energy + load * error) * 1j * orders if quantity else error
            values = full[:, quantity, j]
            line = f"{name} at {load:g} N·m:"
            for label, some in sets.items():
                turns = np.exp(2j * np.pi * np.outer(pitches, some) / cycle)
                off = (values - np.real(turns @ wave[some])).std() / values.std()
                line += f" {label} ({some.size}) {100.0 * off:.1f}"
            print(line)


if __name__ == "__main__":
    main()
