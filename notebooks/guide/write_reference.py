"""Write the reference pages of the guide and the JSON Schemas of input files.

    python notebooks/guide/write_reference.py

Keys come from the models that check the files, options from the parsers of the
commands, and names from the package. A test compares the result with the stored files.
"""

from __future__ import annotations

import argparse
import inspect
import re
import tomllib
from pathlib import Path

from pydantic import BaseModel

import swgjoint
from swgjoint.cli import list as list_command
from swgjoint.cli.main import COMMANDS, STATUSES, command_parser
from swgjoint.explore.schema import KINDS, described_keys, file_schema, schema_text
from swgjoint.files import write_whole
from swgjoint.toml_text import toml_text

ROOT = Path(__file__).resolve().parents[2]
PAGES = Path(__file__).resolve().parent / "reference"
WRITTEN = "<!-- Written by notebooks/guide/write_reference.py: change the code. -->"
MEMBERS = ["   :members:", "   :exclude-members: model_config"]
LONGEST = 60
"""Largest length of an example [characters]."""
FOLDERS = {
    "design": "drives",
    "scene": "scenes",
    "sweep": "sweeps",
    "optimise": "optimisations",
}
BUNDLED = {
    "drives": "swgjoint run bench --drive CSG-25-100",
    "designs": "swgjoint meshing reference-2d --torque 20",
    "arms": "swgjoint run ur5e --drive CSG-25-100",
    "scenes": "swgjoint run ur5e-sweep",
    "sweeps": "swgjoint sweep wave-generator --out DIR",
    "optimisations": "swgjoint optimise qca-stress --out DIR",
}
"""Lists of the command ``list``, with a command that uses one of their rows."""
FILES = {
    "design": (
        "Design files",
        "A design file describes a drive. `swgjoint list designs` lists the bundled"
        " ones in `models/drives/`, and `swgjoint design new` scales a copy of one.",
    ),
    "scene": (
        "Scene files",
        "A scene file describes an arm with its drives, motion and controller for"
        " `swgjoint run`. `swgjoint list scenes` lists the bundled ones in"
        " `models/scenes/`. `swgjoint run ARM --out DIR` writes the scene of an arm.",
    ),
    "sweep": (
        "Sweep files",
        "A sweep file lists the designs or runs that `swgjoint sweep` computes. The"
        " bundled ones are in `models/sweeps/`.",
    ),
    "optimise": (
        "Search files",
        "A search file describes a multi-objective search for `swgjoint optimise`. The"
        " bundled one is `models/optimisations/qca-stress.toml`.",
    ),
    "spec": (
        "Limits for compare",
        "A file with limits for `swgjoint compare --spec FILE`.",
    ),
    "lot": (
        "Limits for lot",
        "A file with limits for `swgjoint lot DESIGN --spec FILE`: the yield is the"
        " fraction of drives that meet all of them.",
    ),
    "accept": (
        "Limits for accept",
        "A file with limits for `swgjoint accept DRIVE --spec FILE`.",
    ),
}


def pages() -> dict[Path, str]:
    """Text of all generated files, by path."""
    found = {
        ROOT / "models" / "schemas" / f"{kind}.json": schema_text(kind)
        for kind in KINDS
    }
    found |= {PAGES / f"{kind}.md": key_page(kind) for kind in KINDS}
    return found | {
        PAGES / "commands.md": command_page(),
        PAGES / "api.md": api_page(),
        PAGES / "bundled.md": bundled_page(),
        PAGES / "notebooks.md": notebook_page(),
    }


def rows_of(kind: str) -> list[dict]:
    """Keys of one kind of file, each once; ``table`` tells whether it holds others."""
    rows = described_keys(file_schema(kind))
    below = [row["key"] for row in rows if "." in row["key"]]
    above = {re.sub(r"(\.NAME|\[\])?\.\w+$", "", key) for key in below}
    once = {(row["key"], row["of_kind"]): row for row in reversed(rows)}
    return [row | {"table": row["key"] in above} for row in reversed(once.values())]


def examples(kind: str) -> dict[tuple[str, str | None], object]:
    """Value of each key in a bundled file, or in examples.toml; by key and kind."""
    found: dict[tuple[str, str | None], object] = {}
    folder = ROOT / "models" / FOLDERS.get(kind, "")
    files = sorted(folder.glob("*.toml")) if kind in FOLDERS else []
    for path in files:
        for key, of_kind, value in _values(tomllib.loads(path.read_text("utf-8")), ""):
            if len(shown(value)) <= LONGEST:
                found.setdefault((key, of_kind), value)
    return found


def written_examples(kind: str) -> dict[str, object]:
    """Values of examples.toml by the key, or by its end, that they are for."""
    text = (PAGES / "examples.toml").read_text(encoding="utf-8")
    return tomllib.loads(text).get(kind, {})


