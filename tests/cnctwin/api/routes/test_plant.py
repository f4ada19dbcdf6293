"""The plant as it is now: machines, states, and clear refusals."""

import json
import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from cnctwin.api.fleet import NO_GAP, fleet_item
from cnctwin.api.live.plant import LivePlant
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.cnctwin.api.small_plant import EDGE, THERMAL, Client, birth, client_of, data, death, now, reading, small_plant


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with client_of(small_plant(1_000)) as client:
        yield client


def test_a_state_has_measured_beside_the_twin_with_unit_quality_and_provenance(client: Client) -> None:
    state = client.get("/state/vmc").json()
    assert state["online"] is True
    assert state["measured"]["spindle_load_pct"] == {
        "value": 37.25, "t": 1000, "unit": "%", "quality": "good", "provenance": "measured",
    }  # fmt: skip
    assert state["twin"]["twin/spindle_temp_c"] == {
        "value": 31.5, "t": 1000, "unit": "°C", "quality": "good", "provenance": "modelled", "meaning": "rise + ambient",
    }  # fmt: skip


def test_an_unknown_machine_is_404_with_those_that_there_are(client: Client) -> None:
    refusal = client.get("/state/lathe")
    assert refusal.status_code == 404
    assert refusal.json() == {"error": "machine 'lathe' is not known; there are vmc"}


@pytest.mark.parametrize("name", ["../../etc/passwd", "..%2f..%2fetc%2fpasswd", "vmc%00", "a" * 5000, "%ff%fe", "<b>"])
def test_no_machine_name_does_anything_but_not_being_known(client: Client, name: str) -> None:
    for route in (
        f"/state/{name}",
        f"/gap/{name}",
        f"/gap/{name}/report",
        f"/history/{name}?signals=a",
        f"/stream?machine={name}",
    ):
        refusal = client.get(route)
        assert refusal.status_code in (400, 404), (route, refusal.status_code)
        assert list(refusal.json()) == ["error"]
        assert "\n" not in refusal.json()["error"]


def test_the_fleet_says_of_each_machine_what_an_overview_needs(client: Client) -> None:
    (item,) = client.get("/machines").json()
    assert {name: item[name] for name in ("machine", "online", "exec_state", "tool_number", "gap", "last_t")} == {
        "machine": "vmc", "online": True, "exec_state": "ACTIVE", "tool_number": 5, "gap": 1.5, "last_t": 1000,
    }  # fmt: skip
    assert (item["score"], item["gap_reason"]) == (None, None)


def test_a_gap_that_is_not_known_says_why_and_one_that_nothing_computes_names_the_processor() -> None:
    def item(*told: tuple[str, str]) -> dict[str, Any]:
        bad = [Reading(name, None, 0, Quality.BAD, "floors", reason, False) for name, reason in told]
        return fleet_item("vmc", True, {one.name: SimpleNamespace(reading=one) for one in bad})

    offered, few = "axis_a_pos_mm is not offered", "less than 60 s seen"
    assert item()["gap_reason"] == NO_GAP
    axes = [(f"twin/gap_axis_{letter}_pos_mm", offered) for letter in "abc"]
    assert item(*axes, ("twin/gap_spindle_temp_c", few))["gap_reason"] == few
    assert item(*axes)["gap_reason"] == offered


def test_a_death_makes_values_stale_and_a_birth_makes_them_good_again() -> None:
    live = small_plant(1_000)
    live.take([death({"spindle_load_pct": 37.25}, 2_000)], 2_000)
    state = live.state("vmc", 2_000)
    assert state is not None
    assert (state["online"], state["measured"]["spindle_load_pct"]["quality"]) == (False, "stale")
    live.take([birth({"spindle_load_pct": 37.25}, 3_000)], 3_000)
    state = live.state("vmc", 3_000)
    assert state is not None
    assert (state["online"], state["measured"]["spindle_load_pct"]["quality"]) == (True, "good")


