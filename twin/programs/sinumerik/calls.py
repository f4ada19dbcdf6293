"""Subprograms: found by name, called with arguments, ended by M17 or RET."""

from typing import Final

from twin.programs.called import NOT_AT_HAND
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.flow import Flow, Level
from twin.programs.sinumerik.language.expressions import Expression, Variable
from twin.programs.sinumerik.language.syntax import Procedure
from twin.programs.sinumerik.language.text import Section, Text

UNKNOWN: Final = f"there is no such subprogram, cycle or G code here; if it is a subprogram, {NOT_AT_HAND}"


def find(flow: Flow, name: str) -> tuple[Text, Section] | None:
    """The program of a name: in the running text, in the main text, or in a text of its own."""
    for text in (flow.level.text, flow.levels[0].text):
        if name in text.programs:
            return text, text.programs[name]
    if name not in flow.texts:
        given = flow.settings.called_text(name)
        if given is None:
            return None
        flow.texts[name] = Text(given, name)
    text = flow.texts[name]
    return text, text.programs.get(name, text.sections[0])


def call(
    flow: Flow,
    name: str,
    word: str,
    arguments: tuple[Expression | None, ...] = (),
    repeats: int = 1,
    is_modal: bool = False,
) -> None:
    """Begin a subprogram; the caller goes on behind its block."""
    found = find(flow, name)
    if found is None:
        raise RefusedError(word, UNKNOWN)
    flow.check_depth(len(flow.levels), word)
    if not 0 <= repeats <= flow.settings.repeats_max:
        raise RefusedError("P", f"repeats from 0 to {flow.settings.repeats_max} times")
    flow.count()
    given = tuple(None if one is None else one(flow.variables) for one in arguments)
    sources = tuple((one.name, one.at(flow.variables)) if isinstance(one, Variable) else None for one in arguments)
    text, section = found
    if repeats > 0:
        level = Level(text, section, section.start, {}, repeats - 1, given, sources, is_modal=is_modal)
        flow.levels.append(level)
        flow.variables.local = level.local


def procedure(flow: Flow, statement: Procedure) -> None:
    """PROC: its parameters become variables with the values of the call."""
    level = flow.level
    given = level.given or ()
    if len(given) > len(statement.parameters):
        raise RefusedError(statement.name, f"takes {len(statement.parameters)} arguments, and the call has {len(given)}")
    level.handed_back.clear()
    for place, one in enumerate(statement.parameters):
        sizes = tuple(size(flow.variables) for size in one.sizes)
        flow.variables.define(one.kind, one.name, sizes, one.text)
        value = given[place] if place < len(given) else None
        if value is not None:
            flow.variables.write(one.name, (), value, one.text)
        elif one.first is not None:
            flow.assign(one.first)
        if one.by_reference and place < len(level.sources):
            if level.sources[place] is None:
                raise RefusedError(one.text, "is VAR, and hands its value back: the call needs a variable there")
            level.handed_back.append((one.name, place))
    level.is_bound, level.saves = True, statement.saves


def need_procedure(level: Level) -> None:
    """RefusedError where a program that has no PROC was called with arguments."""
    if level.given and not level.is_bound:
        raise RefusedError("", "this program is called with arguments, and has no PROC to take them")
    level.is_bound = True


def returns(flow: Flow) -> bool:
    """End the running program; False where it is the main program."""
    if len(flow.levels) == 1:
        return False
    level = flow.level
    if level.repeats_left > 0:
        flow.count()
        level.repeats_left -= 1
        level.at = level.section.start
        level.local.clear()
        level.regions.clear()
        level.is_bound = False
        return True
    flow.levels.pop()
    flow.variables.local = flow.level.local
    for own, place in level.handed_back:
        source = level.sources[place]
        if source is not None:
            flow.variables.write(source[0], source[1], level.local[own].values[0], source[0])
    return True
