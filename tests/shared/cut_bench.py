"""The bench scene, cut short, for benchmarks and advice."""

from __future__ import annotations

from dataclasses import replace

import pytest

from swgjoint.bench.joint.scenes import bench_scene


@pytest.fixture(scope="module")
def bench():
    """The bench, cut short."""
    whole = bench_scene("bench")
    changed = {"simulation.duration_s": 1.0, "trajectory.end_deg.joint": 4.0}
    return replace(whole, scene=whole.scene.with_changes(changed))
