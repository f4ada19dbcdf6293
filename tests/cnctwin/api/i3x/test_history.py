"""History over i3X: out of a real store, within its limits, and refused where the times are none."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cnctwin.api.i3x import history
from cnctwin.api.i3x.problem import PREFIX
from cnctwin.api.i3x.vqt import rfc3339
from cnctwin.api.store_reader import StoreReader
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from tests.cnctwin.api.i3x.shapes import PAST, failed, results_of
from tests.cnctwin.api.small_plant import Client, birth, client_of, data, death, small_plant

T0 = 1_760_000_000_000
LOAD = "signal/vmc/spindle_load_pct"
MINUTES = 200


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A store with a value a minute for some hours, then a death."""
    folder = tmp_path_factory.mktemp("store")
    store = open_store(folder, writable=True)
    events = [birth({"spindle_load_pct": 0.0}, T0)]
    events += [data({"spindle_load_pct": float(minute)}, T0 + 60_000 * minute) for minute in range(1, MINUTES)]
    events += [death({"spindle_load_pct": MINUTES - 1.0}, T0 + 60_000 * MINUTES)]
    store.append([Message(event.timestamp_ms, event) for event in events])
    store.close()
    reader = StoreReader(str(folder))
    with client_of(small_plant(), store=reader) as client:
        yield client
    reader.close()


def asked(client: Client, start_ms: int, end_ms: int, status: int = 200, ids: tuple[str, ...] = (LOAD,)) -> Any:
    body = {"elementIds": list(ids), "startTime": rfc3339(start_ms), "endTime": rfc3339(end_ms)}
    answer = client.post(f"{PREFIX}/objects/history", json=body)
    assert answer.status_code == status, answer.text
    return answer.json()


def values(body: Any) -> list[Any]:
    (past,) = results_of(body, [LOAD], PAST)
    return [(one["value"], one["quality"], one["timestamp"]) for one in past["values"]]


def test_both_ends_of_the_range_are_in_it_oldest_first(client: Client) -> None:
    found = values(asked(client, T0 + 60_000, T0 + 180_000))
    assert found == [(float(minute), "Good", rfc3339(T0 + 60_000 * minute)) for minute in (1, 2, 3)]


def test_stretches_join_without_a_value_twice_or_missing(client: Client) -> None:
    found = values(asked(client, T0, T0 + 60_000 * (MINUTES + 5)))
    assert [value for value, _, _ in found] == [*map(float, range(MINUTES)), MINUTES - 1.0]
    assert found[-1][1] == "Uncertain"


def test_what_a_limit_leaves_out_is_said_and_can_be_asked_for(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "VALUES_MAX", 50)
    found: list[Any] = []
    start_ms, end_ms = T0, T0 + 60_000 * (MINUTES - 1)
    while True:
        answer = client.post(
            f"{PREFIX}/objects/history",
            json={"elementIds": [LOAD], "startTime": rfc3339(start_ms), "endTime": rfc3339(end_ms)},
        )
        some = values(answer.json())
        found += [one for one in some if one not in found]
        if answer.status_code == 200:
            break
        assert len(some) == 50
        assert some[-1][2] in answer.json()["responseDetail"]["detail"]
        start_ms += 49 * 60_000
    assert [value for value, _, _ in found] == [*map(float, range(MINUTES))]


@pytest.mark.parametrize(
    ("start", "end", "line"),
    [
        ("2026-01-02T00:00:00Z", "2026-01-01T00:00:00Z", "is before startTime"),
        ("2026-01-01T00:00:00Z", "2026-03-01T00:00:00Z", "more than 31 days"),
        ("2026-01-01T00:00:00+01:00", "2026-01-02T00:00:00Z", "give a time in UTC"),
        ("2026-13-01T00:00:00Z", "2026-01-02T00:00:00Z", "startTime is '2026-13-01T00:00:00Z'"),
        ("yesterday", "2026-01-02T00:00:00Z", "startTime is 'yesterday'"),
        ("1960-01-01T00:00:00Z", "1960-01-02T00:00:00Z", "between 1970 and the year 3000"),
    ],
)
def test_times_that_are_none_are_refused(client: Client, start: str, end: str, line: str) -> None:
    answer = client.post(f"{PREFIX}/objects/history", json={"elementIds": [LOAD], "startTime": start, "endTime": end})
    assert line in failed(answer.json(), 400)


def test_only_so_many_signals_are_asked_for_at_once(client: Client) -> None:
    assert "limit" in failed(asked(client, T0, T0 + 1, 400, (LOAD,) * 61), 400)


def test_a_store_that_cannot_be_opened_is_a_refusal_and_not_an_empty_answer(tmp_path: Path) -> None:
    reader = StoreReader(str(tmp_path / "nowhere"))
    with client_of(small_plant(), store=reader) as client:
        assert "nowhere" in failed(asked(client, T0, T0 + 1, 503), 503)
    reader.close()
