// The page: which view is open, the stream it wants, the state of the connection, and what the keyboard does everywhere.

import { get, login } from "./api.js";
import { closeForAnotherView, openHelp, openLink, openLogin } from "./dialogs.js";
import { el, say, setHidden, setText } from "./dom.js";
import { serverNow } from "./clock.js";
import { painted } from "./lag.js";
import { lookup } from "./lookup.js";
import { askMe, me } from "./me.js";
import { onFrame } from "./frame.js";
import { Plant } from "./plant.js";
import { Stream } from "./stream.js";
import { age, moment } from "./text.js";
import * as alerts from "./views/alerts.js";
import * as figures from "./views/figures.js";
import * as fleet from "./views/fleet.js";
import * as gap from "./views/gap.js";
import * as jobs from "./views/jobs.js";
import * as machine from "./views/machine.js";
import * as noView from "./views/no_view.js";
import * as parts from "./views/parts.js";
import * as replay from "./views/replay.js";

const VIEWS = lookup({ fleet, machine, gap, alerts, replay, parts, figures, jobs });
const RENAMED = lookup({ validation: "parts" }); // addresses that people have kept
const TABS = [
  ["fleet", "Fleet", "f"],
  ["machine", "Machine", "m"],
  ["gap", "Gap", "g"],
  ["alerts", "Alerts", "a"],
  ["replay", "Replay", "r"],
  ["parts", "Parts", "p"],
  ["figures", "OEE", "o"],
  ["jobs", "Jobs", "j"],
];
const PER_MACHINE = ["machine", "gap", "replay", "parts"];
const ALERTS_MS = 5000;

const main = document.getElementById("main"),
  banner = document.getElementById("banner");
const behindBanner = document.getElementById("behind");
const refusedBanner = document.getElementById("refused");
const describedBanner = document.getElementById("described");
const whom = document.getElementById("me");
const pill = document.getElementById("link"),
  pillWord = pill.querySelector(".word");

export const app = {
  plant: new Plant(),
  stream: new Stream(),
  alerts: null,
  chosen: null,
  view: null,
  go: (hash) => {
    location.hash = hash;
  },
  /** The machine that views are opened for: that of the address, else the last one, else the first. */
  pick: (name) => name ?? (app.plant.machines.has(app.chosen) ? app.chosen : (app.plant.names[0] ?? null)),
};

// The place where we are.

