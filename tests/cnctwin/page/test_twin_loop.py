"""The twin's loop on the page: each step shows what happens and what a person can do, and every deed reaches the server."""

import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.cnctwin.page.conftest import SIZES, Visit
from tests.cnctwin.page.fake_server import Answer, Shop
from tests.cnctwin.page.loop_document import SHA256, loop
from tests.cnctwin.page.simulated_shop import SignalValue
from tests.cnctwin.page.test_views import NAMELESS, SMALL


class Loop:
    """The loop of `vmc` in a made-up shop: a test says at which step it stands."""

    def __init__(self, shop: Shop) -> None:
        self.step, self.more = "watching", dict[str, Any]()
        self.asked: list[tuple[str, Any]] = []
        shop.answers["/twin/vmc"] = lambda _path, _body: (200, loop("vmc", self.step, **self.more))
        shop.answers["/twin/vmc/[a-z]+"] = self._deed
        shop.answers["/demo/reveal"] = self._deed

    def _deed(self, path: str, body: Any) -> Answer:
        self.asked.append((path, body))
        following = {"diagnose": {"step": "diagnosing"}, "promote": {"step": "promoted"}, "back": {"step": "watching"}}
        deed = path.rpartition("/")[2]
        self.step = following.get(deed, {"step": self.step})["step"]
        if deed == "reveal":
            self.more["revealed"] = True
        return 200, {"done": True, "text": f"{deed} is done"}


@pytest.fixture
def told(shop: Shop) -> Loop:
    return Loop(shop)


def panel(page: Page) -> Any:
    return page.locator(".twinloop")


def press(page: Page, deed: str) -> None:
    page.locator(f'[data-deed="{deed}"]').click()


def test_a_stranger_goes_from_the_open_gap_to_the_closed_one_and_opens_the_seal(visit: Visit, told: Loop) -> None:
    page = visit.open("#/gap/vmc")
    expect(panel(page)).to_contain_text("The gap of the temperature is open at 6.1 × repeatability")
    expect(page.locator('[aria-current="step"]')).to_have_text("Watch")
    expect(panel(page)).to_contain_text(SHA256[:8])
    press(page, "diagnose")
    expect(page.locator('[aria-current="step"]')).to_have_text("Diagnose")
    expect(page.get_by_role("progressbar")).to_have_attribute("value", "0.58")
    expect(page.locator('[data-deed="diagnose"]')).to_be_hidden()
    told.step = "shadow"
    for text in (
        "Coolant cools: it takes twice",
        "Coolant cooling",
        "94 %",
        "2.04 (1.8 to 2.3)",
        "Not told apart from",
        "Second thermal",
    ):
        expect(panel(page).locator(".answer")).to_contain_text(text)
    press(page, "promote")
    expect(page.get_by_role("dialog")).to_contain_text("The button Back makes the present description live again")
    page.get_by_role("dialog").get_by_role("button", name="Promote").click()
    expect(panel(page)).to_contain_text("gap of the temperature 6.1 → 1.1 × repeatability")
    press(page, "reveal")
    page.get_by_role("dialog").get_by_role("button", name="Reveal").click()
    expect(panel(page).locator(".sealed")).to_contain_text("Gain 2.1")
    expect(panel(page).locator(".equal.yes")).to_contain_text("it is the one that was shown from the start")
    assert [path for path, _ in told.asked] == ["/twin/vmc/diagnose", "/twin/vmc/promote", "/demo/reveal"]
    assert told.asked[1][1] == {"by": "the page", "version": "0f1e2d3c4b5a"}


def test_both_standing_gaps_are_side_by_side_as_the_stream_tells_them(visit: Visit, told: Loop, shop: Shop) -> None:
    told.step = "shadow"
    shop.other["vmc"] = {
        "twin/gap_spindle_temp_c": SignalValue(8.4, "floors", "inferred"),
        "twin/challenger/gap_spindle_temp_c": SignalValue(1.3, "floors", "inferred"),
    }
    page = visit.open("#/gap/vmc")
    pair = panel(page).locator('.pair[data-signal="spindle_temp_c"]')
    expect(pair.locator(".figure")).to_have_text(["8.4", "1.3"])
    wide, narrow = (pair.locator(f".fill.{kind}").bounding_box() for kind in ("live", "challenger"))
    assert wide is not None and narrow is not None
    assert wide["width"] > 5 * narrow["width"] > 0


