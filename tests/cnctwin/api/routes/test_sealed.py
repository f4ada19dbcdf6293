"""The seal of the demo: its hash can be seen from the start, and what it holds only after somebody has revealed it."""

import hashlib
from pathlib import Path

from cnctwin.api.envelope import Envelope
from cnctwin.standins.simulated_machine.hidden_effect import choice_of, sealed_effect
from tests.cnctwin.api.small_plant import client_of, small_plant


def test_nothing_is_seen_before_it_is_revealed_and_all_can_be_checked_afterwards(tmp_path: Path) -> None:
    file = tmp_path / "sealed.json"
    added, sealed = sealed_effect(choice_of("random"), None, file)
    envelope = Envelope(file)
    assert envelope.shown() == {"sha256": sealed.seal.digest, "revealed": None}
    with client_of(small_plant(), envelope=envelope) as client:
        told = client.post("/demo/reveal", json={}).json()
    assert told == envelope.shown()
    found = told["revealed"]
    assert found["added"]["effect"] == added.effect
    assert hashlib.sha256(f"{found['salt']}\n{found['text']}".encode()).hexdigest() == told["sha256"] == sealed.seal.digest


def test_a_machine_that_has_sealed_nothing_yet_has_nothing_to_reveal(tmp_path: Path) -> None:
    with client_of(small_plant(), envelope=Envelope(tmp_path / "sealed.json")) as client:
        answer = client.post("/demo/reveal", json={})
    assert answer.status_code == 404
    assert "nothing is hidden here" in answer.json()["error"]


def test_a_file_that_was_changed_is_not_shown(tmp_path: Path) -> None:
    file = tmp_path / "sealed.json"
    sealed_effect(choice_of("random"), None, file)
    file.write_text(file.read_text().replace("added", "other"))
    with client_of(small_plant(), envelope=Envelope(file)) as client:
        answer = client.post("/demo/reveal", json={})
    assert answer.status_code == 503
    assert "not those that were sealed" in answer.json()["error"]


def test_a_server_without_a_sealed_file_has_no_such_route() -> None:
    assert Envelope(None).shown() is None
    with client_of(small_plant()) as client:
        assert client.post("/demo/reveal", json={}).status_code in (404, 405)
        assert "/demo/reveal" not in client.get("/openapi.json").json()["paths"]
