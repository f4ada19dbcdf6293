"""The options of `cnctwin gap case` for run logs, and the questions on a terminal where they say nothing."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import typer

from cnctwin.composing.composed import Role
from cnctwin.composing.from_runs import Recording
from cnctwin.composing.guessed import kind_of
from cnctwin.errors import UsageError
from twin.case import RunKind
from twin.runlog import read_run

GUESS = "guess"


def recordings_of(runs: Sequence[Path], said: Mapping[str, Sequence[str]]) -> list[Recording]:
    """Return the recordings as the options say; on a terminal the rest is asked. Raises UsageError, RunLogError."""
    found = {path: Recording(path) for path in runs}
    if len(found) < len(runs):
        raise UsageError("a run log is named twice; name each once")
    for role in get_args(Role):
        for name in said[f"--{role}"]:
            path = _named(name, runs, f"--{role}")
            if found[path].role not in (None, role):
                raise UsageError(f"--{role} {name}: it is said to be {found[path].role} too; nothing is fitted that is judged on")
            found[path] = replace(found[path], role=role)
    for name in said["--healthy"]:
        path = _named(name, runs, "--healthy")
        found[path] = replace(found[path], healthy=True)
    for name, value in _pairs(said["--kind"], "--kind", "air, cut, warmup or program"):
        if value not in tuple(RunKind):
            raise UsageError(f"--kind {name}={value}: there is no such kind; it is air, cut, warmup or program")
        path = _named(name, runs, "--kind")
        found[path] = replace(found[path], kind=RunKind(value))
    for name, value in _pairs(said["--repeats"], "--repeats", "OTHER"):
        path = _named(name, runs, "--repeats")
        found[path] = replace(found[path], repeats=_named(value, runs, "--repeats").stem)
    for name, value in _pairs(said["--program"], "--program", "file.nc"):
        path = _named(name, runs, "--program")
        found[path] = replace(found[path], program=Path(value))
    recordings = list(found.values())
    is_silent = not any(said.values()) and sys.stdin.isatty() and sys.stderr.isatty()
    return [_asked(one) for one in recordings] if is_silent else recordings


def machine_file_of(given: Path | None) -> Path:
    """Return the file that describes the machine; on a terminal it is asked. Raises UsageError."""
    if given is not None:
        return given
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError("--machine machine.toml is missing: the case holds the twin as it stands")
    return Path(typer.prompt("The machine's description", default="machine.toml", err=True))


def _asked(one: Recording) -> Recording:
    """Ask for what a recording is; an empty answer leaves it to be guessed."""
    log = read_run(one.path)
    kind, why = kind_of(log, has_program=False)
    guess = f"{kind.value}: it has {why}" if kind is not None else "its columns do not tell"
    typer.echo(f"{one.path.name}: {log.t_s[-1] - log.t_s[0]:.0f} s, {len(log)} rows ({guess})", err=True)
    kinds, roles = [*(k.value for k in RunKind), *([GUESS] if kind else [])], [*get_args(Role), GUESS]
    answer = _choice("  kind", kinds, kind.value if kind else None)
    role = _choice("  role", roles, GUESS)
    healthy = typer.confirm("  was the twin right when it was made?", default=False, err=True)
    program = ""
    if answer == RunKind.PROGRAM:
        program = typer.prompt("  the NC file that it ran (empty: none)", default="", show_default=False, err=True)
    return replace(
        one,
        kind=None if answer == GUESS else RunKind(answer),
        role="fit" if role == "fit" else "check" if role == "check" else None,
        healthy=healthy,
        program=Path(program) if program else None,
    )


def _choice(what: str, words: Sequence[str], usual: str | None) -> str:
    """Ask until one of these words is the answer."""
    while True:
        answer = str(typer.prompt(f"{what} ({', '.join(words)})", default=usual, err=True)).strip()
        if answer in words:
            return answer
        typer.echo(f"  {answer} is none of them", err=True)


def _named(name: str, runs: Sequence[Path], option: str) -> Path:
    """Return the run log of this name, with or without folder and ending."""
    found = [path for path in runs if name in (str(path), path.name, path.stem)]
    if len(found) != 1:
        there = ", ".join(path.stem for path in runs)
        raise UsageError(
            f"{option} {name}: {'more than one run log has' if found else 'no run log has'} this name; there are {there}"
        )
    return found[0]


def _pairs(values: Sequence[str], option: str, right: str) -> list[tuple[str, str]]:
    """Return NAME and value of each."""
    found = []
    for value in values:
        name, equals, rest = value.partition("=")
        if not (name and equals and rest):
            raise UsageError(f"{option} {value}: write NAME={right}")
        found.append((name, rest))
    return found
