"""A challenger beside the live fold: what it sees and says, when it comes and goes, and what becomes of its state."""

import json
from dataclasses import replace
from typing import Any

import pytest

from processors.actions import Action, DeadLetter, Declare, Publish
from processors.description import Role
from processors.running.engine import Engine
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from sparkplug.quality import Quality
from tests.processors.describing import DESCRIBING, SHADOWED, description
from tests.processors.recorder import RECORDER
from tests.processors.streams import birth, data, death, engine_of, fed, named, reading

OTHER = NodeId("cnc", "twin-other")
CHALLENGERS_WORD = "twin/challenger/of_others"


def engine(live: float | None = 1.0, challenger: float | None = 2.0) -> Engine:
    made = engine_of(DESCRIBING)
    for role, power_kw in ((Role.LIVE, live), (Role.CHALLENGER, challenger)):
        if power_kw is not None:
            made.describe("okuma", role, description(power_kw))
    return made


def said(actions: list[Action]) -> dict[str, Any]:
    """The value of each metric that was published last, without that of a birth."""
    changes = [change for action in actions if isinstance(action, Publish) for change in action.changes]
    return {change.name: change.value for change in changes}


def declared(actions: list[Action]) -> list[dict[str, Any]]:
    """The metrics of each birth that was asked for."""
    return [{change.name: change.value for change in one.latest} for one in actions if isinstance(one, Declare)]


def state(one: Engine) -> tuple[float, float | None]:
    """The totals of the live fold and of the challenger."""
    live = one.known_units["okuma"].live
    return live.state.total, None if live.challenger is None else live.challenger.state.total


def other(at_s: float, **values: Any) -> HostEvent:
    """Another processor says something of the machine, with any name."""
    return data(at_s, node=OTHER, **{name.replace("__", "/"): value for name, value in values.items()})


def test_each_sample_is_folded_with_both_and_the_challenger_says_what_it_may() -> None:
    told = said(fed(engine(), birth(0.0, spindle_rpm=10.0), data(0.5, spindle_rpm=20.0)))
    assert (told["twin/sum"], told["twin/challenger/sum"]) == (30.0, 60.0)
    assert told["twin/challenger/version"] == description(2.0).version
    assert "twin/challenger/samples" not in told


def test_ticks_deaths_and_holes_reach_the_challenger() -> None:
    one = engine(1.0, 1.0)
    fed(one, birth(0.0, spindle_rpm=1.0), data(3.2, spindle_rpm=2.0), death(5.0), birth(9.0, spindle_rpm=3.0))
    live, challenger = state(one)
    assert live == challenger > 3000.0


def test_where_there_is_none_its_metrics_are_in_no_birth() -> None:
    (metrics,) = declared(fed(engine(challenger=None), birth(0.0, spindle_rpm=10.0)))
    assert not [name for name in metrics if "challenger" in name]


def test_a_machine_that_is_born_with_a_challenger_declares_its_metrics() -> None:
    (metrics,) = declared(fed(engine(), birth(0.0, spindle_rpm=10.0)))
    assert [name for name in metrics if "challenger" in name] == [
        "twin/challenger/sum", "twin/challenger/seen", "twin/challenger/version",
    ]  # fmt: skip


def test_a_challenger_starts_anew_or_from_what_the_processor_makes_of_the_live_state() -> None:
    from_live = replace(DESCRIBING, beside=lambda live: replace(live, total=live.total + 1000.0))
    for processor, expected in ((DESCRIBING, 20.0), (from_live, 1030.0 + 20.0)):
        made = engine_of(processor)
        made.describe("okuma", Role.LIVE, description(1.0))
        fed(made, birth(0.0, spindle_rpm=10.0))
        made.describe("okuma", Role.CHALLENGER, description(1.0))
        fed(made, data(0.1, spindle_rpm=20.0))
        assert state(made) == (30.0, expected), "it begins with a birth of what is known, 20"


def test_its_coming_and_going_are_births_of_the_twin_device() -> None:
    one = engine(challenger=None)
    fed(one, birth(0.0, spindle_rpm=10.0))
    assert one.describe("okuma", Role.CHALLENGER, description(2.0)) == []
    came = fed(one, data(0.1, spindle_rpm=20.0))
    (metrics,) = declared(came)
    assert (metrics["twin/sum"], metrics["twin/challenger/sum"]) == (30.0, None)
    assert said(came)["twin/challenger/sum"] == 40.0  # it begins with a birth of what is known
    one.describe("okuma", Role.CHALLENGER, None)
    went = fed(one, data(0.2, spindle_rpm=1.0))
    assert [name for name in declared(went)[0] if "challenger" in name] == []
    assert "twin/challenger/sum" not in said(fed(one, data(0.3, spindle_rpm=2.0)))


