// The tools of a machine: how far each is worn, how many parts are left of it with their band, and why a figure is missing.

import { columnHead, el, setHidden, setText } from "../dom.js";
import { onFrame } from "../frame.js";
import { coarse } from "../text.js";
import { MACHINE_DRIFT, MACHINE_DRIFT_BASIS, TOOL_LIVES } from "../vocabulary.js";

const TOOLS_MAX = 40;
const HEADS = ["Tool", "Parts", "Wear, %", "Parts left", "90 %", ""];
const NUMBERS = 5;
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
              HEADS.map((text, i) => columnHead(text, i < NUMBERS)),
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
      if (!this.element.open || text === this.text) return;
      this.text = text;
      this.body.replaceChildren(...rowsOf(text).map((row) => this.#row(row)));
    });
  }

  #row(row) {
    const cells = [String(row.tool), shown(row.parts), shown(row.wear_pct), shown(row.parts_left), band(row.parts_left_band)];
    const why = row.is_fast === true ? "wears far faster than its lives before" : (row.reason ?? "");
    return el(
      "tr",
      { title: String(row.basis ?? "") },
      cells.map((text) => el("td", { class: "number" }, text)),
      el("td", { class: row.is_fast === true ? "grow" : "why" }, String(why)),
    );
  }
}
