// What the loop of a machine shows, in parts: where it stands, the answer, both standing gaps side by side, and what was done.

import { el, symbol, table } from "../dom.js";
import { lookup } from "../lookup.js";
import { REPEATABILITY, REPEATABILITY_MEANS, coarse, inPageWords, moment, number, recorded, sentence, share, title, words } from "../text.js";

const STEPS = [
  ["watching", "Watch", "twin and machine are compared all the time"],
  ["composing", "Compose", "the stretch is cut out of the history"],
  ["diagnosing", "Diagnose", "effects are tried on it, one after the other"],
  ["shadow", "Try", "the answer runs beside the live twin, as its challenger"],
  ["promoted", "Promote", "the challenger becomes the live twin"],
];
const VERDICTS = lookup({
  healthy: "healthy",
  explained: "explained",
  partly_explained: "partly explained",
  unknown: "cause unknown",
});
const DEEDS = lookup({ promote: "Promoted", back: "Went back", challenge: "Challenger", withdraw: "Withdrawn", edit: "Edited" });
const HISTORY_MAX = 50;
const FULL_MIN = 3; // × repeatability, as all gaps here
const CLOSED_MAX = 1.3;

const list = (value) => (Array.isArray(value) ? value : []);

/** An effect in words, and what it is on. */
export const called = (one) =>
  one.on ? `${words(one.effect)} on ${one.on.length === 1 ? one.on.toUpperCase() : recorded(one.on).toLowerCase()}` : words(one.effect);

/** A parameter in words, without the unit at its end. */
export const parameter = (name) =>
  words(name.replace(/_(s|n|k|kw|mm|rpm_s|rpm|w_per_k|j_per_k)$/, "")).toLowerCase();

/** A sentence of the loop; a version that it begins with stays as it is. */
export const told = (text) => {
  const said = inPageWords(text);
  return /^[0-9a-f]{12} /.test(said) ? said : sentence(said);
};

/** Where the loop stands: one of five steps, or refused. */
export function steps(loop) {
  const at = STEPS.findIndex(([name]) => name === loop.step);
  return el(
    "ol",
    { class: "loopsteps", "aria-label": "Steps of the loop" },
    STEPS.map(([, word, about], i) =>
      el(
        "li",
        {
          "data-at": i < at || loop.step === "promoted" ? "done" : i === at ? "now" : "ahead",
          "aria-current": i === at ? "step" : null,
          title: about,
        },
        symbol(i < at || loop.step === "promoted" ? "s-ack" : i === at ? "s-active" : "s-ready"),
        el("span", {}, word),
      ),
    ),
  );
}

/** What is found: the causes with size, certainty, and what they cannot be told from. */
export function answer(found) {
  const causes = list(found.causes),
    unit = (one) => (one.unit && one.unit !== "unit of the signal" ? ` ${one.unit}` : "");
  const gaps = [found.gap_before, found.gap_after].every(Number.isFinite)
    ? `gap ${coarse(found.gap_before)} → ${coarse(found.gap_after)} ${REPEATABILITY}, on a stretch that it was not fitted to`
    : "";
  return el(
    "div",
    { class: "answer" },
    el("h3", {}, "The answer"),
    el("p", { class: "sentence" }, told(found.sentence)),
    el("p", { class: "quiet" }, [VERDICTS[found.verdict] ?? words(found.verdict), gaps].filter(Boolean).join(" · ")),
    causes.map((one) =>
      el(
        "article",
        { class: "cause" },
        el("h4", {}, called(one), el("span", { class: "quiet" }, `probability ${share(one.probability)}`)),
        el(
          "p",
          {},
          Object.entries(one.parameters ?? {}).map(([name, size], i) => [
            i ? "; " : "",
            `${parameter(name)} `,
            el("strong", {}, `${number(size.value)}${unit(size)}`),
            Number.isFinite(size.low) ? ` (${number(size.low)} to ${number(size.high)})` : "",
          ]),
        ),
        list(one.indistinguishable_from).length
          ? el(
              "p",
              { class: "doubt" },
              el("strong", {}, "Not told apart from "),
              `${list(one.indistinguishable_from).map(called).join(", ")} by this stretch.`,
            )
          : null,
      ),
    ),
  );
}

function bar(kind, word, value, full) {
  const known = Number.isFinite(value),
    width = known ? Math.min(100, (100 * value) / full) : 0;
  const fill = el("span", { class: `fill ${kind}`, "data-closed": known && value <= CLOSED_MAX });
  fill.style.width = `${width.toFixed(1)}%`;
  const repeatability = el("span", { class: "one" });
  repeatability.style.left = `${(100 / full).toFixed(1)}%`;
  return el(
    "div",
    { class: "gapbar" },
    el("span", { class: "what" }, word),
    el("span", { class: "rail", "aria-hidden": "true" }, fill, repeatability),
    el("span", { class: "figure" }, known ? coarse(value) : "–"),
  );
}

/** The standing gap by signal, live and of the challenger. standing: signal → {live, challenger}, as multiples of the repeatability. */
export function bars(standing, hasChallenger) {
  const rows = Object.entries(standing).filter(([, one]) => Number.isFinite(one.live) || Number.isFinite(one.challenger));
  if (!rows.length) return el("p", { class: "quiet" }, "No standing gap yet; below stands when each signal has one.");
  const full = Math.max(FULL_MIN, ...rows.flatMap(([, one]) => [one.live ?? 0, one.challenger ?? 0])) * 1.05;
  return el(
    "div",
    { class: "gapbars" },
    rows.map(([signal, one]) =>
      el(
        "div",
        { class: "pair", "data-signal": signal },
        el("h4", {}, title(signal)),
        bar("live", "live twin", one.live, full),
        hasChallenger ? bar("challenger", "challenger", one.challenger, full) : null,
      ),
    ),
    el("p", { class: "note" }, `Standing gap, ${REPEATABILITY}; the line is at 1. ${sentence(REPEATABILITY_MEANS)}.`),
  );
}

/** What the score on kept data says, in a sentence. */
export function score(found) {
  if (!found) return null;
  const runs = found.runs === 1 ? "one kept run" : `${found.runs} kept runs`;
  return el("p", { class: "note" }, `On ${runs}: live ${coarse(found.live)}, challenger ${coarse(found.challenger)} ${REPEATABILITY}.`);
}

/** Every step that was taken, the newest first. */
export function history(taken) {
  if (!list(taken).length) return null;
  const gap = (one) =>
    Number.isFinite(one.before) && Number.isFinite(one.after) ? `${coarse(one.before)} → ${coarse(one.after)} ${REPEATABILITY}` : "";
  const rows = list(taken)
    .slice(-HISTORY_MAX)
    .reverse()
    .map((one) => [
      moment(one.t),
      DEEDS[one.step] ?? words(one.step),
      String(one.by ?? ""),
      inPageWords(one.why),
      gap(one),
      el("code", {}, String(one.version ?? "").slice(0, 12)),
    ]);
  return el(
    "details",
    {},
    el("summary", {}, `What was done, ${rows.length} ${rows.length === 1 ? "step" : "steps"}`),
    table(["When", "Step", "By", "Why", "Gap", "Version"], rows, { label: "Steps of the loop", className: "taken" }),
  );
}
