"""Lists and records that a machine publishes as JSON are words on the page."""

import json

from playwright.sync_api import expect

from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.fake_server import Shop
from tests.cnctwin.page.simulated_shop import SignalValue

DOOR = {"code": "700016", "text": "Safety door open", "severity": 500, "active": True, "acknowledged": False, "since": None}
GONE = {"code": "SV0401", "text": "VRDY OFF", "severity": "fault", "active": False, "acknowledged": True, "since": None}
WORDS = {
    "[]": "none",
    json.dumps([DOOR]): "700016 Safety door open, severity 500, not acknowledged",
    json.dumps([DOOR, GONE]): (
        "700016 Safety door open, severity 500, not acknowledged; SV0401 VRDY OFF, severity fault, gone, acknowledged"
    ),
    json.dumps([{"tool": 7, "wear_pct": 0.30000000000000004, "why": None}]): "tool 7, wear pct 0.3",
    "G1 X[R1+2] F500": "G1 X[R1+2] F500",
    "[R1]": "[R1]",
    "[12]": "[12]",
}


def test_lists_and_records_are_in_words_and_any_other_text_is_as_it_is(visit: Visit) -> None:
    visit.open("")
    told = visit.evaluate(f"const {{ worded }} = await module('worded'); return {json.dumps(list(WORDS))}.map((x) => worded(x));")
    assert told == list(WORDS.values())


def test_the_noise_of_binary_fractions_is_not_shown(visit: Visit) -> None:
    visit.open("")
    told = visit.evaluate(
        "const { worded } = await module('worded'); return [0.1 + 0.2, Math.fround(12.3)].map((x) => worded(x));"
    )
    assert told == ["0.3", "12.3"]


def test_the_table_of_signals_shows_the_alarms_of_the_control_in_words(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = {"alarms": SignalValue(json.dumps([DOOR]))}
    page = visit.open("#/machine/vmc")
    page.keyboard.press("e")
    row = page.locator("tr", has=page.get_by_text("alarms", exact=True))
    expect(row).to_contain_text("700016 Safety door open, severity 500, not acknowledged")


def test_a_null_that_another_clock_stamped_does_not_make_the_machine_older(visit: Visit) -> None:
    visit.open("")
    script = """
      const { Machine } = await module("plant");
      const recorded = new Machine("okuma"), value = (t, quality) => ({ value: quality === "bad" ? null : 1, t, quality });
      recorded.know("spindle_rpm", value(1659966694000, "good"), {});
      recorded.know("tool_radius_mm", value(1795911622000, "bad"), {});
      return recorded.lastT;
    """
    assert visit.evaluate(script) == 1659966694000
