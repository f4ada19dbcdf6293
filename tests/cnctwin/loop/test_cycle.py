"""The state machine of the loop: what begins it, what ends it, and that it comes to the same end wherever it is started again."""

from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cnctwin.loop.config import Diagnose, LoopConfig, Promote
from cnctwin.loop.cycle import shadow_of, stepped
from cnctwin.loop.request import Request, Word
from cnctwin.loop.standing import Standing
from cnctwin.loop.state import State, StepName, read_state
from cnctwin.loop.world import Back, Deed, File, Finding, Withdraw, Work, World
from cnctwin.loop.world import Promote as MakeLive
from cnctwin.machines.evidence import Card, Score, Shadow, why_not
from processors.description import version_of

T0_MS = 1_795_327_200_000
HOUR_MS = 3_600_000
LIVE, BETTER = "[machine]\nname = 'vmc'\n", "[machine]\nname = 'vmc'\nservo_period_s = 0.002\n"
VA, VB = version_of(LIVE), version_of(BETTER)
CARD = Card(
    sentence="coolant cools: gap 3.1 → 1.1 × the repeatability",
    says="coolant cools",
    signal="spindle_temp_c",
    words="the spindle temperature",
    gap_before=3.1,
    gap_after=1.1,
    score=Score(live=3.1, challenger=1.1, runs=2, against=VA),
)
OPEN = Standing(
    at_ms=T0_MS,
    opens="spindle_temp_c since 2026-11-22T05:00:00Z",
    since_ms=T0_MS - 3 * HOUR_MS,
    window_ms=(T0_MS - 2 * HOUR_MS, T0_MS),
    live={"spindle_temp_c": 3.1},
)
CLOSED = Standing(at_ms=T0_MS, live={"spindle_temp_c": 1.0})
SHADOWED = replace(OPEN, challenger={"spindle_temp_c": 1.0}, challenger_at_ms=T0_MS + 1)
WORLD = World(machine="vmc", now_ms=T0_MS, at_ms=T0_MS, live=VA)
BY_HAND = LoopConfig(shadow_s=900.0)
BY_RULE = LoopConfig(promote=Promote.BY_RULE, shadow_hours=1.0)
FOUND = Finding(True, "coolant cools", BETTER, CARD)


def walked(config: LoopConfig, *worlds: World, state: State | None = None) -> tuple[State, Deed | None]:
    """The state after these looks, and what the last one wants done."""
    state, deed = state or State(), None
    for world in worlds:
        state, deed = stepped(config, state, world)
    return state, deed


def asked(word: Word, version: str = "", by: str = "anna") -> Request:
    return Request(word, "vmc", by, version, "", f"{word}-{version}-{by}")


def test_a_gap_that_stands_open_is_diagnosed_and_the_answer_becomes_a_challenger() -> None:
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN))
    assert state.step is StepName.COMPOSING and state.case.startswith("loop-")
    assert state.span_at_ms == (T0_MS - 3 * HOUR_MS, T0_MS)
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN, work=Work(is_done=True)), state=state)
    assert state.step is StepName.DIAGNOSING
    state, deed = walked(BY_HAND, replace(WORLD, standing=OPEN, work=Work(finding=FOUND)), state=state)
    assert deed == File(FOUND) and state.step is StepName.DIAGNOSING
    state, deed = walked(BY_HAND, replace(WORLD, standing=OPEN, challenger=VB, card=CARD), state=state)
    assert (state.step, state.case, deed) == (StepName.SHADOW, "", None)
    assert "coolant cools" in state.text


def test_nothing_begins_while_the_gap_is_closed_or_where_a_person_has_to_ask() -> None:
    assert walked(BY_HAND, replace(WORLD, standing=CLOSED))[0].step is StepName.WATCHING
    only_asked = LoopConfig(diagnose=Diagnose.BY_HAND)
    state, _ = walked(only_asked, replace(WORLD, standing=OPEN))
    assert state.step is StepName.WATCHING and "can be asked for" in state.text
    state, _ = walked(only_asked, replace(WORLD, standing=OPEN, request=asked(Word.DIAGNOSE)), state=state)
    assert state.step is StepName.COMPOSING and state.asked_by == "anna"
    assert state.answers[-1].done


