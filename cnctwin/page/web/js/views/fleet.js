// The fleet: a card for each machine, or a row where there are many. Only what changed is written, on animation frames.

import { get, part, query } from "../api.js";
import { el, setClass, setHidden, setText } from "../dom.js";
import { atMost } from "../frame.js";
import { SPARK_MS, Unit } from "./fleet_unit.js";
import { ALERT_STATE, GAP_GROWING } from "../vocabulary.js";

const CARDS_MAX = 12;

const FILTERS = [
  ["all", "All", () => true],
  ["active", "Active", (m) => m.online && m.bare("exec_state") === "ACTIVE"],
  ["still", "Not active", (m) => m.online && m.bare("exec_state") !== "ACTIVE"],
  ["alert", "Alerts", (m) => hasAlert(m)],
  ["growing", "Gap growing", (m) => m.bare(GAP_GROWING) === true],
  ["offline", "Offline", (m) => !m.online],
];

const hasAlert = (m) =>
  ["firing", "acknowledged"].includes(m.bare(ALERT_STATE)) ||
  (m.value("alarm")?.quality === "good" && Boolean(m.bare("alarm")));

function urgency(m) {
  const alert = m.bare(ALERT_STATE);
  return (
    (alert === "firing" ? 8 : alert === "acknowledged" ? 4 : 0) +
    (m.online ? 0 : 3) +
    (m.bare(GAP_GROWING) === true ? 2 : 0) +
    (["STOPPED", "INTERRUPTED", "FEED_HOLD", "PROGRAM_STOPPED"].includes(m.bare("exec_state")) ? 1 : 0)
  );
}

