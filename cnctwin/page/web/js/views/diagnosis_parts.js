// The parts of a machine that a diagnosis compared alone, the constants that moved, and what is described but has no name.

import { columnHead, el } from "../dom.js";
import { lookup } from "../lookup.js";
import { number, recorded, sentence, share, words } from "../text.js";
import { shade } from "./gap_shade.js";

const CALLED = lookup({
  healthy: "healthy",
  explained: "explained",
  partly_explained: "partly explained",
  unknown: "cause unknown",
});
const SITES = lookup({ axis_force: "Force", friction: "Friction", heat_input: "Heat input", heat_loss: "Heat loss" });

const list = (value) => (Array.isArray(value) ? value : []);
const place = (on) => (on ? ` on ${on.length <= 2 ? on.toUpperCase() : recorded(on)}` : "");

export function partsSections(diagnosis) {
  return [parts(list(diagnosis.subsystems)), learned(list(diagnosis.learned)), constants(list(diagnosis.constants))];
}

function table(label, name, titles, rows) {
  const head = titles.map(([title, isNumber]) => columnHead(title, isNumber));
  return el(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": label },
    el("table", { class: name }, el("thead", {}, el("tr", {}, head)), el("tbody", {}, rows)),
  );
}

function parts(found) {
  if (!found.length) return null;
  const rows = found.map((one) =>
    el(
      "tr",
      {},
      el("th", { scope: "row" }, String(one.subsystem).replace(/^./, (first) => first.toUpperCase())),
      el("td", {}, recorded(one.compared)),
      el("td", {}, el("span", { class: `swatch ${shade(one.before)}` }, number(one.before))),
      el("td", {}, el("span", { class: `swatch ${shade(one.after)}` }, number(one.after))),
      el("td", {}, CALLED[one.verdict] ?? words(one.verdict)),
      el("td", {}, list(one.causes).map(words).join(", ")),
    ),
  );
  const titles = [["Part"], ["Compared"], ["Before, × repeatability"], ["After"], ["Verdict"], ["Causes"]];
  return el("section", {}, el("h2", {}, "Part by part"), table("Parts compared alone", "where", titles, rows));
}

function learned(found) {
  if (!found.length) return null;
  const terms = found.map((one) =>
    el(
      "article",
      { class: "cause" },
      el(
        "h3",
        {},
        `${SITES[one.site] ?? words(one.site)}${place(one.on)}`,
        el("span", { class: "quiet" }, `closes ${share(one.closure)} · ${one.repeats ? "repeats" : "does not repeat"}`),
      ),
      el("p", {}, sentence(one.sentence)),
      list(one.looks_like).length
        ? el(
            "p",
            { class: "doubt" },
            el("strong", {}, "Looks like "),
            `${list(one.looks_like)
              .map((like) => `${words(like.effect).toLowerCase()}${place(like.on)}, but ${like.why_not}`)
              .join("; ")}.`,
          )
        : null,
    ),
  );
  return el("section", {}, el("h2", {}, "What has no name, described"), terms);
}

function constants(moved) {
  if (!moved.length) return null;
  const rows = moved.map((one) =>
    el(
      "tr",
      {},
      el("th", { scope: "row" }, el("code", {}, one.name)),
      el("td", { class: "number" }, number(one.stated)),
      el("td", { class: "number" }, number(one.found)),
      el("td", { class: "number" }, `${number(one.deviations)} σ`),
      el("td", { class: "number" }, share(one.closure)),
    ),
  );
  const titles = [["Constant"], ["Stated", 1], ["Found", 1], ["Moved by", 1], ["Takes of the gap", 1]];
  return el("section", {}, el("h2", {}, "What the constants take up"), table("Constants that moved", "where", titles, rows));
}
