"""A drive map from a row of the shipped catalogue tables.

The curve of torque against torsion has the slopes K1 from 0 to T1, K2 from T1 to T2 and
K3 above T2. Parabolas that end on the lines of the catalogue round the two corners
(:data:`CORNER`), so torque and stiffness are continuous. Two catalogue figures are
upper bounds: the hysteresis loss and the transmission accuracy. The map has both at the
bound, and its labels note that a real drive may have less. The transmission accuracy
becomes the kinematic error of an assumed specimen; see
:mod:`swgjoint.maps.fit.error_spectrum`. The map has friction if the catalogue states
running losses.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from math import log
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.gear.bearing.base_oil import MAKER_GREASES, ROOM
from swgjoint.gear.catalogue import CatalogueRow, named_rows
from swgjoint.gear.catalogue_stated import (
    LOSS_KEYS,
    stated_figures,
    stated_losses,
    stiffness_of,
)
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.maps.fit.friction_fit import friction_of_losses
from swgjoint.maps.friction import Friction
from swgjoint.maps.friction_temperature import KEY, friction_table
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.potential import Potential
from swgjoint.maps.sheet.loop import largest_torque, torque_loop
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.units import ZERO_CELSIUS, arcmin

SHARED_SERIES = ("CSF", "CSG", "SHG", "HFUC", "HFUS", "CHA")
"""Series that share ``stiffness.csv``; ``ratings.csv`` covers CSG only."""
CORNER = 0.04
"""Half width of a rounded corner, as a fraction of the shorter adjacent line. Rounding
changes the chord of a line of slope K next to one of slope K' by the relative amount
CORNER |K'/K - 1|/4, which is less than 1 % for every shipped row."""
LOBES = 2
"""Number of lobes, equal to the difference of the tooth counts."""
SLOPES = ("K1", "K2", "K3")
"""Keys of the slopes in the result of ``stiffness_of``."""
CLOSE = 1e-4
"""Relative tolerance of the slopes and the hysteresis loss of the loop."""
ROUNDS = 50
"""Largest number of iterations that adjust the loop."""

CATALOGUE_TEMPERATURES = (-10, 81, 5)
"""Range of temperatures of a catalogue drive with friction [°C]. Catalogues state
running torques from -10 °C."""
PALMGREN_EXPONENT = 2.0 / 3.0
"""Exponent of the viscosity in the load-independent moment of a bearing [-]."""

_NAME = re.compile(r"([A-Z]+)-(\d{1,4})-(\d{1,4})")
_NO_ERROR = (
    "a catalogue states only an upper bound of the transmission accuracy: the map has"
    " no kinematic error"
)

Map = TypeVar("Map", bound=Potential)


def catalogue_names() -> list[str]:
    """Every name that :func:`map_from_catalogue` accepts."""
    return [row.name for row in named_rows()]


def is_catalogue_name(text: str) -> bool:
    """Whether a reference begins with a catalogue series and is not a TOML file."""
    series = "|".join(SHARED_SERIES)
    name = re.match(rf"(?:{series})(?:[-\s\d]|$)", text, re.IGNORECASE)
    return name is not None and not text.endswith(".toml")


def find_row(name: str) -> CatalogueRow:
    """The row of a name such as ``CSG-25-100`` (series, size, ratio).

    Raises:
        InputError: If no row with ratings has this name; the message lists the nearest
            names.
    """
    rows = {row.name: row for row in named_rows()}
    wanted = name.strip().upper()
    if wanted in rows:
        return rows[wanted]
    parts = _NAME.fullmatch(wanted)
    if parts is None:
        why = "is not a catalogue name; accepted: SERIES-SIZE-RATIO"
    elif parts[1] not in (series := sorted({row.series for row in rows.values()})):
        why = (
            f"has no ratings in models/catalogue; accepted series: {', '.join(series)}"
        )
    else:
        why = "is not in models/catalogue/ratings.csv"
    # nearest by the factors of size and ratio, which default to 25 and 100
    digits = [max(1, int(text)) for text in re.findall(r"\d{1,4}", wanted)]
    size, ratio = ([*digits, 100] if digits else [25, 100])[:2]
    near = sorted(
        rows,
        key=lambda key: (
            abs(log(rows[key].size / size)) + abs(log(rows[key].ratio / ratio)),
            not wanted.startswith(rows[key].series),
        ),
    )[:3]
    raise InputError(f"catalogue drive {name[:60]!r} {why}; nearest: {', '.join(near)}")