export function open(app) {
  for (const machine of app.plant.machines.values()) machine.series.clear(); // while we looked elsewhere nothing was heard
  const units = new Map();
  let filter = "all",
    order = "name",
    text = "",
    sorted = "";
  const list = el("ul", { class: "fleet" });
  const heads = el(
    "div",
    { class: "fleet-heads", "aria-hidden": "true" },
    ["Machine", "Program and tool", "Load", "Speed", "Score", "Gap", "Load, last 2 min", ""].map((word) => el("span", {}, word)),
  );
  const nothing = el("div", { class: "empty", hidden: true });
  const chips = new Map(
    FILTERS.map(([name, word]) => {
      const count = el("span", { class: "count" }, "0");
      return [
        name,
        {
          count,
          button: el(
            "button",
            { type: "button", class: "button", "aria-pressed": String(name === filter), onclick: () => choose(name) },
            word,
            count,
          ),
        },
      ];
    }),
  );
  const find = el("input", {
    class: "field find",
    type: "search",
    placeholder: "Find",
    "aria-label": "Find a machine or program",
    "aria-keyshortcuts": "/",
    oninput: () => {
      text = find.value.trim().toLowerCase();
      arrange();
    },
  });
  const sort = el(
    "select",
    {
      class: "field",
      "aria-label": "Order",
      onchange: () => {
        order = sort.value;
        sorted = "";
        arrange();
      },
    },
    el("option", { value: "name" }, "by name"),
    el("option", { value: "attention" }, "attention first"),
  );
  const element = el(
    "div",
    { class: "view fleet-view" },
    el(
      "div",
      { class: "head" },
      el("h1", {}, "Fleet"),
      el(
        "div",
        { class: "filters", role: "group", "aria-label": "Show" },
        [...chips.values()].map(({ button }) => button),
      ),
      el("div", { class: "after" }, find, sort),
    ),
    heads,
    list,
    nothing,
  );

  function choose(name) {
    filter = name;
    for (const [key, { button }] of chips) button.setAttribute("aria-pressed", String(key === name));
    arrange();
  }

  /** Choose the machines that are shown, and their order; moves an element only where its place is another one. */
  function arrange() {
    const machines = [...app.plant.machines.values()];
    for (const [name, unit] of units)
      if (app.plant.machines.get(name) !== unit.machine) {
        unit.element.remove();
        units.delete(name);
      }
    for (const machine of machines) if (!units.has(machine.name)) units.set(machine.name, new Unit(app, machine));
    const matches = FILTERS.find(([name]) => name === filter)[2];
    const named = app.plant.names.map((name) => app.plant.machines.get(name));
    const ordered =
      order === "name"
        ? named
        : named
            .map((m) => [urgency(m), m])
            .sort((a, b) => b[0] - a[0])
            .map(([, m]) => m);
    let visible = 0;
    const key = ordered.map((m) => m.name).join("\n");
    for (const m of ordered) {
      const unit = units.get(m.name);
      const hidden = !matches(m) || (text && !`${m.name} ${m.bare("program") ?? ""}`.toLowerCase().includes(text));
      setHidden(unit.element, Boolean(hidden));
      visible += !hidden;
      if (key !== sorted) list.append(unit.element);
    }
    sorted = key;
    for (const [name, , test] of FILTERS) {
      const count = machines.filter(test).length,
        chip = chips.get(name);
      setText(chip.count, String(count));
      setHidden(chip.button, count === 0 && name !== "all" && name !== filter);
    }
    setClass(list, "cards", machines.length <= CARDS_MAX);
    setClass(list, "rows", machines.length > CARDS_MAX);
    setClass(list, "few", machines.length <= 2);
    setHidden(heads, machines.length <= CARDS_MAX);
    setHidden(nothing, visible > 0);
    if (!visible) tellNothing(machines.length);
  }

  function tellNothing(count) {
    if (app.stream.link === "connecting") {
      nothing.replaceChildren(el("p", {}, "Waiting for the server …"));
      return;
    }
    nothing.replaceChildren(
      ...(count
        ? [el("h2", {}, "No machine matches"), el("p", {}, "Another filter shows the others.")]
        : [
            el("h2", {}, "No machine yet"),
            el("p", {}, "A machine appears here as soon as its edge says that it is there. To see one that is simulated:"),
            el("pre", {}, "cnctwin demo"),
            el(
              "p",
              {},
              "To connect one of yours, give its edge this broker; ",
              el("code", {}, "cnctwin doctor"),
              " says what is missing.",
            ),
          ]),
    );
  }

  const rearrange = atMost(1, arrange);
  function write() {
    let appeared = false;
    for (const machine of app.plant.machines.values()) {
      const unit = units.get(machine.name);
      if (!unit || unit.machine !== machine) {
        appeared = true;
        continue;
      }
      if (machine.changed.size) {
        machine.changed.clear();
        unit.write();
      }
    }
    if (appeared || units.size !== app.plant.machines.size) {
      arrange();
      fill();
    } else rearrange();
  }

  // The load before we looked: asked for one machine after the other.
  const stop = new AbortController(),
    filled = new Set();
  async function fill() {
    for (const unit of [...units.values()]) {
      if (stop.signal.aborted || filled.has(unit.machine)) continue;
      filled.add(unit.machine);
      const to = Math.ceil(unit.machine.now());
      try {
        const history = await get(
          query(`history/${part(unit.machine.name)}`, {
            signals: "spindle_load_pct,twin/tool_change_gate",
            from: to - SPARK_MS,
            to: to + 1000,
            every_ms: 1000,
          }),
          { signal: stop.signal, limitMs: 15000 },
        );
        for (const column of history.columns ?? []) unit.machine.backfill(column);
        unit.spark();
      } catch {
        /* the line begins where we began to look */
      }
    }
  }

  // Each line of load is painted once a second, a few of them at a time.
  let next = 0;
  const painter = setInterval(() => {
    if (document.hidden || app.stream.link !== "live") return;
    const all = [...units.values()],
      each = Math.ceil(all.length / 10);
    for (let i = 0; i < each && all.length; i++) {
      const unit = all[next++ % all.length];
      if (!unit.element.hidden) unit.spark();
    }
  }, 100);
  const again = setInterval(() => {
    for (const unit of units.values()) if (!unit.machine.online) unit.write();
    arrange();
  }, 5000);

  function move(key) {
    const shown = [...list.children].filter((item) => !item.hidden).map((item) => item.firstChild);
    const at = shown.indexOf(document.activeElement);
    const columns = list.classList.contains("cards")
      ? Math.max(1, shown.filter((one) => one.offsetTop === shown[0].offsetTop).length)
      : 1;
    const step = { ArrowDown: columns, ArrowUp: -columns, ArrowRight: 1, ArrowLeft: -1 }[key];
    const to =
      key === "Home" ? 0 : key === "End" ? shown.length - 1 : at < 0 ? 0 : Math.min(Math.max(at + step, 0), shown.length - 1);
    shown[to]?.focus();
  }

  arrange();
  fill();
  return {
    title: "Fleet",
    element,
    stream: "stream",
    keys: [
      [["/"], "find a machine or program", () => find.focus()],
      [["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Home", "End"], "from machine to machine; Enter opens it", move],
      [
        ["s"],
        "order: by name, or what needs attention first",
        () => {
          sort.value = sort.value === "name" ? "attention" : "name";
          sort.dispatchEvent(new Event("change"));
        },
      ],
      ...FILTERS.map(([name, word], i) => [[String(i + 1)], `show: ${word.toLowerCase()}`, () => choose(name)]),
    ],
    update: write,
    onLink: () => arrange(),
    onHole() {
      filled.clear();
      fill();
    },
    close() {
      stop.abort();
      clearInterval(painter);
      clearInterval(again);
      rearrange.stop();
    },
  };
}
