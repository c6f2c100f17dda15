"""Files with the states of a run, from which an interrupted run can be resumed."""

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
"""Name of the file with the settings of the run."""
_STATE = "state"


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A folder with the states of one run."""

    folder: Path
    """The folder."""
    asked: bool
    """Whether the user asked to resume a run; a damaged state is then an error."""

    @classmethod
    def open(
        cls, folder: Path, settings: dict[str, Any], *, resume: bool
    ) -> Checkpoint:
        """Begin a run in a folder, or resume the run that the folder contains.

        Files in the folder are never removed.

        Args:
            folder: Folder of the states.
            settings: Settings that identify the run, such as the hash of the design and
                the torque.
            resume: Whether the folder must already contain the run.

        Raises:
            InputError: If the folder contains another run or other files, or if there
                is no run to resume.
        """
        # other versions of the code may compute different states
        settings = json.loads(json_text({"code": code_version()} | settings))
        file = folder / RUN
        try:
            there = json_content(read_regular(file), dict[str, Any])
        except FileNotFoundError:
            cls._begin(folder, settings, resume=resume)
            return cls(folder=folder, asked=resume)
        except (OSError, DamagedError) as error:
            raise InputError(
                f"{file} is not the description of a run: {one_line(error)}; accepted:"
                " another --out"
            ) from None
        if there != settings:
            keys = [k for k in {**settings, **there} if there.get(k) != settings.get(k)]
            raise InputError(
                f"the run in {folder} has different settings ({', '.join(keys)});"
                " accepted: the same design, options and version to resume it"
                " (--resume), or another --out"
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
                f"{folder} contains {foreign[0]!r} but no {RUN}: there is no run that"
                " --resume could continue; accepted: another --out"
            )
        write_whole(folder / RUN, json_file(settings))

    @property
    def count(self) -> int:
        """Number of states that the folder contains."""
        return len(list(self.folder.glob("*.npz")))

    def read(self, name: str) -> SolidState | None:
        """Read a state by its name.

        Returns:
            The state; None if the run did not reach it, or if its file is damaged and
            was ignored with a warning.

        Raises:
            InputError: If the file is damaged and the user asked to resume.
        """
        path = self.folder / f"{name}.npz"
        try:
            state = unpack(arrays_content(read_regular(path)), _STATE)
            if not isinstance(state, SolidState):
                raise DamagedError("the file does not contain a state")
        except FileNotFoundError:
            return None
        except Exception as error:  # a damaged file can raise any error
            if self.asked:
                raise InputError(
                    f"--resume: {path}: {one_line(error)}; remove the file to compute"
                    " this state again"
                ) from None
            warn_ignored(path, error)
            return None
        return state

    def write(self, name: str, state: SolidState) -> None:
        """Write a state; an interruption leaves no incomplete file of that name.

        Args:
            name: Name of the state, without the extension of its file.
            state: The state.
        """
        data = arrays_file(pack(state, _STATE))
        write_whole(self.folder / f"{name}.npz", data)
