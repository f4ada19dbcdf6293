// The gap: where it stands now, whether it grows, what the last diagnosis found, how far it shrank, and what cannot be told.

import { get, part } from "../api.js";
import { el, say, setText, symbol } from "../dom.js";
import {
  REPEATABILITY,
  REPEATABILITY_MEANS,
  age,
  between,
  coarse,
  moment,
  number,
  plain,
  sentence,
  signed,
  title,
  typed,
} from "../text.js";
import { serverNow } from "../clock.js";
import { TILES, tileOf } from "../charted.js";
import { diagnosisSections } from "./diagnosis.js";
import { shade } from "./gap_shade.js";
import { machineHead } from "./machine_head.js";
import { noMachine } from "./no_machine.js";
import { twinLoop } from "./twin_loop.js";

const AGAIN_MS = 15000;
const REGIMES = ["warm_up", "steady", "cool_down", "air"];

const regimeWord = (regime) => (regime === null ? "overall" : regime.replaceAll("_", " ").replace(/^cutting[: ]?/, "cutting "));

function cell(value) {
  if (!value || value.value === null) return el("td", { class: "none", title: value?.reason ?? "" }, "–");
  const old = value.quality !== "good";
  return el(
    "td",
    { class: `${shade(value.value)} ${old ? "stale-here" : ""}`, title: value.reason ?? value.meaning ?? "" },
    coarse(value.value),
    old ? el("small", {}, "stale") : null,
  );
}

function standing(gap) {
  const signals = [...new Set(gap.standing.map((one) => one.signal))];
  if (!signals.length)
    return el(
      "div",
      { class: "empty" },
      el("h3", {}, "No standing gap is published"),
      el(
        "p",
        {},
        "The processors ",
        el("code", {}, "gap"),
        " and ",
        el("code", {}, "thermal"),
        " compare twin and machine all the time. Start them:",
      ),
      el("pre", {}, "cnctwin process thermal gap --config processors.toml"),
    );
  const found = (signal, regime) => gap.standing.find((one) => one.signal === signal && one.regime === regime);
  const size = (signal) => found(signal, null)?.gap.value ?? -1;
  const known = signals
    .filter((signal) => gap.standing.some((one) => one.signal === signal && one.gap.value !== null))
    .sort((a, b) => size(b) - size(a));
  const place = (regime) => (regime === null ? -1 : REGIMES.includes(regime) ? REGIMES.indexOf(regime) : 9);
  const regimes = [...new Set(gap.standing.filter((one) => known.includes(one.signal)).map((one) => one.regime))].sort(
    (a, b) => place(a) - place(b) || String(a).localeCompare(String(b)),
  );
  const reasons = new Map();
  for (const one of gap.standing)
    if (one.regime === null || known.includes(one.signal))
      if (one.gap.reason)
        reasons.set(one.gap.reason, [
          ...(reasons.get(one.gap.reason) ?? []),
          `${title(one.signal).toLowerCase()}${one.regime ? `, ${regimeWord(one.regime)}` : ""}`,
        ]);
  const rows = known.map((signal) => {
    const mean = found(signal, null)?.mean;
    return el(
      "tr",
      {},
      el("th", { scope: "row" }, title(signal)),
      regimes.map((regime) => (found(signal, regime) ? cell(found(signal, regime).gap) : el("td", { class: "none" }, ""))),
      el(
        "td",
        { class: "mean" },
        mean && mean.value !== null ? `${mean.value > 0 ? "+" : ""}${coarse(mean.value)} ${mean.unit ?? ""}` : "–",
      ),
    );
  });
  const texts = ["< 1.3", "1.3", "2", "3", "6", "12", "24 +"];
  const why = reasons.size
    ? el(
        "details",
        { open: !known.length },
        el("summary", {}, known.length ? "What is not in it, and why" : "Why there is none yet"),
        el(
          "ul",
          { class: "plainlist note" },
          [...reasons].map(([reason, where]) => el("li", {}, `${[...new Set(where)].join("; ")}: ${reason}`)),
        ),
      )
    : null;
  if (!known.length)
    return [
      el(
        "p",
        {},
        "No standing gap yet. A signal whose repeatability is given has one after about a minute in a regime. The repeatability of the others is learned first: the reasons below say until when. What twin and machine differ by at this moment stands above.",
      ),
      why,
    ];
  return [
    el(
      "div",
      { class: "scroll", tabindex: "0", role: "region", "aria-label": "Standing gap by signal and regime" },
      el(
        "table",
        { class: "heat" },
        el(
          "thead",
          {},
          el(
            "tr",
            {},
            el("th", { scope: "col" }, "Signal"),
            regimes.map((regime) => el("th", { scope: "col" }, regimeWord(regime))),
            el("th", { scope: "col" }, "mean, twin − measured"),
          ),
        ),
        el("tbody", {}, rows),
      ),
    ),
    el(
      "div",
      { class: "legend" },
      el("span", {}, `rms of twin − measured, ${REPEATABILITY}; inferred. ${sentence(REPEATABILITY_MEANS)}.`),
      el(
        "span",
        { class: "scale", "aria-hidden": "true" },
        texts.map((text, i) => el("span", { class: `swatch h${i}` }, text)),
      ),
    ),
    why,
  ];
}