def test_where_nothing_says_since_when_the_last_hours_are_looked_at() -> None:
    state, _ = walked(LoopConfig(window_hours=3.0), replace(WORLD, request=asked(Word.DIAGNOSE)))
    assert state.span_at_ms == (T0_MS - 3 * HOUR_MS, T0_MS)


def test_a_gap_that_has_just_opened_waits_for_history_unless_somebody_asks() -> None:
    just = replace(OPEN, since_ms=T0_MS - HOUR_MS, window_ms=None)
    state, _ = walked(BY_HAND, replace(WORLD, standing=just))
    assert state.step is StepName.WATCHING and "begins by itself, or when a person asks" in state.text
    asked_for, _ = walked(BY_HAND, replace(WORLD, standing=just, request=asked(Word.DIAGNOSE)), state=state)
    assert asked_for.span_at_ms == (T0_MS - HOUR_MS, T0_MS)


def test_while_the_machine_is_stated_to_be_healthy_nothing_begins_by_itself() -> None:
    stated = replace(WORLD, standing=OPEN, healthy_until_ms=T0_MS + 1)
    assert walked(BY_HAND, stated)[0].step is StepName.WATCHING
    assert walked(BY_HAND, replace(stated, request=asked(Word.DIAGNOSE)))[0].step is StepName.COMPOSING
    assert walked(BY_HAND, replace(stated, at_ms=T0_MS + 1))[0].step is StepName.COMPOSING


def test_a_twin_that_was_never_right_is_put_to_all_of_the_last_month() -> None:
    first = replace(WORLD, is_first=True, live_since_ms=T0_MS - HOUR_MS)
    opened = replace(OPEN, since_ms=T0_MS - HOUR_MS + 60_000, window_ms=None)
    assert walked(BY_HAND, replace(first, standing=opened))[0].span_at_ms == (T0_MS - 30 * 24 * HOUR_MS, T0_MS)
    for other in (replace(first, standing=replace(opened, grows="it grows")), replace(first, standing=opened, is_first=False)):
        state, _ = walked(BY_HAND, replace(other, request=asked(Word.DIAGNOSE)))
        assert state.span_at_ms == (opened.since_ms, T0_MS)


def test_no_case_reaches_further_back_than_it_may() -> None:
    long_open = replace(OPEN, since_ms=T0_MS - 900 * 24 * HOUR_MS)
    state, _ = walked(LoopConfig(history_days=30.0), replace(WORLD, standing=long_open))
    assert state.span_at_ms[0] == T0_MS - 30 * 24 * HOUR_MS


@pytest.mark.parametrize(
    ("work", "says"),
    [
        (Work(failed="no spindle_temp_c in that stretch"), "no spindle_temp_c"),
        (Work(finding=Finding(False, "the diagnosis finds no cause")), "finds no cause"),
        (Work(finding=Finding(True, "nothing to correct", LIVE, CARD)), "nothing to correct"),
    ],
)
def test_what_leads_to_nothing_is_refused_and_not_asked_again_at_once(work: Work, says: str) -> None:
    begun = walked(BY_HAND, replace(WORLD, standing=OPEN))[0].now(step=StepName.DIAGNOSING)
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN, work=work), state=begun)
    assert state.step is StepName.REFUSED and says in state.text
    soon = replace(WORLD, standing=OPEN, at_ms=T0_MS + 23 * HOUR_MS)
    assert walked(BY_HAND, soon, state=state)[0].step is StepName.REFUSED
    later = replace(WORLD, standing=OPEN, at_ms=T0_MS + 25 * HOUR_MS)
    again, _ = walked(BY_HAND, later, state=state)
    assert again.step is StepName.COMPOSING and again.case != begun.case
    assert walked(BY_HAND, replace(later, standing=CLOSED), state=state)[0].step is StepName.WATCHING


def in_shadow(config: LoopConfig) -> State:
    return walked(config, replace(WORLD, standing=OPEN, challenger=VB, card=CARD))[0]


def shadowed(hours: float, standing: Standing = SHADOWED) -> World:
    at_ms = T0_MS + 1 + round(hours * HOUR_MS)
    return replace(WORLD, at_ms=at_ms, standing=standing, challenger=VB, card=CARD)


