"""States of a run in files, so that an interrupted run can go on."""

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
    """Whether the user has asked to go on: a damaged state is an error then."""

    @classmethod
    def open(
        cls, folder: Path, settings: dict[str, Any], *, resume: bool
    ) -> Checkpoint:
        """Begin a run in a folder, or go on with the same run if it is there.

        Nothing in the folder is ever removed.

        Args:
            folder: Of the states.
            settings: What makes the run the same: design hash, torque, positions.
            resume: Whether there has to be a run to go on with.

        Raises:
            InputError: If the folder holds another run or other files, or there is
                nothing to resume.
        """
        # code that has changed may solve the states differently
        settings = json.loads(json_text({"code": code_version()} | settings))
        file = folder / RUN
        try:
            there = json_content(read_regular(file), dict[str, Any])
        except FileNotFoundError:
            cls._begin(folder, settings, resume=resume)
            return cls(folder=folder, asked=resume)
        except (OSError, DamagedError) as error:
            raise InputError(
                f"{file} is of no run that --resume could go on with:"
                f" {one_line(error)}; accepted: another --out"
            ) from None
        if there != settings:
            keys = [k for k in {**settings, **there} if there.get(k) != settings.get(k)]
            raise InputError(
                f"the run in {folder} differs in {', '.join(keys)}; accepted: the same"
                " design, options and version to go on with it (--resume), or another"
                " --out"
            )
        return cls(folder=folder, asked=resume)

    @classmethod
    def _begin(cls, folder: Path, settings: dict[str, Any], *, resume: bool) -> None:
        if resume:
            raise InputError(
                f"--resume: no interrupted run in {folder}; leave --resume out"
            )
        folder.mkdir(parents=True, exist_ok=True)
        # an interrupted write leaves a hidden file
        foreign = sorted(
            path.name for path in folder.iterdir() if not path.name.startswith(".")
        )
        if foreign:
            raise InputError(
                f"{folder} holds {foreign[0]!r}, but no {RUN} of a run that --resume"
                " could go on with; accepted: another --out"
            )
        write_whole(folder / RUN, json_file(settings))

    @property
    def count(self) -> int:
        """States in the folder."""
        return len(list(self.folder.glob("*.npz")))

    def read(self, name: str) -> SolidState | None:
        """A state of that name; None if the run did not get there.

        Raises:
            InputError: If it is damaged and the user has asked to go on.
        """
        path = self.folder / f"{name}.npz"
        try:
            found = unpack(arrays_content(read_regular(path)), _STATE)
            if not isinstance(found, SolidState):
                raise DamagedError("it holds no state")
        except FileNotFoundError:
            return None
        except Exception as error:  # a file may be anything
            if self.asked:
                raise InputError(
                    f"--resume: {path}: {one_line(error)}; remove it to compute it"
                    " again"
                ) from None
            warn_ignored(path, error)
            return None
        return found

    def write(self, name: str, state: SolidState) -> None:
        """Keep a state, whole or not at all."""
        data = arrays_file(pack(state, _STATE))
        write_whole(self.folder / f"{name}.npz", data)
