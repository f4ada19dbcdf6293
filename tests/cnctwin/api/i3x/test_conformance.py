"""CESMII's conformance cases for i3X 1.0, by their ids: what a server that reads, and streams, has to pass.

The cases are those of github.com/cesmii/i3X, conformance-tests/ (MIT by its package.json; read at 7a9fc05, lib/tests/subscribe.js
at 26967df, lib/tests/transport.js at 19b93ab). They are restated here; none of the suite's code is. SUB-09 and SUB-14 are in
test_streams.py. UPD-01 to UPD-04 are for servers that write, SUB-12 for those that do not stream; CORE-05, TLS, is the proxy's.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import jsonschema
import pytest

from cnctwin.api.access import Access
from cnctwin.api.i3x.problem import PREFIX
from cnctwin.api.live.plant import LivePlant
from tests.cnctwin.api.i3x.shapes import (
    CREATED,
    CURRENT,
    INFO,
    NAMESPACE,
    OBJECT,
    OBJECT_TYPE,
    PAST,
    RELATED,
    RELATIONSHIP_TYPE,
    SUBSCRIPTION,
    SYNC,
    failed,
    record,
    result_of,
    results_of,
)  # fmt: skip
from tests.cnctwin.api.small_plant import Client, birth, client_of, data, death, now, small_plant

BOGUS = "no-such-element"
TOKEN = "the token of the server"
LONG_AGO, FAR_OFF = "2026-01-01T00:00:00Z", "2026-01-02T00:00:00Z"


class Server(NamedTuple):
    """A server with a plant that a test tells of."""

    client: Client
    live: LivePlant

    def get(self, path: str, **options: Any) -> Any:
        """The body of an answer."""
        answer = self.client.get(PREFIX + path, headers={"Authorization": f"Bearer {TOKEN}"}, **options)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def post(self, path: str, status: int = 200, **body: Any) -> Any:
        """The body of an answer that has this status."""
        answer = self.client.post(PREFIX + path, headers={"Authorization": f"Bearer {TOKEN}"}, json=body)
        assert answer.status_code == status, answer.text
        return answer.json()

    def objects(self) -> list[dict[str, Any]]:
        """All objects."""
        found: list[dict[str, Any]] = result_of(self.get("/objects"), {"type": "array", "items": OBJECT})
        return found

    def tell(self, **values: Any) -> None:
        """A message of the machine."""
        t_ms = now()
        self.live.take([data(values, t_ms)], t_ms)
        self.client.app.state.subscriptions.deliver(self.live.flush(t_ms))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    """A machine with its twin, another that is offline, and one with a name and metrics like nobody else's."""
    t_ms = now()
    live = small_plant(t_ms)
    live.take([birth({"spindle_load_pct": 1.0, "program": None}, t_ms, machine="lathe")], t_ms)
    live.take([death({"spindle_load_pct": 1.0, "program": None}, t_ms, machine="lathe")], t_ms)
    odd = {"Spindel Öl/Druck #1": 4.2, "counts": (1.0, 2.0), "spindle_rpm": "fast", "axis_z4_pos_mm": 1.0, "note": "x", "n": 3}
    live.take([birth(odd, t_ms, machine=" cell 4/Fräse\t")], t_ms)
    with client_of(live, access=Access(TOKEN)) as client:
        yield Server(client, live)


@pytest.fixture
def subscription(server: Server) -> Iterator[dict[str, str]]:
    """A subscription with one signal, which has changed."""
    made = result_of(server.post("/subscriptions", clientId="suite-5d1f", displayName="suite"), CREATED)
    named = {"clientId": "suite-5d1f", "subscriptionId": made["subscriptionId"]}
    results_of(
        server.post("/subscriptions/register", **named, elementIds=["signal/vmc/spindle_rpm"]), ["signal/vmc/spindle_rpm"], {}
    )
    yield named
    server.post("/subscriptions/delete", clientId="suite-5d1f", subscriptionIds=[made["subscriptionId"]])


