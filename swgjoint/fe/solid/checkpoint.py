"""States of a run in files, from which an interrupted run can resume."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError
from swgjoint.fe.common.state_arrays import pack, unpack
from swgjoint.fe.solid.state import SolidState
from swgjoint.files import read_regular, write_whole
from swgjoint.json_text import json_text
from swgjoint.maps.cache import code_version
from swgjoint.store import (
    DamagedError,
    arrays_content,
    arrays_file,
    json_content,
    json_file,
    one_line,
    warn_ignored,
)

RUN = "run.json"
_STATE = "state"


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A folder with the states of one run."""

    folder: Path
    asked: bool
    """Whether the user requested to resume; a damaged state is then an error."""

    @classmethod
    def open(
        cls, folder: Path, settings: dict[str, Any], *, resume: bool
    ) -> Checkpoint:
        """Begin a run in a folder, or resume the same run if the folder holds it.

        Files in the folder are never removed.

        Args:
            folder: Folder of the states.
            settings: Settings that identify the run: design hash, torque, positions.
            resume: Whether the folder must already hold the run.

        Raises:
            InputError: If the folder holds another run or other files, or no run to
                resume.
        """
        # changed code may solve the states differently
        settings = json.loads(json_text({"code": code_version()} | settings))
        file = folder / RUN
        try:
            there = json_content(read_regular(file), dict[str, Any])
        except FileNotFoundError:
            cls._begin(folder, settings, resume=resume)
            return cls(folder=folder, asked=resume)
        except (OSError, DamagedError) as error:
            raise InputError(
                f"{file} does not describe a run that --resume could continue:"
                f" {one_line(error)}; accepted: another --out"
            ) from None
        if there != settings:
            keys = [k for k in {**settings, **there} if there.get(k) != settings.get(k)]
            raise InputError(
                f"the run in {folder} differs in {', '.join(keys)}; accepted: the same"
                " design, options and version to resume it (--resume), or another"
                " --out"
            )
        return cls(folder=folder, asked=resume)

    @classmethod
    def _begin(cls, folder: Path, settings: dict[str, Any], *, resume: bool) -> None:
        if resume:
            raise InputError(f"--resume: no interrupted run in {folder}; omit --resume")
        folder.mkdir(parents=True, exist_ok=True)
        # an interrupted write leaves a hidden file
        foreign = sorted(
            path.name for path in folder.iterdir() if not path.name.startswith(".")
        )
        if foreign:
            raise InputError(
                f"{folder} holds {foreign[0]!r}, but no {RUN} of a run that --resume"
                " could continue; accepted: another --out"
            )
        write_whole(folder / RUN, json_file(settings))

    @property
    def count(self) -> int:
        """Number of states in the folder."""
        return len(list(self.folder.glob("*.npz")))

    def read(self, name: str) -> SolidState | None:
        """A state by name; None if the run did not reach it or its file is ignored.

        Raises:
            InputError: If the file is damaged and the user requested to resume.
        """
        path = self.folder / f"{name}.npz"
        try:
            state = unpack(arrays_content(read_regular(path)), _STATE)
            if not isinstance(state, SolidState):
                raise DamagedError("the file does not contain a state")
        except FileNotFoundError:
            return None
        except Exception as error:  # a file may be anything
            if self.asked:
                raise InputError(
                    f"--resume: {path}: {one_line(error)}; remove the file to compute"
                    " its state again"
                ) from None
            warn_ignored(path, error)
            return None
        return state

    def write(self, name: str, state: SolidState) -> None:
        """Write a state, completely or not at all.

        Args:
            name: Name of the state.
            state: The state.
        """
        data = arrays_file(pack(state, _STATE))
        write_whole(self.folder / f"{name}.npz", data)
