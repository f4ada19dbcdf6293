"""A description that changes in mid-stream: where it begins to hold, and what goes on."""

import pytest

from processors.actions import Action, Publish
from processors.description import Role
from processors.running.engine import Engine
from sparkplug.metric import NodeId
from tests.processors.describing import DESCRIBING, SUM, VERSION, description
from tests.processors.streams import birth, data, death, engine_of, fed


def last(actions: list[Action], name: str) -> object:
    """The value of a metric that was published last; "unchanged" where it was not."""
    changes = [change for action in actions if isinstance(action, Publish) for change in action.changes]
    return next((change.value for change in reversed(changes) if change.name == name), "unchanged")


def described(power_kw: float | None) -> Engine:
    engine = engine_of(DESCRIBING)
    if power_kw is not None:
        engine.describe("okuma", Role.LIVE, description(power_kw))
    return engine


@pytest.mark.parametrize(("power_kw", "expected"), [(None, 10.0), (4.0, 40.0)])
def test_a_machine_is_folded_with_its_description_else_with_what_is_assumed(power_kw: float | None, expected: float) -> None:
    actions = fed(described(power_kw), birth(0.0, spindle_rpm=10.0))
    assert last(actions, SUM) == expected
    assert last(actions, VERSION) == ("assumed" if power_kw is None else description(power_kw).version)


def test_a_new_one_holds_behind_the_next_message_and_the_state_goes_on() -> None:
    engine = described(1.0)
    fed(engine, birth(0.0, spindle_rpm=10.0))
    engine.describe("okuma", Role.LIVE, description(5.0))
    actions = fed(engine, data(0.2, spindle_rpm=100.0))
    assert (last(actions, SUM), last(actions, VERSION)) == (110.0, "unchanged")
    actions = fed(engine, data(0.4, spindle_rpm=2.0))
    assert (last(actions, SUM), last(actions, VERSION)) == (120.0, description(5.0).version)


def test_ticks_of_a_silence_are_of_the_one_before_whenever_they_were_given() -> None:
    early, late = described(1.0), described(1.0)
    for engine in (early, late):
        fed(engine, birth(0.0, spindle_rpm=1.0))
    early.silence(5.5)  # the clock on the wall came first
    for engine in (early, late):
        engine.describe("okuma", Role.LIVE, description(50.0))
        fed(engine, data(6.1, spindle_rpm=1.0), data(6.2, spindle_rpm=1.0), wall_s=6.0)
    assert early.snapshot("okuma") == late.snapshot("okuma")


def test_what_another_processor_says_is_no_message_of_the_machine() -> None:
    """It may come earlier or later: another process takes its own time."""
    other = NodeId("cnc", "twin-thermal")
    engine = described(1.0)
    fed(engine, birth(0.0, spindle_rpm=1.0), birth(0.0, node=other, **{"twin/of_others": 1.0}))
    engine.describe("okuma", Role.LIVE, description(5.0))
    fed(engine, data(0.1, node=other, **{"twin/of_others": 2.0}))
    assert last(fed(engine, data(0.2, spindle_rpm=2.0)), VERSION) == "unchanged"
    assert last(fed(engine, data(0.3, spindle_rpm=3.0)), VERSION) == description(5.0).version


def test_of_several_before_a_message_the_last_holds() -> None:
    engine = described(1.0)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    for power_kw in (2.0, 3.0, 4.0):
        engine.describe("okuma", Role.LIVE, description(power_kw))
    actions = fed(engine, data(0.1, spindle_rpm=1.0), data(0.2, spindle_rpm=1.5))
    assert last(actions, VERSION) == description(4.0).version


def test_of_a_machine_that_is_offline_it_holds_at_once() -> None:
    engine = described(1.0)
    fed(engine, birth(0.0, spindle_rpm=1.0), death(0.5))
    engine.describe("okuma", Role.LIVE, description(3.0))
    assert last(fed(engine, birth(1.0, spindle_rpm=2.0)), VERSION) == description(3.0).version


def test_a_description_that_is_taken_away_leaves_what_is_assumed() -> None:
    engine = described(7.0)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    engine.describe("okuma", Role.LIVE, None)
    assert last(fed(engine, data(0.1, spindle_rpm=1.0), data(0.2, spindle_rpm=2.0)), VERSION) == "assumed"


def test_one_that_is_refused_leaves_the_one_before() -> None:
    engine = described(1.0)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    with pytest.raises(ValueError, match="thirteen"):
        engine.describe("okuma", Role.LIVE, description(13.0))
    assert last(fed(engine, data(0.1, spindle_rpm=1.0), data(0.2, spindle_rpm=2.0)), SUM) == 4.0


def test_another_machine_keeps_its_own() -> None:
    engine = described(3.0)
    actions = fed(engine, birth(0.0, device="mazak", spindle_rpm=2.0))
    assert last(actions, SUM) == 2.0


def test_a_change_is_the_same_as_a_restart_with_the_new_one_and_that_state() -> None:
    whole, before, after = described(2.0), described(2.0), described(6.0)
    opening = [birth(0.0, spindle_rpm=10.0), data(3.5, spindle_rpm=20.0)]
    fed(whole, *opening)
    whole.describe("okuma", Role.LIVE, description(6.0))
    fed(whole, data(3.7, spindle_rpm=21.0))
    fed(before, *opening, data(3.7, spindle_rpm=21.0))
    after.restore(before.snapshot("okuma"))
    fed(after, birth(3.7, spindle_rpm=21.0))
    fed(whole, birth(3.7, spindle_rpm=21.0))  # what comes back asks for births, and all hear them
    rest = [data(9.2, spindle_rpm=5.0), data(30.0, spindle_rpm=0.0)]
    assert fed(after, *rest) == fed(whole, *rest)


def test_the_engine_that_takes_over_knows_what_the_one_before_was_told() -> None:
    again = Engine(DESCRIBING, DESCRIBING.configured({}), before=described(9.0))
    assert last(fed(again, birth(0.0, spindle_rpm=1.0)), SUM) == 9.0
