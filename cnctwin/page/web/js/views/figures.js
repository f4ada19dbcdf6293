// Production figures: OEE by machine and shift with its parts, stops by reason, parts with their energy (docs/how-to/production.md).

import { get, query } from "../api.js";
import { serverNow } from "../clock.js";
import { drawn, el, setText, table } from "../dom.js";
import { lookup } from "../lookup.js";
import { duration, fixed, knownZone, moment, number, plain, sentence } from "../text.js";

const HOUR_MS = 3600000;
const STRETCHES = [
  ["24 h", 24 * HOUR_MS],
  ["7 days", 168 * HOUR_MS],
  ["31 days", 744 * HOUR_MS],
];
const BYS = [
  ["shift", "Shifts"],
  ["machine", "Machines"],
  ["program", "Programs"],
];
const KINDS = lookup({ production: "production", setup: "setup", delay: "stands, no alarm", down: "down, an alarm", unknown: "not heard" });
const BARS_MAX = 40;
const PARTS_MAX = 200;
const NAMED_MAX = 3;
const ALL = "";
const list = (value) => (Array.isArray(value) ? value : []);
const pct = (value) => (Number.isFinite(value) ? `${fixed(100 * value, 1)} %` : "–");
const kwh = (value) => (Number.isFinite(value) ? `${number(value)} kWh` : "–");
const spent = (seconds) => (Number.isFinite(seconds) ? duration(1000 * Math.round(seconds)) : "–");
const named = (row) => (row.shift === undefined ? row.machine : `${row.machine}, ${row.shift ?? "no shift"}`);
const when = (row, zone) => moment(row.begin, { seconds: false, zone }) + (row.over === false ? ", so far" : "");

/** Notes below the table: why figures are missing, and what was made beside planned time; with the rows, where it is not all of them. */
function notes(rows) {
  const of = new Map();
  for (const row of rows)
    for (const [name, why] of Object.entries(row.why ?? {}))
      if (name !== "oee") of.set(`${name}: ${why}`, [...(of.get(`${name}: ${why}`) ?? []), named(row)]);
  const beside = rows.filter((row) => row.beside_s >= 1);
  if (beside.length) {
    const seconds = beside.reduce((sum, row) => sum + row.beside_s, 0);
    of.set(`${spent(seconds)} made in breaks or outside shifts, not counted`, beside.map(named));
  }
  const whose = (names) => {
    const each = [...new Set(names)],
      more = each.length - NAMED_MAX;
    return names.length === rows.length ? "" : ` (${each.slice(0, NAMED_MAX).join("; ")}${more > 0 ? ` and ${more} more` : ""})`;
  };
  return of.size
    ? el("div", { class: "note" }, [...of].map(([text, names]) => el("p", {}, `${sentence(text)}${whose(names)}.`)))
    : null;
}

function oee(rows, by, zone) {
  if (by === "program")
    return table(
      ["Program", "Machine", "Parts", "Good", "Scrap", "Ideal", "Actual", "Performance", "Energy a part"],
      rows.map((row) => [
        plain(row.program),
        row.machine,
        plain(row.parts),
        plain(row.good),
        plain(row.scrap),
        spent(row.ideal_s),
        spent(row.active_s),
        pct(row.performance),
        kwh(row.energy_a_part_kwh),
      ]),
      { numbers: [2, 3, 4, 5, 6, 7, 8], label: "Figures by program" },
    );
  const heads = ["OEE", "Availability", "Performance", "Quality", "Planned", "Production", "Not heard", "Parts", "Energy"];
  return table(
    [by === "shift" ? "Machine, shift" : "Machine", "Began", ...heads],
    rows.map((row) => [
      named(row),
      when(row, zone),
      el("strong", {}, pct(row.oee)),
      pct(row.availability),
      pct(row.performance),
      pct(row.quality),
      row.calendar === false ? "–" : spent(row.planned_s),
      spent(row.production_s),
      spent(row.unknown_s),
      plain(row.parts),
      kwh(row.energy_kwh),
    ]),
    { numbers: [2, 3, 4, 5, 6, 7, 8, 9, 10], label: `Figures by ${by}` },
  );
}

