"""The alarms of a machine that are remembered, each with its signature and with what a person has said of it.

    begun by an alarm, over when it clears; then open until a person has given a verdict (verdict.py)
    gone: `GONE_PARTS` parts of its program in a row without it, or `GONE_S` without it

An alarm that was called true stands until it is gone, or until a person ends it. One that was called known is held back until it
is gone, with all that are like it and at most `WORSE_MAX` as large. One that was called false is off; where it comes back in the
same part it is the same alarm, and its limits grow with it, but it is on again once it is larger than a limit may become and much
larger than what was called false. What nobody has spoken of changes nothing.
"""

from collections.abc import Iterable
from typing import NamedTuple

from twin.anomaly.parts.alarms.limits import FACTOR_MAX, Tolerated, bounded, raised
from twin.anomaly.parts.alarms.signature import GROWTH, LIKE_MIN, NAME_MAX, Signature, envelope, likeness
from twin.anomaly.parts.alarms.why import Like

OPEN_MAX = 50
LABELLED_MAX = 200
PARTS_MAX = 20
OPERATIONS_MAX = 12
SHOWN_MAX = 3
TRUE, FALSE, KNOWN = "true", "false", "known"
GONE_PARTS = {TRUE: 1, FALSE: 1, KNOWN: 5}
CLEAN_MAX = 5
GONE_S = 14 * 86_400.0
ALIKE = 0.8
WORSE_MAX = 1.5


class Said(NamedTuple):
    """A person's verdict on an alarm, with the label that the person gave it."""

    verdict: str
    label: str
    by: str
    at_s: float


class Episode(NamedTuple):
    """An alarm; began_s names it.

    score, threshold: at its largest, in tails of healthy parts; signature: the largest that was seen of each share
    operations: in which it was seen; parts: in which it or its like was, as the caller names them
    seen_s: when it began, was largest or was over, or its like
    clean_parts: of its program, in a row, since it or its like was seen; called_false: its largest share when somebody said so
    """

    began_s: float
    seen_s: float
    score: float
    threshold: float
    signature: Signature
    operations: tuple[str, ...]
    parts: tuple[str, ...]
    said: Said | None = None
    is_over: bool = False
    clean_parts: int = 0
    called_false: float = 0.0


class Outcome(NamedTuple):
    """The outcome of a verdict: whether it was taken, in words; id is the sender's, "" where it gave none."""

    id: str
    is_done: bool
    text: str
    at_s: float


class Held(NamedTuple):
    """The known cause by which an alarm is held back; since_s: when the person said so."""

    label: str
    by: str
    since_s: float
    likeness: float


class Memory(NamedTuple):
    """The memory of a machine's alarms; the episodes are in the order in which they began.

    running: the alarm that is on by its score; held: why it is held back, if it is
    standing, known: the began_s of those that are not gone
    """

    running: Episode | None = None
    episodes: tuple[Episode, ...] = ()
    standing: tuple[float, ...] = ()
    known: tuple[float, ...] = ()
    tolerated: tuple[Tolerated, ...] = ()
    outcomes: tuple[Outcome, ...] = ()
    held: Held | None = None


class Seen(NamedTuple):
    """A tick at which the score alarms, held back or not; part: a name of the part that is being cut, the caller's."""

    score: float
    threshold: float
    signature: Signature
    part: str


def followed(memory: Memory, seen: Seen | None, at_s: float) -> Memory:
    """Return the memory after a tick; seen: None where the score does not alarm. The same object where nothing is new."""
    running = memory.running
    if seen is None:
        return memory if running is None else _over(memory, running, at_s)
    part = seen.part[:NAME_MAX]
    if running is None:
        again = _called_false(memory, seen.signature, part)
        if again is None:
            operations = (seen.signature.operation,)
            first = Episode(at_s, at_s, seen.score, seen.threshold, seen.signature, operations, (part,))
            return _held(_touched(memory._replace(running=first), first), first)
        running = again._replace(is_over=False)
        memory = memory._replace(running=running, episodes=tuple(one for one in memory.episodes if one is not again))
    now = _grown(running, seen, at_s)
    if now is not running:
        memory = _held(_tolerating(memory._replace(running=now), now, at_s), now)
    if part != now.parts[-1]:
        now = now._replace(parts=(*now.parts, part)[-PARTS_MAX:], seen_s=at_s)
        memory = _touched(memory._replace(running=now), now)
    return memory


def _grown(running: Episode, seen: Seen, at_s: float) -> Episode:
    """Return an alarm after one more tick of it; the same object where it has hardly changed."""
    signature = envelope(running.signature, seen.signature)
    if signature is not running.signature:
        running = running._replace(signature=signature, seen_s=at_s)
    if seen.score > GROWTH * running.score:
        running = running._replace(score=seen.score, threshold=seen.threshold, seen_s=at_s)
    if seen.signature.operation not in running.operations:
        running = running._replace(operations=(*running.operations, seen.signature.operation)[-OPERATIONS_MAX:])
    return running


def alarm_of(memory: Memory) -> bool:
    """Return True where an alarm is published: it is on by its score, neither held back nor called false; or one stands."""
    running = memory.running
    if running is None or memory.standing:
        return bool(memory.standing)
    return memory.held is None and not is_excused(memory) and (running.said is None or running.said.verdict != KNOWN)


def is_excused(memory: Memory) -> bool:
    """Return True while the alarm that is on has been called false, and is not much larger: its part may be learned."""
    one = memory.running
    if one is None or one.said is None or one.said.verdict != FALSE:
        return False
    return one.signature.largest <= max(FACTOR_MAX * one.threshold, WORSE_MAX * one.called_false)


