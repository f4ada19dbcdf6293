// The twin's loop: where it stands, what was found, both gaps beside each other, and the buttons that go on, or back.

import { get, part, post } from "../api.js";
import { openAsked } from "../dialogs.js";
import { el, say, setClass, setHidden, setText } from "../dom.js";
import { may, me, whyNot } from "../me.js";
import { age, moment, sentence } from "../text.js";
import { serverNow } from "../clock.js";
import { CHALLENGER_PREFIX, GAP_PREFIX, TWIN_PREFIX } from "../vocabulary.js";
import { sealedBox } from "./sealed.js";
import { answer, bars, history, score, steps, told as inWords } from "./twin_parts.js";

const ASK_MS = 1500;
const BUSY = ["composing", "diagnosing"];

const route = (name, deed = null) => ["twin", part(name), deed].filter(Boolean).join("/");
const signature = () => me.user ?? "the page";

/** A place whose content is written again only where what it shows is another. */
function slot(render) {
  const host = el("div", { class: "slot" });
  let key = "";
  return {
    host,
    show(value) {
      const now = JSON.stringify(value);
      if (now === key) return;
      key = now;
      const opened = [...host.querySelectorAll("details")].map((one) => one.open);
      const content = value === null ? null : render(value);
      host.replaceChildren(...[content].flat().filter(Boolean));
      [...host.querySelectorAll("details")].forEach((one, i) => {
        one.open = opened[i] ?? one.open;
      });
    },
  };
}

