"""Points of a sweep: values of the parameters, with the resulting design and scene."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.code_hash import code_hash
from swgjoint.errors import InputError
from swgjoint.explore.sweep.figures import Asked
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.keys import BASE, kind_of
from swgjoint.explore.sweep.plan import (
    Grid,
    LatinHypercube,
    Parameter,
    takes_whole_numbers,
)
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import key_of
from swgjoint.sim.scene.scene import Scene

Values = dict[str, Any]
"""Values of the parameters by column."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Point:
    """One row of a sweep.

    The design is not stored here but built in the process that computes it, because a
    million designs would take 30 GB and keep the main process busy.
    """

    values: Values
    key: str | None
    """Key of its record; None if the values give no valid design or scene."""
    fault: str = ""
    """Reason why the values are not valid; empty if they are."""
    bases: Bases = field(repr=False, compare=False)
    """Base design and scene to which the values are applied."""

    @property
    def asked(self) -> Asked | None:
        """Design and scene with the tasks to compute; None without a key."""
        if self.key is None:
            return None
        design, scene = self.bases.apply(self.values)
        file = self.bases.file
        return Asked(
            key=self.key,
            design=design,
            scene=scene,
            meshing=file.meshing,
            spec=file.spec,
            size=file.size,
            run=file.run,
        )


class Bases:
    """Base designs, scene and arms of a sweep, each read once."""

    def __init__(self, file: SweepFile) -> None:
        """Read the base design and scene; other designs are read when needed."""
        self.file = file
        self.scene = None if file.scene is None else Scene.load_file(file.scene)
        self._designs: dict[str, Design] = {}
        self._arms: dict[tuple[str, str], list[str]] = {}
        if file.design is not None:
            self._design(file.design)

    def _design(self, reference: str) -> Design:
        if reference not in self._designs:
            self._designs[reference] = Design.load(reference)
        return self._designs[reference]

    def apply(self, values: Values) -> tuple[Design | None, Scene | None]:
        """Apply the values of a point to the bases; return checked design and scene.

        Raises:
            InputError: If the values give no valid design or scene.
        """
        file, base = self.file, self.file.design
        changes: dict[str, Values] = {"design": {}, "scene": {}}
        for parameter in file.plan.parameters:
            value = values[parameter.column]
            for key in parameter.keys:
                kind = kind_of(key, file.kinds)
                assert kind is not None
                if key == BASE:
                    base = str(value)
                else:
                    changes[kind][key] = value
        return (
            None if base is None else self._design(base).with_changes(changes[BASE]),
            None if self.scene is None else self.scene.with_changes(changes["scene"]),
        )

    def arm(
        self, reference: str, tool_site: str, *, balance_inertia: bool = False
    ) -> list[str]:
        """Hashes of the file of an arm, and of its compiled model with all includes.

        The arm is read only once per sweep.

        Args:
            reference: Bundled name or path of the arm.
            tool_site: Site of the tool.
            balance_inertia: Whether implausible inertias are balanced.
        """
        import mujoco

        from swgjoint.sim.arm.reading import ArmReading
        from swgjoint.sim.arm.rigid_arm import RigidArm

        named = (reference, tool_site)
        if named not in self._arms:
            reading = ArmReading(balance_inertia=balance_inertia)
            arm = RigidArm(reference, tool_site=tool_site, reading=reading)
            compiled = np.empty(mujoco.mj_sizeModel(arm.model), np.uint8)
            mujoco.mj_saveModel(arm.model, None, compiled)
            made = hashlib.sha256(compiled.tobytes()).hexdigest()
            self._arms[named] = [_content(arm.path), made]
        return self._arms[named]


def values_of(file: SweepFile) -> list[Values]:
    """Values of every point, in the order of the plan."""
    plan, kinds = file.plan, file.kinds
    parameters = plan.parameters
    if isinstance(plan, LatinHypercube):
        from scipy.stats import qmc

        generator = np.random.default_rng(plan.seed)
        sampler = qmc.LatinHypercube(len(parameters), seed=generator)
        rows: Sequence[Sequence[Any]] = [
            [_sampled(p, part, kinds) for p, part in zip(parameters, row, strict=True)]
            for row in sampler.random(plan.designs).tolist()
        ]
    else:
        columns = [_column(p, kinds) for p in parameters]
        rows = list(
            product(*columns) if isinstance(plan, Grid) else zip(*columns, strict=True)
        )
    names = [p.column for p in parameters]
    return [dict(zip(names, row, strict=True)) for row in rows]