def every_id(server: Server) -> list[str]:
    return [one["elementId"] for one in server.objects()]


def test_info_is_complete_and_needs_no_authentication(server: Server) -> None:
    """CORE-01, CORE-02, CORE-03."""
    told = server.client.get(f"{PREFIX}/info")
    assert told.status_code == 200
    assert result_of(told.json(), INFO)["capabilities"]["update"] == {"current": False, "history": False}


def test_answers_are_compressed_for_whoever_asks_for_it(server: Server) -> None:
    """CORE-04."""
    headers = {"Authorization": f"Bearer {TOKEN}", "Accept-Encoding": "gzip"}
    assert server.client.get(f"{PREFIX}/namespaces", headers=headers).headers["content-encoding"] == "gzip"
    asked = {"elementIds": ["machine/vmc"], "startTime": LONG_AGO, "endTime": FAR_OFF, "maxDepth": 0}
    partial = server.client.post(f"{PREFIX}/objects/history", headers=headers, json=asked)
    assert (partial.status_code, partial.headers["content-encoding"]) == (206, "gzip")
    assert partial.json()["responseDetail"]["status"] == 206


def test_all_but_info_takes_authentication(server: Server) -> None:
    """CORE-06, and the shape of the refusal."""
    refusal = server.client.get(f"{PREFIX}/namespaces")
    assert refusal.status_code == 401
    assert "Bearer" in failed(refusal.json(), 401)
    wrong = server.client.get(f"{PREFIX}/objects", headers={"Authorization": "Bearer wrong"})
    assert "Bearer" in failed(wrong.json(), 401)


def test_namespaces_have_unique_addresses(server: Server) -> None:
    """EXP-01, EXP-02, EXP-03."""
    found = result_of(server.get("/namespaces"), {"type": "array", "items": NAMESPACE, "minItems": 1})
    assert len({one["uri"] for one in found}) == len(found)


@pytest.mark.parametrize(("path", "shape"), [("/objecttypes", OBJECT_TYPE), ("/relationshiptypes", RELATIONSHIP_TYPE)])
def test_types_belong_to_a_namespace_and_are_found_by_it_and_by_id(server: Server, path: str, shape: dict[str, Any]) -> None:
    """EXP-04 to EXP-09, EXP-11."""
    found = result_of(server.get(path), {"type": "array", "items": shape, "minItems": 1})
    uris = {one["uri"] for one in server.get("/namespaces")["result"]}
    assert {one["namespaceUri"] for one in found} <= uris
    for uri in uris:
        assert server.get(path, params={"namespaceUri": uri})["result"] == [one for one in found if one["namespaceUri"] == uri]
    ids = [one["elementId"] for one in found[:3]][::-1]
    assert results_of(server.post(f"{path}/query", elementIds=[*ids, BOGUS]), [*ids, BOGUS], shape) == [*found[:3][::-1], None]


def test_every_schema_of_a_type_is_one(server: Server) -> None:
    """EXP-04."""
    for one in server.get("/objecttypes")["result"]:
        jsonschema.Draft202012Validator.check_schema(one["schema"])


def test_each_relationship_type_has_its_reverse(server: Server) -> None:
    """EXP-10."""
    reverse = {one["elementId"]: one["reverseOf"] for one in server.get("/relationshiptypes")["result"]}
    assert {name: reverse[reverse[name]] for name in reverse} == {name: name for name in reverse}


def test_objects_have_a_known_type_and_ids_that_are_clean_and_unique(server: Server) -> None:
    """EXP-12, EXP-13, EXP-14."""
    types = [one["elementId"] for one in server.get("/objecttypes")["result"]]
    found = server.objects()
    assert {one["typeElementId"] for one in found} <= set(types)
    ids = [one["elementId"] for one in found] + types + [one["elementId"] for one in server.get("/relationshiptypes")["result"]]
    assert len(ids) == len(set(ids))
    assert all(one == one.strip() and one.isprintable() for one in ids)


