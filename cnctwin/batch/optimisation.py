"""Runs an optimisation and writes its files: for the command line, for a job, and for Python."""

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from cnctwin.files.output import write
from cnctwin.reports.optimisation.page import report_html
from twin.optimisation.answer import Objective, Optimised, SpeedChanges
from twin.optimisation.optimise import Hooks, Progress, Spread, optimise
from twin.optimisation.question import Question
from twin.vocabulary.program_names import ENDINGS

DEFAULTS = Question("", "")


@dataclass(frozen=True, slots=True)
class OptimiseRequest:
    """A request by a job or a command; None = the default of `twin.optimisation.question.Question`.

    encoding: of the program's file, in which it is written again
    """

    program_text: str
    machine_toml: str
    name: str = "program"
    objective: str = "time"
    force_limit_n: float | None = None
    probability: float | None = None
    seed: int = 1
    evolutions: int | None = None
    population: int | None = None
    speed_changes: str | None = None
    encoding: str = "utf-8"

    def question(self) -> Question:
        """The question. Raises OptimisationError where a figure is out of its range."""
        return Question(
            program_text=self.program_text,
            machine_toml=self.machine_toml,
            name=self.name,
            objective=Objective(self.objective),
            force_limit_n=self.force_limit_n,
            probability=self.probability,
            seed=self.seed,
            evolutions=DEFAULTS.evolutions if self.evolutions is None else self.evolutions,
            population=DEFAULTS.population if self.population is None else self.population,
            speed_changes=DEFAULTS.speed_changes if self.speed_changes is None else SpeedChanges(self.speed_changes),
        )


@dataclass(frozen=True, slots=True)
class Files:
    """The files that the answer goes into."""

    program: Path
    answer: Path
    report: Path
    encoding: str = "utf-8"

    @classmethod
    def beside(cls, program: Path, encoding: str = "utf-8") -> "Files":
        """optimised.nc, optimised.json and optimised.html."""
        return cls(program, program.with_suffix(".json"), program.with_suffix(".html"), encoding)


def optimise_request(
    request: OptimiseRequest,
    out: Path,
    *,
    progress: Progress = lambda _part, _what: None,
    spread: Spread = map,
    checkpoint: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Optimised:
    """The answer to a request: optimised.nc (or with the program's own ending), optimisation.json, report.html in folder `out`.

    checkpoint: written after every epoch, and gone on with where it is there

    Raises TwinError where the input is at fault or the limits leave a line nothing, UsageError where a file cannot be written,
    Stopped.
    """
    write(lambda: out.mkdir(parents=True, exist_ok=True), out)
    files = Files(out / f"optimised{_ending(request.name)}", out / "optimisation.json", out / "report.html", request.encoding)
    return run(request.question(), files, progress=progress, spread=spread, checkpoint=checkpoint, stop=stop)


def _ending(name: str) -> str:
    """Return the ending of a file with a part program; .nc where the name has none."""
    suffix = Path(name).suffix
    return suffix if suffix.casefold() in ENDINGS else ".nc"


def run(
    question: Question,
    files: Files,
    *,
    progress: Progress = lambda _part, _what: None,
    spread: Spread = map,
    checkpoint: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
    resimulate: bool = True,
) -> Optimised:
    """The answer to a question, written into its files. Raises as `optimise_request`."""

    def save(text: str) -> None:
        if checkpoint is not None:
            _write_whole(checkpoint, text)

    hooks = Hooks(spread=spread, progress=progress, save=save, stop=stop)
    answer = answer_to(question, hooks, _kept(checkpoint), resimulate=resimulate)
    write_answer(answer, files)
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return answer


def answer_to(question: Question, hooks: Hooks, checkpoint: str | None = None, *, resimulate: bool = True) -> Optimised:
    """The answer to a question, with the time that it took. Raises as `optimise_request`."""
    return optimise(question, replace(hooks, clock=time.monotonic), checkpoint, resimulate=resimulate)


def left_alone(lines: Iterable[int]) -> dict[int, str]:
    """Return lines (from 1) that may not be changed as a `Question` has them."""
    return {line - 1: "as asked" for line in lines}


def write_answer(answer: Optimised, files: Files) -> None:
    """Write an answer into its files. Raises UsageError where one cannot be written."""
    _write_whole(files.answer, json.dumps(answer.as_json()) + "\n")
    _write_whole(files.report, report_html(answer))
    _write_whole(files.program, answer.program, files.encoding)


def _write_whole(path: Path, text: str, encoding: str = "utf-8") -> None:
    """Writes a file whole or not at all, the ends of its lines as they are."""
    half = path.with_name(path.name + ".part")
    write(partial(half.write_text, text, encoding=encoding, newline=""), half)
    write(partial(half.replace, path), path)


def _kept(checkpoint: Path | None) -> str | None:
    """The checkpoint, if there is one that can be read."""
    if checkpoint is None:
        return None
    try:
        text = checkpoint.read_text(encoding="utf-8")
        return text if isinstance(json.loads(text), dict) else None
    except (OSError, ValueError, RecursionError):
        return None