def map_from_catalogue(
    name: str,
    cls: type[Map],
    *,
    kinematic_error_arcmin: float | None = None,
    seed: int = 0,
) -> Map:
    """The map of a catalogue drive; see :meth:`DriveMap.from_catalogue`.

    Two-lobe gearing with the circular spline fixed: z_fs = 2 ratio, z_cs = z_fs + 2.

    Args:
        name: Name of the row, such as ``CSG-25-100``.
        cls: Class of the map to return.
        kinematic_error_arcmin: Peak-to-peak kinematic error over one output turn
            [arcmin]; the stated transmission accuracy if None.
        seed: Seed of the assumed kinematic error.

    Raises:
        InputError: If the name is unknown, the tables contradict each other or an
            option is out of range.
    """
    drive = _without_error(find_row(name), cls)
    return with_stated_error(drive, kinematic_error_arcmin, seed=seed)


def with_stated_error(
    drive: Map,
    kinematic_error_arcmin: float | None = None,
    *,
    seed: int = 0,
    joint: str = "",
) -> Map:
    """The map of a catalogue drive with the kinematic error of an assumed specimen.

    If the tables state no transmission accuracy and no value is given, the map has no
    error, and ``info["kinematic_error"]`` says so.

    Args:
        drive: Map of a catalogue row, without kinematic error.
        kinematic_error_arcmin: Peak-to-peak kinematic error over one output turn
            [arcmin]; the stated transmission accuracy if None.
        seed: Seed of the assumed error.
        joint: Name of the joint that the drive is for, see
            :func:`~swgjoint.maps.fit.error_spectrum.with_assumed_error`.

    Raises:
        InputError: If an option is out of range.
    """
    wanted, stated = kinematic_error_arcmin, kinematic_error_arcmin is not None
    if wanted is None:
        wanted = drive.info["stated"]["transmission_accuracy_arcmin"]
    if wanted is None:
        label = f"none: the tables state no transmission accuracy for {drive.name}"
        return drive.with_parts(info={**drive.info, "kinematic_error": label})
    return with_assumed_error(
        drive, wanted * arcmin, seed=seed, joint=joint, stated=stated
    )


def _without_error(row: CatalogueRow, cls: type[Map]) -> Map:
    """The map of a row without kinematic error."""
    s = stiffness_of(row.size, row.ratio)
    stated = stated_figures(row)
    origin = "" if row.series == "CSG" else f"; the tables have no {row.series} ratings"
    teeth = LOBES * row.ratio
    drive = cls(
        name=row.name,
        level="catalogue",
        layout="circular_spline_fixed",
        teeth_flexspline=teeth,
        teeth_circular_spline=teeth + LOBES,
        orders=np.zeros((1, 2), dtype=np.int64),
        **_spring(row, s),
        kinematic_error=np.zeros((1, 2)),
        ratings=Ratings(
            rated_torque=row.rated_torque,
            repeated_peak=row.repeated_peak,
            momentary_peak=row.momentary_peak,
            T1=s["T1"],
            T2=s["T2"],
            source=f"catalogue CSG-{row.size}-{row.ratio}{origin}",
            ratcheting_torque=row.ratcheting_torque,
        ),
        info={
            "source": f"catalogue {row.name}: models/catalogue/*.csv",
            "stated": stated
            | {f"{k}_Nm_rad": s[k] for k in SLOPES}
            | {f"{k}_Nm": s[k] for k in ("T1", "T2")},
            "corner": CORNER,
            "missing": _missing(stated),
        },
    )
    losses = stated_losses(row)
    if losses is not None:
        label = (
            f"models/catalogue/losses.csv, size {row.size}: starting torque, no-load"
            " running torque at 2000 rpm and efficiency of an RT1-H-CS of the same"
            " rated torque, second-hand; the back-driving torque is a prediction"
        )
        friction = friction_of_losses(losses, drive.ratio, source=label)
        info = {**drive.info, KEY: _friction_table(friction)}
        drive = drive.with_parts(friction=friction, info=info)
    loss = stated["hysteresis_loss_arcmin"]
    return drive if loss is None else _with_hysteresis(drive, row, s, loss * arcmin)


def _friction_table(law: Friction) -> dict[str, Any]:
    r"""Friction over temperature of a catalogue drive whose losses apply at 20 °C.

    The part that grows with speed follows the load-independent moment of greased
    bearings, :math:`M_0 \propto (\nu n)^{2/3}`. The other parts do not change. The
    grease is assumed, because the table does not state it.

    Source:
        Palmgren (1959), "Ball and Roller Bearing Engineering"; also in ISO 15312.
    """
    name = "SK-1A, SK-2"
    oil = MAKER_GREASES[name]
    grid = [float(T) + ZERO_CELSIUS for T in range(*CATALOGUE_TEMPERATURES)]
    laws = {
        T: replace(
            law,
            viscous=law.viscous
            * (oil.viscosity(T) / oil.viscosity(ROOM)) ** PALMGREN_EXPONENT,
        )
        for T in grid
    }
    return friction_table(
        laws,
        lubricant=f"grease {name} assumed, speed-dependent part with (viscosity)^(2/3)",
    )


