"""One line of a program, compiled once: skip level, block number, label, and what is behind them."""

import re
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings
from twin.programs.sinumerik.language.expressions import Expression, Reader, Variable, constant
from twin.programs.sinumerik.language.refused import FRAME_VARIABLES, REFUSED_WORDS, SYNCHRONISED
from twin.programs.sinumerik.language.statements import STATEMENTS
from twin.programs.sinumerik.language.syntax import (
    BLOCK_ADDRESSES,
    Assignment,
    Block,
    Invocation,
    Name,
    Nothing,
    Part,
    Statement,
    Word,
    Words,
)
from twin.programs.sinumerik.language.tokens import Kind, Token, tokenise

MODES: Final = frozenset({"AC", "IC", "DC", "ACP", "ACN"})
EXTENDED: Final = re.compile(r"([A-Z])([0-9]+)")
EXTENSIBLE: Final = frozenset("MSTDH")
SKIP_LEVEL_MAX: Final = 9
G_CODE_MAX: Final = 999


def parse(line: str, written: str, settings: Settings) -> Block:
    """Compile one line. RefusedError where it cannot be read."""
    reader = Reader(tokenise(line, written), settings.bracket_depth_max)
    skip = skip_level(reader)
    block_number = leading_number(reader)
    label = ""
    if reader.peek(1) == ":" and not reader.done and reader.tokens[reader.at].kind is Kind.NAME:
        label = reader.tokens[reader.at].name
        reader.at += 2
    return Block(statement(reader), skip, block_number, label)


def skip_level(reader: Reader) -> int | None:
    """`/` is level 0, `/5` level 5."""
    if not reader.taken("/"):
        return None
    if not reader.done and reader.tokens[reader.at].kind is Kind.NUMBER:
        token = reader.token()
        reader.at += 1
        if not (token.number.is_integer() and token.number <= SKIP_LEVEL_MAX):
            raise RefusedError("/" + token.text, "skip levels are /0 to /9")
        return int(token.number)
    return 0


def leading_number(reader: Reader) -> int | None:
    """N10, or :10 of a main block."""
    if reader.done:
        return None
    token = reader.tokens[reader.at]
    main = token.name == ":" and reader.at + 1 < len(reader.tokens) and reader.tokens[reader.at + 1].kind is Kind.NUMBER
    if main:
        reader.at += 1
        token = reader.tokens[reader.at]
    elif token.kind is not Kind.ADDRESS or token.name != "N":
        return None
    reader.at += 1
    if not token.number.is_integer() or token.number < 0:
        raise RefusedError(token.text, "a block number is a whole number")
    return int(token.number)


def statement(reader: Reader) -> Statement:
    """Return what stands behind number and label."""
    if reader.done:
        return Nothing()
    first = reader.tokens[reader.at]
    if first.kind is Kind.NAME and first.name in SYNCHRONISED:
        raise RefusedError(first.text, SYNCHRONISED[first.name])
    if first.kind is Kind.NAME and first.name in STATEMENTS and reader.peek(1) != "=":
        found = STATEMENTS[first.name](reader)
        if not reader.done:
            raise RefusedError(reader.token().text, "nothing may follow here; write it in a block of its own")
        return found
    if reader.taken("MCALL"):
        if reader.done:
            return Words((), cancels_modal=True)
        parts = words(reader)
        called = [part for part in parts if isinstance(part, Name | Invocation)]
        if len(parts) != 1 or len(called) != 1:
            raise RefusedError(first.text, "needs one cycle or subprogram, such as MCALL CYCLE81(...), in a block of its own")
        return Words((), modal=called[0])
    return Words(words(reader))


def words(reader: Reader) -> tuple[Part, ...]:
    parts: list[Part] = []
    while not reader.done:
        parts.append(part(reader))
    return tuple(parts)


