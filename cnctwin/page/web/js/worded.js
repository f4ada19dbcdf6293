// Values that are lists or records (JSON text) in words: alarms of a control, what a processor has found.

import { moment, plain } from "./text.js";

const SAID = { true: "acknowledged", false: "not acknowledged" };

/** `alarms` and `alarm_history` (docs/reference/signals.md): each alarm as a person would say it, separated by semicolons. */
function alarm(one) {
  const since = typeof one.since === "string" ? Date.parse(one.since) : NaN;
  const parts = [
    [one.code, one.text].filter(Boolean).join(" "),
    one.severity === null || one.severity === undefined ? "" : `severity ${one.severity}`,
    one.active === false ? "gone" : "",
    SAID[one.acknowledged] ?? "",
    Number.isFinite(since) ? `since ${moment(since)}` : "",
  ];
  return parts.filter(Boolean).join(", ");
}

const isAlarm = (one) => one !== null && typeof one === "object" && "code" in one && "acknowledged" in one;

function inWords(value) {
  if (Array.isArray(value)) return value.map(isAlarm(value[0]) ? alarm : inWords).join("; ") || "none";
  if (value === null || typeof value !== "object") return plain(value);
  return Object.entries(value)
    .filter(([, one]) => one !== null)
    .map(([name, one]) => `${name.replaceAll("_", " ")} ${inWords(one)}`)
    .join(", ");
}

/** Any value without its unit, as `plain`; a list or a record in words. */
export function worded(value, unit = null) {
  if (typeof value !== "string" || !/^[[{]/.test(value)) return plain(value, unit);
  try {
    const read = JSON.parse(value);
    return [].concat(read).every((one) => typeof one === "object") ? inWords(read) : value;
  } catch {
    return value; // a text that only looks like one
  }
}
