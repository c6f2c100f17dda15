r"""Passivity of hysteresis and friction in random histories of the engine.

The law of a joint, its hysteresis along the torsion and its friction along beta, is
passive if for any two times :math:`t_1 < t_2` of any motion

.. math:: \int_{t_1}^{t_2} (q\,\dot\Delta + F\,\dot\beta)\,dt \ge S(t_2) - S(t_1),
    \qquad S = \sum_j \tfrac12 k_j u_j^2 + \tfrac12 \sigma z^2 ,

with the torque q and the stretches u of the elements, and the torque F and the stretch
z of the bristle. The storage function S >= 0 is the energy of the springs. Over a
cycle that ends in the state in which it began, the law takes work and never gives any.

In a step of the scheme the integral is the mean torque times the change of the angle.
The energy dissipated in a step is this work minus the change of S. For an inequality
over all intervals, the sum of the dissipated energies never has to fall; the largest
fall of the sum is the largest energy that the law delivers. The engine's midpoint rule
makes the sum of the work of all torques and of the change of the kinetic energy zero,
so that a torque of the law follows from the recorded speeds. On a linear spring without
kinematic error the two torques of rotor and link separate hysteresis from friction, and
the spring is lossless.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from histories import LIMIT, Histories, drawdown, record
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swgjoint.bench.stability.joint import (
    Start,
    hardening_drive,
    make_joint,
    with_friction_of_teeth,
)
from swgjoint.joint import plugin
from swgjoint.joint.hysteresis_step import element_steps
from swgjoint.joint.reference import (
    metric_of,
    other_acceleration,
    relax_state,
    rest_after,
    scheme_force,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction_temperature import at_temperature
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.units import ZERO_CELSIUS, rpm

DRIVES = ("CSG-14-100", "CSG-17-100", "CSG-20-100", "CSG-25-100")
"""Catalogue drives with friction over temperature."""
HYSTERESIS = "CHA-25-100"
"""Catalogue drive with a hysteresis loss; its torques are scaled to the other drives.
"""
TEMPERATURES = (-10.0, 60.0)
"""Range of temperatures [°C]."""
FASTEST = 6000.0 * rpm
"""Largest commanded rotor speed [rad/s], within the limits of all sizes."""
STEPS = 150
ROUND_OFF = 1e-12
"""Largest fall of the dissipated energy over the largest energy of a history [-]."""


def random_drive(k: int, rng) -> DriveMap:
    """A catalogue drive at a random temperature with one of two kinds of hysteresis."""
    drive = DriveMap.from_catalogue(DRIVES[k % len(DRIVES)])
    celsius = rng.uniform(*TEMPERATURES)
    drive = at_temperature(drive, celsius + ZERO_CELSIUS, where="test")
    if k // len(DRIVES) % 2:
        return with_friction_of_teeth(drive)
    other = DriveMap.from_catalogue(HYSTERESIS)
    factor = drive.ratings.rated_torque / other.ratings.rated_torque
    elements = [element.with_torques_scaled(factor) for element in other.hysteresis]
    return replace(drive, hysteresis=tuple(elements))


def on_linear_spring(drive: DriveMap) -> DriveMap:
    """The law of a drive on a linear spring without kinematic error."""
    linear = DriveMap.linear(drive.mean_stiffness)
    return replace(
        linear,
        hysteresis=drive.hysteresis,
        friction=drive.friction,
        ratings=drive.ratings,
    )


@pytest.fixture
def exact(monkeypatch):
    """Without numerical damping, which is no part of the law."""
    plugin.require_metric()
    config = partial(plugin.config, numerical_damping=0.0)
    monkeypatch.setattr(plugin, "config", config)


def run(bench, drive: DriveMap, count: int, rng) -> Histories:
    b = bench(drive, joint=LIMIT, link=1e-3, damping_ratio=None)
    return record(b, count=count, steps=STEPS, speed=FASTEST, rng=rng)


def works(some: Histories) -> tuple[np.ndarray, np.ndarray]:
    """Work that hysteresis, damper and friction take in each step [J]. (steps, n)."""
    i = some.drive.ratio
    g, b = np.array([1.0 / i, -1.0]), np.array([1.0, -1.0])
    # force = -along g - rubs b
    along = some.force.sum(axis=-1) / (1.0 - 1.0 / i)
    rubs = some.force[..., 1] - along
    spring = np.diff(0.5 * some.drive.mean_stiffness * some.torsion() ** 2, axis=0)
    return along * (some.change @ g) - spring, rubs * (some.change @ b)


def stored(some: Histories) -> tuple[np.ndarray, np.ndarray]:
    """Energy of the elements and of the bristle [J]. Shapes (steps + 1, n)."""
    k = np.array([element.stiffness for element in some.drive.hysteresis])
    bristle = 0.5 * some.drive.friction.stiffness * some.bristle() ** 2
    return 0.5 * some.stretches() ** 2 @ k, bristle


def largest_energy(some: Histories) -> np.ndarray:
    """Largest energy in each history [J]. Shape (n,)."""
    spring = some.drive.energy(some.torsion(), some.x[..., 0], some.x[..., 1])
    return np.max(some.kinetic() + spring, axis=0)


@pytest.mark.parametrize(
    ("groups", "count"), [(8, 25), pytest.param(40, 250, marks=pytest.mark.slow)]
)
def test_the_law_delivers_no_energy_in_any_history(bench, exact, groups, count):
    """200 or 10,000 histories: neither hysteresis nor friction over any interval."""
    rng = np.random.default_rng(groups)
    limited = reversed_ = slipped = 0
    for k in range(groups):
        some = run(bench, on_linear_spring(random_drive(k, rng)), count, rng)
        scale = largest_energy(some)
        total = np.zeros(count)
        for work, energy in zip(works(some), stored(some), strict=True):
            dissipated = work - np.diff(energy, axis=0)
            assert (drawdown(dissipated) <= ROUND_OFF * scale).all()
            total += dissipated.sum(axis=0)
        # what is lost is what motor, load and limit put in and nothing keeps
        held = some.kinetic() + sum(stored(some))
        held += 0.5 * some.drive.mean_stiffness * some.torsion() ** 2
        work = np.sum(some.other * some.change, axis=(0, 2))
        np.testing.assert_allclose(
            total, work + held[0] - held[-1], rtol=1e-9, atol=1e-9 * scale.max()
        )
        assert (total > 0.0).all()
        limited += some.limited.any(axis=0).sum()
        reversed_ += (np.ptp(np.sign(some.v[..., 0]), axis=0) == 2).sum()
        rest = some.state[..., 2 : 2 + len(some.drive.hysteresis)]
        slipped += (np.ptp(rest, axis=0).max(axis=-1) > 1e-6).sum()
    every = groups * count
    assert limited > 0 and reversed_ > 0.3 * every and slipped > 0.9 * every


@pytest.mark.parametrize("wrong", ["sign of q", "sign of F", "no S", "half S"])
def test_the_check_notices_a_wrong_law_or_storage(bench, exact, wrong):
    """Torques of the wrong sign, or a storage that is not that of the law, fall."""
    rng = np.random.default_rng(3)
    some = run(bench, on_linear_spring(random_drive(0, rng)), 25, rng)
    hysteresis, friction = works(some)
    share = {"no S": 0.0, "half S": 0.5}.get(wrong, 1.0)
    q, F = 1.0 - 2.0 * (wrong == "sign of q"), 1.0 - 2.0 * (wrong == "sign of F")
    falls = [
        drawdown(sign * work - share * np.diff(energy, axis=0))
        for sign, work, energy in zip(
            (q, F), (hysteresis, friction), stored(some), strict=True
        )
    ]
    assert np.max(falls / largest_energy(some)) > 1e3 * ROUND_OFF


@pytest.mark.parametrize(
    ("groups", "pairs"), [(8, 40), pytest.param(40, 250, marks=pytest.mark.slow)]
)
def test_steps_equal_the_twin_and_every_element_is_passive(bench, groups, pairs):
    """Steps of histories on the catalogue maps themselves: speeds, state, energies.

    The twin starts every step in the recorded state. It gives the torques of each
    element and of the bristle, whose work is at least the energy that they gain.
    """
    rng = np.random.default_rng(groups + 1)
    for k in range(groups):
        drive = random_drive(k, rng)
        some = run(bench, drive, 25, rng)
        stiffness = np.array([element.stiffness for element in drive.hysteresis])
        for _ in range(pairs):
            at, j = int(rng.integers(STEPS)), int(rng.integers(25))
            motion, h = some.motion(at, j), float(some.step[j])
            damping = some.damping
            if some.limited[at, j]:
                damping = max(damping, some.contact_damping)
            f = scheme_force(drive, motion, timestep=h, damping=damping)
            torque = np.array([f.theta, f.psi]) + some.other[at, j]
            metric = np.diag(some.inertia[j]) + metric_of(drive, f, timestep=h)
            v = some.v[at, j] + np.linalg.solve(metric, h * torque)
            size = np.abs(some.v[:, j]).max(axis=0)
            assert (np.abs(v - some.v[at + 1, j]) <= 1e-9 * size).all()
            rates = {"timestep": h, "theta_rate": v[0], "psi_rate": v[1]}
            rest = rest_after(drive, motion, f, **rates)
            want = [*other_acceleration(drive, motion, f, **rates), *rest]
            want.append(relax_state(drive, motion, f, **rates))
            got = some.state[at + 1, j, : len(want)]
            scale = np.abs(some.state[:, j, : len(want)]).max(axis=0)
            assert (np.abs(got - want) <= 1e-9 * scale + 1e-12).all()
            dx = 0.5 * h * (some.v[at, j] + v)
            change = float(np.dot([f.g_theta, f.g_psi], dx))
            start = np.array([e.stretch for e in f.elements])
            end = np.array([e.stretch_after(change) for e in f.elements])
            work = np.array([(e.offset + e.rate * change) * change for e in f.elements])
            gained = 0.5 * stiffness * (end**2 - start**2)
            assert (gained <= work + 1e-12 * (np.abs(work) + np.abs(gained))).all()


@pytest.mark.parametrize(("step", "parts"), [(2e-3, 3), (5e-3, 6)])
def test_hysteresis_of_a_light_joint_gives_no_energy(step, parts):
    """Elements that slip in steps that do not resolve the torsion, h w = 11 and 14.

    With a prediction by Newton's method, which alternates between sticking and
    slipping there, such a joint gains 3 to 14 % in one sense of rotation.
    """
    drive = with_friction_of_teeth(hardening_drive(1e3))
    joint = make_joint(drive, rotor=1e-7, link=1e-4, step=step)
    full = drive.ratings.repeated_peak
    for speed in (20.0, -20.0):
        start = Start(torque=full, load=full, speed=speed)
        assert joint.region(abs(speed), torque=full).sub_steps == parts
        course = joint.run(start, duration=2000 * step, sub_steps=parts)
        assert course.gain < 1e-3


positive = st.floats(1e-3, 1e3)


@settings(max_examples=250, deadline=None, derandomize=True)
@example(stiffness=1.0, reach=1e-200, stretch=0.0, change=1.0, off=0.0)
@example(stiffness=1.0, reach=1e-200, stretch=1e-200, change=1e-190, off=0.0)
@example(stiffness=11.0, reach=1.4e-160, stretch=0.0, change=0.0, off=1.4e-160)
@given(
    stiffness=positive,
    reach=st.floats(0.0, 1.0),
    stretch=st.floats(-1.2, 1.2),
    change=st.floats(-5.0, 5.0),
    off=st.floats(-10.0, 10.0),
)
def test_one_step_of_an_element(stiffness, reach, stretch, change, off):
    """The work is at least the energy gained, whatever the step; slip takes f r.

    In the predicted step the element dissipates its yield torque times the slip.
    """
    element = Jenkin(stiffness=stiffness, yield_torque=1.0)
    [step] = element_steps([element], [-stretch], [reach], 0.0, change)

    def lost(true: float) -> float:
        work = (step.offset + step.rate * true) * true
        end = step.stretch_after(true)
        assert abs(end) <= reach
        return work - 0.5 * stiffness * (end**2 - step.stretch**2)

    size = stiffness * (reach + abs(step.stretch) + abs(change) + abs(off)) ** 2
    size += step.rate * (abs(change) + abs(off)) ** 2
    for true in (change, change + off, -change, 0.1 * change, 0.0):
        # products of numbers below 1e-154 are not normal and have no relative accuracy
        assert lost(true) >= -1e-12 * size - np.finfo(float).tiny
    slip = abs(step.stretch + change) - reach
    assert lost(change) == pytest.approx(
        stiffness * reach * max(0.0, slip), rel=1e-9, abs=1e-12 * size
    )