def test_the_root_has_no_parent_and_the_filters_filter(server: Server) -> None:
    """EXP-15, EXP-16."""
    (root,) = server.get("/objects", params={"root": "true"})["result"]
    assert (root["elementId"], root["parentId"]) == ("plant", None)
    found = server.objects()
    for type_id in {one["typeElementId"] for one in found}:
        listed = server.get("/objects", params={"typeElementId": type_id})["result"]
        assert listed == [one for one in found if one["typeElementId"] == type_id]


def test_metadata_says_where_a_type_is_from(server: Server) -> None:
    """EXP-17."""
    with_metadata = {**OBJECT, "required": [*OBJECT["required"], "metadata"]}
    found = result_of(server.get("/objects", params={"includeMetadata": "true"}), {"type": "array", "items": with_metadata})
    assert len(found) == len(server.objects())
    (temp,) = [one["metadata"] for one in found if one["displayName"] == "twin/spindle_temp_c"]
    assert (temp["description"], temp["system"]["unit"], temp["system"]["provenance"]) == ("rise + ambient", "°C", "modelled")


def test_objects_are_listed_in_the_order_of_the_request(server: Server) -> None:
    """EXP-18."""
    ids = [*every_id(server)[::-1], BOGUS, "machine/nobody", "signal/vmc/nothing"]
    listed = results_of(server.post("/objects/list", elementIds=ids), ids, OBJECT)
    assert listed == [*server.objects()[::-1], None, None, None]


def test_relationships_lead_there_and_back_and_are_filtered(server: Server) -> None:
    """EXP-19 to EXP-22."""
    ids = every_id(server)
    edges = {
        (one, edge["sourceRelationship"], edge["object"]["elementId"])
        for one, found in zip(ids, results_of(server.post("/objects/related", elementIds=ids), ids, RELATED), strict=True)
        for edge in found
    }
    reverse = {one["elementId"]: one["reverseOf"] for one in server.get("/relationshiptypes")["result"]}
    assert edges == {(end, reverse[name], begin) for begin, name, end in edges}
    parents = {(one["elementId"], one["parentId"]) for one in server.objects() if one["parentId"] is not None}
    assert parents == {(begin, end) for begin, name, end in edges if name in ("HasParent", "ComponentOf")}
    (down,) = results_of(
        server.post("/objects/related", elementIds=["plant"], relationshipType="HasChildren"), ["plant"], RELATED
    )
    assert {edge["sourceRelationship"] for edge in down} == {"HasChildren"}
    (none,) = results_of(server.post("/objects/related", elementIds=["plant"], relationshipType="HasParent"), ["plant"], RELATED)
    assert none == []


def test_every_value_is_of_the_schema_of_its_type(server: Server) -> None:
    """QRY-01 to QRY-04."""
    found, ids = server.objects(), [*every_id(server), BOGUS]
    schemas = {one["elementId"]: one["schema"] for one in server.get("/objecttypes")["result"]}
    values = results_of(server.post("/objects/value", elementIds=ids), ids, CURRENT)
    assert values.pop() is None
    for one, told in zip(found, values, strict=True):
        if told["value"] is not None:
            jsonschema.validate(told["value"], schemas[one["typeElementId"]])


def test_components_are_shown_to_whoever_asks_deeper(server: Server) -> None:
    """QRY-05, QRY-06."""
    signals = {one for one in every_id(server) if one.startswith("signal/vmc/")}
    for depth, shown in ((1, set()), (0, signals), (2, signals)):
        (told,) = results_of(server.post("/objects/value", elementIds=["machine/vmc"], maxDepth=depth), ["machine/vmc"], CURRENT)
        assert told["isComposition"] is True
        assert set(told.get("components", {})) == shown


