"""``swgjoint schema``: list every key of an input file."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

from swgjoint.files import check_output_file, write_whole

KINDS = ("design", "scene", "sweep", "optimise", "spec", "lot", "accept")
WIDTH = 88
"""Width of the list in characters."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the kind of file."""
    parser.epilog = (
        "With --json, the output is a JSON Schema (draft 2020-12) for TOML editors and"
        " validators, with the unit of each key under 'unit'; -o writes it to a file."
        " Without both, the keys are listed as text. An editor with taplo (such as Even"
        " Better TOML) completes and checks the keys of a TOML file whose first line is"
        " '#:schema FILE'."
    )
    parser.add_argument(
        "kind",
        choices=KINDS,
        help="kind of file; spec: limits for compare; lot: limits for lot; optimise:"
        " search file for optimise",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="schema file to write (.json)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Return the schema of one kind of file, or write it to a file.

    Returns:
        JSON Schema with ``unit``, range, ``default`` and ``description`` of each key;
        if it is written to a file, ``files`` instead.

    Raises:
        InputError: If the output file cannot be written.
    """
    from swgjoint.explore.schema import file_schema, schema_text

    if args.output is None:
        return file_schema(args.kind)
    path = check_output_file(args.output, ".json")
    write_whole(path, schema_text(args.kind))
    return {"files": [str(path)]}


def report(result: dict[str, Any]) -> str:
    """Format one line per key, followed by its meaning; or the name of the file."""
    from swgjoint.explore.schema import described_keys
    from swgjoint.json_text import json_text

    if "files" in result:
        return f"schema: {result['files'][0]}"
    lines = []
    for one in described_keys(result):
        default = one["default"]
        parts = [one["type"], one["unit"], one["range"]]
        if one["required"]:
            parts.append("required")
        elif default is not None:
            parts.append(f"default {json_text(default, indent=None)}")
        kind = f" (kind {one['of_kind']})" if one["of_kind"] else ""
        lines.append(f"{one['key']}{kind}: {', '.join(filter(None, parts))}")
        lines += textwrap.wrap(
            one["meaning"], WIDTH, initial_indent="    ", subsequent_indent="    "
        )
    return "\n".join(lines)
