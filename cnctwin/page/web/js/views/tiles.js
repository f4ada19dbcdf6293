// A tile: what is measured, large; its twin and what is between the two below; where each comes from, and how old it is.

import { tileOf, SCORES } from "../charted.js";
import { el, setClass, setData, setHidden, setText, setTitle } from "../dom.js";
import { age, between, fixed, moment, number, signed } from "../text.js";
import { COMMON_MODE, TOOL_CHANGE_GATE } from "../vocabulary.js";

const OLD_MS = 10000;

/** The age of a figure, where that is worth a word: a value that does not change is not sent again, so age alone is no fault. */
function agedText(machine, held) {
  if (!held || !Number.isFinite(held.t)) return "";
  const ms = machine.now() - held.t;
  if (held.quality === "stale" || !machine.online) return `stale since ${moment(held.staleSince ?? held.t)}`;
  return ms < OLD_MS ? age(ms) : `for ${age(ms)}`;
}

function where(held) {
  const element = el("span", { class: "from" });
  return {
    element,
    write: (provenance) => {
      if (provenance && element.dataset.from !== provenance) {
        element.dataset.from = provenance;
        element.textContent = provenance;
      }
      setHidden(element, !provenance);
    },
    held,
  };
}

/** A figure below the large one. The mark before its word says where it comes from; so does its word, where it is a twin's. */
class Line {
  constructor(word) {
    this.own = word;
    this.said = el("span", {}, word);
    this.more = el("span", { class: "more" });
    this.word = el("span", { class: "from" }, this.said, this.more);
    this.figure = el("span", { class: "figure" });
    this.element = el("div", { class: "line" }, this.word, this.figure);
  }

  /** unit: that of the large figure, which is not said again. */
  write(machine, signal, format, { provenance = null, unit = null } = {}) {
    const held = machine.value(signal);
    setHidden(this.element, !held);
    if (!held) return;
    setText(
      this.figure,
      held.value === null ? "–" : `${format(held.value, held.unit)}${held.unit && held.unit !== unit ? ` ${held.unit}` : ""}`,
    );
    setTitle(this.figure, held.value === null ? (held.reason ?? "") : (held.meaning ?? ""));
    setData(this.word, "from", provenance ?? held.provenance);
    setText(this.said, provenance ?? this.own);
    const old = held.quality !== "good" && held.value !== null;
    setText(this.more, old ? `(${held.quality}: not live)` : this.own === "twin" && !provenance ? `(${held.provenance})` : "");
    setClass(this.figure, "old", held.quality !== "good");
  }
}

export class Tile {
  constructor(machine, tile, choose) {
    this.machine = machine;
    this.tile = tile;
    this.figure = el("span", { class: "figure" });
    this.unit = el("span", { class: "unitname" });
    this.from = where();
    this.aged = el("span", { class: "aged" });
    this.why = el("span", { class: "why", hidden: true });
    this.twin = new Line("twin");
    this.learned = new Line("learned too");
    this.learned.word.title = "the twin, corrected by what a model learned of its errors; inferred";
    this.rest = new Line("gap");
    this.rest.element.classList.add("rest");
    this.rest.word.title = "measured minus twin";
    this.element = el(
      "button",
      { type: "button", class: "tile livedata", "aria-pressed": "false", onclick: choose },
      el("span", { class: "name" }, tile.name),
      el("span", { class: "big" }, this.figure, this.unit),
      el("span", { class: "origin" }, this.from.element, this.aged),
      this.why,
      this.twin.element,
      this.learned.element,
      this.rest.element,
    );
    this.element.dataset.tile = tile.id;
  }

  press(on) {
    this.element.setAttribute("aria-pressed", String(on));
  }

