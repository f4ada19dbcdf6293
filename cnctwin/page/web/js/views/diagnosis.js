// A diagnosis.json in sections: the verdict, how far the gap shrank, where it lies, the causes, what cannot be told, what next.

import { columnHead, drawn, el, say, symbol } from "../dom.js";
import { lookup } from "../lookup.js";
import { REPEATABILITY, inPageWords, number, recorded, sentence, share, words } from "../text.js";
import { partsSections } from "./diagnosis_parts.js";
import { shade } from "./gap_shade.js";

const VERDICTS = lookup({
  healthy: ["Healthy", "s-ack"],
  explained: ["Explained", "s-ack"],
  partly_explained: ["Partly explained", "s-pending"],
  unknown: ["Cause unknown", "s-alert"],
});
const CELLS_MAX = 8;

const on = (one) =>
  one.on ? `${words(one.effect)} on ${one.on.length === 1 ? one.on.toUpperCase() : recorded(one.on)}` : words(one.effect);
const list = (value) => (Array.isArray(value) ? value : []);

export function diagnosisSections(diagnosis, report) {
  const [parts, learned, constants] = partsSections(diagnosis);
  return [
    verdict(diagnosis, report),
    parts,
    where(list(diagnosis.where)),
    shrinks(diagnosis.gap),
    causes(list(diagnosis.causes)),
    learned,
    constants,
    untold(diagnosis),
  ].filter(Boolean);
}

function verdict(diagnosis, report) {
  const [word, sign] = VERDICTS[diagnosis.verdict] ?? [words(diagnosis.verdict), "s-unknown"],
    gap = diagnosis.gap ?? {};
  const fact = (term, value, small) =>
    el("div", {}, el("dt", {}, term), el("dd", {}, value, small ? el("small", {}, small) : null));
  const between =
    Number.isFinite(gap.closure_low) && Number.isFinite(gap.closure_high)
      ? `90 % interval ${share(gap.closure_low)} to ${share(gap.closure_high)}`
      : "";
  return el(
    "section",
    {},
    el("h2", {}, "Last diagnosis, of recorded runs"),
    el(
      "div",
      { class: "verdict" },
      el("span", { class: "called", "data-verdict": diagnosis.verdict }, symbol(sign), word),
      el("p", { class: "sentence" }, inPageWords(diagnosis.sentence)),
    ),
    el(
      "dl",
      { class: "figures" },
      fact("Gap, before → after", `${number(gap.before)} → ${number(gap.after)}`, `rms, ${REPEATABILITY}, on runs not fitted`),
      fact("Closed of what can be closed", share(gap.closure), between),
      fact("Repeatability", number(gap.floor ?? 1), "what two runs of the same program differ by"),
      Number.isFinite(gap.as_stated) ? fact("Gap of the file as it is", number(gap.as_stated), "before the constants of the machine's file were refitted") : null,
    ),
    report
      ? el("p", {}, el("a", { class: "button report", href: report, target: "_blank", rel: "noopener" }, "Open the whole report"))
      : null,
  );
}

function where(cells) {
  const shown = cells.filter((one) => one.discovered !== false && one.share > 0.005).slice(0, CELLS_MAX);
  if (!shown.length) return null;
  const rows = shown.map((one) =>
    el(
      "tr",
      {},
      el("th", { scope: "row" }, recorded(one.signal)),
      el("td", {}, String(one.regime ?? "").replace(/ -$/, " −")),
      el("td", { class: "number" }, share(one.share)),
      el("td", {}, el("span", { class: `swatch ${shade(one.rms)}` }, number(one.rms))),
      el("td", {}, String(one.sentence ?? "")),
    ),
  );
  return el(
    "section",
    {},
    el("h2", {}, "Where it lies"),
    el(
      "div",
      { class: "scroll", tabindex: "0", role: "region", "aria-label": "Where the gap lies" },
      el(
        "table",
        { class: "where" },
        el(
          "thead",
          {},
          el(
            "tr",
            {},
            ["Signal", "Regime", "Share of the gap", REPEATABILITY, "In words"].map((text, i) =>
              columnHead(text, i === 2),
            ),
          ),
        ),
        el("tbody", {}, rows),
      ),
    ),
  );
}

