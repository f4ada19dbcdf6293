"""The basis of an expectation in words: what it rests on, and what is left out and why."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from twin.expected.expected import Run
from twin.expected.lines import IN_WORDS, Numbering
from twin.learned.words import LearnedSite
from twin.machine import MachineFile

LINES_SHOWN = 5


@dataclass(frozen=True, slots=True)
class Missing:
    """The reasons for loads that are not known → the lines. Reasons without a line hold for the program."""

    lines: dict[str, set[int]] = field(default_factory=dict)

    def add(self, why: str, line: int | None = None) -> None:
        """Note a reason, for a line."""
        found = self.lines.setdefault(why, set())
        if line is not None:
            found.add(line)

    def sentences(self) -> list[str]:
        """Return a sentence for each reason.

        >>> missing = Missing()
        >>> missing.add("goes down into material", 7)
        >>> missing.sentences()
        ['no load of 1 line (7): goes down into material']
        """
        said = []
        for why, lines in self.lines.items():
            shown = ", ".join(str(line) for line in sorted(lines)[:LINES_SHOWN]) + (", …" if len(lines) > LINES_SHOWN else "")
            is_of_all = not lines or why.startswith(("no ", "the path"))
            said.append(why if is_of_all else f"no load of {len(lines)} line{'s'[: len(lines) > 1]} ({shown}): {why}")
        return said


def in_words(
    machine: MachineFile, numbering: Numbering, runs: Sequence[Run], notes: Sequence[str], missing: Missing
) -> tuple[str, ...]:
    """Return the sentences: the numbering, what is taken in, the notes on the machine, and what is missing."""
    tools = sorted({run.tool for run in runs if run.tool})
    named = f", tools {', '.join(str(tool) for tool in tools)}" if tools else ""
    learned = []
    if any(section.site is LearnedSite.CUT_FORCE for section in machine.learned):
        learned.append("without the learned term of the cutting force")
    effects = [one.effect for one in machine.effects]
    with_effects = (
        [f"computed with these effects of the machine description: {', '.join(dict.fromkeys(effects))}"] if effects else []
    )
    return (IN_WORDS[numbering] + named, *with_effects, *dict.fromkeys(notes), *learned, *missing.sentences())
