"""How far the ripple of a map may be believed: its validation against unseen solves.

A map of finite elements carries the record ``info["validation"]``: equilibria at
torques and angles that the map was not sampled at, set against what it predicts there.
Differences of input torque and loaded output error are parts of the peak to peak that
the finite elements have at the same torque. Above :data:`WARNING` figures that depend
on them are marked, above :data:`LIMIT` the ripple is not valid.

A record may come from a file that somebody else wrote: what is not sound is ignored
with a reason, and the map counts as not validated.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap

WARNING = 0.1
"""Difference over the peak to peak from which a figure is marked as uncertain."""
LIMIT = 0.3
"""The same from which ripple figures are not valid."""
UNCERTAIN, NOT_VALID = "~", "!"
"""Marks of figures above :data:`WARNING` and above :data:`LIMIT`."""
NOT_VALIDATED = "not validated against unseen solves"
QUANTITIES = {
    "input_torque": "input torque",
    "output_error": "loaded output error",
}
"""Quantities of the ripple and their names."""
STIFFNESS = "secant_stiffness"
MAX_ROWS = 1000
"""Of a record; a thorough one has some tens."""

Rows = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Largest difference between a map and unseen solves."""

    quantity: str
    """Key of :data:`QUANTITIES` or :data:`STIFFNESS`."""
    largest: float
    """Over the peak to peak of the solves at that torque; of a stiffness relative."""
    torque: float
    """Where it is [N·m]."""
    rms: float | None = None
    """Over the same peak to peak; None where it is not known."""
    from_rows: tuple[float, ...] = ()
    """Two torques of unseen solves, if the difference is on the line through them."""

    @property
    def name(self) -> str:
        """Of the quantity, in words."""
        return QUANTITIES.get(self.quantity, self.quantity.replace("_", " "))

    def to_json(self) -> dict[str, Any]:
        """Keys of the JSON output."""
        return {
            "quantity": self.quantity,
            "largest": self.largest,
            "torque_Nm": self.torque,
            "interpolated_from_Nm": list(self.from_rows),
        }

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> Difference:
        """That of :meth:`to_json`."""
        return cls(
            quantity=given["quantity"],
            largest=given["largest"],
            torque=given["torque_Nm"],
            from_rows=tuple(given["interpolated_from_Nm"]),
        )

    def __str__(self) -> str:
        of = "" if self.quantity == STIFFNESS else "the peak to peak of "
        return (
            f"differs from unseen finite-element solves by {percent(self.largest)} of"
            f" {of}the {self.name} at {self.torque:.4g} N·m{self._line()}"
        )

    def _line(self) -> str:
        """What an interpolated difference comes from."""
        if not self.from_rows:
            return ""
        first, second = self.from_rows
        return f" (interpolated between solves at {first:.4g} and {second:.4g} N·m)"


@dataclass(frozen=True, kw_only=True)
class MapValidation:
    """The record of a map, checked."""

    solves: int
    torques: tuple[float, ...]
    """None of them sampled, increasing [N·m]."""
    totals: dict[str, Difference]
    """The worst of each quantity, by key."""
    rows: dict[str, Rows]
    """Largest differences by quantity: increasing torque [N·m], difference [-]."""
    reason: str
    """Why sampling ended before its goal; empty where it was reached."""

    @property
    def worst(self) -> Difference:
        """The larger of the differences of the two quantities of the ripple."""
        return max((self.totals[key] for key in QUANTITIES), key=lambda d: d.largest)

    def bad_torques(self, limit: float) -> tuple[float, ...]:
        """Torques of the record at which the ripple is off by more than that [N·m]."""
        rows = [row for key in QUANTITIES for row in self.rows[key]]
        return tuple(sorted({torque for torque, largest in rows if largest > limit}))

    def between(self, low: float, high: float) -> dict[str, Difference]:
        """Largest differences over a range of torques.

        Rows inside the range count as they are; its ends lie between two rows and get
        the straight line through them, beyond the record its last row. A record of one
        sign holds for the other one, too.

        Args:
            low: Smallest torque [N·m].
            high: Largest torque [N·m], equal to ``low`` for a constant load.

        Returns:
            By quantity of :data:`QUANTITIES`.
        """
        ends = sorted((low, high))
        if not any(torque < 0.0 for torque in self.torques):
            crosses = ends[0] < 0.0 < ends[1]
            ends = sorted(abs(end) for end in ends)
            ends[0] = 0.0 if crosses else ends[0]
        found = {}
        for key, rows in self.rows.items():
            torque, largest = np.array(rows).T
            inside = (torque >= ends[0]) & (torque <= ends[1])
            at = np.concatenate([torque[inside], np.clip(ends, *torque[[0, -1]])])
            values = np.concatenate([largest[inside], np.interp(ends, torque, largest)])
            k = int(values.argmax())
            after = int(np.searchsorted(torque, at[k]))
            row = torque[after] == at[k]
            found[key] = Difference(
                quantity=key,
                largest=float(values[k]),
                torque=float(at[k]),
                from_rows=() if row else tuple(torque[after - 1 : after + 1].tolist()),
            )
        return found


