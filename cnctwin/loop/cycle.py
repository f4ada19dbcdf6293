"""The loop as a state machine: pure, one step a look.

It goes by what is so, not by what was told: who is killed and started again sees the same folder, the same gap and the same work,
and goes on.

    watching → composing → diagnosing → shadow → promoted → watching
                    └──────────┴→ refused → …

A deed changes the folder; done twice it is done once.
"""

import hashlib
from collections.abc import Callable, Mapping

from cnctwin.loop.config import Diagnose, LoopConfig, Promote
from cnctwin.loop.request import Request, Word
from cnctwin.loop.span import is_long_enough, span_of
from cnctwin.loop.state import Answer, Last, State, StepName
from cnctwin.loop.wording import floors, hours, promotion
from cnctwin.loop.world import Back, Deed, File, Withdraw, World
from cnctwin.loop.world import Promote as MakeLive
from cnctwin.machines.evidence import Card, Shadow, why_not
from processors.description import version_of

RULE = "rule"
HOUR_MS = 3_600_000.0
EQUAL_FLOORS = 0.1
"""Standing gaps that differ by less are alike."""
TAKEN_UP_S, TAKEN_UP_S_MAX = 5.0, 60.0
"""Seconds after a promotion before which its figures are not looked at, and after which they are whatever else is told."""
NO_GAP_FLOORS = 1.0
"""A standing gap up to its floor is none: a challenger that leaves no more is not worse."""
Stepped = tuple[State, Deed | None]


def stepped(config: LoopConfig, state: State, world: World) -> Stepped:
    """Take one look at the world; return the state, and what is to be done to the folder now."""
    state = _after_the_folder(config, state, world)
    request = world.request
    if request is not None and not state.has_answered(request.id):
        return _asked(config, state, world, request)
    if world.fault:
        return state.now(text=f"{world.fault}; the loop waits until it is mended"), None
    if state.promoted_at_ms and (back := _back_of_itself(config, state, world)) is not None:
        return state, back
    return _STEPS[state.step](config, state, world)


def shadow_of(config: LoopConfig, state: State, world: World) -> Shadow | None:
    """Return the challenger as a shadow; None where there is none."""
    if state.step is not StepName.SHADOW:
        return None
    begun = state.shadow_from_at_ms
    seconds = max(world.at_ms - begun, 0) / 1000.0 if begun else 0.0
    both = (world.standing.live, world.standing.challenger) if begun else ({}, {})
    return Shadow(
        version=state.challenger,
        against=state.live,
        seconds=seconds,
        seconds_min=config.shadow_s,
        live=both[0],
        challenger=both[1],
    )


# What has happened to the folder.


def _after_the_folder(config: LoopConfig, state: State, world: World) -> State:
    if world.live != state.live and not world.fault:
        state = _another_is_live(config, state, world)
    if world.challenger and world.challenger != state.challenger:
        said = (world.card or Card()).sentence or "it was filed by hand"
        text = f"a challenger runs beside the live description: {said}"
        state = _now(state, world, StepName.SHADOW, text, challenger=world.challenger, case="", shadow_from_at_ms=0)
        return state.now(shadow_entry_at_ms=world.at_ms)
    if state.challenger and not world.challenger:
        quiet = world.at_ms + round(config.again_hours * HOUR_MS)
        text = f"{state.challenger} was withdrawn; watching the gap"
        state = _now(state, world, StepName.WATCHING, text, challenger="", quiet_until_at_ms=quiet)
    return state


def _another_is_live(config: LoopConfig, state: State, world: World) -> State:
    """Another description is live: the challenger, or one that somebody wrote or went back to."""
    if not state.live:
        return state.now(live=world.live)
    if world.live != state.challenger:
        changed = {"live": world.live, "challenger": "", "last": None, "promoted_at_ms": 0}
        quiet = world.at_ms + round(config.again_hours * HOUR_MS)
        text = f"{world.live} is the live description now: {world.live_said}"
        return _now(state, world, StepName.WATCHING, text, case="", quiet_until_at_ms=quiet, **changed)
    card = world.live_card or Card()
    signal = (
        card.signal if card.signal in state.standing else max(state.standing, key=lambda one: state.standing[one], default="")
    )
    last = Last(
        says=card.says or card.sentence or f"{world.live} was promoted",
        signal=signal,
        words=card.words if signal == card.signal else signal,
        before=state.standing.get(signal, card.gap_before),
        after=card.gap_after if signal not in state.standing else None,
        since=world.live_since_ms or world.now_ms,
    )
    before = {"before": state.standing, "promoted_at_ms": world.at_ms}
    return _now(state, world, StepName.PROMOTED, promotion(last), live=world.live, challenger="", case="", last=last, **before)


