"""Composes a case from recordings: what nobody said of them is guessed by their columns, and said."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from cnctwin.composing.composed import Composed, ComposedRun, Role
from cnctwin.composing.guessed import is_repeat, kind_of
from cnctwin.composing.observable import observability
from cnctwin.composing.roles import FIT_PART
from cnctwin.composing.shared_motion import shared_motion
from cnctwin.composing.written import CASE_FILE, MACHINE_FILE, RUNS, case_toml, complete_or_absent
from cnctwin.errors import UsageError
from cnctwin.files.program_text import read_text
from processors.description import version_of
from twin.case import RunKind
from twin.machine import machine_from_toml
from twin.runlog import RunLog, read_run, write_run

DIVIDED_S_MIN = 60.0
ROWS_MIN = 10
"""A warm-up that is shorter, or would have a part with fewer rows, is not divided."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A run log in a file, and what is known of it. kind, role, repeats: None = to be guessed

    program: the NC file that it ran; repeats: name of the recording that it repeats; healthy: made when the twin was right
    """

    path: Path
    kind: RunKind | None = None
    role: Role | None = None
    program: Path | None = None
    repeats: str | None = None
    healthy: bool = False

    @property
    def name(self) -> str:
        """Its name without folder and ending, by which options name it."""
        return self.path.stem


@dataclass(frozen=True, slots=True, eq=False)
class _Read:
    """A recording that was read, with its kind, and the role that was said or that its name says."""

    recording: Recording
    log: RunLog
    kind: RunKind
    role: Role | None

    @property
    def name(self) -> str:
        """The name of the recording."""
        return self.recording.name


def compose_runs(recordings: Sequence[Recording], description: str, out: Path) -> Composed:
    """Write the case of these recordings into the folder `out`, which appears when it is complete, and return it.

    description: the text of the machine.toml

    Raises UsageError where a kind cannot be told or names are not clear, TwinError where a recording or the machine is wrong.
    """
    machine = machine_from_toml(description)
    notes: list[str] = []
    read = [_read(one, notes) for one in _distinct(recordings)]
    if not read:
        raise UsageError("there is no recording; name run logs, or a machine of a store")
    repeats = _repeats(read, notes)
    roles = _roles(read, repeats, notes)
    if "check" not in roles.values() and not any(one.kind is RunKind.WARMUP for one in read):
        notes.append("nothing is left to judge on: record another program too, or the same a third time")
    said = {one.name for one in read if one.recording.repeats is not None}
    repeats = {name: earlier for name, earlier in repeats.items() if name in said or roles[name] == roles[earlier]}
    read = _lined_up(read, repeats, notes)
    with complete_or_absent(out) as folder:
        runs: list[tuple[ComposedRun, RunLog]] = []
        for one in read:
            for stem, part, role in _parts(one, read, roles, repeats, notes):
                program = _program(one.recording, stem, folder)
                file = f"{RUNS}/{stem}.parquet"
                write_run(part, folder / file)
                lasted_s = round(float(part.t_s[-1] - part.t_s[0]), 6)
                earlier = repeats.get(one.name)
                runs.append(
                    (
                        ComposedRun(
                            file=file,
                            kind=one.kind,
                            role=role,
                            what=one.recording.path.name,
                            rows=len(part),
                            lasted_s=lasted_s,
                            program=program,
                            repeats=None if earlier is None else f"{RUNS}/{earlier}.parquet",
                            healthy=one.recording.healthy,
                        ),
                        part,
                    )
                )
        entries = tuple(run for run, _ in runs)
        name = out.absolute().name
        (folder / MACHINE_FILE).write_text(description, encoding="utf-8")
        (folder / CASE_FILE).write_text(case_toml(name, entries, notes), encoding="utf-8")
        effects = observability(machine, runs)
        return Composed(out, name, machine.machine.name, version_of(description), entries, effects, tuple(notes))


def _distinct(recordings: Sequence[Recording]) -> Sequence[Recording]:
    names = [one.name for one in recordings]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise UsageError(f"{twice}: two recordings have this name; rename one of them")
    for one in recordings:
        if one.repeats is not None and (one.repeats not in names or one.repeats == one.name):
            raise UsageError(f"{one.name} is said to repeat {one.repeats}, which is none of {', '.join(names)}; name another one")
    return recordings


def _read(one: Recording, notes: list[str]) -> _Read:
    log = read_run(one.path)
    log = replace(log, t_s=log.t_s - log.t_s[0])
    kind, why = kind_of(log, has_program=one.program is not None)
    role = one.role or _named_role(one.name)
    if role is not one.role:
        notes.append(f"{one.name} has the role {role}, by its name")
    if one.kind is not None:
        return _Read(one, log, one.kind, role)
    if kind is None:
        there = ", ".join(log.columns) or "no other columns"
        raise UsageError(
            f"{one.path}: its columns do not tell what it is ({there}); say --kind {one.name}=air, cut, warmup or program"
        )
    notes.append(f"{one.name} is taken for kind {kind.value}: it has {why}")
    return _Read(one, log, kind, role)


def _repeats(read: Sequence[_Read], notes: list[str]) -> dict[str, str]:
    """Return the recording that each repeats, by name: as said, else the first alike before it."""
    found: dict[str, str] = {}
    for n, one in enumerate(read):
        if one.recording.repeats is not None:
            found[one.name] = one.recording.repeats
            continue
        alike = (e for e in read[:n] if e.kind is one.kind and e.recording.healthy is one.recording.healthy)
        together = (e for e in alike if {one.role, e.role} != {"fit", "check"})
        first = next((e for e in together if is_repeat(one.log, e.log, one.kind) or shared_motion(e.log, one.log)), None)
        if first is not None:
            found[one.name] = first.name
            notes.append(f"{one.name} repeats {first.name}: they went through the same")
    return found


def _roles(read: Sequence[_Read], repeats: Mapping[str, str], notes: list[str]) -> dict[str, Role]:
    """Return the role of each. Where nothing says it, the last of a kind is the judge, before others one that nothing repeats."""
    found: dict[str, Role] = {one.name: one.role for one in read if one.role is not None}
    found |= {name: found[earlier] for name, earlier in repeats.items() if name not in found and earlier in found}
    for kind in dict.fromkeys(one.kind for one in read):
        names = [one.name for one in read if one.kind is kind]
        silent = [one.name for one in read if one.kind is kind and one.name not in found]
        first = [one.name for one in read if one.name in silent and one.name not in repeats and not one.recording.healthy]
        first.sort(key=lambda name: name not in repeats.values())
        stated = {found[name] for name in names if name in found}
        enough = 1 if "fit" in stated else 2
        judge = first[-1] if "check" not in stated and len(first) >= enough else None
        judges = {name for name in silent if judge is not None and judge in (name, repeats.get(name))}
        found |= {name: "check" if name in judges else "fit" for name in silent}
        if judge is not None:
            notes.append(f"{judge} is kept to judge on: it is the last of kind {kind.value}")
        elif "check" not in stated and (again := _one_too_many(silent, repeats)):
            found[again] = "check"
            notes.append(f"{again} is kept to judge on: another time, but no other motion; record one that goes through another")
    return found


def _one_too_many(names: Sequence[str], repeats: Mapping[str, str]) -> str | None:
    """Return the last of three or more recordings of the same, two of which are enough to tell what repeats."""
    followers = [name for name in names if name in repeats and name not in repeats.values()]
    return next((name for name in reversed(followers) if list(repeats.values()).count(repeats[name]) > 1), None)


def _lined_up(read: Sequence[_Read], repeats: Mapping[str, str], notes: list[str]) -> list[_Read]:
    """Return the recordings, those that repeat one another cut to the motion that they share."""
    by_name = {one.name: one for one in read}
    for first in dict.fromkeys(repeats.values()):
        logs = {name: by_name[name].log for name, earlier in repeats.items() if earlier == first}
        shared = {name: found for name, log in logs.items() if (found := shared_motion(by_name[first].log, log))}
        begin = max((s.one for s in shared.values()), default=0)
        end = min((s.one + s.rows for s in shared.values()), default=0)
        whole = all(s.one == s.other and len(logs[name]) == len(by_name[first].log) == s.rows for name, s in shared.items())
        if whole or end - begin < ROWS_MIN:
            continue
        cuts = {first: begin} | {name: begin - s.one + s.other for name, s in shared.items()}
        for name, row in cuts.items():
            one = by_name[name]
            by_name[name] = replace(one, log=_rows(one.log, slice(row, row + end - begin)))
        lasts_s = float(by_name[first].log.t_s[-1])
        notes.append(f"{', '.join(cuts)} did not begin at the same moment: they are cut to the {lasts_s:.3g} s that they share")
    return [by_name[one.name] for one in read]


def _named_role(name: str) -> Role | None:
    """Return the role that is a word of a name.

    >>> _named_role("air_fit_2"), _named_role("profit")
    ('fit', None)
    """
    words = re.split(r"[^a-z]+", name.casefold())
    return next((role for role in get_args(Role) if role in words), None)


def _parts(
    one: _Read, read: Sequence[_Read], roles: Mapping[str, Role], repeats: Mapping[str, str], notes: list[str]
) -> list[tuple[str, RunLog, Role]]:
    """Return stem, rows and role of each run that a recording becomes: a warm-up that nothing else judges is divided in time."""
    name, role = one.name, roles[one.name]
    whole = [(name, one.log, role)]
    warmups = [e for e in read if e.kind is RunKind.WARMUP and not e.recording.healthy]
    longest = max(warmups, key=lambda e: float(e.log.t_s[-1]), default=None)
    if one is not longest or any(roles[e.name] == "check" for e in warmups) or one.role is not None:
        return whole
    lasted_s = float(one.log.t_s[-1])
    if lasted_s < DIVIDED_S_MIN or name in repeats or name in repeats.values():
        return whole
    row = int(np.searchsorted(one.log.t_s, FIT_PART * lasted_s))
    if min(row, len(one.log) - row) < ROWS_MIN:
        return whole
    notes.append(f"{name} is divided in time: the first {one.log.t_s[row]:.0f} s are fitted, the rest is the judge")
    return [(f"{name}-fit", _rows(one.log, slice(0, row)), "fit"), (f"{name}-check", _rows(one.log, slice(row, None)), "check")]


def _rows(log: RunLog, rows: slice) -> RunLog:
    t_s = log.t_s[rows] - log.t_s[rows][0]
    columns = {n: v[rows] for n, v in log.columns.items()}
    return replace(log, t_s=t_s, columns=columns, text={n: v[rows] for n, v in log.text.items()})


def _program(recording: Recording, stem: str, folder: Path) -> str | None:
    if recording.program is None:
        return None
    file = f"{RUNS}/{stem}.nc"
    (folder / file).write_text(read_text(recording.program), encoding="utf-8", newline="")
    return file