def test_the_death_of_a_processor_says_nothing_of_the_control() -> None:
    live = small_plant(1_000)
    live.take([death({"twin/spindle_temp_c": 31.5}, 2_000, THERMAL)], 2_000)
    state = live.state("vmc", 2_000)
    assert state is not None
    assert state["online"] is True
    assert state["twin"]["twin/spindle_temp_c"]["quality"] == "stale"


@pytest.mark.parametrize(
    ("value", "reason"),
    [(math.nan, "no finite number"), (math.inf, "no finite number"), ((1.0, 2.0), "an array of 2 values"), (b"x", "bytes")],
)
def test_what_json_cannot_hold_is_null_with_a_reason(value: object, reason: str) -> None:
    live = LivePlant()
    live.take([birth({"spindle_load_pct": value}, 1_000)], 1_000)  # type: ignore[dict-item]
    with client_of(live) as client:
        told = client.get("/state/vmc").json()["measured"]["spindle_load_pct"]
    assert (told["value"], told["quality"]) == (None, "bad")
    assert reason in told["reason"]


def test_bad_data_is_a_null_with_its_reason() -> None:
    live = small_plant(1_000)
    bad = reading("spindle_load_pct", None, 1_500, Quality.BAD, "outside 0 to 200 %: 950")
    live.take([data({}, 1_500)._replace(readings=(bad,))], 1_500)
    with client_of(live) as client:
        assert client.get("/state/vmc").json()["measured"]["spindle_load_pct"]["reason"] == "outside 0 to 200 %: 950"
        assert client.get("/machines").json()[0]["spindle_load_pct"] is None


def test_history_that_comes_late_does_not_change_what_is_so_now() -> None:
    live = small_plant(1_000)
    late = reading("spindle_load_pct", 99.0, 500)._replace(is_historical=True)
    live.take([data({}, 1_500)._replace(readings=(late,))], 1_500)
    assert live.readings("vmc")["spindle_load_pct"].value == 37.25


def test_machines_and_signals_have_limits_and_what_is_beyond_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.api.live.plant.MACHINES_MAX", 1)
    monkeypatch.setattr("cnctwin.api.live.plant.SIGNALS_MAX", 2)
    live = LivePlant()
    live.take([birth({"a": 1.0, "b": 1.0, "c": 1.0}, now()), birth({"a": 1.0}, now(), EDGE, "lathe")], now())
    assert live.machines() == ["vmc"]
    assert live.counts["signals_over_limit"] == 1
    assert live.counts["machines_over_limit"] == 1


def test_nothing_is_known_and_everything_answers() -> None:
    with client_of() as client:
        assert client.get("/machines").json() == []
        assert client.get("/state/vmc").json() == {"error": "machine 'vmc' is not known; there are none yet"}
        health = client.get("/health")
        assert health.status_code == 200
        missing = {part["part"]: part for part in health.json()["parts"] if part["state"] == "missing"}
        assert set(missing) == {"machines", "processors", "store", "models", "alerts"}
        assert all(part["reason"] and part["do"] for part in missing.values())
        assert health.json()["status"] == "degraded"
        assert client.get("/livez").json() == {"alive": True}
        assert client.get("/readyz").status_code == 200
        assert client.get("/alerts").json()["available"] is False
        assert client.get("/validation/vmc").status_code == 404
        assert client.get("/metrics").status_code == 200
        assert client.get("/openapi.json").status_code == 200


@pytest.mark.parametrize(
    "path", ["/nothing", "/state", "/machines/", "/page/../../pyproject.toml", "/page/%2e%2e/%2e%2e/__init__.py"]
)
def test_what_is_not_there_is_404_in_the_one_shape(client: Client, path: str) -> None:
    refusal = client.get(path)
    assert refusal.status_code == 404
    assert list(refusal.json()) == ["error"]


