"""A replay and what is live are two sources: it knows nothing beyond the newest moment, and leaves what is live as it is."""

import re
from typing import Any

from playwright.sync_api import expect

from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.documents import part_record
from tests.cnctwin.page.fake_server import Shop, now_ms

AHEAD_MS = 3_600_000


def test_nothing_is_drawn_beyond_the_newest_moment_that_is_known(visit: Visit) -> None:
    visit.open("#/fleet")
    shown = visit.evaluate("""
      const [{ Machine }, { livedThrough }, { Panels }, { chartOf, valueAt }] =
        await Promise.all([module('plant'), module('past'), module('panels'), module('charted')]);
      const known = new Machine('lathe'), last = Date.now() + 3600000, from = last - 60000, to = last + 600000;
      const load = { value: 40, t: last, unit: '%', quality: 'good' };
      known.state({ measured: { spindle_load_pct: load }, twin: {}, online: true, now: last - 3600000 });
      const column = { signal: 'spindle_load_pct', unit: '%', t: [from, last - 30000], value: [30, 40], quality: [], reason: [] };
      const state = { signal: 'exec_state', unit: null, t: [from], value: ['ACTIVE'], quality: [], reason: [null] };
      const past = livedThrough(known, [column, state]), panels = new Panels(past);
      document.querySelector('main').append(panels.element);
      panels.choose(chartOf(past, 'spindle_load_pct'));
      panels.draw(from, to, true);
      const newest = panels.main.chart.data[0].at(-1), bar = panels.strip.lanes[0].svg.querySelector('rect');
      const hatched = panels.main.chart.marks.stale.at(-1);
      const share = bar.getBoundingClientRect().width / panels.strip.lanes[0].svg.getBoundingClientRect().width;
      const at = [last - 10000, to - 1].map((t) => valueAt(past, 'spindle_load_pct', t));
      return [newest < last + 60000, newest >= last, hatched[0] === newest && hatched[1] === to, share < 0.5, at];
    """)
    assert shown == [True, True, True, True, [40, None]]


def test_a_machine_is_offline_since_the_newest_moment_at_which_it_was_heard(visit: Visit) -> None:
    """The fleet, the machine's state and the store tell it one after the other, and each knows more than the one before."""
    visit.open("#/fleet")
    shown = visit.evaluate("""
      const [{ Plant }] = await Promise.all([module('plant')]);
      const plant = new Plant(), stale = (t) => ({ value: 40, t, unit: '%', quality: 'stale' }), since = [];
      plant.fleet([{ machine: 'lathe', online: false, last_t: 1000 }]);
      const lathe = plant.machines.get('lathe'), tell = () => since.push(lathe.offlineSince);
      tell();
      lathe.state({ measured: { spindle_load_pct: stale(2000) }, twin: {}, online: false, now: 9000 });
      tell();
      const quality = ['good', 'good', 'stale'];
      lathe.backfill({ signal: 'spindle_load_pct', t: [500, 3000, 4000], value: [30, 40, null], quality });
      tell();
      lathe.backfill({ signal: 'twin/raw_score', t: [5000], value: [1], quality: ['good'] });
      tell();
      lathe.setOnline(true, 6000);
      tell();
      return since;
    """)
    assert shown == [1000, 2000, 3000, 3000, None]


def test_the_alarm_of_the_control_and_the_alert_of_a_moment_are_two_figures(visit: Visit) -> None:
    visit.open("#/fleet")
    shown = visit.evaluate("""
      const [{ Machine }, { livedThrough }, { MomentShown }] =
        await Promise.all([module('plant'), module('past'), module('views/moment_shown')]);
      const now = Date.now(), known = new Machine('lathe');
      known.state({ measured: { alarm: { value: '', t: now, quality: 'good' } }, twin: {}, online: true, now });
      const t = [now - 60000, now - 30000];
      const of = (signal, ...value) => ({ signal, unit: null, t, value, quality: [], reason: [null, null] });
      const past = livedThrough(known, [of('alarm', 'EX1012', ''), of('twin/alert_state', 'none', 'firing')]);
      const moment = new MomentShown();
      return [now - 50000, now - 20000].map((t) => {
        moment.write(past, t);
        return [moment.parts.alarm.textContent, moment.parts.alert.textContent];
      });
    """)
    assert shown == [["EX1012", "none"], ["none", "firing"]]


def test_a_replay_adds_no_signal_to_what_the_machine_has_live(visit: Visit, shop: Shop) -> None:
    shop.without["vmc"] = re.compile("spindle_load_pct|twin/(alert_state|.*score.*|anomaly.*|gap_.*|tool_change_gate|spindle.*)")
    page = visit.open("#/fleet")
    expect(page.locator("a.unit", has_text="vmc")).to_be_visible()
    visit.open("#/replay/vmc")
    expect(page.locator(".replay-view .panels")).to_be_visible()
    visit.open("#/machine/vmc")
    expect(page.locator('[data-tile="spindle_rpm"] .big .figure')).to_have_text(re.compile(r"\d"))
    for tile in ('[data-tile="spindle_load_pct"]', ".scoretile"):
        expect(page.locator(tile)).to_be_hidden()
    page.keyboard.press("e")
    expect(
        page.get_by_role("region", name="Every signal").get_by_role("row").filter(has_text="spindle_rpm").first
    ).to_be_visible()
    assert page.get_by_role("region", name="Every signal").get_by_text("spindle_load_pct", exact=True).count() == 0


def test_the_parts_and_the_replay_of_a_time_lapse_end_at_its_own_now(visit: Visit, shop: Shop) -> None:
    """Its stamps run ahead of the clock: what it made is asked for up to its newest moment."""
    shop.ahead_ms["vmc"] = AHEAD_MS

    def parts(_path: str, asked: dict[str, Any] | None) -> tuple[int, dict[str, Any]]:
        until = int((asked or {}).get("to", now_ms()))
        made = [part_record("vmc", 7, until - 1000)] if until > now_ms() + AHEAD_MS // 2 else []
        return 200, {"machine": "vmc", "parts": made}

    shop.answers["/parts/vmc"] = parts
    page = visit.open("#/parts/vmc")
    expect(page.get_by_role("region", name="Parts")).to_contain_text("BASE-PLATE.NC")
    page = visit.open("#/replay/vmc")
    expect(page.locator(".replay-view .panels")).to_be_visible()
    start, end = (int(found) for found in re.findall(r"(?:from|to)=(\d+)", page.url))
    assert now_ms() + AHEAD_MS // 2 < end < now_ms() + 2 * AHEAD_MS
    assert end - start == 300_000