def test_a_challenger_that_is_not_ready_says_why_and_cannot_be_promoted(visit: Visit, told: Loop) -> None:
    told.step, told.more = "shadow", {"ready": False}
    page = visit.open("#/gap/vmc")
    expect(page.locator('[data-deed="promote"]')).to_be_disabled()
    expect(panel(page)).to_contain_text("The challenger has run for 4 s; 15 s are asked for")
    press(page, "withdraw")
    page.get_by_role("dialog").get_by_role("button", name="Withdraw").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    assert told.asked == [("/twin/vmc/withdraw", {"by": "the page", "version": "0f1e2d3c4b5a"})]


def test_what_was_done_is_listed_and_can_be_undone(visit: Visit, told: Loop) -> None:
    told.step = "promoted"
    page = visit.open("#/gap/vmc")
    panel(page).get_by_text("What was done, 2 steps").click()
    row = panel(page).locator(".taken tbody tr").first
    for text in ("Promoted", "ada", "coolant cools", "6.1 → 1.1 × repeatability"):
        expect(row).to_contain_text(text)
    press(page, "back")
    page.get_by_role("dialog").get_by_role("button", name="Go back").click()
    expect(page.locator('[aria-current="step"]')).to_have_text("Watch")
    assert told.asked == [("/twin/vmc/back", {"by": "the page", "version": "0f1e2d3c4b5a"})]


def test_a_refused_diagnosis_and_a_refused_deed_say_why(visit: Visit, told: Loop, shop: Shop) -> None:
    told.step = "refused"
    shop.answers["/twin/vmc/[a-z]+"] = lambda _path, _body: (409, {"error": "less than 60 s of production were heard"})
    page = visit.open("#/gap/vmc")
    expect(panel(page)).to_contain_text("No effect explains the gap; the live twin stays")
    press(page, "diagnose")
    expect(panel(page).get_by_role("alert")).to_contain_text("Diagnose was refused: less than 60 s of production were heard.")
    visit.errors.clear()  # the browser names the 409 itself


def test_without_a_loop_the_page_says_how_to_start_one(visit: Visit) -> None:
    page = visit.open("#/gap/vmc")
    expect(panel(page)).to_contain_text("cnctwin twin run")
    expect(panel(page)).to_contain_text("The server says: no loop runs")


def test_a_reader_sees_all_and_may_press_nothing(visit: Visit, told: Loop, shop: Shop) -> None:
    shop.me = {"user": "bob", "role": "reader", "logs_out": False}
    told.step = "shadow"
    page = visit.open("#/gap/vmc")
    expect(page.locator('[data-deed="promote"]')).to_be_disabled()
    expect(page.locator('[data-deed="withdraw"]')).to_be_disabled()
    expect(panel(page)).to_contain_text("takes an operator")


def test_the_keyboard_diagnoses(visit: Visit, told: Loop) -> None:
    page = visit.open("#/gap/vmc")
    expect(page.locator('[data-deed="diagnose"]')).to_be_enabled()
    page.keyboard.press("d")
    expect(page.locator('[aria-current="step"]')).to_have_text("Diagnose")


def test_the_machine_view_tells_it_in_one_line(visit: Visit, told: Loop) -> None:
    told.step = "promoted"
    page = visit.open("#/machine/vmc")
    expect(page.locator(".loopline")).to_contain_text("Cause found and taken into the twin")
    expect(page.locator(".loopline")).to_contain_text("Coolant cools: gap of the temperature 6.1 → 1.1 × repeatability")
    page.locator(".loopline a").click()
    expect(page).to_have_url(re.compile("#/gap/vmc"))


@pytest.mark.parametrize("step", ["watching", "diagnosing", "shadow", "promoted", "refused"])
def test_each_step_fits_each_screen_and_can_be_pressed(visit: Visit, told: Loop, step: str) -> None:
    told.step, told.more = step, {"revealed": step == "promoted"}
    page = visit.open("#/gap/vmc")
    expect(panel(page).locator(".loopsteps")).to_be_visible()
    assert page.evaluate(NAMELESS) == []
    for size, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, size
        assert page.evaluate(SMALL) == [], size


def test_a_hostile_word_in_the_loop_stays_text(visit: Visit, told: Loop) -> None:
    hostile = '<img src=x onerror="window.hacked=1">'
    cause = {"effect": hostile, "on": hostile, "probability": 1.0, "parameters": {hostile: {"value": 1.0, "unit": hostile}}}
    challenger = {"version": hostile, "sentence": hostile, "verdict": hostile, "causes": [cause], "gap_before": 1, "gap_after": 1}
    told.step = "shadow"
    told.more = {"text": hostile, "challenger": challenger, "steps": [{"t": 1, "step": hostile, "by": hostile, "why": hostile}]}
    page = visit.open("#/gap/vmc")
    expect(panel(page)).to_contain_text("<img src=x")
    assert page.locator("main img").count() == 0
    assert page.evaluate("window.hacked") is None