  write() {
    const { machine } = this,
      shown = (this.shown = tileOf(machine, this.tile));
    setHidden(this.element, !shown);
    if (!shown) return;
    const held = machine.value(shown.own);
    const number_ = held && typeof held.value === "number";
    setText(this.figure, number_ ? number(held.value, held.unit) : "–");
    setText(this.unit, held?.unit ?? "");
    setTitle(this.figure, held?.meaning ?? "");
    this.from.write(held?.provenance ?? null);
    setText(this.aged, number_ ? agedText(machine, held) : "");
    const why = !held
      ? "not offered by this machine"
      : number_
        ? held.quality === "good"
          ? ""
          : (held.reason ?? "")
        : (held.reason ?? "no value, and no reason was given");
    setText(this.why, why);
    setTitle(this.why, why);
    setHidden(this.why, !why);
    setClass(this.element, "stale", Boolean(held) && (held.quality === "stale" || !machine.online));
    if (shown.twin)
      this.twin.write(machine, shown.twin, number, {
        provenance: shown.twinIs === "commanded" ? "commanded" : null,
        unit: held?.unit,
      });
    else setHidden(this.twin.element, true);
    if (shown.learned) this.learned.write(machine, shown.learned, number, { unit: held?.unit });
    else setHidden(this.learned.element, true);
    this.#rest(shown, held);
  }

  /** What is between the two figures that are shown. The twin's own residual is of the moment at which it last changed by enough
   * to be told, and stands here only where one of the two is not known. */
  #rest(shown, held) {
    const twin = shown.twin && shown.twinIs === "twin" ? this.machine.value(shown.twin) : null;
    const both = typeof twin?.value === "number" && typeof held?.value === "number";
    if (shown.residual && !both) {
      this.rest.write(this.machine, shown.residual, signed);
      return;
    }
    setHidden(this.rest.element, !both);
    if (!both) return;
    setText(this.rest.figure, between(held, twin));
    setText(this.rest.more, "");
    setData(this.rest.word, "from", "inferred");
    setClass(this.rest.figure, "old", twin.quality !== "good" || held.quality !== "good");
  }
}

export class ScoreTile {
  constructor(machine) {
    this.machine = machine;
    this.figure = el("span", { class: "figure" });
    this.from = where();
    this.aged = el("span", { class: "aged" });
    this.why = el("span", { class: "why", hidden: true });
    this.raw = new Line("raw");
    this.threshold = new Line("threshold");
    this.element = el(
      "div",
      { class: "tile scoretile livedata" },
      el("span", { class: "name" }, "Adjusted score"),
      el("span", { class: "big" }, this.figure),
      el("span", { class: "origin" }, this.from.element, this.aged),
      this.why,
      this.raw.element,
      this.threshold.element,
    );
  }

  write() {
    const { machine } = this,
      held = machine.value(SCORES.adjusted),
      raw = machine.value(SCORES.raw);
    const three = (value) => fixed(value, 3);
    setHidden(this.element, !held && !raw);
    if (!held && !raw) return;
    const known = held && typeof held.value === "number";
    setText(this.figure, known ? three(held.value) : "–");
    this.from.write(held?.provenance ?? raw?.provenance);
    const gated = machine.bare(TOOL_CHANGE_GATE) === true,
      isCommon = machine.bare(COMMON_MODE) === true;
    setText(
      this.aged,
      !known
        ? ""
        : held.quality === "stale" || !machine.online
          ? agedText(machine, held)
          : gated
            ? "not judged: suppression window"
            : isCommon
              ? "the peers explain it"
              : agedText(machine, held),
    );
    setText(this.why, known ? "" : (held?.reason ?? raw?.reason ?? "no score yet"));
    setHidden(this.why, known);
    this.raw.write(machine, SCORES.raw, three);
    this.threshold.write(machine, SCORES.threshold, three);
    if (this.raw.element.hidden === false && raw?.value === null) setHidden(this.raw.element, true);
    if (machine.bare(SCORES.threshold) === null) setHidden(this.threshold.element, true);
    const limit = machine.bare(SCORES.threshold);
    setClass(this.element, "over", known && typeof limit === "number" && held.value >= limit);
    setClass(this.element, "stale", Boolean(held) && (held.quality === "stale" || !machine.online));
  }
}
