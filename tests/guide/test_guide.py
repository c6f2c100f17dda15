"""The guide: links lead somewhere, commands are accepted, examples work."""

from __future__ import annotations

import ast
import re
import shlex
import tomllib
from collections import Counter
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import swgjoint
from swgjoint.cli.main import COMMANDS, command_parser, main
from swgjoint.models_path import bundled_names

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / "notebooks" / "guide"
EXAMPLES = GUIDE / "examples"  # written by Sphinx, from the notebooks
PAGES = [
    ROOT / "README.md",
    *sorted(page for page in GUIDE.rglob("*.md") if page.parent != EXAMPLES),
]
LINK = re.compile(r"(?<!\\)\]\(([^)\s]+)\)")


def name_of(page):
    return page.relative_to(ROOT).as_posix()


@cache
def text_of(page):
    return page.read_text(encoding="utf-8")


def blocks(page, language):
    pattern = rf"^```{language}\n(.*?)^```"
    return re.findall(pattern, text_of(page), re.DOTALL | re.MULTILINE)


def prose(page):
    """Text of a page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", text_of(page), flags=re.DOTALL | re.MULTILINE)


@cache
def anchors(page):
    """Anchors that the headings of a page get."""
    found = Counter()
    names = set()
    for heading in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        names.add(f"{slug}-{found[slug]}" if found[slug] else slug)
        found[slug] += 1
    return names


def broken(page, text):
    """Links of a text, read as part of a page, that lead nowhere."""
    found = []
    for link in LINK.findall(text):
        path, _, anchor = link.partition("#")
        if path.startswith(("http", "<http")):
            continue
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    """Pages, anchors and pictures that a page names are there."""
    assert broken(page, prose(page)) == []


def test_a_broken_link_is_noticed():
    """A page, an anchor and a picture that are not there."""
    page = GUIDE / "levels.md"
    wrong = "[a](none.md) [b](changes.md#none) ![c](../pictures/none.png) [d](#none)"
    assert len(broken(page, wrong)) == 4
    assert broken(page, "[a](changes.md#fixed) [b](#which-step)") == []


def shown_commands(page):
    """Command lines in the blocks of a page."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    return [part for part in parts if part.startswith("swgjoint ")]


def mentioned_commands(page):
    """Commands in the text of a page, which may be incomplete."""
    spans = [" ".join(one.split()) for one in re.findall(r"`([^`]+)`", prose(page))]
    return [one for one in spans if one.startswith("swgjoint ")]


COMMAND_LINES = sorted({line for page in PAGES for line in shown_commands(page)})


def test_there_are_command_lines():
    """The search for commands finds those of the tutorials."""
    assert "swgjoint run arm.urdf --out first" in COMMAND_LINES
    assert len(COMMAND_LINES) > 50


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_shown_commands_are_accepted(line):
    """Each command line is accepted by the parser of its command."""
    _, name, *arguments = shlex.split(line, comments=True)
    assert name in COMMANDS
    args = command_parser(name).parse_args(arguments)
    design = getattr(args, "design", None)
    if design is not None and re.fullmatch(r"(reference|size|dca|xb1)[\w-]+", design):
        assert design in bundled_names("drives", ".toml")
    scene = getattr(args, "scene", None)
    if scene is not None and re.fullmatch(r"(bench|ur5e|iiwa14|panda)[\w-]*", scene):
        names = (*bundled_names("scenes", ".toml"), *bundled_names("arms", ".xml"))
        assert scene in names


CHEAP = """\
swgjoint list drives
swgjoint schema scene
swgjoint doctor
swgjoint design check reference-2d
swgjoint design new reference-2d -o my.toml
swgjoint design new reference-2d --teeth 160/162 --module 0.4 -o my.toml
swgjoint design check my.toml
swgjoint profile my.toml --out teeth
swgjoint profile reference-2d --out pictures
swgjoint spec CSG-25-100
swgjoint study response --only CSG-25-100 --closed-form --load-inertia 2
swgjoint export fmu CSG-25-100 -o drive.fmu
swgjoint export fmu CSG-25-100 --load-inertia 0.5 -o drive.fmu
swgjoint export mjcf ur5e -o arm.xml
swgjoint run bench --drive CSG-25-100
swgjoint run two-link --drive CSG-25-100
swgjoint run ur5e --drive CSG-25-100
swgjoint meshing reference-2d --torque 20
""".splitlines()
"""Commands of the pages that take seconds, in an order in which files are there."""


