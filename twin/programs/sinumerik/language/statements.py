"""Statements that lead a program: jumps, CASE, structures, repetitions, DEF, PROC, calls by name. Each reads its own block."""

from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.expressions import Expression, Reader, Variable, constant
from twin.programs.sinumerik.language.syntax import (
    Assignment,
    CallByName,
    Case,
    Declared,
    Definition,
    Jumps,
    Nothing,
    Procedure,
    Repeat,
    Return,
    Statement,
    Structure,
    Target,
)
from twin.programs.sinumerik.language.tokens import Kind

DIRECTIONS: Final = frozenset({"GOTO", "GOTOF", "GOTOB", "GOTOC", "GOTOS"})
TYPES: Final = frozenset({"REAL", "INT", "BOOL", "CHAR", "STRING", "AXIS"})
QUALIFIERS: Final = frozenset({"CHAN", "NCK", "SYNR", "SYNW", "SYNRW", "DYNAMIC", "PHYS"})
ATTRIBUTES: Final = frozenset({"SAVE", "DISPLOF", "DISPLON", "ACTBLOCNO", "SBLOF", "SBLON", "ICYCOF", "ICYCON", "PREPRO"})
CHOICES_MAX: Final = 100


def jump(reader: Reader) -> Target:
    """`GOTOF LABEL`, `GOTOB N100`, `GOTOF "LAB"<<R1`, `GOTOS`."""
    token = reader.token()
    if token.name not in DIRECTIONS:
        raise RefusedError(token.text, "here has to stand GOTOF, GOTOB, GOTO or GOTOC")
    reader.at += 1
    if token.name == "GOTOS":
        return Target(token.name)
    aim = reader.token()
    if aim.kind is Kind.ADDRESS and aim.name == "N" and aim.number.is_integer():
        reader.at += 1
        return Target(token.name, number=int(aim.number))
    if aim.kind is Kind.NAME and reader.peek(1) not in ("<<", "["):
        reader.at += 1
        return Target(token.name, label=aim.name)
    return Target(token.name, made=reader.expression())


def jumps(reader: Reader) -> Statement:
    return Jumps(((None, jump(reader)),))


def branch(reader: Reader) -> Statement:
    """IF: with a jump behind it, or the first line of IF ... ENDIF."""
    choices: list[tuple[Expression | None, Target]] = []
    while reader.taken("IF"):
        condition = reader.expression()
        if reader.peek() not in DIRECTIONS:
            if choices:
                raise RefusedError("IF", "needs a jump behind its condition, as the IF before it")
            return Structure("IF", condition)
        choices.append((condition, jump(reader)))
        if len(choices) > CHOICES_MAX:
            raise RefusedError("IF", f"more than {CHOICES_MAX} in one block")
    return Jumps(tuple(choices))


def case(reader: Reader) -> Statement:
    reader.take("CASE")
    value = reader.expression()
    reader.take("OF")
    choices: list[tuple[Expression, Target]] = []
    while not reader.done and reader.peek() != "DEFAULT":
        choices.append((reader.factor(), jump(reader)))
        if len(choices) > CHOICES_MAX:
            raise RefusedError("CASE", f"has more than {CHOICES_MAX} values")
    otherwise = jump(reader) if reader.taken("DEFAULT") else None
    return Case(value, tuple(choices), otherwise)


def simple(reader: Reader) -> Statement:
    """ELSE, ENDIF, LOOP, ENDLOOP, ENDFOR, ENDWHILE."""
    word = reader.peek()
    reader.at += 1
    return Structure(word)


def conditional(reader: Reader) -> Statement:
    """WHILE, UNTIL."""
    word = reader.peek()
    reader.at += 1
    return Structure(word, reader.expression())


def counted(reader: Reader) -> Statement:
    """FOR R1=1 TO 5"""
    reader.take("FOR")
    counter = variable(reader)
    reader.take("=")
    first = reader.expression()
    reader.take("TO")
    return Structure("FOR", counter=counter, first=first, last=reader.expression())


def variable(reader: Reader) -> Variable:
    found = reader.primary()
    if isinstance(found, Variable):
        return found
    raise RefusedError(reader.tokens[reader.at - 1].text, "here has to stand a variable")


