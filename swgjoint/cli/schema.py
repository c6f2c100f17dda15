"""``swgjoint schema``: every key of an input file."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

KINDS = ("design", "scene", "sweep", "optimise", "spec", "lot")
WIDTH = 88


def configure(parser: argparse.ArgumentParser) -> None:
    """Kind of file."""
    parser.epilog = (
        "With --json: the JSON Schema (draft 2020-12), for editors and checkers of"
        " TOML; units are under 'unit'. Without: the keys as a list."
    )
    parser.add_argument(
        "kind",
        choices=KINDS,
        help="spec: limits for compare; lot: limits for lot; optimise: search file",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The schema.

    Returns:
        JSON Schema with ``unit``, range, ``default`` and ``description`` of each key.
    """
    from swgjoint.explore.schema import file_schema

    return file_schema(args.kind)


def report(result: dict[str, Any]) -> str:
    """One line for each key, its meaning below."""
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
        of = f" (kind {one['of_kind']})" if one["of_kind"] else ""
        lines.append(f"{one['key']}{of}: {', '.join(filter(None, parts))}")
        lines += textwrap.wrap(
            one["meaning"], WIDTH, initial_indent="    ", subsequent_indent="    "
        )
    return "\n".join(lines)
