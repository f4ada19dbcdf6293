"""Production figures on the page: shifts, stops, parts, what is not known, and the way to the CSV."""

from datetime import datetime
from urllib.parse import parse_qs, urlsplit
from zoneinfo import ZoneInfo

from playwright.sync_api import Browser, expect

from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.fake_server import FakeServer, Shop
from tests.cnctwin.page.figures_document import HOSTILE, HOUR_MS, ZONE, figures, told


def test_the_figures_are_shown_and_what_is_not_known_says_why(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/fleet")
    page.keyboard.press("o")
    expect(page.get_by_role("heading", name="Production figures")).to_be_visible()
    row = page.get_by_role("region", name="Figures by shift").get_by_role("row").filter(has_text="vmc, early")
    for figure in ("64.8 %", "80.0 %", "90.0 %", "7 h 30 min", "12.5 kWh"):
        expect(row).to_contain_text(figure)
    expect(
        page.get_by_text("Availability: the machine was not heard for too much of the planned time (mill-01, early).")
    ).to_be_visible()
    expect(page.get_by_text("6 min 39 s made in breaks or outside shifts, not counted (mill-01, early).")).to_be_visible()
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


def test_times_are_those_of_the_shift_calendar_wherever_the_reader_is(browser: Browser, server: FakeServer, shop: Shop) -> None:
    began = told()[0][0].begin
    shop.answers["/figures"] = lambda _path, asked: figures(asked or {}, began)
    visit = Visit(browser, server.url, zone="Asia/Tokyo")
    page = visit.open("#/figures")
    expect(page.get_by_text(f"Times in {ZONE}, the time zone of the shift calendar.")).to_be_visible()
    row = page.get_by_role("region", name="Figures by shift").get_by_role("row").filter(has_text="vmc, early")
    expect(row).to_contain_text(datetime.fromtimestamp(began / 1000, ZoneInfo(ZONE)).strftime("%H:%M"))
    last = page.get_by_role("region", name="Parts with their energy").get_by_role("row").nth(1)
    expect(last).to_contain_text(datetime.fromtimestamp(began / 1000 + 6000, ZoneInfo(ZONE)).strftime("%H:%M:%S"))
    visit.context.close()
