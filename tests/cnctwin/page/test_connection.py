"""The connection: what is not live never looks live, and the page comes back by itself; fifty machines at 10 Hz."""

import re
import time

import pytest
from playwright.sync_api import Browser, expect

from tests.cnctwin.page.conftest import SIZES, WAIT_MS_MAX, Visit
from tests.cnctwin.page.fake_server import FakeServer, Shop, now_ms

MACHINES, BATCHES = 50, 15


def test_the_page_comes_back_by_itself_after_the_server_was_restarted(visit: Visit, server: FakeServer) -> None:
    page = visit.open("#/machine/vmc")
    load = page.locator('[data-tile="spindle_load_pct"] .big .figure')
    expect(load).to_have_text(re.compile(r"\d"))
    expect(page.locator("#link")).to_have_text("live")
    server.stop()
    expect(page.locator("#banner")).to_contain_text("Not live", timeout=30_000)
    expect(page.locator("#link")).to_have_text("reconnecting")
    assert "gradient" in page.evaluate("getComputedStyle(document.querySelector('.tile')).backgroundImage")
    frozen = load.inner_text()
    page.wait_for_timeout(300)
    assert load.inner_text() == frozen
    server.start()
    expect(page.locator("#link")).to_have_text("live")
    expect(page.locator("#banner")).to_be_hidden()
    expect(load).not_to_have_text(frozen)
    visit.errors.clear()  # the browser writes a line for each refused connection


def test_a_server_without_its_broker_is_not_live(visit: Visit, shop: Shop) -> None:
    page = visit.open("#/fleet")
    expect(page.locator("#link")).to_have_text("live")
    shop.broker = False
    shop.offline_since = dict.fromkeys(shop.numbers, now_ms())
    expect(page.locator("#banner")).to_contain_text("lost the broker")
    expect(page.locator(".unit:not(.stale)")).to_have_count(0)
    shop.broker = True
    shop.offline_since = {}
    expect(page.locator("#banner")).to_be_hidden()
    expect(page.locator(".unit.stale")).to_have_count(0)


@pytest.mark.parametrize("place", ["#/fleet", "#/machine/vmc"])
@pytest.mark.parametrize("size", SIZES)
def test_processors_that_fall_behind_are_said_above_everything(
    browser: Browser, server: FakeServer, shop: Shop, place: str, size: str
) -> None:
    names = "alerts, cutting_force, events, gap, historian, joint_anomaly, mirror, residual, rules, thermal, vibration"
    visit = Visit(browser, server.url, SIZES[size])
    page = visit.open(place)
    line = page.locator("#behind")
    expect(page.locator("#link")).to_have_text("live")
    expect(line).to_be_hidden()
    shop.behind = (
        f"processors are 18 s behind: 20 machines, one core, 105 % busy; `cnctwin plan fleet` says what it takes ({names})"
    )
    expect(line).to_contain_text("Late.")
    expect(line).to_contain_text("Processors are 18 s behind: 20 machines, one core, 105 % busy")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.reload()
    expect(page.locator("#link")).to_have_text("live")
    expect(line).to_contain_text("18 s behind")
    shop.behind = "<img src=x onerror=alert(1)> is 19 s behind"
    expect(line).to_contain_text("<img src=x")
    shop.behind = None
    expect(line).to_be_hidden()
    assert visit.errors == []
    visit.context.close()


@pytest.mark.parametrize("place", ["#/fleet", "#/gap/vmc"])
def test_a_description_that_has_a_fault_is_said_until_it_is_mended(visit: Visit, shop: Shop, place: str) -> None:
    page = visit.open(place)
    line = page.locator("#described")
    expect(page.locator("#link")).to_have_text("live")
    expect(line).to_be_hidden()
    shop.described = "vmc: machines/vmc.toml: line 7: no value; <b>no markup</b>"
    expect(line).to_contain_text("Not taken up.")
    expect(line).to_contain_text("The description of vmc: machines/vmc.toml: line 7: no value; <b>no markup</b>.")
    page.reload()
    expect(line).to_contain_text("line 7")
    shop.described = None
    expect(line).to_be_hidden()


