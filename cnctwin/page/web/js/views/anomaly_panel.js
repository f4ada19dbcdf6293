// Why a machine's score alarms, what is known of the program, and a person's verdict: true, false or known. The same on the machine's
// view and on an alert.

import { VERDICTS, likes, limitOf, saidOf, sentenceOf, shownBy } from "../anomaly_words.js";
import { part, post } from "../api.js";
import { openSigned } from "../dialogs.js";
import { drawn, el, say, setHidden } from "../dom.js";
import { may, whyNot } from "../me.js";
import { moment, number, title } from "../text.js";

const ABOUT = {
  true: "It is a fault. The alarm stands until a part of the program has run without it; what the score saw of it is never learned as usual.",
  false: "It is no fault. What was cut may be learned as usual, and the limit of these signals in this operation rises, so that the same size alarms no more.",
  known: "The cause is known. Alarms like this one are held back, unless they become much larger, until it is gone.",
};
const WIDE = 320;
const HIGH = 34;
const BAND_SPREADS = 3;
const LABELS_MAX = 20;

const list = (value) => (Array.isArray(value) ? value.filter((one) => one && typeof one === "object") : []);

/** Measured beside the band that was expected: three spreads to both sides. */
function band(why) {
  const { measured, expected, spreads, unit } = why;
  if (![measured, expected, spreads].every(Number.isFinite) || spreads <= 0 || measured === expected) return null;
  const half = (BAND_SPREADS * Math.abs(measured - expected)) / spreads,
    low = Math.min(expected - half, measured),
    high = Math.max(expected + half, measured);
  const at = (value) => 8 + ((value - low) / (high - low)) * (WIDE - 16);
  const figures = `expected ${number(expected, unit)} ± ${number(half, unit)} ${unit ?? ""}, measured ${number(measured, unit)} ${unit ?? ""}`;
  return el(
    "figure",
    { class: "expectedband" },
    drawn(
      "svg",
      { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": `${title(String(why.signal ?? ""))}: ${figures}` },
      drawn("rect", { class: "rail", x: 0, y: 14, width: WIDE, height: 6, rx: 3 }),
      drawn("rect", { class: "band", x: at(expected - half), y: 8, width: at(expected + half) - at(expected - half), height: 18, rx: 3 }),
      drawn("line", { class: "expected", x1: at(expected), x2: at(expected), y1: 6, y2: 28 }),
      drawn("circle", { class: "measured", cx: at(measured), cy: 17, r: 6 }),
    ),
    el("figcaption", {}, figures),
  );
}

/** A panel for a machine. `write(shown)`: as GET /anomaly/{machine} tells it; with `told`, ms, of when the reason is. */
export function anomalyPanel(app, name, changed) {
  const element = el("section", { class: "anomaly", hidden: true, "aria-label": "Anomaly alarm" });
  let before = "";

  function give(verdict, alarm, labels) {
    const about = [
      el("p", {}, el("strong", {}, name), `: ${ABOUT[verdict]}`),
      el("datalist", { id: "labels" }, labels.map((label) => el("option", { value: label }))),
    ];
    const ask = { label: "What it was, in a few words", length: 60, list: "labels" };
    openSigned(VERDICTS[verdict], about, VERDICTS[verdict], (by, label) => told({ verdict, label, by }, alarm), ask);
  }

  function end(alarm) {
    const about = el("p", {}, el("strong", {}, name), ": The cause is gone. The alarm does not stand any more.");
    openSigned("End the alarm", about, "End it", (by) => told({ verdict: "true", ends: true, by }, alarm), null);
  }

  async function told(body, alarm) {
    await post(`anomaly/${part(name)}/verdict`, { ...body, alarm_at_s: alarm.alarm_at_s });
    say("Said");
    changed();
  }

  function buttons(alarm, labels) {
    const button = (verdict) =>
      el(
        "button",
        {
          type: "button",
          class: "button",
          "data-verdict": verdict,
          "aria-pressed": String(alarm.said?.verdict === verdict),
          disabled: !may("operator"),
          onclick: () => give(verdict, alarm, labels),
        },
        VERDICTS[verdict],
      );
    return el(
      "div",
      { class: "acts", role: "group", "aria-label": "What the alarm was" },
      ["true", "false", "known"].map(button),
      alarm.state === "stands"
        ? el("button", { type: "button", class: "button", disabled: !may("operator"), onclick: () => end(alarm) }, "End it")
        : null,
    );
  }

  function write(shown) {
    const verdicts = shown?.verdicts ?? null,
      why = shown?.why ?? null,
      alarms = list(verdicts?.alarms),
      alarm = alarms[0] ?? null;
    setHidden(element, !alarm && !why);
    if (element.hidden) return;
    const key = JSON.stringify([why, shown.told, shown.knows, shown.is_alarm, verdicts, may("operator")]);
    if (key === before) return;
    before = key;
    const labels = [...new Set(alarms.map((one) => one.said?.label).filter(Boolean))].slice(0, LABELS_MAX);
    const limits = list(verdicts?.limits);
    element.dataset.state = shown.is_alarm === true ? "alarm" : (alarm?.state ?? "over");
    element.replaceChildren(
      ...[
        el("h2", {}, shown.is_alarm === true ? "Anomaly alarm" : "The last anomaly alarm"),
        why ? el("p", { class: "sentence" }, sentenceOf(why, shown.told)) : alarm ? el("p", { class: "sentence" }, past(alarm)) : null,
        why ? band(why) : null,
        why || shown.knows
          ? el(
              "p",
              { class: "facts" },
              why ? [el("span", {}, likes(why)), el("span", {}, shownBy(why))] : null,
              shown.knows ? el("span", {}, `Known of what runs: ${shown.knows}.`) : null,
            )
          : null,
        alarm?.said ? el("p", { class: "said" }, saidOf(alarm)) : null,
        alarm ? buttons(alarm, labels) : null,
        alarm && !may("operator") ? el("p", { class: "note" }, whyNot("operator", "a verdict")) : null,
        verdicts?.precision ? el("p", { class: "note" }, `${verdicts.precision}.`) : null,
        verdicts?.suggestion ? el("p", { class: "note" }, `${verdicts.suggestion}; nothing is changed by itself.`) : null,
        limits.length
          ? el(
              "details",
              {},
              el("summary", {}, `Limits that false alarms have raised (${verdicts.raised ?? limits.length})`),
              el("ul", { class: "plainlist" }, limits.map((one) => el("li", {}, limitOf(one)))),
            )
          : null,
      ].filter(Boolean),
    );
  }

  return { element, write };
}

/** An alarm that is over, of which only the memory is left. */
function past(alarm) {
  const signals = (Array.isArray(alarm.signals) ? alarm.signals : []).map((one) => title(String(one).split(", ")[0]));
  const from = moment(alarm.alarm_at_s * 1000, { seconds: false }),
    to = Number.isFinite(alarm.ended_s) ? ` to ${moment(alarm.ended_s * 1000, { seconds: false })}` : "";
  return `${[...new Set(signals)].join(", ") || "Score"}, in ${alarm.operation || "an operation without a name"}, from ${from}${to}.`;
}
