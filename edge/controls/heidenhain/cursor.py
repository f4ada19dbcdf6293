"""The parser of the HEIDENHAIN edge: looks in, samples out, without I/O.

Most facts feed one signal each. The line and the text of the program give two more: `nc_block` is the text of the running
block, and where the control does not tell the tool, `tool_number` is what the TOOL CALLs before that block say (`tool_flow`).

The tool from the text. Where every way through the program brings the same tool to the block that runs, that is the tool. Where
they differ (a label that is called with several tools), or where none has come yet, it is the one that this edge saw last, as
long as it has not looked away since: a tool call takes longer than a look, so none can have been missed. Else the tool is not
known, and `tool_number` is null with the reason. A program that is started in its middle is believed only from its next TOOL
CALL on.

While a running block is a TOOL CALL of another tool, the change is in progress (`tool_change_cue`); a PLC bit, where there is
one, says so better.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from edge.config import SignalSection
from edge.controls.heidenhain.config import TOOL_CHANGE, Config, ToolSource
from edge.controls.heidenhain.klartext import Kind, read_program
from edge.controls.heidenhain.meaning import ONLY_PLC, chosen_of, in_words, signal_of, source_of, target_of
from edge.controls.heidenhain.tool_flow import BEFORE, PROGRAM_CALLED, Token, Tokens, flow_of, speed_of, tool_of
from edge.controls.heidenhain.tool_table import FEEDS, NOT_READ, ToolTable, nulls, read_table
from edge.place import Place
from edge.reading import Target, bad, read_value
from edge.sample import UNAVAILABLE, Drop, EdgeSample, Offer, SampleSet, observations_of
from edge.sweep import Fact, Plain, Sweep, SweepPosition, take
from edge.tool_change import CUE
from sparkplug.quality import Quality
from twin.vocabulary.signals import Kind as SignalKind

TEXTS_MAX = 2
RUNNING = 0
GOES_ON = (RUNNING, 1, 4)  # running, stopped or interrupted: the program is at this block
STARTED_INSIDE = "the program was started after its TOOL CALL, in block"
NO_SOURCE = "no telegram of LSV2 tells it; name its PLC address in [heidenhain.plc]"  # how: docs/how-to/edge-heidenhain.md


@dataclass(frozen=True, slots=True)
class Cursor:
    """The parser's position. `texts`: path and text of the programs; `tool`, `speed`: what was seen last, None: not known.

    `unknown`: why the tool is not known; `state`: of the program in the last look; `at_call`: whether that was in a running TOOL
    CALL; `offers`: what was declared; `table`: the control's tools.
    """

    position: SweepPosition = field(default_factory=SweepPosition)
    texts: tuple[tuple[str, str, str], ...] = ()
    tool: int | str | None = None
    speed: float | None = None
    unknown: str = ""
    state: int | None = None
    at_call: bool = False
    offers: tuple[Offer, ...] = ()
    table: ToolTable = NOT_READ


class Look(NamedTuple):
    """One look as it is being taken: its facts by key; `is_baseline`: what it shows was found, and did not happen now."""

    config: Config
    sweep: Sweep
    facts: Mapping[str, Fact]
    is_baseline: bool


class Where(NamedTuple):
    """The running program's position in a look; `block` None: the text of the block is not known, for the reason `fault`."""

    state: Plain
    line: int | None
    block: str | None
    text: str
    fault: str


def start(_config: Config) -> Cursor:
    """The cursor of an edge that has heard nothing yet."""
    return Cursor()


def place(cursor: Cursor) -> Place | None:
    """The place up to which everything is taken."""
    return cursor.position.place()


def resume(_config: Config, kept: Place) -> Cursor:
    """The cursor of an edge that was here before."""
    return Cursor(SweepPosition.resumed(kept))


