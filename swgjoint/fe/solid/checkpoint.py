"""States of a run in files, so that an interrupted run can go on."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import InputError, Outcome
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.teeth import ToothRows
from swgjoint.fe.tooth_contact import Contacts
from swgjoint.files import write_whole
from swgjoint.json_text import json_text

RUN = "run.json"
SCHEMA = 5


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
            with np.load(path, allow_pickle=False) as arrays:
                return _unpacked({key: arrays[key] for key in arrays.files})
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise InputError(
                f"--resume: {path} is damaged ({error}); remove it to compute it again"
            ) from None

    def write(self, name: str, state: SolidState) -> None:
        """Keep a state, whole or not at all."""
        out = io.BytesIO()
        np.savez(out, **_packed(state))
        write_whole(self.folder / f"{name}.npz", out.getvalue())


def _packed(state: SolidState) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    for item in fields(state):
        value = getattr(state, item.name)
        if item.name == "held" or value is None:
            continue
        arrays[item.name] = value.name if isinstance(value, Outcome) else value
    if state.held is not None:
        for item in fields(state.held):
            if item.name != "contacts":
                arrays[f"held.{item.name}"] = getattr(state.held, item.name)
        for item in fields(state.held.contacts):
            arrays[f"contacts.{item.name}"] = getattr(state.held.contacts, item.name)
    return arrays


def _unpacked(arrays: dict[str, Any]) -> SolidState:
    def part(prefix: str) -> dict[str, Any]:
        return {
            key.removeprefix(prefix): value
            for key, value in arrays.items()
            if key.startswith(prefix)
        }

    held = None
    if any(key.startswith("held.") for key in arrays):
        contacts = Contacts(**part("contacts."))
        held = ToothRows(contacts=contacts, **part("held."))
    own = {key: value for key, value in arrays.items() if "." not in key}
    own["outcome"] = Outcome[str(own["outcome"])]
    own["history"] = tuple(float(value) for value in own["history"])
    for item in fields(SolidState):
        if item.type == "float":
            own[item.name] = float(own[item.name])
    return SolidState(held=held, **own)
