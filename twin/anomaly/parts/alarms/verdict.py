"""A person's verdict on an alarm, and what follows from it. Nothing follows from silence.

    true   the alarm stands until its cause is gone (episodes.py), or until the person ends it; its parts are never learned
    false  the part that runs may be learned, and the limits of its signals, scales and sides in its operation rise (limits.py)
    known  it is held back, with its like, until it is gone (episodes.py); its parts are never learned

The same verdict again changes nothing. Of several on one alarm, that with the latest `at_s` holds, in whatever order they come.
It takes back a limit that an earlier one has raised, but not what was learned meanwhile. Of a false alarm the part that is being
cut is learned; those that have ended are not kept, but the next ones, which alarm no more, are learned like any other.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.anomaly.parts.alarms.episodes import (
    FALSE,
    KNOWN,
    TRUE,
    Episode,
    Memory,
    Outcome,
    Said,
    all_of,
    is_excused,
    is_gone,
    kept,
    tolerated_of,
)
from twin.anomaly.parts.alarms.limits import FACTOR_MAX, MARGIN, bounded
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own

VERSION = 1
OUTCOMES_MAX = 10
ALARM_WITHIN_S = 2.0
"""An alarm is found by when it began, give or take the rounding of the sender."""
TEXT_MAX = 200
MESSAGE_CHARACTERS_MAX = 4096


LINE = r"^[^\x00-\x1f\x7f]*$"


class Verdict(BaseModel):
    """A message on `cnctwin/verdict/<machine>`.

    alarm_at_s: when the alarm began, as `twin/anomaly_verdicts` has it; at_s: when the person spoke; both s since 1970, UTC
    label: what it was, in a few words; ends: an alarm that was called true ends now; id: any text, by which the sender finds the
    outcome
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    version: Literal[1] = 1
    alarm_at_s: float = Field(ge=0.0, le=1e11)
    verdict: Literal["true", "false", "known"]
    label: Annotated[str, Field(max_length=60, pattern=LINE)] = ""
    by: Annotated[str, Field(min_length=1, max_length=100, pattern=LINE)]
    at_s: float = Field(ge=0.0, le=1e11)
    ends: bool = False
    id: Annotated[str, Field(max_length=64, pattern=LINE)] = ""


def verdict_of(text: str) -> Verdict:
    """Return the verdict that a message is. Raises ValueError, with one line that names what is wrong and what was given."""
    if len(text) > MESSAGE_CHARACTERS_MAX:
        raise ValueError(f"a verdict of {len(text)} characters; {MESSAGE_CHARACTERS_MAX} are the most")
    try:
        return Verdict.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the message"
        given = "missing" if first["type"] == "missing" else repr(first["input"])[:40]
        raise ValueError(f"{where}: {first['msg']}, but it is {given}; docs/how-to/verdicts.md shows a verdict") from None


def corrected(model: PartsModel, own: Own, verdict: Verdict) -> Own:
    """Return the state of a machine after a verdict on one of its alarms."""
    memory = corrected_memory(own.memory, verdict, own.tick * model.tick_s)
    return own._replace(memory=memory, is_part_bad=own.is_part_bad and not is_excused(memory))


