"""The diagnosis of a case: where twin and recordings differ, what causes it, and the twin with the causes in it."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cnctwin.batch.diagnosis import FILES, diagnosis_files, in_threads, write_files
from cnctwin.interface.errors import one_tree
from twin.case import read_case
from twin.gap.diagnosis import Cause, Cell, GapNumbers, NextExperiment, Verdict
from twin.gap.diagnosis import Diagnosis as Answer
from twin.machine import MachineFile


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """A diagnosis.

    answer: all of diagnosis.json, typed; twin: the machine with its constants refitted and the causes added
    report_html, twin_toml, diagnosis_json: the texts of the files that `cnctwin gap diagnose` writes
    """

    answer: Answer
    twin: MachineFile
    report_html: str
    twin_toml: str
    diagnosis_json: str

    @property
    def verdict(self) -> Verdict:
        """Return the verdict on the gap: healthy, explained, partly_explained or unknown."""
        return self.answer.verdict

    @property
    def sentence(self) -> str:
        """The verdict in a sentence."""
        return self.answer.sentence

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The effects that were found, largest share first, each with its parameters and their 90 % intervals."""
        return self.answer.causes

    @property
    def gap(self) -> GapNumbers:
        """The gap before and after, over what repeats, of all signals and by signal."""
        return self.answer.gap

    @property
    def where(self) -> tuple[Cell, ...]:
        """Return where the gap lies: signal and regime, largest share first."""
        return self.answer.where

    @property
    def next_experiment(self) -> NextExperiment | None:
        """A short program that would tell what these recordings cannot; None where there is none."""
        return self.answer.next_experiment

    def as_json(self) -> dict[str, Any]:
        """Everything, for a program to read: diagnosis.json, parsed."""
        values: dict[str, Any] = json.loads(self.diagnosis_json)
        return values

    def write(self, folder: str | Path) -> None:
        """Write diagnosis.json, report.html and twin.toml into a folder, as `cnctwin gap diagnose` does. Raises UsageError."""
        texts = (self.diagnosis_json, self.report_html, self.twin_toml)
        write_files(dict(zip(FILES, texts, strict=True)), Path(folder))


def diagnose(case: str | Path, *, progress: Callable[[str], None] | None = None) -> Diagnosis:
    """Diagnose the case in a folder (docs/how-to/cases.md).

    progress: is told what is being done, from whichever thread does it

    Raises CaseError, MachineError, RunError.
    """
    with one_tree():
        recorded = read_case(Path(case))
        found = in_threads(recorded, progress or (lambda _: None))
        answer, report, toml = diagnosis_files(found, recorded.name).values()
    return Diagnosis(found.diagnosis, found.twin, report, toml, answer)
