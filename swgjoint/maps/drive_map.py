"""The map of a drive: where it comes from, its file and its spec sheet."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from swgjoint.gear.ratings import Ratings
from swgjoint.maps.potential import Potential


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveMap(Potential):
    """The reduced drive: torque over torsion and angles, with its sources and files.

    The data and the equations are those of :class:`Potential`.
    """

    # -- constructors ---------------------------------------------------------

    @classmethod
    def linear(
        cls,
        stiffness: float,
        *,
        layout: str = "circular_spline_fixed",
        teeth_flexspline: int = 200,
        teeth_circular_spline: int = 202,
        rated_torque: float = 100.0,
        name: str = "linear",
    ) -> Self:
        """A map of constant torsional stiffness [N·m/rad] without kinematic error.

        Args:
            stiffness: Torsional stiffness at the output [N·m/rad].
            layout: Which member is fixed.
            teeth_flexspline: Number of teeth of the flexspline.
            teeth_circular_spline: Number of teeth of the circular spline.
            rated_torque: Rated torque [N·m]; the other ratings follow from it.
            name: Name of the drive.

        >>> from swgjoint import DriveMap
        >>> DriveMap.linear(2e4, rated_torque=50.0).torque_range
        (-100.0, 100.0)
        """
        end = 2.0 * rated_torque / stiffness
        # V = K x^2 / 2 about the first knot at -end
        row = [0.5 * stiffness * end**2, -stiffness * end, 0.5 * stiffness, 0.0, 0.0]
        potential = np.zeros((1, 2, 1, 5))
        potential[0, 0, 0] = row
        return cls(
            name=name,
            level="linear",
            layout=layout,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            torsion_knots=np.array([-end, end]),
            orders=np.zeros((1, 2), dtype=np.int64),
            potential=potential,
            end_stiffness=np.array([[[stiffness, stiffness], [0.0, 0.0]]]),
            kinematic_error=np.zeros((1, 2)),
            ratings=Ratings(
                rated_torque=rated_torque,
                repeated_peak=2.0 * rated_torque,
                momentary_peak=4.0 * rated_torque,
                T1=0.2 * rated_torque,
                T2=0.6 * rated_torque,
            ),
        )

    @classmethod
    def from_catalogue(
        cls, name: str, *, kinematic_error_arcmin: float | None = None, seed: int = 0
    ) -> Self:
        """The map of a catalogue drive such as ``CSG-25-100``: series, size, ratio.

        Stiffness K1, K2, K3 and ratings of the shipped tables, and the hysteresis loss
        where a row states one (CHA), at the upper bound that it is; friction where
        losses are stated (CSG, ratio 100, sizes 14 to 25). The kinematic error is that
        of an assumed specimen, 2 and 4 cycles per turn of the input, whose peak to peak
        is the transmission accuracy that the tables state: a bound that says nothing of
        orders and phases. ``info["kinematic_error"]`` says what was assumed,
        ``info["stated"]`` what the tables state.

        Args:
            name: Of the row.
            kinematic_error_arcmin: Peak to peak over one output turn; None: the stated
                transmission accuracy, no error where none is stated; 0: no error.
            seed: Of the share of both orders and of their phases.

        Raises:
            InputError: With the nearest names, if there is no such row, or if an option
                is out of range.

        >>> from swgjoint import DriveMap
        >>> drive = DriveMap.from_catalogue("CSG-25-100")
        >>> drive.ratio, drive.ratings.rated_torque
        (-100.0, 87.0)
        """
        from swgjoint.maps.from_catalogue import map_from_catalogue

        return map_from_catalogue(
            name, cls, kinematic_error_arcmin=kinematic_error_arcmin, seed=seed
        )

    @classmethod
    def from_measurement(
        cls,
        path: str | Path,
        *,
        teeth_flexspline: int,
        teeth_circular_spline: int,
        ratings: Ratings | float,
        kinematic_error: str | Path | None = None,
        **options: Any,
    ) -> Self:
        """The map of a measured drive; ``info["fit"]`` holds residuals.

        Args:
            path: CSV file of a torque-torsion loop, input locked, both signs of the
                torque: ``torque_Nm`` and ``torsion_arcmin`` or ``torsion_rad``.
            teeth_flexspline: z_fs.
            teeth_circular_spline: z_cs.
            ratings: Torques, or the rated torque alone [N·m].
            kinematic_error: CSV file of one output turn without load: ``output_deg``
                and ``error_arcmin``, output minus ideal output (also ``_rad``).
            **options: ``layout``, ``orders``, ``intervals``, ``damping_ratio``,
                ``name``; see :mod:`swgjoint.maps.fit.measurement`.

        Raises:
            InputError: If a file or a value cannot be used.
        """
        from swgjoint.maps.fit.measurement import map_from_measurement

        return map_from_measurement(
            path,
            cls,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            ratings=ratings,
            kinematic_error=kinematic_error,
            **options,
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a ``.swg`` file; see :mod:`swgjoint.maps.file`."""
        from swgjoint.maps.file import read_map

        return read_map(path, cls)

    def save(self, path: str | Path) -> None:
        """Write a ``.swg`` file, whole or not at all."""
        from swgjoint.maps.file import write_map

        write_map(self, path)

    def spec_sheet(self, only: Collection[str] = ()) -> dict[str, Any]:
        """Catalogue-style figures, measured on the map by the standard procedures.

        Keys as ``swgjoint spec`` has them; None where the source cannot tell, with the
        reason in ``missing``.

        Args:
            only: Keys that are wanted, all for none.

        >>> from swgjoint import DriveMap
        >>> drive = DriveMap.from_catalogue("CSG-25-100")
        >>> sheet = drive.spec_sheet(["T1_Nm", "K1_Nm_rad"])
        >>> sheet["T1_Nm"], round(sheet["K1_Nm_rad"])
        (14.0, 31148)
        """
        from swgjoint.maps.sheet.spec_sheet import spec_sheet

        return spec_sheet(self, only)
