"""One block of a program: compiled once from its tokens, then run as often as the program passes it."""

from collections.abc import Callable
from enum import Enum, auto
from typing import Final

from twin.programs.fanuc.codes import GROUPS
from twin.programs.fanuc.expressions import Expression, Reader, Store, round_half_away
from twin.programs.fanuc.tokens import KEYWORD, NUMBER, NUMBER_MAX, OPERATOR, WORD, tokenise
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

LENGTH_LETTERS: Final = frozenset("XYZUVWABCIJKRQ")
REPEATABLE: Final = frozenset("IJK")


class Kind(Enum):
    """The kind of a block."""

    WORDS = auto()
    ASSIGN = auto()
    GOTO = auto()
    IF_GOTO = auto()
    IF_THEN = auto()
    WHILE = auto()
    END = auto()


class Words:
    """The words of a block with their values. Shared by all passes of a block without variables: nobody changes it.

    values: by letter, N, O, G and M left out; `texts` the same as written; `integers`: letters written without a point
    codes: G code times ten by its group, the last of a group counts; `written` the same as written; `order` of the groups
    m: M codes in order; corner: `,C` or `,R` with its size
    arguments: letter, value and whether it has no point, of each word in order, for G65
    """

    __slots__ = ("arguments", "codes", "corner", "integers", "m", "order", "texts", "values", "written")

    def __init__(self) -> None:
        self.values: dict[str, float] = {}
        self.texts: dict[str, str] = {}
        self.integers: set[str] = set()
        self.codes: dict[str, int] = {}
        self.written: dict[str, str] = {}
        self.order: list[str] = []
        self.m: list[int] = []
        self.corner: tuple[str, float, bool] | None = None
        self.arguments: list[tuple[str, float, bool]] = []

    def add(self, letter: str, value: float, text: str, integer: bool) -> None:
        """Take one more word; RefusedError where it cannot stand beside the others."""
        if letter == "G":
            self.add_g(value, text)
        elif letter == "M":
            if not value.is_integer() or value < 0:
                raise RefusedError(text, "an M code is a whole number")
            self.m.append(int(value))
        elif letter not in "NO:":
            self.arguments.append((letter, value, integer))
            if letter in self.values and letter not in REPEATABLE:
                raise RefusedError(text, f"{letter} stands twice in this block; write it once")
            self.values[letter] = value
            self.texts[letter] = text
            if integer:
                self.integers.add(letter)
            else:
                self.integers.discard(letter)

    def add_g(self, value: float, text: str) -> None:
        tenths = round(value * 10.0)
        group = GROUPS.get(tenths)
        if group is None or abs(value * 10.0 - tenths) > 1e-6:
            raise RefusedError(text, "this G code is not known; docs/reference/part-programs-fanuc.md lists those that are")
        if group == "once" and group in self.codes and self.codes[group] != tenths:
            raise RefusedError(text, f"cannot stand in one block with {self.written[group]}; write two blocks")
        self.codes[group] = tenths
        self.written[group] = text
        if group in self.order:
            self.order.remove(group)
        self.order.append(group)

    def integer(self, letter: str, low: int, high: int) -> int:
        """The value of a word that has to be a whole number from `low` to `high`."""
        value = self.values[letter]
        if not (value.is_integer() and low <= value <= high):
            raise RefusedError(self.texts[letter], f"has to be a whole number from {low} to {high}")
        return int(value)


class Template:
    """A word whose value is an expression. `rounds`: it is ROUND[...], which in a word means the least increment."""

    __slots__ = ("expression", "letter", "rounds", "text")

    def __init__(self, letter: str, expression: Expression, text: str, rounds: bool) -> None:
        self.letter, self.expression, self.text, self.rounds = letter, expression, text, rounds

    def value(self, store: Store, increment: float) -> float | None:
        value = self.expression(store)
        if value is not None and self.rounds:
            step = increment if self.letter in LENGTH_LETTERS else 1.0
            value = round_half_away(value / step) * step
        if value is not None and not -NUMBER_MAX <= value <= NUMBER_MAX:
            raise RefusedError(self.text, f"is {value:g}, more than a control can hold")
        return value


class Block:
    """kind; `words` where they are all plain; `parts` where some are not; `condition`, `target` and `value` of statements."""

    __slots__ = ("condition", "kind", "level", "parts", "target", "value", "words")

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.words: Words | None = None
        self.parts: list[tuple[str, float, str, bool] | Template] = []
        self.condition: Expression | None = None
        self.target: Callable[[Store], float] | None = None
        self.value: Expression | None = None
        self.level = 0

    def evaluated(self, store: Store, increment: float) -> Words:
        """The words with their values now. A word whose value is null is not there."""
        if self.words is not None:
            return self.words
        words = Words()
        for part in self.parts:
            if isinstance(part, Template):
                value = part.value(store, increment)
                if value is not None:
                    add_part(words, (part.letter, value, part.text, False))
            else:
                add_part(words, part)
        return words


def add_part(words: Words, part: tuple[str, float, str, bool]) -> None:
    letter, value, text, integer = part
    if letter[0] == ",":
        if words.corner is not None:
            raise RefusedError(text, "a block has one corner, ,C or ,R")
        words.corner = (letter[1], value, integer)
    else:
        words.add(letter, value, text, integer)


