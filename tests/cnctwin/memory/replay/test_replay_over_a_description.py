"""A replay over a change of a machine's description: each message is folded with the one that held for it on the day."""

from collections.abc import Sequence
from random import Random

import pytest

from cnctwin.memory.descriptions import described
from cnctwin.memory.replay import replay
from cnctwin.memory.replay.run import published_of
from processors.description import Description, DescriptionMessage, Role, topic_of
from processors.discovery import find
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.cnctwin.memory.replay.simulated_day import EDGE, T0_MS, Day
from tests.cnctwin.memory.replay.test_replay_of_a_day import SECONDS, machine_events, shown
from tests.processors.describing import WHOLE
from twin.vocabulary.twin_signals import CHALLENGER_PREFIX

NAMES = ("thermal", "cutting_force", "gap")
FIRST, SECOND = (WHOLE.format(power_kw=power_kw, resistance_k_per_w=r) for power_kw, r in ((11.0, 0.12), (22.0, 0.5)))


def says(at_s: float, text: str | None, role: Role = Role.LIVE) -> tuple[float, HostEvent]:
    """The description of the machine is this one from now on."""
    payload = b""
    if text is not None:
        version = Description.from_toml(text).version
        payload = DescriptionMessage(version=version, toml=text, t=7, step="promoted", by="anna", why="it fits").payload()
    event = HostEvent(
        EventKind.PLAIN, NodeId("", ""), None, T0_MS + round(at_s * 1000), topic=topic_of("vmc", role), payload=payload
    )
    return at_s, event


def day(seed: int, told: Sequence[tuple[float, HostEvent]], kills: Sequence[tuple[float, str, float]] = ()) -> Day:
    whole = Day([(find(name), {}) for name in NAMES], seed)
    whole.run([*machine_events(seed), *told], SECONDS, kills)
    return whole


PROMOTED = [
    says(0.05, FIRST),
    says(25.037, SECOND, Role.CHALLENGER),
    says(70.011, SECOND),
    says(70.012, None, Role.CHALLENGER),
]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_day_with_a_challenger_that_is_promoted_comes_out_as_it_was(seed: int) -> None:
    replayed = replay(day(seed, PROMOTED).store, "vmc", T0_MS - 1000, T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)
    names = {metric.signal for one in replayed.processors for metric in one.metrics if metric.same}
    assert {name for name in names if name.startswith(CHALLENGER_PREFIX)}


@pytest.mark.parametrize("seed", [4, 5])
@pytest.mark.parametrize("from_s", [27.0, 68.0, 72.0])
def test_a_stretch_begins_with_what_was_live_then(seed: int, from_s: float) -> None:
    replayed = replay(day(seed, PROMOTED).store, "vmc", T0_MS + round(from_s * 1000), T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)


@pytest.mark.parametrize("at_s", [40.0, 69.5, 70.0])
def test_processors_that_are_killed_in_between_come_out_as_they_went_on(at_s: float) -> None:
    kills = [(at_s, name, 3.0) for name in NAMES]
    replayed = replay(day(6, PROMOTED, kills).store, "vmc", T0_MS - 1000, T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)
    assert [one.restarts for one in replayed.processors] == [1, 1, 1]


@pytest.mark.parametrize("seed", [3, 6])
def test_a_stretch_may_end_with_the_tick_of_a_silence(seed: int) -> None:
    """The last that is heard is what the processor said itself, seconds after the machine fell silent."""
    store = day(seed, PROMOTED).store
    said_ms = [message.received_ms for message in store.log if message.event.node.node == "twin-thermal"]
    heard_ms = [message.received_ms for message in store.log if message.event.node == EDGE]
    ends_ms = [at_ms for at_ms in said_ms if not any(at_ms - 1500 < one_ms <= at_ms for one_ms in heard_ms)]
    assert len(ends_ms) > 1
    for end_ms in ends_ms:
        replayed = replay(store, "vmc", T0_MS - 1000, end_ms + 1, ["thermal"])
        assert replayed.is_equal, (end_ms - T0_MS, shown(replayed))


def test_changes_in_quick_order_come_out_as_they_were() -> None:
    chance = Random(3)
    told = [says(0.05, FIRST), *(says(5.0 + 0.7 * n + chance.random() / 2, (FIRST, SECOND)[n % 2]) for n in range(1, 60))]
    replayed = replay(day(7, told).store, "vmc", T0_MS - 1000, T0_MS + 300_000)
    assert replayed.is_equal, shown(replayed)


def test_the_answer_says_which_was_live_from_when() -> None:
    store = day(8, PROMOTED).store
    first, second = (Description.from_toml(text).version for text in (FIRST, SECOND))
    whole = replay(store, "vmc", T0_MS - 1000, T0_MS + 300_000).as_json()["descriptions"]
    assert [(round((one["t"] - T0_MS) / 10) * 10, one["role"], one["version"]) for one in whole] == [
        (50, "live", first), (25_040, "challenger", second), (70_010, "live", second), (70_010, "challenger", ""),
    ]  # fmt: skip
    assert (whole[0]["step"], whole[0]["by"], whole[0]["why"]) == ("promoted", "anna", "it fits")
    later = replay(store, "vmc", T0_MS + 80_000, T0_MS + 300_000).as_json()["descriptions"]
    assert [(one["role"], one["version"]) for one in later] == [("live", second), ("challenger", "")]


def test_of_a_moment_the_memory_knows_the_live_one() -> None:
    store = day(9, PROMOTED).store
    first, second = (Description.from_toml(text).version for text in (FIRST, SECOND))
    moments = [T0_MS + at_ms for at_ms in (0, 60, 70_010, 70_020, 90_000)]
    found = [described(store, "vmc", at_ms, at_ms + 1) for at_ms in moments]  # type: ignore[arg-type]
    live = [[one.version for one in held if one.role == "live"][:1] for held in found]
    assert live == [[], [first], [first], [second], [second]]
    assert described(store, "mazak", T0_MS, T0_MS + 1000) == ()  # type: ignore[arg-type]


def test_the_processors_of_the_day_are_these() -> None:
    assert published_of(day(1, PROMOTED).store.series("vmc")) == sorted(NAMES)
