"""Validity of the ripple of a map: its validation against unseen solves.

A finite-element map contains the record ``info["validation"]``, which compares the map
with finite-element equilibria at torques and angles at which the map was not sampled
("unseen solves"). Differences of input torque and loaded output error are relative to
their peak to peak in the finite elements at the same torque. Above :data:`WARNING` the
figures that depend on them are marked as uncertain; above :data:`LIMIT` the ripple is
not valid.

A record may come from a file of unknown origin. An invalid record is ignored, with a
reason, and the map counts as not validated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential

WARNING = 0.1
"""Ratio of difference to peak to peak above which a figure is marked uncertain [-]."""
LIMIT = 0.3
"""Ratio of difference to peak to peak above which ripple figures are not valid [-]."""
NOT_VALIDATED = "not validated against unseen solves"
"""First words of the reason why a map has no usable record."""
QUANTITIES = {
    "input_torque": "input torque",
    "output_error": "loaded output error",
}
"""Names of the ripple quantities by key."""
STIFFNESS = "secant_stiffness"
"""Key of the secant stiffness in a record."""
UNITS = {"input_torque": "Nm", "output_error": "rad"}
"""Units of the ripple quantities, as in the keys of a record."""
MAX_ROWS = 1000
"""Largest number of rows of a record; a detailed one has a few tens."""

Rows = tuple[tuple[float, float, float], ...]
"""Torque [N·m], largest difference [-], peak to peak of the solves [N·m] or [rad]."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Largest difference between a map and unseen solves."""

    quantity: str
    """Key of :data:`QUANTITIES` or :data:`STIFFNESS`."""
    largest: float
    """Difference over the peak to peak of the solves at that torque [-]; the relative
    difference for the stiffness."""
    torque: float
    """Torque at which the difference occurs [N·m]."""
    rms: float | None = None
    """Root mean square difference over the peak to peak [-]; None if unknown."""
    expected: float | None = None
    """Estimate of the largest difference at more angles over the peak to peak [-]; None
    if unknown."""
    peak_to_peak: float | None = None
    """Peak to peak of the solves at that torque [N·m] or [rad]; None if unknown."""
    from_rows: tuple[float, ...] = ()
    """Two torques of unseen solves between which the difference was interpolated; empty
    otherwise."""

    @property
    def name(self) -> str:
        """Name of the quantity for messages."""
        return QUANTITIES.get(self.quantity, self.quantity.replace("_", " "))

    def to_json(self) -> dict[str, Any]:
        """The difference as JSON values, without ``rms`` and ``expected``."""
        return {
            "quantity": self.quantity,
            "largest": self.largest,
            "torque_Nm": self.torque,
            "peak_to_peak": self.peak_to_peak,
            "interpolated_from_Nm": list(self.from_rows),
        }

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> Difference:
        """The difference that :meth:`to_json` wrote."""
        return cls(
            quantity=given["quantity"],
            largest=given["largest"],
            torque=given["torque_Nm"],
            peak_to_peak=given["peak_to_peak"],
            from_rows=tuple(given["interpolated_from_Nm"]),
        )

    def __str__(self) -> str:
        of = "" if self.quantity == STIFFNESS else "the peak-to-peak value of "
        return (
            f"differs from unseen finite-element solves by {percent(self.largest)} of"
            f" {of}the {self.name} at {self.torque:.4g} N·m{self._line()}"
        )

    def _line(self) -> str:
        """Torques between which a difference was interpolated, as text."""
        if not self.from_rows:
            return ""
        first, second = self.from_rows
        return f" (interpolated between solves at {first:.4g} and {second:.4g} N·m)"


