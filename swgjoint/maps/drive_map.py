"""The map of a drive, with its constructors, file and spec sheet."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from swgjoint.gear.ratings import Ratings
from swgjoint.maps.potential import Potential
from swgjoint.units import arcmin


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveMap(Potential):
    """The reduced drive: output torque as a function of torsion and gear angles.

    Data and equations are inherited from :class:`Potential`; this class adds
    constructors, files and the spec sheet.
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
            rated_torque: Rated torque [N·m]; the other ratings are multiples of it.
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
                source="default (repeated_peak_Nm, momentary_peak_Nm, T1_Nm, T2_Nm):"
                " multiples of the rated torque",
            ),
        )

    @classmethod
    def from_catalogue(
        cls, name: str, *, kinematic_error_arcmin: float | None = None, seed: int = 0
    ) -> Self:
        """The map of a catalogue drive such as ``CSG-25-100`` (series, size, ratio).

        Stiffness K1, K2, K3 and ratings come from the shipped tables. The hysteresis
        loss is the stated upper bound if the tables state one (CHA). The map includes
        friction if the tables state losses (CSG, ratio 100, sizes 14 to 25). The
        kinematic error is that of an assumed specimen: 2 and 4 cycles per input turn,
        with the stated transmission accuracy as peak-to-peak value by default. The
        tables do not state orders and phases of the error.
        ``info["kinematic_error"]`` records the assumption and ``info["stated"]`` the
        figures of the tables.

        Args:
            name: Name of the row.
            kinematic_error_arcmin: Peak-to-peak kinematic error over one output turn
                [arcmin]; 0 means no error. None takes the stated transmission accuracy,
                or no error if none is stated.
            seed: Seed for the amplitude ratio and the phases of the two orders.

        Raises:
            InputError: If there is no such row (the message lists the nearest names),
                the tables contradict each other or an option is out of range.

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
    def from_numbers(
        cls,
        *,
        stiffness: float | Sequence[float],
        rated_torque: float,
        **options: Any,
    ) -> Self:
        """The map of a drive of which a few figures are known.

        ``spec_sheet`` of the map finds the stated figures by the standard procedures.
        A lost motion beyond that of the stiffness becomes a clearance, and a hysteresis
        loss beyond the clearance becomes friction.

        Args:
            stiffness: Torsional stiffness, or K1, K2 and K3 [N·m/rad].
            rated_torque: Rated torque [N·m].
            **options: ``ratio`` (default 100); ``lost_motion_arcmin``;
                ``hysteresis_loss_arcmin``; ``kinematic_error``, amplitude [arcmin] by
                order per input turn, zero to peak; ``T1``, ``T2``, ``repeated_peak``
                and ``momentary_peak`` [N·m] (default 0.2, 0.6, 2 and 4 times the rated
                torque); ``name``.

        Raises:
            InputError: If a figure is out of range or contradicts another one.

        >>> from swgjoint import DriveMap
        >>> drive = DriveMap.from_numbers(
        ...     stiffness=3e4, rated_torque=50.0, lost_motion_arcmin=1.0
        ... )
        >>> round(drive.spec_sheet(["lost_motion_arcmin"])["lost_motion_arcmin"], 2)
        1.0
        """
        from swgjoint.maps.from_numbers import map_from_numbers

        return map_from_numbers(
            cls, stiffness=stiffness, rated_torque=rated_torque, **options
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
        """The map of a measured drive; ``info["fit"]`` contains the residuals.

        Args:
            path: CSV file of a torque-torsion loop with locked input and both signs of
                the torque. Columns: ``torque_Nm`` and ``torsion_arcmin`` or
                ``torsion_rad``.
            teeth_flexspline: Number of teeth of the flexspline, z_fs.
            teeth_circular_spline: Number of teeth of the circular spline, z_cs.
            ratings: All catalogue torques, or only the rated torque [N·m].
            kinematic_error: CSV file of one unloaded output turn. Columns:
                ``output_deg`` and ``error_arcmin`` (or ``_rad``), where the error is
                output minus ideal output. The map has no error if None.
            **options: ``layout``, ``orders``, ``intervals``, ``damping_ratio`` and
                ``name``, see
                :func:`~swgjoint.maps.fit.measurement.map_from_measurement`.

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
        """Read a ``.swg`` file.

        Raises:
            MapFileError: If the file is missing or is not a valid map.
        """
        from swgjoint.maps.file import read_map

        return read_map(path, cls)

    def save(self, path: str | Path) -> None:
        """Write a ``.swg`` file atomically.

        Raises:
            InputError: If the file cannot be written or the map is not valid.
        """
        from swgjoint.maps.file import write_map

        write_map(self, path)

    def spec_sheet(self, only: Collection[str] = ()) -> dict[str, Any]:
        """Catalogue-style figures, determined from the map by the standard procedures.

        The keys are those of ``swgjoint spec``. A figure that the map does not provide
        is None, and ``missing`` gives the reason.

        Args:
            only: Keys to compute; all if empty.

        Raises:
            InputError: If a key is unknown.

        >>> from swgjoint import DriveMap
        >>> drive = DriveMap.from_catalogue("CSG-25-100")
        >>> sheet = drive.spec_sheet(["T1_Nm", "K1_Nm_rad"])
        >>> sheet["T1_Nm"], round(sheet["K1_Nm_rad"])
        (14.0, 31148)
        """
        from swgjoint.maps.sheet.spec_sheet import spec_sheet

        return spec_sheet(self, only)

    def pruned(self, tolerance_arcmin: float) -> Self:
        """A copy without the weakest harmonics, within a tolerance.

        ``info["pruned"]`` lists the dropped harmonics, with bounds on their effect on
        output angle, kinematic error and torque; see :mod:`swgjoint.maps.fit.pruning`.

        Args:
            tolerance_arcmin: Largest change of the output angle at a given torque and
                input angle [arcmin].

        Raises:
            InputError: If the tolerance is not positive or the effect has no bound.
        """
        from swgjoint.maps.fit.pruning import pruned_map

        return pruned_map(self, tolerance_arcmin * arcmin)
