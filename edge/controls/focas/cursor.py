"""The way from sweeps of a FANUC control to samples: which fact is which signal. Pure.

The tool number is what the builder's register says, or cnc_toolnum; where there is neither, the T code: on a lathe at once, on a
machining centre when M6 has worked on it, because programs call the next tool ahead. So there it is not known until a change was
seen since the edge joined, or since a hole in which a change may have come and gone.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from edge.controls.focas.config import Config, ToolSource
from edge.controls.focas.mapping import ChosenFact, FocasMapping, mapping_of
from edge.controls.focas.states import cue_of, execution_of, feed_override_pct, first_line, mode_of, rapid_override_pct
from edge.place import Place
from edge.reading import Outcome, Target, bad, read_value
from edge.sample import UNAVAILABLE, Drop, EdgeSample, Offer, SampleSet, observations_of
from edge.sweep import Fact, Plain, Sweep, SweepPosition, take
from edge.tool_change import CUE
from sparkplug.quality import Quality

_WITH_RUN = ("status.emergency",)  # facts that are in exec_state too
CHANGE_MS_MIN = 2_000  # no tool change comes and goes in less
_NOT_SEEN = "the control tells only T codes, which programs call ahead; known from the next tool change on"


@dataclass(frozen=True, slots=True)
class Cursor:
    """The parser's position.

    has_toolnum, has_name: whether the control answers cnc_toolnum, and names its program
    is_changing: the cue of the last sweep
    tool, called: by T codes alone, the tool in the spindle (None: not known) and the one that the present change brings
    """

    position: SweepPosition = field(default_factory=SweepPosition)
    mt_type: str = ""
    has_toolnum: bool = False
    has_name: bool = False
    is_changing: bool | None = None
    tool: int | None = None
    called: int | None = None


def start(config: Config) -> Cursor:
    """Nothing is known."""
    return Cursor()


def place(cursor: Cursor) -> Place | None:
    """The place up to which everything is taken."""
    return cursor.position.place()


def resume(config: Config, kept: Place) -> Cursor:
    """An edge that was here before."""
    return Cursor(position=SweepPosition.resumed(kept))


def parse(config: Config, cursor: Cursor, raw: bytes) -> tuple[Cursor, SampleSet]:
    """The samples of one sweep."""
    taken = take(cursor.position, raw)
    if taken.sweep is None:
        return replace(cursor, position=taken.position), taken.about
    facts = {fact.key: fact for fact in taken.sweep.facts}
    after = _known(replace(cursor, position=taken.position), facts)
    is_away = taken.sweep.t_ms - cursor.position.taken_ms >= CHANGE_MS_MIN or taken.sweep.life != cursor.position.life
    look = _Look(config, after, taken.sweep, is_baseline=taken.is_baseline, is_away=is_away)
    samples = tuple(look.samples())
    dropped: Counter[str] = Counter()
    if more := len(taken.sweep.facts) - observations_of(samples):
        dropped[Drop.UNMAPPED] = more
    offers = look.offers() if "control.series" in facts else None
    return look.cursor, replace(taken.about, samples=samples, dropped=dict(dropped), offers=offers)


def _known(cursor: Cursor, facts: Mapping[str, Fact]) -> Cursor:
    """Return what the first sweep of a connection tells for all that follow."""
    if "control.series" in facts:
        mt_type = str(facts.get("control.mt_type", Fact("")).value or "").strip()
        cursor = replace(cursor, mt_type=mt_type, has_toolnum=False, has_name=False)
    has_toolnum = cursor.has_toolnum if "tool" not in facts else not facts["tool"].fault
    has_name = cursor.has_name if "program.name" not in facts else not facts["program.name"].fault
    return replace(cursor, has_toolnum=has_toolnum, has_name=has_name)


def in_spindle(cursor: Cursor, t_code: int | None, is_changing: bool | None, is_away: bool) -> Cursor:
    """The tool in the spindle where only the T code is known: the one that stood while M6 worked on it.

    >>> at_work = in_spindle(Cursor(tool=3, is_changing=False), 7, is_changing=True, is_away=False)
    >>> at_work.tool, in_spindle(replace(at_work, is_changing=True), 8, is_changing=False, is_away=False).tool
    (3, 7)
    """
    if is_away or is_changing is None:
        cursor = replace(cursor, tool=None, called=None)
    if is_changing:
        kept = cursor.called if cursor.is_changing else None  # a T code that is not told in the middle of M6 is as it was
        return replace(cursor, called=kept if t_code is None else t_code)
    return replace(cursor, tool=cursor.called) if cursor.is_changing else cursor


class _Look:
    """One sweep on its way to samples; `cursor` is what the next one begins with."""

    def __init__(self, config: Config, cursor: Cursor, sweep: Sweep, *, is_baseline: bool, is_away: bool) -> None:
        self._sweep, self._facts = sweep, {fact.key: fact for fact in sweep.facts}
        self._is_baseline, self._is_away = is_baseline, is_away
        self._mapping: FocasMapping = mapping_of(config)
        self._tool_source = _tool_source(config, cursor)
        self._tool_key = self._mapping.register or ("tool" if self._tool_source is ToolSource.TOOLNUM else "modal.T")
        self._cue_now = cue_of(self._mapping.rule, self._facts)
        self.cursor = cursor

    def samples(self) -> Iterator[EdgeSample]:
        """Samples, what belongs to a tool change last: the number before the cue, so that the end of one finds the other.

        A number that is not known comes after it: then the cue is all there is to go by.
        """
        for fact in self._facts.values():
            target = self._target_of(fact)
            if target is not None and target.signal not in ("nc_block", "tool_number"):
                yield self._sample(target.signal, fact, self._outcome(target, fact))
        yield from self._chosen()
        number = tuple(self._tool_number())
        is_known = any(sample.value is not None for sample in number)
        yield from number if is_known else ()
        block = self._facts.get("block")
        target = None if block is None else self._target_of(block)
        if block is not None and target is not None:
            yield self._sample("nc_block", block, self._outcome(target, block))
        yield from self._cue()
        yield from () if is_known else number

    def offers(self) -> tuple[Offer, ...]:
        """The signals of this control, in the order of the facts."""
        found: dict[str, Offer] = {}
        for fact in self._facts.values():
            target = self._target_of(fact)
            if target is not None:
                section = self._mapping.sections.get(target.signal)
                unit = "" if section is None else section.native_unit
                found[target.signal] = Offer(target.signal, self._mapping.source_of(fact.key), unit)
        offered = (one for one in self._mapping.chosen if one.fact in self._facts)
        return (*found.values(), *(one.chosen.offer(self._mapping.source_of(one.fact)) for one in offered))

    def _chosen(self) -> Iterator[EdgeSample]:
        """Variables and PMC addresses of the configuration. A byte of which several bits are read is one observation."""
        counted = {*self._mapping.evidence, self._mapping.rule.bit_fact, self._tool_key}
        counted |= {key for key, fact in self._facts.items() if self._target_of(fact) is not None}
        for one in self._mapping.chosen:
            fact = self._facts.get(one.fact)
            if fact is None:
                continue
            sample = self._sample(one.target.signal, fact, self._read(one, fact))
            yield replace(sample, observations=0) if one.fact in counted else sample
            counted.add(one.fact)

    def _read(self, one: ChosenFact, fact: Fact) -> Outcome:
        if fact.fault:
            return bad(fact.fault)
        if fact.value is None:
            return bad(f"{UNAVAILABLE}: the variable is vacant")
        is_bit = one.bit is not None and isinstance(fact.value, int)
        return read_value(one.target, int(fact.value) >> (one.bit or 0) & 1 if is_bit else fact.value)

    def _target_of(self, fact: Fact) -> Target | None:
        """Return what a fact feeds, given which of several this control has."""
        target = self._mapping.target(fact.key)
        if target is None:
            return None
        if target.signal == "program":
            return target if fact.key == ("program.name" if self.cursor.has_name else "program.number") else None
        return target if target.signal != "tool_number" or fact.key == self._tool_key else None

    def _sample(self, name: str, fact: Fact, outcome: Outcome) -> EdgeSample:
        observations = 1 + (sum(key in self._facts for key in _WITH_RUN) if fact.key == "status.run" else 0)
        value, quality, reason = outcome
        return EdgeSample(name, value, self._sweep.t_ms, quality, reason, self._sweep.number, observations, self._is_baseline)

    def _outcome(self, target: Target, fact: Fact) -> Outcome:
        if fact.fault:
            return bad(fact.fault)
        if fact.value is None and fact.key.startswith("life."):
            return bad(f"{UNAVAILABLE}: no tool group is in use")
        value = self._meaning(target, fact)
        if value is None:
            return bad("F0: its speed is a parameter" if target.signal == "rapid_override_pct" else f"no meaning: {fact.value}")
        return read_value(target, value)

    def _meaning(self, target: Target, fact: Fact) -> Plain:
        match target.signal:
            case "controller_mode":
                return mode_of(fact.value)
            case "exec_state":
                return execution_of(fact.value, self._value("status.emergency"), self._value("modal.M"))
            case "nc_block":
                return first_line(str(fact.value))
            case "program" if fact.key == "program.number":
                return f"O{fact.value:04d}" if isinstance(fact.value, int) else None
            case "program":
                return str(fact.value).rsplit("/", 1)[-1]  # the folder is of the control's memory, not of the program
            case "feed_override_pct":
                return feed_override_pct(fact.value)
            case "rapid_override_pct":
                return rapid_override_pct(fact.value)
        return fact.value

    def _value(self, key: str) -> Plain:
        fact = self._facts.get(key)
        return None if fact is None or fact.fault else fact.value

    def _tool_number(self) -> Iterator[EdgeSample]:
        if self._mapping.target(self._tool_key) is None:
            return
        fact = self._facts.get(self._tool_key)
        told_of = self._value(self._tool_key)
        number = int(told_of) if isinstance(told_of, int) or (isinstance(told_of, float) and told_of.is_integer()) else None
        why = fact.fault if fact is not None and fact.fault else "no T code was commanded yet"
        before = self.cursor.tool
        if self._tool_source is ToolSource.MODAL_AT_CHANGE:
            self.cursor = in_spindle(self.cursor, number, self._cue_now.is_changing, self._is_away)
            number, why = self.cursor.tool, why if fact is not None and fact.fault else _NOT_SEEN
        outcome = bad(f"{UNAVAILABLE}: {why}") if number is None else (number, Quality.GOOD, None)
        if fact is not None:
            yield self._sample("tool_number", fact, outcome)
        elif self.cursor.tool != before:  # not told in this look, but it follows
            yield replace(self._sample("tool_number", Fact(self._tool_key), outcome), observations=0)

    def _cue(self) -> Iterator[EdgeSample]:
        used = sum(key in self._facts for key in self._mapping.evidence)
        if not used:
            return
        cue = self._cue_now
        self.cursor = replace(self.cursor, is_changing=cue.is_changing)
        outcome = (cue.is_changing, Quality.BAD if cue.is_changing is None else Quality.GOOD, cue.why)
        yield replace(self._sample(CUE, Fact(CUE), outcome), observations=used)


def _tool_source(config: Config, cursor: Cursor) -> ToolSource:
    source = config.source.tool_number
    if config.source.tool_number_pmc:
        return ToolSource.TOOLNUM
    if source is ToolSource.AUTO and not cursor.has_toolnum:
        return ToolSource.MODAL if cursor.mt_type.startswith("T") else ToolSource.MODAL_AT_CHANGE
    return ToolSource.TOOLNUM if source is ToolSource.AUTO else source
