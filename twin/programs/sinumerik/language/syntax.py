"""The syntax of a block, once read: a list of parts that work together, or one statement that leads the program."""

from dataclasses import dataclass
from typing import Final

from twin.programs.sinumerik.language.expressions import Expression, Variable

BLOCK_ADDRESSES: Final = frozenset(
    {"CR", "AR", "AP", "RP", "TURN", "CHF", "CHR", "RND", "RNDM", "FRC", "FRCM", "ANG", "ANG1", "ANG2", "SPOS", "SPOSA", "ADIS"}
    | {"ADISPOS", "CTOL", "OTOL", "STOLF", "OFFN", "DISC", "RPL", "LIMS", "SF", "DITS", "DITE", "VELOLIM", "ACC", "OVR", "OVRRAP"}
    | {
        "I1",
        "J1",
        "K1",
        "FL",
        "FZ",
        "FB",
        "SCC",
        "POS",
        "POSA",
        "FA",
        "PO",
        "PL",
        "PW",
        "SD",
        "BNAT",
        "ENAT",
        "SVC",
        "DL",
        "VELOLIMA",
    }
    | {"DISR", "DISCL", "FAD", "A2", "B2", "C2", "A3", "B3", "C3", "A4", "B4", "C4", "A5", "B5", "C5", "LEAD", "TILT", "THETA"}
)
"""Addresses of more than one letter; any other name with `=` behind it is a variable."""


@dataclass(frozen=True, slots=True)
class Word:
    """An address with its value: `X10`, `X=IC(5)`, `M1=3`.

    name: in capitals, without the extension; mode: AC, IC, DC, ACP, ACN or ""; extension: the 1 of `M1=3`
    """

    name: str
    value: Expression
    text: str
    mode: str = ""
    extension: Expression | None = None


@dataclass(frozen=True, slots=True)
class Name:
    """A name by itself: a G code (`G1`, `SOFT`), or a subprogram."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Invocation:
    """A name with arguments, None where one is left out: a cycle, a subprogram, `MSG("...")`."""

    name: str
    arguments: tuple[Expression | None, ...]
    text: str


@dataclass(frozen=True, slots=True)
class Assignment:
    """`R1=5`, `_DEPTH[2]=R1`. values: several in SET(); repeated: REP() fills the array with them."""

    target: Variable
    values: tuple[Expression, ...]
    is_set: bool = False
    is_repeated: bool = False


Part = Word | Name | Invocation | Assignment


@dataclass(frozen=True, slots=True)
class Words:
    """A block of parts. modal: the invocation behind MCALL; cancels: MCALL by itself."""

    parts: tuple[Part, ...]
    modal: Name | Invocation | None = None
    cancels_modal: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """The target of a jump: a label, a block number, or a text made when it is run. direction: GOTOF, GOTOB, GOTO, GOTOC,
    GOTOS."""

    direction: str
    label: str = ""
    number: int | None = None
    made: Expression | None = None


@dataclass(frozen=True, slots=True)
class Jumps:
    """`GOTOF A`, `IF R1>5 GOTOF A IF R1>3 GOTOF B`: the first whose condition holds is taken."""

    choices: tuple[tuple[Expression | None, Target], ...]


@dataclass(frozen=True, slots=True)
class Case:
    """CASE ... OF 1 GOTOF A 2 GOTOF B DEFAULT GOTOF C"""

    value: Expression
    choices: tuple[tuple[Expression, Target], ...]
    otherwise: Target | None


@dataclass(frozen=True, slots=True)
class Structure:
    """A line of IF ... ELSE ... ENDIF, LOOP, FOR, WHILE or REPEAT ... UNTIL, by its first word.

    condition: of IF, WHILE and UNTIL; counter, first, last: of FOR
    """

    word: str
    condition: Expression | None = None
    counter: Variable | None = None
    first: Expression | None = None
    last: Expression | None = None


@dataclass(frozen=True, slots=True)
class Repeat:
    """REPEAT A, REPEAT A B, REPEATB A; times: P."""

    word: str
    begin: str
    end: str
    times: Expression | None


@dataclass(frozen=True, slots=True)
class Declared:
    """One variable of DEF, or one parameter of PROC: its type, the sizes of an array, and its first value.

    by_reference: VAR, which hands the value back
    """

    kind: str
    name: str
    sizes: tuple[Expression, ...] = ()
    first: Assignment | None = None
    by_reference: bool = False
    text: str = ""


@dataclass(frozen=True, slots=True)
class Definition:
    """DEF REAL A, B=5, C[3]=SET(1,2,3)"""

    declared: tuple[Declared, ...]


@dataclass(frozen=True, slots=True)
class Procedure:
    """PROC NAME(REAL A, VAR INT B) SAVE"""

    name: str
    parameters: tuple[Declared, ...]
    saves: bool


@dataclass(frozen=True, slots=True)
class CallByName:
    """CALL "NAME", PCALL NAME(...), EXTCALL "NAME": the name is made when it is run, or stands there."""

    name: Expression
    arguments: tuple[Expression | None, ...]
    text: str


@dataclass(frozen=True, slots=True)
class Return:
    """RET. M17 does the same in a block of words."""


@dataclass(frozen=True, slots=True)
class Nothing:
    """A line with nothing to run: empty, a label, EXTERN."""


Statement = Words | Jumps | Case | Structure | Repeat | Definition | Procedure | CallByName | Return | Nothing


@dataclass(frozen=True, slots=True)
class Block:
    """One line. skip: its level /0 to /9, None without; the label and the number are where jumps arrive."""

    statement: Statement
    skip: int | None = None
    number: int | None = None
    label: str = ""
