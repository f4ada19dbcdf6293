// Proof: the nightly comparison with ground truth, and the as-built record of each part.

import { get, part, query } from "../api.js";
import { serverNow } from "../clock.js";
import { openDocument } from "../dialogs.js";
import { columnHead, el, symbol } from "../dom.js";
import { lookup } from "../lookup.js";
import { REPEATABILITY, age, coarse, duration, moment, number, plain, words } from "../text.js";
import { machineHead } from "./machine_head.js";
import { noMachine } from "./no_machine.js";

const VERDICTS = lookup({ within: "s-ack", over: "s-alert", "not enough data": "s-pending", "not observable": "s-unknown" });
const MEASURES = lookup({
  mae: "MAE",
  rmse: "RMSE",
  mae_worst_hour: "MAE, worst hour",
  rmse_worst_hour: "RMSE, worst hour",
  mape: "MAPE",
  r: "correlation r",
  rms_pct: "rms",
  error_pct: "error",
});
const PARTS_MAX = 50;
const list = (value) => (Array.isArray(value) ? value : []);
const time = (value) => (typeof value === "number" ? value : Date.parse(value));

const pass = (verdict) =>
  el("span", { class: "pass", "data-verdict": verdict }, symbol(VERDICTS[verdict] ?? "s-unknown"), verdict ?? "not judged");

function figures(found) {
  if (!found || !found.t)
    return el(
      "div",
      { class: "empty" },
      el("h3", {}, "Not validated yet"),
      el(
        "p",
        {},
        "Each night the twin is compared with what was recorded: temperature, force, vibration, following error, cycle time. By hand:",
      ),
      el("pre", {}, "cnctwin validate --machine NAME --config processors.toml"),
      el("p", { class: "note" }, found?.reason ?? ""),
    );
  const row = (one) =>
    el(
      "tr",
      {},
      el("th", { scope: "row" }, `${words(one.quantity)}${one.on ? `, ${one.on}` : ""}`),
      el("td", {}, MEASURES[one.measure] ?? words(one.measure)),
      el("td", { class: "number" }, one.value === null ? "–" : `${number(one.value)} ${one.unit ?? ""}`),
      el("td", { class: "number" }, one.low === null || one.low === undefined ? "" : `${number(one.low)} to ${number(one.high)}`),
      el(
        "td",
        { class: "number" },
        one.budget === null || one.budget === undefined ? "–" : `${number(one.budget)} ${one.unit ?? ""}`,
      ),
      el("td", {}, pass(one.verdict), one.reason ? el("p", { class: "why" }, one.reason) : null),
    );
  return [
    found.retrain
      ? el("p", { class: "trouble" }, el("strong", {}, "Retrain: "), found.retrain_reason ?? "two nights over budget")
      : null,
    el(
      "div",
      { class: "scroll", tabindex: "0", role: "region", "aria-label": "Validation" },
      el(
        "table",
        {},
        el(
          "thead",
          {},
          el(
            "tr",
            {},
            ["Quantity", "Measure", "Value", "95 % interval", "Budget", ""].map((text, i) =>
              columnHead(text, i > 1 && i < 5),
            ),
          ),
        ),
        el("tbody", {}, list(found.figures).map(row)),
      ),
    ),
    el(
      "p",
      { class: "note" },
      `Judged ${age(serverNow() - found.t)} ago, at ${moment(found.t)}. Nights kept: ${
        list(found.nights)
          .map((night) => `${night.night} ${night.verdict}`)
          .slice(-7)
          .join(", ") || "none"
      }.`,
    ),
  ];
}