def test_by_hand_nothing_is_promoted_however_much_better_it_is() -> None:
    state, deed = walked(BY_HAND, shadowed(0.0), shadowed(500.0), state=in_shadow(BY_HAND))
    assert (state.step, deed) == (StepName.SHADOW, None)


def test_by_rule_it_is_promoted_after_its_time_beside_the_live_one() -> None:
    state, deed = walked(BY_RULE, shadowed(0.0), shadowed(0.99), state=in_shadow(BY_RULE))
    assert deed is None
    state, deed = walked(BY_RULE, shadowed(1.01), state=state)
    assert isinstance(deed, MakeLive) and (deed.version, deed.by) == (VB, "rule")
    assert deed.shadow is not None and why_not(VB, VA, None, deed.shadow) is None
    assert "3.1 → 1.0 × the repeatability" in deed.why


@pytest.mark.parametrize(
    ("live", "challenger", "card"),
    [
        ({"spindle_temp_c": 3.1}, {"spindle_temp_c": 2.9}, CARD),  # not by enough
        (
            {"spindle_temp_c": 3.1, "spindle_load_pct": 1.0},
            {"spindle_temp_c": 1.0, "spindle_load_pct": 1.3},
            CARD,
        ),  # worse in one
        ({"spindle_temp_c": 3.1}, {"spindle_load_pct": 1.0}, CARD),  # in no signal both
        (
            {"spindle_temp_c": 3.1},
            {"spindle_temp_c": 1.0},
            CARD.model_copy(update={"score": Score(live=1.0, challenger=2.0, runs=1)}),
        ),
    ],
)
def test_the_rule_promotes_nothing_that_is_not_better_everywhere(
    live: dict[str, float], challenger: dict[str, float], card: Card
) -> None:
    standing = replace(SHADOWED, live=live, challenger=challenger)
    worlds = [replace(shadowed(hours, standing), card=card) for hours in (0.0, 2.0)]
    assert walked(BY_RULE, *worlds, state=in_shadow(BY_RULE))[1] is None


def test_a_gap_under_its_floor_is_none_and_stands_against_no_challenger() -> None:
    live, challenger = ({"spindle_temp_c": 3.1, "spindle_load_pct": gap} for gap in (0.5, 1.0))
    standing = replace(SHADOWED, live=live, challenger=challenger | {"spindle_temp_c": 1.0})
    worlds = [replace(shadowed(hours, standing), card=CARD) for hours in (0.0, 2.0)]
    assert isinstance(walked(BY_RULE, *worlds, state=in_shadow(BY_RULE))[1], MakeLive)


def test_the_rule_withdraws_what_is_worse() -> None:
    standing = replace(SHADOWED, challenger={"spindle_temp_c": 4.0})
    deed = walked(BY_RULE, shadowed(0.0, standing), shadowed(2.0, standing), state=in_shadow(BY_RULE))[1]
    assert isinstance(deed, Withdraw) and deed.by == "rule"


def test_figures_of_the_challenger_before_count_for_nothing() -> None:
    stale = replace(SHADOWED, challenger_at_ms=T0_MS - 1)
    state, deed = walked(BY_RULE, shadowed(0.0, stale), shadowed(5.0, stale), state=in_shadow(BY_RULE))
    assert deed is None
    shadow = shadow_of(BY_RULE, state, shadowed(5.0, stale))
    assert shadow is not None and (shadow.seconds, shadow.sums) == (0.0, None)


def promoted(config: LoopConfig) -> State:
    state = walked(config, shadowed(0.0), state=in_shadow(config))[0]
    return walked(config, after(0.0, SHADOWED), state=state)[0]


HOUR_S = 3600.0


def after(hours: float, standing: Standing = CLOSED) -> World:
    at_ms = T0_MS + 1 + round(hours * HOUR_MS)
    heard = replace(standing, at_ms=at_ms)
    return replace(WORLD, live=VB, live_card=CARD, live_since_ms=T0_MS, at_ms=at_ms, standing=heard)