def test_the_live_fold_is_not_touched_by_a_challenger_nor_by_what_others_say() -> None:
    alone, shadowed = engine(challenger=None), engine(challenger=5.0)
    stream = [
        birth(0.0, spindle_rpm=10.0),
        birth(0.1, node=OTHER, **{SHADOWED: 1.0, CHALLENGERS_WORD: 2.0}),
        data(2.5, spindle_rpm=20.0),
        other(2.6, twin__of_others=3.0),
        other(2.7, twin__challenger__of_others=4.0),
        data(4.5, spindle_rpm=30.0),
    ]
    expected, actions = fed(alone, *stream), fed(shadowed, *stream)
    live = [
        (action.machine, action.changes)
        for action in actions
        if isinstance(action, Publish) and not action.changes[0].name.startswith("twin/challenger/")
    ]
    assert live == [(action.machine, action.changes) for action in expected if isinstance(action, Publish)]
    assert state(shadowed)[0] == state(alone)[0]


def test_its_rows_show_what_other_challengers_say_in_place_of_the_live_word() -> None:
    one = engine()
    opening = fed(one, birth(0.0, spindle_rpm=10.0), birth(0.1, node=OTHER, **{SHADOWED: 1.0}))
    assert said(opening)["twin/challenger/seen"] == 1.0  # nobody has challenged it yet
    told = said(fed(one, other(0.2, twin__challenger__of_others=7.0)))
    assert (told.get("twin/seen"), told["twin/challenger/seen"]) == (None, 7.0)
    told = said(fed(one, other(0.3, twin__of_others=2.0)))
    assert (told["twin/seen"], told.get("twin/challenger/seen")) == (2.0, None)
    told = said(fed(one, data(0.4, spindle_rpm=11.0)))
    assert (told.get("twin/seen"), told.get("twin/challenger/seen")) == (None, None)


def test_the_shorter_way_hears_other_challengers_too() -> None:
    one = engine()
    fed(one, birth(0.0, spindle_rpm=10.0), birth(0.1, node=OTHER, **{SHADOWED: 1.0, CHALLENGERS_WORD: 5.0}))
    message = named(other(0.2, twin__challenger__of_others=7.0))
    fed(one, message)
    way = one.way_of(OTHER, "okuma")
    assert way is not None
    again = named(other(0.3, twin__challenger__of_others=8.0))
    told = said(way((again.node, again.readings, again.names, again.oldest_ms, again.newest_ms), 0.3))
    assert told["twin/challenger/seen"] == 8.0


def test_what_another_challenger_said_is_stale_with_it() -> None:
    one = engine()
    fed(one, birth(0.0, spindle_rpm=10.0), birth(0.1, node=OTHER, **{SHADOWED: 1.0, CHALLENGERS_WORD: 5.0}))
    fed(one, death(0.5, node=OTHER))
    (lane,) = (machine.live for machine in one._machines.values())
    assert (lane.row[SHADOWED].quality, lane.others[SHADOWED].quality) == (Quality.STALE, Quality.STALE)


def test_a_challenger_that_fails_is_a_dead_letter_and_the_live_fold_goes_on() -> None:
    one = engine()
    fed(one, birth(0.0, spindle_rpm=10.0))
    challenger = one.known_units["okuma"].live.challenger
    assert challenger is not None
    challenger._given = None
    actions = fed(one, data(0.1, spindle_rpm=20.0))
    assert said(actions) == {"twin/sum": 30.0, "twin/samples": 30.0}
    assert [type(action) for action in actions if isinstance(action, DeadLetter)] == [DeadLetter]
    assert one.ledger.balance == 0
    assert one.ledger.dropped_total == 0


def test_promoted_its_state_becomes_the_live_one_and_the_gap_closes_at_once() -> None:
    one = engine(1.0, 3.0)
    fed(one, birth(0.0, spindle_rpm=10.0), data(0.1, spindle_rpm=20.0))
    assert state(one) == (30.0, 90.0)
    one.describe("okuma", Role.LIVE, description(3.0))
    one.describe("okuma", Role.CHALLENGER, None)
    fed(one, data(0.2, spindle_rpm=1.0))
    assert state(one) == (93.0, None)
    assert said(fed(one, data(0.3, spindle_rpm=2.0)))["twin/sum"] == 99.0


