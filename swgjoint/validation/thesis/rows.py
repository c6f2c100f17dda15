"""Rows of the thesis study: one stress of a case, at T and T/10, with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from swgjoint.validation.reasons import Facts, percent, reason_for
from swgjoint.validation.rows import Row
from swgjoint.validation.thesis.cases import KINDS, Case, Kind
from swgjoint.validation.thesis.record import RunRecord


@dataclass(frozen=True, kw_only=True)
class CaseRecords:
    """All runs of a case, at T and T/10 and on all meshes."""

    case: Case
    nominal: Mapping[float, RunRecord]
    """Records at T by refinement."""
    tenth: Mapping[float, RunRecord]
    """Records at T/10 by refinement."""
    by_tenth: bool = True
    """Whether the rows are judged at T/10 instead of T."""

    @property
    def meshes(self) -> tuple[float, ...]:
        """Refinements in increasing order; the first one is the mesh of the thesis."""
        return tuple(sorted(self.nominal))

    def stress_by_mesh(self, kind: Kind, *, tenth: bool) -> dict[float, float]:
        """Stress by mesh refinement [MPa], without meshes that have no value.

        Args:
            kind: Kind of stress.
            tenth: Whether the load is T/10 instead of T.
        """
        found = {
            mesh: self.value(kind, tenth=tenth, refinement=mesh) for mesh in self.meshes
        }
        return {mesh: value for mesh, value in found.items() if value is not None}

    def value(
        self, kind: Kind, *, tenth: bool, refinement: float = 1, away: bool = False
    ) -> float | None:
        """Stress of the case [MPa]; None if it is unknown.

        The stress is that of the state, angle or mean over the turn that the case asks
        for. It is unknown if the run failed or does not exist. Away from contacts, only
        means over the turn are known, and only in 2D.

        Args:
            kind: Kind of stress.
            tenth: Whether the load is T/10 instead of T.
            refinement: Mesh refinement.
            away: Whether nodes next to loaded tooth contacts are excluded.
        """
        record = (self.tenth if tenth else self.nominal).get(refinement)
        entry = self.case.entry
        if record is None:
            return None
        if away:
            return record.away.get(kind) if self.over_turn else None
        if entry.state != "turn":
            return record.setup.get(entry.state, {}).get(kind)
        if entry.angle_deg is not None:
            return record.last.get(kind)
        return record.average.get(kind)

    @property
    def over_turn(self) -> bool:
        """Whether the case is a mean over the turn instead of one state or position."""
        return self.case.entry.state == "turn" and self.case.entry.angle_deg is None

    def places(self, kind: Kind, *, tenth: bool) -> dict[str, int]:
        """Number of positions with the largest stress at each place.

        Args:
            kind: Kind of stress.
            tenth: Whether the load is T/10 instead of T.

        Returns:
            Number by place; empty for a single state.
        """
        record = (self.tenth if tenth else self.nominal)[1]
        return dict(record.places.get(kind, {})) if self.over_turn else {}

    @property
    def failures(self) -> tuple[str, ...]:
        """Failures on the mesh of the thesis with their torques, each message once."""
        lines: dict[str, list[str]] = {}
        for name, record in (("T", self.nominal[1]), ("T/10", self.tenth[1])):
            if not record.ok:
                count = f" at {record.failed_positions} of {len(record.angle_deg)}"
                where = f"{count} positions" if record.failed_positions else ""
                lines.setdefault(str(record.message), []).append(name + where)
        return tuple(f"{', '.join(who)}: {what}" for what, who in lines.items())


def stress_rows(results: Sequence[CaseRecords]) -> list[Row]:
    """Rows of the stresses: three per case, one for each kind."""
    return [_row(result, kind) for result in results for kind in KINDS]


def increase_rows(results: Sequence[CaseRecords]) -> list[Row]:
    """Rows of the increase of the von Mises stress over another group.

    Only cases whose group names another group in ``over``, and whose counterpart in
    that group was run, have a row.
    """
    known = {(r.case.group.id, r.case.entry.value): r for r in results}
    rows = []
    for result in results:
        case = result.case
        base = known.get((case.group.over or "", case.entry.value))
        if base is None:
            continue
        nominal, tenth = (
            percent(
                result.value("von_mises", tenth=tenth),
                base.value("von_mises", tenth=tenth),
            )
            for tenth in (False, True)
        )
        rows.append(
            Row(
                case=case.name,
                quantity=f"von Mises stress over that at {base.case.torque:g} N·m",
                unit="%",
                source_value=None,
                ours=nominal,
                reason="; ".join(dict.fromkeys(result.failures + base.failures))
                or None,
                more=_columns(result, "von_mises", ours_tenth=tenth),
            )
        )
    return rows


def _row(result: CaseRecords, kind: Kind) -> Row:
    case, tenth = result.case, result.by_tenth
    before, finest = (None, None, *result.meshes)[-2:]
    if len(result.meshes) == 1:
        finest = None
    printed = case.entry.printed[kind]

    def ours(
        tenth: bool, refinement: float | None = 1, away: bool = False
    ) -> float | None:
        if refinement is None:
            return None
        return result.value(kind, tenth=tenth, refinement=refinement, away=away)

    facts = Facts(
        printed=printed,
        value=ours(tenth),
        load="T/10" if tenth else "T",
        tenth=None if tenth else ours(True),
        nominal=ours(False),
        away=ours(tenth, away=True),
        fine=ours(tenth, finest),
        by_mesh={} if tenth else result.stress_by_mesh(kind, tenth=False),
        places=result.places(kind, tenth=tenth),
        failures=result.failures,
        note=case.note,
    )
    return Row(
        case=case.name,
        quantity=kind.replace("_", " ").replace("mises", "Mises") + " stress",
        unit="MPa",
        source_value=printed,
        ours=facts.nominal,
        converged=ours(False, finest),
        reason=reason_for(facts),
        more=_columns(
            result,
            kind,
            ours_tenth=ours(True),
            converged_tenth=ours(True, finest),
            deviation_percent=percent(facts.nominal, printed),
            deviation_tenth_percent=percent(ours(True), printed),
            deviation_converged_percent=percent(ours(False, finest), printed),
            deviation_converged_tenth_percent=percent(ours(True, finest), printed),
            last_refinement_percent=percent(facts.fine, ours(tenth, before)),
            by_refinement={
                f"{mesh:g}": value
                for mesh, value in result.stress_by_mesh(kind, tenth=False).items()
            },
            away_from_contacts=ours(False, away=True),
            away_from_contacts_tenth=ours(True, away=True),
            places=result.places(kind, tenth=False),
            places_tenth=result.places(kind, tenth=True),
        ),
    )


_NUMBERS = (
    "ours_tenth",
    "converged_tenth",
    "deviation_percent",
    "deviation_tenth_percent",
    "deviation_converged_percent",
    "deviation_converged_tenth_percent",
    "last_refinement_percent",
    "by_refinement",
    "away_from_contacts",
    "away_from_contacts_tenth",
    "places",
    "places_tenth",
)


def _columns(result: CaseRecords, kind: Kind, **known: Any) -> dict[str, Any]:
    """Further columns; every row has the same ones, and unknown values are None."""
    case = result.case
    return {
        "part": case.group.id,
        "kind": kind,
        "source": case.group.source,
        "parameter": case.entry.value,
        "torque_Nm": case.torque,
        **dict.fromkeys(_NUMBERS),
        **known,
        "outcome": result.nominal[1].outcome,
        "outcome_tenth": result.tenth[1].outcome,
        "run_s": result.nominal[1].wall_s,
        "run_tenth_s": result.tenth[1].wall_s,
    }