def part(reader: Reader) -> Part:
    """The next word, name, call or assignment."""
    token = reader.token()
    reader.at += 1
    if token.kind is Kind.ADDRESS:
        return addressed(token)
    if token.kind is not Kind.NAME:
        raise RefusedError(token.text, "here has to stand a word, such as X10 or X=R1+5")
    if token.name in REFUSED_WORDS:
        raise RefusedError(token.text, REFUSED_WORDS[token.name])
    if token.name in FRAME_VARIABLES and reader.peek() in ("=", "[") and not is_frame_element(reader):
        raise RefusedError(
            token.text, "frames in variables are not read; write TRANS, ROT, SCALE, MIRROR, or set the work offset"
        )
    following = reader.peek()
    if following == "(":
        return Invocation(token.name, tuple(reader.arguments()), token.text)
    if following == "[":
        variable = reader.variable(token)
        reader.take("=")
        if token.name in BLOCK_ADDRESSES or (len(token.name) == 1 and token.name != "R"):
            if len(variable.index) != 1:
                raise RefusedError(token.text, "needs one index, such as M[1]=3")
            return valued(reader, token, token.name, variable.index[0])
        return assigned(reader, variable)
    if following == "=":
        reader.at += 1
        return equated(reader, token)
    return Name(token.name, token.text)


def is_frame_element(reader: Reader) -> bool:
    """Return True for `$P_UIFR[1,X,TR]`, one figure of a frame."""
    depth, commas = 0, 0
    for token in reader.tokens[reader.at :]:
        depth += (token.name == "[") - (token.name == "]")
        commas += token.name == "," and depth == 1
        if depth == 0:
            break
    return commas == 2


def addressed(token: Token) -> Part:
    """`X10`, `G1`, `M30`, `L100`."""
    if token.name == "G":
        code = token.number
        if not code.is_integer() or not 0 <= code <= G_CODE_MAX:
            raise RefusedError(token.text, "is no G code of this control")
        if f"G{int(code)}" in REFUSED_WORDS:
            raise RefusedError(token.text, REFUSED_WORDS[f"G{int(code)}"])
        return Name(f"G{int(code)}", token.text)
    if token.name == "L":
        return Name("L" + re.sub(r"[^0-9]", "", token.text), token.text)
    if token.name == "R":
        raise RefusedError(token.text, "a parameter stands before = or in a calculation, such as R1=5")
    if token.name == "N":
        raise RefusedError(token.text, "a block number stands at the beginning of its block")
    return Word(token.name, constant(token.number), token.text)


def equated(reader: Reader, token: Token) -> Part:
    """Return what stands behind `=`."""
    extended = EXTENDED.fullmatch(token.name)
    if extended is not None and extended[1] == "R":
        return assigned(reader, Variable("R", (constant(float(extended[2])),), token.text))
    if extended is not None and extended[1] in EXTENSIBLE:
        return valued(reader, token, extended[1], constant(float(extended[2])))
    if extended is not None or len(token.name) == 1 or token.name in BLOCK_ADDRESSES:
        if token.name in ("G", "N", "L", "R"):
            raise RefusedError(token.text, "needs its number in the text, such as G1")
        return valued(reader, token, token.name, None)
    return assigned(reader, Variable(token.name, (), token.text))


def valued(reader: Reader, token: Token, name: str, extension: Expression | None) -> Word:
    """A word with a value that is calculated, perhaps in AC() or IC()."""
    begin, mode = reader.at, ""
    if reader.peek() in MODES and reader.peek(1) == "(":
        mode = reader.peek()
        reader.at += 1
        given = reader.arguments()
        if len(given) != 1 or given[0] is None:
            raise RefusedError(mode, "needs one value")
        value: Expression = given[0]
    else:
        value = reader.expression()
    text = token.text + "=" + "".join(one.text for one in reader.tokens[begin : reader.at])
    return Word(name, value, text, mode, extension)


def assigned(reader: Reader, target: Variable) -> Assignment:
    """`=5`, `=SET(1,2,3)`, `=REP(0)`, or values in a row: `R[1]=1,2` is not read."""
    if reader.peek() in ("SET", "REP") and reader.peek(1) == "(":
        word = reader.token()
        reader.at += 1
        values = [value for value in reader.arguments() if value is not None]
        if not values:
            raise RefusedError(word.text, "needs values, such as SET(1,2,3)")
        return Assignment(target, tuple(values), is_set=True, is_repeated=word.name == "REP")
    return Assignment(target, (reader.expression(),))
