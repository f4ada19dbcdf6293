"""What a person sees on the page, in a real browser, of a made-up shop."""

import json
import re
import time

from playwright.sync_api import Browser, expect

from tests.cnctwin.page.conftest import SIZES, VIEWS, WAIT_MS_MAX, Visit, expect_drawn
from tests.cnctwin.page.documents import CHANGED, FAULTY, alert, alerts, job
from tests.cnctwin.page.fake_server import FakeServer, Shop, now_ms
from tests.cnctwin.page.simulated_shop import SignalValue

HOSTILE = '<img src=x onerror="window.hacked=1">'
NUMBER = re.compile(r"[−+]?\d")
SMALL = """() => [...document.querySelectorAll('button, select, input, .tabs a, a.unit, a.button, summary')]
  .filter((one) => one.offsetParent !== null && getComputedStyle(one).visibility === 'visible')
  .map((one) => [one.getBoundingClientRect(), one]).filter(([box]) => box.width && (box.height < 43.5 || box.width < 43.5))
  .map(([box, one]) => `${one.outerHTML.slice(0, 80)} ${box.width}x${box.height}`)"""
NAMELESS = """() => [...document.querySelectorAll('button, select, input, a')].filter((one) => one.offsetParent !== null)
  .filter((one) => !(one.getAttribute('aria-label') || one.textContent.trim() || one.closest('label') || one.title))
  .map((one) => one.outerHTML.slice(0, 80))"""


def test_a_stranger_sees_a_machine_its_twin_and_the_gap(visit: Visit) -> None:
    page = visit.open("")
    page.get_by_role("link", name=re.compile("vmc")).click()
    tile = page.locator('[data-tile="spindle_temp_c"]')
    expect(tile.locator(".big .figure")).to_have_text(NUMBER)
    expect(tile).to_contain_text("measured")
    expect(tile.locator(".line").nth(0)).to_have_text(re.compile(r"twin.*\d"))
    expect(tile.locator(".line.rest")).to_have_text(re.compile(r"gap.*\d.*K"))
    expect(page.locator(".panel.own .name")).to_have_text("Spindle temperature, °C")
    expect(page.locator(".panel.rest .name")).to_have_text("Measured − twin, K")
    for panel in ("own", "rest", "score"):
        expect_drawn(page, f".panel.{panel} canvas")


def test_each_figure_says_where_it_comes_from_and_how_old_it_is(visit: Visit) -> None:
    page = visit.open("#/machine/vmc")
    for tile, source in (("spindle_temp_c", "measured"), ("cutting_force", "inferred")):
        expect(page.locator(f'[data-tile="{tile}"] .origin .from')).to_have_text(source)
    expect(page.locator('[data-tile="spindle_temp_c"] .aged')).to_have_text(re.compile(r"now|\d+ s"))
    page.keyboard.press("e")
    row = page.locator("tr", has=page.get_by_text("twin/spindle_temp_c", exact=True))
    expect(row).to_contain_text("modelled")
    expect(row).to_contain_text("good")


