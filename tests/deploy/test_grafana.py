"""The dashboards: as their source says, as Grafana takes them, and each of their questions is answered by a real server."""

import copy
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics
from tests.deploy.grafana_schema import complaints
from tests.deploy.plant import DEPLOY
from tests.deploy.plant_history import MACHINES, SECONDS, TOOL_CHANGE_S, exposition, fast, messages, published
from tests.recordings import PROJECT

END_MS = 1_789_000_020_000  # a multiple of the step, so that the server's points are ours
STEP_S = 15
FOLDER = DEPLOY / "grafana" / "dashboards"
DASHBOARDS = sorted(FOLDER.rglob("*.json"))
Query = tuple[str, dict[str, Any]]


def document(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text())  # type: ignore[no-any-return]


def queries(of: dict[str, Any]) -> Iterator[Query]:
    """Every query of every panel and annotation, with what to call it."""
    for panel in of["panels"]:
        yield from ((f"{panel['title']} {target['refId']}", target) for target in panel["targets"])
    yield from ((mark["name"], mark["target"]) for mark in of.get("annotations", {}).get("list", []))


def kind(query: dict[str, Any]) -> str:
    return str(query["datasource"]["type"])


class QueryClient:
    """A client of a server that answers queries over HTTP."""

    def __init__(self, server: ServerProcess) -> None:
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0)

    def get(self, path: str, **parameters: Any) -> Any:
        """The JSON of an answer that is no error."""
        answer = self.http.get(path, params=parameters)
        assert answer.status_code == 200, f"{path} {parameters}: {answer.text}"
        return answer.json()


@contextmanager
def _filled(server: ServerProcess) -> Iterator[QueryClient]:
    """A server with the ten minutes in it, written by the historian's own sink."""
    if server.missing():
        pytest.skip(server.missing())
    server.start()
    try:
        store = open_influx(server.url(), writable=True, spool=server.folder / "ring")
        assert isinstance(store, ServerStore)
        appended = store.append(list(messages(END_MS)))
        assert appended.stored > 5000 and not appended.refused
        assert store.drain(20.0), store.status()
        store.close()
        client = QueryClient(server)
        yield client
        client.http.close()
    finally:
        server.stop()


@pytest.fixture(scope="module")
def metrics_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[QueryClient]:
    server = VictoriaMetrics(tmp_path_factory.mktemp("vm"))
    server.deduplicates = True
    with _filled(server) as client:
        client.http.post("/api/v1/import/prometheus", content=exposition(END_MS)).raise_for_status()
        server.flush()
        yield client


@pytest.fixture(scope="module")
def influx_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[QueryClient]:
    with _filled(Influxd(tmp_path_factory.mktemp("influx"))) as client:
        yield client


def asked_of_prometheus(server: QueryClient, expression: str, machine: str = MACHINES[0]) -> list[dict[str, Any]]:
    """The series that answer, as Grafana would ask for the whole ten minutes."""
    for variable, value in (("$machine", machine), ("$__rate_interval", "1m"), ("$__interval", f"{STEP_S}s")):
        expression = expression.replace(variable, value)
    assert "$" not in expression, "a variable that Grafana was not asked for"
    start_s, end_s = END_MS / 1000 - SECONDS, END_MS / 1000
    answer = server.get("/api/v1/query_range", query=expression, start=start_s, end=end_s, step=STEP_S, nocache=1)
    return answer["data"]["result"]  # type: ignore[no-any-return]


def asked_of_influxdb(server: QueryClient, query: str, machine: str = MACHINES[0]) -> list[dict[str, Any]]:
    between = f"time >= {END_MS - SECONDS * 1000}ms and time <= {END_MS}ms"
    for variable, value in (
        ("${machine:regex}", re.escape(machine)),
        ("$timeFilter", between),
        ("$__interval", f"{STEP_S}s"),
    ):
        query = query.replace(variable, value)
    answer = server.get("/query", db="cnc_raw", q=query, epoch="ms")["results"][0]
    assert "error" not in answer, f"{query}: {answer}"
    return answer.get("series", [])  # type: ignore[no-any-return]


def points(series: dict[str, Any]) -> list[Any]:
    """Return what is drawn of a series of either server."""
    return [point for point in series["values"] if point[1] is not None]


def test_the_files_are_what_their_source_says() -> None:
    command = [sys.executable, str(PROJECT / "scripts" / "dashboards"), "--check"]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stderr) == (0, "")


