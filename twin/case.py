"""A case: the twin as it stands, and what the real machine did (formats, section 5)."""

import tomllib
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from twin.errors import CaseError
from twin.machine import MachineFile, Section, read_machine
from twin.runlog import RunLog, read_run
from twin.vocabulary.faults import faults_of, report


class RunKind(StrEnum):
    """The kind of run: what the machine did."""

    AIR = "air"
    CUT = "cut"
    WARMUP = "warmup"
    PROGRAM = "program"


class RunEntry(Section):
    """[[runs]]"""

    file: str
    kind: RunKind
    role: Literal["fit", "check"]
    program: str | None = None
    repeats: str | None = None
    healthy: bool = False


class CaseTable(Section):
    """[case]. assumed: columns that nobody recorded and somebody stated, as the surroundings of a warm-up"""

    name: str
    machine: str
    assumed: tuple[str, ...] = ()


class CaseFile(Section):
    """case.toml"""

    case: CaseTable
    runs: tuple[RunEntry, ...] = Field(min_length=1)


@dataclass(frozen=True)
class Run:
    """A run of the case, read when it is first asked for."""

    entry: RunEntry
    folder: Path

    @cached_property
    def log(self) -> RunLog:
        """Its recording. Raises RunLogError where it cannot be read."""
        return read_run(self.folder / self.entry.file)

    @property
    def name(self) -> str:
        """Its file, as the case names it."""
        return self.entry.file


@dataclass(frozen=True)
class RunAtHand(Run):
    """A run whose recording is at hand, in no file or mended."""

    recording: RunLog

    @property
    def log(self) -> RunLog:
        """Its recording."""
        return self.recording


@dataclass(frozen=True, slots=True)
class Case:
    """The question: a machine and runs of it. assumed: columns of the runs that nobody recorded"""

    name: str
    machine: MachineFile
    runs: tuple[Run, ...]
    assumed: tuple[str, ...] = ()

    def of(self, kind: RunKind | None = None, role: str | None = None) -> tuple[Run, ...]:
        """The runs of a kind and a role."""
        return tuple(r for r in self.runs if kind in (None, r.entry.kind) and role in (None, r.entry.role))

    def repeats(self) -> tuple[tuple[Run, Run], ...]:
        """Pairs of runs of the same program."""
        by_name = {run.name: run for run in self.runs}
        return tuple((by_name[run.entry.repeats], run) for run in self.runs if run.entry.repeats in by_name)


def read_case(folder: Path) -> Case:
    """The case in `folder`.

    Raises CaseError or MachineError naming file, key and value of the first fault; a run that is not there is one.
    """
    path = folder / "case.toml" if folder.is_dir() else folder
    try:
        file = CaseFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}; a case is a folder with a case.toml") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CaseError(f"{path}: is not TOML: {error}") from None
    except ValidationError as error:
        faults = faults_of([dict(fault) for fault in error.errors(include_url=False)], CaseFile)
        raise CaseError(report(path, faults)) from None
    for entry in file.runs:
        for named in (entry.file, entry.repeats, entry.program):
            if named is not None and not (path.parent / named).is_file():
                raise CaseError(f"{path}: {named} is not there")
    runs = tuple(Run(entry, path.parent) for entry in file.runs)
    return Case(file.case.name, read_machine(path.parent / file.case.machine), runs, file.case.assumed)
