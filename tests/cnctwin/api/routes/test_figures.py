"""Production figures over HTTP, out of a real store: JSON, CSV, bounds, and the shift that runs."""

import csv
import io
import json
from collections.abc import Iterator
from typing import Any

import pytest

from cnctwin.api.store_reader import StoreReader
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from sparkplug.metric import NodeId
from tests.cnctwin.api.small_plant import Client, birth, client_of, data, small_plant

T0 = 1_760_000_400_000
HOUR_MS = 3_600_000
NODE = NodeId("cnc", "twin-production")


def _shift(begin: int, *, over: bool = True) -> str:
    stops = {"feed hold": {"kind": "delay", "s": 600.0, "n": 3}}
    times = {"planned_s": 3600.0, "production_s": 3000.0, "setup_s": 0.0, "delay_s": 600.0, "down_s": 0.0, "unknown_s": 0.0}
    head = {"kind": "shift", "id": f"shift-{begin}", "machine": "vmc", "shift": "early", "begin": begin, "end": begin + HOUR_MS}
    head["time_zone"] = "Europe/Berlin"
    rest = {"over": over, "calendar": True, "beside_s": 0.0, "stops": stops, "energy_kwh": 1.5, "energy_s": 3600.0}
    return json.dumps(head | times | rest)


def _part(n: int, begin: int, quality: str | None) -> str:
    head = {"kind": "part", "id": f"part-{n}", "machine": "vmc", "program": "O1701", "shift": "early", "shift_begin": T0}
    times = {"begin": begin, "end": begin + 300_000, "active_s": 300.0, "interrupted_s": 0.0, "unknown_s": 0.0, "ideal_s": 270.0}
    return json.dumps(head | times | {"complete": True, "energy_kwh": 0.2, "quality": quality})


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A store with one shift of four parts, of which one was judged later, and a live plant whose shift runs."""
    folder = tmp_path_factory.mktemp("store")
    store = open_store(folder, writable=True)
    told: list[str] = [_part(n, T0 + n * 300_000, None if n == 3 else "good") for n in range(4)]
    told += ["no record", _shift(T0), _part(3, T0 + 900_000, "scrap")]
    events = [birth({"twin/production": None}, T0, NODE)]
    events += [data({"twin/production": text}, T0 + 300_000 * (n + 1), NODE) for n, text in enumerate(told)]
    store.append([Message(event.timestamp_ms, event) for event in events])
    store.close()
    live = small_plant()
    live.take([birth({"twin/production_now": _shift(T0 + 2 * HOUR_MS, over=False)}, T0 + 3 * HOUR_MS, NODE)], T0)
    with client_of(live, store=StoreReader(str(folder))) as asked:
        yield asked


def _get(client: Client, query: str) -> dict[str, Any]:
    answer = client.get(f"/figures?{query}")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_shifts_have_their_figures_and_the_one_that_runs_is_among_them(client: Client) -> None:
    told = _get(client, f"machine=vmc&from={T0}&to={T0 + 4 * HOUR_MS}")
    over, running = told["rows"]
    assert (over["shift"], over["over"], over["parts"], over["good"], over["scrap"]) == ("early", True, 4, 3, 1)
    assert (over["availability"], over["performance"], over["quality"]) == (0.8333, 0.9, 0.75)
    assert over["stops"] == {"feed hold": {"kind": "delay", "s": 600.0, "n": 3}}
    assert (running["over"], running["oee"], running["why"]["performance"]) == (False, None, "no complete part has ended")
    assert (told["refused"], told["left_out"], told["note"]) == (1, 0, "")
    assert told["time_zone"] == "Europe/Berlin"


@pytest.mark.parametrize(("by", "rows"), [("machine", 1), ("part", 4), ("program", 1)])
def test_the_rows_are_those_that_are_asked_for(client: Client, by: str, rows: int) -> None:
    told = _get(client, f"from={T0}&to={T0 + HOUR_MS}&by={by}")
    assert (len(told["rows"]), told["by"], told["rows"][0]["machine"]) == (rows, by, "vmc")


def test_csv_is_a_download_that_reads_back(client: Client) -> None:
    answer = client.get(f"/figures?machine=vmc&from={T0}&to={T0 + HOUR_MS}&by=part&format=csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert answer.headers["content-disposition"] == 'attachment; filename="figures-part.csv"'
    rows = list(csv.DictReader(io.StringIO(answer.text, newline="")))
    assert [row["quality"] for row in rows] == ["good", "good", "good", "scrap"]
    assert {row["performance"] for row in rows} == {"0.9"}


def test_a_stretch_without_records_says_why_it_is_empty(client: Client) -> None:
    told = _get(client, f"machine=vmc&from={T0 - 9 * HOUR_MS}&to={T0 - 8 * HOUR_MS}")
    assert told["rows"] == []
    assert "cnctwin figures" in told["note"]


@pytest.mark.parametrize(
    ("query", "status", "said"),
    [
        ("machine=vmx", 404, "machine 'vmx' is not known; there are vmc"),
        (f"from={T0}&to={T0}", 400, "machine-days"),
        (f"from={T0}&to={T0 + 401 * 86_400_000}", 400, "at most 400 machine-days"),
        ("by=week", 400, "by is 'week'"),
    ],
)
def test_what_cannot_be_answered_is_refused_in_one_line(client: Client, query: str, status: int, said: str) -> None:
    answer = client.get(f"/figures?{query}")
    assert (answer.status_code, said in answer.json()["error"]) == (status, True), answer.text
