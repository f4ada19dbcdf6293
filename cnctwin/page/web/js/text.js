// Figures, ages and names as a person reads them.

import { lookup } from "./lookup.js";
import {
  ADJUSTED_SCORE,
  ALERT_STATE,
  ANOMALY_ALARM,
  ANOMALY_THRESHOLD,
  COMMON_MODE,
  CUTTING_FORCE_N,
  GAP_GROWING,
  GATED_SHARE_PCT,
  RAW_SCORE,
  SCORE_DRIFT,
  SPINDLE_TEMP_C,
  SPINDLE_TEMP_CORRECTED_C,
  SPINDLE_TEMP_CORRECTED_RESIDUAL_K,
  SPINDLE_TEMP_CORRECTION_K,
  SPINDLE_TEMP_RESIDUAL_K,
  SPINDLE_TEMP_RISE_K,
  TOOL_CHANGE_GATE,
  VIBRATION_RMS_G,
  VIBRATION_VELOCITY_MM_S,
} from "./vocabulary.js";

const TITLES = lookup({
  spindle_rpm: "Spindle speed",
  spindle_rpm_cmd: "Commanded speed",
  spindle_load_pct: "Spindle load",
  spindle_power_kw: "Spindle power",
  spindle_current_a: "Spindle current",
  feed_mm_min: "Feed",
  feed_override_pct: "Feed override",
  rapid_override_pct: "Rapid override",
  spindle_override_pct: "Spindle override",
  program: "Program",
  nc_block: "Block",
  nc_line: "Line",
  exec_state: "State",
  controller_mode: "Mode",
  tool_number: "Tool",
  tool_change_active: "Tool change",
  tool_change_source: "Tool change reported by",
  spindle_temp_c: "Spindle temperature",
  ambient_temp_c: "Ambient",
  vibration_rms_g: "Vibration",
  vibration_velocity_mm_s: "Vibration velocity",
  coolant_on: "Coolant",
  alarm: "Control alarm",
  clock_offset_s: "Clock offset",
  clock_offset_spread_s: "Clock offset, spread",
  [SPINDLE_TEMP_C]: "Spindle temperature, twin",
  [SPINDLE_TEMP_RISE_K]: "Temperature rise, twin",
  [SPINDLE_TEMP_RESIDUAL_K]: "Temperature, measured − twin",
  [CUTTING_FORCE_N]: "Cutting force",
  [RAW_SCORE]: "Raw score",
  [ADJUSTED_SCORE]: "Adjusted score",
  [TOOL_CHANGE_GATE]: "Suppression window",
  [GATED_SHARE_PCT]: "Time in suppression windows",
  [ANOMALY_THRESHOLD]: "Threshold",
  [ANOMALY_ALARM]: "Anomaly alarm",
  [COMMON_MODE]: "Common mode",
  [GAP_GROWING]: "Gap growing",
  [ALERT_STATE]: "Alert",
  [VIBRATION_RMS_G]: "Vibration",
  [VIBRATION_VELOCITY_MM_S]: "Vibration velocity",
  [SCORE_DRIFT]: "Score drift",
  [SPINDLE_TEMP_CORRECTED_C]: "Spindle temperature, twin with what was learned",
  [SPINDLE_TEMP_CORRECTION_K]: "Temperature, learned correction",
  [SPINDLE_TEMP_CORRECTED_RESIDUAL_K]: "Temperature, measured − corrected twin",
});
const STATES = lookup({
  ACTIVE: ["Active", "s-active", "active"],
  READY: ["Ready", "s-ready", "idle"],
  INTERRUPTED: ["Interrupted", "s-held", "held"],
  FEED_HOLD: ["Feed hold", "s-held", "held"],
  WAIT: ["Waiting", "s-held", "held"],
  STOPPED: ["Stopped", "s-stopped", "stopped"],
  OPTIONAL_STOP: ["Optional stop", "s-held", "held"],
  PROGRAM_STOPPED: ["Program stop", "s-stopped", "stopped"],
  PROGRAM_COMPLETED: ["Completed", "s-ready", "idle"],
  PROGRAM_OPTIONAL_STOP: ["Optional stop", "s-held", "held"],
});
const ACRONYMS = lookup({
  nc: "NC",
  rpm: "speed",
  pct: "",
  mm: "",
  min: "",
  deg: "",
  pos: "position",
  temp: "temperature",
  c: "",
  k: "",
  n: "",
  g: "",
  s: "",
  kw: "",
  a: "",
  rms: "rms",
  cmd: "commanded",
});

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** A signal's name in words. */
export function title(signal) {
  if (TITLES[signal]) return TITLES[signal];
  const own = signal.replace(/^twin\//, "");
  const axis = /^axis_([a-z])_(pos|load)_/.exec(own);
  if (axis) return `${axis[1].toUpperCase()} ${axis[2] === "pos" ? "position" : "load"}`;
  if (own.startsWith("gap_")) return gapTitle(own.slice(4));
  if (own.startsWith("rule_")) return `Rule: ${own.slice(5).replaceAll("_", " ")}`;
  const words = own
    .split(/[_/]/)
    .map((word) => ACRONYMS[word] ?? word)
    .filter(Boolean);
  return capital(words.join(" ")) || own;
}

/** `<signal>[/<regime>][/mean]` of a gap metric, in words. */
export function gapTitle(rest) {
  const [signal, ...more] = rest.split("/");
  return [`Gap: ${(TITLES[signal] ?? title(signal)).toLowerCase()}`, ...more.map((word) => word.replaceAll("_", " "))].join(", ");
}

/** [word, symbol, kind] of an execution state. */
export function execution(state) {
  if (state === null || state === undefined) return ["Unknown", "s-unknown", "unknown"];
  return STATES[state] ?? [capital(String(state).toLowerCase().replaceAll("_", " ")), "s-unknown", "unknown"];
}

const MINUS = (text) => text.replace("-", "−");

// Figures have the decimal sign of the reader's language, and no sign between thousands: 1.234 is one number to one reader and
// a thousand times as much to another.
const formats = new Map();
function written(value, least, most, digits) {
  const key = digits ?? `${least}-${most}`;
  if (!formats.has(key))
    formats.set(
      key,
      new Intl.NumberFormat(navigator.language, {
        useGrouping: false,
        signDisplay: "negative",
        ...(digits ? { maximumSignificantDigits: digits } : { minimumFractionDigits: least, maximumFractionDigits: most }),
      }),
    );
  return MINUS(formats.get(key).format(value));
}

/** A number with so many decimal places. */
export const fixed = (value, places) => written(value, places, places);

/** A number with so many digits that count, and no zeros behind them. */
export const digits = (value, count) => written(value, null, null, count);

function decimals(unit, size) {
  if (["°C", "K", "celsius", "%", "degC"].includes(unit)) return 1;
  if (["rev/min", "rpm", "N", "mm/min"].includes(unit)) return 0;
  if (["g", "mm", "mm/s"].includes(unit)) return size >= 100 ? 1 : 3;
  return null;
}

/** A number for reading: as many digits as its unit wants, else four that count. */
export function number(value, unit = null) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value),
    places = decimals(unit, size);
  if (places !== null) return fixed(value, places);
  if (size >= 1e6 || size < 1e-4) {
    const [factor, power] = value.toExponential(2).split("e");
    return `${fixed(Number(factor), 2)}e${MINUS(power)}`;
  }
  return digits(value, size >= 1000 ? 5 : 4);
}