def test_a_promotion_is_told_with_the_gap_before_and_after() -> None:
    state = promoted(BY_HAND)
    assert state.step is StepName.PROMOTED and dict(state.before) == {"spindle_temp_c": 3.1}
    state, deed = walked(BY_HAND, after(0.1), state=state)
    assert deed is None and "coolant cools: gap of the spindle temperature 3.1 → 1.0 × the repeatability since " in state.text
    assert state.last is not None and (state.last.before, state.last.after) == (3.1, 1.0)
    assert walked(BY_HAND, after(25.0), state=state)[0].step is StepName.WATCHING


def test_it_goes_back_by_itself_where_the_gap_grows_and_not_after_its_time() -> None:
    worse = Standing(at_ms=T0_MS, live={"spindle_temp_c": 3.7})
    _, deed = walked(BY_HAND, after(0.1, worse), state=promoted(BY_HAND))
    assert isinstance(deed, Back) and (deed.version, deed.by) == (VB, "rule")
    assert "3.7 × the repeatability; before the promotion it was 3.1" in deed.why
    alike = Standing(at_ms=T0_MS, live={"spindle_temp_c": 3.5})
    assert walked(BY_HAND, after(0.1, alike), state=promoted(BY_HAND))[1] is None
    state, deed = walked(BY_HAND, after(24.1, worse), state=promoted(BY_HAND))
    assert (state.step, deed) == (StepName.WATCHING, None)


def test_figures_that_the_description_before_has_left_are_no_reason_to_go_back() -> None:
    soon, still = 1.0 / HOUR_S, 30.0 / HOUR_S
    left = Standing(at_ms=T0_MS, live={"spindle_temp_c": 9.9}, challenger={"spindle_temp_c": 1.0})
    for hours, standing in ((soon, replace(left, challenger={})), (still, left)):
        state, deed = walked(BY_HAND, after(hours, standing), state=promoted(BY_HAND))
        assert deed is None
        assert state.last is not None and state.last.after is None
    assert isinstance(walked(BY_HAND, after(still, replace(left, challenger={})), state=promoted(BY_HAND))[1], Back)
    assert isinstance(walked(BY_HAND, after(0.1, left), state=promoted(BY_HAND))[1], Back)


def test_after_the_way_back_it_is_quiet_for_a_while() -> None:
    back = replace(after(1.0, OPEN), live=VA, live_card=None, live_said="back by rule: the gap has grown")
    state, _ = walked(BY_HAND, back, state=promoted(BY_HAND))
    assert state.step is StepName.WATCHING
    state, deed = walked(BY_HAND, replace(back, at_ms=back.at_ms + HOUR_MS), state=state)
    assert (state.step, deed, state.last) == (StepName.WATCHING, None, None)


def test_what_people_ask_is_done_once_and_answered() -> None:
    state = in_shadow(BY_HAND)
    _, deed = walked(BY_HAND, replace(shadowed(0.0), request=asked(Word.PROMOTE, VB)), state=state)
    assert isinstance(deed, MakeLive) and (deed.by, deed.why) == ("anna", CARD.sentence)
    _, deed = walked(BY_HAND, replace(shadowed(0.0), request=asked(Word.WITHDRAW, VB)), state=state)
    assert deed == Withdraw(VB, "anna", "")
    refused, deed = walked(BY_HAND, replace(shadowed(0.0), request=asked(Word.DIAGNOSE)), state=state)
    assert deed is None and not refused.answers[-1].done and "promote or withdraw it first" in refused.answers[-1].text
    again, _ = walked(BY_HAND, replace(shadowed(0.0), request=asked(Word.DIAGNOSE)), state=refused)
    assert len(again.answers) == 1


def test_a_diagnosis_under_way_can_be_ended() -> None:
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN))
    state, deed = walked(BY_HAND, replace(WORLD, standing=OPEN, request=asked(Word.WITHDRAW)), state=state)
    assert (state.step, state.case, deed) == (StepName.WATCHING, "", None)
    assert walked(BY_HAND, replace(WORLD, standing=OPEN), state=state)[0].step is StepName.WATCHING


def test_another_description_in_between_drops_the_question() -> None:
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN))
    state, _ = walked(BY_HAND, replace(WORLD, standing=OPEN, live="0" * 12, live_said="described by file"), state=state)
    assert (state.step, state.case, state.live) == (StepName.WATCHING, "", "0" * 12)