def repeat(reader: Reader) -> Statement:
    """REPEAT by itself begins REPEAT ... UNTIL; with labels it runs their blocks again."""
    word = reader.peek()
    reader.at += 1
    if reader.done:
        if word == "REPEATB":
            raise RefusedError(word, "needs the label of the block to repeat")
        return Structure("REPEAT")
    begin = reader.name("a label")
    end = ""
    times: Expression | None = None
    if not reader.done and reader.tokens[reader.at].kind is Kind.NAME and reader.peek() != "P":
        end = reader.name("a label")
    if not reader.done:
        token = reader.token()
        if token.kind is Kind.ADDRESS and token.name == "P":
            reader.at += 1
            times = constant(token.number)
        else:
            reader.take("P")
            reader.take("=")
            times = reader.expression()
    return Repeat(word, begin, end, times)


def define(reader: Reader) -> Statement:
    reader.take("DEF")
    while reader.peek() in QUALIFIERS:
        reader.at += 1
    kind = type_name(reader)
    declared = [declaration(reader, kind)]
    while reader.taken(","):
        declared.append(declaration(reader, kind))
    return Definition(tuple(declared))


def type_name(reader: Reader) -> str:
    token = reader.token()
    kind = reader.name("a type")
    if kind not in TYPES:
        raise RefusedError(token.text, f"this type is not read; read are {', '.join(sorted(TYPES))}")
    if kind == "STRING" and reader.taken("["):
        reader.expression()
        reader.take("]")
    return kind


def declaration(reader: Reader, kind: str, by_reference: bool = False) -> Declared:
    token = reader.token()
    name = reader.name("the name of a variable")
    if len(name) < 2 or name[1].isdigit():
        raise RefusedError(token.text, "the name of a variable begins with two letters; one letter is an address")
    found = reader.variable(token)
    first = None
    if reader.taken("="):
        target = Variable(name, (), token.text)
        if reader.peek() in ("SET", "REP") and reader.peek(1) == "(":
            word = reader.name("SET")
            values = tuple(value for value in reader.arguments() if value is not None)
            first = Assignment(target, values, is_set=True, is_repeated=word == "REP")
        else:
            first = Assignment(target, (reader.expression(),))
    return Declared(kind, name, found.index, first, by_reference, token.text)


def procedure(reader: Reader) -> Statement:
    """PROC NAME(REAL A, VAR INT B) SAVE DISPLOF"""
    reader.take("PROC")
    name = reader.name("the name of the program")
    parameters: list[Declared] = []
    if reader.taken("(") and not reader.taken(")"):
        while True:
            by_reference = reader.taken("VAR")
            parameters.append(declaration(reader, type_name(reader), by_reference))
            if reader.taken(")"):
                break
            reader.take(",")
    saves = False
    while reader.peek() in ATTRIBUTES:
        saves = saves or reader.peek() == "SAVE"
        reader.at += 1
    return Procedure(name, tuple(parameters), saves)


def external(reader: Reader) -> Statement:
    """EXTERN says what a PROC says itself: passed over."""
    reader.at = len(reader.tokens)
    return Nothing()


def call(reader: Reader) -> Statement:
    """CALL "NAME", EXTCALL "NAME", PCALL NAME(1,2)"""
    token = reader.token()
    reader.at += 1
    if reader.peek() == "BLOCK" or reader.done:
        raise RefusedError(token.text, 'is read with the name of a program only, such as CALL "SUB1"')
    if token.name == "PCALL" and reader.tokens[reader.at].kind is Kind.NAME:
        name = reader.name("a program")
        arguments = tuple(reader.arguments()) if reader.peek() == "(" else ()
        return CallByName(lambda store: name, arguments, token.text)
    if token.name == "EXTCALL" and reader.peek() == "(":
        given = reader.arguments()
        if len(given) != 1 or given[0] is None:
            raise RefusedError(token.text, "needs the name of one program")
        return CallByName(given[0], (), token.text)
    return CallByName(reader.expression(), (), token.text)


def returns(reader: Reader) -> Statement:
    word = reader.token()
    reader.at += 1
    if reader.peek() == "(":
        raise RefusedError(word.text, "is read without arguments only")
    return Return()


STATEMENTS: Final[Mapping[str, Callable[[Reader], Statement]]] = {
    **dict.fromkeys(DIRECTIONS, jumps),
    "IF": branch,
    "CASE": case,
    **dict.fromkeys(("ELSE", "ENDIF", "LOOP", "ENDLOOP", "ENDFOR", "ENDWHILE"), simple),
    **dict.fromkeys(("WHILE", "UNTIL"), conditional),
    "FOR": counted,
    **dict.fromkeys(("REPEAT", "REPEATB"), repeat),
    "DEF": define,
    "PROC": procedure,
    "EXTERN": external,
    **dict.fromkeys(("CALL", "PCALL", "EXTCALL"), call),
    "RET": returns,
    "ENDLABEL": external,
}
