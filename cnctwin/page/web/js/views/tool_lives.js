// The tools of a machine: how far each is worn, how many parts are left of it with their band, what the control itself has counted
// of the one in the spindle, and why a figure is missing.

import { el, setHidden, setText } from "../dom.js";
import { onFrame } from "../frame.js";
import { coarse } from "../text.js";
import { MACHINE_DRIFT, MACHINE_DRIFT_BASIS, TOOL_LIVES } from "../vocabulary.js";

const TOOLS_MAX = 40;
const HEADS = ["Tool", "Parts", "Wear, %", "Parts left", "90 %", "Control counts", ""];
const NUMBERS = 6;
const COUNTS = [
  ["tool_life_used_min", "tool_life_limit_min", "min"],
  ["tool_life_used_count", "tool_life_limit_count", "uses"],
];
const tenths = (value) => String(Number(value.toFixed(1)));
const shown = (value) => (Number.isFinite(value) ? coarse(value) : "–");
const band = (ends) =>
  Array.isArray(ends) && ends.every(Number.isFinite) ? `${Math.round(ends[0])} to ${Math.round(ends[1])}` : "–";

/** The rows of `twin/tool_lives`; what is not such a list has none. */
export function rowsOf(text) {
  try {
    const rows = JSON.parse(text);
    return Array.isArray(rows) ? rows.filter((row) => row && typeof row === "object").slice(0, TOOLS_MAX) : [];
  } catch {
    return [];
  }
}

/** What the control counts of the tool in the spindle, such as "18.5 of 60 min"; "" where it does not tell. */
export function countOf(good) {
  const told = COUNTS.filter(([used]) => Number.isFinite(good(used)));
  return told
    .map(([used, limit, unit]) => {
      const most = good(limit);
      return `${tenths(good(used))}${Number.isFinite(most) ? ` of ${tenths(most)}` : ""} ${unit}`;
    })
    .join(", ");
}

export class ToolLives {
  constructor(machine) {
    this.machine = machine;
    this.text = null;
    this.body = el("tbody");
    this.drift = el("p", { class: "note", hidden: true });
    this.element = el(
      "details",
      { class: "block tools", hidden: true, ontoggle: () => this.write() },
      el("summary", {}, "Tools"),
      this.drift,
      el(
        "div",
        { class: "scroll", tabindex: "0", role: "region", "aria-label": "Tools" },
        el(
          "table",
          {},
          el(
            "thead",
            {},
            el(
              "tr",
              {},
              HEADS.map((text, i) => el("th", { scope: "col", class: i < NUMBERS ? "number" : null }, text)),
            ),
          ),
          this.body,
        ),
      ),
    );
  }

  write() {
    onFrame(() => {
      const text = this.machine.good(TOOL_LIVES);
      setHidden(this.element, typeof text !== "string");
      const drifts = this.machine.good(MACHINE_DRIFT) === true;
      setHidden(this.drift, !drifts);
      if (drifts) setText(this.drift, String(this.machine.good(MACHINE_DRIFT_BASIS) ?? ""));
      const count = countOf((name) => this.machine.good(name));
      const inSpindle = count ? String(this.machine.good("tool_number") ?? "") : "";
      const all = `${inSpindle} ${count} ${text}`;
      if (!this.element.open || all === this.text) return;
      this.text = all;
      this.body.replaceChildren(...rowsOf(text).map((row) => this.#row(row, String(row.tool) === inSpindle ? count : "–")));
    });
  }

  #row(row, count) {
    const figures = [shown(row.parts), shown(row.wear_pct), shown(row.parts_left), band(row.parts_left_band)];
    const cells = [String(row.tool), ...figures, count];
    const why = row.is_fast === true ? "wears far faster than its lives before" : (row.reason ?? "");
    return el(
      "tr",
      { title: String(row.basis ?? "") },
      cells.map((text) => el("td", { class: "number" }, text)),
      el("td", { class: row.is_fast === true ? "grow" : "why" }, String(why)),
    );
  }
}