def corrected_memory(memory: Memory, verdict: Verdict, now_s: float) -> Memory:
    """Return the memory after a verdict: who said what, and what follows from it.

    now_s: event time, which may be another one than that of the person's clock
    """
    if verdict.id and any(one.id == verdict.id for one in memory.outcomes):
        return memory
    found = _meant(memory, verdict.alarm_at_s)
    if found is None:
        last = ", ".join(f"{one.began_s:.3f}" for one in all_of(memory)[-3:]) or "none"
        why = f"no alarm that began at {verdict.alarm_at_s:.3f} s is remembered; the last ones: {last}"
        return _noted(memory, verdict, False, why)
    said, before = Said(verdict.verdict, verdict.label.strip(), verdict.by, verdict.at_s), found.said
    if verdict.ends:
        return _ended(memory, found, verdict)
    if before == said:
        if not verdict.id:
            return memory
        return _noted(memory, verdict, True, f"{before.by} has said so before")
    if before is not None and _order(before) > _order(said):
        return _noted(memory, verdict, False, f"a later verdict holds: {before.verdict}, by {before.by}")
    spoken = found._replace(said=said, called_false=found.signature.largest if said.verdict == FALSE else 0.0)
    memory = _without(memory, found)
    is_here = not is_gone(spoken, now_s)
    standing, known = (
        tuple(sorted((*before, found.began_s))) if said.verdict == word and is_here else before
        for word, before in ((TRUE, memory.standing), (KNOWN, memory.known))
    )
    own = tolerated_of(spoken, now_s) if said.verdict == FALSE else ()
    memory = memory._replace(standing=standing, known=known, tolerated=bounded((*memory.tolerated, *own), now_s))
    return _noted(_replaced(memory, spoken), verdict, True, _text(spoken, is_here))


def refused(memory: Memory, why: str, at_s: float) -> Memory:
    """Return the memory with a message that could not be read among the outcomes."""
    return memory._replace(outcomes=(*memory.outcomes, Outcome("", False, why[:TEXT_MAX], at_s))[-OUTCOMES_MAX:])


def _meant(memory: Memory, alarm_at_s: float) -> Episode | None:
    within = [one for one in all_of(memory) if abs(one.began_s - alarm_at_s) <= ALARM_WITHIN_S]
    return min(within, key=lambda one: abs(one.began_s - alarm_at_s), default=None)


def _order(said: Said) -> tuple[float, str, str, str]:
    return said.at_s, said.by, said.verdict, said.label


def _ended(memory: Memory, found: Episode, verdict: Verdict) -> Memory:
    if found.said is not None and found.said.at_s > verdict.at_s:
        return _noted(memory, verdict, False, f"a later verdict holds: {found.said.verdict}, by {found.said.by}")
    if found.began_s not in memory.standing:
        return _noted(memory, verdict, False, "the alarm does not stand any more")
    standing = tuple(one for one in memory.standing if one != found.began_s)
    return _noted(memory._replace(standing=standing), verdict, True, f"ended by {verdict.by}")


def _text(episode: Episode, is_here: bool) -> str:
    assert episode.said is not None
    if episode.said.verdict == TRUE:
        return "true: it stands until a part of the program has run without it" if is_here else "true: it is gone already"
    if episode.said.verdict == KNOWN:
        return "known: its like is held back until it is gone" if is_here else "known: it is gone already"
    if MARGIN * episode.signature.largest > FACTOR_MAX * episode.threshold:
        return f"false: its limits rise to {FACTOR_MAX:g} times, the most; one as large as this may alarm again: call it known"
    return f"false: its limits rise in {', '.join(episode.operations)}, so that its size alarms no more; forgotten over months"


def _without(memory: Memory, found: Episode) -> Memory:
    """Return the memory without what an earlier verdict on an alarm has brought about."""
    return memory._replace(
        standing=tuple(one for one in memory.standing if one != found.began_s),
        known=tuple(one for one in memory.known if one != found.began_s),
        tolerated=tuple(one for one in memory.tolerated if one.episode_s != found.began_s),
    )


def _replaced(memory: Memory, spoken: Episode) -> Memory:
    if memory.running is not None and memory.running.began_s == spoken.began_s:
        return memory._replace(running=spoken)
    episodes = (spoken if one.began_s == spoken.began_s else one for one in memory.episodes)
    return memory._replace(episodes=kept(episodes, (*memory.standing, *memory.known)))


def _noted(memory: Memory, verdict: Verdict, is_done: bool, text: str) -> Memory:
    outcome = Outcome(verdict.id, is_done, text[:TEXT_MAX], verdict.at_s)
    return memory._replace(outcomes=(*memory.outcomes, outcome)[-OUTCOMES_MAX:])
