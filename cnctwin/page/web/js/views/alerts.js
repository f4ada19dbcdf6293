// The alerts: what fires, by severity; who takes care of it; what is silenced; whether anybody was told.

import { get, part, post } from "../api.js";
import { serverNow } from "../clock.js";
import { openSigned } from "../dialogs.js";
import { el, say, setText, symbol, table } from "../dom.js";
import { lookup } from "../lookup.js";
import { may, whyNot } from "../me.js";
import { age, moment, words } from "../text.js";
import { anomalyPanel } from "./anomaly_panel.js";

const RANK = lookup({ high: 0, medium: 1, low: 2 }),
  PHASE = lookup({ firing: 0, acknowledged: 1, pending: 2, resolved: 3 });

/** The worst first: what fires unacknowledged, of that the most severe, of that the latest. */
export const worstFirst = (a, b) =>
  (PHASE[a.phase] ?? LAST) - (PHASE[b.phase] ?? LAST) ||
  (RANK[a.severity] ?? LAST) - (RANK[b.severity] ?? LAST) ||
  began(b) - began(a);

const SIGNS = lookup({ firing: "s-alert", acknowledged: "s-ack", pending: "s-pending", resolved: "s-ack" });
const LAST = 9; // of a phase or a severity that nobody knows
const AROUND_MS = 300000;
const RESOLVED_MAX = 20;
const ANOMALY = "anomaly_alarm";
const PANELS_MAX = 20;

