"""What stands among the saved states and is none: keys of others are left alone, and what cannot be read is named."""

from random import Random

import pytest

from processors.discovery import discover
from processors.errors import SnapshotError
from processors.partition.partition import Partition
from tests.processors.partition.test_partition import Kept, partition_of, saved, shift, states

THERMAL = discover()["thermal"]
GARBAGE = {
    "no JSON": b"\xff\x00 hello",
    "nothing": b"",
    "a number": b"7",
    "a list": b"[]",
    "nothing of it": b"{}",
    "another type": b'{"processors":7,"folded":"x","devices":[]}',
    "deep": b"[" * 100_000,
    "one place": b'{"processors":{"thermal":[1]},"folded":1,"devices":{"m":{"n":[1]}}}',
    "words": b'{"processors":{"thermal":["a","b"]},"folded":1,"devices":{"m":{"n":["a","b","c"]}}}',
    "before the beginning": b'{"processors":{"thermal":[-1,-1]},"folded":-1,"devices":{}}',
}


def folded(kept: Kept) -> Partition:
    """A partition with a shift behind it, and what it has saved."""
    partition = partition_of(THERMAL)
    partition.restore(kept)
    records = shift()
    while partition.next < len(records):
        list(partition.take(partition.next, records[partition.next]))
    saved(partition, kept)
    key, marker = partition.mark()
    kept[key] = marker
    return partition


@pytest.mark.parametrize("value", GARBAGE.values(), ids=list(GARBAGE))
@pytest.mark.parametrize("key", ["hello", "", "~", "~elsewhere/test", "thermal", "therm/okuma", "\ufffd/okuma"])
def test_a_key_that_no_runner_writes_is_left_alone(key: str, value: bytes) -> None:
    kept: Kept = {}
    before = folded(kept)
    again = partition_of(THERMAL)
    assert again.restore(kept | {key: value}) == before.next
    assert (states(again), again.faults()) == (states(before), [])


@pytest.mark.parametrize("value", GARBAGE.values(), ids=list(GARBAGE))
@pytest.mark.parametrize("key", ["~marker/test", "~marker/another", "~lives/test"])
def test_a_place_that_cannot_be_read_is_named(key: str, value: bytes) -> None:
    kept: Kept = {}
    folded(kept)
    with pytest.raises(SnapshotError) as caught:
        partition_of(THERMAL).restore(kept | {key: value})
    said = str(caught.value)
    assert said.startswith(f"{key}: ") and "\n" not in said and len(said) < 300


@pytest.mark.parametrize("seed", range(20))
def test_bytes_of_a_state_that_are_others_are_refused_or_read_and_never_more(seed: int) -> None:
    kept: Kept = {}
    folded(kept)
    chance = Random(seed)
    state = bytearray(kept["thermal/okuma"])
    for _ in range(chance.randint(1, 5)):
        state[chance.randrange(len(state))] = chance.randrange(256)
    again = partition_of(THERMAL)
    offset = again.restore(kept | {"thermal/okuma": bytes(state)})
    refused = again.faults()
    assert offset == (0 if refused else len(shift()))
    assert all(line.startswith("thermal/okuma: ") for line in refused)


def test_a_state_that_is_of_another_machine_is_refused() -> None:
    kept: Kept = {}
    folded(kept)
    kept["thermal/okuma"] = kept["thermal/okuma"].replace(b'"machines":{"okuma"', b'"machines":{"okumu"')
    again = partition_of(THERMAL)
    assert again.restore(kept) == 0
    assert "okumu" in again.faults()[0]


@pytest.mark.parametrize("value", GARBAGE.values(), ids=list(GARBAGE))
def test_a_state_that_cannot_be_read_is_named_once_and_taken_back(value: bytes) -> None:
    """It would be refused at each start, and all of the processor folded again."""
    kept: Kept = {}
    before = folded(kept)
    kept["thermal/nobody"] = value
    again = partition_of(THERMAL)
    assert again.restore(kept) == 0
    (line,) = again.faults()
    assert line.startswith("thermal/nobody: ") and line.endswith("thermal is rebuilt from what the log still holds")
    folded_again = folded(kept)
    assert "thermal/nobody" not in kept
    assert states(folded_again) == states(before)
    third = partition_of(THERMAL)
    assert third.restore(kept) == before.next and not third.faults()
