"""Rank orders and trends that a source states about several values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from math import inf
from typing import TYPE_CHECKING, Any

from swgjoint.validation.thesis.cases import Kind

if TYPE_CHECKING:
    from swgjoint.validation.thesis.rows import CaseRecords

RANK_GAP = 0.05
"""Smallest relative difference between two printed values whose order is checked [-].
For comparison, the values of one design differ by 15 % in the mesh study of the thesis.
"""
TIE = 0.02
"""Largest relative difference at which a stress counts as equal to the extreme [-]."""
FLAT = 0.05
"""Largest relative spread over a sweep at which a stress counts as constant [-]."""


@dataclass(frozen=True, kw_only=True)
class RankCheck:
    """Whether the von Mises stresses of a table have the printed order."""

    part: str
    """Identifier of the group."""
    tenth: bool
    """Whether the load is T/10 instead of T."""
    pairs: int
    """Number of pairs whose printed values differ by at least 5 %."""
    swapped: tuple[tuple[str, str], ...]
    """Pairs (printed lower, printed higher) that we find in the opposite order."""
    missing: tuple[str, ...]
    """Cases with a printed value but without a computed one."""
    added: dict[str, float]
    """Stress increase from T/10 to T by case [MPa], which may explain pairs that are
    swapped at T."""

    @property
    def agrees(self) -> bool:
        """Whether every pair has the printed order."""
        return not self.swapped and not self.missing

    @property
    def text(self) -> str:
        """One line."""
        load = "T/10" if self.tenth else "T"
        if self.agrees:
            return f"{self.part} at {load}: rank order in von Mises stress as printed"
        swapped = [
            f"{low} above {high} (from T/10 to T {self._added(low)} and"
            f" {self._added(high)} MPa)"
            for low, high in self.swapped
        ]
        return f"{self.part} at {load}: rank order differs: " + ", ".join(
            [*swapped, *(f"{name} missing" for name in self.missing)]
        )

    def _added(self, name: str) -> str:
        value = self.added.get(name)
        return "-" if value is None else f"{value:+.0f}"

    def to_json(self) -> dict[str, Any]:
        """All fields, whether the order agrees, and the line of text."""
        return {**vars(self), "agrees": self.agrees, "text": self.text}


@dataclass(frozen=True, kw_only=True)
class TrendCheck:
    """Whether a stress is lowest, highest or constant as the source states."""

    part: str
    """Identifier of the group."""
    kind: Kind
    tenth: bool
    """Whether the load is T/10 instead of T."""
    claim: str
    """``lowest``, ``highest`` or ``flat``."""
    stated: float | None
    """Parameter value stated by the source; None for ``flat``."""
    ours: float | None
    """Parameter value that we find, or for ``flat`` the spread, largest/smallest - 1;
    None with fewer than two computed values."""
    agrees: bool
    """Whether we confirm the statement, within :data:`TIE` or :data:`FLAT`."""
    refinement: float
    """Mesh refinement [-]."""

    @property
    def text(self) -> str:
        """One line."""
        load = "T/10" if self.tenth else "T"
        if self.refinement > 1:
            load += f", refinement {self.refinement:g}"
        kind = self.kind.replace("_m", " M")
        if self.ours is None:
            return f"{load}: {kind} stress {self.claim}: not computed"
        end = "as stated" if self.agrees else "not as stated"
        if self.claim == "flat":
            return f"{load}: {kind} stress within {100 * self.ours:.1f} %, {end} (flat)"
        place = f"{self.claim} at {self.ours:g}"
        stated = "" if self.ours == self.stated else f" ({self.stated:g})"
        return f"{load}: {kind} stress {place}, {end}{stated}"

    def to_json(self) -> dict[str, Any]:
        """All fields and the line of text."""
        return {**vars(self), "text": self.text}


def _groups(results: Sequence[CaseRecords]) -> Iterator[list[CaseRecords]]:
    for _, found in groupby(results, key=lambda result: result.case.group.id):
        yield list(found)


def rank_checks(results: Sequence[CaseRecords]) -> list[RankCheck]:
    """Check the rank order of all groups with ``rank``, at T/10 and at T."""
    checks = []
    for cases in _groups(results):
        group = cases[0].case.group
        if not group.rank:
            continue
        added = {
            group.name_of(c.case.entry): high - low
            for c in cases
            if (high := c.value("von_mises", tenth=False)) is not None
            and (low := c.value("von_mises", tenth=True)) is not None
        }
        for tenth in (True, False):
            values = [
                (
                    group.name_of(c.case.entry),
                    c.case.entry.von_mises_MPa,
                    c.value("von_mises", tenth=tenth),
                )
                for c in cases
            ]
            known = [(n, p, v) for n, p, v in values if p is not None]
            pairs, swapped = 0, []
            for a, b in combinations(sorted(known, key=lambda item: item[1]), 2):
                if b[1] < (1.0 + RANK_GAP) * a[1]:
                    continue
                pairs += 1
                if a[2] is not None and b[2] is not None and a[2] >= b[2]:
                    swapped.append((a[0], b[0]))
            missing = tuple(name for name, _, value in known if value is None)
            checks.append(
                RankCheck(
                    part=group.id,
                    tenth=tenth,
                    pairs=pairs,
                    swapped=tuple(swapped),
                    missing=missing,
                    added=added,
                )
            )
    return checks


def trend_checks(results: Sequence[CaseRecords]) -> list[TrendCheck]:
    """Check the stated extremes and constant stresses, at T/10 and at T.

    If a sweep was also run on finer meshes, the finest mesh is checked as well.
    """
    checks = []
    for cases in _groups(results):
        group = cases[0].case.group
        finest = max(cases[0].nominal)
        for refinement in dict.fromkeys((1, finest)):
            for tenth in (True, False):
                if refinement not in (cases[0].tenth if tenth else cases[0].nominal):
                    continue
                sweep = _Sweep(cases=cases, tenth=tenth, refinement=refinement)
                for claim in ("lowest", "highest"):
                    checks += [
                        sweep.extreme(kind, claim, stated)
                        for kind, stated in getattr(group, claim).items()
                    ]
                checks += [sweep.flat(kind) for kind in group.flat]
    return checks


@dataclass(frozen=True, kw_only=True)
class _Sweep:
    """Cases of one group at one torque on one mesh."""

    cases: Sequence[CaseRecords]
    tenth: bool
    refinement: float

    def values(self, kind: Kind) -> list[tuple[float, float]]:
        """Pairs (parameter value, stress [MPa]) of the cases that have both."""
        return [
            (case.case.entry.value, value)
            for case in self.cases
            if (value := self._value(case, kind)) is not None
            and case.case.entry.value is not None
        ]

    def _value(self, case: CaseRecords, kind: Kind) -> float | None:
        return case.value(kind, tenth=self.tenth, refinement=self.refinement)

    def extreme(self, kind: Kind, claim: str, stated: float) -> TrendCheck:
        """Check whether the stress at the stated parameter is the lowest (highest)."""
        sign = 1.0 if claim == "lowest" else -1.0
        values = self.values(kind)
        several = len(values) > 1  # a single value has no extreme
        ours = min(values, key=lambda item: sign * item[1]) if several else None
        there = next((stress for value, stress in values if value == stated), None)
        agrees = (
            ours is not None
            and there is not None
            and sign * (there / ours[1] - 1.0) <= TIE
        )
        found = None if ours is None else ours[0]
        return self._check(kind, claim, stated, found, agrees)

    def flat(self, kind: Kind) -> TrendCheck:
        """Check whether the stress is constant over the stated range."""
        low, high = self.cases[0].case.group.flat_range or (-inf, inf)
        stresses = [s for p, s in self.values(kind) if low <= p <= high]
        spread = max(stresses) / min(stresses) - 1.0 if len(stresses) > 1 else None
        agrees = spread is not None and spread <= FLAT
        return self._check(kind, "flat", None, spread, agrees)

    def _check(
        self,
        kind: Kind,
        claim: str,
        stated: float | None,
        ours: float | None,
        agrees: bool,
    ) -> TrendCheck:
        return TrendCheck(
            part=self.cases[0].case.group.id,
            kind=kind,
            tenth=self.tenth,
            refinement=self.refinement,
            claim=claim,
            stated=stated,
            ours=ours,
            agrees=agrees,
        )
