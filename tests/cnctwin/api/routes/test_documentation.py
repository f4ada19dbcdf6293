"""The documentation on the server: the built site under its own policy, and a plain word where it is not built."""

from pathlib import Path

from fastapi import FastAPI

from cnctwin.api.routes.documentation import POLICY, serve_documentation
from tests.cnctwin.api.small_plant import Client


def _client(site: Path) -> Client:
    app = FastAPI(docs_url=None)
    serve_documentation(app, site)
    return Client(app, "127.0.0.1", "127.0.0.1")


def test_the_site_is_served_with_a_policy_that_lets_nothing_in_from_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "how-to").mkdir()
    (tmp_path / "index.html").write_text("<h1>Start</h1>")
    (tmp_path / "how-to" / "edges.html").write_text("<h1>Edges</h1>")
    with _client(tmp_path) as client:
        start = client.get("/docs", follow_redirects=True)
        assert (start.status_code, start.text, start.url.path) == (200, "<h1>Start</h1>", "/docs/")
        assert start.headers["content-security-policy"] == POLICY and "https:" not in POLICY
        assert client.get("/docs/how-to/edges.html").text == "<h1>Edges</h1>"
        assert client.get("/docs/nothing.html").status_code == 404


def test_nothing_beside_the_site_is_served(tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "index.html").write_text("<h1>Start</h1>")
    (tmp_path / "secret").write_text("secret")
    with _client(tmp_path / "site") as client:
        assert client.get("/docs/%2e%2e/secret").status_code == 404


def test_a_site_that_is_not_built_says_how_to_build_it(tmp_path: Path) -> None:
    with _client(tmp_path / "site") as client:
        answer = client.get("/docs/")
    assert answer.status_code == 404 and "scripts/docs" in answer.text
