// The processors run again over a stretch, and whether they give what they published then.

import { post } from "../api.js";
import { el, symbol, table } from "../dom.js";
import { moment, number, plain, words } from "../text.js";

const LIMIT_MS = 120000;
const LONG = 60; // characters of a text that are shown
const SHOWN_MAX = 20;

export class Recompute {
  /** stretch: gives [from, to] of what is looked at */
  constructor(name, stretch, signal) {
    Object.assign(this, { name, stretch, signal });
    this.button = el("button", { type: "button", class: "button", onclick: () => this.run() }, "Recompute and compare");
    this.verdict = el("div", { role: "status" });
    this.element = el("div", { class: "recompute" }, this.button, this.verdict);
  }

  clear() {
    this.verdict.replaceChildren();
  }

  async run() {
    const [from, to] = this.stretch();
    this.button.disabled = true;
    this.verdict.replaceChildren(el("p", { class: "waiting" }, "Running the processors over the stored messages …"));
    try {
      const found = await post("twin/replay", { machine: this.name, from, to }, { signal: this.signal, limitMs: LIMIT_MS });
      this.verdict.replaceChildren(
        ...[verdict(found), took(found), processors(found.processors ?? []), differences(found.differences ?? [])].filter(
          Boolean,
        ),
      );
    } catch (error) {
      if (error.status !== -1)
        this.verdict.replaceChildren(el("p", { class: "trouble" }, `It cannot be recomputed: ${error.message}.`));
    } finally {
      this.button.disabled = false;
    }
  }
}

function verdict(found) {
  if (!found.compared)
    return el(
      "p",
      { class: "equal" },
      symbol("s-pending"),
      "Nothing was published in this stretch, so there is nothing to compare.",
    );
  const differing = found.differences?.length ?? "some";
  const text = found.equal
    ? `The same: ${found.compared} values, bit for bit.`
    : `Not the same: ${differing} of ${found.compared} values differ.`;
  return el("p", { class: `equal ${found.equal ? "yes" : "no"}` }, symbol(found.equal ? "s-ack" : "s-alert"), text);
}

function took(found) {
  const texts = [];
  if (Number.isFinite(found.seconds)) texts.push(`${number(found.seconds)} s`);
  if (Number.isFinite(found.speed)) texts.push(`${Math.round(found.speed)} times real time`);
  return texts.length ? el("p", { class: "note" }, texts.join(", ")) : null;
}

/** A table of what each processor gave again. */
function processors(ran) {
  const rows = ran.map((one) => [
    words(one.name),
    ...["same", "differing", "missing", "extra"].map((key) => plain(one[key])),
    [one.start, ...(one.notes ?? [])].filter(Boolean).join("; "),
  ]);
  return rows.length
    ? table(["Processor", "Same", "Differing", "Missing", "Extra", "Began"], rows, {
        numbers: [1, 2, 3, 4],
        label: "What each processor gave again",
      })
    : null;
}

/** Two texts, long ones only about the place where they first differ. */
function apart(then, now) {
  if (Math.max(then.length, now.length) <= LONG) return [then, now];
  let at = 0;
  while (at < then.length && then[at] === now[at]) at += 1;
  const about = (text) => {
    const from = Math.max(at - LONG / 2, 0),
      to = from + LONG;
    return el("span", { title: text }, `${from > 0 ? "…" : ""}${text.slice(from, to)}${to < text.length ? "…" : ""}`);
  };
  return [about(then), about(now)];
}

function differences(found) {
  const rows = found
    .slice(0, SHOWN_MAX)
    .map((one) => [el("code", {}, one.signal), moment(one.t), ...apart(plain(one.published), plain(one.recomputed))]);
  return rows.length
    ? table(["Signal", "When", "Published then", "Recomputed"], rows, { numbers: [2, 3], label: "Differences" })
    : null;
}