def test_history_is_of_the_range_and_says_where_there_is_none(server: Server) -> None:
    """QRY-07, QRY-08, QRY-09."""
    ids = ["signal/vmc/spindle_load_pct", "machine/vmc", BOGUS]
    asked = {"elementIds": ids, "startTime": LONG_AGO, "endTime": FAR_OFF}
    past, own, unknown = results_of(server.post("/objects/history", 206, **asked), ids, PAST)
    assert past["values"] == own["values"] == [{"value": None, "quality": "GoodNoData", "timestamp": "2026-01-02T00:00:00.000Z"}]
    assert unknown is None


def test_writing_is_refused_as_not_implemented(server: Server) -> None:
    """UPD-05: to a reader, too, since it is nobody's right."""
    for path in ("/objects/value", "/objects/history"):
        headers = {"Authorization": f"Bearer {TOKEN}"}
        answer = server.client.request("PUT", PREFIX + path, headers=headers, json={"updates": []})
        assert answer.status_code == 501
        assert "only reads" in failed(answer.json(), 501)


def test_a_subscription_is_listed_until_it_is_deleted(server: Server) -> None:
    """SUB-01, SUB-02, SUB-10, SUB-11."""
    made = result_of(server.post("/subscriptions", clientId="a"), CREATED)["subscriptionId"]
    ids = [made, BOGUS]
    told, none = results_of(
        server.post("/subscriptions/list", clientId="a", subscriptionIds=ids), ids, SUBSCRIPTION, "subscriptionId"
    )
    assert (told["monitoredObjects"], none) == ([], None)
    deleted = server.post("/subscriptions/delete", clientId="a", subscriptionIds=ids)
    results_of(deleted, ids, {"type": "null"}, "subscriptionId")
    assert [one["success"] for one in deleted["results"]] == [True, False]
    for path in ("sync", "stream"):
        failed(server.post(f"/subscriptions/{path}", 404, clientId="a", subscriptionId=made), 404)


def test_a_request_without_a_client_is_malformed_and_another_client_finds_nothing(
    server: Server, subscription: dict[str, str]
) -> None:
    """SUB-15, SUB-16."""
    known = subscription["subscriptionId"]
    for path in ("", "/list", "/delete", "/register", "/unregister", "/sync", "/stream"):
        body = {"subscriptionId": known, "subscriptionIds": [known], "elementIds": ["plant"]}
        assert "clientId" in failed(server.post(f"/subscriptions{path}", 400, **body), 400)
        if path in ("/register", "/unregister", "/sync", "/stream"):
            failed(server.post(f"/subscriptions{path}", 404, **body, clientId="somebody else"), 404)
    listed = server.post("/subscriptions/list", clientId="somebody else", subscriptionIds=[known])
    assert results_of(listed, [known], SUBSCRIPTION, "subscriptionId") == [None]


def test_objects_are_registered_once_however_often_and_unknown_ones_fail_alone(
    server: Server, subscription: dict[str, str]
) -> None:
    """SUB-03, SUB-04, SUB-05, SUB-08."""
    ids = ["signal/vmc/spindle_rpm", "machine/vmc", BOGUS]
    for _ in range(2):
        answer = server.post("/subscriptions/register", **subscription, elementIds=ids)
        results_of(answer, ids, {"type": "null"})
        assert [one["success"] for one in answer["results"]] == [True, True, False]
    asked = {"clientId": subscription["clientId"], "subscriptionIds": [subscription["subscriptionId"]]}
    (told,) = results_of(server.post("/subscriptions/list", **asked), asked["subscriptionIds"], SUBSCRIPTION, "subscriptionId")
    assert [one["elementId"] for one in told["monitoredObjects"]] == ids[:2]
    answer = server.post("/subscriptions/unregister", **subscription, elementIds=ids[1:])
    assert [one["success"] for one in answer["results"]] == [True, False]


