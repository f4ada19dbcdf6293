// The panels of one machine over time: what is measured beside its twin, what is between them, the score, states and tools.

import { Chart, aligned } from "./chart.js";
import { SCORES, difference, line, stretches, toolMarks, unknown } from "./charted.js";
import { el, setHidden, setText } from "./dom.js";
import { Strip, stateItems, toolItems } from "./strip.js";
import { SUPPRESSION_MEANS, moment, number, title } from "./text.js";
import { TOOL_CHANGE_GATE, TWIN_PREFIX } from "./vocabulary.js";

let count = 0;

export class Panels {
  constructor(machine, { lanes = [] } = {}) {
    this.machine = machine;
    this.sync = `panels-${++count}`;
    this.extra = lanes;
    this.cursor = null;
    const [tall, low, last] = innerHeight < 960 ? [150, 66, 104] : [220, 112, 150];
    this.main = this.#panel("own", tall);
    this.rest = this.#panel("rest", low);
    this.score = this.#panel("score", last);
    this.strip = new Strip(["state", "tool", ...lanes], "Execution states and tools over the same time");
    this.element = el(
      "div",
      { class: "panels livedata" },
      this.main.figure,
      this.rest.figure,
      this.score.figure,
      this.strip.element,
      el(
        "div",
        { class: "keyrow" },
        el("span", { class: "key gate", title: SUPPRESSION_MEANS }, "suppression window (tool change)"),
        el("span", { class: "key tool" }, "tool"),
        el("span", { class: "key old" }, "nothing known"),
      ),
    );
    this.stripAt = 0;
  }

