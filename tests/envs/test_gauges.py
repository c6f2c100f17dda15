"""Strain gauges of the environments: what they read, and the refusals."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import swgjoint.envs  # noqa: F401  (registers the environments)
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.gear.gauges import FlexsplineWall, GaugeRing
from swgjoint.models_path import models_path

GAUGES = {"flexspline": "size-25-100", "position_mm": 13.0, "strain": "outline"}
EXACT = {
    "motor_counts": 0,
    "motor_noise_rad": 0.0,
    "torque_sensor": True,
    "torque_noise_of_rated": 0.0,
    "delay_periods": 0,
}
NAMES = ["swgjoint/JointTracking-v0", "swgjoint/RippleSuppression-v0"]


def turn(name, steps=700, **gauges):
    """True torque, gear angle, and the readings of torque sensor and gauges."""
    keys = {"sensors": EXACT, "gauges": GAUGES | gauges, "normalise": False}
    env = gymnasium.make(name, **keys).unwrapped
    env.reset(seed=2)
    rows = []
    for k in range(steps):
        observation, *_, info = env.step(np.array([0.02 * np.sin(0.02 * k)]))
        angle = info["motor_angle_rad"] - info["link_angle_rad"]
        rows.append((info["output_torque_Nm"], angle, *observation[-2:]))
    return np.array(rows).T


@pytest.mark.parametrize("name", NAMES)
def test_reading_is_the_closed_form_of_torque_and_angle(name):
    """The drive's circular spline is fixed; the torque sensor reads the torque."""
    torque, beta, sensor, reading = turn(name)
    ring = GaugeRing(place=13e-3)
    strain = FlexsplineWall.from_design(Design.load("size-25-100")).strain(13e-3)
    want = ring.signal(strain, torque, beta) / ring.gain(strain)
    np.testing.assert_array_equal(sensor, torque)
    np.testing.assert_allclose(reading, want, atol=1e-9)
    assert np.ptp(beta) > 2.0 * np.pi
    assert np.abs(reading - torque).max() > 40.0  # the ripple of two lobes


@pytest.mark.parametrize(
    ("bridges", "left"),
    [({"bridges": 3}, [6, 12]), ({"bridges": 2, "spacing_deg": 90.0}, [4, 8, 12])],
)
def test_bridges_leave_the_orders_that_theory_says(bridges, left):
    """Three equally spaced ones multiples of six, two at right angles of four."""
    torque, beta, _, reading = turn(NAMES[1], **bridges)
    strain = FlexsplineWall.from_design(Design.load("size-25-100")).strain(13e-3)
    stays = np.isin(strain.orders, left)
    assert stays.sum() == len(left)
    wave = np.exp(-1j * np.multiply.outer(beta, strain.orders[stays]))
    want = (wave @ strain.shear[stays]).real / strain.torsion
    np.testing.assert_allclose(reading - torque, want, atol=1e-9)
    assert np.abs(want).max() > 1e-3


def test_gauges_leave_the_motion_as_it_is():
    """Gauges read; the torque over time has the same bits with and without errors."""
    one, other = turn(NAMES[1]), turn(NAMES[1], bridges=2, turn_errors_deg=[1.0, 0.0])
    np.testing.assert_array_equal(one[:3], other[:3])
    assert np.abs(one[3] - other[3]).max() > 0.3


def test_measurements_for_controllers_keep_their_places():
    """Controllers get the torque sensor and the link encoder, not the gauges."""
    sensors = {"link_encoder": True, "torque_sensor": True}
    runs = []
    for gauges in ({}, {"gauges": GAUGES}):
        env = gymnasium.make(NAMES[1], sensors=sensors, **gauges).unwrapped
        observation, _ = env.reset(seed=1)
        observation, *_ = env.step(np.zeros(1))
        runs.append(env.read_measurements(observation))
        # the noise of a further channel comes from the same generator
        want = (observation * env.core.units)[9:11]
        assert runs[-1].link_angle == want[:1]
        assert runs[-1].output_torque == want[1:]


def test_joints_of_an_arm_read_their_own_torque_and_angle(tmp_path):
    """Two of six joints have gauges; their readings are the last of the observation."""
    text = (models_path() / "scenes" / "ur5e-catalogue.toml").read_text("utf-8")
    joints, places = ("shoulder_pan_joint", "elbow_joint"), (12.0, 13.0)
    for joint, place in zip(joints, places, strict=True):
        text += f"\n[joints.{joint}.gauges]\nflexspline = 'size-25-100'\n"
        text += f"position_mm = {place}\nstrain = 'outline'\n"
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    keys = {"scene": str(path), "sensors": EXACT, "normalise": False}
    env = gymnasium.make("swgjoint/ArmTracking-v0", **keys).unwrapped
    size = env.observation_space.shape[0]
    plain = gymnasium.make(
        "swgjoint/ArmTracking-v0", **keys | {"scene": "ur5e-catalogue"}
    )
    assert size == plain.observation_space.shape[0] + 2
    env.reset(seed=2)
    rng = np.random.default_rng(1)
    rows = []
    for _ in range(200):
        observation, *_, info = env.step(rng.uniform(-0.2, 0.2, 6))
        angle = info["motor_angle_rad"] - info["link_angle_rad"]
        torque = info["output_torque_Nm"]
        # the torque sensors of the six joints stand before the gauges
        np.testing.assert_array_equal(observation[-8:-2], torque)
        gauged = enumerate((0, 2), start=-2)
        rows.append([(torque[j], angle[j], observation[k]) for k, j in gauged])
    design = Design.load("size-25-100")
    for k, place in enumerate(places):
        torque, beta, reading = np.array(rows)[:, k].T
        ring = GaugeRing(place=1e-3 * place)
        strain = FlexsplineWall.from_design(design).strain(ring.place)
        want = ring.signal(strain, torque, beta) / ring.gain(strain)
        np.testing.assert_allclose(reading, want, atol=1e-9)
        assert np.abs(reading - torque).max() > 1.0
    read = env.core.read_measurements(observation)
    np.testing.assert_array_equal(read.output_torque, info["output_torque_Nm"])


@pytest.mark.parametrize(
    ("gauges", "match"),
    [
        (3, "gauges 3; accepted: None or a mapping with flexspline"),
        ({"position_mm": 13.0}, "gauges.flexspline: missing; drive 'CSG-25-100'"),
        (GAUGES | {"place": 1}, "gauges: place: unknown key; did you mean"),
        (GAUGES | {"position_mm": 40.0}, "gauges.position_mm = 40 mm; accepted: "),
        (GAUGES | {"bridges": 0}, "gauges: bridges = 0: "),
        (GAUGES | {"flexspline": "size-25-50"}, "has the ratio -50"),
        (GAUGES | {"flexspline": "absent"}, "gauges.flexspline: "),
    ],
)
def test_bad_gauges_are_refused_in_one_line(gauges, match):
    """With the key and what is accepted, before anything is built."""
    with pytest.raises(InputError, match=match) as caught:
        gymnasium.make(NAMES[1], gauges=gauges)
    assert len(str(caught.value).splitlines()) == 1
