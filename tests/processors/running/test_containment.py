"""The reach of a fault, and how long it lasts."""

import pytest

from processors.running.containment import Containment, Reach

BUG = ZeroDivisionError("our own bug")


def failed(
    faults: Containment, *at_s: float, name: str = "okuma", node: str = "cnc/edge-okuma", machines: int = 10
) -> list[Reach]:
    return [faults.failed(name, node, BUG, one_s, machines=machines) for one_s in at_s]


def test_a_fault_is_the_messages_and_several_in_a_short_time_are_the_machines() -> None:
    faults = Containment()
    assert failed(faults, 0.0, 50.0, 100.0, 150.0) == [Reach.MESSAGE] * 4
    assert faults.aside == {}
    assert failed(faults, 155.0) == [Reach.MACHINE]
    assert faults.aside == {"okuma": 156.0}
    assert (faults.faults, faults.text) == (5, "okuma is set aside for 1 s: ZeroDivisionError: our own bug")


def test_a_pause_doubles_up_to_ten_minutes_and_is_forgotten_after_a_good_time() -> None:
    faults, now_s, pauses_s = Containment(), 0.0, []
    for _ in range(12):
        assert failed(faults, now_s, now_s, now_s)[-1] is Reach.MACHINE
        pauses_s.append(faults.aside["okuma"] - now_s)
        now_s = faults.aside["okuma"]
        assert faults.taken_up(now_s - 0.001) == []
        assert faults.taken_up(now_s) == ["okuma"]
    assert pauses_s == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 600, 600]
    now_s += 1201.0
    failed(faults, now_s, now_s, now_s)
    assert faults.aside["okuma"] - now_s == 1.0


def test_the_processor_is_down_for_pauses_of_its_own_and_known_as_hopeless_at_the_longest() -> None:
    faults, now_s, pauses_s = Containment(), 0.0, []
    while not faults.is_at_the_longest_pause:
        until_s = faults.down("a beat", BUG, now_s)
        pauses_s.append(until_s - now_s)
        now_s = until_s
    assert pauses_s == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 600]
    assert faults.restarts == 11
    assert faults.text == "a beat failed; restarted after 600 s, 11 times so far: ZeroDivisionError: our own bug"


@pytest.mark.parametrize(
    ("senders", "others", "reach"), [(3, 2, Reach.PROCESSOR), (3, 5, Reach.MACHINE), (1, 2, Reach.MACHINE), (2, 0, Reach.MACHINE)]
)
def test_most_machines_of_several_senders_are_the_processors_fault_and_those_of_one_sender_are_not(
    senders: int, others: int, reach: Reach
) -> None:
    faults = Containment()
    for number in range(3):
        node = f"edge-{number % senders}"
        verdicts = failed(faults, 0.0, 0.0, 0.0, name=f"m{number}", node=node, machines=others)
    assert verdicts[-1] is reach


def test_what_is_remembered_of_culprits_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processors.running.containment.CULPRITS_MAX", 10)
    faults = Containment()
    for number in range(1000):
        failed(faults, 0.0, 0.0, 0.0, name=f"m{number}")
    assert len(faults._culprits) == len(faults.aside) == 10


def test_the_line_for_people_is_short_and_printable() -> None:
    faults = Containment()
    faults.failed("\x07" * 30_000, "", ValueError("a\nb\x00" + "x" * 10_000), 0.0)
    assert faults.text.isprintable()
    assert len(faults.text) < 400
