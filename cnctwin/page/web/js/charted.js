// The charts of a machine, and which of its signals belong together: measured, its twin, and what is between the two.

import { Ring, Steps } from "./ring.js";
import { NAMING } from "./plant.js";
import { title } from "./text.js";
import {
  ADJUSTED_SCORE,
  ANOMALY_THRESHOLD,
  CUTTING_FORCE_N,
  RAW_SCORE,
  SPINDLE_TEMP_C,
  SPINDLE_TEMP_CORRECTED_C,
  SPINDLE_TEMP_RESIDUAL_K,
  TOOL_CHANGE_GATE,
  TWIN_PREFIX,
  VIBRATION_RMS_G,
  VIBRATION_VELOCITY_MM_S,
} from "./vocabulary.js";

export const SCORES = { raw: RAW_SCORE, adjusted: ADJUSTED_SCORE, threshold: ANOMALY_THRESHOLD };
export const CONTEXT = ["exec_state", "tool_number", TOOL_CHANGE_GATE, "program", "nc_block", "nc_line"];

/** The tiles, in their order; the first signal that the machine has is the one that is shown. */
export const TILES = [
  {
    id: "spindle_temp_c",
    name: "Spindle temperature",
    own: ["spindle_temp_c"],
    twin: SPINDLE_TEMP_C,
    residual: SPINDLE_TEMP_RESIDUAL_K,
    learned: SPINDLE_TEMP_CORRECTED_C,
  },
  { id: "spindle_load_pct", name: "Spindle load", own: ["spindle_load_pct"], twin: TWIN_PREFIX + "spindle_load_pct" },
  { id: "spindle_rpm", name: "Spindle speed", own: ["spindle_rpm"], twin: "spindle_rpm_cmd", twinIs: "commanded" },
  { id: "cutting_force", name: "Cutting force", own: ["cutting_force_n", CUTTING_FORCE_N], twin: null },
  {
    id: "vibration",
    name: "Vibration",
    own: ["vibration_rms_g", VIBRATION_RMS_G, "vibration_velocity_mm_s", VIBRATION_VELOCITY_MM_S],
    twin: null,
  },
];

/** A tile as this machine has it, or null where it has none of its signals. */
export function tileOf(machine, tile) {
  const own = tile.own.find((signal) => machine.values.has(signal)) ?? null;
  if (own === null && !(tile.twin && typeof machine.bare(tile.twin) === "number")) return null;
  const twin = tile.twin && machine.values.has(tile.twin) ? tile.twin : null;
  return {
    ...tile,
    own: own ?? tile.own[0],
    twin,
    residual: tile.residual && machine.values.has(tile.residual) ? tile.residual : null,
    twinIs: tile.twinIs ?? "twin",
    learned: tile.learned && typeof machine.bare(tile.learned) === "number" ? tile.learned : null,
  };
}

/** The signal that a machine opens on: the first tile that has a figure of its own, else another measured one, else the twin's. */
export function firstOf(machine) {
  const has = (signal) => typeof machine.bare(signal) === "number" || machine.series.get(signal) instanceof Ring;
  const [measured, twin] = numbers(machine),
    tile = TILES.find((one) => has(tileOf(machine, one)?.own));
  const first = (names) => names.find((signal) => has(signal) && !SAYS_LITTLE.test(signal)) ?? names.find(has);
  return tile?.id ?? first(measured) ?? first(twin) ?? measured[0] ?? twin[0] ?? null;
}

/** Positions, overrides, clocks and what an edge counts say little over time; they are charted last. */
const SAYS_LITTLE = /_pos_(mm|deg)$|_override_pct$|^clock_|^edge_/;

/** The same for any signal of the machine. */
export function chartOf(machine, id) {
  const tile = TILES.find((one) => one.id === id || one.own[0] === id);
  const known = tile && tileOf(machine, tile);
  if (known) return known;
  const twin = id.startsWith(TWIN_PREFIX) ? null : TWIN_PREFIX + id;
  return {
    id,
    name: title(id),
    own: id,
    twin: twin && machine.values.has(twin) ? twin : null,
    residual: null,
    twinIs: "twin",
    learned: null,
  };
}

/** All numbers of a machine that can be charted: [measured], [twin]. */
export function numbers(machine) {
  const names = [...machine.values]
    .filter(([signal, held]) => !NAMING.has(signal) && (typeof held.value === "number" || (held.value === null && held.unit)))
    .map(([signal]) => signal)
    .sort();
  return [names.filter((name) => !name.startsWith(TWIN_PREFIX)), names.filter((name) => name.startsWith(TWIN_PREFIX))];
}

/** [t, v] of a number from `from` to `to`, its first sample moved to `from`, its last value held until `held`. */
export function line(machine, signal, from, to, held) {
  const ring = signal ? machine.series.get(signal) : null;
  if (!(ring instanceof Ring) || !ring.length) return [[], []];
  const [t, v] = ring.since(from, to);
  if (t.length && t[0] < from) t[0] = from;
  if (t.length && t[t.length - 1] < held && !Number.isNaN(v[v.length - 1])) {
    t.push(held);
    v.push(v[v.length - 1]);
  }
  return [t, v];
}

/** Stretches in which a line is not known, after it once was. */
export function unknown([t, v], to) {
  const made = [];
  for (let i = 0; i < t.length; i++) if (Number.isNaN(v[i])) made.push([t[i], i + 1 < t.length ? t[i + 1] : to]);
  return made;
}

/** a − b of two stepped lines, where both are known. */
export function difference(a, b) {
  const [t, v] = [[], []];
  let i = -1,
    k = -1;
  while (i + 1 < a[0].length || k + 1 < b[0].length) {
    const at = Math.min(a[0][i + 1] ?? Infinity, b[0][k + 1] ?? Infinity);
    if (a[0][i + 1] === at) i += 1;
    if (b[0][k + 1] === at) k += 1;
    t.push(at);
    v.push(i < 0 || k < 0 ? NaN : a[1][i] - b[1][k]);
  }
  return [t, v];
}

/** The value of a signal that held at t; null where none is known. */
export function valueAt(machine, signal, t) {
  if (t > machine.knownUntil()) return null;
  const series = machine.series.get(signal);
  if (series instanceof Steps) return series.at(t) ?? null;
  if (!(series instanceof Ring)) return null;
  const i = series.indexAt(t + 1) - 1;
  return i < 0 || Number.isNaN(series.valueAt(i)) ? null : series.valueAt(i);
}

export function stretches(machine, signal, from, to) {
  const series = machine.series.get(signal);
  return series instanceof Steps ? series.stretches(from, to) : [];
}

/** The moments at which tools came: {t, text}. */
export function toolMarks(machine, from, to) {
  const series = machine.series.get("tool_number");
  if (!(series instanceof Steps)) return [];
  return series.items
    .slice(1)
    .filter(({ t, value }) => value !== null && t >= from && t <= to)
    .map(({ t, value }) => ({ t, text: `T${value}` }));
}