def mark(largest: float | None) -> str:
    """The sign of a figure that depends on a quantity which is off by that much."""
    if largest is None or largest <= WARNING:
        return ""
    return UNCERTAIN if largest <= LIMIT else NOT_VALID


def joint_doubt(
    joint: Mapping[str, Any], quantities: Sequence[str] = tuple(QUANTITIES)
) -> Difference | None:
    """The worst difference of a joint's map where it exceeds :data:`WARNING`.

    None where the run tells no ripple of the joint.

    Args:
        joint: Figures of a joint, see :func:`swgjoint.sim.metrics.joint_metrics`.
        quantities: Keys of :data:`QUANTITIES` that count.
    """
    found = joint["map_difference"]
    if found is None or joint["ripple_valid"] is None:
        return None
    worst = max(
        (Difference.from_json(found[key]) for key in quantities),
        key=lambda one: one.largest,
    )
    return worst if worst.largest > WARNING else None


def joints_judged(joints: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """``ripple_valid`` and ``map_difference`` of several joints: the worst of them."""
    judged = [joint for joint in joints if joint["ripple_valid"] is not None]
    if not judged:
        return {"ripple_valid": None, "map_difference": None}
    return {
        "ripple_valid": all(joint["ripple_valid"] for joint in judged),
        "map_difference": {
            key: max(
                (joint["map_difference"][key] for joint in judged),
                key=lambda one: float(one["largest"]),
            )
            for key in QUANTITIES
        },
    }


def joint_mark(
    joint: Mapping[str, Any], quantities: Sequence[str] = tuple(QUANTITIES)
) -> str:
    """The sign of a figure of a joint that depends on some quantities, or nothing."""
    doubt = joint_doubt(joint, quantities)
    return "" if doubt is None else mark(doubt.largest)


def worst_mark(
    joints: Iterable[Mapping[str, Any]],
    quantities: Sequence[str] = tuple(QUANTITIES),
) -> str:
    """The gravest sign of several joints."""
    marks = {joint_mark(joint, quantities) for joint in joints}
    return next((sign for sign in (NOT_VALID, UNCERTAIN) if sign in marks), "")


def mark_legend(marks: Collection[str]) -> str:
    """What the signs of figures mean, those that are there."""
    meaning = {
        UNCERTAIN: f"uncertain, the map differs by more than {percent(WARNING)}",
        NOT_VALID: f"not valid, the map differs by more than {percent(LIMIT)}",
    }
    told = [f"{sign} {text}" for sign, text in meaning.items() if sign in marks]
    return (
        f"{'; '.join(told)} of the peak to peak from finite-element solves that it has"
        " not seen"
    )


def percent(share: float) -> str:
    """A share as text, two digits."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 99.5 else f"{value:.2g} %"


def map_validation(drive: DriveMap) -> tuple[MapValidation | None, str | None]:
    """The record of a map, or why there is none to be used.

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


def validation_json(drive: DriveMap) -> dict[str, Any]:
    """``validation``: the record, None where it is not to be used; and the reason."""
    found, reason = map_validation(drive)
    record = None if found is None else drive.info["validation"]
    return {"validation": record, "validation_reason": reason}


def validation_lines(found: MapValidation) -> list[str]:
    """Warnings about the figures of a map, none where it is good."""
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
    """Solves and largest differences in one line."""
    told = [
        f"{one.name} within {percent(one.largest)}"
        + ("" if one.rms is None else f" (rms {percent(one.rms)})")
        + f" at {one.torque:.4g} N·m"
        for one in found.totals.values()
    ]
    return (
        f"validated against {found.solves} unseen solves at {len(found.torques)}"
        f" torques, worst torque of each, ripple in parts of its peak to peak:"
        f" {', '.join(told)}"
    )


def _torques(found: MapValidation, limit: float) -> str:
    """Torques above a limit in words, that of the worst row at least."""
    torques = found.bad_torques(limit) or (found.worst.torque,)
    shown = ", ".join(f"{torque:.4g}" for torque in torques[:6])
    return f"{shown}{', ...' if len(torques) > 6 else ''} N·m"


def _no_record(drive: DriveMap) -> str:
    """Why a map has no record."""
    if "kinematic_error" in drive.info:
        return "its kinematic error is assumed"
    sources = {
        "linear": "a constant stiffness",
        "catalogue": "figures of a catalogue",
        "measurement": "a measurement",
    }
    if drive.level in sources:
        return f"the map comes from {sources[drive.level]}"
    return "the map has no record"


class _Fault(Exception):
    """Place in the record and what is wrong with it."""


def _read(record: Any) -> MapValidation:
    """A record, checked; unknown keys are left alone."""
    given = _table(record, "")
    rows = given.get("rows")
    if not isinstance(rows, Sequence) or isinstance(rows, str | bytes):
        raise _Fault(f".rows is {_short(rows)}; accepted: a list")
    if not 0 < len(rows) <= MAX_ROWS:
        raise _Fault(f".rows has {len(rows)} entries; accepted: 1 to {MAX_ROWS}")
    solves = given.get("solves")
    if isinstance(solves, bool) or not isinstance(solves, int) or not 0 < solves < 1e9:
        raise _Fault(f".solves is {_short(solves)}; accepted: a count")
    totals = {
        key: _total(given, key)
        for key in (*QUANTITIES, STIFFNESS)
        if key in QUANTITIES or given.get(key) is not None
    }
    found: dict[str, dict[float, float]] = {key: {} for key in QUANTITIES}
    torques = set()
    for k, row in enumerate(rows):
        where = f".rows.{k}"
        table = _table(row, where)
        torque = _number(table, "torque_Nm", where)
        torques.add(torque)
        for key, of in found.items():
            # where the solves have no ripple there is no part of it
            if table.get(f"{key}_largest") is not None:
                value = _share(table, f"{key}_largest", where)
                of[torque] = max(value, of.get(torque, 0.0))
    return MapValidation(
        solves=solves,
        torques=tuple(sorted(torques)),
        totals=totals,
        rows={
            key: tuple(sorted(of.items()))
            or ((totals[key].torque, totals[key].largest),)
            for key, of in found.items()
        },
        reason=_text(given.get("reason", "")),
    )


def _total(given: Mapping[str, Any], key: str) -> Difference:
    where = f".{key}"
    table = _table(given.get(key), where)
    return Difference(
        quantity=key,
        largest=_share(table, "largest", where),
        torque=_number(table, "at_Nm", where),
        rms=None if table.get("rms") is None else _share(table, "rms", where),
    )


def _table(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise _Fault(f"{where} is {_short(value)}; accepted: a table")
    return value


def _number(table: Mapping[str, Any], key: str, where: str) -> float:
    value = table.get(key)
    if isinstance(value, int | float) and not isinstance(value, bool):
        # an integer of a file may be too large for a float
        if abs(value) <= 1e12 and isfinite(value):
            return float(value)
    raise _Fault(f"{where}.{key} is {_short(value)}; accepted: a finite number")


def _share(table: Mapping[str, Any], key: str, where: str) -> float:
    value = _number(table, key, where)
    if value < 0.0:
        raise _Fault(f"{where}.{key} is {value:g}; accepted: >= 0")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _Fault(f".reason is {_short(value)}; accepted: a text")
    return " ".join(value.split())[:400]


def _short(value: Any) -> str:
    """A value of a hostile file in some characters."""
    if isinstance(value, int) and abs(value) > 10**12:
        return "a very large integer"
    if isinstance(value, list | tuple | Mapping):
        return f"a {'table' if isinstance(value, Mapping) else 'list'}"
    return f"{value!r:.20}" if value is not None else "absent"
