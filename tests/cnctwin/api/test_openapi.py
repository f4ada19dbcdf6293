"""The OpenAPI document: what a program that has never seen us needs."""

import re
from typing import Any

import pytest

from tests.cnctwin.api.small_plant import client_of, small_plant

OF_THE_PLANT = (
    "/machines",
    "/state/{machine}",
    "/stream",
    "/gap/{machine}",
    "/gap/{machine}/report",
    "/twin/{machine}",
    "/alerts",
    "/anomaly/{machine}",
)
OF_JOBS = ("/jobs", "/jobs/{job_id}", "/jobs/{job_id}/files/{name}")
OF_THE_PAST = ("/history/{machine}", "/events/{machine}", "/parts/{machine}", "/figures", "/validation/{machine}")
OF_THE_SERVER = ("/health", "/livez", "/readyz", "/metrics", "/whoami", "/audit", "/models")
ASKED = ("/silences", "/predict", "/twin/replay", "/alerts/{fingerprint}/acknowledge", "/jobs")
OF_ITS_OWN = ("/silences/{silence_id}/end", "/anomaly/{machine}/verdict", "/models/{kind}/{machine}/promote")
OF_THE_LOOP = tuple(f"/twin/{{machine}}/{word}" for word in ("diagnose", "promote", "back", "withdraw"))
POSTS = (*ASKED, *OF_ITS_OWN, *OF_THE_LOOP, "/jobs/{job_id}/cancel", "/login", "/logout")
ROUTES = {f"GET {path}" for path in (*OF_THE_PLANT, *OF_JOBS, *OF_THE_PAST, *OF_THE_SERVER)} | {f"POST {path}" for path in POSTS}


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    with client_of() as client:
        found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def routes(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {f"{method.upper()} {path}": route for path, methods in document["paths"].items() for method, route in methods.items()}


def test_all_routes_are_in_it_and_say_what_they_are(document: dict[str, Any]) -> None:
    told = routes(document)
    assert set(told) == ROUTES
    assert [name for name, route in told.items() if not route.get("description")] == []


def test_what_is_posted_has_an_example_that_is_taken(document: dict[str, Any]) -> None:
    told = routes(document)
    with client_of(small_plant()) as client:
        for name in (f"POST {path}" for path in ASKED):
            reference = told[name]["requestBody"]["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
            (example,) = document["components"]["schemas"][reference]["examples"]
            answer = client.post(name.split()[1].replace("{fingerprint}", "ea33a6"), json=example)
            assert answer.status_code in (200, 503), answer.text


def test_every_path_parameter_has_an_example(document: dict[str, Any]) -> None:
    bare = [
        (name, one["name"])
        for name, route in routes(document).items()
        for one in route.get("parameters", ())
        if one["in"] == "path" and not one["schema"].get("examples")
    ]
    assert bare == []


def test_every_answer_that_is_json_has_a_contract(document: dict[str, Any]) -> None:
    for name, route in routes(document).items():
        content = route["responses"].get("200", {}).get("content", {})
        if "application/json" in content:
            assert content["application/json"]["schema"] != {}, name


def test_the_list_of_routes_needs_no_network_and_no_script() -> None:
    with client_of() as client:
        page = client.get("/routes").text
    assert re.findall(r"https?://", page) == []
    assert "<script" not in page
    assert "style=" not in page
    for name in ROUTES:
        assert name in page
