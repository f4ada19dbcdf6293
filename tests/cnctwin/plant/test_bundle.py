"""A bundle for a report of a fault has no secret in it, wherever one was: a hunt for planted ones."""

import json
import zipfile
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.plant.bundle import LOG_BYTES_MAX, NO_LOGS, summary, write_bundle

PLANTED = {
    "in an address": "hunter2-address",
    "as a password": "hunter2-password",
    "as an address of a receiver": "T0000/B0000/hunter2receiver",
    "as a user of the page": "hunter2-page-token-0123",
    "in a comment": "hunter2-comment",
    "in the environment": "hunter2-environment",
    "in a file that is named": "hunter2-in-a-file",
    "in a key file": "hunter2-in-the-key-file",
    "in a file that is no TOML": "hunter2-broken",
    "in words of the doctor": "hunter2-findings",
    "in a log alone": "hunter2-logged",
    "as a header": "hunter2header000",
    "as a private key": "hunter2pem",
    "as a query": "hunter2-query",
    "as a login": "hunter2-login",
    "as a number": "48151623",
    "as it looks": "sk9aF3kq0ZbX7mN2pL5tR8vY",
}


def planted(folder: Path) -> list[Path]:
    secret = folder / "ntfy.secret"
    secret.write_text(PLANTED["in a file that is named"] + "\n")
    key = folder / "client.secret"
    key.write_text(PLANTED["in a key file"])
    edges = folder / "edges"
    edges.mkdir()
    (edges / "vmc.toml").write_text(
        f'''# {PLANTED["in a comment"]}
[machine]
name = "vmc"
lost_after_s = 30.0
[broker]
url = "mqtts://edge-1:{PLANTED["in an address"]}@broker.plant:8883?key={PLANTED["as a query"]}"
password_env = "VMC_PASSWORD"
[opcua]
password = "{PLANTED["as a password"]}"
username = "{PLANTED["as a login"]}"
pin = {PLANTED["as a number"]}
key_file = "{key}"
note = "{PLANTED["as it looks"]}"
'''
    )
    (folder / "processors.toml").write_text(
        f"""[alerts.receivers.ops]
type = "webhook"
url = "https://hooks.example/{PLANTED["as an address of a receiver"]}"
[alerts.receivers.phone]
type = "ntfy"
token = "file:{secret}"
[thermal]
tick_s = 2.0
"""
    )
    (folder / "users.toml").write_text(f'[ada]\nrole = "reader"\ntoken = "{PLANTED["as a user of the page"]}"\n')
    (folder / "broken.toml").write_text(f'password = "{PLANTED["in a file that is no TOML"]}')
    log = folder / "cnctwin.log"
    lines = [
        f"no connection to mqtts://edge-1:{PLANTED['in an address']}@broker.plant",
        f"password={PLANTED['in a log alone']} refused",
        f"Authorization: Bearer {PLANTED['as a header']}",
        f"-----BEGIN PRIVATE KEY-----\n{PLANTED['as a private key']}\n-----END PRIVATE KEY-----",
        *(f"seen: {secret}" for name, secret in PLANTED.items() if name not in ONLY_THERE),
        "the end",
    ]
    log.write_text("x" * LOG_BYTES_MAX + "\n" + "\n".join(lines) + "\n")
    return [edges, folder / "processors.toml", folder / "users.toml", folder / "broken.toml", log]


ONLY_THERE = {"in a comment", "in a file that is no TOML", "in a log alone"}
ONLY_THERE |= {"as a header", "as a private key", "in words of the doctor"}
"""Nothing but its place tells that these are secrets, so that a log which repeats one alone cannot be blanked."""


def bundled(folder: Path) -> dict[str, str]:
    report = {"good": False, "findings": [f"mqtt://u:{PLANTED['in words of the doctor']}@broker does not answer"]}
    out = folder / "bundle.zip"
    environment = {"VMC_PASSWORD": PLANTED["in the environment"], "CNCTWIN_BROKER": "mqtt://broker", "HOME": "/root"}
    names = write_bundle(out, report, planted(folder), environment)
    with zipfile.ZipFile(out) as bundle:
        assert sorted(bundle.namelist()) == names
        return {name: bundle.read(name).decode() for name in names}


def test_no_planted_secret_is_in_the_bundle(tmp_path: Path) -> None:
    whole = "\n".join(bundled(tmp_path).values())
    assert {name: secret for name, secret in PLANTED.items() if secret in whole} == {}


def test_what_helps_is_still_there(tmp_path: Path) -> None:
    parts = bundled(tmp_path)
    vmc = json.loads(next(text for name, text in parts.items() if name.endswith("edges/vmc.toml.json")))
    assert vmc["machine"] == {"name": "vmc", "lost_after_s": 30.0}
    assert vmc["broker"]["url"].startswith("mqtts://edge-1:…@broker.plant:8883")
    assert vmc["broker"]["password_env"] == "VMC_PASSWORD"
    processors = json.loads(next(text for name, text in parts.items() if name.endswith("processors.toml.json")))
    assert processors["thermal"] == {"tick_s": 2.0}
    assert processors["alerts"]["receivers"]["ops"] == {"type": "webhook", "url": "…"}
    log = next(text for name, text in parts.items() if name.endswith("cnctwin.log"))
    assert log.endswith("the end\n") and "xxxx" not in log and "no connection to mqtts://edge-1:…@broker.plant" in log
    versions = json.loads(parts["versions.json"])
    assert versions["packages"]["typer"] and versions["variables"] == ["CNCTWIN_BROKER"]
    assert "broken.toml (TOMLDecodeError)" in parts["README.txt"]
    assert json.loads(parts["doctor.json"])["good"] is False


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no such file or folder"):
        write_bundle(tmp_path / "b.zip", {}, [tmp_path / "none.toml"])
    with pytest.raises(UsageError, match="name a file that can be written"):
        write_bundle(tmp_path / "none" / "b.zip", {}, [tmp_path])


def test_the_logs_of_a_running_plant_are_taken_without_being_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = tmp_path / "state" / "logs"
    logs.mkdir(parents=True)
    (logs / "edge.log").write_text("no answer from the control\n")
    monkeypatch.chdir(tmp_path)
    names = write_bundle(Path("bug.zip"), {}, [], {})
    assert "logs/state/logs/edge.log" in names
    with zipfile.ZipFile("bug.zip") as bundle:
        assert bundle.read("logs/state/logs/edge.log") == b"no answer from the control\n"
        assert "Logs: 1\n" in bundle.read("README.txt").decode()


def test_a_bundle_without_logs_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = write_bundle(Path("bug.zip"), {}, [], {})
    assert NO_LOGS in summary(Path("bug.zip"), names)
    with zipfile.ZipFile("bug.zip") as bundle:
        assert f"Logs: {NO_LOGS}\n" in bundle.read("README.txt").decode()
