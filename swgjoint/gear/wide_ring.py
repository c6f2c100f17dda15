r"""State of a toothed rim of finite width between plane stress and plane strain.

A rim that is bent circumferentially tends to bend in the opposite sense across its
width (anticlastic bending). Three effects limit this:

* The teeth are ribs across the width. They hardly stiffen the rim circumferentially but
  stiffen it across the width, which suppresses most of the anticlastic bending.
* The ring is curved. Bending across the width stretches it circumferentially, which
  acts like an elastic foundation of a beam.
* The axial stress vanishes at both edges of the face.

A smooth ring of the same width has no ribs. It is close to plane stress up to widths of
several :math:`\sqrt{rt}`, even if it is much wider than thick.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, cosh, sin, sinh, sqrt, tanh

EDGE_LAYER = 1.5
"""Width over which both edges together release the axial stress, divided by the square
root of module times rim thickness. It was calibrated with 3D models of the rings of
eleven drives in CalculiX (C3D20R elements, quarter rings loaded by a traction
cos 2 phi on the bore; rims of 0.4 to 2 mm, modules of 0.2 to 1 mm, widths of 1 to 40
rim thicknesses). The two-lobe stiffness is within 0.8 % of every 3D model, and within
0.5 % for widths of at least four rim thicknesses."""


@dataclass(frozen=True, kw_only=True)
class RimAcross:
    """Stiffness of a rim around and across, per metre of width or circumference."""

    radius: float
    """Radius of the neutral line [m]."""
    bending: float
    """Circumferential bending stiffness E I over the width, in plane stress [N·m]."""
    stretching: float
    """Circumferential stiffness E A over the width [N/m]."""
    across: float
    """Bending stiffness across the width: E I of the rim and tooth of one pitch over
    the pitch [N·m]."""


def edge_confinement(width: float, module: float, rim: float) -> float:
    r"""Mean confinement over the width, reduced by the two free edges [-].

    .. math:: g = 1 - \frac{\tanh x}{x}, \quad x = \frac{b}{1.5\sqrt{mt}}

    This is the mean of a stress that increases from zero at the edges, as in shear lag.

    Args:
        width: Face width b [m].
        module: Module m [m].
        rim: Thickness t of the rim below the teeth [m].
    """
    x = width / (EDGE_LAYER * sqrt(module * rim))
    # series for narrow faces, where 1 - tanh(x)/x would cancel
    return x**2 / 3.0 if x < 1e-4 else 1.0 - tanh(x) / x


def anticlastic_share(width: float, rim: RimAcross) -> float:
    r"""Fraction of the free anticlastic bending that occurs in a curved ring [-].

    It is the end rotation of a beam on an elastic foundation under equal end moments,
    divided by that of a free beam:

    .. math:: f = \frac{2}{x}\,\frac{\cosh x - \cos x}{\sinh x + \sin x}, \quad
        x = \beta b, \quad \beta^4 = \frac{EA}{4 r^2 D_z}

    Args:
        width: Face width b [m].
        rim: Stiffness of the rim.

    Source:
        Hetenyi (1946), "Beams on Elastic Foundation", University of Michigan Press,
        finite beam with free ends; the foundation of a cylinder: Timoshenko and
        Woinowsky-Krieger (1959), "Theory of Plates and Shells", 2nd ed., McGraw-Hill,
        section 114. Ashwell (1950), "The anticlastic curvature of rectangular beams and
        plates", J. R. Aeronautical Society 54, gives the same function for flat strips.
    """
    beta = sqrt(sqrt(rim.stretching / (4.0 * rim.radius**2 * rim.across)))
    x = beta * width
    if x < 1e-3:
        return 1.0
    if x > 300.0:
        return 2.0 / x
    return 2.0 / x * (cosh(x) - cos(x)) / (sinh(x) + sin(x))


def rim_confinement(
    width: float, module: float, thickness: float, rim: RimAcross
) -> float:
    r"""Confinement c of a toothed rim, 0 in plane stress and 1 in plane strain [-].

    Plane strain requires a moment :math:`\nu M` across the width. Releasing it against
    the stiffness :math:`D_z` adds :math:`f\nu^2/D_z` to the plane-strain compliance
    :math:`(1-\nu^2)/D_\varphi`:

    .. math:: \frac{1}{D} = \frac{1 - c\nu^2}{D_\varphi}, \quad
        c = g\Bigl(1 - f\,\frac{D_\varphi}{D_z}\Bigr)

    Here :math:`D_\varphi` is that of plane stress, f is :func:`anticlastic_share` and g
    is :func:`edge_confinement`. For a smooth ring :math:`D_z = D_\varphi`.

    Args:
        width: Face width [m].
        module: Module [m].
        thickness: Thickness of the rim [m].
        rim: Stiffness of the rim around and across.
    """
    released = anticlastic_share(width, rim) * rim.bending / rim.across
    return edge_confinement(width, module, thickness) * max(0.0, 1.0 - released)
