"""The comparison of stream engines: its fold, and the account that finds what an engine repeats, loses or gets wrong."""

import json
from pathlib import Path

import pytest

from benchmarks.stream_engines.fold import KEYS, MESSAGE_BYTES, folded, key_of, message
from benchmarks.stream_engines.ledger import Ledger
from benchmarks.stream_engines.order import Order
from benchmarks.stream_engines.report import Disturbed, Outcome, table
from benchmarks.stream_engines.worker import family

MESSAGES, STATE_BYTES = 10 * KEYS, 40


def outputs() -> list[bytes]:
    """The outputs of an undisturbed fold, in their order."""
    states = [bytearray(STATE_BYTES) for _ in range(KEYS)]
    return [folded(states[key_of(number)], message(number)) for number in range(MESSAGES)]


@pytest.mark.parametrize("number", [0, 63, 64, 1_000_000])
def test_every_message_has_its_size(number: int) -> None:
    assert len(message(number)) == MESSAGE_BYTES


def test_a_ring_gives_back_what_it_took_a_turn_ago() -> None:
    values = [json.loads(message(KEYS * turn))["value"] for turn in range(10)]
    of_one_key = [json.loads(output)["oldest"] for output in outputs()[::KEYS]]
    assert of_one_key == [0, 0, 0, *values[:7]]


def test_an_undisturbed_fold_is_exact() -> None:
    ledger = Ledger(MESSAGES, STATE_BYTES)
    assert [ledger.take(output) for output in outputs()] == [True] * MESSAGES
    assert (ledger.complete, ledger.repeated(), ledger.exact()) == (True, 0, KEYS)


def test_repeated_lost_and_wrong_outputs_are_told_apart() -> None:
    ledger = Ledger(MESSAGES, STATE_BYTES)
    told = outputs()
    forgotten = json.dumps({**json.loads(told[5]), "sum": -1}).encode()
    for output in [*told[:5], forgotten, *told[6:-1], *told[100:110]]:
        ledger.take(output)
    assert (ledger.complete, ledger.repeated(), ledger.exact()) == (False, 10, KEYS - 2)


def test_a_message_folded_twice_is_no_exact_key() -> None:
    ledger, state = Ledger(MESSAGES, STATE_BYTES), bytearray(STATE_BYTES)
    for number in (0, 0, KEYS):
        ledger.take(folded(state, message(number)))
    assert ledger.wrong == {"vmc-00"}


def test_an_order_survives_the_command_line() -> None:
    order = Order("127.0.0.1:9092", "in", "out", "snapshots", "group", "a", "/state", 200, 0.2, "", "")
    assert Order.read(order.words()) == order


def test_the_family_of_a_process_counts_its_own_time() -> None:
    """This process is in the family of the first one of the machine."""
    me = int(Path("/proc/self").resolve().name)
    assert me in family(me)
    assert me in family(1)


def test_the_table_has_a_row_for_each_engine_and_its_failures() -> None:
    outcome = Outcome(killed=[Disturbed(1.0, 0, 64), Disturbed(3.0, 7, 63), Disturbed(2.0, 0, 64)], failures=["slow: nothing"])
    outcome.cpu_us[200] += [10.0, 12.0, 11.0]
    outcome.ratios[200] += [1.0, 1.25, 1.5]
    text = table({"one": outcome, "other": Outcome()})
    assert "| one | 11.0 µs (10.0–12.0) | – | 1.25 (1.00–1.50) | – | 2.0 s (1.0–3.0) | 0 (0–7) | 63 of 64 | – | – | – |" in text
    assert text.endswith("What failed:\n- slow: nothing\n")