def parse(config: Config, cursor: Cursor, raw: bytes) -> tuple[Cursor, SampleSet]:
    """One look."""
    taken = take(cursor.position, raw)
    if taken.sweep is None:
        return replace(cursor, position=taken.position), taken.about
    sweep, is_baseline = taken.sweep, taken.is_baseline
    look = Look(config, sweep, {fact.key: fact for fact in sweep.facts}, is_baseline)
    if is_baseline:  # we have looked away
        cursor = replace(cursor, tool=None, speed=None, unknown="", state=None, at_call=False)
    cursor = _with_texts(cursor, sweep)
    where = _where(cursor, look)
    samples, evidence = _plain(look)
    after, tool_samples = _tool(cursor, where, look)
    if config.source.program_text:
        samples.append(_derived("nc_block", where.block, where.fault, look))
        after, speed = _speed(after, where)
        samples.append(_derived("spindle_rpm_cmd", speed, "no speed of a TOOL CALL is known", look))
        samples.append(_derived("program_comment", *_comment(cursor, look), look))
    samples += tool_samples
    if config.source.tool_table:
        samples += _of_table(cursor.table, tool_samples, look)
    offers = _offers(cursor.offers, look)
    samples += _missing(cursor.offers, offers, samples, look)
    samples = [sample for sample in samples if _is_wanted(config, sample.signal)]
    dropped: dict[str, int] = {Drop.EVIDENCE: evidence} if evidence else {}
    unmapped = len(sweep.facts) - evidence - observations_of(samples)
    if unmapped:
        dropped[Drop.UNMAPPED] = unmapped
    after = replace(
        after,
        position=taken.position,
        offers=offers,
        state=where.state if isinstance(where.state, int) else None,
        at_call=_called(where) is not None and where.state in GOES_ON,
    )
    news = offers if offers != cursor.offers or is_baseline else None
    return after, replace(taken.about, samples=tuple(samples), dropped=dropped, offers=news)


def _is_wanted(config: Config, name: str) -> bool:
    return name == CUE or config.signals.get(name, SignalSection()).publish


def _with_texts(cursor: Cursor, sweep: Sweep) -> Cursor:
    """Keep the programs that came; one that could not be read is kept as its fault."""
    texts = list(cursor.texts)
    for fact in sweep.facts:
        if fact.key.startswith("text:"):
            path = fact.key.removeprefix("text:")
            texts = [entry for entry in texts if entry[0] != path]
            texts.append((path, fact.value if isinstance(fact.value, str) else "", fact.fault))
    table = next((fact for fact in sweep.facts if fact.key == "tool_table"), None)
    if table is not None:
        told = read_table(table.value) if isinstance(table.value, str) else ToolTable(fault=table.fault)
        cursor = replace(cursor, table=told)
    return replace(cursor, texts=tuple(texts[-TEXTS_MAX:]))


def _comment(cursor: Cursor, look: Look) -> tuple[str | None, str]:
    """The comment in the head of the selected program, "" where there is none; and why it is not known."""
    selected = look.facts["program"].value if "program" in look.facts else None
    found = next((entry for entry in cursor.texts if entry[0] == selected), None)
    if found is None or not found[1]:
        return None, (found[2] if found else "") or "the program's text was not read yet"
    program = read_program(found[1])
    if not program.blocks:
        return None, program.fault
    head = program.block(1) or ""
    return (head[1:].strip() if head.startswith((";", "*")) else ""), ""


def _of_table(table: ToolTable, tool_samples: list[EdgeSample], look: Look) -> list[EdgeSample]:
    """The row of the tool in the spindle."""
    tool = next((sample for sample in tool_samples if sample.signal == "tool_number"), None)
    number = tool.value if tool is not None else None
    if isinstance(number, int) and number:
        outcomes = table.outcomes(number)
    else:
        outcomes = nulls("no tool in the spindle" if number == 0 else f"{UNAVAILABLE}: the tool in the spindle is not known")
    return [
        EdgeSample(name, value, look.sweep.t_ms, quality, reason, look.sweep.number, 0, look.is_baseline)
        for name, (value, quality, reason) in outcomes
    ]


def _where(cursor: Cursor, look: Look) -> Where:
    state = look.facts["program_state"].value if "program_state" in look.facts else None
    line, path = (look.facts[key].value if key in look.facts else None for key in ("line", "current_program"))
    if not isinstance(line, int) or not isinstance(path, str):
        return Where(state, None, None, "", "the control does not tell its block")
    if not look.config.source.program_text:
        return Where(state, line, None, "", "program_text is switched off")
    if not path.upper().endswith(".H"):
        return Where(state, line, None, "", f"{path[-80:]} is no Klartext program (.H)")
    found = next((entry for entry in cursor.texts if entry[0] == path), None)
    if found is None or not found[1]:
        return Where(state, line, None, "", (found[2] if found else "") or f"the text of {path[-80:]} was not read yet")
    program = read_program(found[1])
    block = program.block(line)
    fault = program.fault if not program.blocks else f"{path[-80:]} has no block {line}"
    return Where(state, line, block, found[1], "" if block is not None else fault)


def _plain(look: Look) -> tuple[list[EdgeSample], int]:
    """A sample of each fact that feeds a signal by itself, and how many look.facts are evidence of a tool change only."""
    samples: list[EdgeSample] = []
    for key, fact in look.facts.items():
        name = signal_of(key)
        is_another = not key.startswith("plc:") and f"plc:{name}" in look.facts  # the PLC address was asked for by name
        is_another |= bool(look.config.source.tool_table) and name in FEEDS.values()  # the table tells it, with its wear
        if name not in (None, "tool_number") and not is_another:
            samples.append(_sample(name, fact, look))
    return samples, int(f"plc:{TOOL_CHANGE}" in look.facts)


