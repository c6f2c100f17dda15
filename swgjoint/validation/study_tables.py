"""Files with the printed values of the validation studies."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from swgjoint.faults import Section, validate
from swgjoint.models_path import find
from swgjoint.toml_file import read_toml


class StudyTables(Section):
    """Content of a study file."""

    @classmethod
    def load(cls, reference: str | Path) -> Self:
        """Read a study file, given as a path or as the name of a bundled one.

        Raises:
            InputError: If the file is missing or invalid, with one line per fault.
        """
        path = find(reference, "studies", ".toml", what="study")
        return validate(cls, read_toml(path, what="study"), where=str(path))