function shrinks(gap) {
  const signals = Object.entries(gap?.by_signal ?? {});
  if (!signals.length) return null;
  const over = (value, one) => Math.max(0, Math.log10(Math.max(value / one.floor, 0.7)));
  const most = Math.max(
    0.5,
    ...signals.map(([, one]) => over(one.before, one)),
    ...signals.map(([, one]) => over(one.after, one)),
  );
  const rows = signals.map(([signal, one]) => {
    const place = (value) => `${(3 + (94 * over(value, one)) / most).toFixed(1)}%`;
    const svg = drawn(
      "svg",
      { "aria-hidden": "true" },
      drawn("line", { x1: "0", x2: "100%", y1: 9, y2: 9, class: "rail" }),
      drawn("line", { x1: place(one.after), x2: place(one.before), y1: 9, y2: 9, class: "between" }),
      drawn("circle", { cx: place(one.before), cy: 9, r: 6, class: "dot-before" }),
      drawn("rect", { x: place(one.after), y: 3, width: 12, height: 12, transform: "translate(-6 0)", class: "dot-after" }),
    );
    return el(
      "tr",
      {},
      el("th", { scope: "row" }, recorded(signal)),
      el("td", { class: "number" }, number(one.before)),
      el("td", { class: "number" }, number(one.after)),
      el("td", { class: "number" }, number(one.floor)),
      el("td", {}, one.unit),
      el("td", {}, el("span", { class: "pairbar" }, svg)),
    );
  });
  return el(
    "section",
    {},
    el("h2", {}, "Before and after"),
    el(
      "div",
      { class: "scroll", tabindex: "0", role: "region", "aria-label": "Before and after by signal" },
      el(
        "table",
        { class: "shrinks" },
        el(
          "thead",
          {},
          el(
            "tr",
            {},
            ["Signal", "Before", "After", "Repeatability", "Unit", "● before, ■ after, from the repeatability on (left edge), logarithmic"].map(
              (text, i) => columnHead(text, i > 0 && i < 4),
            ),
          ),
        ),
        el("tbody", {}, rows),
      ),
    ),
  );
}

function causes(found) {
  if (!found.length) return null;
  const parameter = ([name, one]) =>
    el(
      "tr",
      {},
      el("th", { scope: "row" }, el("code", {}, name)),
      el("td", { class: "number" }, `${number(one.value)} ${one.unit ?? ""}`),
      el("td", {}, Number.isFinite(one.low) ? `${number(one.low)} to ${number(one.high)} (90 %)` : ""),
    );
  return el(
    "section",
    {},
    el("h2", {}, found.length === 1 ? "The cause" : "The causes"),
    found.map((one) =>
      el(
        "article",
        { class: "cause" },
        el(
          "h3",
          {},
          on(one),
          el("span", { class: "quiet" }, `closes ${share(one.closure)} · probability ${share(one.probability)}`),
        ),
        el("table", {}, el("tbody", {}, Object.entries(one.parameters ?? {}).map(parameter))),
        list(one.indistinguishable_from).length
          ? el(
              "p",
              { class: "doubt" },
              el("strong", {}, "Not told apart from "),
              list(one.indistinguishable_from).map(on).join(", "),
              " by these recordings.",
            )
          : null,
      ),
    ),
  );
}

function untold(diagnosis) {
  const reasons = new Map();
  for (const one of list(diagnosis.not_observable))
    reasons.set(one.why, [...(reasons.get(one.why) ?? []), words(one.effect).toLowerCase()]);
  const next = diagnosis.next_experiment,
    columns = [];
  if (reasons.size || list(diagnosis.not_identifiable).length) {
    columns.push(
      el(
        "div",
        {},
        el("h2", {}, "What these runs cannot tell"),
        el(
          "ul",
          { class: "plainlist" },
          [...reasons].map(([why, effects]) => el("li", {}, `${effects.join(", ")}: `, el("span", { class: "quiet" }, why))),
          list(diagnosis.not_identifiable).map((text) => el("li", {}, String(text))),
        ),
      ),
    );
  }
  if (next) {
    const program = el("pre", { tabindex: "0" }, String(next.program ?? ""));
    const copy = el("button", { type: "button", class: "button", onclick: () => copied(program, copy) }, "Copy the program");
    columns.push(
      el(
        "div",
        {},
        el("h2", {}, "Next experiment"),
        el("p", {}, sentence(next.why)),
        next.program
          ? el(
              "details",
              {},
              el("summary", {}, `The program${next.seconds ? `, ${Math.round(next.seconds)} s` : ""}`),
              program,
              el("p", { class: "note" }, "Look at the program before you run it."),
              copy,
            )
          : null,
      ),
    );
  }
  return columns.length ? el("section", { class: "columns" }, columns) : null;
}

async function copied(source, button) {
  try {
    await navigator.clipboard.writeText(source.textContent);
    button.textContent = "Copied";
    say("Copied");
  } catch {
    getSelection().selectAllChildren(source);
    button.textContent = "Selected: copy with Ctrl C";
  }
}
