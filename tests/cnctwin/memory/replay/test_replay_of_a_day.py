"""A replay gives what was published then, bit for bit: through silence, late ticks, deaths, and processors that are killed."""

from random import Random

import pytest

from cnctwin.memory.replay import ReplayRefusedError, replay
from processors.discovery import find
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.cnctwin.memory.replay.simulated_day import EDGE, T0_MS, Day

SECONDS = 130.0
NAMES = ("thermal", "cutting_force", "gap", "rules")
BORN: dict[str, object] = {
    "spindle_rpm": 0.0,
    "spindle_load_pct": 0.0,
    "spindle_temp_c": 21.0,
    "feed_mm_min": 0.0,
    "exec_state": "READY",
    "tool_number": 1,
    "program": "O1",
}
BORN_AGAIN = BORN | {
    "spindle_rpm": 100.0,
    "spindle_load_pct": 3.0,
    "spindle_temp_c": 22.0,
    "exec_state": "ACTIVE",
    "tool_number": 2,
}


def machine_events(seed: int, *, machine: str = "vmc", node=EDGE, silences: bool = True) -> list[tuple[float, HostEvent]]:
    """Three minutes of a machine: it cuts, stands silent, its edge dies and comes again."""
    chance, at_s = Random(seed), 0.2
    events = [(at_s, _event(EventKind.BIRTH, at_s, machine, node, **BORN))]
    while at_s < SECONDS - 5.0:
        at_s += chance.choice((0.1, 0.1, 0.1, 0.2)) if not silences or chance.random() > 0.03 else chance.uniform(1.0, 12.0)
        if silences and 100.0 < at_s < 101.0:
            death = HostEvent(EventKind.DEATH, node, machine, T0_MS + round(at_s * 1000) + 3, (), "edge node offline")
            events.append((at_s, death))
            at_s += 4.0
            events.append((at_s, _event(EventKind.BIRTH, at_s, machine, node, **BORN_AGAIN)))
            continue
        values = {"spindle_rpm": 3000.0 + chance.gauss(0, 3), "spindle_load_pct": 40.0 + chance.gauss(0, 2)}
        if chance.random() < 0.1:
            values |= {"spindle_temp_c": 22.0 + at_s / 60, "feed_mm_min": 800.0, "exec_state": "ACTIVE"}
        events.append((at_s, _event(EventKind.DATA, at_s, machine, node, **values)))
    return events


def _event(kind: EventKind, at_s: float, machine: str, node, **values: object) -> HostEvent:
    at_ms = T0_MS + round(at_s * 1000) - 20  # it took 20 ms to the broker
    readings = tuple(Reading(name, value, at_ms, Quality.GOOD, None, None, False) for name, value in values.items())
    return HostEvent(kind, node, machine, at_ms + 5, readings)


def day(seed: int, kills=(), names=NAMES, silences: bool = True) -> Day:
    whole = Day([(find(name), {}) for name in names], seed)
    whole.run(machine_events(seed, silences=silences), SECONDS, kills)
    return whole


def shown(replayed) -> list:
    return [
        (one.name, one.start, one.totals, [m.first for m in one.metrics if m.first][:2], one.notes) for one in replayed.processors
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_day_comes_out_as_it_was_published(seed: int) -> None:
    replayed = replay(day(seed).store, "vmc", T0_MS - 1000, T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)
    assert [one.name for one in replayed.processors] == sorted(NAMES)
    assert replayed.compared > 300


@pytest.mark.parametrize("seed", [4, 5])
def test_processors_that_were_killed_come_out_as_they_went_on(seed: int) -> None:
    kills = [(30.3 + seed / 10, "thermal", 1.5), (31.0, "rules", 1.0), (110.1, "thermal", 3.0), (61.7, "gap", 2.2)]
    replayed = replay(day(seed, kills).store, "vmc", T0_MS - 1000, T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)
    assert {one.name: one.restarts for one in replayed.processors} == {"thermal": 2, "rules": 1, "gap": 1, "cutting_force": 0}


@pytest.mark.parametrize("from_s", [65, 115])
def test_a_stretch_goes_on_from_the_snapshot_before_it(from_s: int) -> None:
    whole = day(7, [(90.0, "thermal", 1.0)])
    replayed = replay(whole.store, "vmc", T0_MS + from_s * 1000, T0_MS + 180_000)
    assert replayed.is_equal, shown(replayed)
    assert all(one.start.startswith("from the snapshot") for one in replayed.processors)


def test_two_replays_give_the_same_bytes_and_a_chain_the_same_values() -> None:
    whole = day(8)
    first, second = (replay(whole.store, "vmc", T0_MS, T0_MS + 180_000) for _ in range(2))
    chained = replay(whole.store, "vmc", T0_MS, T0_MS + 180_000, chain=True)
    assert first.sha256 == second.sha256
    assert chained.is_equal, shown(chained)


def test_another_configuration_is_found_out() -> None:
    replayed = replay(day(9).store, "vmc", T0_MS, T0_MS + 180_000, ["thermal"], {"thermal": {"capacity_j_per_k": 9000.0}})
    assert not replayed.is_equal
    assert replayed.differences


def test_a_machine_that_is_not_there_is_named() -> None:
    with pytest.raises(ReplayRefusedError, match="no machine 'mill'; it has: vmc"):
        replay(day(9, names=["thermal"]).store, "mill", T0_MS, T0_MS + 1000)