/** One bar: what the time of a shift went to, the stops by reason, longest first. */
function stopBar(row, zone) {
  const stops = Object.entries(row.stops ?? {}).map(([reason, one]) => [reason, one.kind, one.s, one.n]);
  const pieces = [["production", "production", row.production_s, null], ...stops].filter(([, , seconds]) => seconds > 0);
  const whole = pieces.reduce((sum, [, , seconds]) => sum + seconds, 0);
  if (!whole) return null;
  let at = 0;
  const rects = pieces.map(([reason, kind, seconds]) => {
    const width = (100 * seconds) / whole;
    const rect = drawn("rect", { x: at, y: 0, width, height: 1, "data-kind": kind }, drawn("title", {}, `${reason}, ${spent(seconds)}`));
    at += width;
    return rect;
  });
  const told = pieces.map(([reason, , seconds]) => `${reason} ${spent(seconds)}`).join(", ");
  const bar = drawn("svg", { class: "whole", viewBox: "0 0 100 1", preserveAspectRatio: "none", role: "img", "aria-label": told }, rects);
  const share = (seconds) => pct(seconds / whole);
  return el(
    "div",
    { class: "stopbar" },
    el("p", { class: "what" }, el("strong", {}, named(row)), el("span", { class: "quiet" }, when(row, zone))),
    bar,
    el(
      "details",
      {},
      el("summary", {}, stops.length ? `${stops.length} reasons, ${spent(whole - row.production_s)}` : "no stop"),
      table(
        ["Reason", "Counts as", "Time", "Share", "Stops"],
        pieces.map(([reason, kind, seconds, n]) => [reason, KINDS[kind] ?? kind, spent(seconds), share(seconds), plain(n)]),
        { numbers: [2, 3, 4], label: `Stops of ${named(row)}` },
      ),
    ),
  );
}

const key = () =>
  el(
    "ul",
    { class: "stopkey", "aria-label": "Colours" },
    Object.entries(KINDS).map(([kind, text]) =>
      el("li", {}, drawn("svg", { viewBox: "0 0 1 1", "aria-hidden": "true" }, drawn("rect", { width: 1, height: 1, "data-kind": kind })), text),
    ),
  );

function parts(rows, zone) {
  if (!rows.length) return el("p", { class: "note" }, "No part has ended in this stretch.");
  return table(
    ["Ended", "Machine", "Program", "Shift", "Ideal", "Actual", "Performance", "Energy", "Quality"],
    rows
      .slice(-PARTS_MAX)
      .reverse()
      .map((row) => [
        moment(row.end, { zone }),
        row.machine,
        plain(row.program),
        plain(row.shift),
        spent(row.ideal_s),
        row.complete ? spent(row.active_s) : `${spent(row.active_s)}, not all seen`,
        pct(row.performance),
        kwh(row.energy_kwh),
        plain(row.quality),
      ]),
    { numbers: [4, 5, 6, 7], label: "Parts with their energy" },
  );
}

const nothing = (note) =>
  el(
    "div",
    { class: "empty" },
    el("h3", {}, "No figures of this stretch"),
    el("p", {}, "The processor production adds them up live, shift by shift. Out of the store, by hand:"),
    el("pre", {}, "cnctwin figures --all --from -1d --calendar calendar.toml"),
    el("p", { class: "note" }, note),
  );

/** Buttons of which one is pressed. */
function choice(label, options, chosen, choose) {
  const buttons = options.map(([value, text]) =>
    el(
      "button",
      {
        type: "button",
        class: "button",
        "aria-pressed": String(value === chosen),
        onclick: (event) => {
          for (const one of buttons) one.setAttribute("aria-pressed", String(one === event.currentTarget));
          choose(value);
        },
      },
      text,
    ),
  );
  return el("div", { class: "group", role: "group", "aria-label": label }, buttons);
}