def test_a_method_that_is_not_for_a_route_is_405_in_the_one_shape(client: Client) -> None:
    refusal = client.request("DELETE", "/machines")
    assert refusal.status_code == 405
    assert refusal.json() == {"error": "DELETE is not for /machines; /openapi.json says what is"}


def test_a_bug_is_500_without_its_inside_and_with_the_security_headers(monkeypatch: pytest.MonkeyPatch) -> None:
    live = small_plant()
    monkeypatch.setattr(live, "fleet", lambda: 1 / 0)
    with client_of(live) as client:
        failed = client.get("/machines")
    assert failed.status_code == 500
    assert failed.json() == {"error": "the server failed at this; its log says how"}
    assert "default-src 'self'" in failed.headers["content-security-policy"]


BEHIND = "processors are 18 s behind: 20 machines, one core, 105 % busy; `cnctwin plan fleet` says what it takes (thermal)"


def told(live: LivePlant, t_ms: int) -> list[object]:
    """Return what the stream says of processors at a moment."""
    said = [batch.payload for batch in live.flush(t_ms) if batch.payload.startswith(b"event: processors")]
    return [json.loads(payload.split(b"data: ")[1])["behind"] for payload in said]


def test_processors_that_fall_behind_are_told_on_change_and_stand_in_each_state() -> None:
    live = small_plant(1_000)
    own = {"health/lag_s": 18.0, "health/published_lag_s": 18.2, "health/machines": 20, "health/busy_pct": 104.6}
    live.take([birth(dict.fromkeys(own, 0.0), 1_000, THERMAL, None)], 1_000)
    assert told(live, 1_000) == []
    live.take([data(own, 2_000, THERMAL, None)], 2_000)
    assert [told(live, t_ms) for t_ms in (2_000, 2_100, 3_000, 4_000)] == [[BEHIND], [], [], []]
    state = live.state("vmc", 4_000)
    assert state is not None
    assert (state["behind"], live.notices().behind) == (BEHIND, BEHIND)
    with client_of(live) as client:
        assert client.get("/state/vmc").json()["behind"] == BEHIND
        (part,) = [part for part in client.get("/health").json()["parts"] if part["part"] == "processors"]
        assert (part["state"], part["reason"]) == ("degraded", BEHIND)
    live.take([data({"health/lag_s": 0.1, "health/published_lag_s": 0.1}, 5_000, THERMAL, None)], 5_000)
    assert told(live, 5_000) == [None]
    assert live.notices().behind is None


def test_a_processor_that_has_died_is_behind_no_longer() -> None:
    live = small_plant(1_000)
    live.take([birth({"health/lag_s": 18.0}, 1_000, THERMAL, None)], 1_000)
    assert len(told(live, 1_000)) == 1
    live.take([death({"health/lag_s": 18.0}, 2_000, THERMAL, None)], 2_000)
    assert told(live, 2_000) == [None]


def test_what_is_refused_is_told_on_change_and_named_above_every_view() -> None:
    live = small_plant(1_000)
    rows = [{"node": "cnc/edge-bad", "device": f"mill-{index}", "text": "its name is too long"} for index in range(3)]
    live.take([birth({"health/quarantine": "[]"}, 1_000, THERMAL, None)], 1_000)
    assert told(live, 1_000) == []
    live.take([data({"health/quarantine": json.dumps(rows)}, 2_000, THERMAL, None)], 2_000)
    assert told(live, 2_000) == [None]  # nothing is late
    first, second = (f"mill-{index} of cnc/edge-bad: its name is too long" for index in range(2))
    assert live.notices().refused == f"{first}; {second}; and 1 more"
    with client_of(live) as client:
        assert client.get("/state/vmc").json()["refused"] == live.notices().refused
    live.take([data({"health/quarantine": "[]"}, 3_000, THERMAL, None)], 3_000)
    assert told(live, 3_000) == [None]
    assert live.notices().refused is None
