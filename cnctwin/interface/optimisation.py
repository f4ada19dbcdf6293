"""Feed and spindle speed for each line of a part program, within the limits of the machine."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from cnctwin.batch.optimisation import Files, answer_to, left_alone, write_answer
from cnctwin.errors import UsageError
from cnctwin.files.called_programs import speaking
from cnctwin.interface.errors import one_tree
from cnctwin.interface.machine import machine_of
from cnctwin.interface.part_program import part_program
from cnctwin.reports.optimisation.page import report_html
from twin.machine import MachineFile
from twin.machine_toml import machine_to_toml
from twin.optimisation.answer import Bound, LineAnswer, Objective, SpeedChanges, Totals
from twin.optimisation.answer import Optimised as Answer
from twin.optimisation.optimise import Hooks
from twin.optimisation.question import Question

Word = TypeVar("Word", Objective, SpeedChanges)


@dataclass(frozen=True, slots=True, eq=False)
class Optimised:
    """An optimised program. answer: everything, typed; encoding: in which the program came, and is written again"""

    answer: Answer
    encoding: str = "utf-8"

    @property
    def text(self) -> str:
        """The program with its new feeds and speeds; all else stays as it was."""
        return self.answer.program

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        return self.answer.sentence

    @property
    def before(self) -> Totals:
        """Time, cost, force, power, torque and chip of the program as it came."""
        return self.answer.before

    @property
    def after(self) -> Totals:
        """The same of the program as it is now; `over` is the number of lines above a limit."""
        return self.answer.after

    @property
    def bound(self) -> Bound:
        """The figure that no program within the limits can beat, and how far this one is from it."""
        return self.answer.bound

    @property
    def lines(self) -> tuple[LineAnswer, ...]:
        """Each line that cuts or feeds, before and after, and which limit binds it."""
        return self.answer.lines

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what a person should know of this answer."""
        return self.answer.notes

    @property
    def report_html(self) -> str:
        """The report, one page."""
        return report_html(self.answer)

    def as_json(self) -> dict[str, Any]:
        """Everything but the program's text, for a program to read."""
        return self.answer.as_json()

    def write(self, path: str | Path) -> None:
        """Write the program, and its report and answer beside it as .html and .json, as `cnctwin optimise` does.

        Raises UsageError where that cannot be done.
        """
        out = Path(path)
        if out.suffix in (".json", ".html", ".toml"):
            raise UsageError(f"{out}: write the program under another name, as optimised.nc; its .json and .html go beside it")
        write_answer(self.answer, Files.beside(out, self.encoding))


def optimise(
    program: str | Path,
    machine: MachineFile | str | Path,
    *,
    objective: Literal["time", "cost", "pareto"] = "time",
    force_limit_n: float | None = None,
    probability: float | None = None,
    speed_changes: Literal["anywhere", "in_air", "per_tool"] = "anywhere",
    leave: Iterable[int] = (),
    seed: int = 1,
    evolutions: int = 60,
    population: int = 64,
    islands: int = 2,
    resimulate: bool = True,
    progress: Callable[[float, str], None] | None = None,
) -> Optimised:
    """Optimise a part program on a machine.

    program: a Path is a file, a str the text itself; machine: as `read_machine` gives it, or the name of its file
    force_limit_n: None = that of [limits]; probability: keep it with this probability, None = with the constants as stated
    speed_changes: where the spindle may change its speed; leave: lines (from 1) that stay as they are
    seed, evolutions, population, islands: of the search; resimulate: run both programs on the whole twin, too
    progress: is told the part that is done, 0 to 1, and what is being done

    Raises LimitsError where no feed and speed keep the limits, ProgramError, MachineError, UsageError.
    """
    described, read = machine_of(machine), part_program(program)
    if isinstance(program, Path):
        described = speaking(described, program, read.text)
    wanted = _word(Objective, "objective", objective)
    changes = _word(SpeedChanges, "speed_changes", speed_changes)
    with one_tree(str(program) if isinstance(program, Path) else read.name):
        question = Question(
            program_text=read.text,
            machine_toml=machine_to_toml(described),
            name=read.name,
            objective=wanted,
            force_limit_n=force_limit_n,
            probability=probability,
            seed=seed,
            evolutions=evolutions,
            population=population,
            islands=islands,
            left_alone=left_alone(leave),
            speed_changes=changes,
        )
        answer = answer_to(question, Hooks(progress=progress or (lambda _part, _what: None)), resimulate=resimulate)
    return Optimised(answer, read.encoding)


def _word(words: type[Word], name: str, given: str) -> Word:
    try:
        return words(given)
    except ValueError:
        raise UsageError(f"{name} {given!r}: is not known; it is one of {', '.join(words)}") from None
