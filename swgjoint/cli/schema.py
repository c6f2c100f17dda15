"""``swgjoint schema``: list every key of an input file."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

KINDS = ("design", "scene", "sweep", "optimise", "spec", "lot")
WIDTH = 88
"""Width of the list in characters."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the kind of file."""
    parser.epilog = (
        "With --json, the output is a JSON Schema (draft 2020-12) for TOML editors and"
        " validators, with the unit of each key under 'unit'. Without --json, the keys"
        " are listed as text."
    )
    parser.add_argument(
        "kind",
        choices=KINDS,
        help="kind of file; spec: limits for compare; lot: limits for lot; optimise:"
        " search file for optimise",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Return the schema of one kind of file.

    Returns:
        JSON Schema with ``unit``, range, ``default`` and ``description`` of each key.
    """
    from swgjoint.explore.schema import file_schema

    return file_schema(args.kind)


def report(result: dict[str, Any]) -> str:
    """Format one line per key, followed by its meaning."""
    from swgjoint.explore.schema import described_keys
    from swgjoint.json_text import json_text

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
