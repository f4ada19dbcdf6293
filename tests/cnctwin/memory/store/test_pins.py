"""Pins that overlap are one stretch, with every reason; what is pinned is the same as before."""

from hypothesis import given
from hypothesis import strategies as st

from cnctwin.memory.store.contract import Pinned, merged

MINUTES = st.integers(0, 60)
PINS = st.lists(
    st.builds(
        lambda machine, begin, length, reason: Pinned(machine, begin, begin + length, reason),
        *(st.sampled_from(["vmc", "lathe"]), MINUTES, st.integers(1, 10), st.sampled_from(["anomaly_alarm", "gap_growing"])),
    ),
    max_size=12,
)


def test_four_firings_of_an_alarm_are_one_stretch() -> None:
    assert merged(Pinned("vmc", at, at + 20, "load") for at in (0, 10, 20, 35)) == [Pinned("vmc", 0, 55, "load")]


def test_stretches_of_two_machines_and_stretches_apart_stay_apart() -> None:
    pins = [Pinned("lathe", 0, 20, "load"), Pinned("vmc", 10, 30, "load"), Pinned("vmc", 31, 40, "load")]
    assert merged(pins) == pins


@given(PINS)
def test_what_is_pinned_is_the_same_and_no_reason_is_lost(pins: list[Pinned]) -> None:
    def minutes(given: list[Pinned]) -> set[tuple[str, int, str]]:
        return {
            (pin.machine, at, reason)
            for pin in given
            for at in range(pin.from_ms, pin.to_ms)
            for reason in pin.reason.split(", ")
        }

    stretches = merged(pins)
    assert {(machine, at) for machine, at, _ in minutes(stretches)} == {(machine, at) for machine, at, _ in minutes(pins)}
    assert minutes(pins) <= minutes(stretches)
    assert merged(stretches) == stretches
