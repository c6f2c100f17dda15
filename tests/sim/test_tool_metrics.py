"""Pose and path figures, settling: made-up clouds first, then runs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.figures.tool_metrics import (
    crossings,
    path_accuracy,
    path_repeatability,
    pose_accuracy,
    pose_repeatability,
    settling_time,
    tool_metrics,
)
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

STIFF = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
START = {
    "shoulder_lift_joint": -100.0,
    "elbow_joint": 100.0,
    "wrist_1_joint": -90.0,
    "wrist_2_joint": -90.0,
}
ISO = {"kind": "iso9283", "edge_mm": 120.0, "cycles": 3, "rest_s": 0.6, "hold_s": 0.3}
CIRCLE = {"kind": "circle", "radius_mm": 60.0, "cycles": 4, "ramp_s": 0.5}


def test_accuracy_is_the_distance_of_the_mean():
    """Six points on the axes about (1, 2, 2): the mean is 3 away from the origin."""
    cloud = np.array([1.0, 2.0, 2.0]) + 0.1 * np.vstack([np.eye(3), -np.eye(3)])
    assert pose_accuracy(cloud, np.zeros(3)) == pytest.approx(3.0)


def test_repeatability_is_the_mean_distance_and_three_deviations():
    """Distances 1, 1, 3, 3 from the mean: 2 and three times sqrt(4/3)."""
    cloud = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 3, 0], [0, -3, 0]]) + 7.0
    expected = 2.0 + 3.0 * np.sqrt(4.0 / 3.0)
    assert pose_repeatability(cloud) == pytest.approx(expected)
    assert pose_repeatability(np.ones((5, 3))) == 0.0


def test_repeatability_of_a_normal_cloud_has_its_expectation():
    """Isotropic scatter s: distances of a chi distribution with three degrees."""
    rng = np.random.default_rng(3)
    s, n = 0.01, 200_000
    got = pose_repeatability(rng.normal(0.0, s, (n, 3)))
    mean, square = 2.0 * np.sqrt(2.0 / np.pi), 3.0
    expected = s * (mean + 3.0 * np.sqrt(square - mean**2))
    assert got == pytest.approx(expected, rel=0.01)


def test_path_figures_are_the_worst_along_the_path():
    """Two passes 0.2 apart about an offset that grows to 0.5 along the path."""
    commanded = np.linspace([0.0, 0, 0], [1.0, 0, 0], 11)
    offset = np.linspace(0.0, 0.5, 11)[:, None] * [0.0, 1.0, 0.0]
    gap = np.array([0.0, 0.0, 0.1])
    attained = np.stack([commanded + offset + gap, commanded + offset - gap])
    assert path_accuracy(attained, commanded) == pytest.approx(0.5)
    assert path_repeatability(attained) == pytest.approx(0.1)


def test_settling_is_the_last_leaving_of_the_band():
    """A decaying oscillation exp(-t/tau) leaves a band b last about tau ln(1/b)."""
    t = np.arange(0.0, 4.0, 1e-4)
    off = np.where(t < 1.0, 9.0, np.exp(-(t - 1.0) / 0.2))
    assert settling_time(t, off, 1.0, 0.01) == pytest.approx(
        0.2 * np.log(100.0), abs=2e-4
    )
    assert settling_time(t, 0.0 * off, 1.0, 0.01) == 0.0
    assert settling_time(t, off, 1.0, 1e-7) is None  # still outside at the end
    assert settling_time(t, off, 3.9995, 0.01) is None  # no rest to speak of


def scene_of(level: str, motion: dict, duration: float, **changes: object) -> Scene:
    return Scene.from_data(
        {
            "name": "test",
            "arm": "ur5e",
            "defaults": {"drive": "map", "level": level, "rotor_inertia_kgm2": 1e-4},
            "trajectory": {"start_deg": START, **motion},
            "controller": {"kind": "pd", "feedforward": "gravity_inertia"},
            "simulation": {"duration_s": duration},
        },
        overrides=changes,
    )


def ur5e(level: str, motion: dict, duration: float, **changes: object) -> Run:
    return run_scene(
        scene_of(level, motion, duration, **changes), drives={"map": STIFF}
    )


@cache
def rigid_iso() -> Run:
    """Three cycles of the poses."""
    return ur5e("rigid", ISO, 16.0)


def test_a_rigid_arm_meets_its_poses():
    """AP and RP of the ISO cycle vanish with the error of the control loop."""
    tool = rigid_iso().metrics()["tool"]
    assert tool["ap_mm"] < 1e-3
    assert tool["rp_mm"] < 1e-3
    assert [pose["pose"] for pose in tool["poses"]] == [1, 2, 3, 4, 5]
    assert {pose["approaches"] for pose in tool["poses"]} == {3}
    assert "rp_mm" not in tool["missing"]


def test_a_flexible_arm_repeats_what_it_misses(synthetic_map):
    """Sag and kinematic error make AP; without anything random RP is far below it."""
    scene_map = {"map": synthetic_map}
    scene = scene_of("full", ISO, 16.0)
    run = run_scene(scene, drives=scene_map)
    tool = run.metrics()["tool"]
    assert tool["ap_mm"] > 0.1
    assert tool["rp_mm"] < 0.02 * tool["ap_mm"]
    # by hand, of P3
    ends = [end for number, end in run.assembly.trajectory.visits if number == 3]
    samples = [int(end / 1e-3 + 1e-6) for end in ends]
    off = run.tool_position[samples].mean(axis=0) - run.tool_reference[samples[0]]
    got = next(pose for pose in tool["poses"] if pose["pose"] == 3)
    assert got["ap_mm"] == pytest.approx(1e3 * np.linalg.norm(off))


def test_made_up_poses_give_what_was_put_in():
    """A run whose tool is moved at the rests has exactly that accuracy and scatter."""
    run = rigid_iso()
    position = run.tool_reference.copy()
    cycle = 0
    for number, end in run.assembly.trajectory.visits:
        shift = [0.003, 0.0, 0.0] if number == 4 else [0.001, 0.0, 0.0]
        scatter = [0.0, 0.0, 1e-4 * (cycle - 1)]
        position[int(end / 1e-3 + 1e-6)] += np.array(shift) + scatter
        cycle += number == 1
    tool = tool_metrics(replace(run, tool_position=position))
    assert tool["ap_mm"] == pytest.approx(3.0)
    # distances 0.1, 0, 0.1: mean 0.0667, deviation 0.0577
    assert tool["rp_mm"] == pytest.approx(0.2 / 3.0 + 3.0 * 0.1 / np.sqrt(3.0))


def test_a_rigid_arm_keeps_to_the_circle():
    """AT is the loop's error, of first order in the step; RT is far below it."""
    coarse, fine = (
        ur5e("rigid", CIRCLE, 9.0, **{"simulation.step_s": step}).metrics()["tool"]
        for step in (1e-3, 5e-4)
    )
    assert coarse["passes"] == 3
    assert coarse["at_mm"] < 0.02
    assert fine["at_mm"] == pytest.approx(coarse["at_mm"] / 2.0, rel=0.05)
    assert coarse["rt_mm"] < 0.02 * coarse["at_mm"]