@pytest.mark.slow
def test_cheap_commands_succeed(tmp_path, monkeypatch):
    """The commands that need no map of finite elements, as the pages show them."""
    shown = {line.partition("#")[0].strip() for line in COMMAND_LINES}
    assert set(CHEAP) <= shown
    monkeypatch.chdir(tmp_path)
    failed = [line for line in CHEAP if main(shlex.split(line)[1:]) != 0]
    assert failed == []


def refusal(line, capsys):
    """What the parser says of a command line; empty if it accepts it."""
    _, name, *arguments = shlex.split(line)
    try:
        command_parser(name).parse_args(arguments)
    except SystemExit:
        return capsys.readouterr().err
    return ""


INCOMPLETE = ("arguments are required", "expected one argument")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_mentioned_commands_exist(page, capsys):
    """The parser accepts them, or asks for what the text leaves out.

    Alternatives such as ``design|scene`` are tried one by one.
    """
    for line in mentioned_commands(page):
        name, *rest = line.split()[1:]
        if name.isupper() or name.startswith("-"):  # COMMAND, --version
            continue
        assert name in COMMANDS, line
        options = [[word] if word.isupper() else word.split("|") for word in rest]
        for words in product(*options):
            if words and words[0].isupper() and name in ("list", "schema"):  # KIND
                continue
            found = refusal(shlex.join(["swgjoint", name, *words]), capsys)
            assert not found or any(part in found for part in INCOMPLETE), line


