"""Hash of the source code for cache keys."""

from __future__ import annotations

import ast
import hashlib
from functools import lru_cache
from pathlib import Path

from swgjoint.store import cache_folder, json_content, json_file, keep, read_kept

PACKAGE = Path(__file__).resolve().parent
"""Folder of the package."""
_CODE = (".py", ".cc", ".h")


@lru_cache
def code_hash(*parts: str) -> str:
    """Hash the code of some parts of the package.

    Of Python files, the syntax tree without docstrings is hashed, so that comments,
    docstrings and formatting do not affect the result. C++ files are hashed byte by
    byte. The hash of unchanged files is kept in the cache folder, because parsing them
    takes most of a second.

    Args:
        parts: Files and folders relative to the package, e.g. ``"gear"`` or
            ``"units.py"``.

    Returns:
        64 hexadecimal digits.

    >>> len(code_hash("units.py"))
    64
    """
    files = code_files(*parts)
    content = {
        path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in files
    }
    raw = hashlib.sha256()
    for name, data in content.items():
        raw.update(f"{name}\0{len(data)}\0".encode() + data)
    folder = cache_folder()
    path = folder / "code" / f"{raw.hexdigest()}.json" if folder else None
    known = path and read_kept(path, lambda data: json_content(data, dict[str, str]))
    if known:
        return known["code"]
    digest = hashlib.sha256()
    for name, data in content.items():
        meaning = _meaning(data) if name.endswith(".py") else data
        digest.update(f"{name}\0{len(meaning)}\0".encode() + meaning)
    if path is not None:
        keep(path, json_file({"code": digest.hexdigest()}))
    return digest.hexdigest()


def code_files(*parts: str) -> list[Path]:
    """Sorted source files of the given parts, including files that do not exist."""
    found: set[Path] = set()
    for part in parts:
        path = PACKAGE / part
        if path.is_dir():
            found.update(p for p in path.rglob("*") if p.suffix in _CODE)
        else:
            found.add(path)
    return sorted(found)


def _meaning(source: bytes) -> bytes:
    """Syntax tree without string statements, which are docstrings."""
    parts: list[str] = []

    # ast.dump of a tree without these statements takes twice as long
    def add(part: object) -> None:
        if isinstance(part, ast.AST):
            parts.append(type(part).__name__ + "(")
            for name in part._fields:
                add(getattr(part, name, None))
            parts.append(")")
        elif isinstance(part, list):
            parts.append("[")
            for one in part:
                if not _is_text(one):
                    add(one)
            parts.append("]")
        else:
            parts.append(repr(part) + ",")

    add(ast.parse(source))
    return "".join(parts).encode()


def _is_text(part: object) -> bool:
    return (
        isinstance(part, ast.Expr)
        and isinstance(part.value, ast.Constant)
        and isinstance(part.value.value, str)
    )
