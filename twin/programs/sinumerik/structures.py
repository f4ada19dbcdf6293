"""IF ... ELSE ... ENDIF, LOOP, FOR, WHILE and REPEAT ... UNTIL: where the program goes on behind each of their lines."""

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.flow import Flow
from twin.programs.sinumerik.language.functions import as_number, is_true
from twin.programs.sinumerik.language.syntax import Structure


def structure(flow: Flow, statement: Structure) -> None:
    """Run a line of IF, LOOP, FOR, WHILE or REPEAT."""
    level, word = flow.level, statement.word
    span = level.text.span(level.section, level.at)
    holds = statement.condition is None or is_true(statement.condition(flow.variables), word)
    if word in ("ENDLOOP", "ENDWHILE", "ENDFOR") or (word == "UNTIL" and not holds):
        flow.count()
    if word == "IF":
        past = span.end if span.middle is None else span.middle
        level.at = level.at + 1 if holds else past + 1
    elif word == "ELSE":
        level.at = span.end + 1
    elif word == "FOR":
        counts(flow, statement, is_first=True)
        level.at = level.at + 1 if counts_on(flow, statement) else span.end + 1
    elif word == "ENDFOR":
        head = head_of(flow, span.begin)
        counts(flow, head, is_first=False)
        level.at = span.begin + 1 if counts_on(flow, head) else span.end + 1
    elif word == "WHILE":
        level.at = level.at + 1 if holds else span.end + 1
    elif word in ("ENDLOOP", "ENDWHILE"):
        level.at = span.begin
    elif word == "UNTIL":
        level.at = level.at + 1 if holds else span.begin + 1
    else:
        level.at += 1


def head_of(flow: Flow, line: int) -> Structure:
    block = flow.level.text.blocks.get(line)
    if block is None or not isinstance(block.statement, Structure):
        raise RefusedError("ENDFOR", "is reached without its FOR")
    return block.statement


def counts(flow: Flow, statement: Structure, is_first: bool) -> None:
    """Set the counter of FOR, or take it one on."""
    counter = statement.counter
    assert counter is not None and statement.first is not None
    at = counter.at(flow.variables)
    if is_first:
        flow.variables.write(counter.name, at, statement.first(flow.variables), counter.text)
    else:
        now = as_number(flow.variables.read(counter.name, at, counter.text), counter.text)
        flow.variables.write(counter.name, at, now + 1.0, counter.text)


def counts_on(flow: Flow, statement: Structure) -> bool:
    assert statement.counter is not None and statement.last is not None
    last = as_number(statement.last(flow.variables), "TO")
    return as_number(statement.counter(flow.variables), statement.counter.text) <= last