def _values(table, above):
    """Keys of a file with the kind of their table and their value."""
    for name, value in table.items():
        key = f"{above}{name}"
        yield key, table.get("kind"), value
        named = key in ("joints", "load")  # tables by the name of a joint
        if isinstance(value, dict):
            for inner in value.values() if named else [value]:
                yield from _values(inner, f"{key}.NAME." if named else f"{key}.")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for inner in value:
                yield from _values(inner, f"{key}[].")


def shown(value: object) -> str:
    """Value as TOML."""
    return toml_text({"x": [value]}).removeprefix("x = [").removesuffix("]\n")


def example(row, bundled, written) -> object:
    """Example of a key; None if none is known."""
    key = row["key"]
    for each in (key, key.rpartition(".")[2]):
        if each in written:
            return written[each]
    if (key, row["of_kind"]) in bundled:
        return bundled[key, row["of_kind"]]
    if row["default"] not in (None, "", []):
        return row["default"]
    form = row["forms"][0]
    if "enum" in form:
        return form["enum"][0]
    if "enum" in form.get("items", {}):
        return form["items"]["enum"][:1]
    if form.get("type") == "boolean":
        return True
    return None


def key_page(kind: str) -> str:
    """Page with every key of one kind of file."""
    title, text = FILES[kind]
    lines = [WRITTEN, "", f"# {title}", "", text, ""]
    lines += [
        f"`swgjoint schema {kind}` prints this list, and `swgjoint schema {kind} -o"
        f" {kind}.json` writes it as a JSON Schema. Editors with taplo (Even Better"
        " TOML in VS Code) complete, explain and check the keys of a file whose first"
        f" line is `#:schema ./{kind}.json`; the path is relative to the file.",
    ]
    bundled, written = examples(kind), written_examples(kind)
    rows = rows_of(kind)
    meaning = {row["key"]: row["meaning"] for row in rows}
    seen: dict[str, str] = {}
    tables: dict[tuple[str, str | None], list] = {}
    for row in rows:
        table = row["key"].rpartition(".")[0], row["of_kind"]
        tables.setdefault(table, []).append(row)
    for (above, of_kind), group in tables.items():
        heading = _heading(above, of_kind)
        lines += ["", f"## {heading}", ""]
        if meaning.get(above.removesuffix("[]")):
            lines += [meaning[above.removesuffix("[]")], ""]
        content = repr([row | {"key": row["key"].rpartition(".")[2]} for row in group])
        if content in seen:
            lines += [f"The keys are those of {seen[content]}."]
            continue
        seen[content] = heading
        lines += ["| key | type | range | default | example | meaning |"]
        lines += ["|---|---|---|---|---|---|"]
        lines += [
            _row(row, None if row["table"] else example(row, bundled, written))
            for row in group
        ]
    return "\n".join(lines) + "\n"


def _heading(above: str, of_kind: str | None) -> str:
    if not above:
        return "Keys before the first table"
    name = f"[[{above[:-2]}]]" if above.endswith("[]") else f"[{above}]"
    return f"`{name}`" + (f' with `kind = "{of_kind}"`' if of_kind else "")


def _row(row, value: object) -> str:
    name = row["key"].rpartition(".")[2]
    unit = f", {row['unit']}" if row["unit"] else ""
    default = "required" if row["required"] else ""
    if not row["required"] and row["default"] not in (None, "", []):
        default = f"`{shown(row['default'])}`"
    cells = (
        f"`{name}`",
        f"{row['type']}{unit}".replace("'", '"'),
        row["range"],
        default,
        f"`{shown(value)}`" if value is not None else "",
        row["meaning"],
    )
    return f"| {' | '.join(_cell(cell) for cell in cells)} |"


def _cell(text: str) -> str:
    """Text of a table cell: outside of code, < and * have no meaning of their own."""
    parts = re.split(r"(`[^`]*`)", text.replace("|", r"\|"))
    return "".join(
        part if part.startswith("`") else re.sub(r"([<*])", r"\\\1", part)
        for part in parts
    )


def command_page() -> str:
    """Page with every command, its arguments and the keys of its JSON object."""
    lines = [WRITTEN, "", "# Commands", "", STATUSES, ""]
    lines += ["| command | does |", "|---|---|"]
    lines += [f"| [`{name}`](#{name}) | {text} |" for name, text in COMMANDS.items()]
    lines += ["", "All commands have these options:", "", "| option | meaning |"]
    lines += ["|---|---|"]
    common = ("--help", "--json", "--quiet", "--verbose", "--traceback")
    for action in command_parser("doctor")._actions:
        lines += [_option(action)] if action.option_strings[-1] in common else []
    for name in COMMANDS:
        lines += ["", *_command(name, common)]
    return "\n".join(lines) + "\n"


