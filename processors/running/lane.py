"""One machine's stream through a fold: its clock and its row. A machine's live data and its history have a lane each.

Event time is that of the readings. It only goes forward, in steps that hold on any day:

* before a message is folded, a tick is given at each multiple of tick_s up to its time;
* silence longer than gap_s_max gets the ticks of its first gap_s_max, then one HOLE. Wall-clock ticks are the same ticks given
  earlier, so the day and its replay see the same samples;
* a message up to late_s_max behind is folded at the present time; a reading older than what is known of its signal is not news;
* a message further behind is held back. Where the next ones agree with it, the clock was set back: one HOLE, then they are
  folded; where they don't, it was a straggler, and is dropped as late;
* a death is stamped by the clock of the host that hears it, another one in each process: it moves time only within gap_s_max, and
  only to the last tick before it, so that all hosts come to the same state.
"""

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from types import MappingProxyType
from typing import Any

from processors.actions import Action
from processors.config import ProcessorConfig
from processors.description import Given
from processors.running.challenger import said_by_challengers
from processors.running.counts import Counts
from processors.running.fold import Fold, Folded
from processors.running.ledger import FOLDED, DropReason, Fates
from processors.running.picks import Picks, Stream
from processors.sample import Sample, SampleKind
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

REWIND_MESSAGES = 3  # so many messages in a row, far behind, mean that the clock was set back
SUPERSEDED: Fates = (DropReason.SUPERSEDED,)
HELD: Fates = ()
_name: Callable[[Reading], str] = itemgetter(Reading._fields.index("name"))
_timestamp_ms: Callable[[Reading], int] = itemgetter(Reading._fields.index("timestamp_ms"))
_DATA, _TICK, _GOOD = SampleKind.DATA, SampleKind.TICK, Quality.GOOD  # to look up a member of an enumeration costs 70 ns
_new = tuple.__new__  # a named tuple's own constructor costs as much as the rest of a fold


