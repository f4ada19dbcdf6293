// The state of each machine as it is known: the last value of each signal with its age and quality, and the last minutes of what can be drawn.

import { serverNow } from "./clock.js";
import { Ring, Steps } from "./ring.js";
import { unitWord } from "./text.js";
import {
  ADJUSTED_SCORE,
  ALERT_STATE,
  ANOMALY_THRESHOLD,
  GAP_GROWING,
  SPINDLE_TEMP_RESIDUAL_K,
  TOOL_CHANGE_GATE,
  TWIN_PREFIX,
} from "./vocabulary.js";

const FLEET_SERIES = new Set(["spindle_load_pct", TOOL_CHANGE_GATE]);
export const NAMING = new Set(["tool_number", "nc_line"]); // numbers that name something
const OTHER_CLOCK_MS = 5000;
const MACHINES_MAX = 1000;
const SIGNALS_MAX = 2000;
export const SERIES_S_MAX = 1200;

export class Machine {
  constructor(name) {
    this.name = name;
    this.online = false;
    this.offlineSince = null;
    this.values = new Map();
    this.series = new Map();
    this.lastT = -Infinity;
    this.lastHeard = -Infinity;
    this.otherClock = false;
    this.skews = 0;
    this.changed = new Set();
    this.until = null;
    this.gap = null;
    this.gapReason = null;
  }

  /** Now, by the clock that stamps this machine's values. A machine of another clock (a time lapse) is as old as its newest value. */
  now() {
    return this.otherClock ? Math.round(this.lastT + (performance.now() - this.lastHeard)) : serverNow();
  }

  /** The newest moment of which anything is known: values hold until then, and nothing does beyond it. A machine that has lived
   * through a stretch of the past (`until`) knows nothing of later. */
  knownUntil() {
    return this.until ?? (this.online ? this.now() : this.lastT);
  }

  value(signal) {
    return this.values.get(signal) ?? null;
  }

  /** The bare value where it is good, else null. */
  good(signal) {
    const held = this.values.get(signal);
    return held && held.quality === "good" ? held.value : null;
  }

  bare(signal) {
    return this.values.get(signal)?.value ?? null;
  }

  ageMs(signal) {
    const held = this.values.get(signal);
    return held ? this.now() - held.t : NaN;
  }

  /** Takes the last known value of a signal, with what its birth certificate says of it. */
  know(signal, given, { series }) {
    if (!given || typeof given !== "object" || !("value" in given)) return;
    if (!this.values.has(signal) && this.values.size >= SIGNALS_MAX) return;
    const held = this.values.get(signal);
    this.values.set(signal, {
      value: given.value,
      t: given.t ?? NaN,
      unit: given.unit ? unitWord(given.unit) : (held?.unit ?? null),
      quality: given.quality ?? "good",
      reason: given.reason ?? null,
      provenance: given.provenance ?? held?.provenance ?? (signal.startsWith(TWIN_PREFIX) ? "inferred" : "measured"),
      meaning: given.meaning ?? held?.meaning ?? null,
    });
    this.changed.add(signal);
    // A null may be stamped by another clock than the machine's: by that of an agent that has lost it.
    if (given.quality !== "bad" && given.t > this.lastT) this.lastT = given.t;
    if (series && Number.isFinite(given.t)) this.#keep(signal, given.t, given.value, given.quality ?? "good");
  }

  /** One change. */
  row(t, signal, value, quality, reason, keepAll) {
    let held = this.values.get(signal);
    if (!held) {
      if (this.values.size >= SIGNALS_MAX) return;
      held = {
        value: null,
        t: -Infinity,
        unit: null,
        quality: "good",
        reason: null,
        provenance: signal.startsWith(TWIN_PREFIX) ? "inferred" : "measured",
        meaning: null,
      };
      this.values.set(signal, held);
    }
    if (t < held.t) return; // history that comes late is not the present
    if (quality === "stale" && held.quality !== "stale") held.staleSince = held.t;
    if (quality !== "stale") held.staleSince = null;
    [held.value, held.t, held.quality, held.reason] = [value, t, quality, reason ?? null];
    this.changed.add(signal);
    if (keepAll || FLEET_SERIES.has(signal)) this.#keep(signal, t, value, quality);
  }