def test_a_hole_in_the_connection_is_a_hole_in_the_line_and_is_filled_from_the_store(visit: Visit) -> None:
    visit.open("")
    script = """
      const { Ring, Steps } = await module("ring");
      const ring = new Ring(4, 100), steps = new Steps();
      for (const t of [10, 11, 12]) ring.push(t, t);
      ring.hole(13); ring.push(20, 20);
      const holed = ring.since(0);
      ring.merge([5, 6, 10, 12, 14, 15, 18, 20, 21], [5, 6, 99, 99, 14, 15, 18, 99, 99]);
      steps.push(10, "a"); steps.hole(13); steps.push(20, "b");
      steps.merge([5, 11, 14, 25], ["z", "x", "y", "q"]);
      return [holed[1].map(String), ring.since(0), steps.items.map((one) => [one.t, one.value])];
    """
    holed, filled, steps = visit.evaluate(script)  # type: ignore[misc]
    assert holed == ["10", "11", "12", "NaN", "20"]
    assert filled == [[5, 6, 10, 11, 12, 14, 15, 18, 20], [5, 6, 10, 11, 12, 14, 15, 18, 20]]
    assert steps == [[5, "z"], [10, "a"], [13, None], [14, "y"], [20, "b"]]


def test_memory_is_bounded(visit: Visit) -> None:
    visit.open("")
    script = """
      const { Ring, Steps } = await module("ring");
      const ring = new Ring(8, 100), steps = new Steps(50);
      for (let t = 0; t < 1000; t++) { ring.push(t, t); steps.push(t, t); }
      return [ring.length, ring.first, ring.last, steps.items.length];
    """
    assert visit.evaluate(script) == [100, 900, 999, 50]


def test_figures_read_as_a_person_writes_them(visit: Visit) -> None:
    visit.open("")
    script = """
      const { age, number, plain, title, signed } = await module("text");
      return [number(-0.04, "°C"), number(1234.6, "rev/min"), number(0.00012346), number(NaN), plain(null), plain(true),
        age(500), age(59000), age(3700000), title("axis_z_load_pct"),
        title("twin/gap_spindle_temp_c/warm_up"), signed(0.72, "K"), number(-12.34)];
    """
    assert visit.evaluate(script) == [
        "0.0", "1235", "0.0001235", "–", "–", "yes", "now", "59 s", "1 h 01 min",
        "Z load", "Gap: spindle temperature, warm up", "+0.7", "−12.34",
    ]  # fmt: skip


def test_fifty_machines_at_ten_hertz_are_painted_before_the_next_values_come(browser: Browser) -> None:
    """A slice; `benchmarks/page/page.py` does it with the real server, a real broker and simulated edges, and measures the lag.

    Counted is the processor time of the page's thread, which is the same however long it waits for a processor. A page that has
    painted one batch before the next one comes shows a value within two periods and a frame: less than a quarter of a second.
    """
    shop = Shop([f"mill-{number:02d}" for number in range(MACHINES)])
    with FakeServer(shop) as server:
        visit = Visit(browser, server.url, SIZES["wall"])
        page = visit.open("#/fleet")
        expect(page.locator(".unit")).to_have_count(MACHINES)
        thread = visit.context.new_cdp_session(page)
        thread.send("Performance.enable", {"timeDomain": "threadTicks"})

        def page_thread_ms() -> float:
            metrics = {one["name"]: one["value"] for one in thread.send("Performance.getMetrics")["metrics"]}
            return 1000.0 * metrics["TaskDuration"]

        visit.evaluate("(await module('lag')).forget();")
        began_ms = page_thread_ms()
        end_s, painted = time.monotonic() + WAIT_MS_MAX / 1000.0, 0
        while painted < BATCHES * MACHINES and time.monotonic() < end_s:
            page.wait_for_timeout(200)
            painted = visit.evaluate("return (await module('lag')).lag()?.count ?? 0;")  # type: ignore[assignment]
        took_ms = page_thread_ms() - began_ms
        visit.context.close()
    assert visit.errors == []
    assert painted >= BATCHES * MACHINES
    assert 0.0 < took_ms / painted * MACHINES <= 1000.0 * shop.period_s