def part_ended(memory: Memory, program: str | None, part: str, at_s: float) -> Memory:
    """Return the memory after a part of `program` has ended: whatever was not seen in it is nearer to being gone."""
    if memory.running is None and not memory.episodes:
        return memory

    def after(one: Episode) -> Episode:
        is_without = one.is_over and one.signature.program == (program or "") and part not in one.parts
        return one._replace(clean_parts=min(one.clean_parts + 1, CLEAN_MAX)) if is_without else one

    return without_gone(memory._replace(episodes=tuple(map(after, memory.episodes))), at_s)


def without_gone(memory: Memory, at_s: float) -> Memory:
    """Return the memory in which what is gone does not stand, and is not held back, any more."""
    if not memory.standing and not memory.known:
        return memory
    here = {one.began_s for one in all_of(memory) if not is_gone(one, at_s)}
    standing, known = (tuple(began_s for began_s in each if began_s in here) for each in (memory.standing, memory.known))
    return memory._replace(standing=standing, known=known)


def is_gone(one: Episode, at_s: float) -> bool:
    """Return True where an alarm has not been seen for so many parts, or for so long, that its cause is gone."""
    parts = GONE_PARTS[TRUE] if one.said is None else GONE_PARTS[one.said.verdict]
    return one.is_over and (one.clean_parts >= parts or at_s - one.seen_s >= GONE_S)


def held_back(memory: Memory, signature: Signature) -> Held | None:
    """Return the known cause that explains an alarm of the same operation; None without one, or where it is much larger."""
    if not memory.known:
        return None
    found: Held | None = None
    for one in all_of(memory):
        is_known = one.began_s in memory.known and one.said is not None and signature.operation in one.operations
        if is_known and one.said is not None and signature.largest <= WORSE_MAX * one.signature.largest:
            like = likeness(one.signature, signature)
            if like >= ALIKE and (found is None or like > found.likeness):
                found = Held(one.said.label, one.said.by, one.said.at_s, like)
    return found


def nearest(memory: Memory, signature: Signature, count: int = SHOWN_MAX) -> tuple[Like, ...]:
    """Return the labels of the alarms that are most like this one, each once, the most like first; none below `LIKE_MIN`."""
    best: dict[str, Like] = {}
    for one in memory.episodes:
        if one.said is not None and one.said.label:
            like = likeness(one.signature, signature)
            before = best.get(one.said.label)
            if like >= LIKE_MIN and (before is None or like >= before.likeness):
                best[one.said.label] = Like(one.said.label, like, one.began_s)
    return tuple(sorted(best.values(), key=lambda each: (-each.likeness, -each.at_s)))[:count]


def all_of(memory: Memory) -> tuple[Episode, ...]:
    """Return the episodes, the one that is on last."""
    return memory.episodes if memory.running is None else (*memory.episodes, memory.running)


def kept(episodes: Iterable[Episode], in_use: Iterable[float]) -> tuple[Episode, ...]:
    """Return as many episodes as are remembered: the latest ones, and those that stand or are held back before others."""
    ordered, used = sorted(episodes, key=lambda one: one.began_s), set(in_use)
    open_ones = [one.began_s for one in ordered if one.said is None][-OPEN_MAX:]
    labelled = [one for one in ordered if one.said is not None]
    labelled = sorted(labelled, key=lambda one: (one.began_s in used, one.began_s))[-LABELLED_MAX:]
    names = {*open_ones, *(one.began_s for one in labelled)}
    return tuple(one for one in ordered if one.began_s in names)


def _over(memory: Memory, running: Episode, at_s: float) -> Memory:
    over = running._replace(is_over=True, seen_s=at_s)
    memory = _touched(memory._replace(running=None, held=None), over)
    return memory._replace(episodes=kept((*memory.episodes, over), (*memory.standing, *memory.known)))


def _called_false(memory: Memory, signature: Signature, part: str) -> Episode | None:
    """Return the alarm that was called false in this part, and that has come back; None where there is none."""
    return next(
        (
            one
            for one in reversed(memory.episodes)
            if one.said is not None
            and one.said.verdict == FALSE
            and part in one.parts
            and likeness(one.signature, signature) >= ALIKE
        ),
        None,
    )


def _tolerating(memory: Memory, now: Episode, at_s: float) -> Memory:
    """Return the memory in which the limits of an alarm that was called false have grown with it."""
    if now.said is None or now.said.verdict != FALSE:
        return memory
    others = (one for one in memory.tolerated if one.episode_s != now.began_s)
    return memory._replace(tolerated=bounded((*others, *tolerated_of(now, at_s)), at_s))


def tolerated_of(one: Episode, now_s: float) -> tuple[Tolerated, ...]:
    """Return the limits that an alarm raises which somebody has called false."""
    by = "" if one.said is None else one.said.by
    return raised(one.began_s, one.operations, one.signature, one.threshold, by, now_s)


def _held(memory: Memory, now: Episode) -> Memory:
    held = held_back(memory, now.signature)
    return memory if held == memory.held else memory._replace(held=held)


def _touched(memory: Memory, now: Episode) -> Memory:
    """Return the memory in which all that are like an alarm were seen in its part too."""

    def after(one: Episode) -> Episode:
        if now.seen_s - one.seen_s >= GONE_S or likeness(one.signature, now.signature) < ALIKE:
            return one
        parts = one.parts if now.parts[-1] in one.parts else (*one.parts, now.parts[-1])[-PARTS_MAX:]
        return one._replace(parts=parts, seen_s=max(one.seen_s, now.seen_s), clean_parts=0)

    return memory._replace(episodes=tuple(map(after, memory.episodes))) if memory.episodes else memory
