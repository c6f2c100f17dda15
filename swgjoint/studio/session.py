"""State of one browser tab: drafts, results and computations; it survives a reload."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.faults import validate
from swgjoint.fe.quick_look import QuickLook
from swgjoint.gear.design.design import Design
from swgjoint.studio import work
from swgjoint.studio.draft import Draft, open_bundled, with_value
from swgjoint.studio.fields import Field, parse_text, value_at
from swgjoint.studio.jobs import Job

FIRST = "reference-2d"
"""Design with which a page begins."""


@dataclass(kw_only=True)
class EditedDesign:
    """A design with the results that belong to it."""

    draft: Draft
    """Content of its file."""
    shown: work.Shown | None = None
    """Checks and picture of the teeth; None until they are ready."""
    look: QuickLook | None = None
    """Quick look; None until it is ready."""
    fault: str = ""
    """Reason why there is no quick look; empty if there is none."""

    @property
    def design(self) -> Design | None:
        """The design; None if the draft is not valid or not checked yet."""
        return self.shown.verdict.design if self.shown else None


@dataclass(kw_only=True)
class Session:
    """Everything that one browser tab shows."""

    folder: Path = field(
        default_factory=lambda: Path(tempfile.mkdtemp(prefix="swgjoint-studio-"))
    )
    """Folder for files of the user and for results."""
    current: EditedDesign = field(
        default_factory=lambda: EditedDesign(draft=open_bundled(FIRST))
    )
    """The variant that is edited."""
    kept: EditedDesign | None = None
    """The variant to which it is compared."""
    picture: bytes | None = None
    """Picture of the quick looks."""
    request: str = "sheet 2d"
    """Computation chosen in the page: what and fidelity."""
    files: list[str] = field(default_factory=list)
    """Files of the last requested computation, the page first."""
    fault: str = ""
    """Reason why the requested computation has failed; empty if it has not."""
    requested: Draft | None = None
    """Draft for which it was requested; None before the first one."""
    source: str = "bench"
    """Scene or arm."""
    drives: dict[str, str] = field(default_factory=dict)
    """Drives by joint, as the scene has them."""
    chosen: dict[str, str] = field(default_factory=dict)
    """Drives that the user has chosen, by joint."""
    level: str = ""
    """Level of all joints; empty for that of the scene."""
    metrics: dict[str, Any] | None = None
    """Figures of the last run of the arm."""
    arm_files: list[str] = field(default_factory=list)
    """Files of the last run of the arm, the report first."""
    arm_fault: str = ""
    """Reason why the run has failed; empty if it has not."""
    ran: tuple[Any, ...] = ()
    """Scene, level, drives and design of the last run, see :attr:`to_run`."""
    page: str = "Drive"
    """Page that is shown, ``Drive`` or ``Arm``."""
    jobs: dict[str, Job] = field(default_factory=dict)
    """Running computations by purpose."""
    pages: int = 0
    """Number of open pages, more than one only during a reload."""
    version: int = 0
    """Number of changes so far, by which a page sees that it must draw again."""
    _then: dict[str, Callable[[Job], None]] = field(default_factory=dict)

    def edit(self, key: str, value: Any) -> None:
        """Change one value of the current draft and start to show the result.

        Args:
            key: Dotted key.
            value: New value; None removes the key.
        """
        self.replace(with_value(self.current.draft, key, value))

    def edit_text(self, one: Field, text: str) -> None:
        """Change one value to the text of its field.

        Args:
            one: The field.
            text: Its text.
        """
        value = parse_text(one, text)
        if value != value_at(self.current.draft, one.key):
            self.edit(one.key, value)

    def replace(self, draft: Draft) -> None:
        """Take another draft as the current one and start to show it."""
        self.current = EditedDesign(draft=draft)
        for purpose in ("look", "draw"):
            self.stop(purpose)
        self.start("show", self._shown, work.show_design, draft)
        with suppress(DesignError):  # the other core need not wait for the checks
            self._look(validate(Design, draft, where="design", error=DesignError))

    def keep(self) -> None:
        """Keep the current variant for comparison."""
        self.kept = EditedDesign(
            **{**vars(self.current), "draft": deepcopy(self.current.draft)}
        )
        self._draw()

    def swap(self) -> None:
        """Edit the kept variant, and keep the current one."""
        if self.kept is not None:
            self.current, self.kept = self.kept, self.current
            for purpose in ("show", "look"):
                self.stop(purpose)
            self.replace(self.current.draft)

    def drop(self) -> None:
        """Forget the kept variant."""
        self.kept = None
        self._draw()

    def looks(self) -> dict[str, QuickLook]:
        """Quick looks that are ready, by label."""
        variants = (
            {"A": self.kept, "B": self.current} if self.kept else {"": self.current}
        )
        return {k: v.look for k, v in variants.items() if v is not None and v.look}

    def compute(self) -> None:
        """Start the requested computation for the current design."""
        if self.current.design is None:
            return
        kind, model = self.request.split()
        function = {"sheet": work.make_sheet, "meshing": work.make_meshing}[kind]
        self.files, self.fault = [], ""
        self.requested = self.current.draft
        self.start(
            "request",
            self._requested,
            function,
            self.current.design,
            model,
            self.folder,
        )

    @property
    def files_are_old(self) -> bool:
        """Whether the design was changed after its results were requested."""
        return bool(self.files) and self.requested != self.current.draft

    @property
    def to_run(self) -> tuple[Any, ...]:
        """Scene, level, drives by joint, and the design if it is one of them."""
        drives = {**self.drives, **self.chosen}
        design = self.current.draft if THIS_DESIGN in drives.values() else None
        return self.source, self.level, drives, design

    @property
    def run_is_old(self) -> bool:
        """Whether the last run of the arm was made with other settings."""
        return self.metrics is not None and self.ran != self.to_run

    def choose_drive(self, joint: str, drive: str) -> None:
        """Choose the drive of a joint for the next run.

        Args:
            joint: Name of the joint.
            drive: Reference of the drive.
        """
        self.chosen[joint] = drive
        self.version += 1

    def choose_level(self, level: str) -> None:
        """Choose the level of all joints for the next run; empty for the scene's."""
        self.level = level
        self.version += 1

    def choose(self, source: str) -> None:
        """Choose a scene or an arm and read its joints; a running arm is stopped."""
        self.stop("arm")
        self.source, self.drives, self.chosen = source, {}, {}
        self.metrics, self.arm_files, self.arm_fault = None, [], ""
        self.start("joints", self._joints, work.list_joints, source)

    def run(self) -> None:
        """Run the arm with the chosen drives, once its joints are known."""
        if "joints" in self.jobs:  # the chosen level would reach none of them
            self.arm_fault = "the joints are still being read; run again afterwards"
            self.version += 1
            return
        own = [j for j, drive in self.chosen.items() if drive == THIS_DESIGN]
        if own and self.current.design is None:
            self.arm_fault = "the design of the page has faults"
            self.version += 1
            return
        changes: dict[str, Any] = {
            f"joints.{joint}.drive": drive
            for joint, drive in self.chosen.items()
            if joint not in own and drive != self.drives.get(joint)
        }
        if self.level:
            changes |= {f"joints.{joint}.level": self.level for joint in self.drives}
        self.metrics, self.arm_files, self.arm_fault = None, [], ""
        self.ran = self.to_run
        self.start(
            "arm",
            self._ran,
            work.run_arm,
            self.source,
            changes,
            own,
            self.current.design,
            self.folder,
        )

    def start(
        self, purpose: str, then: Callable[[Job], None], function: Any, *args: Any
    ) -> None:
        """Start a computation, which replaces a running one of the same purpose.

        Args:
            purpose: Name of the purpose.
            then: Called with the computation once it has ended.
            function: See :class:`~swgjoint.studio.jobs.Job`.
            *args: Arguments of the function.
        """
        self.stop(purpose)
        self.jobs[purpose], self._then[purpose] = Job(function, *args), then
        self.version += 1

    def stop(self, purpose: str) -> None:
        """End a computation, if it is running."""
        if purpose in self.jobs:
            self.jobs.pop(purpose).cancel()
            self.version += 1

    def poll(self) -> None:
        """Take in what the computations have sent."""
        for purpose, job in list(self.jobs.items()):
            if not job.poll():
                continue
            self.version += 1
            if not job.running and self.jobs.get(purpose) is job:
                del self.jobs[purpose]
                self._then[purpose](job)

    def leave(self) -> None:
        """A page was closed: with the last one, all computations end."""
        self.pages -= 1
        if self.pages <= 0:
            for purpose in list(self.jobs):
                self.stop(purpose)

    def close(self) -> None:
        """End all computations and remove the folder."""
        for purpose in list(self.jobs):
            self.stop(purpose)
        shutil.rmtree(self.folder, ignore_errors=True)

    def resume(self) -> None:
        """Start what the current variant still lacks, after the page was closed."""
        if self.current.shown is None and "show" not in self.jobs:
            self.replace(self.current.draft)
        elif self.current.look:
            self._draw()
        elif self.current.design and not self.current.fault and "look" not in self.jobs:
            self._look(self.current.design)
        if not self.drives and not self.arm_fault and "joints" not in self.jobs:
            self.choose(self.source)

    def _shown(self, job: Job) -> None:
        if job.fault:
            self.current.fault = job.fault
            return
        self.current.shown = job.result
        if self.current.design is None:
            self.stop("look")
        elif "look" not in self.jobs and self.current.look is None:
            self._look(self.current.design)

    def _look(self, design: Design) -> None:
        self.start("look", self._looked, work.look_at_design, design)

    def _looked(self, job: Job) -> None:
        self.current.look = job.result
        if self.current.shown is None or self.current.design is not None:
            self.current.fault = job.fault
        self._draw()

    def _draw(self) -> None:
        if looks := self.looks():
            self.start("draw", self._drawn, work.draw_looks, looks)

    def _drawn(self, job: Job) -> None:
        self.picture = job.result

    def _requested(self, job: Job) -> None:
        self.files, self.fault = job.result or [], job.fault

    def _joints(self, job: Job) -> None:
        self.drives, self.arm_fault = job.result or {}, job.fault

    def _ran(self, job: Job) -> None:
        self.metrics, self.arm_files = job.result or (None, [])
        self.arm_fault = job.fault


THIS_DESIGN = "the design of this page"
"""Choice of a drive that stands for the current design."""
