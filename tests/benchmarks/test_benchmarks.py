"""The benchmarks run, and who cites them cites what is there; what they measure is not tested, since a machine is never quiet."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main
from typer import Context
from typer.core import TyperGroup

from benchmarks import sample_path
from cnctwin.cli import app

ROOT = Path(__file__).parents[2]
SCRIPTS = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "benchmarks").rglob("*.py"))
    if path.name != "__init__.py"
}
PAPERS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
WENT_AWAY = ("attr-defined", "call-arg", "import-not-found", "name-defined")
"""What mypy calls the use of a name, a module or a parameter that is not there. The rest of strictness is not asked of them."""
SCRIPT = re.compile(r"(?:python\s+|`)(?:(benchmarks/[\w/]+)\.py|-m (benchmarks[\w.]+))\b(.*?)(?:`|#| {3}|$)", re.M)
PROGRAM = re.compile(r"\bcnctwin ([a-z].*?)(?:`|#| {3}|$)", re.M)
OPTION = re.compile(r"(?<![\w-])--[a-z][\w-]*")
CNCTWIN = typer.main.get_command(app)
PLACE = re.compile(r"\b(?:tests|benchmarks|scripts)/[\w./-]*\w")


def test_every_message_of_the_sample_path_brings_a_result() -> None:
    stages = sample_path.stages(200)
    assert set(stages) == {"floor", "decode", "fold", "encode"}
    assert all(figure >= 0.0 for figure in stages.values())


def test_the_benchmarks_use_what_is_there() -> None:
    """Some seconds where mypy has looked at the packages before, as in `scripts/test`: asked the same way, it uses its cache."""
    modules = [part for name in SCRIPTS for part in ("-m", name.removesuffix(".py").replace("/", "."))]
    mypy = [Path(sys.executable).with_name("mypy"), "--no-error-summary", *modules]
    done = subprocess.run(mypy, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    codes = tuple(f"[{code}]" for code in WENT_AWAY)
    wrong = [line for line in done.stdout.splitlines() if line.startswith("benchmarks") and line.endswith(codes)]
    assert not wrong, "\n".join(wrong)


def words_of(script: str) -> set[str]:
    """Every text in a script: its options are among them, and so is whatever else it may be told to do."""
    nodes = ast.walk(ast.parse(SCRIPTS[script]))
    return {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def untaken(script: str, told: str) -> Iterator[str]:
    """What a script is told and does not know."""
    words, own = told.split(), words_of(script)
    first = words[0].split("|") if words and re.fullmatch(r"[a-z|]+", words[0]) else []
    yield from (word for word in (*first, *OPTION.findall(told)) if word not in own)


@pytest.mark.parametrize("path", [*PAPERS, *(ROOT / script for script in SCRIPTS)], ids=lambda path: str(path.relative_to(ROOT)))
def test_a_cited_command_is_there_with_its_options(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert [place for place in PLACE.findall(text) if not (ROOT / place).exists()] == []
    for one in SCRIPT.finditer(text):
        place = (one[1] or one[2]).replace(".", "/")
        script = f"{place}/__main__.py" if f"{place}/__main__.py" in SCRIPTS else f"{place}.py"
        assert list(untaken(script, one[3])) == [], one[0]
    for one in PROGRAM.finditer(text):
        command, words = CNCTWIN, one[1].split()
        while words and isinstance(command, TyperGroup) and (inner := command.get_command(Context(command), words[0])):
            command, words = inner, words[1:]
        assert not (isinstance(command, TyperGroup) and words and re.fullmatch(r"[a-z-]+", words[0])), one[0]
        known = {option for parameter in command.params for option in parameter.opts + parameter.secondary_opts}
        assert set(OPTION.findall(" ".join(words))) <= known | {"--help"}, one[0]