def _sample(name: str, fact: Fact, look: Look) -> EdgeSample:
    value = in_words(fact.key, fact.value)
    if isinstance(value, bool) and target_of(fact.key, name, look.config).known.kind is SignalKind.NUMBER:
        value = int(value)  # a marker that is to be a number
    if fact.fault:
        outcome = bad(fact.fault)
    elif value is None:
        outcome = bad(f"the control says {fact.value!r}" if fact.value is not None else "the control does not say")
    else:
        outcome = read_value(target_of(fact.key, name, look.config), value)
    return EdgeSample(name, outcome[0], look.sweep.t_ms, outcome[1], outcome[2], look.sweep.number, is_baseline=look.is_baseline)


def _derived(name: str, value: Plain, reason: str, look: Look) -> EdgeSample:
    outcome = bad(reason) if value is None else read_value(Target("", name), value)
    at_ms, number = look.sweep.t_ms, look.sweep.number
    return EdgeSample(name, outcome[0], at_ms, outcome[1], outcome[2], number, observations=0, is_baseline=look.is_baseline)


def _route(look: Look) -> str:
    """The fact that gives the tool number, "text" where the program does, "" where nothing does."""
    source = look.config.source
    if source.tool_number_from in (ToolSource.AUTO, ToolSource.PLC) and "plc:tool_number" in look.facts:
        return "plc:tool_number"
    if source.tool_number_from is ToolSource.CONTROL or (source.tool_number_from is ToolSource.AUTO and "tool" in look.facts):
        return "tool"
    return "text" if source.tool_number_from in (ToolSource.AUTO, ToolSource.PROGRAM) and source.program_text else ""


def _tool(cursor: Cursor, where: Where, look: Look) -> tuple[Cursor, list[EdgeSample]]:
    """The tool number, and whether a change is in progress."""
    route = _route(look)
    after, samples = cursor, list[EdgeSample]()
    in_spindle: Token | None = None
    if route == "text":
        after, number = _tool_of_text(cursor, where, look)
        in_spindle = after.tool
        samples.append(number)
    elif route in look.facts:
        made = _sample("tool_number", look.facts[route], look)
        if look.facts[route].fault:  # not another tool, but nothing that is known; the fault itself is in `edge check`
            made = replace(made, reason=UNAVAILABLE)
        in_spindle = made.value if isinstance(made.value, int) else None
        samples.append(made)
    cue, why = _in_progress(where, in_spindle, look)
    if cue is None:  # first: with it goes whatever it said before
        return after, [_cue(None, why, look), *samples]
    return after, [*samples, _cue(cue, why, look)]


def _in_progress(where: Where, in_spindle: Token | None, look: Look) -> tuple[bool | None, str]:
    """Return whether a tool change is in progress, and what says so; None: nothing does."""
    bit = look.facts.get(f"plc:{TOOL_CHANGE}")
    if bit is not None:
        return (bit.value if isinstance(bit.value, bool) else None), source_of(bit.key, look.config)
    if where.block is None:
        return None, where.fault
    called = _called(where)
    if called is None or where.state not in GOES_ON or called == in_spindle:
        return False, "no other tool is called in the running block"
    return True, f"TOOL CALL in block {where.line} of the program text"


def _cue(value: bool | None, reason: str, look: Look) -> EdgeSample:
    return EdgeSample(
        CUE, value, look.sweep.t_ms, Quality.GOOD, reason, look.sweep.number, observations=0, is_baseline=look.is_baseline
    )


def _called(where: Where) -> Token | None:
    """The tool that the running block calls, where it does."""
    for step in read_program(where.text).steps:
        if step.number == where.line:
            return tool_of(step) if step.kind is Kind.TOOL_CALL else None
    return None


def _tool_of_text(cursor: Cursor, where: Where, look: Look) -> tuple[Cursor, EdgeSample]:
    if where.block is None or where.line is None:
        after, is_found = replace(cursor, tool=None, unknown=UNAVAILABLE), False  # why, stands in nc_block
    else:
        tool, unknown = _decided(cursor, where, where.line)
        was_unknown = cursor.tool is None and not cursor.at_call
        is_found = (was_unknown or tool is None) and (tool, unknown) != (cursor.tool, cursor.unknown)  # it did not happen now
        after = replace(cursor, tool=tool, unknown=unknown)
    value = after.tool if isinstance(after.tool, int) else None
    reason = None if value is not None else str(after.tool or after.unknown)
    quality = Quality.GOOD if value is not None else Quality.BAD
    return after, EdgeSample(
        "tool_number",
        value,
        look.sweep.t_ms,
        quality,
        reason,
        look.sweep.number,
        observations=0,
        is_baseline=look.is_baseline or is_found,
    )