@pytest.mark.parametrize("path", DASHBOARDS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_grafana_knows_every_key_of_a_dashboard(path: Path) -> None:
    assert complaints(document(path)) == []


def _damaged(damage: str) -> dict[str, Any]:
    found = copy.deepcopy(document(FOLDER / "victoriametrics" / "anomaly.json"))
    panel = found["panels"][2]
    match damage:
        case "panel type":
            panel["type"] = "timeserie"
        case "unit":
            panel["fieldConfig"]["defaults"]["unit"] = "celcius"
        case "variable type":
            found["templating"]["list"][0]["type"] = "queery"
        case "key":
            found["tittle"] = "x"
        case "option":
            panel["options"]["legend"]["showLegends"] = True
        case "override":
            panel["fieldConfig"]["overrides"][0]["properties"][0]["id"] = "custom.fillOpacities"
        case "query":
            panel["targets"][0]["expression"] = panel["targets"][0].pop("expr")
    return found


@pytest.mark.parametrize("damage", ["panel type", "unit", "variable type", "key", "option", "override", "query"])
def test_the_schema_sees_a_slip_of_the_pen(damage: str) -> None:
    assert len(complaints(_damaged(damage))) in (1, 2)


def test_a_dashboard_asks_only_for_what_a_processor_publishes() -> None:
    asked = {
        name
        for path in DASHBOARDS
        for _, query in queries(document(path))
        for name in re.findall(r"[\"'](twin/[^\"'(\[|]+)[\"']", query.get("expr") or query.get("query", ""))
    }
    assert len(asked) > 15
    assert asked - published() == set()


def test_both_stores_have_the_same_panels() -> None:
    for ours in sorted((FOLDER / "victoriametrics").glob("*.json")):
        panels = [
            [panel["title"] for panel in document(FOLDER / store / ours.name)["panels"]]
            for store in ("influxdb", ours.parent.name)
        ]
        assert panels[0] == panels[1]


@pytest.mark.parametrize("path", DASHBOARDS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_each_question_of_a_dashboard_is_answered_with_data(
    path: Path, metrics_server: QueryClient, influx_server: QueryClient
) -> None:
    without: list[str] = []
    for name, query in queries(document(path)):
        if kind(query) == "prometheus":
            answered = asked_of_prometheus(metrics_server, query["expr"])
        else:
            answered = asked_of_influxdb(influx_server, query["query"])
        if not any(points(series) for series in answered):
            without.append(name)
    assert without == []


def test_the_list_of_machines_is_found_in_both_stores(metrics_server: QueryClient, influx_server: QueryClient) -> None:
    variables = {
        store: document(FOLDER / store / "machine.json")["templating"]["list"][0] for store in ("victoriametrics", "influxdb")
    }
    metric = re.fullmatch(r"label_values\((\w+), machine\)", variables["victoriametrics"]["query"])
    assert metric
    at = {"start": END_MS / 1000 - SECONDS, "end": END_MS / 1000, "match[]": metric[1]}
    assert set(metrics_server.get("/api/v1/label/machine/values", **at)["data"]) == set(MACHINES)
    answered = influx_server.get("/query", q=variables["influxdb"]["query"])["results"][0]["series"][0]["values"]
    assert {value for _, value in answered} == set(MACHINES)


def _query(store: str, board: str, name: str) -> dict[str, Any]:
    return dict(queries(document(FOLDER / store / f"{board}.json")))[name]


def test_a_value_that_is_bad_now_is_not_drawn_on(metrics_server: QueryClient) -> None:
    load = _query("victoriametrics", "machine", "Spindle load A")["expr"]
    healthy, ended = (points(asked_of_prometheus(metrics_server, load, machine)[0]) for machine in MACHINES)
    assert healthy[-1][0] == END_MS / 1000
    assert END_MS / 1000 - 60 - STEP_S <= ended[-1][0] <= END_MS / 1000 - 60


def test_a_tool_change_is_marked_when_it_was(metrics_server: QueryClient, influx_server: QueryClient) -> None:
    at_s = END_MS / 1000 - SECONDS + TOOL_CHANGE_S[1]
    marked = asked_of_prometheus(metrics_server, _query("victoriametrics", "force", "Another tool")["expr"])
    assert [point[0] for series in marked for point in points(series)] == [pytest.approx(at_s, abs=STEP_S)]
    found = asked_of_influxdb(influx_server, _query("influxdb", "force", "Another tool")["query"])
    assert [(t_ms / 1000, change) for t_ms, change in found[0]["values"]] == [(at_s, 4.0)]


def test_no_peak_is_lost_between_two_points_of_the_screen(metrics_server: QueryClient, influx_server: QueryClient) -> None:
    largest = max(fast(second) for second in range(0, SECONDS, 2))
    drawn = asked_of_prometheus(metrics_server, _query("victoriametrics", "anomaly", "Scores A")["expr"])
    assert max(float(value) for _, value in drawn[0]["values"]) == pytest.approx(largest)
    found = asked_of_influxdb(influx_server, _query("influxdb", "anomaly", "Scores A")["query"])
    assert max(value for _, value in points(found[0])) == pytest.approx(largest)


def test_dashboards_and_their_data_sources_are_provisioned_together() -> None:
    for store in ("victoriametrics", "influxdb"):
        folder = DEPLOY / "grafana" / "provisioning" / store
        sources = {
            (one["type"], one["uid"])
            for file in (folder / "datasources").glob("*.yml")
            for one in yaml.safe_load(file.read_text())["datasources"]
        }
        paths = {
            one["options"]["path"] for one in yaml.safe_load((folder / "dashboards" / "cnctwin.yml").read_text())["providers"]
        }
        assert paths == {f"/etc/grafana/cnctwin/{name}" for name in (store, "metrics")}
        asked = {
            (query["datasource"]["type"], query["datasource"]["uid"])
            for name in (store, "metrics")
            for path in (FOLDER / name).glob("*.json")
            for _, query in queries(document(path))
        }
        assert asked == sources
