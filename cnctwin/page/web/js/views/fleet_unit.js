// A machine of the fleet: one element, that is a card or a row by its style. Only what changed is written.

import { sparkline } from "../chart.js";
import { el, setClass, setData, setHidden, setSymbol, setText, setTitle, symbol } from "../dom.js";
import { Ring, Steps } from "../ring.js";
import { REPEATABILITY, REPEATABILITY_MEANS, coarse, execution, fixed, moment, number, plain, signed } from "../text.js";
import {
  ADJUSTED_SCORE,
  ALERT_STATE,
  ANOMALY_THRESHOLD,
  GAP_GROWING,
  GAP_LEFT_OUT_PCT,
  GAP_PREFIX,
  SPINDLE_TEMP_RESIDUAL_K,
  TOOL_CHANGE_GATE,
} from "../vocabulary.js";

export const SPARK_MS = 120000;
const LOAD_TOP = 120;
const NO_GAP = new Set([GAP_LEFT_OUT_PCT]); // a number about the comparison, not a gap

/** The largest standing gap: what `/machines` says, kept up by the stream's `twin/gap_<signal>`. */
function gapOf(machine) {
  let worst = null;
  for (const [signal, held] of machine.values) {
    if (!signal.startsWith(GAP_PREFIX) || signal.includes("/", 5) || NO_GAP.has(signal)) continue;
    if (typeof held.value !== "number") continue;
    if (worst === null || held.value > worst) worst = held.value;
  }
  const given = machine.gap && typeof machine.gap === "object" ? (machine.gap.value ?? null) : (machine.gap ?? null);
  return worst ?? (typeof given === "number" ? given : null);
}

/** Why there is no standing gap: as its processor says it now, else as `/machines` does. */
function whyNoGap(machine) {
  for (const [signal, held] of machine.values)
    if (signal.startsWith(GAP_PREFIX) && held.value === null && held.reason && !held.reason.endsWith("is not offered"))
      return held.reason;
  return machine.gapReason ?? "not known yet";
}

export class Unit {
  constructor(app, machine) {
    this.machine = machine;
    const part = (name, ...children) => el("span", { class: name }, ...children);
    this.dot = symbol("s-unknown");
    this.name = el("strong", { class: "name" }, machine.name);
    this.word = part("word");
    this.job = part("job");
    this.tool = part("tool");
    this.loadBar = part("fill");
    this.load = part("figure");
    this.speed = part("figure");
    this.score = part("figure");
    this.scoreBar = part("fill");
    this.scoreMark = part("mark");
    this.gap = part("figure");
    this.gapUnit = part("unitname");
    this.growing = symbol("s-grow", "grow");
    this.alertSign = symbol("s-alert");
    this.alertWord = part("said");
    this.alert = part("chip alertchip", this.alertSign, this.alertWord);
    this.gate = part("chip gate", "tool change");
    this.canvas = el("canvas", { class: "spark", "aria-hidden": "true" });
    this.bars = part("bar-track", this.loadBar, part("hundred"));
    this.scoreTrack = part("bar-track score", this.scoreBar, this.scoreMark);
    const cell = (name, label, ...children) => part(`cell ${name}`, el("span", { class: "label" }, label), ...children);
    this.link = el(
      "a",
      { class: "unit livedata", href: app.address("machine", machine.name) },
      part("who", this.dot, part("names", this.name, this.word)),
      part("jobs", this.job, this.tool),
      cell("load", "Load", part("row", this.bars, part("value", this.load, part("unitname", "%")))),
      cell("speed", "Speed", part("value", this.speed, part("unitname", "rev/min"))),
      cell("scores", "Score", part("row", this.scoreTrack, part("value", this.score))),
      cell("gaps", "Gap", part("value", this.gap, this.gapUnit, this.growing)),
      part("spark-label", "Load, last 2 minutes"),
      this.canvas,
      part("flags", this.alert, this.gate),
    );
    this.element = el("li", {}, this.link);
    this.write();
  }

  figure(element, signal, unit = null) {
    const held = this.machine.value(signal);
    setText(element, held ? (typeof held.value === "number" ? number(held.value, unit) : plain(held.value)) : "–");
    setTitle(element, held && held.value === null && held.reason ? held.reason : "");
    setClass(element, "old", Boolean(held) && held.quality !== "good");
    return held && typeof held.value === "number" ? held.value : null;
  }

