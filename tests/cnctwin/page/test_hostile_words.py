"""Words from machines that are also names of every JavaScript object: the page shows them like any other word."""

import json
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.documents import alerts, job
from tests.cnctwin.page.fake_server import Shop
from tests.cnctwin.page.simulated_shop import SignalValue

WORDS = ("constructor", "__proto__", "toString", "hasOwnProperty", "valueOf", "isPrototypeOf")


@pytest.mark.parametrize("view", ["fleet", "machine/vmc", "replay/vmc"])
def test_a_machine_whose_state_is_such_a_word_is_shown(visit: Visit, shop: Shop, view: str) -> None:
    shop.other["vmc"] = {
        "exec_state": SignalValue("constructor"),
        "program": SignalValue("__proto__"),
        "alarm": SignalValue("toString"),
        **{word: SignalValue(float(number)) for number, word in enumerate(WORDS)},
    }
    page = visit.open(f"#/{view}")
    expect(page.locator("#link")).to_have_text("live")
    if view != "replay/vmc":
        expect(page.locator("main")).to_contain_text("Constructor")


def test_every_table_of_the_page_has_its_own_keys_only(visit: Visit) -> None:
    visit.open("")
    script = f"""
      const text = await module("text");
      const words = {json.dumps(WORDS)};
      return words.map((word) => [text.execution(word), text.title(word), text.gapTitle(word + "/" + word), text.recorded(word)]);
    """
    found: Any = visit.evaluate(script)
    for word, (state, title, gap, recorded) in zip(WORDS, found, strict=True):
        assert state[1:] == ["s-unknown", "unknown"], word
        assert all(isinstance(one, str) for one in (state[0], title, gap, recorded)), word
        assert "native code" not in f"{state}{title}{gap}{recorded}"


@pytest.mark.parametrize("word", WORDS)
def test_alerts_jobs_events_and_validations_of_such_words_are_shown(visit: Visit, shop: Shop, word: str) -> None:
    told = alerts(list(shop.numbers))
    told["alerts"][0] |= {"phase": word, "severity": word}
    told["alerts"][1] |= {"severity": word}
    shop.answers["/alerts"] = lambda _path, _body: (200, told)
    shop.answers["/jobs"] = lambda _path, _body: (200, {"jobs": [job(word, word, word)]})
    event = {"t": 0, "until": None, "kind": word, "text": word}
    shop.answers["/events/vmc"] = lambda _path, _body: (200, {"events": [event], "left_out": 0})
    figure = {"quantity": word, "measure": word, "value": 1.0, "verdict": word}
    night = {"machine": "vmc", "t": 1, "verdict": word, "figures": [figure], "nights": [], "retrain": False, "over_in_a_row": {}}
    shop.answers["/validation/vmc"] = lambda _path, _body: (200, night)
    for view in ("alerts", "jobs", "replay/vmc", "parts/vmc"):
        page = visit.open(f"#/{view}")
        page.wait_for_timeout(200)
        expect(page.locator("main")).not_to_contain_text("native code")
    assert "native code" not in page.content()


@pytest.mark.parametrize("word", WORDS)
def test_an_address_of_such_a_word_is_no_view(visit: Visit, word: str) -> None:
    page = visit.open(f"#/{word}")
    expect(page.get_by_text(f"There is no view {word}.")).to_be_visible()