def _spring(row: CatalogueRow, s: dict[str, float]) -> dict[str, Any]:
    """Arguments of a map with three lines: knots, potential and end stiffness."""
    top = max(row.momentary_peak, 1.5 * s["T2"])
    knots, stiffness = three_lines(
        s["T1"], s["T2"], s["K1"], s["K2"], s["K3"], largest=top
    )
    potential, ends = potential_of_stiffness(knots, stiffness)
    return {"torsion_knots": knots, "potential": potential, "end_stiffness": ends}


def _with_hysteresis(
    drive: Map, row: CatalogueRow, s: dict[str, float], loss: float
) -> Map:
    """The map whose loop has the slopes of the row and a hysteresis loss [rad].

    The mid-line of a loop differs from the curve of the spring: it mixes the slopes
    around T1 and T2, and at the tip, where both branches meet, the hysteresis elements
    carry part of the torque. The slopes of the spring are therefore iterated until the
    slopes measured on the loop equal those of the catalogue.
    """
    r = drive.ratings
    limits = (0.0, r.T1, r.T2, largest_torque(r))
    wanted = np.array([*(s[k] for k in SLOPES), loss])
    # initial yield torque: that of one element in parallel with K1
    trial = wanted * [1.0, 1.0, 1.0, 0.5 * s["K1"]]
    for _ in range(ROUNDS):
        slopes = dict(zip(SLOPES, map(float, trial), strict=False))
        element = Jenkin(stiffness=s["K1"], yield_torque=float(trial[3]))
        drive = replace(drive, **_spring(row, s | slopes), hysteresis=(element,))
        loop = torque_loop(drive)
        measured = [loop.stiffness(a, b) for a, b in pairwise(limits)]
        change = wanted / np.array([*measured, loop.hysteresis_loss()])
        if np.abs(change - 1.0).max() < CLOSE:
            label = (
                f"catalogue {row.name}: {loss / arcmin:g} arcmin, an upper bound; a"
                " drive may have less"
            )
            return drive.with_parts(info={**drive.info, "hysteresis": label})
        trial = trial * change
    raise InputError(
        f"catalogue drive {row.name}: found no map with its stiffness and a hysteresis"
        f" loss of {loss / arcmin:g} arcmin"
    )


def three_lines(
    T1: float, T2: float, K1: float, K2: float, K3: float, *, largest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Knots [rad] and stiffness there [N·m/rad] of three lines with rounded corners.

    The slope is K1 up to T1, K2 up to T2 and K3 beyond; the curve is odd in the
    torsion. Within a corner the stiffness varies linearly, so its mean is that of the
    two slopes and the torque ends exactly on the next line. Both arrays have the shape
    (10,).

    Args:
        T1: End of the first line [N·m].
        T2: End of the second line [N·m].
        K1: Slope of the first line [N·m/rad].
        K2: Slope of the second line [N·m/rad].
        K3: Slope of the third line [N·m/rad].
        largest: Torque at the last knot, above T2 [N·m].
    """
    lengths = [T1 / K1, (T2 - T1) / K2, (largest - T2) / K3]
    first = lengths[0]
    second = first + lengths[1]
    w1, w2 = CORNER * min(lengths[:2]), CORNER * min(lengths[1:])
    half = [first - w1, first + w1, second - w2, second + w2, sum(lengths)]
    values = [K1, K2, K2, K3, K3]
    return (
        np.array([-x for x in reversed(half)] + half),
        np.array(values[::-1] + values),
    )


def _missing(stated: dict[str, float | None]) -> dict[str, str]:
    """Reasons why the map lacks a figure, with the value that the catalogue states."""

    def stated_as(key: str) -> str:
        """What the tables state about a figure, as text."""
        value = stated[key]
        return (
            "the catalogue tables do not state it"
            if value is None
            else f"the catalogue states {value:g} arcmin"
        )

    no_losses = (
        "the map has no friction: the catalogue tables state losses only for component"
        " sets of ratio 100, sizes 14 to 25"
    )
    bound = f"{_NO_ERROR}; {stated_as('transmission_accuracy_arcmin')}"
    return {
        "transmission_accuracy_arcmin": bound,
        "transmission_accuracy_rated_arcmin": bound,
        "orders": _NO_ERROR,
        "ripple_rms_percent": _NO_ERROR,
        "ripple_pp_percent": _NO_ERROR,
        "hysteresis_loss_arcmin": "the torque loop is conservative: the map has no"
        f" hysteresis; {stated_as('hysteresis_loss_arcmin')}",
        "repeatability_arcmin": "the map has no random part;"
        f" {stated_as('repeatability_arcmin')}",
        **dict.fromkeys(LOSS_KEYS, no_losses),
    }