function place() {
  const [path, search] = location.hash.replace(/^#\/?/, "").split("?");
  const [name, ...rest] = path.split("/");
  let machineName = null;
  try {
    machineName = rest.length ? decodeURIComponent(rest.join("/")) : null;
  } catch {
    /* a broken address is no machine */
  }
  const view = RENAMED[name] ?? (name || "fleet");
  return { name: view, machine: machineName || null, search: new URLSearchParams(search ?? "") };
}

export const address = (name, machineName, search) =>
  `#/${name}${machineName ? `/${encodeURIComponent(machineName)}` : ""}${search ? `?${new URLSearchParams(search)}` : ""}`;
app.address = address;

let shown = "";
function route() {
  const at = place(),
    hash = location.hash;
  if (app.view && hash === shown) return;
  shown = hash;
  app.view?.close?.();
  if (at.machine) app.chosen = at.machine;
  app.view = (VIEWS[at.name] ?? noView).open(app, at);
  app.view.name = at.name;
  main.replaceChildren(app.view.element);
  document.title = `${app.view.title} · cnctwin`;
  document.body.dataset.view = at.name;
  app.stream.open(app.view.stream ?? "stream");
  tabs();
  if (document.activeElement === document.body || main.contains(document.activeElement)) main.focus({ preventScroll: true });
  scrollTo(0, 0);
  say(app.view.title);
}

/** The present view has written another address of its own. */
app.replaceShown = (hash) => {
  shown = hash;
};

/** Opens the present view again: its machine has come, or it was asked for. */
app.reopen = () => {
  shown = null;
  route();
};

const tabLinks = new Map();
function tabs() {
  const nav = document.getElementById("tabs");
  if (!tabLinks.size) {
    for (const [name, text, key] of TABS) {
      const link = el(
        "a",
        { href: address(name), "aria-keyshortcuts": key },
        el("span", {}, text),
        name === "alerts" ? el("span", { class: "badge", hidden: true }) : null,
      );
      tabLinks.set(name, link);
      nav.append(link);
    }
  }
  for (const [name, link] of tabLinks) {
    if (PER_MACHINE.includes(name)) link.setAttribute("href", address(name, app.pick(null)));
    if (name === app.view?.name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

// The stream.

function onStream(event, take) {
  app.stream.addEventListener(event, ({ detail }) => {
    const stamps = take(detail) ?? [];
    onFrame(() => {
      app.view?.update?.(detail, event);
      painted(stamps);
    });
  });
}
onStream("fleet", (detail) => {
  heardNotices(detail);
  app.plant.fleet(detail.machines ?? []);
  tabs();
});
onStream("fleet_rows", (detail) => app.plant.fleetRows(detail));
onStream("state", (detail) => {
  heardNotices(detail);
  app.plant.state(detail);
  tabs();
});
onStream("rows", (detail) => (app.view?.machine ? app.plant.rows(app.view.machine, detail) : []));
app.stream.addEventListener("hole", ({ detail }) => {
  for (const one of app.plant.machines.values()) one.hole(one.now() - detail.silentMs);
  app.view?.onHole?.();
});
app.stream.addEventListener("alerts", ({ detail }) => heardAlerts(detail));
app.stream.addEventListener("processors", ({ detail }) => heardNotices(detail));

/** What stands above every view: processors that fall behind (what the twin says is late, and looks live all the same), and
 * devices of which nothing is taken, and descriptions that have a fault. */
function heardNotices({ behind, refused, described }) {
  notice(behindBanner, "Late.", behind);
  notice(refusedBanner, "Refused.", refused);
  notice(describedBanner, "Not taken up.", described && `the description of ${described}`);
}

function notice(banner, word, sentence) {
  setHidden(banner, !sentence);
  if (!sentence) return;
  if (!banner.firstChild) banner.append(el("strong", {}, word), el("span"));
  setText(banner.lastChild, `${sentence[0].toUpperCase()}${sentence.slice(1)}.`);
}

function link() {
  const { link: state, lostAt, heardMs } = app.stream;
  document.body.dataset.link = state;
  setText(pillWord, { live: "live", connecting: "connecting", lost: "reconnecting", broker: "broker lost" }[state]);
  setHidden(banner, state === "live" || (state === "connecting" && heardMs === null));
  if (banner.hidden) {
    app.view?.onLink?.(state);
    return;
  }
  const since = lostAt ? `${moment(lostAt)}, ${age(serverNow() - lostAt)} ago` : "never";
  const texts = {
    lost: [
      "Not live.",
      heardMs === null
        ? "The server does not answer. Trying again."
        : `Last heard at ${since}. What you see is as it was then. Reconnecting by itself.`,
    ],
    broker: ["Not live.", `The server has lost the broker (${since}). What you see is as it was then. It reconnects by itself.`],
    connecting: ["Connecting.", ""],
  };
  const [strong, rest] = texts[state];
  if (!banner.firstChild) banner.append(el("strong"), el("span"));
  setText(banner.firstChild, strong);
  setText(banner.lastChild, rest);
  app.view?.onLink?.(state);
}
app.stream.addEventListener("link", link);
setInterval(() => {
  if (app.stream.link !== "live") link();
}, 1000);

// Alerts: sent by the stream where it does, else asked for.

let alertsHeard = -Infinity;
function heardAlerts(given, asked = false) {
  if (!asked) alertsHeard = performance.now();
  app.alerts = given;
  const open = (given?.alerts ?? []).filter((alert) => alert.phase === "firing" && !alert.silenced_by);
  onFrame(() => {
    const badge = tabLinks.get("alerts")?.querySelector(".badge");
    if (badge) {
      setHidden(badge, !open.length);
      setText(badge, String(open.length));
      badge.setAttribute("aria-label", `${open.length} firing`);
    }
    app.view?.onAlerts?.();
  });
}

app.askAlerts = async () => {
  try {
    heardAlerts(await get("alerts"), true);
  } catch (error) {
    if (!app.alerts) heardAlerts({ available: false, reason: error.message, alerts: [] }, true);
  }
};
setInterval(() => {
  if (!document.hidden && performance.now() - alertsHeard > 60000 && app.stream.link !== "lost") app.askAlerts();
}, ALERTS_MS);

/** Who looks, and what the role may: asked at the start and after each log-in. */
app.askMe = async () => {
  await askMe();
  setHidden(whom, !me.user && me.role !== "reader");
  setText(whom, me.user ?? me.role ?? "");
  onFrame(() => app.view?.onMe?.());
};

/** The fleet's names where its stream is not open: they are needed to go from machine to machine. */
async function askMachines() {
  if (document.hidden || (app.view?.stream === "stream" && app.plant.machines.size)) return;
  try {
    app.plant.fleet(await get("machines"), { adds: true });
    onFrame(() => {
      tabs();
      app.view?.update?.();
    });
  } catch {
    /* the stream tells what is wrong */
  }
}
setInterval(askMachines, 30000);

/** Ask whether the server has lost its broker, where all that we look at is offline: then it is not the machines' fault. */
async function askBroker() {
  const { stream, plant, view } = app,
    seen = view?.machine ? [plant.machines.get(view.machine)] : [...plant.machines.values()];
  if (document.hidden || (!stream.isBrokerLost && (!seen.length || seen.some((one) => !one || one.online)))) return;
  const health = await get("health", { limitMs: 4000 }).catch(() => null),
    parts = Array.isArray(health?.parts) ? health.parts : [];
  const broker = parts.find((one) => one.part === "broker");
  if (broker) stream.knowBroker(broker.state === "missing");
}
setInterval(askBroker, 2000);

// The keyboard.

const isTyping = (target) => target.closest?.("input:not([type=range]), textarea, select, [contenteditable]");

function neighbour(step) {
  const names = app.plant.names,
    at = names.indexOf(app.view.machine);
  if (!names.length || !app.view.machine) return;
  app.go(address(app.view.name, names[(at + step + names.length) % names.length]));
}
app.neighbour = neighbour;

export const EVERYWHERE = [
  ...TABS.map(([name, text, key]) => [
    [key],
    text,
    () => app.go(address(name, PER_MACHINE.includes(name) ? app.pick(null) : null)),
  ]),
  [["[", "]"], "previous, next machine", (key) => neighbour(key === "[" ? -1 : 1)],
  [["?"], "this list", () => openHelp(app, EVERYWHERE)],
];

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("dialog").open) return;
  if (isTyping(event.target)) {
    if (event.key === "Escape") main.focus({ preventScroll: true });
    return;
  }
  route(); // a key typed before the event of a new address has come is meant for the new view
  for (const [keys, , act] of [...(app.view?.keys ?? []), ...EVERYWHERE]) {
    if (!keys.includes(event.key)) continue;
    if (event.key === "Enter" && event.target.closest("a, button, summary")) return;
    if (event.key === " " && event.target.closest("a, button, summary, input")) return;
    if (event.key.startsWith("Arrow") && event.target.closest("input")) return;
    if (act(event.key, event) !== false) event.preventDefault();
    return;
  }
});

document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
document.getElementById("help").addEventListener("click", () => openHelp(app, EVERYWHERE));
pill.addEventListener("click", () => openLink(app));
login.needed = () => openLogin(app);
addEventListener("hashchange", () => {
  if (location.hash !== shown) closeForAnotherView();
  route();
});
addEventListener("error", (event) => say(`The page has an error: ${event.message}`));

tabs();
route();
link();
app.askMe();
app.askAlerts();
askMachines();