  write() {
    const m = this.machine,
      online = m.online;
    const [word, sign, kind] = online ? execution(m.bare("exec_state")) : ["Offline", "s-offline", "offline"];
    setSymbol(this.dot, sign);
    setData(this.link, "kind", kind);
    const since = m.offlineSince ?? (m.lastT === -Infinity ? null : m.lastT);
    const alarm = online && m.value("alarm")?.quality === "good" && m.bare("alarm");
    setText(this.word, online ? (alarm ? `${word}: ${alarm}` : word) : since ? `Offline since ${moment(since)}` : "Offline");
    setClass(this.link, "stale", !online);
    setText(this.job, m.bare("program") === null ? "no program" : String(m.bare("program")));
    setClass(this.job, "quiet", m.bare("program") === null);
    setText(this.tool, m.bare("tool_number") === null ? "no tool" : `T${m.bare("tool_number")}`);
    const load = this.figure(this.load, "spindle_load_pct", "%");
    this.scale(this.loadBar, load === null ? 0 : Math.abs(load) / LOAD_TOP);
    setClass(this.loadBar, "over", load !== null && load > 100);
    this.figure(this.speed, "spindle_rpm", "rev/min");
    const score = this.figure(this.score, ADJUSTED_SCORE);
    if (score !== null) setText(this.score, fixed(score, 2));
    const limit = m.bare(ANOMALY_THRESHOLD),
      top = typeof limit === "number" && limit > 0 ? 2 * limit : 1;
    this.scale(this.scoreBar, score === null ? 0 : Math.max(0, score) / top);
    setClass(this.scoreBar, "over", score !== null && typeof limit === "number" && score >= limit);
    setHidden(this.scoreMark, typeof limit !== "number");
    const gap = gapOf(m),
      growing = m.bare(GAP_GROWING) === true;
    const rest = gap === null ? m.bare(SPINDLE_TEMP_RESIDUAL_K) : null,
      hasRest = typeof rest === "number";
    setText(this.gap, gap !== null ? coarse(gap) : hasRest ? signed(rest, "K") : "–");
    setText(this.gapUnit, gap !== null ? REPEATABILITY : hasRest ? "K now" : "");
    setTitle(
      this.gap,
      gap !== null
        ? `the largest gap between machine and twin that stays, as a multiple of the ${REPEATABILITY_MEANS}. Below 3 it is hardly more than chance.`
        : hasRest
          ? `spindle temperature, measured minus twin, at this moment; of the standing gap: ${whyNoGap(m)}`
          : whyNoGap(m),
    );
    setClass(this.gap, "large", gap !== null && gap > 3);
    setClass(this.growing, "off", !growing);
    const alert = m.bare(ALERT_STATE),
      shown = alert && alert !== "none";
    setClass(this.alert, "off", !shown);
    if (shown) {
      setSymbol(this.alertSign, { firing: "s-alert", acknowledged: "s-ack", pending: "s-pending" }[alert] ?? "s-alert");
      setText(this.alertWord, alert);
      setData(this.alert, "state", alert);
    }
    setData(this.link, "alert", shown ? alert : null);
    setClass(this.gate, "off", m.bare(TOOL_CHANGE_GATE) !== true);
  }

  scale(bar, share) {
    const text = `scaleX(${Math.min(1, share).toFixed(3)})`;
    if (bar.style.transform !== text) bar.style.transform = text;
  }

  spark() {
    const load = this.machine.series.get("spindle_load_pct"),
      gates = this.machine.series.get(TOOL_CHANGE_GATE);
    if (!(load instanceof Ring) || !this.canvas.clientWidth) return;
    const to = this.machine.now(),
      from = to - SPARK_MS;
    const shaded = gates instanceof Steps ? gates.stretches(from, to).filter(([, , on]) => on === true) : [];
    const [t, v] = load.since(from);
    if (!this.machine.online) (v.push(NaN), t.push(Math.max(load.last, from)));
    sparkline(this.canvas, [t, v], [from, to], LOAD_TOP, shaded);
  }
}