  #keep(signal, t, value, quality) {
    let series = this.series.get(signal);
    const isNumber = typeof value === "number" && !NAMING.has(signal);
    if (!series) {
      if (value === null) return;
      series = isNumber ? new Ring() : new Steps();
      this.series.set(signal, series);
    }
    if (series instanceof Ring)
      series.push(quality === "good" ? t : Math.max(t, series.last + 1), isNumber && quality === "good" ? value : NaN);
    else series.push(t, quality === "stale" ? null : value);
  }

  /** A column of the store, put where nothing is known. */
  backfill(column) {
    const values = column.value ?? [],
      times = column.t ?? [];
    const first = values.find((value) => value !== null);
    if (first === undefined) return;
    const isNumber = typeof first === "number" && !NAMING.has(column.signal);
    let series = this.series.get(column.signal);
    if (!series) this.series.set(column.signal, (series = isNumber ? new Ring() : new Steps()));
    if (series instanceof Ring)
      series.merge(
        times,
        values.map((value, i) => (typeof value === "number" && (column.quality?.[i] ?? "good") !== "stale" ? value : NaN)),
      );
    else series.merge(times, values);
    const heard = values.findLastIndex((value, i) => value !== null && (column.quality?.[i] ?? "good") === "good");
    if (!this.online && heard >= 0 && !column.signal.startsWith(TWIN_PREFIX)) this.setOnline(false, times[heard]);
  }

  /** Nothing was heard since `t`: lines end there, until they are filled up from the store or told again. */
  hole(t) {
    for (const series of this.series.values()) series.hole(t);
  }

  /** Note what a message tells of the clock that stamps: `t` the newest stamp in it. */
  heard(t, now) {
    if (!(t > this.lastT)) return;
    this.lastT = t;
    this.lastHeard = performance.now();
    const far = Math.abs(now - t) > OTHER_CLOCK_MS;
    this.skews = far === this.otherClock ? 0 : this.skews + 1;
    if (this.skews >= 3) [this.otherClock, this.skews] = [far, 0];
  }

  /** The whole of it: `/state/{machine}`. A signal that is not in it the machine does not have. */
  state({ measured, twin, online, now }) {
    const all = new Map(Object.entries(measured ?? {}));
    for (const [signal, given] of Object.entries(twin ?? {}))
      all.set(signal.startsWith(TWIN_PREFIX) ? signal : TWIN_PREFIX + signal, given);
    for (const signal of [...this.values.keys()]) if (!all.has(signal)) this.values.delete(signal);
    for (const [signal, given] of all) this.know(signal, given, { series: true });
    if (this.lastT - now > OTHER_CLOCK_MS) [this.otherClock, this.lastHeard] = [true, performance.now()]; // stamped ahead of the server
    this.setOnline(Boolean(online), this.lastT === -Infinity ? null : this.lastT);
  }

  /** at: when it was last heard; of several for one silence the newest holds, since what was heard later ended it later. */
  setOnline(online, at) {
    const since = online ? null : this.offlineSince === null || at > this.offlineSince ? at : this.offlineSince;
    if (online === this.online && since === this.offlineSince) return;
    this.online = online;
    this.offlineSince = since;
    this.changed.add("online");
  }
}

export class Plant {
  constructor() {
    this.machines = new Map();
  }

  machine(name) {
    let machine = this.machines.get(name);
    if (!machine) {
      if (this.machines.size >= MACHINES_MAX) return null;
      this.machines.set(name, (machine = new Machine(name)));
    }
    return machine;
  }

  get names() {
    return [...this.machines.keys()].sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
  }

  /** The whole fleet again: `/machines`. */
  fleet(items, { adds = false } = {}) {
    const named = new Set(items.map((item) => item.machine));
    if (!adds) for (const name of [...this.machines.keys()]) if (!named.has(name)) this.machines.delete(name);
    const signals = {
      exec_state: "exec_state",
      program: "program",
      tool_number: "tool_number",
      alert_state: ALERT_STATE,
      score: ADJUSTED_SCORE,
      gated: TOOL_CHANGE_GATE,
      spindle_load_pct: "spindle_load_pct",
      spindle_rpm: "spindle_rpm",
      threshold: ANOMALY_THRESHOLD,
      alarm: "alarm",
      growing: GAP_GROWING,
      residual_k: SPINDLE_TEMP_RESIDUAL_K,
    };
    for (const item of items) {
      const isNew = !this.machines.has(item.machine),
        machine = this.machine(item.machine);
      if (!machine || (adds && !isNew)) continue;
      for (const [key, signal] of Object.entries(signals)) {
        const given = item[key];
        if (given === undefined || (given === null && !machine.values.has(signal))) continue; // null there also means: has none
        const stale = { value: given, t: item.last_t, quality: item.online ? (given === null ? "bad" : "good") : "stale" };
        machine.know(signal, given !== null && typeof given === "object" ? given : stale, { series: FLEET_SERIES.has(signal) });
      }
      machine.gap = item.gap ?? null;
      machine.gapReason = item.gap_reason ?? null;
      if (item.last_t > machine.lastT) machine.lastT = item.last_t;
      machine.setOnline(Boolean(item.online), item.last_t ?? null);
    }
  }

  /** Changes of the fleet's key signals; gives back their stamps. */
  fleetRows({ rows, now }) {
    const stamps = [],
      newest = new Map();
    for (const [name, t, signal, value, quality, reason] of rows) {
      const machine = this.machine(name);
      if (!machine) continue;
      if (signal === "online") machine.setOnline(Boolean(value), t);
      else machine.row(t, signal, value, quality, reason, false);
      stamps.push(t);
      if (quality === "good" && t > (newest.get(machine) ?? -Infinity)) newest.set(machine, t);
    }
    for (const [machine, t] of newest) machine.heard(t, now ?? serverNow());
    return stamps;
  }

  /** The whole state of a machine: `/state/{machine}`. */
  state(state) {
    const machine = this.machine(state.machine);
    machine?.state(state);
    return machine;
  }

  /** Changes of one machine; gives back their stamps. */
  rows(name, { rows, now, online }) {
    const machine = this.machine(name);
    if (!machine) return [];
    const stamps = [];
    let newest = -Infinity;
    for (const [t, signal, value, quality, reason] of rows) {
      machine.row(t, signal, value, quality, reason, true);
      stamps.push(t);
      if (quality === "good" && t > newest) newest = t;
    }
    if (newest > -Infinity) machine.heard(newest, now ?? serverNow());
    if (typeof online === "boolean") machine.setOnline(online, machine.lastT);
    return stamps;
  }
}
