"""Options for limits of figures, shared by ``compare`` and ``accept``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence


def add_limits(parser: argparse.ArgumentParser, example: str) -> None:
    """Add ``--spec`` and ``--limit``.

    Args:
        parser: Parser of the command.
        example: Key and value for the help text.
    """
    parser.add_argument(
        "--spec",
        metavar="FILE",
        help="TOML file with a [spec] table of limits; the exit status is 1 if a limit"
        " is missed",
    )
    parser.add_argument(
        "--limit",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help=f"add or replace a limit, e.g. {example}; repeatable",
    )


def limits_of(
    args: argparse.Namespace, accepted: Sequence[str]
) -> dict[str, float] | None:
    """Limits of the file, replaced by those of the options; None without any limit.

    Args:
        args: Parsed arguments.
        accepted: Figures that may be limited.

    Raises:
        InputError: If the file or a limit cannot be used.
    """
    from swgjoint.explore.compare.limits import checked_limits, read_spec
    from swgjoint.sim.scene.overrides import parse_override

    if not args.spec and not args.limit:
        return None
    limits = read_spec(args.spec, accepted) if args.spec else {}
    from_options = dict(map(parse_override, args.limit))
    return limits | checked_limits(from_options, accepted, where="--limit ")
