"""The record of who did what: complete, private, bounded, and without secrets."""

import json
import stat
from pathlib import Path

import pytest

from cnctwin.api.access import Access
from cnctwin.api.door import audit
from cnctwin.api.door.audit import AuditLog, Deed
from cnctwin.api.door.role import Role
from cnctwin.api.door.users import User
from tests.cnctwin.api.small_plant import client_of, small_plant

TOKEN = "a-token-of-more-than-sixteen"
ADA = User("ada", Role.OPERATOR, TOKEN)
ROOT = User("root", Role.ADMINISTRATOR, "another-token-of-sixteen")
DEED = Deed("ada", "operator", "10.0.0.7", "acknowledge", "ea33a6")
REFUSED = DEED._replace(outcome="403 no")


def lines(file: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in file.read_text().splitlines()]


def test_who_did_what_stands_in_a_file_that_only_its_owner_reads(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "page.jsonl"
    log = AuditLog(file)
    log.note(DEED, 1_795_305_600.5)
    assert lines(file) == [{"at": "2026-11-22T00:00:00.500Z", **DEED._asdict()}]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    file.chmod(0o644)
    log.note(DEED, 1_795_305_601.0)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert [one["at"] for one in AuditLog(file).newest(10)] == ["2026-11-22T00:00:01.000Z", "2026-11-22T00:00:00.500Z"]


def test_every_action_is_noted_with_its_outcome_and_no_secret(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "page.jsonl")
    with client_of(small_plant(), peer="10.0.0.7", access=Access(users=(ADA, ROOT)), audit=log) as client:
        client.post("/login", json={"token": "wrong-token-of-sixteen"})
        client.post("/login", json={"token": TOKEN})
        ours = {"Origin": "http://127.0.0.1"}
        client.post("/alerts/ea33a6/acknowledge", json={"by": "mallory"}, headers=ours)
        client.post("/models/anomaly/vmc/promote", json={}, headers=ours)
        client.get("/machines", headers={"Authorization": "Bearer wrong-token-of-sixteen"})
        client.get("/machines")
        client.post("/logout", headers=ours)
        told = client.get("/audit", headers={"Authorization": f"Bearer {ROOT.token}"}).json()["deeds"]
    found = [(one["user"], one["role"], one["action"], one["object"], str(one["outcome"])[:4].strip()) for one in reversed(told)]
    assert found == [
        ("anybody", "", "log in", "", "401"),
        ("ada", "operator", "log in", "", "done"),
        ("ada", "operator", "acknowledge", "ea33a6", "503"),
        ("ada", "operator", "promote model", "anomaly/vmc", "403"),
        ("anybody", "", "give token", "/machines", "401"),
        ("ada", "operator", "log out", "", "done"),
    ]
    assert {one["address"] for one in told} == {"10.0.0.7"}
    text = (tmp_path / "page.jsonl").read_text()
    assert len(text.splitlines()) == len(found)
    assert "of-sixteen" not in text
    assert TOKEN not in text


def test_it_is_bounded_and_the_oldest_file_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "BYTES_MAX", 2_000)
    monkeypatch.setattr(audit, "REMEMBERED_MAX", 20)
    log = AuditLog(tmp_path / "page.jsonl")
    for number in range(300):
        log.note(DEED._replace(object=str(number)), float(number))
    files = sorted(tmp_path.iterdir())
    assert len(files) in (audit.FILES_MAX, audit.FILES_MAX - 1)
    assert all(one.stat().st_size <= 2_000 + 300 for one in files)
    assert all(stat.S_IMODE(one.stat().st_mode) == 0o600 for one in files)
    kept = [number for one in files for number in (int(str(line["object"])) for line in lines(one))]
    assert sorted(kept) == list(range(300 - len(kept), 300)), "the newest, without a hole"
    assert [one["object"] for one in AuditLog(tmp_path / "page.jsonl").newest(3)] == ["299", "298", "297"]


def test_refusals_are_limited_and_what_is_left_out_is_counted() -> None:
    log = AuditLog()
    for _ in range(50):
        log.note(REFUSED, 0.0)
    log.note(DEED, 1.0)
    told = log.newest(100)
    assert [one["outcome"] for one in told] == ["done"] + ["403 no"] * audit.REFUSALS_OF_ONE_MAX
    assert told[0]["left_out"] == 50 - audit.REFUSALS_OF_ONE_MAX
    for number in range(500):
        log.note(REFUSED._replace(address=f"10.0.{number}.1"), 2.0)
    assert len(log.newest(1000)) == 1 + audit.REFUSALS_MAX
    log.note(REFUSED, 100.0)
    assert log.newest(1)[0]["left_out"] == 500 - (audit.REFUSALS_MAX - audit.REFUSALS_OF_ONE_MAX)


def test_what_a_request_says_cannot_break_a_line_or_a_terminal(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "page.jsonl")
    log.note(DEED._replace(user="a\nb\x1b[31m", object="x" * 5000), 0.0)
    (line,) = lines(tmp_path / "page.jsonl")
    assert line["user"] == "a b [31m"
    assert len(str(line["object"])) <= audit.TEXT_MAX + 1


def test_a_torn_line_is_passed_over_and_a_disk_that_is_full_hinders_nobody(tmp_path: Path) -> None:
    file = tmp_path / "page.jsonl"
    log = AuditLog(file)
    log.note(DEED, 0.0)
    with file.open("a") as torn:
        torn.write('{"at": "2026')
    again = AuditLog(file)
    assert len(again.newest(10)) == 1
    again.note(DEED._replace(object="after"), 1.0)
    assert [one["object"] for one in AuditLog(file).newest(10)] == ["after", "ea33a6"]
    folder = tmp_path / "folder"
    folder.mkdir()
    failing = AuditLog(folder)
    failing.note(DEED, 0.0)
    assert "folder" in failing.trouble
    assert len(failing.newest(10)) == 1
