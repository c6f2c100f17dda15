"""Joints whose plugin instances have the same long texts share a map."""

from __future__ import annotations

import ctypes
import re
import sys
import time
from base64 import b64decode, b64encode
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from swgjoint import attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.torsion_law import potential_of_stiffness

ARM = """<mujoco><option timestep="1e-3" integrator="discrete"/><worldbody>{}
</worldbody></mujoco>"""
LINK = '<body><joint name="j{}"/><geom size=".1"/></body>'


def with_harmonics(count, intervals, seed=3):
    """A drive with random harmonics of 12 orders in theta and several knots."""
    rng = np.random.default_rng(seed)
    linear = DriveMap.linear(5e4, rated_torque=80.0)
    knots = np.linspace(-2e-3, 2e-3, intervals + 1)
    mean, ends = potential_of_stiffness(knots, np.full(knots.size, 5e4))
    orders = np.stack(np.meshgrid(np.arange(1, 13), np.arange(-100, 101)), -1)
    orders = rng.permutation(orders.reshape(-1, 2))[:count]
    potential = np.zeros((count + 1, 2, intervals, 5))
    potential[0] = mean[0]
    potential[1:] = rng.normal(size=(count, 2, intervals, 1))
    potential[1:] *= 1e-6 * 5e2 ** np.arange(5)
    end_stiffness = np.zeros((count + 1, 2, 2))
    end_stiffness[0] = ends[0]
    end_stiffness[1:] = 0.1 * rng.normal(size=(count, 2, 2))
    error = np.zeros((count + 1, 2))
    error[1:] = 2e-7 * rng.normal(size=(count, 2))
    return replace(
        linear,
        torsion_knots=knots,
        orders=np.concatenate([[[0, 0]], orders]),
        potential=potential,
        end_stiffness=end_stiffness,
        kinematic_error=error,
    )


def spec_with(drive, joints):
    links = "".join(LINK.format(k) for k in range(joints))
    spec = mujoco.MjSpec.from_string(ARM.format(links))
    for k in range(joints):
        attach(spec, joint=f"j{k}", drive=drive, rotor_inertia=1e-4)
    return spec


def moved(model, torsion, ratio):
    """State after five steps from a torsion."""
    data = mujoco.MjData(model)
    data.joint("j0_rotor").qpos = ratio * torsion
    data.joint("j0_rotor").qvel = 3.0
    mujoco.mj_step(model, data, 5)
    return np.concatenate([data.qpos, data.qvel, data.plugin_state])


def changed(key, text):
    """Another text of the same length: its last number has another first digit."""
    if text.startswith("base64:"):
        numbers = np.frombuffer(b64decode(text[7:])).copy()
        numbers[-1] *= 2.0
        return "base64:" + b64encode(numbers.tobytes()).decode()
    head, last = text.rsplit(" ", 1)
    digit = re.search(r"[1-8]", last)
    return f"{head} {last[: digit.start()]}{int(digit[0]) + 1}{last[digit.end() :]}"


# many harmonics, written in base64, or few of them with many knots, in decimals
@pytest.mark.parametrize(("count", "intervals"), [(200, 8), (30, 40)])
# the last numbers: sine amplitudes, the last interval, beyond it
@pytest.mark.parametrize(
    ("key", "torsion"),
    [
        *[("orders", 0.0), ("knots", 2.5e-3), ("potential", 1.97e-3)],
        *[("end_stiffness", 2.5e-3), ("kinematic_error", 0.0)],
    ],
)
def test_maps_of_different_texts_are_not_shared(key, torsion, count, intervals):
    """One number of one attribute differs; the other map is in use, or not."""
    drive = with_harmonics(count, intervals)
    spec = spec_with(drive, 1)
    [instance] = spec.plugins
    config = instance.config
    assert config["potential"].startswith("base64:") == (count > 128)
    assert len(config["potential"]) > 100_000
    model = spec.compile()
    first = mujoco.MjData(model)
    before = moved(model, torsion, drive.ratio)
    text = changed(key, config[key])
    assert len(text) == len(config[key]) and text != config[key]
    instance.config = {**config, key: text}
    other = spec.compile()
    beside = moved(other, torsion, drive.ratio)
    assert not np.array_equal(beside, before)
    assert np.array_equal(moved(model, torsion, drive.ratio), before)
    del first, model
    assert np.array_equal(moved(other, torsion, drive.ratio), beside)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory from /proc")
# decimals take three times the memory of a table while they are read
@pytest.mark.parametrize(("count", "intervals", "most"), [(2000, 40, 6), (100, 800, 9)])
def test_joints_with_equal_texts_share_a_table(count, intervals, most):
    """Two data of six joints need less memory than their twelve tables would."""
    joints = 6
    model = spec_with(with_harmonics(count, intervals), joints).compile()
    table = count * 10 * (intervals + 2) * 8
    page = 4096
    # otherwise, memory that was freed before would be used first
    ctypes.CDLL(None).malloc_trim(0)
    before = int(Path("/proc/self/statm").read_text().split()[1])
    data = [mujoco.MjData(model) for _ in range(2)]
    grown = int(Path("/proc/self/statm").read_text().split()[1]) - before
    assert len(data) == 2
    # the table, its texts, and what one was read from; 12 tables otherwise
    assert grown * page < most * table


def test_the_last_maps_are_not_read_again():
    """Data of a map that was read take a fraction of the time, after the others, too.

    Those of a map with another digit, which was not read, take the whole time.
    """
    # compiling a model reads its map
    models = [spec_with(with_harmonics(60, 80, k), 1).compile() for k in range(3)]
    texts = models[0].plugin_attr
    [digit] = np.flatnonzero(texts == ord("."))[[200]] + 1

    def seconds(model):
        began = time.process_time()
        mujoco.MjData(model)
        return time.process_time() - began

    again = [min(seconds(model) for _ in range(5)) for model in models]
    old, first = int(texts[digit]), []
    for other in set(b"0123456789") - {old}:
        texts[digit] = other
        first.append(seconds(models[0]))
        texts[digit] = old
    assert max(again) < 0.4 * min(first)
