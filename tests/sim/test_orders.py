"""Order analysis: known lines come back."""

import numpy as np
import pytest

from swgjoint.sim.figures.orders import order_spectrum, strongest_lines


def uneven_angle(turns: float = 3.37, samples: int = 6000) -> np.ndarray:
    """An input angle that wobbles like that of a real motor [rad]."""
    t = np.linspace(0.0, 1.0, samples)
    return 2.0 * np.pi * turns * (t + 2e-4 * np.sin(2.0 * np.pi * 23.0 * t))


def test_known_lines_come_back_within_one_percent():
    """Orders between the bins, a trend and noise change amplitudes by less than 1 %."""
    angle = uneven_angle()
    noise = np.random.default_rng(3).normal(0.0, 0.005, angle.size)
    signal = (
        0.8 * np.cos(121.93 * angle + 1.0)
        + 0.3 * np.sin(2.03 * angle)
        + 0.1 * np.cos(60.4 * angle)
        + 5.0
        + 0.4 * angle
        - 0.02 * angle**2
        + noise
    )
    lines = strongest_lines(angle, signal, highest=150.0)
    assert [round(line.order) for line in lines] == [122, 2, 60]
    for line, (order, amplitude) in zip(
        lines, [(121.93, 0.8), (2.03, 0.3), (60.4, 0.1)], strict=True
    ):
        assert line.order == pytest.approx(order, abs=0.02)  # record: 0.3 per bin
        assert line.amplitude == pytest.approx(amplitude, rel=0.01)


def test_neighbouring_lines_keep_their_amplitudes():
    """A strong line does not leak into one four orders away."""
    angle = uneven_angle()
    signal = np.cos(122.0 * angle) + 0.05 * np.sin(118.0 * angle + 0.4)
    lines = strongest_lines(angle, signal, highest=150.0, count=2)
    assert [round(line.order) for line in lines] == [122, 118]
    assert lines[1].amplitude == pytest.approx(0.05, rel=0.01)


def test_direction_does_not_matter():
    """Turning the input backwards gives the same orders and amplitudes."""
    angle = uneven_angle()
    forth = strongest_lines(angle, np.cos(41.0 * angle), highest=100.0, count=1)
    back = strongest_lines(-angle, np.cos(41.0 * angle), highest=100.0, count=1)
    assert forth[0].order == pytest.approx(back[0].order, abs=1e-9)
    assert forth[0].amplitude == pytest.approx(back[0].amplitude, rel=1e-9)


def test_nothing_above_the_resolved_order_is_reported():
    """A line above the highest order does not appear, neither there nor folded."""
    angle = uneven_angle()
    lines = strongest_lines(angle, np.cos(90.0 * angle), highest=60.0, floor=1e-3)
    assert lines == ()


def test_a_constant_has_no_lines():
    """Mean, slope and bend of a signal are trend, not a line."""
    angle = uneven_angle()
    trend = 3.0 + 0.2 * angle + 0.01 * angle**3
    assert strongest_lines(angle, trend, highest=60.0, floor=1e-9) == ()


def test_an_input_at_rest_has_no_orders():
    """Without half an input turn there is no spectrum, and no false one."""
    angle = np.linspace(0.0, 0.5, 500)
    assert strongest_lines(angle, np.cos(100 * angle), highest=60.0) == ()
    assert order_spectrum(angle, angle) is None


def test_spectrum_shows_the_amplitude_of_a_lone_line():
    """The picture's spectrum peaks at the order with the line's own amplitude."""
    angle = uneven_angle(turns=10.0)
    spectrum = order_spectrum(angle, 0.7 * np.cos(17.0 * angle))
    peak = int(np.argmax(spectrum.amplitude))
    assert spectrum.order[peak] == pytest.approx(17.0, abs=0.02)
    assert spectrum.amplitude[peak] == pytest.approx(0.7, rel=0.01)