export function open(app, { machine: asked }) {
  const stop = new AbortController(),
    chosen = { stretch: STRETCHES[0][1], by: "shift", machine: asked ?? ALL };
  const shifts = el("div", {}, el("p", { class: "waiting" }, "Loading …")),
    stops = el("div", { class: "stopbars" }),
    made = el("div", {}),
    csv = el("a", { class: "button", download: true }, "CSV"),
    partsCsv = el("a", { class: "button", download: true }, "CSV of the parts");
  const zoneSaid = el("p", { class: "note" });
  let turn = 0,
    isOtherClock = null;

  const seen = () => [...app.plant.machines.values()].filter((one) => !chosen.machine || one.name === chosen.machine);
  /** Now, by the clock that stamps what is shown: a time lapse runs ahead, a recording behind. */
  const newest = () => Math.max(...(seen().length ? seen().map((one) => Math.max(one.now(), one.lastT)) : [serverNow()]));
  const hasOtherClock = () => seen().some((one) => one.otherClock);

  async function load() {
    isOtherClock = hasOtherClock();
    const mine = ++turn,
      to = Math.round(newest()),
      base = { machine: chosen.machine || null, from: to - chosen.stretch, to };
    csv.setAttribute("href", query("figures", { ...base, by: chosen.by, format: "csv" }));
    partsCsv.setAttribute("href", query("figures", { ...base, by: "part", format: "csv" }));
    const told = async (by) => get(query("figures", { ...base, by }), { signal: stop.signal, limitMs: 30000 });
    try {
      const [main, bars, each] = await Promise.all([told(chosen.by), told(chosen.by === "machine" ? "machine" : "shift"), told("part")]);
      if (mine !== turn) return;
      const rows = list(main?.rows),
        zone = knownZone(main?.time_zone);
      setText(zoneSaid, `Times in ${zone}${zone === "UTC" ? "" : ", the time zone of the shift calendar"}.`);
      shifts.replaceChildren(...(rows.length ? [oee(rows, chosen.by, zone), notes(rows)].filter(Boolean) : [nothing(main?.note ?? "")]));
      stops.replaceChildren(...list(bars?.rows).slice(-BARS_MAX).map((row) => stopBar(row, zone)).filter(Boolean));
      made.replaceChildren(parts(list(each?.rows), zone));
    } catch (error) {
      if (error.status === -1 || mine !== turn) return;
      shifts.replaceChildren(nothing(`The server says: ${error.message}`));
      stops.replaceChildren();
      made.replaceChildren();
    }
  }
  const take = (name) => (value) => {
    chosen[name] = value;
    load();
  };
  const machines = el("select", { class: "field", "aria-label": "Machine", onchange: (event) => take("machine")(event.target.value) });
  const names = () => {
    const wanted = [ALL, ...new Set([...app.plant.names, ...(chosen.machine ? [chosen.machine] : [])])];
    if (machines.options.length === wanted.length) return;
    machines.replaceChildren(...wanted.map((name) => el("option", { value: name }, name || "All machines")));
    machines.value = chosen.machine;
  };
  names();
  const element = el(
    "div",
    { class: "view oee" },
    el(
      "div",
      { class: "head" },
      el("h1", {}, "Production figures"),
      el(
        "div",
        { class: "after" },
        choice("Rows", BYS, chosen.by, take("by")),
        choice(
          "Stretch",
          STRETCHES.map(([text, ms]) => [ms, text]),
          chosen.stretch,
          take("stretch"),
        ),
        machines,
        csv,
      ),
    ),
    zoneSaid,
    el("section", {}, el("h2", {}, "OEE, by ISO 22400-2"), shifts),
    el("section", {}, el("h2", {}, "Stops by reason"), key(), stops),
    el("section", {}, el("h2", {}, "Parts"), el("p", {}, partsCsv), made),
  );
  load();
  const update = () => {
    names();
    if (hasOtherClock() !== isOtherClock) load();
  };
  return { title: "Production figures", element, keys: [[["l"], "reload", load]], update, close: () => stop.abort() };
}
