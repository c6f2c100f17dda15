"""Sweep files: which designs, and what is computed of each."""

from __future__ import annotations

import os
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from swgjoint.faults import Fault, Section, read_toml, unit_of, validated
from swgjoint.models_path import find
from swgjoint.study.sweep_figures import (
    MESHING_FIGURES,
    RUN_FIGURES,
    SPEC_FIGURES,
)
from swgjoint.study.sweep_keys import BASE, find_key, is_path, kind_of, unknown

MOST = 1_000_000
"""Designs of one sweep.

The process that hands out holds about 1 kB of each, and some 5 kB while it writes the
tables: 5 GB for so many.
"""

Listed = Field(strict=False, min_length=1)  # TOML has lists, the models tuples
Text = Annotated[str, Field(min_length=1, max_length=200)]
Count = Annotated[int, Field(ge=2, le=MOST)]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]


class FigureTask(Section):
    """What is computed of a design."""

    known: ClassVar[tuple[str, ...]]
    figures: Annotated[tuple[Text, ...], Listed]

    @model_validator(mode="after")
    def _known(self) -> FigureTask:
        faults = []
        for k, name in enumerate(self.figures):
            if name not in self.known:
                near = get_close_matches(name, self.known, n=1)
                hint = f"did you mean {near[0]}? " if near else ""
                told = ", ".join(self.known)
                faults.append((f"figures[{k}]", f"{name!r}: {hint}accepted: {told}"))
        if faults:
            raise Fault(*faults)
        return self


class MeshingTask(FigureTask):
    """Simulation of meshing: stresses, errors, contact."""

    known = MESHING_FIGURES
    torque_Nm: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    """T; rated torque of the design without."""
    positions: Annotated[int, Field(ge=1, le=10_000)] = 6
    turn_deg: Annotated[float, Field(gt=0, le=360_000)] | None = None
    """Of the input; without, one pitch of the fixed member, after which the pattern of
    a perfect gear repeats."""
    model: Literal["2d", "3d"] | None = None
    """3d for a design with a cup, else 2d, without."""


class SpecTask(FigureTask):
    """The map of the drive and figures of its specification sheet."""

    known = SPEC_FIGURES
    model: Literal["ring", "2d", "3d"] | None = None
    angles: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Positions of the map over a pitch; see :func:`swgjoint.build_map`."""


class RunTask(FigureTask):
    """The scene with the drive in every driven joint; the worst joint counts."""

    known = RUN_FIGURES
    model: Literal["ring", "2d", "3d"] | None = None
    angles: Annotated[int, Field(ge=1, le=10_000)] | None = None


class Parameter(Section):
    """Keys that take the same value, and the values that they take."""

    keys: Annotated[tuple[Text, ...], Listed]
    values: Annotated[tuple[Any, ...], Listed] | None = None
    low: float | int | None = None
    high: float | int | None = None
    count: Count | None = None
    """Of equally spaced values of a grid."""

    @model_validator(mode="after")
    def _one_way(self) -> Parameter:
        ends = (self.low, self.high)
        if (self.values is None) == (ends == (None, None)):
            raise Fault(("values", "accepted: values, or low and high, not both"))
        if self.values is not None:
            if self.count is not None:
                raise Fault(("count", "read by nobody beside values"))
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
        return self

    @property
    def column(self) -> str:
        """Name of the parameter in tables: its first key."""
        return self.keys[0]


def _tabled(value: Any) -> bool:
    """Whether a value can stand in tables and in JSON: TOML also has times."""
    if isinstance(value, dict):
        return all(map(_tabled, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_tabled, value))
    return isinstance(value, bool | int | float | str)


# not min_length, which would also complain where all parameters are faulty
Parameters = Annotated[tuple[Parameter, ...], Field(strict=False)]


class Grid(Section):
    """Every value with every other; the last parameter changes first."""

    kind: Literal["grid"] = "grid"
    parameters: Parameters


class LatinHypercube(Section):
    """One value in each of equally likely parts of every parameter, strewn."""

    kind: Literal["latin_hypercube"] = "latin_hypercube"
    designs: Count
    seed: Seed = 0
    parameters: Parameters


class List(Section):
    """The first values of all parameters, then the second ones, and so on."""

    kind: Literal["list"] = "list"
    parameters: Parameters


Plan = Annotated[Grid | LatinHypercube | List, Field(discriminator="kind")]


class SlurmCluster(Section):
    """Jobs of a SLURM cluster, each with one process a core."""

    kind: Literal["slurm"] = "slurm"
    jobs: Annotated[int, Field(ge=1, le=10_000)]
    cores: Annotated[int, Field(ge=1, le=1_000)]
    memory_GB: Annotated[float, Field(gt=0, le=100_000)]
    """Of a job."""
    walltime: Annotated[str, Field(pattern=r"^(\d+-)?\d{1,3}:\d\d:\d\d$")]
    queue: Text | None = None
    account: Text | None = None
    prologue: Annotated[tuple[Text, ...], Field(strict=False)] = ()
    """Lines of shell before a worker starts, such as ``module load``."""
    directives: Annotated[tuple[Text, ...], Field(strict=False)] = ()
    """Further ``#SBATCH`` options."""


