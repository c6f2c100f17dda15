"""Names that a reader meets: one meaning each, and functions that say what they do."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import swgjoint

PACKAGE = Path(swgjoint.__file__).parent
PREPOSITIONS = set(
    "above after ahead along apart around as at back before behind beside between"
    " beyond by down for from in inside into like of off on onto out outside over per"
    " since through to toward towards under until up upon with within without".split()
)
IRREGULAR = set(
    "begun bent bound done drawn felt found given gone held hung kept known laid left"
    " lost made met run said seen sent set shown sought stuck taken taught thrown told"
    " won wound written".split()
)
NOUNS = set(
    "bearing bending ceiling coning coupling damping housing loading meshing rounding"
    " running spring starting string ring need speed seed embed run set".split()
)
"""Words that look like participles and are nouns, or verbs."""
KNOWN = {"pruned"}
"""``DriveMap.pruned``: users' programs call it."""


@cache
def definitions() -> list[tuple[str, ast.AST, str | None]]:
    """Classes and functions outside functions: file, node, class that holds it."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        stack = [(ast.parse(path.read_text(encoding="utf-8")), None)]
        while stack:
            node, holder = stack.pop()
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.ClassDef):
                    found.append((name, child, holder))
                    stack.append((child, child.name))
                elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                    found.append((name, child, holder))
                elif isinstance(child, ast.If | ast.Try):
                    stack.append((child, holder))
    return found


def test_no_class_name_twice():
    """A public class name stands for one thing in the package."""
    files = defaultdict(set)
    for file, node, _ in definitions():
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            files[node.name].add(f"{file}:{node.lineno}")
    assert {name: where for name, where in files.items() if len(where) > 1} == {}


def bare(name: str) -> bool:
    """Whether a name is a participle or preposition, and no more than prepositions."""
    first, _, rest = name.partition("_")
    if (rest and rest not in PREPOSITIONS) or name in NOUNS:
        return False
    if first in PREPOSITIONS | IRREGULAR:
        return True
    return bool(re.fullmatch(r"[a-z]+(ed|ing)", first)) and first not in NOUNS


def test_functions_say_what_they_do():
    """No public function or method is a bare preposition or participle.

    Properties are data, and private classes belong to their file.
    """
    found = [
        f"{file}: {node.name}"
        for file, node, holder in definitions()
        if not isinstance(node, ast.ClassDef) and bare(node.name)
        if not (holder or "").startswith("_") and node.name not in KNOWN
        if not any("property" in ast.unparse(d) for d in node.decorator_list)
    ]
    assert found == []


def test_the_rule_tells_them_apart():
    """Verbs and nouns pass, what says nothing does not."""
    assert not any(map(bare, ("meshing", "solve", "from_design", "lost_motion", "run")))
    assert all(map(bare, ("of", "turned", "told", "facing", "turned_to", "held")))


def test_files_are_short():
    """No file has more than 400 lines."""
    lengths = {
        path.relative_to(PACKAGE).as_posix(): path.read_bytes().count(b"\n")
        for path in PACKAGE.rglob("*.py")
    }
    assert {name: n for name, n in lengths.items() if n > 400} == {}