/** The name of an alert in words. */
export const alertName = ({ labels = {} }) => words((labels.alertname ?? "alert").replace(/^rule_/, "").replace(/^twin\//, ""));

/** The sentence of an alert without the machine before it; the alert's name where there is none. */
export function sentence(alert) {
  const { labels = {}, annotations = {} } = alert;
  const told = annotations.summary ?? "",
    before = `${labels.machine ?? ""}: `;
  if (told) return told.startsWith(before) ? told.slice(before.length) : told;
  return alertName(alert);
}

const began = (alert) => Date.parse(alert.startsAt);
const ended = (alert) => {
  const at = Date.parse(alert.endsAt);
  return Number.isFinite(at) && at > 0 && alert.phase === "resolved" ? at : null;
};

export function open(app) {
  const body = el("div"),
    trouble = el("p", { class: "trouble", role: "alert", hidden: true }),
    counts = el("span", { class: "quiet" });
  const element = el(
    "div",
    { class: "view alerts-view" },
    el("div", { class: "head" }, el("h1", {}, "Alerts"), counts),
    trouble,
    body,
  );
  let shown = "",
    focused = null;
  const stop = new AbortController(),
    reasons = new Map(); // by machine: the panel of its anomaly alarm, while that is listed

  /** Asks why the scores alarm whose alerts are listed. A machine that the server does not know is not asked for again. */
  async function explain() {
    for (const [machine, panel] of reasons) {
      if (document.hidden || panel.unknown) continue;
      try {
        const told = await get(["anomaly", part(machine)].join("/"), { signal: stop.signal });
        panel.write({ ...told, told: told.why_t });
      } catch (error) {
        if (error.status === -1) return;
        if (error.status === 404) panel.unknown = true;
      }
    }
  }

  /** The panel of an alert of the score; of each machine one, the first. */
  function reasonOf(alert, taken) {
    const machine = alert.labels?.machine ?? "";
    if (alert.labels?.alertname !== ANOMALY || !machine || taken.has(machine) || taken.size >= PANELS_MAX) return null;
    taken.add(machine);
    if (!reasons.has(machine)) reasons.set(machine, anomalyPanel(app, machine, explain));
    return reasons.get(machine).element;
  }

  function acknowledge(alert) {
    const about = el(
      "p",
      {},
      el("strong", {}, alert.labels?.machine ?? ""),
      `: ${sentence(alert)}. It is neither repeated nor escalated. An alert that becomes more severe fires again.`,
    );
    openSigned("Acknowledge", about, "Acknowledge", async (by, comment) => {
      const outcome = await post(`alerts/${part(alert.fingerprint)}/acknowledge`, { by, comment, episode: alert.episode });
      if (outcome && outcome.done === false) throw new Error(outcome.text);
      say("Acknowledged");
      app.askAlerts();
    });
  }

  function silence(alert) {
    const { machine = "", alertname = "" } = alert.labels ?? {};
    const hours = el("input", { class: "field", name: "hours", type: "number", min: "0.1", max: "720", step: "any", value: "2" });
    const about = [
      el("p", {}, el("strong", {}, machine), `: ${sentence(alert)}. Nobody gets a notification of it until the silence ends; it stays on this page.`),
      el("label", { class: "named" }, "For how many hours", hours),
    ];
    openSigned("Silence", about, "Silence", async (by, comment) => {
      await post("silences", { machine, alertname, for_s: Number(hours.value) * 3600, by, comment });
      say("Silenced");
      app.askAlerts();
    });
  }

  function card(alert, taken) {
    const { labels = {}, annotations = {} } = alert,
      machine = labels.machine ?? "",
      start = began(alert),
      raised = alert.episode || start, // what it shows is of then; one that builds up for weeks began long before
      end = ended(alert);
    const facts = [
      el("span", {}, el("span", { class: "severity" }, alert.severity ?? ""), ` · ${alert.phase}`),
      el("span", {}, `since ${moment(start)} (${age((end ?? serverNow()) - start)})`),
      end ? el("span", {}, `resolved at ${moment(end)}`) : null,
      alert.acknowledged_by
        ? el("span", {}, `${alert.acknowledged_by}${alert.comment ? `: “${alert.comment}”` : " takes care of it"}`)
        : null,
      alert.silenced_by ? el("span", {}, `silenced (${alert.silenced_by})`) : null,
      alert.flapping ? el("span", {}, "comes and goes") : null,
      alert.unknown ? el("span", {}, `cannot be read now: ${alert.unknown}`) : null,
      Array.isArray(alert.told) && alert.told.length ? el("span", {}, `notified: ${alert.told.join(", ")}`) : null,
      alert.undelivered ? el("span", {}, "not delivered") : null,
    ];
    const key = alert.fingerprint;
    return el(
      "article",
      {
        class: `alarmcard ${alert.phase} ${alert.silenced_by ? "silenced" : ""}`,
        "data-severity": alert.severity,
        "data-fingerprint": key,
        tabindex: "-1",
      },
      symbol(SIGNS[alert.phase] ?? "s-alert"),
      el(
        "div",
        {},
        el("h3", {}, el("a", { href: app.address("machine", machine) }, machine), ` · ${sentence(alert)}`),
        annotations.description ? el("p", { class: "what" }, annotations.description) : null,
        annotations.advice && !end ? el("p", { class: "advice" }, annotations.advice) : null,
        el("p", { class: "facts" }, facts),
      ),
      el(
        "div",
        { class: "acts" },
        alert.phase === "firing"
          ? el("button", { type: "button", class: "button main", disabled: !may("operator"), onclick: () => acknowledge(alert) }, "Acknowledge")
          : null,
        alert.phase === "firing" && !alert.silenced_by
          ? el("button", { type: "button", class: "button", disabled: !may("operator"), onclick: () => silence(alert) }, "Silence")
          : null,
        machine && Number.isFinite(start)
          ? el(
              "a",
              {
                class: "button",
                href: app.address("replay", machine, {
                  from: raised - AROUND_MS,
                  to: Math.min((end ?? raised) + AROUND_MS, serverNow()),
                  at: raised,
                }),
              },
              "Replay",
            )
          : null,
      ),
      reasonOf(alert, taken),
    );
  }

  const block = (title, cards, empty) =>
    cards.length || empty
      ? el(
          "section",
          {},
          el("h2", {}, `${title} (${cards.length})`),
          cards.length ? el("div", { class: "alerts" }, cards) : el("p", { class: "quiet" }, empty),
        )
      : null;

  function endSilence(one) {
    const about = el("p", {}, `${one.comment || "It"}: people are notified again of the alerts that it keeps quiet.`);
    openSigned("End this silence?", about, "End it", async (by) => {
      await post(`silences/${part(one.id ?? "")}/end`, { by });
      say("Ended");
      app.askAlerts();
    });
  }

  function silences(given) {
    if (!given.length) return null;
    const matchers = (one) => Object.entries(one.matchers ?? {}).map(([label, pattern]) => `${label} = ${pattern}`);
    const rows = given.map((one) => [
      matchers(one).join(", "),
      `${moment(Date.parse(one.starts))} to ${moment(Date.parse(one.ends))}`,
      one.by ?? "",
      one.comment ?? "",
      el("button", { type: "button", class: "button", disabled: !may("operator"), onclick: () => endSilence(one) }, "End"),
    ]);
    return el(
      "section",
      {},
      el("h2", {}, "Silenced"),
      table(["What", "When", "By", "Why", ""], rows, { label: "Silenced" }),
    );
  }

  /** What the controls themselves show: no alert of ours, and what the head of a machine leads to. */
  function controls() {
    const showing = [...app.plant.machines.values()].filter((one) => one.online && one.good("alarm"));
    if (!showing.length) return null;
    const rows = showing.map((one) => [el("a", { href: app.address("machine", one.name) }, one.name), String(one.good("alarm"))]);
    return el(
      "section",
      {},
      el("h2", {}, `Shown by the controls (${rows.length})`),
      table(["Machine", "Alarm"], rows, { label: "Shown by the controls" }),
    );
  }

  function receivers(given, failures) {
    const entries = Object.entries(given ?? {});
    if (!entries.length)
      return el(
        "section",
        {},
        el("h2", {}, "Who is notified"),
        el("p", { class: "quiet" }, "No receiver is configured: alerts are on the broker and on this page only."),
      );
    const last = (one) =>
      one.last_error ? String(one.last_error) : one.last_delivered ? `last at ${moment(Date.parse(one.last_delivered))}` : "";
    const count = (number) => String(number ?? 0);
    const rows = entries.map(([name, one]) => [name, count(one.delivered), count(one.failed), count(one.waiting), last(one)]);
    return el(
      "section",
      {},
      el("h2", {}, "Who is notified"),
      table(["Receiver", "Delivered", "Failed", "Waiting", ""], rows, { numbers: [1, 2, 3], label: "Who is notified" }),
      failures?.length
        ? el(
            "ul",
            { class: "plainlist" },
            failures.slice(-5).map((one) => el("li", {}, `${one.receiver}, ${moment(Date.parse(one.at))}: ${one.reason}`)),
          )
        : null,
    );
  }

  function write() {
    const given = app.alerts;
    if (!given) {
      body.replaceChildren(el("p", { class: "waiting" }, "Loading …"));
      return;
    }
    trouble.hidden = given.available !== false;
    setText(
      trouble,
      `Alerts are not kept up: ${given.reason ?? "no reason was given"}. What stands here is the last that was heard.`,
    );
    const key = JSON.stringify([
      given.alerts,
      given.silences,
      given.receivers,
      given.failures,
      given.available,
      [...app.plant.machines.values()].map((one) => one.good("alarm")),
      Math.floor(serverNow() / 30000),
    ]);
    if (key === shown) return;
    shown = key;
    focused = body.contains(document.activeElement)
      ? (document.activeElement.closest("[data-fingerprint]")?.dataset.fingerprint ?? null)
      : null;
    const all = [...(given.alerts ?? [])].sort(worstFirst);
    const of = (...phases) => all.filter((one) => phases.includes(one.phase));
    const firing = of("firing"),
      taken = new Set(),
      cards = (alerts) => alerts.map((alert) => card(alert, taken));
    setText(
      counts,
      all.length ? `${firing.length} firing, ${of("acknowledged").length} acknowledged, ${of("pending").length} pending` : "",
    );
    const known = given.available !== false || all.length;
    body.replaceChildren(
      ...[
        may("operator") ? null : el("p", { class: "note role" }, whyNot("operator", "acknowledging, or silencing,")),
        !known
          ? el(
              "div",
              { class: "empty" },
              el("h2", {}, "No alerts are raised"),
              el("p", {}, "The processor that turns alarms into alerts is not running. Start it:"),
              el("pre", {}, "cnctwin process rules joint_anomaly alerts --config processors.toml"),
            )
          : block("Firing", cards(firing), "Nothing fires."),
        block("Acknowledged", cards(of("acknowledged"))),
        block("Pending", cards(of("pending"))),
        given.alerts_not_shown ? el("p", { class: "note" }, `${given.alerts_not_shown} more are not shown.`) : null,
        controls(),
        silences(given.silences ?? []),
        block("Over", cards(of("resolved").slice(0, RESOLVED_MAX))),
        known ? receivers(given.receivers, given.failures) : null,
      ].filter(Boolean),
    );
    for (const machine of reasons.keys()) if (!taken.has(machine)) reasons.delete(machine);
    explain();
    if (focused)
      body
        .querySelector(`[data-fingerprint="${CSS.escape(focused)}"] button, [data-fingerprint="${CSS.escape(focused)}"] a`)
        ?.focus();
  }

  function move(key) {
    const cards = [...body.querySelectorAll(".alarmcard")],
      at = cards.findIndex((one) => one.contains(document.activeElement));
    const to = cards[at < 0 ? 0 : Math.min(Math.max(at + (key === "ArrowDown" ? 1 : -1), 0), cards.length - 1)];
    to?.querySelector(".acts button, .acts a")?.focus();
    to?.scrollIntoView({ block: "nearest" });
  }

  write();
  app.askAlerts();
  const timer = setInterval(() => {
    write();
    explain();
  }, 5000);
  return {
    title: "Alerts",
    element,
    stream: "stream",
    machine: null,
    keys: [
      [["ArrowDown", "ArrowUp"], "from alert to alert", move],
      [
        ["k"],
        "acknowledge the one that is chosen, else the first",
        () =>
          (document.activeElement.closest?.(".alarmcard") ?? body.querySelector(".alarmcard.firing"))
            ?.querySelector("button")
            ?.click(),
      ],
    ],
    onAlerts: write,
    onMe: write,
    onLink: (state) => {
      if (state === "live") app.askAlerts();
    },
    close() {
      stop.abort();
      clearInterval(timer);
    },
  };
}
