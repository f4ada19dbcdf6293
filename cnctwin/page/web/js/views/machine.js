// One machine, live: measured beside its twin, what is between them, the score with its gate, and every signal with source and age.

import { parsed } from "../anomaly_words.js";
import { get, part, query } from "../api.js";
import { CONTEXT, SCORES, TILES, chartOf, firstOf, numbers, tileOf } from "../charted.js";
import { el, setHidden, setText } from "../dom.js";
import { atMost, onFrame, offFrame } from "../frame.js";
import { Panels } from "../panels.js";
import { addBefore } from "../past.js";
import { title } from "../text.js";
import { ANOMALY_ALARM, ANOMALY_KNOWS, ANOMALY_VERDICTS, ANOMALY_WHY } from "../vocabulary.js";
import { anomalyPanel } from "./anomaly_panel.js";
import { loopLine } from "./loop_line.js";
import { machineHead } from "./machine_head.js";
import { noMachine } from "./no_machine.js";
import { SignalTable } from "./signal_table.js";
import { ScoreTile, Tile } from "./tiles.js";
import { ToolLives } from "./tool_lives.js";

const WINDOWS = [
  [120000, "2 min"],
  [300000, "5 min"],
  [900000, "15 min"],
];

export function open(app, { machine: named, search }) {
  const name = app.pick(named);
  if (name === null) return noMachine(app, "Machine", "A machine appears as soon as its edge says that it is there.");
  const element = el("div", { class: "view machine-view" });
  const machine = app.plant.machine(name);
  machine.series.clear(); // what was kept for the fleet has holes: it is filled up again
  const head = machineHead(app, machine, "machine");
  const stop = new AbortController(),
    line = loopLine(app, name),
    anomaly = anomalyPanel(app, name, () => {}),
    filled = new Set();
  let windowMs = Number(search.get("window")) || 300000,
    asked = search.get("signal") ?? null,
    frozenAt = null;
  const panels = new Panels(machine),
    tools = new ToolLives(machine),
    table = new SignalTable(machine);
  const tiles = [...TILES.map((tile) => new Tile(machine, tile, () => pick(tile.id))), new ScoreTile(machine)];
  const select = el("select", {
    class: "field",
    id: "signal",
    "aria-label": "Signal to chart",
    onchange: () => pick(select.value),
  });
  const windows = el(
    "div",
    { class: "group", role: "group", "aria-label": "Time shown" },
    WINDOWS.map(([ms, word]) =>
      el(
        "button",
        { type: "button", class: "button", "aria-pressed": String(ms === windowMs), dataset: { ms }, onclick: () => widen(ms) },
        word,
      ),
    ),
  );
  const note = el("p", { class: "note", hidden: true });
  element.append(
    head.element,
    line.element,
    anomaly.element,
    el(
      "div",
      { class: "tiles" },
      tiles.map((tile) => tile.element),
    ),
    el(
      "div",
      { class: "charting" },
      el("label", { class: "inline" }, el("span", { class: "unseen" }, "Charted"), select),
      windows,
      note,
    ),
    panels.element,
    tools.element,
    table.element,
  );

  /** A person has chosen; else it is the first tile, as more signals become known too. */
  function pick(id) {
    asked = id;
    choose(id);
  }

  function choose(id) {
    panels.choose(chartOf(machine, id));
    for (const tile of tiles) tile.press?.(tile.tile?.id === id || tile.shown?.own === id);
    select.value = panels.charted.own;
    if (select.selectedIndex < 0) {
      select.append(el("option", { value: panels.charted.own }, title(panels.charted.own))); // charted, and without a figure
      select.value = panels.charted.own;
    }
    fill();
    draw(); // at once, so that nothing is empty for a moment
  }

  function widen(ms) {
    windowMs = ms;
    filled.clear();
    for (const button of windows.children) button.setAttribute("aria-pressed", String(Number(button.dataset.ms) === ms));
    fill();
    redraw();
  }

  /** Fills the charts up from the store with what was before we looked. */
  async function fill() {
    const wanted = [
      ...new Set([
        ...CONTEXT,
        SCORES.raw,
        SCORES.adjusted,
        ...TILES.flatMap((tile) => [...tile.own, tile.twin, tile.residual]),
        panels.charted.own,
        panels.charted.twin,
        panels.charted.residual,
      ]),
    ].filter((signal) => signal && machine.values.has(signal) && !filled.has(signal));
    if (!wanted.length) return;
    for (const signal of wanted) filled.add(signal);
    const to = Math.ceil(machine.now()),
      from = Math.floor(to - windowMs);
    try {
      const history = await get(
        query(`history/${part(name)}`, {
          signals: wanted.join(","),
          from,
          to: to + 1000,
          every_ms: windowMs > 300000 ? 1000 : windowMs > 120000 ? 500 : 200,
        }),
        { signal: stop.signal },
      );
      await addBefore(name, history.columns ?? [], from, stop.signal);
      for (const column of history.columns ?? []) machine.backfill(column);
      setHidden(note, true);
      redraw();
    } catch (error) {
      if (error.status === -1) return;
      for (const signal of wanted) filled.delete(signal);
      setText(note, `Nothing from before this page was opened: ${error.message}.`);
      setHidden(note, false);
    }
  }

  let offered = "";
  function offer() {
    const [measured, twin] = numbers(machine),
      key = [...measured, ...twin].join();
    if (key === offered) return;
    offered = key;
    const group = (label, names) =>
      names.length
        ? el(
            "optgroup",
            { label },
            names.map((signal) => el("option", { value: signal }, title(signal))),
          )
        : null;
    select.replaceChildren(...[group("Measured", measured), group("Twin", twin)].filter(Boolean));
    const shown = asked ?? firstOf(machine);
    if (shown !== null) choose(shown);
  }

  const draw = () => {
    if (!panels.charted) return;
    const live = app.stream.link === "live";
    if (live) frozenAt = null;
    else frozenAt ??= machine.now();
    const to = frozenAt ?? machine.now();
    // While less is known than the window would show, what is known fills it.
    const first = Math.min(
      ...[panels.charted.own, panels.charted.twin, SCORES.raw, "exec_state"].map(
        (signal) => machine.series.get(signal)?.first ?? Infinity,
      ),
    );
    panels.draw(Math.max(to - windowMs, Math.min(first, to - 60000)), to, live);
  };
  const redraw = atMost(10, draw);
  /** The score's reason as the stream tells it; the form is that of GET /anomaly. */
  function writeAnomaly() {
    anomaly.write({
      verdicts: parsed(machine.good(ANOMALY_VERDICTS)),
      why: parsed(machine.good(ANOMALY_WHY)),
      told: machine.value(ANOMALY_WHY)?.t,
      knows: machine.good(ANOMALY_KNOWS),
      is_alarm: machine.good(ANOMALY_ALARM),
    });
  }
  const write = () => {
    offer();
    head.write();
    writeAnomaly();
    for (const tile of tiles) tile.write();
    machine.changed.clear();
  };
  const move = setInterval(() => {
    if (app.stream.link === "live" && !document.hidden) redraw();
  }, 250);
  const tick = setInterval(() => {
    onFrame(write);
    tools.write();
    table.write();
  }, 1000);

  requestAnimationFrame(() => {
    if (element.isConnected) {
      write();
      redraw();
    }
  });
  return {
    title: name,
    element,
    machine: name,
    stream: query("stream", { machine: name }),
    update() {
      write();
      redraw();
    },
    onLink() {
      onFrame(write);
      redraw();
    },
    onAlerts: () => head.write(),
    onMe: writeAnomaly,
    onHole() {
      filled.clear();
      fill();
    },
    keys: [
      ...TILES.map((tile, i) => [
        [String(i + 1)],
        `chart ${tile.name.toLowerCase()}`,
        () => {
          if (tileOf(machine, tile)) pick(tile.id);
        },
      ]),
      [["+", "="], "less time", () => widen(WINDOWS[Math.max(0, WINDOWS.findIndex(([ms]) => ms === windowMs) - 1)][0])],
      [
        ["-"],
        "more time",
        () => widen(WINDOWS[Math.min(WINDOWS.length - 1, WINDOWS.findIndex(([ms]) => ms === windowMs) + 1)][0]),
      ],
      [["c"], "choose the signal that is charted", () => select.focus()],
      [["e"], "every signal", () => table.toggle()],
    ],
    close() {
      stop.abort();
      line.close();
      clearInterval(move);
      clearInterval(tick);
      redraw.stop();
      offFrame(write);
      panels.destroy();
    },
  };
}
