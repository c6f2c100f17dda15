"""Errors superposed at one position: problems over the torque, and hard problems."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from swgjoint.fe.common.following import Unloaded
from swgjoint.fe.common.influence import Response
from swgjoint.fe.common.strip_problems import StripProblems
from swgjoint.fe.tolerances.cycle import gap_errors, pitches_of
from swgjoint.fe.tolerances.perfect import PerfectSolid
from swgjoint.fe.tolerances.rest import SMALL, Rest, influences
from swgjoint.fe.tolerances.sampling import CHUNK, respond_over_torque
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.kernels import kernels


class Spring:
    """A drive without contacts, which turns by 1 mrad/(N·m) and by the errors."""

    torque, angle = 0.0, 0.0

    def __init__(self) -> None:
        self.solved: list[float] = []

    def respond(self, change: np.ndarray, torque: float, start: object) -> Response:
        """Angle of the spring; takes note of the torque."""
        self.solved.append(torque)
        angle = change - 1e-3 * torque
        return Response(
            output_angle=angle,
            potential=torque * angle + 0.5e-3 * torque**2,
            compliance=np.full(len(change), 1e-3),
            active=np.zeros((len(change), 1), dtype=bool),
        )


def test_both_ends_of_a_clearance_are_solved_once():
    """They are rows of the table, and the unloaded output is midway between them."""
    up, down, state = Spring(), Spring(), SimpleNamespace(energy=0.0)
    rest = Rest(state=state, at=up, opposite=(state, down))
    errors, levels, parts = np.linspace(0.0, 1e-3, CHUNK), np.array([0.5, 4.0]), []
    table, free = respond_over_torque(
        rest, lambda _: errors, levels, 0.5, lambda n=1: parts.append(n)
    )
    assert up.solved == [0.5, 4.0] and down.solved == [-0.5, -4.0]
    torque = np.array([-4.0, -0.5, 0.0, 0.5, 4.0])
    assert np.allclose(table[0], errors - 1e-3 * torque[:, None], atol=1e-15)
    assert free == CHUNK and sum(parts) == torque.size


def sprung(torque: float, play: float = 0.0) -> SimpleNamespace:
    """State of a spring of 1 mrad/(N·m), beyond half of its play."""
    return SimpleNamespace(
        torque=torque,
        angle=-1e-3 * torque - 0.5 * play * np.sign(torque),
        energy=0.5e-3 * torque**2,
        compliance=1e-3,
    )


@pytest.mark.parametrize("play", [0.0, 2e-3])
def test_perfect_drive_is_linear_beyond_a_failed_solve(play):
    """A spring with play whose larger positive torques have no equilibrium."""
    levels = np.array([0.5, 2.0, 3.0, 4.0])
    loaded = {t: sprung(t, play) for t in (0.5, 2.0, -0.5, -2.0, -3.0, -4.0)}
    sides = (loaded[0.5], loaded[-0.5]) if play else None
    rest = Unloaded(state=sprung(0.0), small=0.5, sides=sides)
    follow = SimpleNamespace(output_angle=lambda state: state.angle)
    drive = PerfectSolid(follow=follow, positions=[rest])
    angle, energy, compliance = drive.table([loaded], levels)[:, :, 0]
    torque = np.concatenate([-levels[::-1], [0.0], levels])
    wanted = [sprung(t, play) for t in torque]
    assert angle == pytest.approx([one.angle for one in wanted], abs=1e-15)
    assert energy == pytest.approx([one.energy for one in wanted], abs=1e-15)
    # the output is free to turn by the play and by twice its deflection at 0.5 N·m
    assert compliance[4] == pytest.approx(1e-3 + play)
    assert np.delete(compliance, 4) == pytest.approx(1e-3)


@pytest.mark.fe
@pytest.mark.skipif(kernels() is None, reason="built without compiled loops")
def test_a_rim_that_lifts_off_is_no_trap(monkeypatch):
    """Almost unloaded, with clearance: no problem is left to the method of last resort.

    When all violated contacts changed in each step, 26 of 512 problems failed.
    """
    design = Design.preset("size-25-100-bought")
    small = SMALL * ratings_of(design).rated_torque
    rest = influences(design, phases=1)[1][0]
    pitches = np.arange(0, pitches_of(design), 39)[:512]
    errors, left = gap_errors(design, pitches), list[int]()
    by_numpy = StripProblems._solve_in_rounds

    def counted(problems, offset, start):
        left.append(len(offset))
        return by_numpy(problems, offset, start)

    monkeypatch.setattr(StripProblems, "_solve_in_rounds", counted)
    for sign in (1.0, -1.0):
        at = rest.near(sign)[1]
        change = at.gap_change(*errors)
        found = at.respond(change, sign * small)
        assert not left and np.isfinite(found.output_angle).all()
        monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
        theirs = at.respond(change[::16], sign * small)
        monkeypatch.delenv("SWGJOINT_KERNELS")
        assert left == [32]
        left.clear()
        for key in ("output_angle", "potential"):
            ours, wanted = getattr(found, key)[::16], getattr(theirs, key)
            assert np.abs(ours - wanted).max() < 1e-7 * np.ptp(wanted)