def _command(name: str, common: tuple[str, ...]) -> list[str]:
    parser = command_parser(name)
    lines = [f"## {name}", "", f"`swgjoint {name}`: {COMMANDS[name]}."]
    if notes := (parser.epilog or "").removesuffix(STATUSES).strip():
        lines += ["", _cell(notes)]
    for group in parser._action_groups:
        actions = [
            action
            for action in group._group_actions
            if not set(action.option_strings) & set(common)
        ]
        if not actions:
            continue
        lines += ["", f"| {group.title or 'options'} | meaning |", "|---|---|"]
        lines += [_option(action) for action in actions]
    keys = re.search(r"Returns:\n(.*?)(\n\n|\Z)", inspect.getdoc(_run(name)), re.DOTALL)
    text = " ".join(keys[1].split()).replace("``", "`")
    return [*lines, "", f"JSON object: {_roles(text)}"]


def _run(name: str):
    return __import__(f"swgjoint.cli.{name}", fromlist=["run"]).run


def _roles(text: str) -> str:
    return re.sub(r":[a-z]+:`~?([^`]+)`", r"`\1`", text)


def _option(action: argparse.Action) -> str:
    """Row of an argument: how it is typed, and its meaning."""
    value = ""
    if action.choices is not None:
        value = "|".join(map(str, action.choices))
    elif action.metavar is not None:
        value = str(action.metavar)
    elif action.nargs != 0:
        value = action.dest.upper()
    if action.nargs == "?" and action.option_strings:
        value = f"[{value}]"
    typed = " ".join(filter(None, (", ".join(action.option_strings), value)))
    return f"| {_cell(f'`{typed}`')} | {_cell(action.help or '')} |"


def api_page() -> str:
    """Page with the public names; Sphinx adds what their docstrings say."""
    names = [name for name in swgjoint.__all__ if not name.startswith("_")]
    lines = [WRITTEN, "", "# Python interface", ""]
    lines += [
        "These names are importable from `swgjoint`. Everything else may move between"
        " versions.",
        "",
        "| name | meaning |",
        "|---|---|",
    ]
    for name in names:
        first = (inspect.getdoc(getattr(swgjoint, name)) or "").split("\n\n")[0]
        text = _roles(" ".join(first.split()).replace("``", "`"))
        lines += [f"| `{name}` | {_cell(text)} |"]
    for name in names:
        found = getattr(swgjoint, name)
        where = f"{found.__module__}.{found.__qualname__}"
        kind = "function"
        if isinstance(found, type):
            kind = "exception" if issubclass(found, Exception) else "class"
            if issubclass(found, BaseModel):
                where += "(**tables)"  # their defaults fill half a screen
        lines += ["", f"## {name}", "", "```{eval-rst}", f".. auto{kind}:: {where}"]
        lines += MEMBERS if kind == "class" else []
        lines += ["```"]
    return "\n".join(lines) + "\n"


def bundled_page() -> str:
    """Page with the bundled drives, arms and files, as ``list`` prints them."""
    lines = [WRITTEN, "", "# Bundled drives, arms and files", ""]
    lines += ["`swgjoint list KIND` prints these tables."]
    for kind, use in BUNDLED.items():
        result = list_command.run(argparse.Namespace(kind=kind))
        table = list_command.report(result).removesuffix(result["note"]).rstrip()
        table = "\n".join(line.rstrip() for line in table.splitlines())
        lines += ["", f"## {kind.capitalize()}", "", "```sh", use, "```"]
        lines += ["", "```text", table, "```", "", _cell(result["note"])]
    return "\n".join(lines) + "\n"


def notebook_page() -> str:
    """Page with the title and the first sentences of every notebook."""
    lines = [WRITTEN, "", "# Notebooks", ""]
    lines += [
        "The notebooks in `notebooks/` are Python files with cells, which VS Code and"
        " PyCharm open directly. For JupyterLab, convert one; the extra `notebooks` has"
        " the tools. The slow tests run all of them.",
        "",
        "```sh",
        "python3 -m pip install '.[notebooks]'",
        "jupytext --to notebook notebooks/first-drive.py",
        "```",
    ]
    for path in sorted((ROOT / "notebooks").glob("*.py")):
        cell = path.read_text("utf-8").partition("# %% [markdown]\n# # ")[2]
        title, *text = cell.partition("\n# %%")[0].splitlines()
        plain = " ".join(line.removeprefix("#").strip() for line in text).strip()
        start = re.match(r"(?:[^.?]*[.?] ?){1,2}(?=\s|$)", plain)[0]
        lines += ["", f"## {title}", "", f"`notebooks/{path.name}`: {start.strip()}"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for path, text in pages().items():
        write_whole(path, text)
        print(path.relative_to(ROOT))