def _decided(cursor: Cursor, where: Where, line: int) -> tuple[int | str | None, str]:
    """The tool, or None and why it is not known."""
    flow, seen = flow_of(where.text, tool_of), cursor.tool
    if flow.fault:
        return None, flow.fault
    if _called(where) is not None:  # what is in the spindle while it changes is not in the text
        if cursor.at_call and where.state not in GOES_ON:
            return None, f"the program was ended in the TOOL CALL of block {line}"
        return seen, "" if seen is not None else cursor.unknown or f"block {line} calls a tool"
    tokens: Tokens = flow.at(line)
    if cursor.unknown.startswith(STARTED_INSIDE) and not cursor.at_call:
        return None, cursor.unknown
    only = next(iter(tokens)) if len(tokens) == 1 else None
    if only is None or only in (BEFORE, PROGRAM_CALLED):
        if seen is not None and (seen in tokens or tokens & {BEFORE, PROGRAM_CALLED}):
            return seen, ""
        return None, str(only) if only is not None else _either(tokens)
    assert isinstance(only, int | str)
    began = where.state == RUNNING and cursor.state is not None and cursor.state not in GOES_ON
    if began and seen != only:
        return None, f"{STARTED_INSIDE} {line}"
    return only, ""


def _either(tokens: Tokens) -> str:
    if not tokens:
        return "no way through the program leads to this block"
    return f"it may be {' or '.join(sorted(str(token) for token in tokens)[:5])}"[:200]


def _speed(cursor: Cursor, where: Where) -> tuple[Cursor, float | None]:
    """The speed that the last TOOL CALL commanded, in the same way."""
    if where.block is None or where.line is None:
        return replace(cursor, speed=None), None
    tokens = flow_of(where.text, speed_of).at(where.line)
    numbers = [token for token in tokens if isinstance(token, float)]
    if len(tokens) == 1 and numbers:
        return replace(cursor, speed=numbers[0]), numbers[0]
    keeps = cursor.speed is not None and (cursor.speed in tokens or bool(tokens & {BEFORE, PROGRAM_CALLED}))
    speed = cursor.speed if keeps else None
    return replace(cursor, speed=speed), speed


def _offers(before: tuple[Offer, ...], look: Look) -> tuple[Offer, ...]:
    """Return what the birth declares, once declared for good. Signals that cannot be had are in it too: null, with the reason."""
    found = {offer.signal: offer for offer in before}
    for key in look.facts:
        name = signal_of(key)
        if name not in (None, "tool_number"):
            source = f"plc:{name}" if f"plc:{name}" in look.facts else key
            found.setdefault(name, _offer(look.config, name, source_of(source, look.config)))
    if look.config.source.program_text:
        found.setdefault("nc_block", _offer(look.config, "nc_block", "program text"))
        found.setdefault("spindle_rpm_cmd", _offer(look.config, "spindle_rpm_cmd", "program text"))
        found.setdefault("program_comment", _offer(look.config, "program_comment", "program text"))
    if look.config.source.tool_table:
        for column, name in FEEDS.items():
            found[name] = _offer(look.config, name, f"tool table {column}")
    route = _route(look)
    if route:
        source = "program text" if route == "text" else source_of(route, look.config)
        found.setdefault("tool_number", _offer(look.config, "tool_number", source))
    for name in ONLY_PLC:
        found.setdefault(name, _offer(look.config, name, "none"))
    return tuple(offer for offer in found.values() if _is_wanted(look.config, offer.signal))


def _offer(config: Config, name: str, source: str) -> Offer:
    chosen = chosen_of(name, config)
    if chosen is not None:
        return chosen.offer(source)
    section = config.signals.get(name, SignalSection())
    return Offer(name, source, section.native_unit, section.low, section.high)


def _missing(before: tuple[Offer, ...], offers: tuple[Offer, ...], samples: list[EdgeSample], look: Look) -> list[EdgeSample]:
    """A null with its reason for each signal that is declared and that this look does not feed."""
    known, declared = {sample.signal for sample in samples}, {offer.signal for offer in before}
    why_axes = look.facts["axes"].fault if "axes" in look.facts else ""
    nulls: list[EdgeSample] = []
    for offer in offers:
        is_lost_axis = bool(why_axes) and offer.signal.startswith("axis_")
        if offer.signal not in known and (is_lost_axis or offer.signal not in declared):
            nulls.append(_derived(offer.signal, None, why_axes if is_lost_axis else NO_SOURCE, look))
    return nulls
