"""Strain gauges of a scene's joints: what they read of a recorded or simulated motion.

The reading needs the geometry of the flexspline. It comes from a design with a cup:
that of the drive, or one that the scene names. A catalogue drive does not state it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import gcd
from typing import Any, TypeVar

import numpy as np

from swgjoint.drives.references import names_catalogue
from swgjoint.drives.sections import GaugesSection, JointSection
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.gear.gauges import FlexsplineWall, GaugeRing, WallStrain, torque_in_wall
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.figures.transmission import Transmission
from swgjoint.typing import Array
from swgjoint.units import mm

Values = TypeVar("Values", float, Array)

COMPARED = (1, 2, 3, 5)
"""Numbers of bridges of which the figures state what they would leave."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointGauges:
    """Gauges on the flexspline of one drive, with the strain that they see."""

    ring: GaugeRing
    """The bridges."""
    strain: WallStrain
    """Strain in their section."""
    layout: str
    """Which member of the drive is fixed."""
    ratio: float
    """Signed ratio i [-]."""
    design: str
    """Name of the design that provides the geometry."""
    model: str
    """Model of the strain: ``3d`` or ``outline``."""

    @property
    def share(self) -> float:
        """Torque in the wall per output torque [-]."""
        return torque_in_wall(self.layout, self.ratio)

    @property
    def gain(self) -> float:
        """Signal per supply voltage and output torque [1/(N·m)]."""
        return self.share * self.ring.gain(self.strain)

    @property
    def nominal_gain(self) -> float:
        """The same of gauges without errors, by which readings are scaled [1/(N·m)]."""
        return self.share * self.ring.nominal_gain(self.strain)

    @property
    def orders(self) -> Array:
        """Orders of the ripple per input turn while the torsion is constant (m,)."""
        theta, psi = angle_coefficients(self.layout)[1]
        return np.asarray(self.strain.orders * abs(theta + psi / self.ratio))

    @property
    def ripple(self) -> Array:
        """Amplitudes of the ripple by order, as output torque (m,) [N·m]."""
        return np.asarray(np.abs(self.ring.ripple(self.strain) / self.nominal_gain))

    @cached_property
    def _waves(self) -> tuple[int, list[float], list[float]]:
        """Common divisor of all orders, and real and imaginary amplitudes [N·m].

        The amplitudes are those of the multiples of the divisor, the highest first.
        """
        orders = [round(order) for order in self.strain.orders]
        step = gcd(*orders)
        waves = np.zeros(max(orders) // step + 1, complex)
        ripple = self.ring.ripple(self.strain) / self.nominal_gain
        waves[np.array(orders) // step] = ripple
        return step, waves.real[::-1].tolist(), waves.imag[::-1].tolist()

    @cached_property
    def _scale(self) -> float:
        """Reading per torque [-]; one without errors of the gauges."""
        return self.gain / self.nominal_gain

    @property
    def largest_ripple(self) -> float:
        """Upper bound of the ripple of the reading [N·m]."""
        return float(self.ripple.sum())

    def read_torque(self, torque: Values, theta: Values, psi: Values) -> Values:
        """Output torque that the gauges read (n,) [N·m].

        The sum over the orders, Re sum c_n exp(-i n beta), is computed by Horner's rule
        in real numbers, so that one instant and many give the same bits.

        Args:
            torque: Output torque (n,) [N·m], or a number, like the others.
            theta: Input angle (n,) [rad].
            psi: Output angle (n,) [rad].
        """
        a, b = angle_coefficients(self.layout)[1]
        step, real, imaginary = self._waves
        angle = step * (a * theta + b * psi)
        cosine, sine = np.cos(angle), np.sin(angle)
        if isinstance(torque, float):  # python's numbers are faster than numpy's
            cosine, sine = float(cosine), float(sine)
        re, im = 0.0 * cosine, 0.0 * sine
        for x, y in zip(real, imaginary, strict=True):
            re, im = re * cosine + im * sine + x, im * cosine - re * sine + y
        return self._scale * torque + re


def with_bridges(gauges: JointGauges, count: int) -> JointGauges:
    """Other gauges in the same place: exact bridges at equal distances.

    Args:
        gauges: The gauges.
        count: Number of bridges.
    """
    ring = replace(gauges.ring, bridges=count, spacing=None, shifts=(), turns=())
    return replace(gauges, ring=ring)


def joint_gauges(
    where: str,
    sections: Sequence[JointSection],
    transmissions: Sequence[Transmission],
    progress: Progress = silent,
) -> dict[str, JointGauges]:
    """Gauges by joint, for the joints that have any.

    Args:
        where: File name for messages.
        sections: Joint settings, one per joint.
        transmissions: Compiled drives, one per joint.
        progress: Called while the contact of a flexspline is solved.

    Raises:
        InputError: If the geometry of a flexspline is not known or does not fit.
    """
    return {
        t.joint: gauges_of_drive(
            section.gauges,
            t.drive,
            section.drive,
            where=f"{where}: joints.{t.joint}.gauges",
            progress=progress,
        )
        for section, t in zip(sections, transmissions, strict=True)
        if section.gauges is not None
    }


def gauges_of_drive(
    section: GaugesSection,
    drive: DriveMap,
    reference: str | None,
    *,
    where: str,
    progress: Progress = silent,
) -> JointGauges:
    """Gauges on the flexspline of one drive, with the strain that they see.

    Args:
        section: The gauges.
        drive: Map of the drive.
        reference: Reference of the drive (catalogue name, design or file), if any.
        where: Path of the section, for messages.
        progress: Called while the contact of the flexspline is solved.

    Raises:
        InputError: If the geometry of the flexspline is not known or does not fit.
    """
    design = _flexspline_design(section, reference, where=where)
    if (design.ratio, design.drive.layout) != (drive.ratio, drive.layout):
        raise InputError(
            f"{where}.flexspline: {design.drive.name!r} has the ratio"
            f" {design.ratio:g} ({design.drive.layout}), the drive {drive.ratio:g}"
            f" ({drive.layout}); accepted: a design of the same ratio and layout"
        )
    try:
        wall = FlexsplineWall.from_design(design)
    except InputError as error:
        raise InputError(f"{where}.flexspline: {error}") from None
    low, high = wall.smooth
    ring = section.ring()
    if not low <= ring.place <= high:
        raise InputError(
            f"{where}.position_mm = {section.position_mm:g} mm; accepted:"
            f" {low / mm:.4g} to {high / mm:.4g} mm, the smooth wall of"
            f" {design.drive.name!r}"
        )
    return JointGauges(
        ring=ring,
        strain=wall.strain(ring.place)
        if section.strain == "outline"
        else _contact_strain(design, ring.place, where, progress),
        model=section.strain,
        layout=drive.layout,
        ratio=drive.ratio,
        design=design.drive.name,
    )


def _contact_strain(
    design: Design, place: float, where: str, progress: Progress
) -> WallStrain:
    from swgjoint.fe.solid.figures.deflected_wall import deflected_strain

    try:
        return deflected_strain(design, place, progress=progress)
    except InputError as error:
        raise InputError(f"{where}.flexspline: {error}") from None


def _flexspline_design(
    section: GaugesSection, drive: str | None, *, where: str
) -> Design:
    """The design that states the geometry of the flexspline."""
    reference = section.flexspline or drive
    if section.flexspline is None and (
        reference is None or reference.endswith(".swg") or names_catalogue(reference)
    ):
        name = "the drive" if reference is None else f"drive {reference!r}"
        raise InputError(
            f"{where}.flexspline: missing; {name} does not state the geometry of its"
            " flexspline; accepted: a design with a [cup]"
        )
    try:
        return Design.load(str(reference))
    except InputError as error:
        raise InputError(f"{where}.flexspline: {error}") from None


def gauge_figures(
    gauges: JointGauges, *, torque: Array, reading: Array, rated: float
) -> dict[str, Any]:
    """Gain, ripple and error of the gauges of one joint, with keys of the JSON output.

    Args:
        gauges: The gauges.
        torque: Output torque (n,) [N·m].
        reading: Torque that the gauges read (n,) [N·m].
        rated: Rated torque [N·m].
    """
    error = reading - torque
    return {
        "flexspline": gauges.design,
        "strain": gauges.model,
        "bridges": gauges.ring.bridges,
        "gain_uV_V_Nm": 1e6 * gauges.gain,
        "gain_error_percent": 100.0 * (gauges.gain / gauges.nominal_gain - 1.0),
        "ripple": [
            {
                "order": float(order),
                "amplitude_Nm": float(amplitude),
                "amplitude_percent": float(100.0 * amplitude / rated),
            }
            for order, amplitude in zip(gauges.orders, gauges.ripple, strict=True)
        ],
        "error_Nm": {
            "mean": float(error.mean()),
            "rms": float(np.sqrt(np.mean(error**2))),
            "pp": float(np.ptp(error)),
        },
        "compensation": [
            {
                "bridges": count,
                "ripple_rms_percent": float(
                    100.0
                    * np.linalg.norm(with_bridges(gauges, count).ripple)
                    / (np.sqrt(2.0) * rated)
                ),
            }
            for count in COMPARED
        ],
        "error_rms_percent": float(100.0 * np.sqrt(np.mean(error**2)) / rated),
    }