def other_commands(page):
    """Commands of other programs in the blocks and the text of a page."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    parts = [part.strip(" &") for line in lines for part in line.split("&&")]
    spans = [" ".join(one.split()) for one in re.findall(r"`([^`]+)`", prose(page))]
    begins = ("python ", "python3 ", "pip ", ".ci/")
    parts += [one for one in spans if one.startswith(begins) and " " in one]
    return [one for one in parts if one and not one.startswith(("swgjoint ", "#"))]


def unknown(line):
    """What a command of another program names that does not exist."""
    words = shlex.split(line, comments=True)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    if "pip" in words[:3]:
        asked = [
            extra
            for word in words
            for group in re.findall(r"\[([\w,]+)\]", word)
            for extra in group.split(",")
        ]
        return [extra for extra in asked if extra not in extras]
    if words[0] in ("git", "cd", "cp", "gcc", "g++", ".") or "=" in words[0]:
        return []
    if words[1:3] == ["-m", "venv"]:  # writes the folder that it names
        return []
    if words[0].startswith("./"):  # built by a line before
        return []
    needed = [project["project"]["dependencies"], *extras.values()]
    programs = {re.split(r"[\[>=]", name)[0] for names in needed for name in names}
    files = [word for word in words if word.startswith(("tests/", "notebooks/", "."))]
    files += [word for word in words if word.endswith(".py")]
    missing = [name for name in dict.fromkeys(files) if not (ROOT / name).exists()]
    if words[0] in ("python", "python3"):
        module = words[2].split(".")[0] if words[1] == "-m" else None
        return missing + [module] * (module not in (None, *programs))
    return missing + [words[0]] * (words[0] not in (*programs, *files))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_other_commands_exist(page):
    """Scripts, modules, programs and extras that a page names are there."""
    assert [found for line in other_commands(page) for found in unknown(line)] == []


def test_an_unknown_program_or_extra_is_noticed():
    """A script, a module, an extra and a program that are not there."""
    lines = ("python tests/no.py", "python -m no", "pip install '.[no]'", "no --x")
    assert [unknown(line) for line in lines] == [["tests/no.py"], *[["no"]] * 3]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_python_examples_use_public_names(page):
    """Examples compile and use names that the package has."""
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if (
                isinstance(node, ast.Attribute)
                and ast.unparse(node.value) == "swgjoint"
            ):
                assert hasattr(swgjoint, node.attr), node.attr


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_named_files_exist(page):
    """Paths in the repository that a page names exist."""
    folders = "models|notebooks|tests|swgjoint"
    named = re.findall(rf"`((?:{folders})/[\w./-]+)`", text_of(page))
    assert [path for path in named if not (ROOT / path).exists()] == []


def follow(page, folder, monkeypatch, capsys, skip=()):
    """Do what a tutorial says, in a folder: save its files, run code and commands."""
    monkeypatch.chdir(folder)
    for urdf in blocks(page, "xml"):
        (folder / "arm.urdf").write_text(urdf)
    names = {"__name__": "example"}  # a block continues the one before it
    pattern = r"^```(python|sh)\n(.*?)^```"
    parts = re.findall(pattern, text_of(page), re.DOTALL | re.MULTILINE)
    for number, (language, block) in enumerate(parts):
        if language == "python":
            exec(compile(block, f"{page.name}:{number}", "exec"), names)
            continue
        for line in block.splitlines():
            _, *arguments = shlex.split(line, comments=True)
            if arguments[0] not in skip:
                assert main(arguments) == 0, line
    return capsys.readouterr().out


def test_own_arm_tutorial(tmp_path, monkeypatch, capsys):
    """Every command and the program; the printed table is that of the page."""
    page = GUIDE / "tutorials" / "my-own-arm.md"
    out = follow(page, tmp_path, monkeypatch, capsys)
    table = blocks(page, "text")[0].splitlines()
    shown = [line.split()[:8] for line in table if line.split()[1:2] == ["full"]]
    printed = [line.split()[:8] for line in out.splitlines()]
    assert len(shown) == 2 and all(line in printed for line in shown)
    assert (tmp_path / "first" / "run.rrd").exists()


def test_measured_loop_tutorial(tmp_path, monkeypatch, capsys):
    """The map of the example has the width and the stiffness that the loop has."""
    page = GUIDE / "tutorials" / "measured-loop.md"
    out = follow(page, tmp_path, monkeypatch, capsys)
    found = dict(re.findall(r"^(hysteresis loss|K1)\s+([\d.e+]+)", out, re.MULTILINE))
    assert float(found["hysteresis loss"]) == pytest.approx(0.6, rel=0.05)
    assert float(found["K1"]) == pytest.approx(31_000, rel=0.05)


def test_first_drive_tutorial(tmp_path, monkeypatch, capsys):
    """All steps that need no finite elements of a whole drive."""
    page = GUIDE / "tutorials" / "first-drive.md"
    slow = ("meshing", "map", "spec", "compare", "run", "view")
    follow(page, tmp_path, monkeypatch, capsys, skip=slow)
    made = {"my.toml", "steeper.toml", "teeth", "fine.toml", "coarse.toml"}
    assert made == {p.name for p in tmp_path.iterdir()}


@pytest.mark.slow
@pytest.mark.fe
def test_first_drive_in_an_arm(tmp_path, monkeypatch, capsys):
    """The named joint and design, and ripple and error with both pitch errors."""
    page = GUIDE / "tutorials" / "first-drive.md"
    monkeypatch.chdir(tmp_path)
    urdf = blocks(GUIDE / "tutorials" / "my-own-arm.md", "xml")[0]
    (tmp_path / "arm.urdf").write_text(urdf)
    section = text_of(page).partition("## In an arm of your own\n")[2]
    lines = re.search(r"(?s)```sh\n(.*)\n```", section)[1].splitlines()
    figures = []
    for line in (line for line in lines if re.match("swgjoint (run|design)", line)):
        assert main([*shlex.split(line)[1:], "--quiet"]) == 0, line
        out = capsys.readouterr().out
        if "arm.urdf" in line:
            assert (
                "shoulder carries the most" in out and "size-20-100 (shoulder)" in out
            )
        elif " run " in line:
            row = re.search(r"^shoulder +full (.*)", out, re.MULTILINE)[1].split()
            figures.append((row[4], row[3]))
    (fine, error), (coarse, more) = figures
    shown = fine, coarse, error, more
    text = " ".join(section.split())
    stated = re.search(
        r"rises from (\S+) to (\S+) % .* from (\S+) to (\S+) arcmin", text
    )
    assert stated.groups() == tuple(f"{float(value):.2f}" for value in shown)


def test_linear_control_page(tmp_path, monkeypatch, capsys):
    """The regulator runs, and prints the table of the page."""
    page = GUIDE / "how-to" / "linear-control.md"
    out = follow(page, tmp_path, monkeypatch, capsys).splitlines()
    table = blocks(page, "text")[0].splitlines()
    assert len(table) == 2 and out[-2:] == table


def test_optimal_control_page(tmp_path, monkeypatch, capsys):
    """The motions and the arms are found, and print what the page shows.

    IPOPT ends in one of several local optima, and which one depends on the processor.
    """
    for name in ("casadi", "pinocchio"):
        pytest.importorskip(name)
    page = GUIDE / "how-to" / "optimal-control.md"
    out, shown = (
        re.split(r"(\d+\.\d+)", text)
        for text in (
            follow(page, tmp_path, monkeypatch, capsys),
            "".join(blocks(page, "text")),
        )
    )
    assert out[::2] == shown[::2]
    numbers = [[float(x) for x in part[1::2]] for part in (out, shown)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.1)


def test_own_environment_page(capsys):
    """The environment passes the checker, pays as told, and its batch is as alone."""
    check_env = pytest.importorskip("gymnasium.utils.env_checker").check_env
    names = {"__name__": "example"}
    for block in blocks(GUIDE / "how-to" / "own-environment.md", "python"):
        exec(compile(block, "own-environment.md", "exec"), names)
    assert "10 values" in capsys.readouterr().out
    del names["gymnasium"].registry["Gentle-v0"]
    env, many = names["env"].unwrapped, names["many"]
    check_env(env, skip_render_check=True)
    (first, _), (each, _) = env.reset(seed=3), many.reset(seed=3)
    assert (first == each[0]).all()
    rated = env.core.joint.drive.ratings.rated_torque
    for k in range(200):
        one = env.step(np.full(1, 0.05 * np.sin(0.1 * k)))
        all_of = many.step(np.full((256, 1), 0.05 * np.sin(0.1 * k)))
        info, (observation, reward) = one[4], one[:2]
        assert (observation == all_of[0][0]).all() and reward == all_of[1][0]
        assert observation[2] * env.core.units[2] == info["output_torque_Nm"]
        load, error = info["output_torque_Nm"] / rated, info["link_error_arcmin"] / 3.0
        assert reward == pytest.approx(1.0 / (1.0 + error**2) - 0.2 * load**2)


def test_citation_names_the_version():
    """The version of the citation file and of the pages is that of the package."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {swgjoint.__version__}\n" in text
    assert f"version {swgjoint.__version__}," in text_of(GUIDE / "sources.md")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["version"] == swgjoint.__version__
    (date,) = re.findall(r"^date-released: (\S+)$", text, re.MULTILINE)
    headings = re.findall(r"^## (.+)$", text_of(GUIDE / "changes.md"), re.MULTILINE)
    assert headings[0] == f"{swgjoint.__version__} ({date})"