@dataclass(frozen=True, kw_only=True)
class MapValidation:
    """The checked validation record of a map."""

    solves: int
    """Number of unseen solves."""
    torques: tuple[float, ...]
    """Torques of the unseen solves, increasing [N·m]."""
    totals: dict[str, Difference]
    """Largest difference of each quantity, by key."""
    rows: dict[str, Rows]
    """Rows of each ripple quantity, by key, at increasing torques. An unknown peak to
    peak is NaN."""
    reason: str
    """Reason why sampling ended before its goal; empty if it reached the goal."""

    @property
    def worst(self) -> Difference:
        """The larger of the largest differences of the two ripple quantities."""
        return max((self.totals[key] for key in QUANTITIES), key=lambda d: d.largest)

    def bad_torques(self, limit: float) -> tuple[float, ...]:
        """Torques of the record whose ripple difference exceeds a limit [N·m]."""
        rows = [row for key in QUANTITIES for row in self.rows[key]]
        return tuple(sorted({row[0] for row in rows if row[1] > limit}))

    def worst_between(self, low: float, high: float) -> dict[str, Difference]:
        """Largest differences over a range of torques.

        Rows inside the range are used directly. At the ends of the range the
        differences are interpolated linearly between two rows; beyond the record they
        are those of its outermost row. A record of positive torques also applies to
        negative ones.

        Args:
            low: Smallest torque [N·m].
            high: Largest torque [N·m], equal to ``low`` for a constant load.

        Returns:
            Largest difference by key of :data:`QUANTITIES`.
        """
        ends = sorted((low, high))
        if not any(torque < 0.0 for torque in self.torques):
            crosses = ends[0] < 0.0 < ends[1]
            ends = sorted(abs(end) for end in ends)
            ends[0] = 0.0 if crosses else ends[0]
        differences = {}
        for key, rows in self.rows.items():
            torque, largest, wave = np.array(rows).T
            inside = (torque >= ends[0]) & (torque <= ends[1])
            at = np.concatenate([torque[inside], np.clip(ends, *torque[[0, -1]])])
            values = np.concatenate([largest[inside], np.interp(ends, torque, largest)])
            k = int(values.argmax())
            after = int(np.searchsorted(torque, at[k]))
            row, height = torque[after] == at[k], float(np.interp(at[k], torque, wave))
            differences[key] = Difference(
                quantity=key,
                largest=float(values[k]),
                torque=float(at[k]),
                peak_to_peak=height if isfinite(height) else None,
                from_rows=() if row else tuple(torque[after - 1 : after + 1].tolist()),
            )
        return differences