def test_a_wrong_file_is_waited_for() -> None:
    state, _ = walked(BY_HAND, replace(WORLD, standing=CLOSED))
    state, deed = walked(BY_HAND, replace(WORLD, standing=OPEN, fault="vmc.toml: nome is not known"), state=state)
    assert deed is None and "the loop waits" in state.text and not state.case
    assert walked(BY_HAND, replace(WORLD, standing=OPEN), state=state)[0].step is StepName.COMPOSING


def test_a_state_that_cannot_be_read_finds_its_place_by_the_folder() -> None:
    state = read_state({"step": "nowhere"})
    assert walked(BY_HAND, shadowed(0.0), state=state)[0].step is StepName.SHADOW


@dataclass
class Plant:
    """A folder, a gap and work as they really are; the loop sees them now and then, and is killed in between."""

    config: LoopConfig
    live: str = VA
    challenger: str = ""
    at_ms: int = T0_MS
    is_open: bool = True
    promotions: list[str] = field(default_factory=list)
    backs: int = 0
    state: State = field(default_factory=State)
    shadow: Shadow | None = None

    def world(self, request: Request | None) -> World:
        gap = {VA: 3.1 if self.is_open else 1.0, VB: 1.0}
        standing = Standing(
            at_ms=self.at_ms,
            opens="spindle_temp_c" if gap[self.live] > 2.0 else "",
            live={"spindle_temp_c": gap[self.live]},
            challenger={"spindle_temp_c": gap[VB]} if self.challenger else {},
            challenger_at_ms=self.at_ms if self.challenger else 0,
        )
        work = (
            Work(is_done=True, finding=FOUND if self.state.step is StepName.DIAGNOSING else None) if self.state.case else Work()
        )
        card = CARD if self.challenger else None
        return World(
            machine="vmc",
            now_ms=self.at_ms,
            at_ms=self.at_ms,
            live=self.live,
            challenger=self.challenger,
            card=card,
            live_card=CARD if self.live == VB else None,
            standing=standing,
            work=work,
            request=request,
        )

    def look(self, killed: str, request: Request | None = None) -> None:
        """killed: before the deed is done, before the state is kept, or not."""
        state, deed = stepped(self.config, read_state(self.state.model_dump(mode="json")), self.world(request))
        if killed == "before the deed":
            return
        if deed is not None:
            self.do(deed)
        if killed != "before the state":
            self.state = state

    def do(self, deed: Deed) -> None:
        if isinstance(deed, File) and not self.challenger and self.live != VB:
            self.challenger = VB
        elif isinstance(deed, MakeLive) and deed.version == self.challenger and self.challenger:
            assert why_not(self.challenger, self.live, CARD, deed.shadow) is None
            self.promotions.append(self.live)
            self.live, self.challenger = self.challenger, ""
        elif isinstance(deed, Back) and deed.version == self.live and self.live == VB:
            self.live = VA
            self.backs += 1
        elif isinstance(deed, Withdraw) and deed.version == self.challenger:
            self.challenger = ""


LOOKS = st.lists(
    st.tuples(
        st.sampled_from(["not", "before the deed", "before the state"]),
        st.integers(0, 40),
        st.sampled_from([None, None, None, Word.DIAGNOSE, Word.PROMOTE]),
    ),
    max_size=30,
)


@given(LOOKS)
def test_wherever_it_is_killed_it_comes_to_the_same_end_and_promotes_once(
    looks: list[tuple[str, int, Word | None]],
) -> None:
    plant = Plant(BY_RULE)
    for number, (killed, minutes, word) in enumerate(looks):
        plant.at_ms += 60_000 * minutes
        request = None if word is None else Request(word, "vmc", "anna", VB if word is Word.PROMOTE else "", "", str(number))
        plant.look(killed, request)
    for _ in range(30):
        plant.at_ms += 10 * 60_000
        plant.look("not")
    assert (plant.live, plant.challenger, plant.promotions, plant.backs) == (VB, "", [VA], 0)


@given(LOOKS)
def test_a_healthy_machine_is_never_promoted(looks: list[tuple[str, int, Word | None]]) -> None:
    plant = Plant(BY_RULE, is_open=False)
    for killed, minutes, _ in looks:
        plant.at_ms += 60_000 * minutes
        plant.look(killed)
    assert (plant.live, plant.promotions, plant.state.step) == (VA, [], StepName.WATCHING)
