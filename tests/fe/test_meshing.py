"""Simulation of meshing: balance, energy, symmetry, and an independent study."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from messages import naming
from solved import coarse, kept
from strips import open_gaps

from swgjoint.errors import DesignError
from swgjoint.fe.common.cyclic import CyclicFactor
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import elastic_energy
from swgjoint.fe.plane.drive2d import sector_model, unmodelled_parts
from swgjoint.fe.plane.linearise import linearise
from swgjoint.fe.plane.stress import circular_spline_stress, flexspline_stress
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design

TORQUE = 20.0
PITCH = 2 * pi / 122


@cache
def reference(refinement=1, **changes):
    design = Design.load("reference-2d")
    return design.with_changes({"mesh.refinement": refinement, **changes})


@cache
def one_pitch():
    """Two pitches of the ring gear at 20 N·m, 12 positions each, and one beyond."""
    return kept("meshing over two pitches", lambda: positions(25))


def positions(steps, half=True):
    """The first positions of them."""
    return simulate_meshing(
        reference(), torque=TORQUE, steps=steps, turn=steps / 12 / 122, half=half
    )


@cache
def follow(half=True):
    return Continuation(model=sector_model(reference(), half=half), ratio=-60.0)


@cache
def meshed():
    return follow().engage(follow().deflect())


@pytest.mark.parametrize(
    ("refinement", "tolerance"),
    [(1, 0.15), pytest.param(4, 0.04, marks=pytest.mark.slow)],
)
def test_deflected_flexspline_meets_an_independent_study(refinement, tolerance):
    """Stress by the wave generator alone against 289/200/282 MPa (CalculiX study)."""
    run = simulate_meshing(reference(refinement), torque=0.0, steps=1, half=True)
    state, found = run.setup[0].name, run.setup[0].stress
    assert state == "wave_generator"
    found = found.flexspline
    values = [found.tensile, found.compressive, found.von_mises]
    assert run.setup[0].stress.circular_spline.von_mises == 0.0
    assert values == pytest.approx([289e6, 200e6, 282e6], rel=tolerance)


def test_moments_balance_at_every_step():
    """Moment of the tooth forces plus wave-generator torque equals the load."""
    run = one_pitch()
    total = run.series("tooth_moment") + run.series("wave_generator_torque")
    assert np.abs(total - TORQUE).max() < 1e-6 * TORQUE


def test_mean_input_torque_is_torque_over_ratio():
    """Over whole pitches the wave-generator torque does the work of the output."""
    torque = one_pitch().series("wave_generator_torque")[:24]
    assert torque.mean() == pytest.approx(TORQUE / -60.0, rel=5e-3)
    assert np.ptp(torque) > 1e-3  # and it does ripple


def test_pattern_repeats_after_one_pitch():
    """Error, energy and stress repeat after a pitch of the fixed member."""
    run = one_pitch()
    for name in ("output_error", "wave_generator_torque", "energy"):
        values = run.series(name)
        assert np.abs(values[12:] - values[:13]).max() < 1e-3 * np.ptp(values)


def test_half_and_full_model_agree():
    """Without tolerances half of the drive is the whole drive."""
    full = positions(5, half=False)
    for name in ("output_error", "wave_generator_torque", "energy"):
        a, b = one_pitch().series(name)[:5], full.series(name)
        assert np.abs(a - b).max() < 1e-9 * np.abs(a).max()


def test_work_equals_energy():
    """T_wg dtheta - T dpsi = dU by central differences at a smooth position."""
    start = follow().to_torque(meshed(), TORQUE)
    middle = follow().to_angle(start, 0.3 * PITCH)
    h = 0.004 * PITCH
    low, high = (follow().to_angle(middle, 0.3 * PITCH + s * h) for s in (-1, 1))
    work = middle.wave_generator_torque * 2 * h
    gained = high.energy - low.energy + TORQUE * (high.rotation - low.rotation)
    assert gained == pytest.approx(work, rel=1e-5)


def test_tangent_compliance_is_the_derivative_of_the_rotation():
    """d(torsion)/dT of the converged system against differences."""
    state = follow().to_angle(follow().to_torque(meshed(), TORQUE), 0.3 * PITCH)
    low, high = (follow().to_torque(state, TORQUE + s * 0.01) for s in (-1, 1))
    slope = -(high.rotation - low.rotation) / 0.02
    # contact points that slide along their flanks are left out of the tangent
    assert state.compliance == pytest.approx(slope, rel=5e-4)


def test_mirrored_load_gives_mirrored_error():
    """Reversed torque at the mirrored position: reversed rotation, same energy."""
    zero = follow().to_torque(meshed(), 0.0)
    plus = follow().to_angle(follow().to_torque(zero, 15.0), 0.2 * PITCH)
    minus = follow().to_angle(follow().to_torque(zero, -15.0), -0.2 * PITCH)
    assert plus.rotation == pytest.approx(-minus.rotation, rel=1e-6)
    assert plus.energy == pytest.approx(minus.energy, rel=1e-9)
    assert plus.wave_generator_torque == pytest.approx(
        -minus.wave_generator_torque, rel=1e-6
    )


def test_nothing_penetrates():
    """Teeth overlap nowhere, the bore as far as its layer yields: below 0.05 um."""
    model = follow().model
    state = follow().to_torque(meshed(), TORQUE)
    points, on = model.bore_points(state), state.touching
    gap, _, _ = model.wave_generator_gap(points, state.wave_generator_angle)
    assert gap[~on].min() > 0.0 > gap[on].max()
    assert gap[on].min() > -5e-8
    layer = np.broadcast_to(model.stations.stiffness, gap.shape)[on]
    assert -layer * gap[on] == pytest.approx(state.pressure[on], abs=1e-6)
    assert state.tooth_force.min() > 0.0
    ring = linearise(model, state, TORQUE)
    assert np.abs(open_gaps(model, state)).max() < 1e-11
    found = ring.search.search(ring.flank, 1e-6, None)
    # elsewhere on a pair of flanks they are no closer than their strip lets them
    strips = Strips.from_contacts(
        model.indentation, found, state.contacts, state.tooth_force
    )
    approach = model.indentation.approach(strips.force)[strips.strip]
    assert (found.gap + approach).min() > -1e-11
    # the weights are the derivative of the gap by the flank displacement
    rng = np.random.default_rng(1)
    direction = rng.normal(size=ring.flank.shape)
    h = 1e-8
    moved = [
        ring.search.gather(
            found.sector, found.side, found.station, ring.flank + s * h * direction
        ).gap
        for s in (-1, 1)
    ]
    slope = (moved[1] - moved[0]) / (2 * h)
    ours = np.einsum("kb,kb->k", found.weight, direction[found.sector])
    assert ours == pytest.approx(slope, rel=1e-4, abs=1e-5)


def test_gradients_of_mean_gaps_are_those_of_the_gaps():
    """Weighted means over the stations of some sectors, also of the last one."""
    model = follow().model
    here = linearise(model, follow().to_torque(meshed(), TORQUE), None)
    rng = np.random.default_rng(4)
    increment = 1e-6 * rng.normal(size=here.gradient.shape)
    sector = np.array([5, 0, model.sectors - 1, 5])
    weight = rng.random((4, here.gap.shape[1]))
    rows = here.mean_gap_gradient(sector, weight)
    ours = np.einsum("kn,kn->k", rows, increment[sector])
    change = (here.gap_after(increment) - here.gap)[sector]
    assert ours == pytest.approx(np.einsum("kq,kq->k", weight, change), rel=1e-9)
    none = np.zeros((0, here.gap.shape[1]))
    assert here.mean_gap_gradient(sector[:0], none).shape == (0, rows.shape[1])


def test_gradient_and_tangent_are_derivatives_of_the_energy():
    """Rim and layer below the bore against differences, with half a ring closed."""
    model, h = follow().model, 1e-8
    loaded = follow().to_torque(meshed(), TORQUE)
    state = replace(
        loaded,
        flank_force=np.zeros((model.sectors, 4 * model.element.flank_size)),
        tooth_force=np.zeros(loaded.tooth_force.size),
    )
    here = linearise(model, state, None)
    rng = np.random.default_rng(3)
    increment = CyclicFactor(here.hessian, here.face_dofs).solve(
        rng.normal(size=(*here.gradient.shape, 1))
    )[..., 0]
    increment *= 1.0 / np.abs(increment).max()
    shift = here.rotate_to_global(increment)
    size, inside = model.element.face_size, model.element.bore_size

    def moved(way):
        return replace(
            state,
            faces=state.faces + way * shift[:, :size],
            bores=state.bores + way * shift[:, size : size + inside],
        )

    def energy(state):
        gap, _, _ = model.wave_generator_gap(
            model.bore_points(state), state.wave_generator_angle
        )
        layer = 0.5 * model.stations.stiffness * np.where(state.touching, gap, 0.0) ** 2
        rim = elastic_energy(model.element, model.frames(state), state.flank_force)
        return layer.sum() + rim.sum()

    gain = (energy(moved(h)) - energy(moved(-h))) / (2.0 * h)
    assert np.sum(here.gradient * increment) == pytest.approx(gain, rel=1e-5)
    turn = (
        linearise(model, moved(h), None).gradient
        - linearise(model, moved(-h), None).gradient
    ) / (2.0 * h)
    bending = here.hessian.copy()
    bending[0] -= here.anchor_stiffness * np.outer(here.anchor[0], here.anchor[0])
    bend = np.einsum("si,sij,sj->", increment, bending, increment)
    assert bend == pytest.approx(np.sum(turn * increment), rel=1e-5)
    # at single nodes of the bore, too: contributions of both sectors to a face add up
    face = here.face_dofs
    wrong = np.einsum("sij,sj->si", bending, increment) - turn
    wrong[:, :face] += np.roll(wrong[:, -face:], 1, axis=0)
    assert np.abs(wrong[:, :-face]).max() < 1e-5 * np.abs(turn).max()


def test_stress_is_continuous_across_the_faces():
    """Both sectors of a face report the same stress, seen from their frames."""
    model = follow().model
    state = follow().deflect()
    ring = circular_spline_stress(model, follow().to_torque(meshed(), TORQUE))
    for stress, element in (
        (flexspline_stress(model, state), model.element),
        (ring, model.circular_spline.compliance.element),
    ):
        trace = stress[..., 0] + stress[..., 1]
        after = np.roll(trace[:, element.mesh.face_first], -1, axis=0)
        assert np.allclose(
            trace[:, element.mesh.face_last], after, rtol=1e-9, atol=1e-3
        )
    assert np.abs(ring).max() > 1e6


def test_linear_level_runs_and_differs():
    """The labelled linear level is another model: large rotations matter."""
    linear = simulate_meshing(
        reference(), torque=TORQUE, steps=2, turn=0.01, half=True, nonlinear=False
    )
    assert linear.to_json()["label"]["level"] == "linear"
    total = linear.series("tooth_moment") + linear.series("wave_generator_torque")
    assert linear.setup[0].stress.flexspline.tensile != pytest.approx(
        one_pitch().setup[0].stress.flexspline.tensile, rel=0.01
    )
    assert np.isfinite(total).all()


def test_what_is_not_modelled_is_named():
    """A key that the model cannot honour is in the label, and changes nothing."""
    leaning = coarse(**{"tolerances.misalignment_arcmin": 0.5})
    found, plain = (
        simulate_meshing(design, torque=1.0, steps=1, half=True)
        for design in (leaning, coarse())
    )
    label = found.to_json()["label"]
    assert label["left_out"] == "tolerances.misalignment_arcmin"
    assert found.steps[-1].state.rotation == plain.steps[-1].state.rotation


def test_half_model_of_odd_teeth_is_refused():
    """Odd tooth counts put the lobes half a pitch apart."""
    design = Design.load("reference-2d").with_changes(
        {"drive.teeth_flexspline": 121, "drive.teeth_circular_spline": 123}
    )
    with pytest.raises(
        DesignError,
        match=naming(
            "reference-2d", "121/123 teeth", "half model", "even", "tolerances"
        ),
    ):
        simulate_meshing(design, torque=1.0, steps=1, half=True)


def test_json_has_the_contract_keys():
    """Counts, labels and lists of the JSON object fit together."""
    result = one_pitch().to_json()
    assert result["steps"] == 25 == len(result["per_step"]["angle_deg"])
    assert result["elements"] == (60 + 61) * 146
    assert result["nodes"] == (60 + 61) * 175 + 12
    assert [row["state"] for row in result["setup_MPa"]] == [
        "wave_generator",
        "meshed",
        "torque",
    ]
    mean = result["flexspline"]["average_max_MPa"]["von_mises"]
    assert mean == pytest.approx(np.mean(result["per_step"]["von_mises_MPa"]))
    assert result["circular_spline"]["average_max_MPa"]["tensile"] > 1.0


def test_rigid_circular_spline_has_no_stress():
    """A rigid member has null stresses and makes the drive stiffer."""
    run = simulate_meshing(
        reference(), torque=TORQUE, steps=1, half=True, elastic_circular_spline=False
    )
    result = run.to_json()
    assert result["circular_spline"]["average_max_MPa"]["tensile"] is None
    assert result["setup_MPa"][0]["circular_spline"] is None
    assert result["nodes"] == 60 * 175 + 6
    assert abs(run.steps[0].output_error) < abs(one_pitch().steps[0].output_error)


def test_cup_adds_its_torsion_in_series():
    """At level 2d a cup twists the output by T/K and stores T^2/(2 K), and is named."""
    cup = {
        "length_mm": 40.0,
        "thickness_coefficient": 0.8,
        "fillet_mm": 2.0,
        "bore_radius_mm": 20.0,
    }
    with_cup, without = (
        simulate_meshing(
            Design.load("reference-2d").with_changes(changes),
            torque=TORQUE,
            steps=1,
            half=True,
        )
        for changes in ({"cup": cup}, {})
    )
    stiffness = cup_torsional_stiffness(with_cup.design)
    twist = with_cup.series("output_error") - without.series("output_error")
    assert twist == pytest.approx(-TORQUE / stiffness, rel=1e-6)
    gained = with_cup.series("energy") - without.series("energy")
    assert gained == pytest.approx(0.5 * TORQUE**2 / stiffness, rel=1e-6)
    assert "closed-form" in with_cup.to_json()["label"]["cup"]


def test_backlash_is_taken_up_by_torque():
    """With 5 % thinner teeth both signs of torque move the output by the clearance."""
    thin = {"flexspline.thickness_coefficient": 0.95}
    design = coarse(**thin)
    error = [
        simulate_meshing(design, torque=torque, steps=1, half=True).series(
            "output_error"
        )[0]
        for torque in (-5.0, 5.0)
    ]
    assert error[0] == pytest.approx(-error[1], rel=1e-6)
    # half the clearance of 5 % of half a pitch at the pitch circle, less what the
    # deflected teeth find before they are in the middle of their spaces
    assert 0.3e-3 < error[0] < 0.05 * pi / 120 / 2 * 1.2


def test_label_names_what_a_plane_model_cannot_see():
    """Micro-geometry of a design is left out, and the label says so."""
    assert unmodelled_parts(Design.load("reference-2d")) is None
    assert unmodelled_parts(Design.load("size-25-100")) == "micro_geometry"
    assert one_pitch().to_json()["label"]["left_out"] is None


@pytest.mark.parametrize(
    ("pressure_angle", "member"), [(19.8, "flexspline"), (20.4, "circular_spline")]
)
def test_sharp_teeth_touch_with_their_corners(pressure_angle, member):
    """Involute flanks that are not parallel touch at tips (thesis section 6.3.1)."""
    design = Design.preset("reference-2d-involute").with_changes(
        {"flexspline.pressure_angle_deg": pressure_angle}
    )
    run = simulate_meshing(design, torque=20.0, steps=2, turn=0.02, half=True)
    inner = run.model.circular_spline.profile.addendum_radius
    for step in run.steps:
        contacts, force = step.state.contacts, step.state.tooth_force
        assert step.tooth_moment + step.wave_generator_torque == pytest.approx(20.0)
        assert np.abs(open_gaps(run.model, step.state)).max() < 1e-9
        radius = np.hypot(contacts.point[:, 0], contacts.point[:, 1])
        at_tip = {
            "flexspline": contacts.station == run.model.element.flank_range[0],
            "circular_spline": np.abs(radius - inner) < 2e-5,
        }
        assert force[at_tip[member]].sum() > 0.5 * force.sum()
