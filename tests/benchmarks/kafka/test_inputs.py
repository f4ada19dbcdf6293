"""The readings of a kill run beside what the witness saw: each missing message is found, and laid to the right account."""

from array import array
from collections.abc import Iterable

from benchmarks.kafka.inputs import Inputs, Kill, Missing
from benchmarks.kafka.witness import Noted
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.records.record import Origin, Record

NODE, MACHINE = NodeId("cnc", "edge-m"), "m"
BORN_MS, STEP_MS, LENGTH = 1_000_000, 100, 100
KILL = Kill(BORN_MS + 5000, BORN_MS + 6000)


def record(number: int, kind: EventKind = EventKind.DATA, born_ms: int = BORN_MS) -> Record:
    """The record of a message of the machine, taken in as it was sent."""
    at_ms = BORN_MS + number * STEP_MS
    return Record(HostEvent(kind, NODE, MACHINE, at_ms), at_ms, "b0", Origin(0, born_ms, number % 256))


def held(numbers: Iterable[int]) -> Inputs:
    """The readings of a log that holds these messages."""
    inputs = Inputs()
    for number in numbers:
        inputs.take(record(number))
    return inputs


def missing(numbers: Iterable[int], *kills: Kill) -> Missing:
    """Return what is missing where the witness saw all messages, and the log holds these."""
    noted = Noted({MACHINE: array("q")})
    for number in range(LENGTH):
        noted.messages[MACHINE].extend((BORN_MS, BORN_MS + number * STEP_MS, number % 256))
    return held(numbers).missing(noted, kills)


def without(*lost: range) -> list[int]:
    """The numbers of all messages but some."""
    return [number for number in range(LENGTH) if not any(number in one for one in lost)]


def test_nothing_is_missing_of_what_is_there() -> None:
    found = missing(range(LENGTH), KILL)
    assert (found.in_memory, found.unbridged, found.otherwise, found.first) == (0, 0, 0, "")
    assert found.blind_s == [1.0]


def test_one_message_that_is_lost_far_from_a_kill_is_found() -> None:
    for kills in ((), (KILL,)):
        found = missing(without(range(20, 21)), *kills)
        assert (found.in_memory, found.unbridged, found.otherwise) == (0, 0, 1)
        assert found.first == f"{MACHINE}: 1 messages from {BORN_MS + 20 * STEP_MS} on"


def test_messages_behind_the_first_data_of_a_new_bridge_are_lost_otherwise() -> None:
    assert missing(without(range(70, 73)), KILL).otherwise == 3


def test_what_a_kill_cost_is_told_by_its_moment() -> None:
    found = missing(without(range(48, 65)), KILL)
    assert (found.in_memory, found.unbridged, found.otherwise) == (2, 15, 0)


def test_a_machine_that_the_log_does_not_know_is_missing_as_a_whole() -> None:
    assert missing(()).otherwise == LENGTH


def test_a_gap_in_the_numbers_is_found_unless_a_hole_is_told() -> None:
    inputs = held(without(range(20, 22)))
    assert inputs.gaps == 1 and "22 after 19" in inputs.first_gap
    told = held(range(20))
    told.take(record(21, EventKind.HOLE))
    for number in range(22, LENGTH):
        told.take(record(number))
    assert (told.gaps, told.holes) == (0, 1)


def test_a_new_life_begins_with_any_number_and_numbers_begin_again_after_255() -> None:
    inputs = held(range(300))
    inputs.take(record(310, EventKind.BIRTH, born_ms=BORN_MS + 1))
    inputs.take(record(311, born_ms=BORN_MS + 1))
    assert (inputs.gaps, inputs.data) == (0, 301)


def test_a_message_out_of_order_and_one_that_is_doubled_are_found() -> None:
    swapped = held([0, 1, 3, 2, 4])
    assert swapped.gaps == 3 and swapped.data == 5
    doubled = held([0, 1, 1, 2])
    assert (doubled.repeated, doubled.data, doubled.gaps) == (1, 3, 0)
