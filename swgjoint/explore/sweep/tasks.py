"""Tasks of a sweep or search: the figures to compute, and the cluster to use."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from swgjoint.explore.sweep.figures import (
    MESHING_FIGURES,
    RANGES,
    RUN_FIGURES,
    SIZE_FIGURES,
    SPEC_FIGURES,
    STIFFNESS,
)
from swgjoint.faults import Fault, Section

Listed = Field(strict=False, min_length=1)  # TOML lists become tuples
Text = Annotated[str, Field(min_length=1, max_length=200)]
Reference = Annotated[str, Field(min_length=1, max_length=4096)]
"""Name of a bundled file, or a path."""


class FigureTask(Section):
    """Figures to compute for a design."""

    known: ClassVar[tuple[str, ...]]
    figures: Annotated[tuple[Text, ...], Listed]
    """Names of the quantities to compute; an unknown name lists those accepted."""

    @model_validator(mode="after")
    def _known(self) -> FigureTask:
        faults = []
        for k, name in enumerate(self.figures):
            if name not in self.known:
                near = get_close_matches(name, self.known, n=1)
                hint = f"did you mean {near[0]}? " if near else ""
                known = ", ".join(self.known)
                faults.append(
                    (f"figures[{k}]", f"{name!r} is unknown; {hint}accepted: {known}")
                )
        if faults:
            raise Fault(*faults)
        return self


class MeshingTask(FigureTask):
    """Simulation of meshing: stresses, errors and contact."""

    known = MESHING_FIGURES
    torque_Nm: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    """Output torque [N·m]; by default the rated torque of the design."""
    positions: Annotated[int, Field(ge=1, le=10_000)] = 6
    """Number of wave-generator positions in the simulated rotation."""
    turn_deg: Annotated[float, Field(gt=0, le=360_000)] | None = None
    """Input rotation [deg]; by default one pitch of the fixed member, after which the
    mesh cycle of a drive without errors repeats."""
    model: Literal["2d", "3d"] | None = None
    """Fidelity; by default 3d for a design with a cup, else 2d."""

    @model_validator(mode="after")
    def _fits(self) -> MeshingTask:
        faults = []
        if self.torque_Nm == 0 and STIFFNESS in self.figures:
            # with clearance, an unloaded output moves freely and has no stiffness
            fault = f"0 N·m: {STIFFNESS} needs a nonzero torque"
            faults.append(("torque_Nm", fault))
        if fault := self.range_fault(self.positions):
            faults.append(("positions", fault))
        if faults:
            raise Fault(*faults)
        return self

    def range_fault(self, positions: int | None) -> str:
        """Reason why the figures cannot be computed from that many positions, or ""."""
        ranges = [name for name in self.figures if name in RANGES]
        if positions != 1 or not ranges:
            return ""
        return f"1: the peak to peak of {', '.join(ranges)} needs at least 2 positions"


class SpecTask(FigureTask):
    """Map of the drive, and figures of its specification sheet."""

    known = SPEC_FIGURES
    model: Literal["ring", "2d", "3d"] | None = None
    """Fidelity of the map; by default 3d for a design with a cup, else 2d."""
    angles: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of positions of the map over a pitch; see :func:`swgjoint.build_map`."""


class RunTask(FigureTask):
    """Run of the scene with the design in every driven joint.

    The figures are those of the worst joint.
    """

    known = RUN_FIGURES
    model: Literal["ring", "2d", "3d"] | None = None
    """Fidelity of the map; by default 3d for a design with a cup, else 2d."""
    angles: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of positions of the map over a pitch; see :func:`swgjoint.build_map`."""


class SizeTask(FigureTask):
    """Dimensions of the drive."""

    known = SIZE_FIGURES


class SlurmCluster(Section):
    """Jobs of a SLURM cluster, each with one process per core."""

    kind: Literal["slurm"] = "slurm"
    jobs: Annotated[int, Field(ge=1, le=10_000)]
    """Number of jobs submitted to the cluster."""
    cores: Annotated[int, Field(ge=1, le=1_000)]
    """Number of cores, and of processes, of one job."""
    memory_GB: Annotated[float, Field(gt=0, le=100_000)]
    """Memory of one job [GB]."""
    walltime: Annotated[str, Field(pattern=r"^(\d+-)?\d{1,3}:\d\d:\d\d$")]
    """Time limit of one job, as hours:minutes:seconds or days-hours:minutes:seconds."""
    queue: Text | None = None
    """Partition of the cluster; by default that of SLURM."""
    account: Text | None = None
    """Account that is charged; by default that of SLURM."""
    prologue: Annotated[tuple[Text, ...], Field(strict=False)] = ()
    """Shell commands run before a worker starts, such as ``module load``."""
    directives: Annotated[tuple[Text, ...], Field(strict=False)] = ()
    """Further ``#SBATCH`` options."""


class AskedFile(Section):
    """Keys of every sweep and search file: bases, tasks and cluster."""

    description: Annotated[str, Field(max_length=1000)] = ""
    """Purpose of the file in a sentence."""
    source: Annotated[str, Field(max_length=1000)] = ""
    """Source of the numbers in the file."""
    design: Reference | None = None
    """Base of the designs; without a base, the scene keeps its drives."""
    scene: Reference | None = None
    """Scene that is run with each design, or whose keys are varied."""
    meshing: MeshingTask | None = None
    spec: SpecTask | None = None
    size: SizeTask | None = None
    run: RunTask | None = None
    cluster: SlurmCluster | None = None
    """Cluster that computes the designs unless ``--jobs`` or ``--scheduler`` is given;
    by default this machine computes them."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds that parameters may vary: ``design``, ``scene`` or both."""
        bases = {"design": self.design, "scene": self.scene}
        return tuple(kind for kind, base in bases.items() if base is not None)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures, in the order of the file's tables."""
        tasks = (self.meshing, self.spec, self.size, self.run)
        return tuple(
            name for task in tasks if task is not None for name in task.figures
        )


def task_faults(file: AskedFile) -> list[tuple[str, str]]:
    """Faults of the tasks: missing bases, repeated figures, unused keys.

    Returns:
        Pairs of location in the file and message.
    """
    faults = []
    if not file.figures:
        faults.append(("meshing", "nothing to compute; add meshing, spec, size or run"))
    for name in ("meshing", "spec", "size"):
        if getattr(file, name) is not None and file.design is None:
            faults.append((f"{name}", "needs the key design"))
    if (file.run is None) != (file.scene is None):
        faults.append(("run", "expected both run and scene, or neither"))
    twice = sorted({name for name in file.figures if file.figures.count(name) > 1})
    faults += [("figures", f"{name!r} is listed more than once") for name in twice]
    if file.run is not None and file.design is None:
        faults += [
            (f"run.{key}", "unused without a design")
            for key in ("model", "angles")
            if getattr(file.run, key) is not None
        ]
    return faults
