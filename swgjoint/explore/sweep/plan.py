"""Plans: the values that the parameters of a sweep or a search take."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Annotated, Any, Literal

from pydantic import Field, WrapValidator, model_validator

from swgjoint.explore.sweep.keys import BASE, find_key, kind_of, unknown
from swgjoint.explore.sweep.tasks import Listed, Text
from swgjoint.faults import Fault, Section, unit_of

MOST = 1_000_000
"""Largest number of designs in one sweep.

The main process needs about 1 kB per design, and about 5 kB per design while it writes
the tables, that is 5 GB for this number of designs.
"""

Count = Annotated[int, Field(ge=2, le=MOST)]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]


def _keep_integer(value: Any, check: Callable[[Any], float]) -> float | int:
    """A checked number; integers stay integers, for keys that take only those."""
    number = check(value)
    return value if isinstance(value, int) else number


# not float | int, of which a fault would be reported for each type
Number = Annotated[float, WrapValidator(_keep_integer)]


class Parameter(Section):
    """Keys that share one value, and the values that they take in turn."""

    keys: Annotated[tuple[Text, ...], Listed]
    """Dotted keys of the design or the scene, all of which take the same value."""
    values: Annotated[tuple[Any, ...], Listed] | None = None
    """Values of these keys, as an alternative to ``low`` and ``high``."""
    low: Number | None = None
    """Smallest value, in the unit of the keys."""
    high: Number | None = None
    """Largest value, in the unit of the keys."""
    count: Count | None = None
    """Number of equally spaced values in a grid."""

    @model_validator(mode="after")
    def _one_way(self) -> Parameter:
        ends = (self.low, self.high)
        if (self.values is None) == (ends == (None, None)):
            raise Fault(("values", "accepted: either values, or low and high"))
        if self.values is not None:
            if self.count is not None:
                raise Fault(("count", "unused together with values"))
            faults = [
                (
                    f"values[{k}]",
                    f"{value}; accepted: number, text, true, false, list, table",
                )
                for k, value in enumerate(self.values)
                if not _tabled(value)
            ]
            if faults:
                raise Fault(*faults)
            return self
        key = self.keys[0]
        unit = f" {unit_of(key)}".rstrip()
        missing = [n for n in ("low", "high") if getattr(self, n) is None]
        if missing:
            raise Fault(*((name, "missing; accepted: a number") for name in missing))
        assert self.low is not None and self.high is not None
        if not self.low < self.high:
            raise Fault(
                (
                    "high",
                    f"{self.high:g}{unit}; accepted: above {self.low:g}{unit}",
                )
            )
        if not isfinite(float(self.high) - float(self.low)):
            raise Fault(
                ("high", f"{self.high:g}{unit}; accepted: a range of finite length")
            )
        return self

    @property
    def column(self) -> str:
        """Name of the parameter in tables: its first key."""
        return self.keys[0]


def _tabled(value: Any) -> bool:
    """Whether tables and JSON can contain a value; dates and times of TOML cannot."""
    if isinstance(value, dict):
        return all(map(_tabled, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_tabled, value))
    return isinstance(value, bool | int | float | str)


# no min_length: it would add a second message if all parameters are faulty
Parameters = Annotated[tuple[Parameter, ...], Field(strict=False)]


class Grid(Section):
    """All combinations of the values; the last parameter changes fastest."""

    kind: Literal["grid"] = "grid"
    parameters: Parameters
    """Parameters that are varied."""


class LatinHypercube(Section):
    """Latin hypercube: n designs, one value in each of n equal parts of every range."""

    kind: Literal["latin_hypercube"] = "latin_hypercube"
    designs: Count
    """Number of designs to draw."""
    seed: Seed = 0
    """Seed of the random numbers."""
    parameters: Parameters
    """Parameters that are varied."""


class List(Section):
    """Design k has the k-th value of every parameter."""

    kind: Literal["list"] = "list"
    parameters: Parameters
    """Parameters that are varied."""


Plan = Annotated[Grid | LatinHypercube | List, Field(discriminator="kind")]


class SearchPlan(Section):
    """Values that a genetic search chooses generation by generation (NSGA-II).

    Source:
        Deb, Pratap, Agarwal and Meyarivan (2002), "A fast and elitist multiobjective
        genetic algorithm: NSGA-II", IEEE Transactions on Evolutionary Computation 6.
    """

    kind: Literal["nsga2"] = "nsga2"
    designs: Count = 300
    """Number of designs to try, including those that cannot be built."""
    population: Annotated[int, Field(ge=2, le=10_000)] = 24
    """Number of designs in a generation."""
    seed: Seed = 0
    """Seed of the random numbers."""
    minutes: Annotated[float, Field(gt=0, le=1e6)] | None = None
    """Time after which no further generation starts [min]. Without this limit, the same
    file gives the same designs on any machine."""
    parameters: Parameters
    """Parameters that are varied."""


AnyPlan = Grid | LatinHypercube | List | SearchPlan


def plan_faults(plan: AnyPlan, kinds: tuple[str, ...]) -> list[tuple[str, str]]:
    """Faults of a plan: unknown or repeated keys, missing values, too many designs.

    Args:
        plan: Plan to check.
        kinds: Kinds that the file has a base for: ``design``, ``scene`` or both.

    Returns:
        Pairs of location in the file and message.
    """
    faults = []
    if not kinds:
        return [("design", "missing; accepted: a design, a scene or both")]
    if not plan.parameters:
        return [("plan.parameters", "expected at least one parameter")]
    seen: set[str] = set()
    for k, parameter in enumerate(plan.parameters):
        where = f"plan.parameters[{k}]"
        for n, key in enumerate(parameter.keys):
            if kind_of(key, kinds) is None:
                faults.append((f"{where}.keys[{n}]", unknown(key, kinds)))
            if key in seen:
                fault = f"{key!r} is listed more than once"
                faults.append((f"{where}.keys[{n}]", fault))
            seen.add(key)
        ranged = parameter.values is None
        if isinstance(plan, List) and ranged:
            faults.append((f"{where}.values", "missing; accepted: a list"))
        if isinstance(plan, Grid) and ranged and parameter.count is None:
            faults.append((f"{where}.count", "missing; accepted: an integer >= 2"))
        if (
            isinstance(plan, LatinHypercube | SearchPlan)
            and parameter.count is not None
        ):
            faults.append((f"{where}.count", "unused; see plan.designs"))
        if ranged and takes_whole_numbers(parameter, kinds):
            # rounded, they would admit values outside the range
            faults += [
                (f"{where}.{end}", f"{value:g}; accepted: an integer")
                for end in ("low", "high")
                if (value := getattr(parameter, end)) != round(value)
            ]
        if ranged and BASE in parameter.keys:
            faults.append((f"{where}.values", "missing; accepted: names of designs"))
    lengths = [len(p.values) for p in plan.parameters if p.values is not None]
    if isinstance(plan, List) and len(set(lengths)) > 1:
        counts = ", ".join(map(str, lengths))
        faults.append(
            ("plan.parameters", f"{counts} values; accepted: lists of equal length")
        )
    if isinstance(plan, Grid):
        total = 1
        for parameter in plan.parameters:
            total *= len(parameter.values or ()) or parameter.count or 1
        if total > MOST:
            faults.append(("plan", f"{total} designs; accepted: at most {MOST}"))
    return faults


def takes_whole_numbers(parameter: Parameter, kinds: tuple[str, ...]) -> bool:
    """Whether any key of a parameter takes integers; values of its range are rounded.

    Args:
        parameter: Parameter of a plan.
        kinds: Kinds that the file has a base for.
    """
    return any(find_key(key, kind) for key in parameter.keys for kind in kinds)