class Lane:
    """See the module.

    ticking: the machine was online from clock_ms on, so that silence means that nothing changed
    births: of each edge node of the machine, the first birth that was heard since the processor was started, by its stamp: what a
        replay has to know of a life. Restored ones are of the life before, and go with the first of this one.
    anchor_ms, anchor_wall_s: event time and the time on the wall at the newest message; held: messages that are held back
    is_challenged: the machine has a challenger, which may begin with the next message only
    owner: which node each signal of the row is taken from
    others: what the challengers of other processors say, by the names of the live twin's signals
    """

    __slots__ = (
        "_counts", "_fold_in", "_gap_ms", "_inputs", "_late_ms", "_machine", "_names", "_pick", "_picks", "_tick_ms", "_view",
        "_wakes", "anchor_ms", "anchor_wall_s", "births", "births_are_old", "clock_ms", "emission", "fold", "held", "is_awaited",
        "is_challenged", "is_restored", "is_silent", "last_ms", "others", "owner", "row", "ticking",
    )  # fmt: skip

    def __init__(self, fold: Fold, picks: Picks, config: ProcessorConfig, machine: str, counts: Counts) -> None:
        self.row: dict[str, Reading] = {}
        self.owner: dict[str, NodeId] = {}
        self.fold = fold
        self.emission = fold.join(machine)
        self.clock_ms: int | None = None  # event time that the fold has seen
        self.last_ms = 0  # event time of the newest message; meaningless while clock_ms is None
        self.ticking = fold.is_history
        self.is_silent = False  # the hole of the present silence has been given
        self.is_restored = False
        self.births: dict[str, int] = {}
        self.births_are_old = False
        self.is_challenged = False
        self.others: dict[str, Reading] = {}
        self.is_awaited = False  # its silence is watched (processors/running/silences.py)
        self._view: Mapping[str, Reading] = MappingProxyType(self.row)
        self._fold_in, self._inputs, self._machine, self._wakes = fold.take, picks.inputs, machine, fold.wakes
        self._picks, self._pick = picks, picks.of(())
        self._names: tuple[str, ...] = ()  # of the last message, which the next one nearly always has too
        self._counts = counts
        self._tick_ms = max(1, round(config.tick_s * 1000))
        self._gap_ms = round(config.gap_s_max * 1000)
        self._late_ms = round(config.late_s_max * 1000)
        self.held: list[Sequence[Reading]] = []
        self.anchor_ms, self.anchor_wall_s = 0, 0.0

    @property
    def state(self) -> Any:
        """The state that the fold has come to."""
        return self.fold.state

    # Messages.

    def stream(self, message: Stream, wall_s: float) -> Folded:
        """A message of the machine's own edge has come whose names and stamps are given: as `data`, by the shortest way where it
        is the next one in time, as nearly every message is."""
        _, readings, names, oldest_ms, newest_ms = message
        clock_ms, last_ms, fold = self.clock_ms, self.last_ms, self.fold
        if self._inputs is None:
            self.row.update(zip(names, readings))  # noqa: B905 — as long as each other; `strict` is slower
            return self._fold(_DATA, newest_ms if clock_ms is None else clock_ms, names)
        if clock_ms is None or self.held or oldest_ms < last_ms or newest_ms > last_ms + self._gap_ms:
            return self.data(readings, wall_s)
        actions: list[Action] | None = None
        if newest_ms > clock_ms:
            if self.ticking and not self.is_silent and newest_ms // self._tick_ms != clock_ms // self._tick_ms:
                actions = self._pass_silence(newest_ms)
            self.clock_ms = clock_ms = newest_ms
        self.last_ms, self.is_silent = newest_ms, False
        self.anchor_ms, self.anchor_wall_s = clock_ms, wall_s
        if names is not self._names:
            self._names, self._pick = names, self._picks.of(names)
        taken, get, wakes = self._pick
        if not taken:
            return actions or [], FOLDED  # nothing in it for this processor but the time
        self.row.update(zip(taken, get(readings)))  # noqa: B905
        if not wakes:
            return actions or [], FOLDED  # the next tick sees it
        sample = (self._machine, _DATA, clock_ms / 1000, self._view, taken, 0.0, "", fold.is_history, fold.cell, "")
        folded, fates = self._fold_in(_new(Sample, sample), clock_ms)
        return (actions + folded if actions else folded), fates

    def twin(self, message: Stream, wall_s: float) -> Folded:
        """A message of another processor has come whose names and stamps are given: mostly nothing of it is for this one."""
        names = message[2]
        if names is not self._names:
            self._names, self._pick = names, self._picks.of(names)
        pick = self._pick
        return self.data(pick.get(message[1]), wall_s, is_of_twin=True) if pick.names else ([], FOLDED)

    def twin_and_challengers(self, message: Stream, wall_s: float) -> Folded:
        """A message of another processor has come, of a machine that has a challenger."""
        actions, fates = self.twin(message, wall_s)
        return actions + self.hear_challengers(message[1]), fates

    def data(self, readings: Sequence[Reading], wall_s: float, *, is_of_twin: bool = False) -> Folded:
        """A message with changes has come. What another processor says never sets the clock back: its figures may be of a while
        ago, or as old as their last change."""
        if not readings:
            return [], FOLDED
        if self._inputs is None:
            return self._show(_DATA, readings)
        at_ms = self._time_of(readings)
        if is_of_twin:
            return self._accept(readings, self._if_news(at_ms), wall_s)
        if at_ms is not None and self.clock_ms is not None and at_ms < self.last_ms - self._late_ms:
            self.held.append(readings)
            return self._follow_the_clock_back(wall_s) if len(self.held) == REWIND_MESSAGES else ([], HELD)
        if not self.held:
            return self._accept(readings, at_ms, wall_s)
        late = self.drop_held()
        actions, fates = self._accept(readings, at_ms, wall_s)
        return actions, late + fates

    def birth(
        self,
        readings: Sequence[Reading],
        taken: Sequence[Reading],
        wall_s: float,
        *,
        is_of_twin: bool = False,
    ) -> Folded:
        """A birth has come: the values `taken` of it hold, whatever was known before."""
        self.fold.show(self._machine, self._view)
        if self._inputs is None:
            self.is_restored = False
            return self._show(SampleKind.BIRTH, taken)
        late = self.drop_held()
        actions: list[Action] = []
        at_ms = self._time_of(readings)
        if is_of_twin:
            at_ms = self._if_news(at_ms)
        before_ms = self.last_ms if self.clock_ms is not None else None
        if at_ms is not None:
            if before_ms is not None and max(map(_timestamp_ms, readings)) < before_ms - self._late_ms:
                actions += self._jump_back(at_ms)
            if self.is_restored and before_ms is not None and at_ms > before_ms:
                # Nobody heard what held meanwhile: no ticks, and so no figures, of that time.
                self.ticking = False
                actions += self._reach(at_ms, wall_s)
                actions += self._hole((at_ms - before_ms) / 1000, "restarted: what came in between was not seen")
            else:
                actions += self._reach(at_ms, wall_s)
        self.is_restored = False
        self.row.update((reading.name, reading) for reading in taken)
        self.ticking = True
        names = tuple(reading.name for reading in taken)
        folded, fates = self._fold(SampleKind.BIRTH, self._now_ms(readings), names)
        return actions + folded, late + fates

    def born(self, node: str, stamp_ms: int) -> None:
        """A birth of this node is heard."""
        if self.births_are_old:
            self.births, self.births_are_old = {}, False
        self.births.setdefault(node, stamp_ms)

    def note(self, readings: Sequence[Reading]) -> None:
        """Keep what another processor says of a machine whose edge is offline: nothing is made of it until the edge is back."""
        self.row.update((reading.name, reading) for reading in readings)

    def _show(self, kind: SampleKind, readings: Sequence[Reading]) -> Folded:
        """Fold for a processor that reads everything, from several sources, each with a clock of its own: no time is common.

        What comes last of a source is what it said last: the session has put its messages in order.
        """
        self.row.update((reading.name, reading) for reading in readings)
        return self._fold(kind, self._now_ms(readings), tuple(reading.name for reading in readings))

    def death(self, names: Sequence[str], at_ms: int, reason: str, *, is_last: bool) -> Folded:
        """An edge of the machine went offline, and `names` with it. What was held back is to be dropped before."""
        actions: list[Action] = []
        if self.clock_ms is not None and self.clock_ms < at_ms <= self.last_ms + self._gap_ms:
            actions = self._pass_silence(at_ms)  # and no further than its last tick: each host stamps a death by its own clock
        self.ticking = self.ticking and not is_last
        for name in names:
            self.row[name] = self.row[name]._replace(quality=Quality.STALE, reason=reason)
        for name in self.others.keys() & set(names) if self.others else ():
            self.others[name] = self.others[name]._replace(quality=Quality.STALE, reason=reason)
        if is_last:
            self.fold.hide(self._machine)
        now_ms = at_ms if self.clock_ms is None else self.clock_ms
        folded, fates = self._fold(SampleKind.DEATH, now_ms, tuple(names), detail=reason)
        return actions + folded, fates

    def lost(self, detail: str) -> list[Action]:
        """Messages were lost on the way."""
        return self._hole(0.0, detail)

    def withdraw(self, names: Sequence[str]) -> None:
        """Signals that a new birth does not offer any more."""
        for name in names:
            self.row[name] = self.row[name]._replace(quality=Quality.STALE, reason="not offered any more")

    def challenge(self, given: Given | None) -> bool:
        """Have a challenger with this description, None for none; return True if that is another one than before."""
        is_new = self.fold.challenge(given, (self.row, self.others))
        self.is_challenged = given is not None
        self._fold_in = self.fold.take_both if self.is_challenged else self.fold.take
        if not self.is_challenged:
            self.others.clear()
        return is_new

    def hear_challengers(self, readings: Sequence[Reading]) -> list[Action]:
        """Keep what the challengers of another processor say in a message, and let ours see it. It tells nobody the time."""
        if not self.is_challenged:
            return []
        said = said_by_challengers(readings, self._inputs or ())
        self.others.update(said)
        challenger, clock_ms = self.fold.challenger, self.clock_ms
        is_awake = bool(said) and (self._wakes is None or not self._wakes.isdisjoint(said))
        if challenger is None or clock_ms is None or not is_awake or not self.ticking:
            return []  # the next tick sees it
        return challenger.hear(self._machine, tuple(said), clock_ms)

    def go_on(self) -> None:
        """A restored lane, at the very message at which it was saved: nothing was missed, and who was online still is."""
        self.is_restored = self.births_are_old = False
        if self.ticking:
            self.fold.show(self._machine, self._view)

    def drop_held(self) -> Fates:
        """Drop the messages that were held back: they were stragglers."""
        late = (DropReason.LATE,) * len(self.held)
        self.held.clear()
        return late

    # Time.

    def silence(self, wall_s: float, margin_s: float) -> list[Action]:
        """No message waits: give the ticks up to the present, held back by a margin for what is still on its way."""
        if self.ticking and self.anchor_ms and self.clock_ms is not None and not self.is_silent:
            now_ms = self.anchor_ms + int((wall_s - self.anchor_wall_s - margin_s) * 1000)
            if now_ms - self.clock_ms >= self._tick_ms or now_ms > self.last_ms + self._gap_ms:
                return self._pass_silence(now_ms)
        return []

    def silent_at_s(self, margin_s: float) -> float | None:
        """The time on the wall before which `silence` has nothing to give, as things are; None where it never has."""
        if not (self.ticking and self.anchor_ms and self.clock_ms is not None) or self.is_silent:
            return None
        due_ms = min(self.clock_ms + self._tick_ms, self.last_ms + self._gap_ms + 1)
        return self.anchor_wall_s + margin_s + (due_ms - self.anchor_ms) / 1000

    def _time_of(self, readings: Sequence[Reading]) -> int | None:
        """Event time of a message: its newest reading; None where it has none to believe. When time leaps, only a good value is
        believed: an UNAVAILABLE may be stamped by another clock."""
        newest_ms = max(map(_timestamp_ms, readings), default=None)
        if newest_ms is None or (self.clock_ms is not None and newest_ms <= self.last_ms + self._gap_ms):
            return newest_ms
        good = (reading.timestamp_ms for reading in readings if reading.quality is _GOOD and reading.value is not None)
        return max(good, default=None)

    def _if_news(self, at_ms: int | None) -> int | None:
        """The time of what another processor says, if it is beyond the present."""
        return at_ms if at_ms is None or self.clock_ms is None or at_ms > self.clock_ms else None

    def _now_ms(self, readings: Sequence[Reading]) -> int:
        """The time of the fold, also before any time was believed."""
        return max(map(_timestamp_ms, readings), default=0) if self.clock_ms is None else self.clock_ms

    def _accept(self, readings: Sequence[Reading], at_ms: int | None, wall_s: float) -> Folded:
        before_ms = self.last_ms
        if at_ms is not None and self.clock_ms is not None and at_ms < before_ms:
            self._counts.late += 1
        actions = [] if at_ms is None else self._reach(at_ms, wall_s)
        inputs = self._inputs
        if inputs is not None and not inputs.issuperset(map(_name, readings)):
            readings = [reading for reading in readings if reading[0] in inputs]
        if not readings:
            return actions, FOLDED  # nothing in it for this processor, but the time
        if not (changed := self._update(readings, before_ms)):
            return actions, SUPERSEDED
        if self._wakes is not None and self._wakes.isdisjoint(changed):
            return actions, FOLDED  # the next tick sees it
        folded, fates = self._fold(_DATA, self._now_ms(readings), changed)
        return (actions + folded if actions else folded), fates

    def _reach(self, at_ms: int, wall_s: float) -> list[Action]:
        is_forward = self.clock_ms is not None and at_ms > self.clock_ms
        actions = self._pass_silence(at_ms) if is_forward else []
        if is_forward or self.clock_ms is None:
            self.clock_ms = self.last_ms = at_ms
        else:
            self.last_ms = max(self.last_ms, at_ms)
        self.is_silent = False
        self.anchor_ms, self.anchor_wall_s = self.clock_ms, wall_s
        return actions

    def _pass_silence(self, to_ms: int) -> list[Action]:
        """Give what silence up to `to_ms` brings: ticks, then a hole if it is long. Bounded by gap_s_max / tick_s."""
        clock_ms = self.clock_ms
        actions: list[Action] = []
        if clock_ms is None or self.is_silent:
            return actions
        end_ms = self.last_ms + self._gap_ms
        if self.ticking:
            tick_ms = self._tick_ms
            for at_ms in range((clock_ms // tick_ms + 1) * tick_ms, min(to_ms, end_ms) + 1, tick_ms):
                self.clock_ms = at_ms
                self._counts.ticks += 1
                actions += self._fold(_TICK, at_ms, ())[0]
        if to_ms > end_ms:
            self.clock_ms, self.is_silent = end_ms, True
            actions += self._hole(self._gap_ms / 1000, f"no message for {self._gap_ms / 1000:g} s")
        return actions

    def _follow_the_clock_back(self, wall_s: float) -> Folded:
        held = list(self.held)
        self.held.clear()
        actions = self._jump_back(min(max(map(_timestamp_ms, readings)) for readings in held))
        fates: Fates = ()
        for readings in held:
            accepted, fate = self._accept(readings, self._time_of(readings), wall_s)
            actions += accepted
            fates += fate
        return actions, fates

    def _jump_back(self, at_ms: int) -> list[Action]:
        gap_s = (self.last_ms - at_ms) / 1000
        self.clock_ms = self.last_ms = at_ms
        self.is_silent = False
        return self._hole(gap_s, "the machine's clock was set back")

    def _hole(self, gap_s: float, detail: str) -> list[Action]:
        self._counts.holes += 1
        return [] if self.clock_ms is None else self._fold(SampleKind.HOLE, self.clock_ms, (), gap_s=gap_s, detail=detail)[0]

    # The fold.

    def _update(self, readings: Sequence[Reading], before_ms: int) -> tuple[str, ...]:
        """Put a message into the row; the names that it set. A reading stamped beyond the machine's clock can't be trusted to be
        newer than what follows, so it is always replaced."""
        row, last_ms = self.row, self.last_ms
        names = tuple(map(_name, readings))
        if before_ms <= min(map(_timestamp_ms, readings)):  # nearly always: newer than all that came before
            row.update(zip(names, readings, strict=True))
            return names
        changed = []
        for name, reading in zip(names, readings, strict=True):
            known = row.get(name)
            if known is None or reading.timestamp_ms >= known.timestamp_ms or known.timestamp_ms > last_ms:
                row[name] = reading
                changed.append(name)
        return tuple(changed)

    def _fold(
        self,
        kind: SampleKind,
        at_ms: int,
        changed: tuple[str, ...],
        *,
        gap_s: float = 0.0,
        detail: str = "",
    ) -> Folded:
        fold = self.fold
        return self._fold_in(
            _new(
                Sample,
                (self._machine, kind, at_ms / 1000, self._view, changed, gap_s, detail, fold.is_history, fold.cell, ""),
            ),
            at_ms,
        )
