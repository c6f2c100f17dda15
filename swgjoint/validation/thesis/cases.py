"""Cases of a study file: designs, loads and printed values of the source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from swgjoint.errors import DesignError, InputError
from swgjoint.faults import Fault, Section
from swgjoint.gear.design.design import Design
from swgjoint.validation.study_tables import StudyTables

Kind = Literal["tensile", "compressive", "von_mises"]
KINDS: tuple[Kind, ...] = ("tensile", "compressive", "von_mises")

Stress = Annotated[float, Field(gt=0, le=10_000)]
Refinement = Annotated[float, Field(gt=1, le=16)]
Torque = Annotated[float, Field(ge=0, le=1e6)]
Text = Annotated[str, Field(min_length=1, max_length=200)]
Listed = Field(strict=False)  # TOML has lists, the models tuples


class CaseEntry(Section):
    """One case: a design, a load and the printed values of the source."""

    name: Text | None = None
    """Name, which follows the parameter value if there is one; required without a
    parameter value."""
    value: float | None = None
    """Value of the parameter of the group, in the unit of the group; None if the group
    has no parameter."""
    base: Text | None = None
    """Bundled design; None for that of the group."""
    changes: Mapping[str, Any] = {}
    """Changes of the design by dotted key, in addition to those of the group."""
    torque_Nm: Torque | None = None
    """Nominal output torque T [N·m]; None for that of the group."""
    state: Literal["turn", "wave_generator", "meshed"] = "turn"
    """``turn`` for the mean over the turn of the largest stress at each position;
    otherwise the state of the set-up at which the stress is read."""
    angle_deg: Annotated[float, Field(gt=0, le=360)] | None = None
    """Wave-generator angle at which the stress is read [deg]; None for the mean over
    the turn."""
    tensile_MPa: Stress | None = None
    """Printed tensile stress [MPa]; None if it is withheld or not printed."""
    compressive_MPa: Stress | None = None
    """Magnitude of the printed compressive stress [MPa]; None as above."""
    von_mises_MPa: Stress | None = None
    """Printed von Mises stress [MPa]; None as above."""
    note: str = ""
    """What the source leaves open about this case."""

    @property
    def printed(self) -> dict[Kind, float | None]:
        """Printed values by kind of stress [MPa]; None if withheld or not printed."""
        return {kind: getattr(self, f"{kind}_MPa") for kind in KINDS}


class GroupEntry(Section):
    """Cases of one section or table of the source."""

    id: Annotated[str, Field(pattern=r"^[\w.-]+$", max_length=40)]
    """Identifier that ``--only`` accepts: a section number or a table."""
    title: Text
    source: Text
    """Section, figures or table of the source."""
    base: Text
    """Bundled design of the cases."""
    changes: Mapping[str, Any] = {}
    """Changes of the design by dotted key."""
    torque_Nm: Torque | None = None
    """Nominal output torque T [N·m]; None for that of the file."""
    positions: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Number of wave-generator positions over the turn; None for the value of the file.
    """
    turn_deg: Annotated[float, Field(gt=0, le=360)] | None = None
    """Input rotation over which the positions are distributed [deg]; None for the value
    of the file."""
    keys: Annotated[tuple[str, ...], Listed] = ()
    """Dotted keys of the design that take the parameter value of a case; empty if the
    group has no parameter."""
    symbol: str = ""
    """Symbol of the parameter."""
    unit: str = ""
    """Unit of the parameter."""
    lowest: Mapping[Kind, float] = {}
    """Parameter value at which the source states the lowest stress, by kind of stress.
    """
    highest: Mapping[Kind, float] = {}
    """Parameter value at which the source states the highest stress, by kind of stress.
    """
    flat: Annotated[tuple[Kind, ...], Listed] = ()
    """Kinds of stress that do not depend on the parameter according to the source."""
    flat_range: Annotated[tuple[float, float], Listed] | None = None
    """Parameter range in which ``flat`` applies; None for all values."""
    over: str | None = None
    """Identifier of another group with the same parameter. Further rows list the
    increase of the von Mises stress over that group."""
    statement: str = ""
    """Statement of the source that the report quotes."""
    note: str = ""
    """What the source leaves open about all cases."""
    converge: bool = False
    """Whether the cases are also computed on finer meshes."""
    rank: bool = False
    """Whether the order of the printed values is compared with our order."""
    cases: Annotated[tuple[CaseEntry, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> GroupEntry:
        faults = []
        values = [case.value for case in self.cases]
        for k, case in enumerate(self.cases):
            if (case.value is not None) != bool(self.keys):
                faults.append(
                    (f"cases[{k}].value", "expected if and only if the group has keys")
                )
            if case.name is None and case.value is None:
                faults.append((f"cases[{k}].name", "missing; accepted: a string"))
        given = [value for value in values if value is not None]
        if any(b <= a for a, b in pairwise(given)):
            faults.append(("cases", "expected values in increasing order"))
        for key in ("lowest", "highest"):
            faults += [
                (f"{key}.{kind}", f"{value:g}; accepted: the value of a case")
                for kind, value in getattr(self, key).items()
                if value not in given
            ]
        names = [self.name_of(case) for case in self.cases]
        if len(set(names)) < len(names):
            faults.append(("cases", "expected different names"))
        if faults:
            raise Fault(*faults)
        return self

    def name_of(self, case: CaseEntry) -> str:
        """Name of a case inside the group."""
        if case.value is None:
            return case.name or ""
        text = f"{self.symbol} = {case.value:g} {self.unit}".rstrip()
        return text if case.name is None else f"{text}, {case.name}"


class StudyFile(StudyTables):
    """A file of ``models/studies``."""

    source: Text
    """Chapters of the source."""
    torque_Nm: Torque
    """Nominal output torque T [N·m]."""
    model: Literal["2d", "3d"] = "2d"
    positions: Annotated[int, Field(ge=1, le=1000)]
    """Number of wave-generator positions over the turn."""
    turn_deg: Annotated[float, Field(gt=0, le=360)] = 180.0
    """Input rotation over which the positions are distributed [deg]."""
    refinements: Annotated[tuple[Refinement, ...], Listed] = (2.0, 3.0)
    """Refinements of the finer meshes [-], for groups with ``converge``."""
    fine_positions: Annotated[int, Field(ge=1, le=1000)] = 12
    """Number of positions on the finer meshes, over one pitch of the fixed member.
    Without tolerances the stresses repeat with that pitch, so 35 positions over half a
    turn (61 pitches) sample 35 equidistant phases of the pitch. The mean over 12 phases
    agrees with the mean over 35 within 0.1 %."""
    contradictions: Annotated[tuple[Text, ...], Listed] = ()
    """Contradictions within the source, and the version that the cases follow."""
    group: Annotated[tuple[GroupEntry, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _groups_fit(self) -> StudyFile:
        ids = [group.id for group in self.group]
        twice = sorted({i for i in ids if ids.count(i) > 1})
        if twice:
            raise Fault(("group", f"id {', '.join(twice)} used more than once"))
        keys = {group.id: group.keys for group in self.group}
        faults = [
            (f"group[{k}].over", f"{g.over!r}; accepted: a group of the same keys")
            for k, g in enumerate(self.group)
            if g.over is not None and (keys.get(g.over) != g.keys or not g.keys)
        ]
        if faults:
            raise Fault(*faults)
        return self

    @property
    def by_tenth(self) -> bool:
        """Whether rows are judged at T/10 (2D model) instead of T (3D model)."""
        return self.model == "2d"

    def chosen(self, only: tuple[str, ...]) -> tuple[GroupEntry, ...]:
        """Groups whose id equals or starts with one of the parts; all if none is given.

        For example, ``5.4`` chooses 5.4.1 to 5.4.4, and ``table-5.6`` one table.

        Raises:
            InputError: If a part chooses nothing.
        """

        def chooses(part: str, group: GroupEntry) -> bool:
            rest = group.id.removeprefix(part)
            return group.id.startswith(part) and rest[:1] in ("", ".", "-")

        unknown = [p for p in only if not any(chooses(p, g) for g in self.group)]
        if unknown:
            accepted = ", ".join(group.id for group in self.group)
            raise InputError(
                f"--only {','.join(unknown)}: unknown part; accepted: {accepted}"
            )
        return tuple(
            g for g in self.group if not only or any(chooses(p, g) for p in only)
        )


@dataclass(frozen=True, kw_only=True)
class Case:
    """One case, ready to compute."""

    group: GroupEntry
    entry: CaseEntry
    design: Design | None
    """Design; None if it is invalid."""
    fault: str | None
    """Why the design is invalid; None if it is valid."""
    torque: float
    """Nominal torque T [N·m]."""

    @property
    def name(self) -> str:
        """Identifier of the group and name of the case."""
        return f"{self.group.id} {self.group.name_of(self.entry)}"

    @property
    def note(self) -> str:
        """What the source leaves open about the case, or else about its group."""
        return self.entry.note or self.group.note


def case_of(study: StudyFile, group: GroupEntry, entry: CaseEntry) -> Case:
    """Build a case; its design is the base with the changes of group and case.

    Args:
        study: Study file.
        group: Group of the case.
        entry: Entry of the case.
    """
    base = Design.preset(entry.base or group.base)
    changes: Mapping[str, Any] = {
        **group.changes,
        **dict.fromkeys(group.keys, entry.value),
        **entry.changes,
    }
    torque = next(
        t for t in (entry.torque_Nm, group.torque_Nm, study.torque_Nm) if t is not None
    )
    try:
        design, fault = base.with_changes(changes), None
    except DesignError as error:
        design, fault = None, str(error)
    return Case(group=group, entry=entry, design=design, fault=fault, torque=torque)