def test_promoted_while_it_stays_both_are_the_same_from_then_on() -> None:
    one = engine(1.0, 3.0)
    fed(one, birth(0.0, spindle_rpm=10.0))
    one.describe("okuma", Role.LIVE, description(3.0))
    fed(one, data(0.1, spindle_rpm=20.0), data(5.4, spindle_rpm=4.0))
    live, challenger = state(one)
    assert live == challenger


def test_another_challenger_begins_anew() -> None:
    one = engine(1.0, 3.0)
    fed(one, birth(0.0, spindle_rpm=10.0), birth(0.1, node=OTHER, **{SHADOWED: 1.0, CHALLENGERS_WORD: 5.0}))
    one.describe("okuma", Role.CHALLENGER, description(4.0))
    fed(one, data(0.2, spindle_rpm=2.0))
    assert state(one)[1] == 8.0


def test_more_that_is_known_of_the_same_version_is_taken_up_and_the_state_goes_on() -> None:
    one = engine()
    fed(one, birth(0.0, spindle_rpm=10.0))
    one.describe("okuma", Role.CHALLENGER, replace(description(3.0), version=description(2.0).version))
    fed(one, data(0.3, spindle_rpm=20.0), data(0.6, spindle_rpm=100.0))
    assert state(one) == (130.0, 2.0 * 10.0 + 2.0 * 20.0 + 3.0 * 100.0)


def test_one_that_is_refused_is_none() -> None:
    one = engine(1.0, 3.0)
    fed(one, birth(0.0, spindle_rpm=10.0))
    with pytest.raises(ValueError, match="thirteen"):
        one.describe("okuma", Role.CHALLENGER, description(13.0))
    fed(one, data(0.1, spindle_rpm=20.0))
    assert state(one) == (30.0, None)


@pytest.mark.parametrize("is_promoted", [False, True])
def test_a_restart_in_between_keeps_its_state(is_promoted: bool) -> None:
    whole, before = engine(1.0, 3.0), engine(1.0, 3.0)
    opening = [birth(0.0, spindle_rpm=10.0), birth(0.1, node=OTHER, **{SHADOWED: 1.0, CHALLENGERS_WORD: 5.0})]
    for one in (whole, before):
        fed(one, *opening, data(2.4, spindle_rpm=20.0))
    after = engine(3.0, None) if is_promoted else engine(1.0, 3.0)
    assert after.restore(before.snapshot("okuma")) == "okuma"
    if is_promoted:
        assert state(after) == (state(whole)[1], None)
        return
    assert state(after) == state(whole)
    again = [birth(2.4, spindle_rpm=20.0), data(4.7, spindle_rpm=30.0)]
    assert said(fed(after, *again)) == said(fed(whole, *again))
    assert _without_births(after) == _without_births(whole)


def _without_births(one: Engine) -> Any:
    document = json.loads(one.snapshot("okuma"))
    for lane in document["live"]["machines"].values():
        del lane["births"]
    return document


def test_the_state_of_a_challenger_that_is_none_any_more_is_let_go() -> None:
    before, after = engine(1.0, 3.0), engine(1.0, 4.0)
    fed(before, birth(0.0, spindle_rpm=10.0))
    after.restore(before.snapshot("okuma"))
    assert state(after) == (10.0, 0.0)


def test_an_identical_challenger_that_was_filed_late_does_not_take_the_state_of_the_live_one() -> None:
    """Its version is the live one's, as after a promotion; but nobody has promoted it."""
    before, after = engine(1.0, None), engine(1.0, 1.0)
    fed(before, birth(0.0, spindle_rpm=10.0), data(0.5, spindle_rpm=20.0))
    before.describe("okuma", Role.CHALLENGER, description(1.0))
    fed(before, data(0.6, spindle_rpm=5.0))
    after.restore(before.snapshot("okuma"))
    assert state(after) == state(before) == (35.0, 5.0)


def test_a_processor_that_heeds_no_description_has_no_challenger() -> None:
    one = engine_of(RECORDER)
    one.describe("okuma", Role.CHALLENGER, description(1.0))
    fed(one, birth(0.0, spindle_rpm=10.0))
    assert not one.is_described
    assert one.known_units["okuma"].live.challenger is None


def test_history_has_no_challenger() -> None:
    one = engine()
    fed(one, birth(0.0, spindle_rpm=10.0))
    late = named(data(0.0)._replace(readings=(reading("spindle_rpm", 99.0, -50.0, history=True),)))
    told = said(fed(one, late))
    assert "twin/sum" in told
    assert "twin/challenger/sum" not in told
