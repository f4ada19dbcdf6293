"""The fold that every engine runs: count, sum and a ring of the newest values of a key, in a state of a given size.

The state is a packed buffer, so that engines which keep it as a value need no second format. Integers make every result exact.

>>> state = bytearray(32)
>>> [json.loads(folded(state, message(number, 1)))["sum"] for number in (0, 1, 2)]
[0, 427799, 1283397]
>>> HEAD.unpack_from(state)
(3, 1283397)
>>> json.loads(folded(state, message(3, 1)))["oldest"]
427799
"""

import json
import struct
from collections.abc import Iterator

KEYS, PARTITIONS, MESSAGE_BYTES = 64, 4, 200
HEAD, CELL = struct.Struct("<qq"), struct.Struct("<q")


def key_of(number: int, keys: int = KEYS) -> int:
    """Return the key of an input message."""
    return number % keys


def message(number: int, keys: int = KEYS) -> bytes:
    """Return an input message of 200 bytes."""
    reading = {"machine": f"vmc-{key_of(number, keys):02}", "value": number * 2_654_435_761 % 1_000_003, "note": ""}
    short = json.dumps(reading)
    return (short[:-2] + "x" * (MESSAGE_BYTES - len(short)) + short[-2:]).encode()


def folded(state: bytearray, value: bytes) -> bytes:
    """Fold a message into the state of its key and return the output."""
    reading = json.loads(value)
    count, total = HEAD.unpack_from(state)
    cells = (len(state) - HEAD.size) // CELL.size
    at = HEAD.size + CELL.size * (count % cells)
    (oldest,) = CELL.unpack_from(state, at)
    CELL.pack_into(state, at, reading["value"])
    HEAD.pack_into(state, 0, count + 1, total + reading["value"])
    result = {"machine": reading["machine"], "count": count + 1, "sum": total + reading["value"], "oldest": oldest}
    return json.dumps(result).encode()


def expected(messages: int, state_bytes: int) -> Iterator[tuple[str, int, tuple[int, int]]]:
    """Yield machine, count, and sum with oldest value, of each output that these messages must bring."""
    states = [bytearray(state_bytes) for _ in range(KEYS)]
    for number in range(messages):
        output = json.loads(folded(states[key_of(number)], message(number)))
        yield output["machine"], output["count"], (output["sum"], output["oldest"])