def cited_names(text):
    """Family names in front of a year, as in ``Júdice and Pires (1994)``."""
    found = re.findall(r"((?:[A-Z][^\W\d_]+,? (?:and |et al\. )?)+)\(\d{4}\)", text)
    names = {name for part in found for name in re.findall(r"[^\W\d_]+", part)}
    return names - {"and", "et", "al", "De", "Source"}


def test_cited_sources_are_listed():
    """Authors that a docstring names before a year are on the page of sources."""
    page = text_of(GUIDE / "sources.md")
    page += page.replace("ä", "ae").replace("é", "e")
    missing = {}
    for path in sorted((ROOT / "swgjoint").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        kinds = ast.Module | ast.ClassDef | ast.FunctionDef
        texts = [
            ast.get_docstring(n) or "" for n in ast.walk(tree) if isinstance(n, kinds)
        ]
        names = {name for text in texts for name in cited_names(" ".join(text.split()))}
        if names := {name for name in names if name not in page}:
            missing[path.name] = names
    assert missing == {}
    assert cited_names("as in Taylor, Beresford and Wilson (1976), and") == {
        "Taylor",
        "Beresford",
        "Wilson",
    }


@pytest.mark.slow
def test_tune_tutorial(tmp_path, monkeypatch, capsys):
    """The environment by hand, a short tuning and the closed form of the response."""
    page = GUIDE / "tutorials" / "tune-a-controller.md"
    assert "held-out" in follow(page, tmp_path, monkeypatch, capsys)
