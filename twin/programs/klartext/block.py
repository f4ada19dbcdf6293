"""The words of a path block: `L X+10 IY-5 R0 F250 M3`, taken apart once and evaluated at every run."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

from twin.programs.klartext.numbers import VALUE, Expression, Store, value
from twin.programs.klartext.source import Source
from twin.programs.refusal import RefusedError

WORD: Final = re.compile(
    r"[ \t]*+(?:"
    r"(F[ \t]*+MAX|F[ \t]*+AUTO)(?![A-Z])"  # 1: a feed without a figure
    r"|(R0(?![0-9.,])|RL|RR)(?![A-Z])"  # 2: radius compensation
    r"|DR[ \t]*+([-+])(?![ \t]*+[0-9.,Q])"  # 3: sense of rotation
    r"|M[ \t]*+([0-9]{1,4}+)(?![0-9.,])"  # 4: M function
    r"|(MB[ \t]*+MAX)(?![A-Z])"  # 5: retract as far as it goes
    rf"|([A-Z][A-Z_]*?)[ \t]*+({VALUE})"  # 6, 7: a word and its value
    r"|([A-Z]++(?![0-9]))"  # 8: a word without one
    r"|(\S\S*+)"  # 9: anything else
    r")"
)
END: Final = re.compile(r"[ \t]*+")
AFTER_M: Final[Mapping[int, frozenset[str]]] = {
    103: frozenset("F"),
    112: frozenset({"T", "A"}),
    118: frozenset("XYZABC"),
    120: frozenset({"LA"}),
    124: frozenset("T"),
    128: frozenset("F"),
    138: frozenset("ABC"),
    140: frozenset({"MB", "F"}),
}
"""Words that belong to the M function that they follow, not to the block."""


class FeedKind(Enum):
    """The form of a feed."""

    FIGURE = "F"
    RAPID = "FMAX"
    AUTO = "F AUTO"
    PER_REVOLUTION = "FU"
    PER_TOOTH = "FZ"


class MFunction(NamedTuple):
    """An M function with the words that belong to it."""

    code: int
    words: Mapping[str, Expression]
    flags: frozenset[str]


@dataclass(slots=True)
class Block:
    """The contents of a path block.

    values: by name, incremental ones as IX; texts: as written; flags: words without a value
    compensation: R0, RL or RR; direction: of DR
    """

    values: dict[str, Expression] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    flags: set[str] = field(default_factory=set)
    compensation: str | None = None
    direction: int | None = None
    feed: FeedKind | None = None
    feed_value: Expression | None = None
    feed_text: str = ""
    m: list[MFunction] = field(default_factory=list)

    def value(self, store: Store, name: str) -> float | None:
        """Return the word's value, None where the block does not have it."""
        found = self.values.get(name)
        return None if found is None else found(store)

    def whole(self, store: Store, name: str, low: int, high: int) -> int | None:
        """Return the word's value as an integer; RefusedError where it is none in these bounds."""
        given = self.value(store, name)
        if given is None:
            return None
        if not given.is_integer() or not low <= given <= high:
            raise RefusedError(self.texts[name], f"has to be a whole number from {low} to {high}")
        return int(given)


def parse(source: Source, begin: int, allowed: frozenset[str], flags: frozenset[str] = frozenset()) -> Block:
    """Take apart the words behind the head of a block.

    begin: where they begin in the body
    allowed: names of words with a value; flags: of words without one. RefusedError for any other
    """
    block = Block()
    body, written = source.body, source.written
    at, owner = begin, 0
    while at < len(body):
        match = WORD.match(body, at)
        if match is None:
            break
        index = match.lastindex or 0
        first = match.start(6 if index == 7 else index) if index else at
        text = written[first : match.end()].strip() if index != 3 else written[at : match.end()].strip()
        at = match.end()
        if index == 7:
            name = match.group(6)
            if owner in AFTER_M and name in AFTER_M[owner]:
                last = block.m[-1]
                block.m[-1] = last._replace(words={**last.words, name: value(match.group(7), text)})
            else:
                owner = 0
                take_value(block, name, match.group(7), text, allowed)
        elif index == 4:
            owner = int(match.group(4))
            block.m.append(MFunction(owner, {}, frozenset()))
        elif index == 5 and owner == 140:
            block.m[-1] = block.m[-1]._replace(flags=frozenset({"MAX"}))
        else:
            if not (owner == 140 and index == 1):
                owner = 0
            head = written[begin:first]
            whole = begin + max(head.rfind(" "), head.rfind("\t")) + 1  # F3OO, of which F3 was read
            take_flag(block, match, index, text if index < 8 else written[whole:at].strip(), flags)
    return block


def take_value(block: Block, name: str, figures: str, text: str, allowed: frozenset[str]) -> None:
    if name in ("F", "FU", "FZ"):
        if block.feed is not None:
            raise RefusedError(text, "is a second feed in this block")
        block.feed, block.feed_value, block.feed_text = FEEDS[name], value(figures, text), text
        return
    if name not in allowed:
        raise RefusedError(text, "has no meaning in this block")
    if name in block.values:
        raise RefusedError(text, f"{name} stands twice in this block")
    block.values[name], block.texts[name] = value(figures, text), text


def take_flag(block: Block, match: re.Match[str], index: int, text: str, flags: frozenset[str]) -> None:
    if index == 1:
        block.feed = FeedKind.RAPID if "X" in match.group(1) else FeedKind.AUTO
        block.feed_text = text
    elif index == 2:
        block.compensation = match.group(2)
    elif index == 3:
        block.direction = 1 if match.group(3) == "+" else -1
    elif index == 8 and match.group(8) in flags:
        block.flags.add(match.group(8))
    else:
        raise RefusedError(text, "is not read here")


FEEDS: Final = {"F": FeedKind.FIGURE, "FU": FeedKind.PER_REVOLUTION, "FZ": FeedKind.PER_TOOTH}