function growth(app, name, gap) {
  const { growing } = gap;
  if (!growing) return el("p", { class: "note" }, "Whether it grows is not published.");
  if (growing.value === null)
    return el(
      "p",
      {},
      el("span", { class: "chip" }, symbol("s-pending"), "growth not judged yet"),
      " ",
      el("span", { class: "why" }, growing.reason ?? ""),
    );
  if (!growing.value)
    return el(
      "p",
      {},
      el("span", { class: "chip kind-active" }, symbol("s-ack"), "not growing"),
      " ",
      el(
        "span",
        { class: "why" },
        growing.quality === "good" ? `judged ${age(serverNow() - growing.t)} ago` : `stale since ${moment(growing.t)}`,
      ),
    );
  return el(
    "div",
    { class: "trouble" },
    el("p", {}, el("span", { class: "chip grow" }, symbol("s-grow"), "growing"), " ", plain(gap.growing_signal?.value)),
    gap.window
      ? el(
          "p",
          {},
          "Worst stretch: ",
          el(
            "a",
            { href: app.address("replay", name, { from: gap.window.from, to: gap.window.to }) },
            `${moment(gap.window.from)} to ${moment(gap.window.to)}`,
          ),
          ". Diagnose that recording.",
        )
      : null,
  );
}

function noDiagnosis(name, gap) {
  return el(
    "div",
    { class: "empty" },
    el("h2", {}, "No diagnosis yet"),
    el(
      "p",
      {},
      "Press Diagnose above: the loop cuts the last stretch of production out of the history and looks for the effect that makes the gap. Runs that you have recorded yourself make a case too:",
    ),
    el(
      "pre",
      {},
      gap?.diagnosis_do ?? `cnctwin gap diagnose CASE --out ${typed(`DIAGNOSES/${name}`)}\ncnctwin serve --diagnoses DIAGNOSES`,
    ),
    gap?.diagnosis_reason && !gap.diagnosis_do ? el("p", { class: "note" }, `The server says: ${gap.diagnosis_reason}`) : null,
  );
}

/** The difference of twin and machine at this moment; there before any standing gap is. */
function nowOf(machine) {
  const host = el("p", { class: "now livedata" });
  const write = () => {
    const texts = [];
    for (const tile of TILES) {
      const shown = tileOf(machine, tile);
      if (!shown?.twin || shown.twinIs !== "twin") continue;
      const own = machine.value(shown.own),
        twin = machine.value(shown.twin),
        rest = shown.residual ? machine.value(shown.residual) : null;
      const both = typeof own?.value === "number" && typeof twin?.value === "number",
        published = typeof rest?.value === "number" ? `${signed(rest.value, rest.unit)} ${rest.unit ?? ""}` : "not known";
      texts.push([
        `${tile.name}: measured ${number(own?.value, own?.unit)}, twin ${number(twin?.value, twin?.unit)} ${own?.unit ?? ""}: `,
        both ? between(own, twin) : published,
        own?.quality === "stale" ? ` (stale since ${moment(own.t)})` : "",
      ]);
    }
    const key = JSON.stringify(texts);
    if (host.dataset.key === key) return;
    host.dataset.key = key;
    host.replaceChildren(
      ...(texts.length
        ? texts.map(([said, figure, old]) => el("span", {}, said, el("span", { class: "gapfigure figure" }, figure), old))
        : [el("span", { class: "quiet" }, "No signal of this machine has a live twin now.")]),
    );
  };
  return { host, write };
}

