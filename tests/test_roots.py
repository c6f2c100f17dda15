"""The root search: the bits of SciPy's."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from swgjoint.roots import find_root

KINDS = {
    "cubic": lambda a, b, c: lambda x: a + abs(b) * x + abs(c) * x**3,
    "steep": lambda a, b, c: lambda x: math.tanh(20.0 * b * (x - a)),
    "triple": lambda a, b, c: lambda x: (x - a) ** 3 + 1e-3 * (x - a),
    "steps": lambda a, b, c: lambda x: math.floor(8.0 * x) / 8.0 - a,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tolerances", [(1e-18, 1e-14), (1e-9, 1e-12)])
def test_a_root_has_the_bits_of_scipy(kind, tolerances):
    """Smooth, steep and flat functions, jumps, and a root at either end."""
    rng = np.random.default_rng(0)
    given = dict(zip(("xtol", "rtol"), tolerances, strict=True))
    found = 0
    while found < 200:
        function = KINDS[kind](*rng.normal(size=3))
        ends = -4.0 - rng.random(), 4.0 + rng.random()
        if function(ends[0]) * function(ends[1]) > 0.0:
            continue
        assert find_root(function, *ends, **given) == brentq(function, *ends, **given)
        found += 1
    for ends in ((0.0, 1.0), (-1.0, 0.0)):
        assert find_root(lambda x: x, *ends, **given) == 0.0