class SweepFile(Section):
    """A file of ``models/sweeps``."""

    description: Annotated[str, Field(max_length=1000)] = ""
    source: Annotated[str, Field(max_length=1000)] = ""
    design: Text | None = None
    """Base of the designs; a scene alone keeps its drives."""
    scene: Text | None = None
    meshing: MeshingTask | None = None
    spec: SpecTask | None = None
    run: RunTask | None = None
    plan: Plan
    cluster: SlurmCluster | None = None

    @property
    def kinds(self) -> tuple[str, ...]:
        """What the keys of the parameters may belong to."""
        bases = {"design": self.design, "scene": self.scene}
        return tuple(kind for kind, base in bases.items() if base is not None)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures, in the order of the file's tables."""
        tasks = (self.meshing, self.spec, self.run)
        return tuple(
            name for task in tasks if task is not None for name in task.figures
        )

    @model_validator(mode="after")
    def _fits(self) -> SweepFile:
        faults = [*_task_faults(self), *_plan_faults(self)]
        if faults:
            raise Fault(*faults)
        return self

    @classmethod
    def load(cls, reference: str | Path) -> SweepFile:
        """Read a sweep file, given as a path or as the name of a bundled one.

        Files that it names by a path, as bases or as values, lie relative to it.

        Raises:
            InputError: With one line per fault of the file.
        """
        path = find(reference, "sweeps", ".toml", what="sweep")
        data = read_toml(path, what="sweep")
        return _anchored(validated(cls, data, where=str(path)), path.parent)


def _anchored(file: SweepFile, folder: Path) -> SweepFile:
    """The sweep with files that it names relative to a folder."""

    def anchor(value: Any) -> Any:
        if isinstance(value, str) and os.path.isfile(folder / value):
            return str((folder / value).resolve())
        return value

    parameters = tuple(
        p.model_copy(update={"values": tuple(map(anchor, p.values))})
        if p.values is not None and any(map(is_path, p.keys))
        else p
        for p in file.plan.parameters
    )
    plan = file.plan.model_copy(update={"parameters": parameters})
    bases = {"design": anchor(file.design), "scene": anchor(file.scene)}
    return file.model_copy(update={**bases, "plan": plan})


def _task_faults(file: SweepFile) -> list[tuple[str, str]]:
    """What is asked for needs its base; nothing is asked for twice."""
    faults = []
    if not file.figures:
        faults.append(("meshing", "nothing to compute; accepted: meshing, spec or run"))
    for name in ("meshing", "spec"):
        if getattr(file, name) is not None and file.design is None:
            faults.append((f"{name}", "needs a design; accepted: with the key design"))
    if (file.run is None) != (file.scene is None):
        faults.append(("run", "accepted: exactly where the key scene is"))
    twice = sorted({name for name in file.figures if file.figures.count(name) > 1})
    faults += [("figures", f"{name!r} asked for more than once") for name in twice]
    if file.run is not None and file.design is None:
        faults += [
            (f"run.{key}", "read by nobody without a design")
            for key in ("model", "angles")
            if getattr(file.run, key) is not None
        ]
    return faults


def _plan_faults(file: SweepFile) -> list[tuple[str, str]]:
    """Keys that exist, each once, with what the plan needs; not too many designs."""
    plan, kinds, faults = file.plan, file.kinds, []
    if not kinds:
        return [("design", "missing; accepted: a design, a scene or both")]
    if not plan.parameters:
        return [("plan.parameters", "none; accepted: at least one")]
    seen: set[str] = set()
    for k, parameter in enumerate(plan.parameters):
        where = f"plan.parameters[{k}]"
        for n, key in enumerate(parameter.keys):
            if kind_of(key, kinds) is None:
                faults.append((f"{where}.keys[{n}]", unknown(key, kinds)))
            if key in seen:
                faults.append((f"{where}.keys[{n}]", f"{key!r} more than once"))
            seen.add(key)
        ranged = parameter.values is None
        if isinstance(plan, List) and ranged:
            faults.append((f"{where}.values", "missing; accepted: a list"))
        if isinstance(plan, Grid) and ranged and parameter.count is None:
            faults.append((f"{where}.count", "missing; accepted: a whole number >= 2"))
        if isinstance(plan, LatinHypercube) and parameter.count is not None:
            faults.append((f"{where}.count", "read by nobody; see plan.designs"))
        if ranged and BASE in parameter.keys:
            faults.append((f"{where}.values", "missing; accepted: names of designs"))
    lengths = [len(p.values) for p in plan.parameters if p.values is not None]
    if isinstance(plan, List) and len(set(lengths)) > 1:
        told = ", ".join(map(str, lengths))
        faults.append(("plan.parameters", f"{told} values; accepted: equally many"))
    if isinstance(plan, Grid):
        total = 1
        for parameter in plan.parameters:
            total *= len(parameter.values or ()) or parameter.count or 1
        if total > MOST:
            faults.append(("plan", f"{total} designs; accepted: at most {MOST}"))
    return faults


def takes_whole_numbers(parameter: Parameter, kinds: tuple[str, ...]) -> bool:
    """Whether numbers of a range are rounded for any of the keys."""
    return any(find_key(key, kind) for key in parameter.keys for kind in kinds)
