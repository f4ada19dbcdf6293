// Why a score alarms, in words, from the JSON of twin/anomaly_why; and what a person's verdict has brought about.

import { lookup } from "./lookup.js";
import { fixed, moment, number, title } from "./text.js";

const OVER = lookup({ seconds: "within seconds", cut: "over some cuts", part: "over minutes", tool: "against the last parts of this tool" });
const VERDICTS = lookup({ true: "True", false: "False", known: "Known" });
const STATES = lookup({
  on: "It is on.",
  over: "It is over.",
  stands: "It stands until a part has run without it.",
  "held back": "Its like is held back until it is gone.",
});
const DIFFERENCES = new Set(["K", "°C"]);
const PCT_MAX = 200; // beyond it a factor is easier to read

const isNumber = Number.isFinite;
const list = (value) => (Array.isArray(value) ? value : []);
const text = (value) => (typeof value === "string" ? value : "");

/** The object of a text that is published; null where it is none. */
export function parsed(value) {
  if (typeof value !== "string") return null;
  try {
    const found = JSON.parse(value);
    return found && typeof found === "object" && !Array.isArray(found) ? found : null;
  } catch {
    return null;
  }
}

/** How far from what was expected: "18 % above", "3.2 K above", "5.1 times". */
function away({ measured, expected, unit }) {
  if (!isNumber(measured) || !isNumber(expected)) return "away from";
  const side = measured >= expected ? "above" : "below",
    pct = expected > 0 ? Math.abs(measured / expected - 1) * 100 : Infinity;
  if (DIFFERENCES.has(unit) || !isNumber(pct)) return `${number(Math.abs(measured - expected), unit)} ${unit ?? ""} ${side}`.replace("  ", " ");
  return pct > PCT_MAX ? `${number(measured / expected)} times` : `${Math.max(1, Math.round(pct))} % ${side}`;
}

/** What it is compared with. */
function against(by) {
  const parts = /^(\d+) parts?$/.exec(text(by));
  if (parts) return parts[1] === "1" ? "the part before" : `the last ${parts[1]} parts`;
  return by === "the twin" || by === "the twin only" ? "what the twin expects" : "what is usual";
}

function where({ lines, program, tool }) {
  const [first, last] = list(lines);
  const range = !isNumber(first) ? "" : first === last || !isNumber(last) ? ` in line ${first}` : ` in lines ${first}–${last}`;
  const of = [text(program), isNumber(tool) ? `tool ${tool}` : ""].filter(Boolean).join(", ");
  return `${range}${of ? ` (${of})` : ""}`;
}

/** The sentence: "Spindle load 18 % above the last 12 parts in lines 210–260 (O1701, tool 5), over some cuts, since 10:32." */
export function sentenceOf(why, told) {
  const scale = OVER[text(why.scale)],
    since = isNumber(told) ? told - (isNumber(why.since_s) ? why.since_s * 1000 : 0) : NaN;
  const when = isNumber(since) ? `, since ${moment(since, { seconds: false })}` : "";
  return `${title(text(why.signal) || "a signal")} ${away(why)} ${against(why.by)}${where(why)}${scale ? `, ${scale}` : ""}${when}.`;
}

/** Labelled alarms that it looks like: "Looks like: packed chips (likeness 0.91, 2026-11-03 10:40)." */
export function likes(why) {
  const known = list(why.like).filter((one) => one && text(one.label) && isNumber(one.likeness));
  if (!known.length) return "It looks like no alarm that has a name.";
  return `Looks like: ${known
    .map((one) => `${one.label} (likeness ${fixed(one.likeness, 2)}, ${moment(one.at_s * 1000, { seconds: false })})`)
    .join("; ")}.`;
}

/** Peers that show it too; they may be told by number only. */
export function shownBy(why) {
  const peers = list(why.peers).map(String);
  if (!peers.length) return "No peer shows it.";
  if (peers.every((one) => /^\d+$/.test(one))) return peers.length === 1 ? "A peer shows it too." : `${peers.length} peers show it too.`;
  return `${peers.join(", ")} ${peers.length === 1 ? "shows" : "show"} it too.`;
}

/** Who said what of an alarm, and what has come of it. */
export function saidOf(alarm) {
  const said = alarm.said;
  if (!said) return "";
  const label = text(said.label) ? `, “${said.label}”` : "";
  return `${text(said.by)} said at ${moment(said.at_s * 1000, { seconds: false })}: ${(VERDICTS[text(said.verdict)] ?? "?").toLowerCase()}${label}. ${STATES[text(alarm.state)] ?? ""}`;
}

/** A limit that a false alarm has raised, with the name of who said so. */
export function limitOf(one) {
  const since = isNumber(one.since_s) ? `, ${moment(one.since_s * 1000, { seconds: false })}` : "";
  return `${title(text(one.signal))} ${text(one.side)} what is usual in ${text(one.operation)} (${text(one.scale)}): limit × ${number(one.factor)}, by ${text(one.by)}${since}`;
}

export { VERDICTS };