/** A number as `number` shows it where its unit has fixed places, so that a difference of two can be checked by eye. */
export function rounded(value, unit = null) {
  const places = decimals(unit, Math.abs(value));
  return places === null ? value : Number(value.toFixed(places));
}

/** a − b of two values as they are shown, with its sign and unit: what a reader who subtracts them gets. */
export const between = (a, b) =>
  `${signed(rounded(a.value, a.unit) - rounded(b.value, b.unit), a.unit)} ${a.unit === "°C" ? "K" : (a.unit ?? "")}`.trim();

/** Any value without its unit. */
export function plain(value, unit = null) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return Number.isInteger(value) && !unit ? String(value) : number(value, unit);
  if (typeof value === "boolean") return value ? "yes" : "no";
  return String(value);
}

/** A number with its sign. */
export const signed = (value, unit = null) =>
  value > 0 && number(value, unit) !== "0" ? `+${number(value, unit)}` : number(value, unit);

/** The unit of gaps in words, and what it means; the interface calls it floors. */
export const REPEATABILITY = "× repeatability";
export const REPEATABILITY_MEANS = "repeatability: what two runs of the same program differ by on a healthy machine";
const UNITS = lookup({ floors: REPEATABILITY });

/** A unit as a person reads it. */
export const unitWord = (unit) => UNITS[unit] ?? unit;

