"""The page for each role: what may not be done is not offered, and the page says why."""

import re
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.documents import alerts
from tests.cnctwin.page.fake_server import Shop

DEEDS = [
    {
        "at": "2026-11-22T10:00:00.000Z",
        "user": "ada",
        "role": "operator",
        "address": "10.0.0.7",
        "action": "acknowledge",
        "object": "ea33a6",
        "outcome": "done",
    },
    {
        "at": "2026-11-22T09:00:00.000Z",
        "user": "<b>mallory</b>",
        "role": "reader",
        "address": "10.0.0.8",
        "action": "ask for job",
        "object": "",
        "outcome": "403 mallory is a reader; this takes an operator",
    },
]


def is_now(shop: Shop, role: str, user: str | None = "ada") -> None:
    shop.me = {"user": user, "role": role, "logs_out": True}


def test_a_reader_sees_what_fires_and_why_it_cannot_be_acknowledged(visit: Visit, shop: Shop) -> None:
    is_now(shop, "reader")
    page = visit.open("#/alerts")
    expect(page.locator(".note.role")).to_have_text("You are a reader (ada): acknowledging, or silencing, takes an operator.")
    buttons = page.get_by_role("button", name="Acknowledge")
    expect(buttons.first).to_be_visible()
    assert all(button.is_disabled() for button in buttons.all())
    page.keyboard.press("k")
    expect(page.get_by_role("dialog")).to_be_hidden()
    visit.open("#/jobs")
    expect(page.get_by_role("button", name="New job")).to_be_disabled()
    expect(page.locator(".note.role")).to_contain_text("cancelling one, takes an operator")
    expect(page.get_by_role("button", name="Cancel").first).to_be_disabled()


@pytest.mark.parametrize("role", ["operator", "administrator"])
def test_an_operator_acknowledges_under_the_name_that_the_server_knows(visit: Visit, shop: Shop, role: str) -> None:
    is_now(shop, role)
    posted: list[Any] = []
    shop.answers["/alerts/[^/]+/acknowledge"] = lambda _path, body: posted.append(body) or (200, {"done": True, "text": "done"})
    shop.answers["/alerts"] = lambda _path, _body: (200, alerts(list(shop.numbers)))
    page = visit.open("#/alerts")
    expect(page.locator(".note.role")).to_have_count(0)
    page.get_by_role("button", name="Acknowledge").first.click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("As ada.")
    expect(dialog.get_by_label("Your name")).to_have_count(0)
    dialog.get_by_label("Comment").fill("on my way")
    dialog.get_by_role("button", name="Acknowledge").click()
    expect(dialog).to_be_hidden()
    assert [(one["by"], one["comment"]) for one in posted] == [("ada", "on my way")]


def test_who_looks_and_who_did_what_stand_in_the_dialog_of_the_connection(visit: Visit, shop: Shop) -> None:
    is_now(shop, "administrator", "grace")
    shop.answers["/audit"] = lambda _path, _body: (
        200,
        {"file": "/var/lib/cnctwin/audit/page.jsonl", "trouble": "", "deeds": DEEDS},
    )
    page = visit.open("#/fleet")
    page.locator("#link").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("grace, administrator")
    expect(dialog.get_by_role("button", name="Log out")).to_be_visible()
    dialog.get_by_role("button", name="Who did what").click()
    rows = dialog.locator("tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.first).to_have_text(re.compile("ada, operator.*10.0.0.7.*acknowledge ea33a6.*done"))
    expect(rows.last).to_contain_text("<b>mallory</b>")
    expect(dialog).to_contain_text("Older lines: /var/lib/cnctwin/audit/page.jsonl")


def test_only_an_administrator_is_offered_the_record(visit: Visit, shop: Shop) -> None:
    is_now(shop, "operator")
    page = visit.open("#/fleet")
    page.locator("#link").click()
    expect(page.get_by_role("dialog")).to_contain_text("ada, operator")
    expect(page.get_by_role("button", name="Who did what")).to_have_count(0)


def test_an_operator_silences_an_alert_and_ends_a_silence(visit: Visit, shop: Shop) -> None:
    is_now(shop, "operator", None)
    shop.answers["/silences.*"] = lambda _path, _body: (200, {"done": True, "text": "done"})
    page = visit.open("#/alerts")
    page.get_by_role("button", name="Silence").first.click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("For how many hours").fill("0.5")
    dialog.get_by_label("Your name").fill("ada")
    dialog.get_by_label("Comment").fill("service")
    dialog.get_by_role("button", name="Silence").click()
    expect(dialog).to_be_hidden()
    page.get_by_role("button", name="End").first.click()
    expect(dialog.get_by_label("Your name")).to_have_value("ada")
    dialog.get_by_role("button", name="End it").click()
    expect(dialog).to_be_hidden()
    (begun, body), (ended, by) = shop.posted
    silence = {"machine": "vmc", "alertname": "rule_spindle_overload", "for_s": 1800, "by": "ada", "comment": "service"}
    assert (begun, body) == ("/silences", silence)
    assert (ended.startswith("/silences/"), ended.endswith("/end"), by) == (True, True, {"by": "ada"})
