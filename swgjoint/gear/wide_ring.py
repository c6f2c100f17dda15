r"""State between plane stress and plane strain of a toothed rim of finite width.

A rim that is bent circumferentially tends to bend in the opposite direction across its
width (anticlastic bending). Three effects determine how far this bending develops:

* the teeth act as ribs along the width. The rim remains flexible in circumferential
  bending but becomes stiff across the width, which suppresses most of the anticlastic
  bending;
* the ring is curved: bending across the width stretches it circumferentially, which
  acts like an elastic foundation under a beam;
* the axial stress is zero at both edges of the face.

A smooth ring of the same width has no ribs. It remains close to plane stress up to
widths of several :math:`\sqrt{rt}`, even if these are many times its thickness.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, cosh, sin, sinh, sqrt, tanh

EDGE_LAYER = 1.5
"""Width over which both edges together relieve the axial stress, divided by the square
root of module times rim thickness [-].

The value is calibrated with solid models of the rings of eleven drives in CalculiX
(elements C3D20R; quarter models that a traction cos 2 phi on the bore bends; rims of
0.4 to 2 mm, modules of 0.2 to 1 mm, widths of 1 to 40 rim thicknesses). With this
value, the stiffness against two-lobe bending is within 0.8 % of every solid model, and
within 0.5 % for widths of at least four rim thicknesses."""


@dataclass(frozen=True, kw_only=True)
class RimAcross:
    """Stiffness of a toothed rim, per unit length of face width or circumference."""

    radius: float
    """Radius of the neutral line [m]."""
    bending: float
    """Circumferential bending stiffness in plane stress [N·m]: E I divided by the face
    width."""
    stretching: float
    """Circumferential stretching stiffness [N/m]: E A divided by the face width."""
    across: float
    """Bending stiffness across the width [N·m]: E I of rim and tooth of one pitch,
    divided by the pitch."""


def edge_confinement(width: float, module: float, rim: float) -> float:
    r"""Mean confinement over the width between the two free edges [-].

    .. math:: g = 1 - \frac{\tanh x}{x}, \quad x = \frac{b}{1.5\sqrt{mt}}

    This is the mean of a stress that is zero at both edges and grows towards the middle
    of the face as in shear lag.

    Args:
        width: Face width b [m].
        module: Module m [m].
        rim: Thickness t of the rim below the teeth [m].
    """
    x = width / (EDGE_LAYER * sqrt(module * rim))
    # the series avoids the difference of nearly equal numbers for narrow faces
    return x**2 / 3.0 if x < 1e-4 else 1.0 - tanh(x) / x


def anticlastic_share(width: float, rim: RimAcross) -> float:
    r"""Fraction of the anticlastic bending that develops in a curved ring [-].

    It is the end rotation of a beam on an elastic foundation, divided by that of a free
    beam under the same end moments:

    .. math:: f = \frac{2}{x}\,\frac{\cosh x - \cos x}{\sinh x + \sin x}, \quad
        x = \beta b, \quad \beta^4 = \frac{EA}{4 r^2 D_z}

    Args:
        width: Face width b [m].
        rim: Radius and stiffness of the rim.

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

    Plane strain requires the moment :math:`\nu M` across the width. Where this moment
    is released, the rim bends with the stiffness :math:`D_z`, which adds
    :math:`f\nu^2/D_z` to the compliance :math:`(1-\nu^2)/D_\varphi` of plane strain:

    .. math:: \frac{1}{D} = \frac{1 - c\nu^2}{D_\varphi}, \quad
        c = g\Bigl(1 - f\,\frac{D_\varphi}{D_z}\Bigr)

    with :math:`D_\varphi` for plane stress, f from :func:`anticlastic_share` and g from
    :func:`edge_confinement`. For a smooth ring :math:`D_z = D_\varphi`. Negative values
    of the bracket are replaced by zero.

    Args:
        width: Face width [m].
        module: Module [m].
        thickness: Thickness of the rim below the teeth [m].
        rim: Radius and stiffness of the rim.
    """
    released = anticlastic_share(width, rim) * rim.bending / rim.across
    return edge_confinement(width, module, thickness) * max(0.0, 1.0 - released)