def percent(share: float) -> str:
    """A fraction as a percentage with two significant digits, an integer from 100 %."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 99.5 else f"{value:.2g} %"


def map_validation(drive: Potential) -> tuple[MapValidation | None, str | None]:
    """The validation record of a map, or the reason why it has no usable one.

    Returns:
        The record and None, or None and the reason.
    """
    record = drive.info.get("validation")
    if record is None:
        return None, f"{NOT_VALIDATED}: {_no_record(drive)}"
    try:
        return _read(record), None
    except _Fault as fault:
        why = f"the record in the map cannot be used: validation{fault}"
        return None, f"{NOT_VALIDATED}: {why}"


def validation_json(drive: Potential) -> dict[str, Any]:
    """Entries ``validation`` (None if unusable) and ``validation_reason`` for a map."""
    checked, reason = map_validation(drive)
    record = None if checked is None else drive.info["validation"]
    return {"validation": record, "validation_reason": reason}


def validation_lines(found: MapValidation) -> list[str]:
    """Warnings about the figures of a map; empty if the differences are small."""
    worst, lines = found.worst, []
    if worst.largest > LIMIT:
        lines.append(
            f"ripple figures of this map are not valid near {_torques(found, LIMIT)}:"
            f" the map {worst} (accepted: {percent(LIMIT)}); 'swgjoint meshing DESIGN"
            " --torque NM' computes the ripple at one torque"
        )
    elif worst.largest > WARNING:
        lines.append(
            f"warning: ripple figures of this map are uncertain near"
            f" {_torques(found, WARNING)}: the map {worst}"
        )
    stiffness = found.totals.get(STIFFNESS)
    if stiffness is not None and stiffness.largest > WARNING:
        lines.append(f"warning: the map {stiffness}")
    if found.reason:
        lines.append(f"sampling ended before its goal: {found.reason}")
    return lines


def validation_summary(found: MapValidation) -> str:
    """One line with the number of solves and the largest differences."""
    parts = [
        f"{one.name} within {percent(one.largest)}"
        + _spread(one)
        + f" at {one.torque:.4g} N·m"
        for one in found.totals.values()
    ]
    return (
        f"validated against {found.solves} unseen solves at {len(found.torques)}"
        f" torques; largest differences, ripple relative to its peak to peak:"
        f" {', '.join(parts)}"
    )


def _spread(one: Difference) -> str:
    """Root mean square and estimate for more angles in parentheses, if known."""
    parts = [] if one.rms is None else [f"rms {percent(one.rms)}"]
    if one.expected is not None:
        parts.append(f"expected at more angles {percent(one.expected)}")
    return f" ({', '.join(parts)})" if parts else ""


def _torques(found: MapValidation, limit: float) -> str:
    """Up to six torques above a limit as text, or that of the largest difference."""
    torques = found.bad_torques(limit) or (found.worst.torque,)
    shown = ", ".join(f"{torque:.4g}" for torque in torques[:6])
    return f"{shown}{', ...' if len(torques) > 6 else ''} N·m"


def _no_record(drive: Potential) -> str:
    """Reason why a map has no validation record."""
    if "kinematic_error" in drive.info:
        return "its kinematic error is assumed"
    sources = {
        "linear": "a constant stiffness",
        "catalogue": "figures of a catalogue",
        "measurement": "a measurement",
        "numbers": "stated figures",
    }
    if drive.level in sources:
        return f"the map comes from {sources[drive.level]}"
    return "the map has no record"


class _Fault(Exception):
    """Fault of a record: the key, its value and what is accepted."""


def _read(record: Any) -> MapValidation:
    """The checked record; unknown keys are ignored."""
    content = _table(record, "")
    rows = content.get("rows")
    if not isinstance(rows, Sequence) or isinstance(rows, str | bytes):
        raise _Fault(f".rows is {_short(rows)}; accepted: a list")
    if not 0 < len(rows) <= MAX_ROWS:
        raise _Fault(f".rows has {len(rows)} entries; accepted: 1 to {MAX_ROWS}")
    solves = content.get("solves")
    if isinstance(solves, bool) or not isinstance(solves, int) or not 0 < solves < 1e9:
        raise _Fault(f".solves is {_short(solves)}; accepted: a count")
    totals = {
        key: _total(content, key)
        for key in (*QUANTITIES, STIFFNESS)
        if key in QUANTITIES or content.get(key) is not None
    }
    by_quantity: dict[str, dict[float, tuple[float, float]]] = {
        key: {} for key in QUANTITIES
    }
    torques = set()
    for k, row in enumerate(rows):
        where = f".rows.{k}"
        table = _table(row, where)
        torque = _number(table, "torque_Nm", where)
        torques.add(torque)
        for key, of in by_quantity.items():
            # if the solves have no ripple, no relative difference exists
            if table.get(f"{key}_largest") is None:
                continue
            value, height = _share(table, f"{key}_largest", where), nan
            if table.get(f"{key}_pp_{UNITS[key]}") is not None:
                height = _share(table, f"{key}_pp_{UNITS[key]}", where)
            of[torque] = max((value, height), of.get(torque, (0.0, nan)))
    return MapValidation(
        solves=solves,
        torques=tuple(sorted(torques)),
        totals=totals,
        rows={
            key: tuple((torque, *of[torque]) for torque in sorted(of))
            or ((totals[key].torque, totals[key].largest, nan),)
            for key, of in by_quantity.items()
        },
        reason=_text(content.get("reason", "")),
    )


def _total(content: Mapping[str, Any], key: str) -> Difference:
    """Largest difference of a quantity over all torques."""
    where = f".{key}"
    table = _table(content.get(key), where)
    return Difference(
        quantity=key,
        largest=_share(table, "largest", where),
        torque=_number(table, "at_Nm", where),
        rms=_known_share(table, "rms", where),
        expected=_known_share(table, "expected", where),
    )


def _table(value: Any, where: str) -> Mapping[str, Any]:
    """The value if it is a table."""
    if not isinstance(value, Mapping):
        raise _Fault(f"{where} is {_short(value)}; accepted: a table")
    return value


def _number(table: Mapping[str, Any], key: str, where: str) -> float:
    """A finite number of a table."""
    value = table.get(key)
    if isinstance(value, int | float) and not isinstance(value, bool):
        # an integer in a file may be too large for a float
        if abs(value) <= 1e12 and isfinite(value):
            return float(value)
    raise _Fault(f"{where}.{key} is {_short(value)}; accepted: a finite number")


def _share(table: Mapping[str, Any], key: str, where: str) -> float:
    """A number of a table that is not negative."""
    value = _number(table, key, where)
    if value < 0.0:
        raise _Fault(f"{where}.{key} is {value:g}; accepted: >= 0")
    return value


def _known_share(table: Mapping[str, Any], key: str, where: str) -> float | None:
    """A number of a table that is not negative; None if it is absent."""
    return None if table.get(key) is None else _share(table, key, where)


def _text(value: Any) -> str:
    """A reason as one line of limited length."""
    if not isinstance(value, str):
        raise _Fault(f".reason is {_short(value)}; accepted: a string")
    return " ".join(value.split())[:400]


def _short(value: Any) -> str:
    """A value of an untrusted file as a short text."""
    if isinstance(value, int) and abs(value) > 10**12:
        return "a very large integer"
    if isinstance(value, list | tuple | Mapping):
        return f"a {'table' if isinstance(value, Mapping) else 'list'}"
    return f"{value!r:.20}" if value is not None else "absent"
