"""Where the bundled drives, arms, scenes and catalogue tables lie."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from swgjoint.errors import InputError


def models_path() -> Path:
    """Folder of the bundled models, installed or in a clone."""
    package = Path(__file__).resolve().parent
    for folder in (package / "models", package.parent / "models"):
        if (folder / "drives").is_dir():
            return folder
    raise InputError(f"bundled models not found in {package}; install swgjoint again")


def bundled_names(kind: str, suffix: str) -> list[str]:
    """Names of the bundled files of one kind (``drives``, ``scenes``, ...)."""
    return sorted(file.stem for file in (models_path() / kind).glob(f"*{suffix}"))


def find(reference: str | Path, kind: str, suffix: str, *, what: str) -> Path:
    """Path of a file given as a path or as the name of a bundled one.

    An existing path wins; a reference without a folder is then looked up among the
    bundled files, with or without its suffix.

    Args:
        reference: Path or bundled name.
        kind: Folder below ``models/``.
        suffix: Suffix of the bundled files, with its dot.
        what: Word for messages, e.g. ``design``.

    Raises:
        InputError: If neither exists; names the bundled ones.
    """
    path = Path(reference)
    text = str(reference)
    if "\0" in text or len(text) > 4096:
        raise InputError(f"{what} {text[:60]!r} is not a path or a bundled name")
    if path.is_file():
        return path
    names = bundled_names(kind, suffix)
    if path.parent == Path("."):
        bare = text.removesuffix(suffix)
        if bare in names:
            return models_path() / kind / f"{bare}{suffix}"
    if path.is_dir():
        raise InputError(f"{what} {text!r} is a folder; needed: a {suffix} file")
    near = get_close_matches(text.removesuffix(suffix), names, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise InputError(
        f"{what} {text!r} is neither a file nor in models/{kind}{hint}"
        f" (bundled: {', '.join(names)})"
    )
