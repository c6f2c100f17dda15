"""Paths of the bundled drives, arms, scenes and catalogue tables."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from itertools import accumulate
from pathlib import Path

from swgjoint.errors import InputError

KINDS = {
    "drives": (".toml", "a design"),
    "arms": (".xml", "an arm"),
    "scenes": (".toml", "a scene"),
    "sweeps": (".toml", "a sweep"),
    "optimisations": (".toml", "an optimisation"),
}
"""Folders in ``models/`` whose files commands accept by name, with the suffix of the
files and the noun for one such file in messages."""
MAX_NAME, MAX_PATH = 255, 4096
"""Largest length of a file name and of a path on Linux [B]; the limits of other systems
are not larger."""
ECHOED = 120
"""Largest length of a reference that a message quotes in full [characters]."""
LISTED = 200
"""Largest length of a list of bundled names in a message [characters]."""
_SHOWN_AS = {"drives": "designs"}
"""Names of kinds in messages and commands, where they differ from the folder."""
TOGETHER = {"scenes": ("arms",)}
"""Other kinds whose names are accepted where a kind is expected: an arm where a scene
is."""


def near_names(text: str, names: Iterable[str], n: int = 3) -> list[str]:
    """Known names that an unknown name may stand for, the most likely first.

    Names that begin with the text come first, then names that contain all its parts,
    then names with similar spelling: ``size-25`` suggests ``size-25-100`` rather than
    ``size-32-50``, and ``tool_rms`` suggests ``tool_path_rms`` rather than ``tool_rp``.

    Args:
        text: The unknown name.
        names: Known names.
        n: Largest number of suggestions.

    >>> near_names("CSG-25-10", ["CSG-25-100", "CHA-14-50"])
    ['CSG-25-100']
    """
    known = {name.lower(): name for name in names}
    wanted = text.lower()
    begin = [key for key in known if wanted and key.startswith(wanted)]
    parts = _parts(wanted)
    within = [key for key in known if parts and parts <= _parts(key)]
    close = get_close_matches(wanted, known, n=n)
    return [known[key] for key in dict.fromkeys([*begin, *within, *close])][:n]


def is_file(reference: str | Path) -> bool:
    """Whether the file exists; False if the name is not a valid path."""
    try:
        return Path(reference).is_file()
    except (OSError, ValueError):  # too long, or with a null character
        return False


def _parts(name: str) -> set[str]:
    """Words and numbers in a name."""
    return set(re.findall(r"[^\W_]+", name))


def models_path() -> Path:
    """Folder of the bundled models, in an installed package or in a clone.

    Raises:
        InputError: If the folder does not exist.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "models", package.parent / "models"):
        if (folder / "drives").is_dir():
            return folder
    raise InputError(f"bundled models not found in {package}; install swgjoint again")


def bundled_names(kind: str, suffix: str) -> list[str]:
    """Names of the bundled files of one kind.

    Args:
        kind: Folder in ``models/``, e.g. ``drives`` or ``scenes``.
        suffix: Suffix of the files, including the dot.

    >>> "bench" in bundled_names("scenes", ".toml")
    True
    """
    return sorted(file.stem for file in (models_path() / kind).glob(f"*{suffix}"))


def find(reference: str | Path, kind: str, suffix: str, *, what: str) -> Path:
    """Find a file by its path or by the name of a bundled file.

    An existing path takes precedence. A reference without a folder is then looked up
    among the bundled files, with or without its suffix.

    Args:
        reference: Path or bundled name.
        kind: Folder in ``models/``.
        suffix: Suffix of the bundled files, including the dot.
        what: Name of the kind in messages, e.g. ``design``.

    Raises:
        InputError: If the reference is neither a file nor a bundled name; the message
            lists bundled names.
    """
    path = Path(reference)
    text = str(reference)
    longest = max(len(part.encode(errors="replace")) for part in ("", *path.parts))
    if "\0" in text or len(text) > MAX_PATH or longest > MAX_NAME:
        raise InputError(f"{what} {text[:60]!r} is not a path or a bundled name")
    if is_file(path):
        return path
    names = bundled_names(kind, suffix)
    if path.parent == Path("."):
        bare = text.removesuffix(suffix)
        if bare in names:
            return models_path() / kind / f"{bare}{suffix}"
    if path.is_dir():
        raise InputError(
            f"{what} {text[:200]!r} is a folder; accepted: a {suffix} file"
        )
    bare = text.removesuffix(suffix)
    shown = text if len(text) <= ECHOED else f"{text[:57]}..."
    accepted = (kind, *TOGETHER.get(kind, ()))
    near = near_names(bare, [name for k in accepted for name in _names(k, suffix)])
    other = named_kind(bare)
    if other is not None and other not in accepted:
        fault = f"{shown!r} is the name of {KINDS[other][1]}; accepted: a {what}"
    else:
        folders = " or ".join(f"models/{k}" for k in accepted)
        fault = f"{what} {shown!r} is neither a file nor in {folders}"
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    bundled = (f"{_SHOWN_AS.get(k, k)}: {_listed(k, suffix)}" for k in accepted)
    raise InputError(f"{fault}{hint} (bundled {'; '.join(bundled)})")


def _listed(kind: str, suffix: str) -> str:
    """Bundled names of one kind for a message, as many as :data:`LISTED` allows."""
    names = _names(kind, suffix)
    lengths = accumulate(len(name) + len(", ") for name in names)
    shown = sum(length <= LISTED for length in lengths)
    if shown == len(names):
        return ", ".join(names)
    command = f"swgjoint list {_SHOWN_AS.get(kind, kind)}"
    more = f"and {len(names) - shown} more, see '{command}'"
    return ", ".join([*names[:shown], more])


def named_kind(name: str) -> str | None:
    """Folder in ``models/`` with a file of this name; None if there is none."""
    return next((k for k in KINDS if name in bundled_names(k, KINDS[k][0])), None)


def _names(kind: str, suffix: str) -> list[str]:
    """Names of one kind; ``suffix`` is for kinds that are not in :data:`KINDS`."""
    return bundled_names(kind, KINDS.get(kind, (suffix,))[0])
