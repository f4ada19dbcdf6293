// The dialogs: keys and marks, the connection, the log-in, and questions with a name and a comment.

import { get, post } from "./api.js";
import { clockOffset } from "./clock.js";
import { el, symbol, table } from "./dom.js";
import { lag } from "./lag.js";
import { may, me } from "./me.js";
import { REPEATABILITY, REPEATABILITY_MEANS, age, execution, fixed, moment, words } from "./text.js";

const dialog = () => document.getElementById("dialog");

function show(title, ...content) {
  const open = dialog();
  open.replaceChildren(
    el(
      "div",
      { class: "inside" },
      el(
        "header",
        {},
        el("h2", { id: "dialog-title" }, title),
        el("button", { type: "button", class: "round", "aria-label": "Close", onclick: () => open.close() }, "×"),
      ),
      ...content,
    ),
  );
  if (!open.open) open.showModal();
  return open;
}

/** Another view is opened: what was asked or told belongs to the one before; a log-in belongs to all. */
export function closeForAnotherView() {
  const open = dialog();
  if (open.open && !open.querySelector("#token")) open.close();
}

const NAMES = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→", " ": "Space" };

export function openHelp(app, everywhere) {
  const list = (keys) =>
    el(
      "dl",
      { class: "keys" },
      keys.map(([names, text]) => [
        el(
          "dt",
          {},
          names.map((name) => el("kbd", {}, NAMES[name] ?? name)),
        ),
        el("dd", {}, text),
      ]),
    );
  const from = (where, text) => el("li", {}, el("span", { class: "from", "data-from": where }, where), el("span", {}, text));
  const own = app.view?.keys ?? [];
  show(
    "Keys and marks",
    el("p", {}, el("a", { href: "docs/", target: "_blank", rel: "noopener" }, "Documentation"), ": tutorials, guides, reference"),
    el("br"),
    own.length ? [el("h3", {}, app.view.title), list(own), el("br")] : null,
    el("h3", {}, "Everywhere"),
    list([...everywhere, [["Tab"], "the next thing that can be pressed"], [["Esc"], "closes a dialog, leaves a field"]]),
    el("br"),
    el("h3", {}, "Where a figure comes from"),
    el(
      "ul",
      { class: "legend-list" },
      from("measured", "the machine's control or a sensor says so"),
      from("modelled", "the twin works it out from physics"),
      from("inferred", "worked out from what is measured; not measured itself"),
    ),
    el("h3", {}, "Marks"),
    el(
      "ul",
      { class: "legend-list" },
      ["ACTIVE", "READY", "FEED_HOLD", "STOPPED"].map((state) =>
        el("li", {}, symbol(execution(state)[1], `kind-${execution(state)[2]}`), el("span", {}, execution(state)[0])),
      ),
      el("li", {}, symbol("s-offline", "kind-offline"), el("span", {}, "offline: values are the last ones known, hatched")),
      el(
        "li",
        {},
        el("span", { class: "key gate" }),
        el("span", {}, "suppression window: a tool change and what follows it, when scores are not judged"),
      ),
      el("li", {}, el("span", { class: "figure" }, "│"), el("span", {}, "on a load bar: 100 %; on a score bar: the threshold")),
      el("li", {}, el("span", { class: "key old" }), el("span", {}, "stale: nothing was heard in this stretch")),
      el("li", {}, el("span", { class: "figure" }, REPEATABILITY), el("span", {}, REPEATABILITY_MEANS.replace("repeatability: ", ""))),
    ),
  );
}

export function openLink(app) {
  const body = el("dl", { class: "keys" });
  const parts = el("ul", { class: "legend-list" });
  const fill = () => {
    const { stream } = app,
      behind = lag();
    const rows = [
      ["You", me.role === null ? "not known" : [me.user, me.role].filter(Boolean).join(", ")],
      ["State", document.getElementById("link").textContent.trim()],
      [
        "Last heard",
        stream.heardMs === null
          ? "never"
          : `${age(performance.now() - stream.heardMs)}${performance.now() - stream.heardMs < 1500 ? "" : " ago"}`,
      ],
      [
        "Behind",
        behind
          ? `${Math.round(behind.median)} ms at the median, ${Math.round(behind.p95)} ms for 95 % (stamp to paint)`
          : "nothing was painted yet",
      ],
      ["Messages", `${stream.messages}, ${stream.reconnects} reconnections`],
      [
        "Clock",
        Math.abs(clockOffset()) > 50
          ? `this device is ${fixed(Math.abs(clockOffset()) / 1000, 1)} s ${clockOffset() > 0 ? "behind" : "ahead of"} the server`
          : "agrees with the server's",
      ],
    ];
    body.replaceChildren(...rows.flatMap(([term, text]) => [el("dt", {}, term), el("dd", {}, text)]));
  };
  const open = show(
    "Connection",
    body,
    el("br"),
    el("h3", {}, "Parts of the server"),
    parts,
    el(
      "div",
      { class: "actions" },
      me.role !== null && may("administrator")
        ? el("button", { type: "button", class: "button", onclick: openDeeds }, "Who did what")
        : null,
      me.logsOut ? el("button", { type: "button", class: "button", onclick: () => logOut(app) }, "Log out") : null,
      el("button", { type: "button", class: "button", onclick: () => app.stream.restart() }, "Reconnect"),
    ),
  );
  fill();
  const timer = setInterval(() => (open.open ? fill() : clearInterval(timer)), 1000);
  get("health").then(
    (health) => parts.replaceChildren(...healthRows(health)),
    (error) => parts.replaceChildren(el("li", {}, error.message)),
  );
}

