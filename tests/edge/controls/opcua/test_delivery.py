"""What the notifications of a subscription mean."""

from hypothesis import given, settings
from hypothesis import strategies as st

from edge.controls.opcua.delivery import OPENING_S_MAX, SEQUENCE_MAX, Delivery, Load, Notification
from edge.sweep import Fact, Hole


def delivery(
    outage: tuple[str, int] | None = None, *, sampled_ms: float = 100.0, items: tuple[str, ...] = ("a", "b")
) -> Delivery:
    return Delivery(
        frozenset(items), 100.0, sampled_ms, 50, silent_s_max=3.0, began_ms=10_000, began_s=10.0,
        faults=(Fact("c", fault="BadNodeIdUnknown"),), outage=outage,
    )  # fmt: skip


def opened() -> Delivery:
    one = delivery()
    assert one.take(Notification(1, (Fact("a", 1), Fact("b", 2))), 10_100, 10.1)
    return one


def test_the_state_as_found_is_one_load_with_the_hole_before_it_and_what_cannot_be_watched() -> None:
    one = delivery(("session lost", 4_000))
    assert one.take(Notification(1, (Fact("a", 1),)), 10_050, 10.05) == []
    (load,) = one.take(Notification(2, (Fact("b", 2),)), 10_100, 10.1)
    assert load.facts == (Fact("c", fault="BadNodeIdUnknown"), Fact("a", 1), Fact("b", 2))
    assert load.holes == (Hole("session lost", 4_000, 10_100, 2 * 62),)


def test_a_second_value_of_an_item_is_a_change_and_comes_in_a_load_of_its_own() -> None:
    one = delivery()
    first, second = one.take(Notification(1, (Fact("a", 1), Fact("a", 3), Fact("b", 2))), 10_100, 10.1)
    assert [fact.value for fact in first.facts] == [None, 1, 2]
    assert second == Load((Fact("a", 3),))


def test_an_item_that_never_comes_does_not_hold_up_the_others() -> None:
    one = delivery()
    one.take(Notification(1, (Fact("a", 1),)), 10_050, 10.05)
    assert one.tick(11_000, 11.0) == []
    (load,) = one.tick(13_000, 10.0 + OPENING_S_MAX)
    assert [fact.key for fact in load.facts] == ["c", "a"]
    assert one.take(Notification(2, (Fact("b", 2),)), 14_000, 12.9) == [Load((Fact("b", 2),))]


def test_a_number_that_is_left_out_is_a_hole_with_the_most_that_it_can_have_held() -> None:
    one = opened()
    (load,) = one.take(Notification(4, (Fact("a", 9),)), 10_400, 10.4)
    assert load.holes == (Hole("2 notifications missing", 10_100, 10_400, 2 * 4),)
    assert one.take(Notification(5, (Fact("a", 10),)), 10_500, 10.5) == [Load((Fact("a", 10),))]


def test_a_keep_alive_uses_no_number_but_tells_one_that_is_missing() -> None:
    one = opened()
    assert one.take(Notification(2, is_keep_alive=True), 11_000, 11.0) == []
    assert one.take(Notification(2, is_keep_alive=True), 12_000, 12.0) == []
    (load,) = one.take(Notification(3, is_keep_alive=True), 13_000, 13.0)
    assert load.holes[0].reason == "1 notifications missing"
    assert one.take(Notification(3, (Fact("a", 1),)), 13_100, 13.1) == [Load((Fact("a", 1),))]


def test_after_the_last_number_comes_the_first() -> None:
    one = opened()
    one.take(Notification(SEQUENCE_MAX, is_keep_alive=True), 10_200, 10.2)
    assert one.take(Notification(SEQUENCE_MAX, (Fact("a", 1),)), 10_300, 10.3) == [Load((Fact("a", 1),))]
    assert one.take(Notification(1, (Fact("a", 2),)), 10_400, 10.4) == [Load((Fact("a", 2),))]


def test_a_queue_that_ran_over_is_a_hole_of_that_item_alone() -> None:
    (load,) = opened().take(Notification(2, (Fact("a", 9),), overflowed=("a", "a")), 10_600, 10.6)
    assert load.holes == (Hole("queue of the server ran over: a", 10_100, 10_600, 6),)


def test_a_server_that_was_silent_for_too_long_leaves_a_hole_though_it_goes_on_counting() -> None:
    (load,) = opened().take(Notification(2, (Fact("a", 9),)), 14_100, 14.1)
    assert load.holes == (Hole("the server was silent", 10_100, 14_100, 2 * 41),)
    assert opened().take(Notification(2, (Fact("a", 9),)), 13_000, 13.0)[0].holes == ()


def test_where_the_server_does_not_tell_how_often_it_samples_its_queue_is_the_bound() -> None:
    one = delivery(("session lost", 9_000), sampled_ms=0.0, items=("a",))
    (load,) = one.take(Notification(1, (Fact("a", 1),)), 10_000, 10.0)
    assert load.holes[0].lost == 11 * 50


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(1, 12), st.lists(st.sampled_from("ab"), max_size=3), st.booleans()), max_size=12))
def test_no_value_is_ever_left_out_and_none_comes_twice(told: list[tuple[int, list[str], bool]]) -> None:
    one, given_, handed_on = delivery(), list[Fact](), list[Fact]()
    for step, (sequence, keys, is_silent) in enumerate(told):
        facts = tuple(Fact(key, f"{step}.{number}") for number, key in enumerate(keys))
        given_ += facts
        now_ms = 10_100 + 100 * step + (5_000 if is_silent else 0)
        handed_on += [
            f for load in one.take(Notification(sequence, facts, (), not facts), now_ms, now_ms / 1000) for f in load.facts
        ]
    handed_on += [fact for load in one.tick(99_000, 99.0) for fact in load.facts]
    assert sorted(fact for fact in handed_on if not fact.fault) == sorted(given_)
