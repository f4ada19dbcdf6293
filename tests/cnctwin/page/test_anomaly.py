"""An anomaly alarm on the page: why, in plain words; what it looks like; and a person's verdict."""

import json
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.cnctwin.page.anomaly_document import anomaly, signals, verdicts, why
from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.fake_server import Shop

HOSTILE = "<img src=x onerror='window.hacked=1'>"
SAID = {"verdict": "known", "label": "dull tool", "by": "ada", "at_s": 1_793_800_000.0}


def panel(page: Page) -> Locator:
    return page.locator("section.anomaly")


def test_the_machine_says_why_it_alarms_and_what_it_looks_like(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = signals(anomaly())
    page = visit.open("#/machine/vmc")
    for text in (
        "Spindle load 18 % above the last 12 parts in lines 210–260 (O1701, tool 5), over some cuts, since ",
        "Looks like: packed chips (likeness 0.91, ",
        "No peer shows it.",
        "Known of what runs: 12 parts.",
        "expected 37.0 ± 3.8 %, measured 43.7 %",
        "9 of the last 14 alarms with a verdict were true",
    ):
        expect(panel(page)).to_contain_text(text)
    panel(page).get_by_text("Limits that false alarms have raised (1)").click()
    expect(panel(page)).to_contain_text("Vibration above what is usual in O1701|T2|1 (seconds): limit × 1.95, by ada")
    expect(panel(page).locator("svg")).to_have_attribute("aria-label", "Spindle load: expected 37.0 ± 3.8 %, measured 43.7 %")


@pytest.mark.parametrize("view", ["machine/vmc", "alerts"])
def test_a_person_says_what_it_was(visit: Visit, shop: Shop, view: str) -> None:
    told = anomaly()
    shop.other["vmc"] = signals(told)
    shop.answers["/anomaly/vmc"] = lambda _path, _body: (200, told)
    shop.answers["/anomaly/vmc/verdict"] = lambda _path, _body: (200, told)
    page = visit.open(f"#/{view}")
    panel(page).get_by_role("button", name="Known").click()
    page.get_by_label("Your name").fill("ada")
    page.get_by_label("What it was, in a few words").fill("dull tool")
    known = anomaly(is_alarm=False, why=None, verdicts=verdicts(SAID, "held back"))
    shop.answers["/anomaly/vmc"] = lambda _path, _body: (200, known)
    shop.other["vmc"] = signals(known)
    page.get_by_role("dialog").get_by_role("button", name="Known").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    expect(panel(page)).to_contain_text("known, “dull tool”. Its like is held back until it is gone.")
    expect(panel(page).get_by_role("button", name="Known")).to_have_attribute("aria-pressed", "true")
    ((path, body),) = shop.posted
    assert path == "/anomaly/vmc/verdict"
    assert body == {
        "verdict": "known",
        "label": "dull tool",
        "by": "ada",
        "alarm_at_s": told["verdicts"]["alarms"][0]["alarm_at_s"],
    }


def test_a_refused_verdict_says_why(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = signals(anomaly())
    shop.answers["/anomaly/vmc/verdict"] = lambda _path, _body: (409, {"error": "a later verdict holds: true, by bob"})
    page = visit.open("#/machine/vmc")
    panel(page).get_by_role("button", name="False").click()
    page.get_by_label("Your name").fill("ada")
    page.get_by_role("dialog").get_by_role("button", name="False").click()
    expect(page.get_by_role("dialog")).to_contain_text("a later verdict holds")
    visit.errors.clear()  # the browser itself writes a line for a 409


def test_an_alarm_that_stands_is_ended_by_a_person(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = signals(anomaly(verdicts=verdicts({**SAID, "verdict": "true"}, "stands")))
    shop.answers["/anomaly/vmc/verdict"] = lambda _path, _body: (200, anomaly())
    page = visit.open("#/machine/vmc")
    expect(panel(page)).to_contain_text("It stands until a part has run without it.")
    panel(page).get_by_role("button", name="End it").click()
    page.get_by_label("Your name").fill("ada")
    page.get_by_role("dialog").get_by_role("button", name="End it").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    assert shop.posted[0][1] == {"verdict": "true", "ends": True, "by": "ada", "alarm_at_s": shop.posted[0][1]["alarm_at_s"]}


def test_a_reader_sees_why_and_cannot_say_what_it_was(visit: Visit, shop: Shop) -> None:
    shop.me = {"user": "eve", "role": "reader", "logs_out": True}
    shop.other["vmc"] = signals(anomaly())
    page = visit.open("#/machine/vmc")
    expect(panel(page)).to_contain_text("You are a reader (eve): a verdict takes an operator.")
    for word in ("True", "False", "Known"):
        expect(panel(page).get_by_role("button", name=word)).to_be_disabled()


def test_a_machine_without_alarms_has_no_panel(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = signals(anomaly(is_alarm=False, why=None, verdicts=verdicts(alarms=[])))
    page = visit.open("#/machine/vmc")
    expect(page.locator(".tiles")).to_be_visible()
    expect(panel(page)).to_be_hidden()


@pytest.mark.parametrize(
    "odd", [{}, {"like": HOSTILE, "lines": 3, "peers": 5, "measured": HOSTILE}, {"signal": HOSTILE, "program": HOSTILE}]
)
def test_words_from_elsewhere_stay_words(visit: Visit, shop: Shop, odd: dict[str, Any]) -> None:
    told = anomaly(why=why(**odd) if odd else {}, knows=HOSTILE, verdicts=verdicts({**SAID, "by": HOSTILE, "label": HOSTILE}))
    shop.other["vmc"] = signals(told)
    page = visit.open("#/machine/vmc")
    expect(panel(page)).to_contain_text("<img src=x")
    assert page.locator("main img").count() == 0
    assert page.evaluate("window.hacked") is None


NOWHERE: dict[str, Any] = {"lines": None, "program": None, "tool": None}
REASONS = {
    "Spindle speed 40 % below what the twin expects in line 12 (tool 3), within seconds.": {
        **{"signal": "spindle_rpm", "measured": 3000, "expected": 5000, "by": "the twin", "scale": "seconds"},
        **{"lines": [12, 12], "program": None, "tool": 3},
    },
    "Temperature, measured − twin 12.0 K above the part before (O1), over minutes.": {
        **{"signal": "twin/spindle_temp_residual_k", "measured": 13, "expected": 1, "unit": "K", "by": "1 part", "scale": "part"},
        **{**NOWHERE, "program": "O1"},
    },
    "Vibration 5.2 times the last 3 parts, against the last parts of this tool.": {
        **{"signal": "vibration_rms_g", "measured": 0.52, "expected": 0.1, "unit": "g", "by": "3 parts", "scale": "tool"},
        **NOWHERE,
    },
}


def test_the_reason_in_words(visit: Visit) -> None:
    visit.open("")
    told = json.dumps([why(**more) for more in REASONS.values()])
    script = f"const words = await module('anomaly_words'); return {told}.map((why) => words.sentenceOf(why));"
    assert visit.evaluate(script) == list(REASONS)
