"""What keys of kept results see of the code."""

from __future__ import annotations

import pytest

from swgjoint import code_hash as module
from swgjoint.code_hash import code_files, code_hash

SOURCE = '''
"""A module."""

LIMIT = 0.5
"""Of a quantity."""


def double(x: float) -> float:
    """Twice of it."""
    assert x in {"a", "b", "c"}, "a message"
    return 2.0 * x  # why
'''


@pytest.fixture
def hashed(tmp_path, monkeypatch):
    """Hash of a module with other text."""
    monkeypatch.setattr(module, "PACKAGE", tmp_path)
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path / "cache"))

    def hashed(text):
        (tmp_path / "part.py").write_text(text, encoding="utf-8")
        return code_hash.__wrapped__("part.py")

    return hashed


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""A module."""', '"""Another docstring."""\n\n\n'),
        ('    """Twice of it."""\n', ""),
        ('"""Of a quantity."""', "# a comment instead"),
        ("  # why", ""),
    ],
)
def test_prose_does_not_count(hashed, old, new):
    """Comments, docstrings and places of lines are free."""
    assert old in SOURCE
    assert hashed(SOURCE.replace(old, new)) == hashed(SOURCE)


@pytest.mark.parametrize(
    ("old", "new"), [("0.5", "0.6"), ("2.0 *", "2.0 +"), ("LIMIT", "BOUND")]
)
def test_code_counts(hashed, old, new):
    """Another constant, operator or name is other code."""
    assert hashed(SOURCE.replace(old, new)) != hashed(SOURCE)


def test_remembered_hashes_are_the_same(hashed, tmp_path, monkeypatch):
    """With an empty cache folder, a full one and none."""
    found = [hashed(SOURCE), hashed(SOURCE)]
    assert len(list(tmp_path.glob("cache/code/*.json"))) == 1
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    assert {*found, hashed(SOURCE)} == {found[0]}


def test_parts_that_keys_name_exist():
    """A renamed folder or file would leave the keys that are made of it unchanged."""
    with pytest.raises(FileNotFoundError):
        code_hash("no_such_file.py")
    assert len(code_files("gear", "units.py")) > 20