# What a person asks.


def _asked(config: LoopConfig, state: State, world: World, request: Request) -> Stepped:
    """A deed is answered by whoever does it; all else here."""
    if request.word is Word.PROMOTE:
        shadow = shadow_of(config, state, world)
        return state, MakeLive(request.version or world.challenger, request.by, request.why or _why(world), shadow)
    if request.word is Word.BACK:
        return state, Back(request.version, request.by, request.why)
    if request.word is Word.WITHDRAW:
        if not state.case:
            return state, Withdraw(request.version or world.challenger, request.by, request.why)
        quiet = world.at_ms + round(config.again_hours * HOUR_MS)
        text = f"the diagnosis was ended by {request.by}; watching the gap"
        ended = _now(state, world, StepName.WATCHING, text, case="", quiet_until_at_ms=quiet)
        return _answered(ended, world, request, "the diagnosis is ended", is_done=True), None
    if state.case:
        return _answered(state, world, request, f"a diagnosis is under way: {state.text}", is_done=True), None
    if world.challenger:
        line = f"{world.challenger} waits as the challenger; promote or withdraw it first"
        return _answered(state, world, request, line, is_done=False), None
    if world.fault:
        return _answered(state, world, request, world.fault, is_done=False), None
    begun = _begun(config, state, world, request.by)
    return _answered(begun, world, request, begun.text, is_done=True), None


def _answered(state: State, world: World, request: Request, text: str, *, is_done: bool) -> State:
    if not request.id:
        return state
    return state.answered(Answer(id=request.id, request=request.word, done=is_done, text=text, t=world.now_ms))


def _why(world: World) -> str:
    return (world.card or Card()).sentence


# The steps.


def _watching(config: LoopConfig, state: State, world: World) -> Stepped:
    state = _seen(state, world)
    found = world.standing
    if not found.is_open:
        calm = state.step is StepName.REFUSED and world.at_ms >= state.quiet_until_at_ms
        return (_now(state, world, StepName.WATCHING, "watching the gap") if calm else state), None
    waits = world.at_ms < state.quiet_until_at_ms or not is_long_enough(config, world)
    if config.diagnose is Diagnose.BY_HAND or waits:
        if state.step is StepName.REFUSED:
            return state, None
        by_hand = config.diagnose is Diagnose.BY_HAND
        then = "a diagnosis can be asked for" if by_hand else "a diagnosis begins by itself, or when a person asks"
        return state.now(text=f"the gap is open: {found.grows or found.opens}; {then}"), None
    return _begun(config, state, world, ""), None


def _begun(config: LoopConfig, state: State, world: World, by: str) -> State:
    span = span_of(config, world)
    asked = f"{world.machine}|{world.live}|{span[0]}|{span[1]}"
    case = f"loop-{hashlib.sha256(asked.encode()).hexdigest()[:12]}"
    since = f": {told}" if (told := world.standing.grows or world.standing.opens) else ""
    text = f"composing a case of {hours(span[1] - span[0])} of history{since}"
    return _now(
        state, world, StepName.COMPOSING, text, of=world.live, span_at_ms=span, case=case, asked_by=by, next_experiment=None
    )


def _composing(config: LoopConfig, state: State, world: World) -> Stepped:
    if world.work.failed:
        return _refused(config, state, world, f"no case could be composed: {world.work.failed}"), None
    if world.work.is_done:
        return _now(state, world, StepName.DIAGNOSING, "the case is diagnosed"), None
    return state, None


def _diagnosing(config: LoopConfig, state: State, world: World) -> Stepped:
    finding = world.work.finding
    if world.work.failed:
        return _refused(config, state, world, f"the diagnosis failed: {world.work.failed}"), None
    if finding is None:
        return state, None
    if not finding.is_better or version_of(finding.toml) == world.live:
        refused = _refused(config, state, world, finding.text)
        return refused.now(next_experiment=finding.next_experiment), None
    return state, File(finding)


