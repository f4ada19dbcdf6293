"""The first look at a machine: the chart that it opens on, the figures in its tiles, and the addresses that lead there."""

import re

from playwright.sync_api import Browser, expect

from cnctwin.api.fleet import NO_GAP
from tests.cnctwin.page.conftest import Visit, expect_drawn
from tests.cnctwin.page.fake_server import FakeServer, Shop
from tests.cnctwin.page.simulated_shop import SignalValue


def test_a_machine_without_a_spindle_temperature_opens_on_what_it_has(visit: Visit, shop: Shop) -> None:
    shop.without["vmc"] = re.compile("spindle_temp_c|twin/spindle_temp_residual_k")
    shop.other["vmc"] = {"twin/spindle_temp_c": SignalValue(None, "°C", "modelled", "no ambient temperature")}
    page = visit.open("#/machine/vmc")
    expect(page.locator(".panel.own .name")).to_have_text("Spindle load, %")
    expect(page.get_by_label("Signal to chart")).to_have_value("spindle_load_pct")
    expect_drawn(page, ".panel.own canvas")
    expect(page.locator('[data-tile="spindle_temp_c"]')).to_be_hidden()
    page = visit.open("#/machine/vmc?signal=spindle_temp_c")
    expect(page.get_by_label("Signal to chart")).to_have_value("spindle_temp_c")
    expect(page.locator(".panel.own .why")).to_contain_text("not offered by this machine")


def test_a_control_that_tells_positions_only_opens_on_one_of_them(visit: Visit, shop: Shop) -> None:
    shop.without["vmc"] = re.compile("(spindle|feed_mm|vibration|axis_._load|ambient|twin/(?!spindle_temp_c$)).*")
    shop.other["vmc"] = {"axis_x_pos_mm": SignalValue(12.5, "mm")} | {
        "twin/spindle_temp_c": SignalValue(None, "°C", "modelled", "speed is not known")
    }
    page = visit.open("#/machine/vmc")
    expect(page.get_by_label("Signal to chart")).to_have_value("axis_x_pos_mm")
    expect(page.locator(".panel.own .name")).to_have_text("X position, mm")


def test_the_gap_of_a_tile_is_the_difference_of_the_two_figures_above_it(visit: Visit) -> None:
    visit.open("#/machine/vmc")
    shown = visit.evaluate("""
      const [{ Machine }, { Tile }, { TILES }] = await Promise.all([module('plant'), module('views/tiles'), module('charted')]);
      const machine = new Machine('lathe'), tile = new Tile(machine, TILES[0], () => {}), read = [];
      machine.setOnline(true);
      const told = (ms, of) => {
        const t = Date.now() - 20000 + ms;
        for (const [signal, value, unit] of of) machine.know(signal, { value, t, unit }, { series: true });
        tile.write();
        read.push([...tile.element.querySelectorAll('.big .figure, .line:not([hidden]) .figure')].map((one) => one.textContent));
      };
      const own = (value) => ['spindle_temp_c', value, '°C'];
      told(0, [own(40.04), ['twin/spindle_temp_c', 38.96, '°C'], ['twin/spindle_temp_residual_k', 1.08, 'K']]);
      told(500, [own(43)]);
      told(600, [['twin/spindle_temp_c', null, '°C'], ['twin/spindle_temp_residual_k', null, 'K']]);
      return read;
    """)
    assert shown == [["40.0", "39.0", "+1.0 K"], ["43.0", "39.0", "+4.0 K"], ["43.0", "–", "–"]]


def test_figures_are_written_in_the_readers_language(browser: Browser, server: FakeServer) -> None:
    visit = Visit(browser, server.url, locale="de-DE")
    page = visit.open("#/machine/vmc")
    expect(page.locator('[data-tile="spindle_temp_c"] .big .figure')).to_have_text(re.compile(r"^\d+,\d$"))
    shown = visit.evaluate(
        "const { number, coarse } = await module('text'); return [number(8500.4, 'rpm'), number(-1.5), coarse(2.34)]"
    )
    visit.context.close()
    assert shown == ["8500", "−1,5", "2,3"]


def test_the_address_of_the_parts_is_their_name_and_the_old_one_still_leads_there(visit: Visit) -> None:
    for place in ("#/parts/vmc", "#/validation/vmc"):
        page = visit.open(place)
        expect(page.get_by_role("link", name="Parts")).to_have_attribute("aria-current", "page")
    page = visit.open("#/parts")
    expect(page.get_by_role("link", name="Parts")).to_have_attribute("aria-current", "page")


def test_a_gap_that_is_not_known_says_so_and_one_that_is_says_in_what(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/fleet")
    gap = page.locator("a.unit", has=page.get_by_text("vmc", exact=True)).locator(".cell.gaps")
    expect(gap).to_have_text(re.compile(r"3.1× repeatability"))
    expect(gap.locator(".figure")).to_have_attribute("title", re.compile("what two runs of the same program differ by"))


def test_where_no_gap_is_computed_the_fleet_says_which_processor_does_it(visit: Visit, shop: Shop) -> None:
    shop.without["vmc"] = re.compile("twin/(gap_.*|spindle_temp_residual_k)")
    page = visit.open("#/fleet")
    gap = page.locator("a.unit", has=page.get_by_text("vmc", exact=True)).locator(".cell.gaps .figure")
    expect(gap).to_have_text("–")
    expect(gap).to_have_attribute("title", NO_GAP)


def test_an_address_that_no_view_has_says_so_and_leads_to_the_fleet(visit: Visit) -> None:
    page = visit.open("#/machines/vmc")
    expect(page.get_by_text("There is no view machines.")).to_be_visible()
    expect(page.get_by_role("link", name="Fleet", exact=True)).not_to_have_attribute("aria-current", "page")
    page.get_by_role("link", name="To the fleet").click()
    expect(page.get_by_role("heading", name="Fleet")).to_be_visible()
    visit.open("#/constructor")
    expect(page.get_by_text("There is no view constructor.")).to_be_visible()
    visit.open("")
    expect(page.get_by_role("heading", name="Fleet")).to_be_visible()