export const SUPPRESSION_MEANS = "around a tool change, when scores are not judged";

/** Two digits that count: of a gap over the repeatability more would be noise. */
export const coarse = (value) =>
  !Number.isFinite(value) ? "–" : Math.abs(value) >= 10 ? fixed(value, 0) : digits(value, 2);

/** An age in words, from a number of ms. */
export function age(ms) {
  if (!Number.isFinite(ms)) return "";
  const s = Math.max(0, ms / 1000);
  if (s < 1.5) return "now";
  if (s < 60) return `${Math.floor(s)} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min`;
  if (s < 86400) return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
  return `${Math.floor(s / 86400)} d ${Math.floor((s % 86400) / 3600)} h`;
}

/** A stretch of time from a number of ms. */
export function duration(ms) {
  const s = ms < 59500 ? ms / 1000 : Math.round(ms / 1000);
  if (s < 60) return `${digits(s, 3)} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
}

const two = (value) => String(value).padStart(2, "0");

const clocks = new Map();

/** [date, time of day] by the clock on the wall: of the reader's zone, or of another one by its name. */
function onTheWall(t, zone) {
  if (!zone) {
    const at = new Date(t);
    const time = [at.getHours(), at.getMinutes(), at.getSeconds()];
    return [`${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`, time.map(two).join(":")];
  }
  if (!clocks.has(zone))
    clocks.set(zone, new Intl.DateTimeFormat("sv-SE", { timeZone: zone, dateStyle: "short", timeStyle: "medium" })); // as ISO 8601
  return clocks.get(zone).format(t).split(" ");
}

/** The name of a time zone where this browser knows it, else UTC. */
export function knownZone(name) {
  try {
    new Intl.DateTimeFormat("sv-SE", { timeZone: name });
    return name ?? "UTC";
  } catch {
    return "UTC";
  }
}

/** A moment: time of day, with the date where it is not today; in the reader's time zone, or in `zone`. */
export function moment(t, { seconds = true, now = Date.now(), zone = null } = {}) {
  if (!Number.isFinite(t)) return "–";
  const [date, clock] = onTheWall(t, zone),
    time = seconds ? clock : clock.slice(0, 5);
  return date === onTheWall(now, zone)[0] ? time : `${date} ${time}`;
}

/** A moment as a `datetime-local` field holds it, and back. */
export const localField = (t) => {
  const at = new Date(t);
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}T${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
};
export const fromLocalField = (text) => new Date(text).getTime();

/** A share, 0 to 1. */
export const share = (value) =>
  !Number.isFinite(value) ? "–" : value > 0 && value < 0.005 ? "under 1 %" : `${Math.round(value * 100)} %`;

const RECORDED = { pos_mm: "position", table_mm: "table position", torque_a: "torque", ref_mm: "reference" };

/** A signal of a recorded run in words: those of the axes are named otherwise than live ones. */
export function recorded(signal) {
  const axis = /^([a-z])_(pos_mm|table_mm|torque_a|ref_mm)$/.exec(signal ?? "");
  return axis ? `${axis[1].toUpperCase()} ${RECORDED[axis[2]]}` : title(String(signal ?? ""));
}

/** A sentence begins with a capital. */
export const sentence = (text) => capital(String(text ?? ""));

/** A text of loop or diagnosis, also one of a record from before, with the unit of its gaps as this page calls it. */
export const inPageWords = (text) => String(text ?? "").replace(/(\d) floors\b/g, `$1 ${REPEATABILITY}`);

/** The name of an effect or a part, in words. */
export const words = (name) => capital(String(name ?? "").replaceAll("_", " "));

/** A word of a command as a shell reads it: quoted where it needs to be. */
export const typed = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'"'"'`)}'`);
