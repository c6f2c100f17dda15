"""Elastic wave generators: balance of springs and cup, limits, play of the teeth."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, nan, radians, tan

import numpy as np
import pytest
from messages import naming
from solved import kept

from swgjoint.errors import InputError
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.pinched_cup import pinched_cup
from swgjoint.fe.solid.wave_generator import elastic as module
from swgjoint.fe.solid.wave_generator.elastic import (
    ElasticWaveGenerator,
    LobeCharacteristic,
    cup_of,
    lobe_characteristic,
)
from swgjoint.fe.solid.wave_generator.lobe_pads import (
    force_on_teeth,
    pad_force,
    with_pads,
)
from swgjoint.gear.wave_generators.wave_generator import lobe_height

HEIGHT = 0.4e-3
STIFFNESS = 60e3


@pytest.fixture(scope="module")
def cup():
    """A made-up cup: 60 N/mm that stiffens, teeth of 1 N/µm from 0.45 mm on."""
    w = np.linspace(0.0, 0.5e-3, 11)
    play = 20.0 * (0.45e-3 - w)
    play[0] = nan
    force = STIFFNESS * w * (1.0 + 50.0 * w)
    return LobeCharacteristic(
        height=HEIGHT,
        deflection=w,
        force=force,
        play=play,
        pressed_deflection=np.array([0.45e-3, 0.46e-3, 0.49e-3]),
        pressed_force=np.array([0.0, 10.0, 40.0]),
    )


@pytest.fixture(scope="module")
def design(thin_cup):
    """A small cup, thin as XB1-100-80."""
    return thin_cup


@pytest.fixture(scope="module")
def model(design, few_masters):
    """Half of it, the circular spline rigid."""
    return solid_sector_model(
        design, half=True, elastic_circular_spline=False, orders=few_masters
    )


@pytest.fixture(scope="module")
def found(design, few_masters, few_masters_everywhere):
    """Its characteristic, with two deflections beyond the take-up."""

    def solve():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "BEYOND", (0.02, 0.1))
            return lobe_characteristic(design, heights=(0.02, 0.82, 0.9, 1.1))

    return kept(f"lobes {design.content_hash()} {few_masters}", solve)


def test_springs_and_cup_balance(cup):
    """The spring's line meets the cup's curve."""
    for k, preload in ((0.0, 20.0), (5e3, 18.0), (80e3, 12.0), (5e3, 4.0)):
        at = cup.working_point(ElasticWaveGenerator(stiffness=k, preload=preload))
        assert at.force == pytest.approx(preload + k * (HEIGHT - at.deflection))
        assert at.force == pytest.approx(cup.force_at(at.deflection))
        assert at.play == pytest.approx(20.0 * (0.45e-3 - at.deflection))
        assert at.on_teeth == 0.0


def test_rigid_is_the_limit_of_stiff_springs(cup):
    """Springs without end hold the lobe height, whatever their preload."""
    rigid = cup.working_point(ElasticWaveGenerator(stiffness=inf, preload=0.0))
    assert rigid.deflection == HEIGHT
    errors = []
    for k in (1e6, 1e7, 1e8):
        at = cup.working_point(ElasticWaveGenerator(stiffness=k, preload=5.0))
        errors.append(HEIGHT - at.deflection)
        assert at.force == pytest.approx(rigid.force, rel=1.1 * STIFFNESS / k)
    # the miss falls with the compliance of the springs
    assert errors[1] / errors[0] == pytest.approx(0.1, rel=0.1)
    assert errors[2] / errors[1] == pytest.approx(0.1, rel=0.02)


def test_soft_springs_keep_their_force(cup):
    """Without stiffness the force is the preload on any cup; a rigid one follows it."""
    soft = ElasticWaveGenerator(stiffness=0.0, preload=15.0)
    rigid = ElasticWaveGenerator(stiffness=inf, preload=15.0)
    stiffer = replace(cup, force=1.2 * cup.force)
    assert cup.working_point(soft).force == pytest.approx(15.0)
    assert stiffer.working_point(soft).force == pytest.approx(15.0)
    ratio = stiffer.working_point(rigid).force / cup.working_point(rigid).force
    assert ratio == pytest.approx(1.2)


def test_teeth_carry_what_springs_have_beyond_the_take_up(cup):
    """From there on cup and teeth together balance the springs; no play is left."""
    assert cup.take_up == pytest.approx(0.45e-3)
    at = cup.working_point(ElasticWaveGenerator(stiffness=5e3, preload=35.0))
    assert at.deflection > cup.take_up and at.play == 0.0
    assert at.on_teeth == pytest.approx(1e6 * (at.deflection - 0.45e-3), rel=1e-6)
    assert at.force == pytest.approx(35.0 + 5e3 * (HEIGHT - at.deflection))
    assert at.force == pytest.approx(cup.force_at(at.deflection) + at.on_teeth)
    # a rigid wave generator presses them as its height has it
    high = replace(cup, height=0.47e-3)
    rigid = ElasticWaveGenerator(stiffness=inf, preload=0.0)
    assert high.working_point(rigid).on_teeth == pytest.approx(20.0)
    # no end of the play in the range
    none = {"pressed_deflection": np.zeros(0), "pressed_force": np.zeros(0)}
    loose = replace(cup, play=np.abs(cup.play) + 1e-3, **none)
    weak = ElasticWaveGenerator(stiffness=5e3, preload=20.0)
    assert loose.take_up == inf and loose.working_point(weak).play > 0.0
    assert loose.working_point(weak).on_teeth == 0.0


def test_outside_the_range_is_refused(cup):
    """One line with the value and the range."""
    pattern = naming("preload", "500 N", "0 N/mm") + r".*\b0\D+\d+\.\d+ N\b"
    with pytest.raises(InputError, match=pattern):
        cup.working_point(ElasticWaveGenerator(stiffness=0.0, preload=500.0))
    with pytest.raises(InputError, match=naming("deflection", "0.6 mm", "0", "0.5 mm")):
        cup.force_at(0.6e-3)
    with pytest.raises(
        InputError, match=naming("deflection", "0.495 mm", "0.49 mm", "teeth")
    ):
        cup.tooth_force_at(0.495e-3)


@pytest.mark.fe
def test_slope_at_rest_is_the_radial_stiffness(design, model, found, few_masters):
    """Small loads: linear, odd, as stiff as the pinched cup at mid-face."""
    pinched = pinched_cup(design, orders=few_masters).pull(1.0).stiffness
    # 2 % of the lobe height: large rotations add 0.03 %; the force acts on a patch of
    # a third of the face width instead of a plane: 0.1 %
    small = float(found.deflection[1])
    assert found.force_at(small) / small == pytest.approx(pinched, rel=2e-3)
    assert found.force_at(0.5 * small) / (0.5 * small) == pytest.approx(
        pinched, rel=2e-3
    )
    same = cup_of(model, design)
    assert same.pull(1.0).stiffness == pytest.approx(pinched, rel=1e-3)
    # odd to first order: 1.4 % of the deflection is 1e-3 of the stiffness
    out, back = (same.pull(sign * 1e-2, nonlinear=True) for sign in (1.0, -1.0))
    assert back.deflection == pytest.approx(-out.deflection, rel=1e-4)


@pytest.mark.fe
def test_play_falls_as_flanks_come_nearer(design, found):
    """A lobe that comes out by dw takes up 2 tan(alpha) dw/r, the play closes once."""
    assert isnan(found.play[1])  # at 2 % of the height teeth overlap off the lobes
    assert found.height == lobe_height(design)
    assert found.play[2] > found.play[3] > found.play[4]
    slope = (found.play[2] - found.play[3]) / (
        found.deflection[3] - found.deflection[2]
    )
    profile_angle = design.flexspline.pressure_angle_deg
    flat = 2.0 * tan(radians(profile_angle)) / (0.5 * design.pitch_diameter)
    # coning at the open edge and the curved flanks
    assert slope == pytest.approx(flat, rel=0.5)
    assert found.play_at(found.take_up) == pytest.approx(0.0, abs=1e-9)
    assert found.deflection[2] < found.take_up < found.deflection[3]


@pytest.mark.fe
def test_pads_find_the_teeth_where_the_play_ends(design, model, found):
    """No force on the teeth just below the take-up, more and more above it."""
    cup = cup_of(model, design)

    def on_teeth(w):
        planes = cup.pull(found.force_at(w), nonlinear=True).of_planes
        share = cup.share("mid_face")
        return force_on_teeth(model, design.ratio, share, planes)

    # play of 0.02 mrad: 0.3 % of the deflection
    assert on_teeth(0.997 * found.take_up) == pytest.approx(0.0, abs=1e-6)
    assert on_teeth(1.003 * found.take_up) > 0.1
    stiffness = np.diff(found.pressed_force) / np.diff(found.pressed_deflection)
    assert np.all(np.diff(stiffness) > 0.0)
    # teeth resist far more than the cup
    assert stiffness[-1] > 10.0 * found.force_at(found.height) / found.height


@pytest.mark.fe
def test_a_pad_presses_as_the_load_does(design, model):
    """Without teeth its force is that of the load that deflects the cup as much."""
    cup, share = cup_of(model, design), cup_of(model, design).share("mid_face")
    pulled = cup.pull(30.0, nonlinear=True)
    padded = with_pads(model, share, pulled.of_planes)
    state = SolidContinuation(model=padded, ratio=design.ratio).deflect()
    # the pad touches nodes, the load is spread over them
    assert pad_force(padded, state) == pytest.approx(30.0, rel=2e-3)