def test_crossings_are_those_of_a_displaced_circle():
    """A tool that runs late on a circle larger by 1 mm is off by 1 mm everywhere."""
    run = ur5e("rigid", CIRCLE, 9.0)
    centre = run.tool_reference[0] + [0.06, 0.0, 0.0]
    late = run.tool_reference[np.maximum(np.arange(run.time.size) - 12, 0)]
    grown = centre + (late - centre) * (0.061 / 0.06)
    attained, commanded = crossings(replace(run, tool_position=grown))
    off = np.linalg.norm(attained - commanded, axis=-1)
    np.testing.assert_allclose(off, 1e-3, rtol=1e-4)
    assert path_repeatability(attained) < 1e-9


@pytest.mark.parametrize("fate", ["falls", "rests", "stops"])
def test_a_tool_that_misses_the_planes_has_no_path_figures(fate):
    """A tool that falls, never starts or stops on its way says so, with no warning."""
    run = ur5e("rigid", CIRCLE, 9.0)
    tool = run.tool_reference.copy()
    if fate == "falls":
        tool = tool - np.outer(run.time, [1.0, 0.2, 1.0])
    elif fate == "rests":
        tool[:] = tool[0]
    else:
        tool[run.time > 2.5] = tool[run.time > 2.5][0]
    found = tool_metrics(replace(run, tool_position=tool))
    for key in ("at_mm", "rt_mm"):
        assert found[key] is None
        why = "the tool does not cross the planes of the path"
        assert found["missing"][key] == why


def test_what_a_motion_does_not_have_is_null_with_the_reason(bench):
    """No figure without a motion for it, and the reason beside it."""
    turning = bench(STIFF).metrics()["tool"]
    assert turning["ap_mm"] is None
    assert turning["missing"]["ap_mm"] == "the motion reaches no pose"
    assert turning["settling_s"] is None
    step = {"kind": "step", "at_s": 0.1, "step_deg": {"joint": 1.0}}
    stepped = bench(STIFF, trajectory=step, simulation__duration_s=1.5).metrics()
    assert stepped["tool"]["path_rms_mm"] is None
    assert "no path" in stepped["tool"]["missing"]["path_rms_mm"]
    assert {"ap_mm", "rp_mm", "at_mm", "rt_mm"} <= set(stepped["tool"])
    for key in ("rp_mm", "at_mm", "rt_mm"):
        assert stepped["tool"][key] is None
        assert stepped["tool"]["missing"][key]


def test_a_step_settles_like_its_loop(bench):
    """The rigid joint with a critically damped loop enters 1 arcmin by (1+wt)e^-wt."""
    step = {"kind": "step", "at_s": 0.1, "step_deg": {"joint": 1.0}}
    run = bench(
        STIFF,
        defaults__level="rigid",
        trajectory=step,
        load={},
        simulation={"duration_s": 1.5, "step_s": 2e-4},
    )
    found = run.metrics()["joints"]["joint"]["settling"]["settling_s"]
    x = np.linspace(0.0, 30.0, 300_001)
    last = x[np.flatnonzero((1 + x) * np.exp(-x) > 1.0 / 60.0)[-1]]
    assert found == pytest.approx(last / (2 * np.pi * 8.0), rel=0.01)