def _refused(config: LoopConfig, state: State, world: World, text: str) -> State:
    quiet = world.at_ms + round(config.again_hours * HOUR_MS)
    return _now(state, world, StepName.REFUSED, text, case="", quiet_until_at_ms=quiet)


def _shadow(config: LoopConfig, state: State, world: World) -> Stepped:
    state = _seen(state, world)
    found = world.standing
    is_fresh = found.challenger and found.challenger_at_ms > state.shadow_entry_at_ms
    if not state.shadow_from_at_ms and is_fresh and world.at_ms:
        state = state.now(shadow_from_at_ms=world.at_ms)
    if config.promote is Promote.BY_HAND:
        return state, None
    shadow = shadow_of(config, state, world)
    if shadow is None or shadow.seconds < 3600.0 * config.shadow_hours or (sums := shadow.sums) is None:
        return state, None
    smaller = f"standing gap {floors(sums[0])} → {floors(sums[1])} × the repeatability"
    gained = f"{smaller} in {hours(1000.0 * shadow.seconds)} beside the live one"
    if sums[1] >= sums[0] + config.promote_floors:
        return state, Withdraw(state.challenger, RULE, gained)
    if sums[0] - sums[1] < config.promote_floors or _worse_in(shadow.live, shadow.challenger):
        return state, None
    if why_not(state.challenger, state.live, world.card, shadow) is not None:
        return state, None
    return state, MakeLive(state.challenger, RULE, "; ".join(filter(None, (_why(world), gained))), shadow)


def _promoted(config: LoopConfig, state: State, world: World) -> Stepped:
    state = _seen(state, world)
    if not state.promoted_at_ms:
        state = state.now(promoted_at_ms=world.at_ms)
    if world.at_ms - state.promoted_at_ms >= config.back_hours * HOUR_MS:
        return _now(state, world, StepName.WATCHING, "watching the gap"), None
    return (state if state.last is None else state.now(text=promotion(state.last))), None


def _back_of_itself(config: LoopConfig, state: State, world: World) -> Back | None:
    """Return the way back where the gap has grown since the promotion; None while it has not, or its time is over."""
    now = world.standing.live
    both = [signal for signal in state.before if signal in now]
    if not both or not _is_taken_up(state, world) or not 0 < world.at_ms - state.promoted_at_ms < config.back_hours * HOUR_MS:
        return None
    before, after = (sum(gaps[signal] for signal in both) for gaps in (state.before, now))
    if after - before <= config.back_floors:
        return None
    why = f"the standing gap is {floors(after)} × the repeatability; before the promotion it was {floors(before)}"
    return Back(state.live, RULE, why)


def _is_taken_up(state: State, world: World) -> bool:
    """Return True where the figures are of the description that was promoted: as long as the processor tells of a challenger
    beside the live one, it has not taken it up."""
    since_s = (world.standing.at_ms - state.promoted_at_ms) / 1000.0
    return since_s >= (TAKEN_UP_S_MAX if world.standing.challenger else TAKEN_UP_S)


def _seen(state: State, world: World) -> State:
    """The state with the standing gap of the live description, also as that to which the last promotion has led."""
    now = world.standing.live
    if not now:
        return state  # what was known holds until more is heard
    last = state.last
    if last is not None and last.signal in now and _is_taken_up(state, world):
        last = last.model_copy(update={"after": now[last.signal]})
    is_news = dict(state.standing) != dict(now) or last != state.last
    return state.now(standing=dict(now), last=last) if is_news else state


def _worse_in(live: Mapping[str, float], challenger: Mapping[str, float]) -> list[str]:
    return [signal for signal in live if challenger.get(signal, 0.0) > max(live[signal] + EQUAL_FLOORS, NO_GAP_FLOORS)]


def _now(state: State, world: World, step: StepName, text: str, **changed: object) -> State:
    return state.now(step=step, since_ms=world.now_ms, text=text, **changed)


_STEPS: Mapping[StepName, Callable[[LoopConfig, State, World], Stepped]] = {
    StepName.WATCHING: _watching,
    StepName.COMPOSING: _composing,
    StepName.DIAGNOSING: _diagnosing,
    StepName.SHADOW: _shadow,
    StepName.PROMOTED: _promoted,
    StepName.REFUSED: _watching,
}
