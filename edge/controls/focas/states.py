"""The meaning of a FANUC control's figures: execution, mode, overrides, and whether it works on a tool change."""

import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

from edge.sweep import Fact, Plain

_MODES = {0: "MANUAL_DATA_INPUT", 1: "AUTOMATIC", 3: "EDIT", 10: "AUTOMATIC"} | dict.fromkeys(range(4, 10), "MANUAL")
_STOPPED_BY = {0: "PROGRAM_STOPPED", 1: "OPTIONAL_STOP", 2: "PROGRAM_COMPLETED", 30: "PROGRAM_COMPLETED"}
_OTHER_STROBE = re.compile(r"(?<![A-Z])[TSB]\d")
_M_WORD = re.compile(r"(?<![A-Z])M\d")
_RAPID = {0: 100.0, 1: 50.0, 2: 25.0}


def mode_of(aut: Plain) -> str | None:
    """The mode selected, from ODBST.aut; None for one that has no word.

    >>> mode_of(1), mode_of(0), mode_of(5), mode_of(2)
    ('AUTOMATIC', 'MANUAL_DATA_INPUT', 'MANUAL', None)
    """
    return _MODES.get(aut) if isinstance(aut, int) else None


def execution_of(run: Plain, emergency: Plain, m_code: Plain) -> str | None:
    """Execution, from ODBST.run (0 reset, 1 stop, 2 hold, 3 start, 4 restart); why it stopped, from the M code that stands.

    >>> execution_of(3, 0, 3), execution_of(2, 0, 3), execution_of(1, 0, 1), execution_of(0, 0, 30), execution_of(3, 1, 3)
    ('ACTIVE', 'FEED_HOLD', 'OPTIONAL_STOP', 'PROGRAM_COMPLETED', 'STOPPED')
    """
    if emergency == 1:
        return "STOPPED"
    if run in (3, 4):
        return "ACTIVE"
    if run == 2:
        return "FEED_HOLD"
    if run == 1:
        return _STOPPED_BY.get(m_code, "STOPPED") if isinstance(m_code, int) else "STOPPED"
    if run == 0:
        return "PROGRAM_COMPLETED" if m_code in (2, 30) else "READY"
    return None


def feed_override_pct(g12: Plain) -> Plain:
    """The feed override that the panel asks for: G12 in negative logic, all ones and all zeros being 0 %.

    >>> feed_override_pct(0x9B), feed_override_pct(0xFF), feed_override_pct(0)
    (100, 0, 0)
    """
    return None if not isinstance(g12, int) else 0 if g12 in (0, 0xFF) else 0xFF - (g12 & 0xFF)


def rapid_override_pct(g14: Plain) -> float | None:
    """The rapid override from ROV1 and ROV2 of G14; None for F0, whose speed is a parameter.

    >>> rapid_override_pct(0), rapid_override_pct(2), rapid_override_pct(3)
    (100.0, 25.0, None)
    """
    return _RAPID.get(g14 & 3) if isinstance(g14, int) else None


class Cue(NamedTuple):
    """The tool change in progress, or not (None: the control does not tell), and what says so."""

    is_changing: bool | None
    why: str


class CueRule(NamedTuple):
    """The place of the cue. `bit`: the fact and the bit of the machine's builder, "" where there is none."""

    m_codes: Collection[int]
    strobe: str
    code: str
    bit_fact: str = ""
    bit: int = 0
    bit_name: str = ""

    @property
    def keys(self) -> tuple[str, ...]:
        """The facts that it looks at."""
        return tuple(filter(None, ("status.mstb", "modal.M", self.strobe, self.code, self.bit_fact)))


def cue_of(rule: CueRule, facts: Mapping[str, Fact]) -> Cue:
    """The builder's bit; else the strobe MF with its M code; else the M code that stands while the control is busy.

    The last is weaker: M6 stands until the next M code, so a T code that is called ahead looks the same but for its block.
    """
    if rule.bit_fact:
        byte = _whole(facts, rule.bit_fact)
        why = f"PMC {rule.bit_name}"
        return Cue(None, f"{why} is not told") if byte is None else _told(bool(byte >> rule.bit & 1), why)
    strobe, code = _whole(facts, rule.strobe), _whole(facts, rule.code)
    if strobe is not None and code is not None:
        return _told(bool(strobe & 1) and code in rule.m_codes, f"M{code} in progress")
    busy, m_code = _whole(facts, "status.mstb"), _whole(facts, "modal.M")
    if busy is None or m_code is None:
        return Cue(None, "the control does not tell its M code")
    block = facts.get("block", Fact("")).value
    return _told(busy != 0 and m_code in rule.m_codes and not _is_other_strobe(block), f"M{m_code} stands, busy")


def _told(is_changing: bool, why: str) -> Cue:
    return Cue(is_changing, why if is_changing else "no tool change in progress")


def _is_other_strobe(block: Plain) -> bool:
    """Return whether the block that runs has a T, S or B word and no M word: then that is what the control is busy with."""
    if not isinstance(block, str):
        return False
    line = first_line(block).upper()
    return bool(_OTHER_STROBE.search(line)) and not _M_WORD.search(line)


def first_line(block: str) -> str:
    """The block that runs, of a text that goes on with those after it.

    >>> first_line("N10 T7 M6;\\nG0 X1")
    'N10 T7 M6'
    """
    return block.strip().split("\n", 1)[0].strip().rstrip(";").rstrip()


def _whole(facts: Mapping[str, Fact], key: str) -> int | None:
    fact = facts.get(key)
    return fact.value if fact is not None and not fact.fault and type(fact.value) is int else None
