"""States of a run in files, so that an interrupted run can go on."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.state_arrays import packed, unpacked
from swgjoint.files import write_whole
from swgjoint.json_text import json_text

RUN = "run.json"
SCHEMA = 6
_STATE = "state"


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A folder with the states of one run."""

    folder: Path
    settings: dict[str, Any]
    """What makes the run the same: design hash, torque, positions, model."""

    @classmethod
    def open(
        cls, folder: Path, settings: dict[str, Any], *, resume: bool
    ) -> Checkpoint:
        """Begin a run in a folder, or go on with the one that lies there.

        Raises:
            InputError: If there is nothing to go on with, or it is of another run.
        """
        settings = json.loads(json_text({"schema": SCHEMA} | settings))
        file = folder / RUN
        if resume:
            try:
                there = json.loads(file.read_text())
            except (OSError, ValueError):
                raise InputError(
                    f"--resume: no interrupted run in {folder}; leave --resume out"
                ) from None
            if there != settings:
                other = [k for k in settings if there.get(k) != settings[k]]
                raise InputError(
                    f"--resume: the run in {folder} has another {', '.join(other)};"
                    " accepted: the same design and options"
                )
        else:
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.glob("*.npz"):
                old.unlink()
            write_whole(file, json_text(settings) + "\n")
        return cls(folder=folder, settings=settings)

    def read(self, name: str) -> SolidState | None:
        """A state of that name; None if the run did not get there."""
        path = self.folder / f"{name}.npz"
        if not path.exists():
            return None
        try:
            content = io.BytesIO(path.read_bytes())
            with np.load(content, allow_pickle=False) as arrays:
                found = unpacked({key: arrays[key] for key in arrays.files}, _STATE)
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise InputError(
                f"--resume: {path} is damaged ({error}); remove it to compute it again"
            ) from None
        if not isinstance(found, SolidState):
            raise InputError(
                f"--resume: {path} holds no state; remove it to compute it again"
            )
        return found

    def write(self, name: str, state: SolidState) -> None:
        """Keep a state, whole or not at all."""
        out = io.BytesIO()
        np.savez(out, **packed(state, _STATE))
        write_whole(self.folder / f"{name}.npz", out.getvalue())
