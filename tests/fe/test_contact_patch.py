"""The averaged displacement of a touched flank, and what it is there for."""

import numpy as np
import pytest

from swgjoint.fe.common.contact_patch import PATCH_PARTS, average_spline
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design

STATIONS = np.linspace(0.3e-3, 2.2e-3, 21)


def test_linear_fields_are_reproduced_to_the_ends():
    """Rigid motion of a straight flank closes the gap by exactly that motion."""
    s = np.linspace(STATIONS[0], STATIONS[-1], 301)
    found = average_spline(STATIONS)(s) @ (2.0 + 3.0e3 * STATIONS)
    assert found == pytest.approx(2.0 + 3.0e3 * s, rel=1e-12)


def test_average_of_a_wave_has_the_transform_of_the_patch():
    """A sine is damped by the Fourier transform of (1 - x^2)^3, quadrature apart."""
    fine = np.linspace(STATIONS[0], STATIONS[-1], 401)
    half = (STATIONS[-1] - STATIONS[0]) / PATCH_PARTS
    wave_number = 2.0 / half
    s = np.linspace(0.8e-3, 1.7e-3, 50)
    found = average_spline(fine)(s) @ np.sin(wave_number * fine)
    x = np.linspace(-1.0, 1.0, 20_001)
    kernel = (1.0 - x**2) ** 3
    factor = float(np.sum(kernel * np.cos(2.0 * x)) / np.sum(kernel))
    # cubic splines through knots a sixth of the patch apart
    assert found == pytest.approx(factor * np.sin(wave_number * s), abs=2e-4)


@pytest.mark.fe
@pytest.mark.parametrize(
    ("name", "meshes", "angles"),
    [
        ("reference-2d", (0.5, 1), 12),
        pytest.param("reference-2d", (1, 2), 24, marks=pytest.mark.slow),
        pytest.param("reference-2d-simplified", (1, 2), 24, marks=pytest.mark.slow),
    ],
)
def test_kinematic_error_does_not_depend_on_the_mesh(name, meshes, angles):
    """Unloaded peak to peak over one pitch changes by under 5 % on refinement."""
    found = []
    for refinement in meshes:
        design = Design.preset(name).with_changes({"mesh.refinement": refinement})
        follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
        state = follow.to_torque(follow.engage(follow.deflect()), 0.0)
        error = []
        for angle in 2.0 * np.pi / 122 * np.arange(angles) / angles:
            state = follow.to_angle(state, float(angle))
            assert state.outcome.ok
            error.append(follow.output_angle(state) - angle / design.ratio)
        found.append(np.ptp(error))
    assert found[1] == pytest.approx(found[0], rel=0.05)