/** The newest lines of the record, for administrators. */
async function openDeeds() {
  const where = el("div", {}, el("p", { class: "waiting" }, "Loading …"));
  show("Who did what", where);
  try {
    const { deeds, file, trouble } = await get("audit?limit=50");
    const rows = deeds.map((one) => [
      moment(Date.parse(one.at)),
      [one.user, one.user === one.role ? "" : one.role].filter(Boolean).join(", "),
      one.address,
      [one.action, one.object].filter(Boolean).join(" "),
      one.outcome,
    ]);
    where.replaceChildren(
      ...(trouble ? [el("p", { class: "trouble" }, trouble)] : []),
      rows.length
        ? table(["When", "Who", "From", "What", "Outcome"], rows, { label: "Who did what", className: "deeds" })
        : el("p", { class: "quiet" }, "No actions yet."),
      el("p", { class: "note" }, file ? `Older lines: ${file}` : "Kept in memory only, until the server ends."),
    );
  } catch (error) {
    where.replaceChildren(el("p", { class: "trouble" }, `The record cannot be shown: ${error.message}.`));
  }
}

async function logOut(app) {
  await post("logout", {}).catch(() => {});
  app.stream.restart();
  await app.askMe();
}

function healthRows(health) {
  const parts = health?.parts ?? {};
  const entries = Array.isArray(parts) ? parts.map((one) => [one.name ?? one.part, one]) : Object.entries(parts);
  if (!entries.length) return [el("li", {}, String(health?.status ?? "the server names no parts"))];
  return entries.map(([name, part]) => {
    const state = typeof part === "string" ? part : (part.state ?? part.status ?? (part.ok === false ? "not well" : "ok"));
    const reason = typeof part === "object" ? (part.reason ?? part.text ?? "") : "";
    const isWell = ["ok", "up", "ready", "well", "good"].includes(String(state).toLowerCase());
    return el(
      "li",
      {},
      symbol(isWell ? "s-ack" : "s-alert", isWell ? "kind-active" : "kind-held"),
      el("span", {}, el("strong", {}, words(name)), ` ${state}${reason ? `: ${reason}` : ""}`),
    );
  });
}

export function openLogin(app) {
  const open = dialog();
  if (open.open && open.querySelector("#token")) return;
  const field = el("input", { class: "field", id: "token", type: "password", autocomplete: "current-password", required: true });
  const act = async () => {
    try {
      await post("login", { token: field.value });
    } catch (error) {
      field.select();
      throw error.status === 401 || error.status === 403 ? new Error("This is not the token.") : error;
    }
    await app.askMe();
    app.stream.restart();
    app.reopen();
  };
  const where = "Yours is in the server's file of users, or there is one for all: whoever runs the server has it.";
  const about = el("p", {}, `This page asks for a token. ${where}`);
  openAsked("Log in", [about, el("label", { class: "named" }, "Token", field)], "Log in", act, null);
  field.focus();
}

/** A document as it is. */
export function openDocument(title, value) {
  show(title, el("pre", { tabindex: "0" }, JSON.stringify(value, null, 2)));
}

/** Asks before something is done; `act()` does it, or throws why not. back: the word for leaving it be; null = none is offered. */
export function openAsked(title, content, word, act, back = "Cancel") {
  const told = el("p", { role: "alert", class: "trouble", hidden: true });
  const button = el("button", { class: "button main" }, word);
  const submit = async (event) => {
    event.preventDefault();
    button.disabled = true;
    told.hidden = true;
    try {
      await act();
      open.close();
    } catch (error) {
      told.hidden = false;
      told.textContent = error.message;
      button.disabled = false;
    }
  };
  const leave = back && el("button", { type: "button", class: "button", onclick: () => open.close() }, back);
  const open = show(title, el("form", { onsubmit: submit }, content, told, el("div", { class: "actions" }, leave, button)));
}

const COMMENT = { label: "Comment", length: 500, list: null };

/**
 * Asks for a name, where the server does not know it, and a comment; `act(by, comment)` does it, or throws why not.
 * asked: what the comment is called, how long it may be, and the list that it may be chosen from; null = none is asked for.
 */
export function openSigned(title, about, word, act, asked = COMMENT) {
  const by = el("input", {
    class: "field",
    name: "by",
    required: true,
    maxlength: "80",
    autocomplete: "username",
    value: remembered(),
  });
  const attributes = asked?.list
    ? { class: "field", name: "comment", maxlength: String(asked.length), list: asked.list, autocomplete: "off" }
    : { class: "field", name: "comment", maxlength: String(asked?.length ?? 0) };
  const comment = el(asked?.list ? "input" : "textarea", attributes);
  const name = me.user ? el("p", { class: "note" }, `As ${me.user}.`) : el("label", { class: "named" }, "Your name", by);
  const content = [about, name, asked && el("label", { class: "named" }, asked.label, comment)];
  openAsked(title, content, word, async () => {
    if (!me.user) remember(by.value.trim());
    await act(me.user ?? by.value.trim(), comment.value.trim());
  });
  if (!me.user && !by.value) by.focus();
  else if (asked) comment.focus();
}

const KEY = "cnctwin-name";
function remembered() {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return "";
  }
}
function remember(name) {
  try {
    localStorage.setItem(KEY, name);
  } catch {
    /* a browser that keeps nothing asks again */
  }
}