/** The panel of a machine. changed: called where the live description has become another one. */
export function twinLoop(app, name, changed = () => {}) {
  const machine = app.plant.machine(name),
    stop = new AbortController();
  const said = el("p", { class: "sentence", role: "status" }),
    since = el("span", { class: "quiet" }),
    bar = el("progress", { max: "1", hidden: true, "aria-label": "Progress of the diagnosis" }),
    trouble = el("p", { class: "trouble", role: "alert", hidden: true }),
    refused = el("p", { class: "trouble", role: "alert", hidden: true }),
    note = el("p", { class: "note" });
  const stepper = slot(steps),
    found = slot(answer),
    gaps = slot(({ standing, challenged }) => bars(standing, challenged)),
    scored = slot(score),
    last = slot(closed),
    sealed = slot((one) => sealedBox(one, load)),
    taken = slot(history);
  const button = (deed, word, act, main = false) =>
    el("button", { type: "button", class: main ? "button main" : "button", "data-deed": deed, onclick: act, hidden: true }, word);
  const diagnose = button("diagnose", "Diagnose", () => request("diagnose", {}), true),
    promote = button("promote", "Promote", askPromote, true),
    withdraw = button("withdraw", "Withdraw", askWithdraw),
    back = button("back", "Back", askBack);
  const whole = el(
    "div",
    { class: "loop" },
    stepper.host,
    el("div", { class: "saying" }, said, since, bar),
    el("div", { class: "acts" }, diagnose, promote, withdraw, back),
    refused,
    note,
    last.host,
    el("div", { class: "loopcolumns" }, found.host, el("div", {}, gaps.host, scored.host)),
    taken.host,
  );
  const nothing = el("div", { class: "empty", hidden: true });
  const element = el("section", { class: "twinloop" }, el("h2", {}, "Twin"), trouble, nothing, whole, sealed.host);
  let loop = null,
    version = null;

  async function load() {
    try {
      show(await get(route(name), { signal: stop.signal }));
      setHidden(trouble, true);
    } catch (error) {
      if (error.status === -1) return;
      if (loop === null && [404, 503].includes(error.status)) whatToDo(error.message);
      else {
        setText(trouble, `The loop cannot be shown: ${error.message}.`);
        setHidden(trouble, false);
      }
    }
  }

  function whatToDo(reason) {
    setHidden(whole, true);
    setHidden(nothing, false);
    if (nothing.dataset.reason === reason) return;
    nothing.dataset.reason = reason;
    nothing.replaceChildren(
      el("h3", {}, "The loop does not run"),
      el("p", {}, "It diagnoses a gap that has opened, tries the answer beside the live twin, and waits for you to promote it. Start it:"),
      el("pre", {}, "cnctwin twin run"),
      el("p", { class: "note" }, `The server says: ${reason}`),
    );
  }

  function show(told) {
    sealed.show(told.sealed ?? null);
    if (!told.step) {
      whatToDo(told.reason ?? "nothing was heard of this machine's loop");
      return;
    }
    setHidden(whole, false);
    setHidden(nothing, true);
    loop = told;
    if (version !== null && told.live?.version !== version) changed();
    version = told.live?.version ?? null;
    element.dataset.step = told.step;
    stepper.show({ step: told.step });
    setText(said, inWords(told.text));
    setHidden(bar, !BUSY.includes(told.step));
    if (Number.isFinite(told.progress)) bar.value = told.progress;
    else bar.removeAttribute("value");
    found.show(told.challenger ? { ...told.challenger, version: null, since: null } : null);
    scored.show(told.challenger ? (told.score ?? null) : null);
    last.show(told.last && !String(told.text).startsWith(told.last.text) ? told.last : null);
    taken.show(told.steps ?? []);
    offer();
    write();
  }

  function offer() {
    const { step, challenger, may_promote: mayPromote, why_not: why } = loop,
      allowed = may("operator");
    setHidden(diagnose, BUSY.includes(step) || Boolean(challenger));
    setClass(diagnose, "main", step !== "promoted");
    setHidden(promote, !challenger);
    setHidden(withdraw, !challenger);
    setHidden(back, !canGoBack());
    promote.disabled = !allowed || !mayPromote;
    for (const one of [diagnose, withdraw, back]) one.disabled = !allowed;
    const told = !allowed ? whyNot("operator", "deciding about the twin") : challenger && !mayPromote ? inWords(why) : "";
    setText(note, told);
    setHidden(note, !told);
  }

  const canGoBack = () => (loop.steps ?? []).filter((one) => ["promote", "promoted", "back"].includes(one.step)).length > 0;

  /** The figures that move: the time that a step takes, and the standing gap as the stream tells it. */
  function write() {
    if (loop === null) return;
    setText(since, loop.since > 0 ? `for ${age(serverNow() - loop.since)}` : "");
    const standing = {};
    for (const [signal, one] of Object.entries(loop.standing ?? {})) {
      standing[signal] = {
        live: known(machine.value(GAP_PREFIX + signal)) ?? one.live,
        challenger: known(machine.value(CHALLENGER_PREFIX + GAP_PREFIX.slice(TWIN_PREFIX.length) + signal)) ?? one.challenger,
      };
    }
    gaps.show({ standing, challenged: Boolean(loop.challenger) });
  }

  async function request(deed, more) {
    setHidden(refused, true);
    try {
      await post(route(name, deed), { by: signature(), ...more });
      say(`${sentence(deed)}: asked for`);
    } catch (error) {
      setText(refused, `${sentence(deed)} was refused: ${error.message}.`);
      setHidden(refused, false);
    }
    load();
  }

  function askPromote() {
    const about = [
      el("p", {}, inWords(loop.challenger.sentence)),
      el("p", {}, `From then on this is the live twin of ${name}, in every figure and every job. The button Back makes the present description live again.`),
    ];
    openAsked(`Promote the challenger of ${name}`, about, "Promote", () => ordered("promote", loop.challenger.version));
  }

  function askWithdraw() {
    const about = el("p", {}, "The challenger is put aside. The live twin stays as it is, and the history keeps both.");
    openAsked(`Withdraw the challenger of ${name}`, [about], "Withdraw", () => ordered("withdraw", loop.challenger.version));
  }

  function askBack() {
    const about = el("p", {}, `The description that was live before becomes the live twin of ${name} again. The history keeps both.`);
    openAsked(`Go back, ${name}`, [about], "Go back", () => ordered("back", loop.live?.version ?? null));
  }

  async function ordered(deed, version) {
    await post(route(name, deed), { by: signature(), version });
    say(`${sentence(deed)}: done`);
    load();
  }

  load();
  const timer = setInterval(() => {
    if (!document.hidden) load();
  }, ASK_MS);
  return {
    element,
    write,
    load,
    onMe: () => loop && offer(),
    press: (deed) => element.querySelector(`[data-deed="${deed}"]:not([hidden]):not(:disabled)`)?.click(),
    close() {
      stop.abort();
      clearInterval(timer);
    },
  };
}

const known = (value) => (typeof value?.value === "number" && value.quality === "good" ? value.value : null);

/** What the last promotion did to the gap. */
function closed(one) {
  return el(
    "p",
    { class: "closed" },
    el("strong", {}, inWords(one.text)),
    one.since > 0 ? el("span", { class: "quiet" }, ` since ${moment(one.since)}`) : null,
  );
}