export function open(app, { machine: named }) {
  const name = app.pick(named);
  if (name === null) return noMachine(app, "Gap", "The gap is that of a machine; there is none so far.");
  const element = el("div", { class: "view gap-view" }),
    stop = new AbortController(),
    head = machineHead(app, app.plant.machine(name), "gap");
  const body = el("div", {}, el("p", { class: "waiting" }, "Loading …")),
    trouble = el("p", { class: "trouble", role: "alert", hidden: true }),
    asOf = el("p", { class: "note" });
  const now = nowOf(app.plant.machine(name)),
    loop = twinLoop(app, name, () => load()),
    write = () => {
      head.write();
      now.write();
      loop.write();
    };
  const watched = el("p", {}, el("a", { href: app.address("machine", name) }, `Watch ${name} cut`), ": its curves and the twin's, live");
  const present = el("section", {}, el("h2", {}, "At this moment, measured − twin"), now.host);
  element.append(head.element, watched, loop.element, present, trouble, body, asOf);
  now.write();
  let shown = "",
    heardAt = null;

  async function load() {
    try {
      const gap = await get(`gap/${part(name)}`, { signal: stop.signal });
      trouble.hidden = true;
      heardAt = serverNow();
      show(gap);
    } catch (error) {
      if (error.status === -1) return;
      if (!shown) body.replaceChildren();
      setText(
        trouble,
        heardAt === null
          ? `The gap cannot be shown: ${error.message}.`
          : `Not up to date: ${error.message}. What you see is of ${moment(heardAt)}.`,
      );
      trouble.hidden = false;
      if (!shown && error.status !== 404) body.replaceChildren(noDiagnosis(name, null));
    }
  }

  function show(gap) {
    const live = { ...gap, now: 0 },
      key = JSON.stringify(live);
    setText(asOf, `As of ${moment(heardAt)}; asked again every ${AGAIN_MS / 1000} s.`);
    if (key === shown) return;
    const opened = [...body.querySelectorAll("details")].map((one) => one.open),
      scrolled = scrollY;
    shown = key;
    const left = gap.left_out_pct;
    body.replaceChildren(
      el(
        "section",
        {},
        el("h2", {}, "Standing gap: where it is, over the last hours"),
        standing(gap),
        growth(app, name, gap),
        left && left.value !== null
          ? el(
              "p",
              { class: "note" },
              `Left out: ${number(left.value, "%")} % of the time (tool changes, settling, inputs not known).`,
            )
          : null,
        gap.basis
          ? el("details", {}, el("summary", {}, "What these figures rest on"), el("p", { class: "note" }, gap.basis))
          : null,
      ),
      ...(gap.diagnosis ? diagnosisSections(gap.diagnosis, gap.report) : [el("section", {}, noDiagnosis(name, gap))]),
    );
    [...body.querySelectorAll("details")].forEach((one, i) => {
      one.open = opened[i] ?? one.open;
    });
    scrollTo(0, scrolled);
    say(`Gap of ${name} is shown`);
  }

  load();
  const timer = setInterval(() => {
    if (!document.hidden) load();
  }, AGAIN_MS);
  const tick = setInterval(write, 1000);
  return {
    title: `Gap of ${name}`,
    element,
    machine: name,
    stream: `stream?machine=${part(name)}`,
    keys: [
      [["v"], "open the report", () => body.querySelector("a.report")?.click()],
      [["l"], "reload", load],
      [["d"], "diagnose", () => loop.press("diagnose")],
      [["P"], "promote the challenger", () => loop.press("promote")],
    ],
    onMe: loop.onMe,
    update: write,
    onLink: (state) => {
      if (state === "live" && !shown) load();
    },
    close() {
      stop.abort();
      loop.close();
      clearInterval(timer);
      clearInterval(tick);
    },
  };
}