def test_updates_wait_until_they_are_acknowledged(server: Server, subscription: dict[str, str]) -> None:
    """SUB-06, SUB-07."""
    server.tell(spindle_rpm=100.0)
    first = result_of(server.post("/subscriptions/sync", **subscription), SYNC)
    server.tell(spindle_rpm=200.0)
    second = result_of(server.post("/subscriptions/sync", **subscription), SYNC)
    assert second[: len(first)] == first
    assert [update["value"] for batch in second for update in batch["updates"]][-2:] == [100.0, 200.0]
    numbers = [batch["sequenceNumber"] for batch in second]
    assert all(after > before for before, after in pairwise(numbers))
    rest = result_of(server.post("/subscriptions/sync", **subscription, lastSequenceNumber=numbers[-2]), SYNC)
    assert [batch["sequenceNumber"] for batch in rest] == numbers[-1:]
    assert server.post("/subscriptions/sync", **subscription, lastSequenceNumber=numbers[-1])["result"] == []


def test_minus_one_clears_everything_and_an_impossible_number_nothing(server: Server, subscription: dict[str, str]) -> None:
    """SUB-13."""
    server.tell(spindle_rpm=300.0)
    known = server.post("/subscriptions/sync", **subscription)["result"]
    for wrong in (10**6, -2, 2**64 - 1):
        assert server.post("/subscriptions/sync", **subscription, lastSequenceNumber=wrong)["result"] == known
    failed(server.post("/subscriptions/sync", 400, **subscription, lastSequenceNumber="7"), 400)
    server.tell(spindle_rpm=301.0)
    assert server.post("/subscriptions/sync", **subscription, lastSequenceNumber=-1)["result"] == []
    server.tell(spindle_rpm=302.0)
    (batch,) = server.post("/subscriptions/sync", **subscription)["result"]
    assert batch["sequenceNumber"] > known[-1]["sequenceNumber"]


@pytest.mark.parametrize(
    ("path", "body", "line"),
    [
        ("/objects/value", b'{"elementIds": "plant"}', "elementIds is 'plant'"),
        ("/objects/value", b'{"elementIds": ["\\ud800"]}', "elementIds.0"),
        ("/objects/value", b'{"elementIds": ["plant"], "maxDepth": -1}', "maxDepth is -1"),
        ("/objects/value", b"[" * 5000, "body"),
        ("/objects/list", b"{}", "elementIds is missing; /i3x/v1/openapi.json has an example"),
        ("/objects/related", b'{"elementIds": [1]}', "elementIds.0 is 1"),
        ("/objecttypes/query", b"\xff", "parsing the body"),
        ("/subscriptions", b'{"clientId": ""}', "clientId is ''"),
    ],
)
def test_a_malformed_request_is_refused_in_one_line_that_names_it(server: Server, path: str, body: bytes, line: str) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
    answer = server.client.post(PREFIX + path, headers=headers, content=body)
    assert answer.status_code == 400
    said = failed(answer.json(), 400)
    assert line in said
    assert "\n" not in said


def test_a_body_without_its_type_is_told_what_to_send(server: Server) -> None:
    answer = server.client.post(
        f"{PREFIX}/objects/value", headers={"Authorization": f"Bearer {TOKEN}"}, content=b'{"elementIds": ["plant"]}'
    )
    said = "the body is not taken as JSON; send Content-Type: application/json"
    assert failed(answer.json(), 400) == said


def test_no_more_ids_than_the_limit_are_taken_at_once(server: Server) -> None:
    assert "elementIds" in failed(server.post("/objects/value", 400, elementIds=["plant"] * 1001), 400)
    headers = {"Authorization": f"Bearer {TOKEN}"}
    assert server.client.post(f"{PREFIX}/objects/value", headers=headers, content=b" " * 300_001).status_code == 413


def test_what_is_no_method_of_i3x_is_refused_in_its_shape(server: Server) -> None:
    for method, path, status in (("GET", "/nothing", 404), ("DELETE", "/objects", 405), ("GET", "/objects/value", 405)):
        headers = {"Authorization": f"Bearer {TOKEN}"}
        answer = server.client.request(method, PREFIX + path, headers=headers)
        assert answer.status_code == status
        assert path in failed(answer.json(), status)
    jsonschema.validate(server.get("/openapi.json"), record(openapi={}, paths={}))