def _column(parameter: Parameter, kinds: tuple[str, ...]) -> Sequence[Any]:
    """Values of one parameter of a grid or list."""
    if parameter.values is not None:
        return parameter.values
    assert parameter.count is not None
    parts = np.linspace(0.0, 1.0, parameter.count).tolist()
    if not takes_whole_numbers(parameter, kinds):
        return [_between(parameter, part) for part in parts]
    low, high = parameter.low, parameter.high
    assert low is not None and high is not None
    return [round(low + part * (high - low)) for part in parts]


def _sampled(parameter: Parameter, part: float, kinds: tuple[str, ...]) -> Any:
    """Value at a fraction, 0 to 1, of the list or range; all values share equally."""
    listed, low, high = parameter.values, parameter.low, parameter.high
    if listed is not None:
        return listed[min(int(part * len(listed)), len(listed) - 1)]
    if not takes_whole_numbers(parameter, kinds):
        return _between(parameter, part)
    assert low is not None and high is not None
    first, last = round(low), round(high)
    return min(first + int(part * (last - first + 1)), last)


def _between(parameter: Parameter, part: float) -> float:
    """Number at a fraction, 0 to 1, of the range."""
    low, high = parameter.low, parameter.high
    assert low is not None and high is not None
    # this form returns the bounds of the file exactly
    return float(low * (1.0 - part) + high * part)


def points_of(file: SweepFile) -> list[Point]:
    """All points of a sweep, with design and scene checked.

    Raises:
        InputError: If the base design or scene cannot be read.
    """
    bases = Bases(file)
    return [_point(bases, values) for values in values_of(file)]


def _point(bases: Bases, values: Values) -> Point:
    try:
        key = key_of(_parts(bases, *bases.apply(values)))
    except InputError as error:
        lines = (line.split(" with changes: ")[-1] for line in str(error).splitlines())
        return Point(values=values, key=None, fault="; ".join(lines), bases=bases)
    return Point(values=values, key=key, bases=bases)


def _parts(
    bases: Bases, design: Design | None, scene: Scene | None
) -> Mapping[str, Any]:
    """Everything that determines the figures of one point."""
    file = bases.file
    parts: dict[str, Any] = {
        "sweep": _own_version(),
        "design": None if design is None else design.content_hash(),
        **{
            name: None if task is None else task.model_dump()
            for name, task in (
                ("meshing", file.meshing),
                ("spec", file.spec),
                ("size", file.size),
                ("run", file.run),
            )
        },
    }
    if scene is not None:
        parts["scene"] = scene.model_dump(exclude={"name", "description"})
        parts["engine"] = _engine_version()
        parts["arm"] = bases.arm(
            scene.arm, scene.tool_site, balance_inertia=scene.balance_inertia
        )
        if (motion := getattr(scene.trajectory, "file", None)) is not None:
            parts["motion"] = _content(Path(motion))
        if design is None:
            parts["drives"] = _drives(scene)
    return parts


def _drives(scene: Scene) -> dict[str, str | None]:
    """Hashes of the drives of a scene; None for a catalogue drive, part of the code."""
    from swgjoint.drives.references import find_drive

    names = {section.drive for section in (scene.defaults, *scene.joints.values())}
    found: dict[str, str | None] = {}
    for name in sorted(name for name in names if name is not None):
        if name.endswith(".swg"):
            found[name] = _content(Path(name))
        else:
            source = find_drive(name)
            found[name] = source.content_hash() if isinstance(source, Design) else None
    return found


def _content(path: Path) -> str:
    """Hash of a file."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


@lru_cache
def _own_version() -> str:
    """Hash of the code that turns simulations into figures."""
    return code_hash("explore/sweep/figures.py")


@lru_cache
def _engine_version() -> str:
    """Hash of the code between a map and the figures of a run, including the plugin.

    The compiled library is hashed, because a wheel does not contain its sources.
    """
    import mujoco

    from swgjoint.engine import library

    digest = hashlib.sha256(str(mujoco.__version__).encode())
    digest.update(_content(library()).encode())
    parts = ("joint", "plugin", "sim", "control", "explore/compare/compare.py")
    digest.update(code_hash(*parts).encode())
    return digest.hexdigest()
