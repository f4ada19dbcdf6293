// The events of a stretch: from the server's events, or read off the signals where it has none. As a list and as a lane of marks.

import { get, part, query } from "../api.js";
import { el, table } from "../dom.js";
import { lookup } from "../lookup.js";
import { Steps } from "../ring.js";
import { duration, execution, moment } from "../text.js";

const EVENTS_MAX = 500;
const QUIET_MAX = 60;
const KINDS = lookup({
  hole: "hole",
  alarm: "high",
  alert: "high",
  stop: "high",
  pin: "event",
  description: "event",
  description_fault: "high",
});

export class Happenings {
  /** seek: is called with the time of an event that was chosen */
  constructor(seek) {
    this.seek = seek;
    this.events = [];
    this.descriptions = [];
    this.element = el("div", {}, el("p", { class: "waiting" }, "Loading …"));
  }

  async load(past, from, to, signal) {
    let reason = "";
    this.descriptions = [];
    try {
      const found = await get(query(`events/${part(past.name)}`, { from, to }), { signal, limitMs: 30000 });
      this.events = (found.events ?? []).slice(-EVENTS_MAX);
      this.descriptions = (found.descriptions ?? []).filter((one) => one.role === "live");
      if (found.left_out) reason = `The ${found.left_out} oldest are left out.`;
    } catch (error) {
      if (error.status === -1) return;
      this.events = readOff(past, from, to);
      reason = `From the signals themselves; the server's events cannot be had: ${error.message}.`;
    }
    const rows = this.events.map((one) => [
      el("button", { type: "button", class: "button", onclick: () => this.seek(one.t) }, moment(one.t)),
      String(one.kind ?? "").replaceAll("_", " "),
      one.kind === "execution" ? execution(one.text)[0] : String(one.text ?? ""),
      one.until ? duration(one.until - one.t) : "",
    ]);
    const list = rows.length
      ? table(["When", "What", "", "For"], rows, { label: "Events" })
      : el("p", { class: "quiet" }, "Nothing: no change of state, tool or alarm.");
    list.classList.toggle("events", rows.length > 0);
    this.rows = [...list.querySelectorAll("tbody tr")];
    this.element.replaceChildren(list, reason ? el("p", { class: "note" }, reason) : "");
  }

  /** Items of a lane of the strip; of many events those that say little are left out. */
  lane() {
    const items = this.events.map((one) => ({
      from: one.t,
      text: one.text,
      title: `${moment(one.t)} ${one.text}`,
      kind: KINDS[one.kind] ?? "quiet",
    }));
    return items.filter((one) => one.kind !== "quiet" || items.length < QUIET_MAX);
  }

  /** Marks the last event before a moment. */
  mark(at) {
    let here = -1;
    this.events.forEach((one, i) => {
      if (one.t <= at) here = i;
    });
    this.rows?.forEach((row, i) => row.classList.toggle("here", i === here));
  }

  /** What the live description was at a moment, in words; null where it is not known. */
  description(at) {
    const held = this.descriptions.findLast((one) => one.t <= at);
    return held ? String(held.text).replace(/^description /, "") : null;
  }

  next(at) {
    return this.events.find((one) => one.t > at + 1);
  }

  before(at) {
    return this.events.findLast((one) => one.t < at - 1);
  }
}

/** Changes of state and tool, and alarms. */
function readOff(past, from, to) {
  const of = (signal) => (past.series.get(signal) instanceof Steps ? past.series.get(signal).items : []);
  const tools = of("tool_number").filter(({ value }) => value !== null);
  const alarms = of("alarm").filter(({ value }) => value);
  return [
    ...of("exec_state").map(({ t, value }) => ({ t, kind: "execution", text: value })),
    ...tools.map(({ t, value }) => ({ t, kind: "tool_change", text: `T${value} in the spindle` })),
    ...alarms.map(({ t, value }) => ({ t, kind: "alarm", text: String(value) })),
  ]
    .filter(({ t }) => t >= from && t <= to)
    .sort((a, b) => a.t - b.t)
    .slice(-EVENTS_MAX);
}