  #panel(name, height) {
    const host = el("div", { class: "plot" }),
      told = el("figcaption"),
      why = el("p", { class: "why", hidden: true });
    return { name, height, host, told, why, figure: el("figure", { class: `panel ${name}` }, told, host, why), chart: null };
  }

  #caption(panel, name, keys) {
    panel.read = el("span", { class: "read" });
    panel.told.replaceChildren(
      el("span", { class: "name" }, name),
      ...keys.map(([kind, word]) => el("span", { class: `key ${kind}` }, word)),
      panel.read,
    );
  }

  #chart(panel, options) {
    panel.chart?.destroy();
    panel.host.replaceChildren();
    panel.chart = new Chart(panel.host, {
      height: panel.height,
      sync: this.sync,
      axis: false,
      onCursor: (t) => {
        this.cursor = t;
      },
      ...options,
    });
  }

  /** Sets up the panels for what is charted; where that is what they show already, they stay as they are. */
  choose(charted) {
    const key = [charted.own, charted.twin, charted.residual, charted.learned, this.machine.value(charted.own)?.unit].join();
    if (key === this.chosen) return;
    this.chosen = key;
    this.charted = charted;
    const { machine } = this,
      unit = machine.value(charted.own)?.unit ?? machine.value(charted.twin)?.unit ?? "",
      isTwinOnly = charted.own.startsWith(TWIN_PREFIX);
    const commanded = charted.twinIs === "commanded";
    this.unit = unit;
    const lines = [{ label: charted.name, colour: isTwinOnly ? "after" : "ink", width: 2 }];
    const keys = [
      [isTwinOnly ? "twin" : "own", isTwinOnly ? (machine.value(charted.own)?.provenance ?? "inferred") : "measured"],
    ];
    if (charted.twin) {
      lines.push({ label: charted.twinIs, colour: "after", width: commanded ? 1.5 : 2, dash: commanded ? [6, 4] : undefined });
      keys.push([commanded ? "commanded" : "twin", commanded ? "commanded" : "twin"]);
    }
    if (charted.learned) {
      lines.push({ label: "with what was learned", colour: "after", width: 1.5, dash: [2, 3] });
      keys.push(["learned", "twin with what was learned"]);
    }
    this.#caption(this.main, `${charted.name}${unit ? `, ${unit}` : ""}`, keys);
    this.#chart(this.main, { lines, roof: true, label: `${charted.name} over time` });
    setHidden(this.rest.figure, !charted.twin);
    if (charted.twin) {
      const restUnit = charted.residual ? (machine.value(charted.residual)?.unit ?? unit) : unit;
      this.restUnit = restUnit;
      this.#caption(this.rest, `Measured − ${charted.twinIs}${restUnit ? `, ${restUnit === "°C" ? "K" : restUnit}` : ""}`, [
        ["gap", charted.residual ? "as published" : "worked out here"],
      ]);
      this.#chart(this.rest, {
        lines: [{ label: "residual", colour: "before", width: 2, fill: true }],
        zero: true,
        label: `Measured minus ${charted.twinIs} over time`,
      });
    }
    if (!this.score.chart) {
      this.#caption(this.score, "Anomaly score", [
        ["twin", "adjusted"],
        ["raw", "raw"],
        ["limit", "threshold"],
      ]);
      this.#chart(this.score, {
        lines: [
          { label: "raw", colour: "measured", width: 1.5, dash: [2, 3] },
          { label: "adjusted", colour: "after", width: 2 },
        ],
        zero: true,
        axis: true,
        label: "Raw and adjusted anomaly score over time",
      });
    }
  }

  /** Draws [from, to]. live: values hold until `to`, or until the newest moment that is known; lanes: items of the further lanes of
   * the strip. */
  draw(from, to, live, lanes = []) {
    const { machine, charted } = this,
      range = [from, to];
    const end = Math.min(to, machine.online ? machine.knownUntil() : (machine.offlineSince ?? to));
    const gates = stretches(machine, TOOL_CHANGE_GATE, from, end).filter(([, , on]) => on === true);
    const tools = toolMarks(machine, from, end);
    const holds = live && machine.online ? end : -Infinity;
    const own = line(machine, charted.own, from, to, holds),
      stale = charted.own.startsWith(TWIN_PREFIX) ? [] : unknown(own, end);
    if (end < to) stale.push([Math.max(from, end), to]);
    const marks = { gates, tools, stale };
    const twin = charted.twin ? line(machine, charted.twin, from, to, holds) : null;
    const learned = charted.learned ? line(machine, charted.learned, from, to, holds) : null;
    this.main.chart.show(aligned([own, twin, learned].filter(Boolean)), range, marks);
    if (twin)
      this.rest.chart.show(
        aligned([charted.residual ? line(machine, charted.residual, from, to, holds) : difference(own, twin)]),
        range,
        { ...marks, tools: [] },
      );
    const raw = line(machine, SCORES.raw, from, to, holds),
      adjusted = line(machine, SCORES.adjusted, from, to, holds);
    const threshold = machine.bare(SCORES.threshold);
    this.score.chart.show(aligned([raw, adjusted]), range, {
      gates,
      tools: [],
      stale: [],
      threshold: typeof threshold === "number" ? threshold : null,
    });
    this.#why();
    this.#read();
    if (performance.now() - this.stripAt > 450) {
      this.stripAt = performance.now();
      this.strip.show(
        [
          [
            ...stateItems(stretches(machine, "exec_state", from, end)),
            ...(machine.online ? [] : [{ from: end, to, text: "Offline", kind: "offline" }]),
          ],
          toolItems(stretches(machine, "tool_number", from, end), stretches(machine, TOOL_CHANGE_GATE, from, end)),
          ...lanes,
        ],
        from,
        to,
      );
    }
  }

  /** A panel that is empty says why. */
  #why() {
    const reasonOf = (signal) => {
      const held = this.machine.value(signal);
      if (!held) return `${title(signal)}: not offered by this machine`;
      return held.value === null ? `${title(signal)}: ${held.reason ?? "no value, and no reason was given"}` : "";
    };
    const shown = [
      [this.main, [this.charted.own, this.charted.twin]],
      [this.rest, [this.charted.residual ?? this.charted.own]],
      [this.score, [SCORES.raw]],
    ];
    for (const [panel, signals] of shown) {
      const text = signals.filter(Boolean).map(reasonOf).filter(Boolean).join(" · ");
      setHidden(panel.why, !text);
      setText(panel.why, text);
    }
  }

  #read() {
    const write = (panel, texts) => {
      if (panel.read) setText(panel.read, this.cursor === null ? "" : `${moment(this.cursor)}  ${texts()}`);
    };
    const at = (panel, index) => {
      const [times, ...columns] = panel.chart.data,
        column = columns[index];
      let i = times.length - 1;
      while (i >= 0 && times[i] > this.cursor) i--;
      while (i >= 0 && column[i] === undefined) i--;
      return i >= 0 && column[i] !== null ? column[i] : NaN;
    };
    write(this.main, () =>
      this.charted.twin
        ? `${number(at(this.main, 0), this.unit)} · ${this.charted.twinIs} ${number(at(this.main, 1), this.unit)} ${this.unit}`
        : `${number(at(this.main, 0), this.unit)} ${this.unit}`,
    );
    if (this.charted.twin) write(this.rest, () => `${number(at(this.rest, 0), this.restUnit)}`);
    write(this.score, () => `raw ${number(at(this.score, 0))} · adjusted ${number(at(this.score, 1))}`);
  }

  /** The moment that is looked at, on all panels. */
  pointAt(t) {
    for (const panel of [this.main, this.rest, this.score]) if (!panel.figure.hidden) panel.chart?.pointAt(t);
  }

  /** Calls `act` with the time where somebody taps a panel. */
  onTap(act) {
    for (const panel of [this.main, this.rest, this.score]) {
      panel.host.addEventListener("click", (event) => {
        const plot = panel.chart?.plot,
          over = plot?.over;
        if (!over) return;
        const left = event.clientX - over.getBoundingClientRect().left;
        if (left >= 0 && left <= over.clientWidth) act(plot.posToVal(left, "x"));
      });
    }
  }

  destroy() {
    for (const panel of [this.main, this.rest, this.score]) panel.chart?.destroy();
  }
}
