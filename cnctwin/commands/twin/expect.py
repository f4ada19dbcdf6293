"""`cnctwin expect`: what the twin expects of part programs, line by line, worked out once for the live processors."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from cnctwin.commands.options import AsJson, MachineDescription
from cnctwin.errors import UsageError
from cnctwin.files.called_programs import with_called_programs
from cnctwin.files.program_text import read_text
from cnctwin.processes.extras import needed_by
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.spinner import working

if TYPE_CHECKING:
    from twin.expected.expectation import Expectation
    from twin.expected.lines import Numbering
    from twin.machine import Tool


FORCE_NOTE = (
    "note: the mean tangential force is the one that loads the spindle; simulate and optimise print the peak of the resultant, "
    "which is greater"
)


def expect(
    programs: Annotated[list[Path], typer.Argument(help="Part programs; the name of a file is that of its program")],
    machine: MachineDescription,
    out: Annotated[Path, typer.Option(help="Folder of expectations, which the processors read")] = Path("expectations"),
    tools: Annotated[Path | None, typer.Option(help="TOML with \\[tools.N], in place of those of the machine")] = None,
    lines: Annotated[
        str, typer.Option(help="How the control counts lines: n_words, from_0, from_1; auto = N words where most blocks have one")
    ] = "auto",
    name: Annotated[str | None, typer.Option(help="Name of the machine on the broker; else that of its description")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Work out again what is up to date")] = False,
    as_json: AsJson = False,
) -> None:
    """Work out the feed, time, force and spindle load of each line of part programs, for look-up while they run."""
    with needed_by("the twin", "twin"):
        from dataclasses import replace

        from processors.description import version_of
        from twin.errors import TwinError
        from twin.expected.files import written
        from twin.expected.making import expectation_of
        from twin.machine import machine_from_toml
        from twin.simulator.simulation import program_settings
    _check_names(programs)
    text = read_text(machine)
    described = machine_from_toml(text, str(machine))
    if name is not None:
        described = described.model_copy(update={"machine": described.machine.model_copy(update={"name": name})})
    table, numbering = _tools(tools), _numbering(lines)
    version = version_of(text) + ("" if tools is None else f"+{version_of(read_text(tools))}")
    shown: list[dict[str, Any]] = []
    for program in programs:
        source = read_text(program)
        kept = _up_to_date(out, described.machine.name, program, source, version)
        kept = None if fresh else kept
        if kept is not None and numbering in (None, kept.numbering):
            shown.append(_shown(kept, program, None, as_json=as_json))
            continue
        with working(f"working out {program.name}"):
            try:
                settings = with_called_programs(program_settings(described), program, source)
                made = expectation_of(
                    described, source, table, program.stem, numbering=numbering, settings=settings, description=version
                )
            except TwinError as error:
                raise UsageError(f"{program}: {error}") from None
        made = replace(made, file=program.name)
        shown.append(_shown(made, program, written(out, made), as_json=as_json))
    if as_json:
        sys.stdout.write(json.dumps(shown) + "\n")


def _tools(path: Path | None) -> "dict[str, Tool]":
    """Return the tools of a table in a file."""
    from twin.machine import machine_from_toml

    if path is None:
        return {}
    text = read_text(path)
    head = "" if "[machine]" in text else '[machine]\nname = "tools"\n'
    found = machine_from_toml(head + text, str(path)).tools
    if not found:
        raise UsageError(f"{path}: has no [tools.N]; write one for each tool, with diameter_mm, teeth and the coefficients")
    return found


def _numbering(lines: str) -> "Numbering | None":
    from twin.expected.lines import Numbering

    if lines == "auto":
        return None
    if lines not in list(Numbering):
        raise UsageError(f"--lines {lines} is not known; give auto, {', '.join(Numbering)}")
    return Numbering(lines)


def _check_names(programs: list[Path]) -> None:
    """Raises UsageError for two programs that have the same name but for their endings: the processors know no endings."""
    from twin.vocabulary.program_names import program_key

    by_key: dict[str, Path] = {}
    for program in programs:
        other = by_key.setdefault(program_key(program.name), program)
        if other.resolve() != program.resolve():
            raise UsageError(f"{program}: {_one_name(other.name, program.name)}")


def _one_name(one: str, other: str) -> str:
    return (
        f"{one} and {other} are one program to the processors, which look it up without ending and leading zeros; "
        "rename one of them, or give each machine a folder of its own with --out"
    )


def _up_to_date(out: Path, machine: str, program: Path, source: str, version: str) -> "Expectation | None":
    """Return the expectation that is there already, if program and description are still those that it was worked out from.

    Raises UsageError where it is that of another file.
    """
    from twin.errors import ExpectationError
    from twin.expected.files import place_of, read_expectation, stale
    from twin.expected.making import text_sha256

    path = place_of(out, machine, program.stem)
    if not path.is_file():
        return None
    try:
        kept = read_expectation(path)
    except ExpectationError:
        return None
    if kept.file not in ("", program.name):
        raise UsageError(f"{path}: {_one_name(kept.file, program.name)}; if {kept.file} is gone, delete {path.name}")
    is_stale = kept.description != version or stale(kept, program_sha256=text_sha256(source)) is not None
    return None if is_stale else kept


def _shown(made: "Expectation", program: Path, path: Path | None, *, as_json: bool) -> dict[str, Any]:
    """Print what was made, or return it for a program to read. path: None where it was up to date."""
    from twin.expected.summary import summary_of

    summary = summary_of(made)
    answer = {
        "program": made.program,
        "machine": made.machine,
        "seconds": made.time_s,
        "tools": [one._asdict() for one in summary],
        "basis": made.basis,
        "out": None if path is None else str(path),
    }
    if as_json:
        return answer
    table = Table(title=f"{program.name} on {made.machine}: {made.time_s:.1f} s", title_justify="left")
    for column in ("tool", "time s", "lines", "peak load %", "greatest mean tangential force N", "lines without load"):
        table.add_column(column, justify="right")
    for one in summary:
        load = "–" if one.load_pct is None else f"{one.load_pct:.1f}"
        force = "–" if one.force_n is None else f"{one.force_n:.0f}"
        table.add_row(str(one.tool or "–"), f"{one.time_s:.1f}", str(one.lines), load, force, str(one.unknown or ""))
    console = standard_output()
    console.print(table)
    if any(one.force_n for one in summary):
        console.print(FORCE_NOTE, markup=False, highlight=False, soft_wrap=True)
    for sentence in made.basis:
        console.print(f"note: {sentence}", markup=False, highlight=False, soft_wrap=True)
    console.print("up to date" if path is None else f"in {path}", markup=False, highlight=False, soft_wrap=True)
    return answer
