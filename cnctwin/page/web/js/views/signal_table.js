// Every signal of a machine: its value, where it comes from, how old it is, and why it is null. Written once a second while it is open.

import { columnHead, el, setClass, setText } from "../dom.js";
import { onFrame } from "../frame.js";
import { age, moment } from "../text.js";
import { TWIN_PREFIX } from "../vocabulary.js";
import { worded } from "../worded.js";

const LONG = 120;

export class SignalTable {
  constructor(machine) {
    this.machine = machine;
    this.rows = new Map();
    this.body = el("tbody");
    this.count = el("span", { class: "quiet" });
    const heads = ["Signal", "Value", "From", "Age", "Quality and reason"];
    this.element = el(
      "details",
      { class: "block signals", ontoggle: () => this.write() },
      el("summary", {}, "Every signal ", this.count),
      el(
        "div",
        { class: "scroll", tabindex: "0", role: "region", "aria-label": "Every signal" },
        el(
          "table",
          {},
          el(
            "thead",
            {},
            el(
              "tr",
              {},
              heads.map((text, i) => columnHead(text, i === 1)),
            ),
          ),
          this.body,
        ),
      ),
    );
  }

  toggle() {
    this.element.open = !this.element.open;
    if (this.element.open) this.element.scrollIntoView({ block: "start" });
  }

  write() {
    onFrame(() => {
      setText(this.count, ` (${this.machine.values.size})`);
      if (this.element.open) this.#write();
    });
  }

  #write() {
    for (const signal of [...this.machine.values.keys()].sort(
      (a, b) => Number(a.startsWith(TWIN_PREFIX)) - Number(b.startsWith(TWIN_PREFIX)) || a.localeCompare(b),
    )) {
      const held = this.machine.value(signal);
      let row = this.rows.get(signal);
      if (!row) {
        const cells = {
          value: el("td", { class: "number" }),
          from: el("span", { class: "from" }),
          age: el("td", {}),
          quality: el("td"),
        };
        row = {
          ...cells,
          element: el(
            "tr",
            {},
            el("th", { scope: "row" }, el("code", { title: held.meaning ?? "" }, signal)),
            cells.value,
            el("td", {}, cells.from),
            cells.age,
            cells.quality,
          ),
        };
        this.rows.set(signal, row);
        this.body.append(row.element);
      }
      const text = worded(held.value, held.unit);
      row.value.title = text.length > LONG ? text : "";
      setText(
        row.value,
        `${text.length > LONG ? `${text.slice(0, LONG)} …` : text}${held.unit && held.value !== null ? ` ${held.unit}` : ""}`,
      );
      if (row.from.dataset.from !== held.provenance) {
        row.from.dataset.from = held.provenance;
        row.from.textContent = held.provenance;
      }
      const stale = held.quality === "stale" || (!this.machine.online && !signal.startsWith(TWIN_PREFIX));
      setText(row.age, stale ? `stale since ${moment(held.staleSince ?? held.t)}` : age(this.machine.now() - held.t));
      setText(row.quality, held.reason ? `${held.quality}: ${held.reason}` : held.quality);
      setClass(row.element, "stale", stale);
    }
  }
}
