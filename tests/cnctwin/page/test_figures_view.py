"""Production figures on the page: shifts, stops, parts, what is not known, and the way to the CSV."""

import json
from typing import Any
from urllib.parse import parse_qs, urlsplit

from playwright.sync_api import expect

from cnctwin.figures.documents import PartTold, ShiftTold
from cnctwin.figures.table import Asked, By, table
from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.fake_server import Answer, Shop, now_ms

HOUR_MS = 3_600_000
HOSTILE = "<img src=x onerror=alert(1)>"


def _told() -> tuple[list[ShiftTold], list[PartTold]]:
    began = now_ms() - 10 * HOUR_MS
    stops = {
        "feed hold": {"kind": "delay", "s": 1800.0, "n": 4},
        f"alarm: {HOSTILE}": {"kind": "down", "s": 900.0, "n": 1},
        "mode MANUAL": {"kind": "setup", "s": 2700.0, "n": 2},
    }
    times = {"planned_s": 27000.0, "production_s": 21600.0, "setup_s": 2700.0, "delay_s": 1800.0, "down_s": 900.0}
    shift: dict[str, Any] = {"kind": "shift", "id": "a", "machine": "vmc", "shift": "early", "begin": began, "calendar": True}
    shift |= times | {
        "end": began + 8 * HOUR_MS,
        "over": True,
        "unknown_s": 0.0,
        "beside_s": 0.0,
        "stops": stops,
        "energy_s": 28800.0,
    }
    part: dict[str, Any] = {"kind": "part", "machine": "vmc", "program": HOSTILE, "shift": "early", "shift_begin": began}
    part |= {"interrupted_s": 0.0, "unknown_s": 0.0, "ideal_s": 540.0, "active_s": 600.0, "complete": True, "energy_kwh": 0.42}
    ends = [began + n * 600_000 for n in range(1, 11)]
    parts = [part | {"id": str(end), "begin": end - 600_000, "end": end, "quality": "good"} for end in ends]
    parts[-1]["quality"] = "scrap"
    other = shift | {
        "id": "b",
        "machine": "mill-01",
        "unknown_s": 9000.0,
        "production_s": 12600.0,
        "energy_kwh": None,
        "energy_s": 0.0,
    }
    shifts = [ShiftTold.model_validate(one) for one in (shift | {"energy_kwh": 12.5}, other)]
    return shifts, [PartTold.model_validate(one) for one in parts]


def _answer(asked: dict[str, str]) -> Answer:
    shifts, parts = _told()
    by = By(asked["by"])
    rows = table(shifts, parts, Asked(by, int(asked["from"]), int(asked["to"])))
    wanted = asked.get("machine")
    rows = [json.loads(json.dumps(row)) for row in rows if wanted in (None, row["machine"])]
    return 200, {"from": int(asked["from"]), "to": int(asked["to"]), "by": by, "note": "", "rows": rows}


def test_the_figures_are_shown_and_what_is_not_known_says_why(visit: Visit, shop: Shop) -> None:
    shop.answers["/figures"] = lambda _path, asked: _answer(asked)
    page = visit.open("#/fleet")
    page.keyboard.press("o")
    expect(page.get_by_role("heading", name="Production figures")).to_be_visible()
    row = page.get_by_role("region", name="Figures by shift").get_by_role("row").filter(has_text="vmc, early")
    for figure in ("64.8 %", "80.0 %", "90.0 %", "7 h 30 min", "12.5 kWh"):
        expect(row).to_contain_text(figure)
    expect(page.get_by_text("Availability: the machine was not heard for too much of the planned time.")).to_be_visible()
    bar = page.get_by_role("img").first
    expect(bar).to_have_attribute(
        "aria-label", f"production 6 h 00 min, mode MANUAL 45 min 0 s, feed hold 30 min 0 s, alarm: {HOSTILE} 15 min 0 s"
    )
    page.get_by_text("3 reasons, 1 h 30 min").first.click()
    expect(
        page.get_by_role("region", name="Stops of vmc, early").get_by_role("row").filter(has_text="feed hold")
    ).to_contain_text("6.7 %")
    expect(page.get_by_role("region", name="Parts with their energy").get_by_role("row")).to_have_count(11)
    expect(page.get_by_role("region", name="Parts with their energy")).to_contain_text("0.42 kWh")


def test_rows_stretch_and_machine_are_chosen_and_the_csv_is_of_the_same(visit: Visit, shop: Shop) -> None:
    shop.answers["/figures"] = lambda _path, asked: _answer(asked)
    page = visit.open("#/figures")
    page.get_by_role("button", name="Programs").press("Enter")
    expect(page.get_by_role("region", name="Figures by program")).to_contain_text(HOSTILE)
    page.get_by_role("button", name="7 days").click()
    page.get_by_label("Machine").select_option("mill-01")
    expect(page.get_by_role("heading", name="No figures of this stretch")).to_be_visible()
    asked = parse_qs(urlsplit(page.get_by_role("link", name="CSV", exact=True).get_attribute("href") or "").query)
    assert (asked["format"], asked["by"], asked["machine"]) == (["csv"], ["program"], ["mill-01"])
    assert int(asked["to"][0]) - int(asked["from"][0]) == 168 * HOUR_MS


def test_a_server_that_refuses_is_quoted(visit: Visit, shop: Shop) -> None:
    shop.answers["/figures"] = lambda _path, _asked: (503, {"error": "no store was named"})
    page = visit.open("#/figures")
    expect(page.get_by_text("The server says: no store was named")).to_be_visible()
    visit.errors.clear()  # the browser notes the status