/** A part's record in a row (docs/reference/part_record.schema.json); what it does not have is a dash, with the reasons at its end. */
function recordRow(record) {
  const cycle = record.cycle?.cycle_time_s,
    force = Math.max(...list(record.tools).map((tool) => tool?.force_n?.max ?? -Infinity)),
    heat = record.temperature,
    gaps = Object.values(record.gap ?? {})
      .map((one) => one?.end)
      .filter(Number.isFinite);
  const tools = list(record.tools)
    .filter((tool) => tool?.tool !== null && tool?.tool !== undefined)
    .map((tool) => `T${tool.tool}`);
  return el(
    "tr",
    {},
    el("td", {}, moment(time(record.ended ?? record.t))),
    el("th", { scope: "row" }, plain(record.program)),
    el("td", { class: "number" }, plain(record.part_number)),
    el("td", { class: "number" }, Number.isFinite(cycle) ? duration(cycle * 1000) : "–"),
    el("td", {}, tools.join(", ") || "–"),
    el("td", { class: "number" }, heat && Number.isFinite(heat.max) ? `${number(heat.max, heat.unit)} ${heat.unit ?? ""}` : "–"),
    el("td", { class: "number" }, Number.isFinite(force) ? `${number(force, "N")} N` : "–"),
    el("td", { class: "number" }, gaps.length ? coarse(Math.max(...gaps)) : "–"),
    el(
      "td",
      {},
      words(record.ended_by ?? ""),
      record.complete === false ? el("p", { class: "why" }, `not complete: ${list(record.reasons).join("; ")}`) : null,
    ),
    el(
      "td",
      {},
      el(
        "button",
        {
          type: "button",
          class: "button",
          onclick: () => openDocument(`Part ${plain(record.part_number)} of ${plain(record.program)}`, record),
        },
        "Record",
      ),
    ),
  );
}

function parts(found) {
  const records = list(found?.parts).slice(0, PARTS_MAX);
  if (!records.length)
    return el(
      "div",
      { class: "empty" },
      el("h3", {}, "No part yet"),
      el("p", {}, "A part's record (program, tools, times, temperature, force, gap) is written when its program ends."),
      el("p", { class: "note" }, found?.reason ?? ""),
    );
  return el(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": "Parts" },
    el(
      "table",
      { class: "parts" },
      el(
        "thead",
        {},
        el(
          "tr",
          {},
          ["Made", "Program", "Part", "Cycle", "Tools", "Spindle, hottest", "Force, largest", `Gap, ${REPEATABILITY}`, "How it ended", ""].map(
            (text, i) => columnHead(text, [2, 3, 5, 6, 7].includes(i)),
          ),
        ),
      ),
      el("tbody", {}, records.map(recordRow)),
    ),
  );
}

export function open(app, { machine: named }) {
  const name = app.pick(named);
  if (name === null)
    return noMachine(app, "Parts and validation", "Parts are made by a machine, and its twin is validated; there is none so far.");
  const element = el("div", { class: "view validation-view" }),
    stop = new AbortController(),
    machine = app.plant.machine(name),
    head = machineHead(app, machine, "parts");
  let isOtherClock = null;
  const made = el("div", {}, el("p", { class: "waiting" }, "Loading …")),
    proof = el("div", {}, el("p", { class: "waiting" }, "Loading …"));
  element.append(
    head.element,
    el("section", {}, el("h2", {}, "Parts made, as built"), made),
    el("section", {}, el("h2", {}, "Validation against ground truth"), proof),
  );

  const load = async () => {
    const into = async (path, host, show) => {
      try {
        host.replaceChildren(...[show(await get(path, { signal: stop.signal }))].flat().filter(Boolean));
      } catch (error) {
        if (error.status !== -1)
          host.replaceChildren(...[show({ reason: `The server says: ${error.message}` })].flat().filter(Boolean));
      }
    };
    isOtherClock = machine.otherClock;
    const made_ = query(`parts/${part(name)}`, { to: isOtherClock ? Math.ceil(machine.now()) + 1 : null });
    await Promise.all([into(made_, made, parts), into(`validation/${part(name)}`, proof, figures)]);
  };
  load();
  const tick = setInterval(head.write, 1000);
  return {
    title: `Parts of ${name}`,
    element,
    machine: name,
    stream: `stream?machine=${part(name)}`,
    keys: [[["l"], "reload", load]],
    update() {
      head.write();
      if (machine.otherClock !== isOtherClock) load();
    },
    close() {
      stop.abort();
      clearInterval(tick);
    },
  };
}