def test_what_a_model_learned_stands_beside_the_physics_and_never_in_its_place(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = {"twin/spindle_temp_corrected_c": SignalValue(31.4, "°C", "inferred")}
    page = visit.open("#/machine/vmc")
    tile = page.locator('[data-tile="spindle_temp_c"]')
    expect(tile).to_contain_text(re.compile(r"twin.*\d.*learned too.*31\.4.*gap.*\d"))
    expect(page.locator(".panel.own figcaption")).to_contain_text("twin with what was learned")


def test_the_signal_that_is_charted_can_be_chosen(visit: Visit) -> None:
    page = visit.open("#/machine/vmc")
    page.locator('[data-tile="spindle_rpm"]').click()
    expect(page.locator(".panel.own .name")).to_have_text("Spindle speed, rev/min")
    expect(page.locator(".panel.own figcaption")).to_contain_text("commanded")
    page.get_by_label("Signal to chart").select_option("axis_z_load_pct")
    expect(page.locator(".panel.own .name")).to_have_text("Z load, %")
    expect(page.locator(".panel.rest")).to_be_hidden()


def test_a_chart_is_not_made_anew_when_the_tool_changes(visit: Visit, shop: Shop) -> None:
    shop.other["vmc"] = {"tool_number": SignalValue(5)}
    page = visit.open("#/machine/vmc")
    expect(page.locator(".machine-head .job")).to_contain_text("T5")
    page.evaluate("document.querySelector('.panel.own canvas').dataset.mine = 'yes'")
    for number in (None, 3):
        shop.other["vmc"] = {"tool_number": SignalValue(number)}
        expect(page.locator(".machine-head .job")).to_have_text(re.compile(r"T3" if number else r"NC · line"))
    assert page.evaluate("document.querySelector('.panel.own canvas').dataset.mine") == "yes"


def test_the_last_minutes_are_there_before_they_were_looked_at(visit: Visit) -> None:
    visit.open("#/machine/vmc")
    script = "const { app } = await module('app'); const ring = app.plant.machine('vmc').series.get('spindle_temp_c');"
    deadline_s = time.monotonic() + WAIT_MS_MAX / 1000
    while not visit.evaluate(f"{script} return ring && ring.last - ring.first > 280_000;"):
        assert time.monotonic() < deadline_s
        visit.page.wait_for_timeout(100)


def test_the_controls_own_count_stands_beside_the_parts_left_of_the_tool_in_the_spindle(visit: Visit, shop: Shop) -> None:
    lives = [{"tool": 5, "parts": 120, "parts_left": 40.0, "parts_left_band": [30.0, 55.0]}, {"tool": 3, "parts": 80}]
    told = {"twin/tool_lives": SignalValue(json.dumps(lives)), "tool_number": SignalValue(5)}
    shop.other["vmc"] = told | {"tool_life_used_min": SignalValue(18.5), "tool_life_limit_min": SignalValue(60.0)}
    page = visit.open("#/machine/vmc")
    page.locator("details.tools summary").click()
    rows = page.locator("details.tools tbody tr")
    expect(rows.nth(0).locator("td").nth(5)).to_have_text("18.5 of 60 min")
    expect(rows.nth(1).locator("td").nth(5)).to_have_text("–")
    no_minutes = {name: SignalValue(None, "min") for name in ("tool_life_used_min", "tool_life_limit_min")}
    shop.other["vmc"] = told | no_minutes | {"tool_life_used_count": SignalValue(37)}
    expect(rows.nth(0).locator("td").nth(5)).to_have_text("37 uses")


def test_a_null_shows_its_reason(visit: Visit, shop: Shop) -> None:
    reason = "spindle below 50 rev/min: power over speed means nothing"
    shop.other["vmc"] = {"twin/cutting_force_n": SignalValue(None, "N", "inferred", reason)}
    page = visit.open("#/machine/vmc")
    tile = page.locator('[data-tile="cutting_force"]')
    expect(tile.locator(".big .figure")).to_have_text("–")
    expect(tile.locator(".why")).to_have_text(reason)
    tile.click()
    expect(page.locator(".panel.own .why")).to_contain_text(reason)


def test_a_machine_that_is_gone_never_looks_live(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/fleet")
    unit = page.get_by_role("link", name=re.compile("vmc"))
    expect(unit).to_contain_text("Active")
    shop.offline_since["vmc"] = now_ms()
    expect(unit).to_contain_text("Offline since")
    expect(unit).to_have_class(re.compile("stale"))
    unit.click()
    expect(page.locator(".machine-head")).to_contain_text("stale since")
    expect(page.locator('[data-tile="spindle_temp_c"]')).to_have_class(re.compile("stale"))
    expect(page.locator('[data-tile="spindle_temp_c"] .aged')).to_contain_text("stale since")


def test_the_gap_has_a_place_a_cause_and_a_next_step(visit: Visit) -> None:
    page = visit.open("#/gap/vmc")
    main = page.locator("main")
    for text in (
        "Standing gap",
        "growing",
        "19.9 → 1.05",
        "Gravity on Z",
        "Not told apart from",
        "no force_x_n",
        "Next experiment",
        "Z mechanics",
        "healthy",
        "A force on X of +43 N between 118 and 141 mm",
        "direction friction on X, but it closes 31 %",
        "axes.y.mass_kg",
    ):
        expect(main).to_contain_text(text)
    expect(page.get_by_role("link", name="Open the whole report")).to_have_attribute("href", "gap/vmc/report")
    page.keyboard.press("]")
    page.keyboard.press("[")
    page = visit.open("#/gap/mill-01")
    expect(main).to_contain_text("cnctwin gap diagnose CASE --out diagnoses/mill-01")


def test_an_alert_is_acknowledged_with_name_and_comment(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/alerts")
    first = page.locator(".alarmcard.firing").first
    expect(first.locator("h3")).to_have_text("vmc · Spindle load 131 % for 4 s, limit 120 %")
    expect(first).to_contain_text("Check the tool for wear")
    first.get_by_role("button", name="Acknowledge").click()
    page.get_by_label("Your name").fill("ada")
    page.get_by_label("Comment").fill("on my way")
    done = alerts(list(shop.numbers))
    done["alerts"][0] |= {"phase": "acknowledged", "acknowledged_by": "ada", "comment": "on my way"}
    shop.answers["/alerts"] = lambda _path, _body: (200, done)
    page.get_by_role("dialog").get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    expect(page.locator(".alarmcard.acknowledged").first).to_contain_text("ada: “on my way”")
    ((path, body),) = shop.posted
    assert path.endswith("/acknowledge")
    assert body == {"by": "ada", "comment": "on my way", "episode": body["episode"]}


def test_the_head_of_a_machine_names_its_worst_alert_that_nobody_has_acknowledged(visit: Visit, shop: Shop) -> None:
    told = alerts(list(shop.numbers))
    told["alerts"] = [
        alert("vmc", "gap_growing", "high", "acknowledged", 5400, acknowledged_by="ada"),
        alert("vmc", "score_drift", "low", "firing", 9),
        alert("vmc", "machine_offline", "medium", "firing", 120, sentence="No data from the machine"),
        alert("mill-01", "rule_vibration", "high", "firing", 9),
    ]
    shop.answers["/alerts"] = lambda _path, _body: (200, told)
    page = visit.open("#/machine/vmc")
    pill = page.locator('.machine-head a[href="#/alerts"]')
    expect(pill).to_contain_text("alert firing: Machine offline")
    expect(pill).to_have_attribute("title", "No data from the machine")
    told["alerts"] = [told["alerts"][0]]
    page.reload()
    expect(pill).to_contain_text("alert acknowledged: Gap growing")


def test_a_refused_acknowledgement_says_why(visit: Visit, shop: Shop) -> None:
    shop.answers["/alerts/[^/]+/acknowledge"] = lambda _path, _body: (504, {"error": "no answer within 5 s"})
    page = visit.open("#/alerts")
    page.get_by_role("button", name="Acknowledge").first.click()
    page.get_by_label("Your name").fill("ada")
    page.get_by_role("dialog").get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("dialog")).to_contain_text("no answer within 5 s")
    visit.errors.clear()  # the browser itself writes a line for a 504


def test_an_incident_is_gone_through_with_the_slider(visit: Visit) -> None:
    page = visit.open("#/replay/vmc")
    clock, slider = page.locator(".player .moment"), page.get_by_label("Moment")
    expect(page.locator(".then")).to_contain_text(
        "BASE-PLATE.NC" if "BASE-PLATE" in page.locator(".then").inner_text() else ".NC"
    )
    before = clock.inner_text()
    slider.fill("500")
    expect(clock).not_to_have_text(before)
    middle = clock.inner_text()
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Play").click()
    expect(clock).not_to_have_text(middle)
    page.get_by_role("button", name="Pause").click()
    page.locator("main").press("End")
    expect(slider).to_have_value("1000")
    page.locator(".events button").first.click()
    expect(page.locator(".events tr.here")).to_contain_text("T2 in the spindle")


def test_the_replay_shows_which_description_was_live_then_and_what_was_wrong_with_its_file(visit: Visit) -> None:
    page = visit.open("#/replay/vmc")
    then, slider = page.locator(".then"), page.get_by_label("Moment")
    expect(page.locator(".events")).to_contain_text("description fault")
    expect(page.locator(".events")).to_contain_text(FAULTY)
    slider.fill("400")
    expect(then).to_contain_text("3f2a1bc4d5e6 live: described")
    slider.fill("1000")
    expect(then).to_contain_text("9b1c77aa2e01 live: promoted by anna: coolant cools")
    expect(then).not_to_contain_text("challenger")
    expect(page.locator(".events tr", has_text=CHANGED)).to_have_count(1)


def test_what_is_recomputed_is_said_to_be_equal_or_not(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/replay/vmc")
    page.get_by_role("button", name="Recompute and compare").click()
    expect(page.locator(".recompute")).to_contain_text("The same: 18204 values")
    difference = {"signal": "twin/raw_score", "t": now_ms(), "published": 0.1, "recomputed": 0.2}
    shop.answers["/twin/replay"] = lambda _path, _body: (200, {"equal": False, "compared": 7, "differences": [difference]})
    page.get_by_role("button", name="Recompute and compare").click()
    expect(page.locator(".recompute")).to_contain_text("Not the same: 1 of 7")
    expect(page.locator(".recompute")).to_contain_text("twin/raw_score")


def test_parts_and_validation_are_shown(visit: Visit) -> None:
    page = visit.open("#/parts/vmc")
    main = page.locator("main")
    for text in (
        "BASE-PLATE.NC",
        "T1, T2, T5",
        "38.9 °C",
        "its beginning was not seen",
        "0.84 K",
        "within",
        "over",
        "the machine offers no vibration_rms_g",
    ):
        expect(main).to_contain_text(text)
    page.get_by_role("button", name="Record").first.click()
    expect(page.get_by_role("dialog")).to_contain_text("part_number")


def test_the_whole_page_can_be_gone_through_by_keyboard(visit: Visit) -> None:
    page = visit.open("#/fleet")
    expect(page.locator(".unit").first).to_be_visible()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    focused = page.evaluate("document.activeElement.querySelector('.name').textContent")
    assert focused == "mill-02"
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile("#/machine/mill-02"))
    page.keyboard.press("]")
    expect(page).to_have_url(re.compile("#/machine/vmc"))
    page.keyboard.press("3")
    expect(page.locator(".panel.own .name")).to_have_text("Spindle speed, rev/min")
    for key, view in (("g", "gap"), ("a", "alerts"), ("r", "replay"), ("p", "parts"), ("j", "jobs"), ("f", "fleet")):
        page.keyboard.press(key)
        expect(page.locator(f"body[data-view={view}]")).to_be_visible()
    page.keyboard.press("/")
    page.keyboard.type("mill-01")
    expect(page.locator(".unit:visible")).to_have_count(1)
    page.keyboard.press("Escape")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_contain_text("previous, next machine")
    expect(page.get_by_role("dialog")).to_contain_text("on a load bar: 100 %")
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_be_hidden()
    page.wait_for_timeout(100)
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_a_dialog_of_one_view_does_not_stay_open_over_the_next(visit: Visit) -> None:
    page = visit.open("#/fleet")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    page.evaluate("location.hash = '#/alerts'")
    expect(page.locator("body[data-view=alerts]")).to_be_visible()
    expect(page.get_by_role("dialog")).to_be_hidden()


def test_a_key_typed_before_the_event_of_a_new_address_belongs_to_the_new_view(visit: Visit) -> None:
    page = visit.open("#/fleet")
    expect(page.locator(".unit").first).to_be_visible()
    page.evaluate(
        """() => {
            location.hash = "#/machine/mill-02";
            document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "]", bubbles: true }));
        }"""
    )
    expect(page).to_have_url(re.compile("#/machine/vmc"))


def test_text_from_a_machine_stays_text(visit: Visit, shop: Shop) -> None:
    told = SignalValue(HOSTILE)
    shop.other["vmc"] = dict.fromkeys(("program", "nc_block", "alarm", "exec_state"), told) | {
        "twin/raw_score": SignalValue(None, None, "inferred", HOSTILE)
    }
    hostile = alerts(["vmc", HOSTILE])
    hostile["alerts"][0] |= {"comment": HOSTILE, "acknowledged_by": HOSTILE, "phase": "acknowledged"}
    shop.answers["/alerts"] = lambda _path, _body: (200, hostile)
    event = {"t": now_ms() - 60_000, "kind": HOSTILE, "text": HOSTILE}
    shop.answers["/events/vmc"] = lambda _path, _body: (200, {"events": [event]})
    shop.answers["/parts/vmc"] = lambda _path, _body: (
        200,
        {"parts": [{"program": HOSTILE, "tools": [HOSTILE], "ended_by": HOSTILE, "reasons": [HOSTILE], "complete": False}]},
    )
    shop.answers["/jobs"] = lambda _path, _body: (
        200,
        {"jobs": [job(HOSTILE, HOSTILE, HOSTILE, reason=HOSTILE, sentence=HOSTILE)]},
    )
    for place in ("fleet", "machine/vmc", "alerts", "replay/vmc", "parts/vmc", "jobs", "gap/vmc"):
        page = visit.open(f"#/{place}")
        expect(page.locator("main")).to_contain_text("<img src=x" if place != "gap/vmc" else "Standing")
        page.wait_for_timeout(150)
        assert page.locator("main img").count() == 0, place
    assert page.evaluate("window.hacked") is None


def test_nothing_is_cut_off_and_what_is_pressed_is_large_enough(visit: Visit) -> None:
    for place in VIEWS:
        page = visit.open(f"#/{place}")
        page.wait_for_timeout(250)
        assert page.locator("main h1").count() == 1, place
        assert page.evaluate(NAMELESS) == [], place
        for size, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, f"{place} is wider than {size}"
            assert page.evaluate(SMALL) == [], f"{place} at {size}"
    assert {url.split("/")[2] for url in visit.asked} == {visit.url.split("/")[2]}, "something was loaded from elsewhere"


def test_dark_and_light_are_both_there(visit: Visit) -> None:
    page = visit.open("#/machine/vmc")
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.emulate_media(color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != light
    expect_drawn(page, ".panel.own canvas")


def test_the_log_in_opens_the_page(visit: Visit, shop: Shop) -> None:
    shop.token = "a-token"
    page = visit.open("")
    field = page.get_by_label("Token")
    field.fill("wrong")
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("dialog")).to_contain_text("not the token")
    field.fill("a-token")
    page.get_by_role("button", name="Log in").click()
    expect(page.locator(".unit").first).to_be_visible()
    visit.errors.clear()  # the browser itself writes a line for each 401


def test_without_a_machine_the_page_says_what_to_do(browser: Browser) -> None:
    with FakeServer(Shop([])) as server:
        visit = Visit(browser, server.url)
        page = visit.open("")
        expect(page.locator("main")).to_contain_text("cnctwin demo")
        for place in ("machine", "gap", "replay", "parts"):
            expect(visit.open(f"#/{place}").locator("main")).to_contain_text("No machine yet")
        visit.context.close()
        assert visit.errors == []


def test_the_time_of_a_value_is_the_servers_not_the_tablets(visit: Visit) -> None:
    """A tablet whose clock is an hour wrong shows the same ages."""
    visit.page.add_init_script("const own = Date.now; Date.now = () => own() + 3600000;")
    page = visit.open("#/machine/vmc")
    expect(page.locator('[data-tile="spindle_load_pct"] .aged')).to_have_text(re.compile(r"now|^\d+ s|for \d+ s"))
