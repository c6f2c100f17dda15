"""Elements of hysteresis from loops with and without friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.fit.hysteresis_elements import (
    REACHES,
    STEEPEST_SUM,
    fit_elements,
)
from swgjoint.maps.fit.hysteresis_loops import play_loops, played_loop, with_hysteresis
from swgjoint.maps.hysteresis import Jenkin, sticking_stiffness, total_yield
from swgjoint.units import arcmin

N = 24


def path(top: float) -> np.ndarray:
    """0 -> T -> -T -> T -> -T -> T [N·m]."""
    up = np.linspace(-top, top, 2 * N + 1)[1:]
    return np.concatenate([[0.0], up[N:], -up, up, -up, up])


def blank(drive: DriveMap, theta: float, top: float = 90.0) -> FrictionLoop:
    """A loop to be played: the torques of a map without friction."""
    torque = path(top)
    psi = output_angle(replace(drive, hysteresis=()), theta, torque)
    x = drive.torsion(theta, psi)
    return FrictionLoop(
        input_angle=theta,
        quarter=N,
        torque=torque,
        torsion=theta / drive.ratio - psi,
        elastic_torsion=theta / drive.ratio - psi,
        stiffness=drive.stiffness(x, theta, psi),
        work=np.zeros(torque.size),
    )


def rubbed(drive: DriveMap, theta: float = 0.1) -> FrictionLoop:
    """The loop that a map with elements makes, as if it were computed."""
    return played_loop(drive, blank(drive, theta))


def elements(drive: DriveMap, *parts: tuple[float, float]) -> tuple[Jenkin, ...]:
    """Elements of given yield torques and yield torsions in parts of the travel."""
    travel = float(np.ptp(blank(drive, 0.1).torsion))
    return tuple(Jenkin(stiffness=f / (d * travel), yield_torque=f) for f, d in parts)


def test_work_of_a_round_is_that_of_the_slip(synthetic_map):
    """The area of a round, and the integral of R dx, are 4 f (X - f/k)."""
    drive = replace(synthetic_map, hysteresis=elements(synthetic_map, (2.0, 0.05)))
    loop = rubbed(drive)
    (element,) = drive.hysteresis
    half = 0.5 * float(np.ptp(loop.torsion))
    lost = 4.0 * element.yield_torque * (half - element.yield_torsion)
    x, r = (values[loop.round] for values in (loop.torsion, loop.friction_torque))
    # the trapezoidal rule with 24 steps a quarter cuts corners
    assert loop.area == pytest.approx(lost, rel=0.02)
    assert float(np.trapezoid(r, x)) == pytest.approx(lost, rel=0.02)
    assert loop.gap == pytest.approx(0.0, abs=1e-12)


def test_elements_come_back(synthetic_map):
    """A map with elements of the grid gives them back from its own loops."""
    given = elements(synthetic_map, (2.0, REACHES[8]), (5.0, REACHES[5]))
    drive = replace(synthetic_map, hysteresis=given)
    loops = [rubbed(drive, theta) for theta in (0.0, 0.02)]
    found = fit_elements(loops, synthetic_map.max_stiffness)
    for loop in loops:
        back = played_loop(replace(drive, hysteresis=found), loop)
        # friction takes 1 % of the travel, and the grid of yield torsions with it
        assert np.abs(back.width - loop.width).max() < 0.03 * loop.width.max()
        assert np.abs(back.shift - loop.shift).max() < 0.05 * np.abs(loop.shift).max()
    assert sum(e.yield_torque for e in found) == pytest.approx(7.0, rel=0.02)


def test_no_friction_no_elements(synthetic_map):
    """Loops of a conservative drive have no width and give no elements."""
    loop = blank(synthetic_map, 0.1)
    assert np.abs(loop.width).max() < 1e-15 and loop.friction_work == 0.0
    assert fit_elements([replace(loop, torsion=loop.elastic_torsion)], 1e5) == ()


def test_sticking_teeth_stiffen_without_loss(synthetic_map):
    """An element that never slips comes back as such: a mid-line, no width."""
    drive = replace(synthetic_map, hysteresis=elements(synthetic_map, (5.0, 1.0)))
    loop = rubbed(drive)
    assert np.abs(loop.width).max() < 1e-12 and np.abs(loop.shift).max() > 1e-5
    found = replace(drive, hysteresis=fit_elements([loop], synthetic_map.max_stiffness))
    back = played_loop(found, loop)
    assert np.abs(back.width).max() < 0.01 * np.abs(loop.shift).max()
    assert back.shift == pytest.approx(loop.shift, abs=0.02 * np.abs(loop.shift).max())


def test_report_compares_what_was_played(synthetic_map):
    """Loss and work of the loops and of the map stand side by side in the info."""
    given = elements(synthetic_map, (2.0, REACHES[6]))
    loops = [rubbed(replace(synthetic_map, hysteresis=given), t) for t in (0.0, 0.02)]
    loops = [
        replace(one, work=np.linspace(0.0, one.area, one.torque.size)) for one in loops
    ]
    found = with_hysteresis(synthetic_map, loops)
    report = found.info["friction_loop"]
    assert report["hysteresis_loss_arcmin"] == [one.loss / arcmin for one in loops]
    assert report["hysteresis_loss_map_arcmin"] == pytest.approx(
        report["hysteresis_loss_arcmin"], rel=0.02
    )
    assert report["round_area_map_J"] == pytest.approx(report["round_area_J"], rel=0.02)
    assert report["residual_width_max_arcmin"] < 0.02 * report["width_rms_arcmin"]
    assert "tooth friction" in found.info["hysteresis"]
    only = found.spec_sheet(only=["hysteresis_loss_arcmin"])
    assert only["hysteresis_loss_arcmin"] > 0.0


def test_round_of_unequal_branches_is_refused(synthetic_map):
    """Widths are differences at equal torques: other paths are a ValueError."""
    loop = blank(synthetic_map, 0.1)
    with pytest.raises(ValueError, match=naming("217", "torques", "24 steps")):
        replace(loop, torque=np.linspace(-1.0, 1.0, loop.torque.size))


def small(
    drive: DriveMap, theta: float, means: tuple[float, ...], size: float = 8.0
) -> list[FrictionLoop]:
    """Small loops about several torques, which follow the large loop."""
    part = np.arange(1, 9) / 4
    once = np.concatenate([1.0 - part, part - 1.0])
    torque = path(90.0)
    loops = []
    for mean in means:
        approach = np.linspace(torque[-1], mean + size, 5)[1:]
        torque = np.concatenate([torque, approach, *[mean + size * once] * 2])
        bare = replace(drive, hysteresis=())
        psi = output_angle(bare, theta, torque)
        x = drive.torsion(theta, psi)
        one = FrictionLoop(
            input_angle=theta,
            quarter=4,
            torque=torque,
            torsion=theta / drive.ratio - psi,
            elastic_torsion=theta / drive.ratio - psi,
            stiffness=drive.stiffness(x, theta, psi),
            work=np.zeros(torque.size),
        )
        loops.append(played_loop(drive, one))
    return loops


def test_yields_that_grow_with_the_load_come_back(synthetic_map):
    """Narrow in the middle, wide under load: the fit follows, constants do not."""
    (base,) = elements(synthetic_map, (2.0, REACHES[10]))
    element = Jenkin(
        stiffness=4.0 * base.stiffness, yield_torque=1.0, yield_curve=((90.0, 7.0),)
    )
    drive = replace(synthetic_map, hysteresis=(element,))
    loops = [rubbed(drive), *small(drive, 0.1, [50.0, 0.0])]
    found = fit_elements(loops, synthetic_map.max_stiffness)
    back = [played_loop(replace(drive, hysteresis=found), one) for one in loops]
    widest = loops[0].width.max()
    for one, other in zip(back, loops, strict=True):
        # the grids of yield torsions and torques do not contain the element
        assert np.abs(one.width - other.width).max() < 0.08 * widest
    assert back[0].area == pytest.approx(loops[0].area, rel=0.02)
    assert back[0].loss == pytest.approx(loops[0].loss, rel=0.1)
    plain = tuple(e for e in found if not e.yield_curve)
    assert sum(float(e.yields(90.0)) for e in plain) < 0.3 * 7.0


def test_small_loops_are_compared_by_their_torque(synthetic_map):
    """The report has one row per mean torque, averaged over the positions."""
    given = elements(synthetic_map, (4.0, REACHES[8]))
    drive = replace(synthetic_map, hysteresis=given)
    loops = []
    for theta in (0.0, 0.02):
        loops += [rubbed(drive, theta), *small(drive, theta, [50.0, 0.0])]
    loops = [
        replace(one, work=np.linspace(0.0, one.area, one.torque.size)) for one in loops
    ]
    report = with_hysteresis(synthetic_map, loops).info["friction_loop"]
    assert len(report["hysteresis_loss_arcmin"]) == 2
    zero, half = report["small_loops"]
    assert (zero["mean_torque_Nm"], half["mean_torque_Nm"]) == (0.0, 50.0)
    for row in (zero, half):
        assert row["amplitude_Nm"] == pytest.approx(8.0)
        assert row["width_map_arcmin"] == pytest.approx(row["width_arcmin"], rel=0.1)
        assert row["round_area_map_J"] == pytest.approx(row["round_area_J"], rel=0.1)


def test_fit_keeps_to_the_stiffness_that_a_joint_can_integrate(synthetic_map):
    """Half the stiffness that the loop wants: obeyed, and little work is lost."""
    (base,) = elements(synthetic_map, (2.0, REACHES[14]))
    element = Jenkin(
        stiffness=4.0 * base.stiffness, yield_torque=1.0, yield_curve=((90.0, 7.0),)
    )
    drive = replace(synthetic_map, hysteresis=(element,))
    loop = rubbed(drive)
    free = fit_elements([loop], synthetic_map.max_stiffness)
    stiffest = 0.5 * sticking_stiffness(free)
    found = fit_elements([loop], synthetic_map.max_stiffness, stiffest)
    assert 0.3 * stiffest < sticking_stiffness(found) <= stiffest
    back = played_loop(replace(drive, hysteresis=found), loop)
    assert back.area == pytest.approx(loop.area, rel=0.05)


def test_steep_yields_keep_their_dependence_on_the_load(synthetic_map):
    """Yields that grow too fast for the law are fitted with the largest slope instead.

    The fit fell back to constant yields, which held the unloaded output with 9 instead
    of 0.5 N·m.
    """
    (base,) = elements(synthetic_map, (2.0, REACHES[10]))
    curve = ((50.0, 1.5), (70.0, 20.0), (90.0, 20.0))
    element = Jenkin(
        stiffness=40.0 * base.stiffness, yield_torque=0.5, yield_curve=curve
    )
    drive = replace(synthetic_map, hysteresis=(element,))
    loops = [rubbed(drive), *small(drive, 0.1, [80.0, 0.0])]
    found = fit_elements(loops, synthetic_map.max_stiffness)
    at = np.linspace(0.0, 90.0, 181)
    slopes = sum(np.abs(np.diff(e.yields(at)) / np.diff(at)) for e in found)
    assert slopes.max() == pytest.approx(STEEPEST_SUM, abs=1e-3)
    assert total_yield(found, 0.0) == pytest.approx(0.5, rel=0.05)
    back = played_loop(replace(drive, hysteresis=found), loops[0])
    assert back.loss == pytest.approx(loops[0].loss, rel=0.05)
    assert back.area == pytest.approx(loops[0].area, rel=0.05)


def test_round_off_does_not_choose_a_yield_torsion(synthetic_map):
    """Yield torsions that the loops do not determine do not depend on round-off."""
    (base,) = elements(synthetic_map, (2.0, REACHES[13]))
    element = Jenkin(
        stiffness=4.0 * base.stiffness, yield_torque=1.0, yield_curve=((90.0, 7.0),)
    )
    drive = replace(synthetic_map, hysteresis=(element,))
    # steps of 3.75 N·m slide through the yield torsion; those of 0.25 N·m do not
    loops = [rubbed(drive), *small(drive, 0.1, [0.0], 1.0)]
    rng = np.random.default_rng(1)
    fits = []
    for size in (0.0, 1e-12, 1e-12, 1e-12):
        noisy = [
            replace(one, torsion=one.torsion * (1.0 + size * rng.normal(size=n)))
            for one, n in ((one, one.torsion.size) for one in loops)
        ]
        fits.append(fit_elements(noisy, synthetic_map.max_stiffness))
    stiff = [[e.stiffness for e in found] for found in fits]
    assert len(stiff[0]) > 3
    assert stiff[1:] == [pytest.approx(stiff[0], rel=1e-6)] * 3


def test_paths_that_begin_alike_are_played_once(synthetic_map):
    """Loops of common and of other paths are those that each path gives alone."""
    given = elements(synthetic_map, (4.0, REACHES[8]))
    drive = replace(synthetic_map, hysteresis=given)
    loops = [blank(drive, 0.0), *small(drive, 0.0, (50.0, 0.0)), blank(drive, 0.02)]
    loops.append(blank(drive, 0.0, top=60.0))  # not a part of the longest path
    for loop, played in zip(loops, play_loops(drive, loops), strict=True):
        alone = played_loop(drive, loop)
        assert played.quarter == loop.quarter
        assert (played.torque == loop.torque).all()
        assert played.torsion == pytest.approx(alone.torsion, rel=1e-12, abs=1e-15)
        assert played.area == pytest.approx(alone.area, rel=1e-12)
