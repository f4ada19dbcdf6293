"""A Klartext program (.H) as numbered blocks, and what in them concerns tools and the way through the program.

A block begins with its number; lines without one go on with the block before (`~` at the end of a line, cycle parameters). The
control numbers blocks 0, 1, 2, … from BEGIN PGM to END PGM; where the text that came does not, it is not whole, and nothing is
made of it. A text without any numbers is counted the same way.

>>> program = read_program("0 BEGIN PGM P MM\\n1 TOOL CALL 5 Z S8500\\n2 CALL LBL 3 REP 2\\n3 END PGM P MM\\n")
>>> program.blocks[1], [(step.kind.value, step.word) for step in program.steps]
('TOOL CALL 5 Z S8500', [('tool call', '5'), ('repeat', '3'), ('end', '')])
"""

import re
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

BLOCKS_MAX = 200_000
STEPS_MAX = 5_000
TEXT_LENGTH_MAX = 512
_NUMBERED = re.compile(r"(/?)(\d{1,7})(?:\s+(.*))?", re.ASCII)
_STRUCTURED = re.compile(r"(?:IF|WHILE|FOR|SWITCH|TRY|ELSE|CASE)\b")
_WORD = r'(?:"[^"]*"|[^\s;]+)'
_TOOL_CALL = re.compile(rf"TOOL CALL(?:\s+({_WORD}))?")
_SPEED = re.compile(r"\sS\s*([+-]?\d+(?:\.\d*)?|\+?-?Q\S+)")
_LABEL = re.compile(rf"LBL\s+({_WORD})")
_CALL = re.compile(rf"CALL LBL\s+({_WORD})(\s+REP)?")
_JUMP = re.compile(rf"FN ?\d+:\s*IF\b.*\bGOTO LBL\s+({_WORD})")
_PROGRAM = re.compile(r"CALL PGM\b|CALL SELECTED PGM\b|CYCL DEF 12\.1\b|PGM CALL\b")
_END = re.compile(r"(?:^|\s)M0?2(?:\s|$)|(?:^|\s)M30(?:\s|$)|^END PGM\b")


class Kind(Enum):
    """The effect of a block on the tool or on the way through the program."""

    TOOL_CALL = "tool call"
    LABEL = "label"
    CALL = "call"
    REPEAT = "repeat"
    JUMP = "jump"
    PROGRAM = "program call"
    END = "end"


@dataclass(frozen=True, slots=True)
class Step:
    """One block that matters. `word` is the tool or label as written; `may_skip`: the block can be skipped (/)."""

    number: int
    kind: Kind
    word: str = ""
    speed: str = ""
    may_skip: bool = False


@dataclass(frozen=True, slots=True)
class Program:
    """The text of each block by its number. `fault`: why the program cannot be followed, "" where it can."""

    blocks: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()
    fault: str = ""

    def block(self, number: int) -> str | None:
        """The text of this block, without its number."""
        return self.blocks[number] if 0 <= number < len(self.blocks) else None


@lru_cache(maxsize=8)
def read_program(text: str) -> Program:
    """Read a program. One that is not whole has no blocks, only a fault."""
    blocks, skips, fault = _blocks(text)
    if fault:
        return Program(fault=fault)
    steps: list[Step] = []
    for number, block in enumerate(blocks):
        code = _code(block)
        if _STRUCTURED.match(code):
            return Program(blocks, fault=f"block {number} is a structured jump, which is not followed")
        step = _step(number, code, number in skips)
        if step is not None:
            steps.append(step)
    if len(steps) > STEPS_MAX:
        return Program(blocks, fault=f"{len(steps)} labels and calls are more than the {STEPS_MAX} that are followed")
    return Program(blocks, tuple(steps))


def _blocks(text: str) -> tuple[tuple[str, ...], frozenset[int], str]:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    is_numbered = bool(lines) and _NUMBERED.fullmatch(lines[0]) is not None
    blocks: list[str] = []
    skips: set[int] = set()
    goes_on = False
    for line in lines:
        found = _NUMBERED.fullmatch(line) if is_numbered and not goes_on else None
        if found is not None or (not is_numbered and not goes_on):
            if found is not None and int(found[2]) != len(blocks):
                return (), frozenset(), f"block {found[2]} stands where {len(blocks)} should; the text is not whole"
            if len(blocks) >= BLOCKS_MAX:
                return (), frozenset(), f"more than {BLOCKS_MAX} blocks"
            if (found is not None and found[1]) or line.startswith("/"):
                skips.add(len(blocks))
            words = (found[3] or "") if found is not None else line.removeprefix("/").strip()
            blocks.append(words.removesuffix("~").strip()[:TEXT_LENGTH_MAX])
        elif blocks and len(blocks[-1]) < TEXT_LENGTH_MAX:
            blocks[-1] = f"{blocks[-1]} {line.removesuffix('~').strip()}"[:TEXT_LENGTH_MAX]
        goes_on = line.endswith("~")
    if not blocks or not blocks[0].startswith("BEGIN PGM") or not blocks[-1].startswith("END PGM"):
        return (), frozenset(), "no Klartext program from BEGIN PGM to END PGM"
    return tuple(blocks), frozenset(skips), ""


def _code(block: str) -> str:
    """Without the comment; a semicolon between quotes is none."""
    return re.sub(r'("[^"]*")|;.*', lambda found: found[1] or "", block).strip()


def _step(number: int, code: str, may_skip: bool) -> Step | None:
    if found := _TOOL_CALL.match(code):
        speed = _SPEED.search(code)
        word = found[1] or ""
        # `TOOL CALL Z S4000` and `TOOL CALL S4000` command a speed and no tool.
        word = "" if re.fullmatch(r"[XYZUVW]|[SF][+\d.Q-].*|D[LR]\d?[+-].*", word) else word
        return Step(number, Kind.TOOL_CALL, word, speed[1] if speed else "", may_skip)
    if found := _CALL.match(code):
        return Step(number, Kind.REPEAT if found[2] else Kind.CALL, found[1], "", may_skip)
    if found := _LABEL.match(code):
        return Step(number, Kind.LABEL, found[1])
    if found := _JUMP.match(code):
        return Step(number, Kind.JUMP, found[1])
    if _PROGRAM.search(code):
        return Step(number, Kind.PROGRAM, "", "", may_skip)
    if _END.search(code):
        return Step(number, Kind.END, "", "", may_skip)
    return None
