"""TOML from elsewhere: what no file of ours holds is one line at the door."""

from __future__ import annotations

import time

import pytest

from swgjoint.errors import InputError
from swgjoint.faults import shorten
from swgjoint.sim.scene.overrides import parse_override
from swgjoint.toml_file import MAX_DEPTH, parse_toml, parse_value

DEEP = 5000
FILES = {
    "digits": "a = " + "9" * 4301,
    "hexadecimal": "a = 0x" + "f" * 4000,
    "wide integer": f"a = {2**63}",
    "far below": f"a = -{2**63 + 1}",
    "dotted": "a." * DEEP + "a = 1",
    "dotted with blanks": "a . " * DEEP + "a = 1",
    "dotted in quotes": '"a".' * DEEP + "a = 1",
    "dotted table": "[" + "a." * DEEP + "a]",
    "lists": "a = " + "[" * DEEP + "]" * DEEP,
    "tables": "a = " + "{a = " * DEEP + "1" + "}" * DEEP,
    "two steps deeper": "a = " + "[" * (MAX_DEPTH + 2) + "]" * (MAX_DEPTH + 2),
    "long key": "k" * 5000 + " = 1",
    "escape in a text": 'a = "\\u001b[2J"',
    "end of a text": 'a = "x\\u0000y"',
    "escape in a key": '"\\u001b" = 1',
}


@pytest.mark.parametrize("text", FILES.values(), ids=FILES)
def test_a_hostile_file_is_one_short_line(text):
    """One fault, with the file, in less than a second of CPU."""
    begin = time.process_time()
    with pytest.raises(InputError) as caught:
        parse_toml(text, where="file.toml")
    assert time.process_time() - begin < 1.0
    message = str(caught.value)
    assert message.startswith("file.toml: ")
    assert len(message) < 250 and message.isprintable()


@pytest.mark.parametrize(
    "value",
    [
        "9" * 4301,
        "[" * DEEP + "]" * DEEP,
        "{" + "a." * DEEP + "a = 1}",
        '"\\u001b[2J"',
        "\x1b[2J",
    ],
)
def test_a_hostile_value_is_one_short_line(value):
    """What a file may not hold, ``--set`` may not either."""
    with pytest.raises(InputError) as caught:
        parse_override(f"simulation.step_s={value}")
    message = str(caught.value)
    assert message.startswith("simulation.step_s") and "\n" not in message
    assert len(message) < 250 and message.isprintable()


@pytest.mark.parametrize("text", ["a." * DEEP + "a=1", "x" * 5000, "=" * 5000])
def test_a_hostile_key_of_the_command_line_is_one_short_line(text):
    """The key is not repeated whole."""
    with pytest.raises(InputError) as caught:
        parse_override(text)
    assert len(str(caught.value)) < 250


def test_honest_values_pass():
    """Limits leave room: deepest and largest values, lists of numbers, plain words."""
    inside = "[" * (MAX_DEPTH - 1) + "1" + "]" * (MAX_DEPTH - 1)
    numbers = ", ".join(["1.5"] * 2000)
    text = f'a = {inside}\nb = [{numbers}]\nc = {2**63 - 1}\nd = "µ ö\\n\\t$"\n'
    found = parse_toml(text, where="file")
    assert len(found["b"]) == 2000 and found["c"] == 2**63 - 1
    assert parse_value("1.5", where="a") == 1.5
    assert parse_value(" CSG-25-100 ", where="a") == "CSG-25-100"
    assert parse_value("./folder.d/some-file.v1.2.toml", where="a").endswith(".toml")


def test_a_shortened_text_is_printable():
    """Of a foreign text 60 characters at most, none of which moves the cursor."""
    assert shorten("a\x1b[2Jb\x00") == "a?[2Jb?"
    assert len(shorten("y" * 500)) == 60