def without_skips(reader: Reader, settings: Settings) -> None:
    """Drop `/n` at any top-level place; where its switch is on, what follows it is no part of the block either."""
    kept, depth, at, tokens = [], 0, 0, reader.tokens
    while at < len(tokens):
        token = tokens[at]
        if token.kind == OPERATOR:
            depth += (token.name == "[") - (token.name == "]")
            before = tokens[at - 1] if at else None
            divides = before is not None and (before.name == "]" or before.kind == NUMBER)
            if token.name == "/" and depth == 0 and not divides:
                switch = 1
                if at + 1 < len(tokens) and tokens[at + 1].kind == NUMBER:
                    at += 1
                    if not (tokens[at].whole and 1 <= tokens[at].number <= 9):
                        raise RefusedError("/" + tokens[at].text, "block-skip switches are /1 to /9")
                    switch = int(tokens[at].number)
                if switch in settings.block_skip:
                    break
                at += 1
                continue
        kept.append(token)
        at += 1
    reader.tokens = kept


def parse(line: str, written: str, settings: Settings) -> Block | None:
    """Compile one line; None where nothing stands in it. RefusedError where it cannot be read."""
    reader = Reader(tokenise(line, written), settings.bracket_depth_max, settings.angle_signed)
    without_skips(reader, settings)
    while reader.at < len(reader.tokens) and reader.tokens[reader.at].kind == WORD:
        if reader.tokens[reader.at].name not in "NO:":
            break
        reader.at += 1
    if reader.at == len(reader.tokens):
        return None
    first = reader.tokens[reader.at]
    if first.kind == WORD or (first.kind == KEYWORD and len(first.name) == 1) or first.name == ",":
        return words_block(reader)
    block = statement(reader)
    if reader.at < len(reader.tokens):
        raise RefusedError(reader.tokens[reader.at].text, "nothing may follow here; write it in a block of its own")
    return block


def words_block(reader: Reader) -> Block:
    block = Block(Kind.WORDS)
    tokens = reader.tokens
    while reader.at < len(tokens):
        token = tokens[reader.at]
        comma = "," if token.name == "," else ""
        if comma:
            reader.at += 1
            token = tokens[reader.at] if reader.at < len(tokens) else token
            if token.name not in ("C", "R"):
                raise RefusedError(",", "a comma stands before C (chamfer) or R (rounding) only")
        if token.kind == WORD:
            block.parts.append((comma + token.name, token.number, comma + token.text, token.whole))
            reader.at += 1
        elif token.kind == KEYWORD and len(token.name) == 1:
            reader.at += 1
            start = reader.at
            rounds = next((t.name for t in tokens[start : start + 2] if t.name not in ("+", "-")), "") == "ROUND"
            expression = rounded_inside(reader) if rounds else reader.factor()
            text = comma + token.text + "".join(t.text for t in tokens[start : reader.at])
            block.parts.append(Template(comma + token.name, expression, text, rounds))
        else:
            raise RefusedError(token.text, "here has to stand a word, such as X1.5; calculations stand in [ ]")
    if not any(isinstance(part, Template) for part in block.parts):
        block.words = Words()
        for part in block.parts:
            if not isinstance(part, Template):
                add_part(block.words, part)
    return block


def rounded_inside(reader: Reader) -> Expression:
    """The argument of `ROUND[...]`, with its sign: the word rounds it to its own increment."""
    negative = False
    while (sign := reader.peek()) in ("+", "-"):
        negative, reader.at = negative != (sign == "-"), reader.at + 1
    reader.take("ROUND")
    inner = reader.bracket()
    return (lambda store: -(inner(store) or 0.0)) if negative else (lambda store: inner(store) or 0.0)


def statement(reader: Reader) -> Block:
    """Assignment, GOTO, IF, WHILE, DO, END."""
    name = reader.peek()
    if name == "#":
        return assignment(reader, Kind.ASSIGN)
    if name == "GOTO":
        return jump(reader, Kind.GOTO)
    if name == "IF":
        reader.at += 1
        condition = reader.bracket()
        if reader.peek() == "THEN":
            reader.at += 1
            block = assignment(reader, Kind.IF_THEN)
        elif reader.peek() == "GOTO":
            block = jump(reader, Kind.IF_GOTO)
        else:
            raise RefusedError("IF", "after its condition has to stand GOTO or THEN")
        block.condition = condition
        return block
    if name in ("WHILE", "DO", "END"):
        return loop(reader, name)
    token = reader.tokens[reader.at]
    raise RefusedError(token.text, "a block cannot begin with this; it begins with a word, #, IF, GOTO, WHILE, DO or END")


def assignment(reader: Reader, kind: Kind) -> Block:
    block = Block(kind)
    if reader.peek() != "#":
        raise RefusedError("THEN", "needs an assignment, such as THEN #1=2")
    block.target = reader.variable()
    reader.take("=")
    block.value = reader.expression()
    return block


def jump(reader: Reader, kind: Kind) -> Block:
    reader.take("GOTO")
    block = Block(kind)
    block.value = reader.factor()
    return block


def loop(reader: Reader, name: str) -> Block:
    block = Block(Kind.END if name == "END" else Kind.WHILE)
    if name == "WHILE":
        reader.at += 1
        block.condition = reader.bracket()
    if name != "END":
        reader.take("DO")
    else:
        reader.at += 1
    token = reader.tokens[reader.at] if reader.at < len(reader.tokens) else None
    if token is None or token.kind != NUMBER or token.number not in (1.0, 2.0, 3.0):
        raise RefusedError(name, "needs the number of the loop: 1, 2 or 3")
    block.level = int(token.number)
    reader.at += 1
    return block
