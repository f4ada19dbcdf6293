// The jobs: what is computed, what waits, what came of it; one more can be asked for, and each can be cancelled.

import { get, part, post } from "../api.js";
import { serverNow } from "../clock.js";
import { openAsked } from "../dialogs.js";
import { el, say, setData, setHidden, setSymbol, setText, symbol } from "../dom.js";
import { lookup } from "../lookup.js";
import { may, whyNot } from "../me.js";
import { age, duration, moment, plain, words } from "../text.js";
import { openNewJob } from "./job_form.js";

const ASK_MS = 2000;
const SIGNS = lookup({ queued: "s-pending", running: "s-active", done: "s-ack", failed: "s-alert", cancelled: "s-stopped" });
const isOver = (job) => !["queued", "running"].includes(job.state);

export function open(app) {
  const list = el("div", { class: "jobs-list" }),
    counts = el("span", { class: "quiet" }),
    trouble = el("p", { class: "trouble", role: "alert", hidden: true }),
    nothing = el("div", { class: "empty", hidden: true }),
    role = el("p", { class: "note role", hidden: true }),
    cards = new Map(),
    stop = new AbortController();
  const ask = el("button", { type: "button", class: "button main", onclick: () => openNewJob(accepted) }, "New job");
  const element = el(
    "div",
    { class: "view jobs-view" },
    el("div", { class: "head" }, el("h1", {}, "Jobs"), counts, el("div", { class: "after" }, ask)),
    trouble,
    role,
    nothing,
    list,
  );
  nothing.append(
    el("h2", {}, "No jobs"),
    el("p", {}, "Optimising a program, identifying a machine and diagnosing a gap take their time. Ask for one here, or with:"),
    el("pre", {}, "cnctwin jobs submit --job optimise --program plate.nc --machine vmc.toml"),
  );

  function accepted(told) {
    say(`Job ${told.id}: ${told.answer}`);
    load();
  }

  async function load() {
    if (document.hidden) return;
    try {
      write(await get("jobs", { signal: stop.signal }));
    } catch (error) {
      if (error.status !== -1) complain(`Jobs cannot be shown: ${error.message}.`);
    }
  }

  function complain(text) {
    setHidden(trouble, !text);
    setText(trouble, text);
  }

  function write(given) {
    const jobs = given.jobs ?? [];
    const troubles = [
      given.available === false ? `Jobs are not kept up: ${given.reason}. What stands here is the last that was heard.` : "",
      given.disk_trouble ? `The consumer cannot write: ${given.disk_trouble}.` : "",
    ];
    complain(troubles.filter(Boolean).join(" "));
    ask.disabled = given.available === false || !may("operator");
    setHidden(role, may("operator"));
    setText(role, may("operator") ? "" : whyNot("operator", "asking for a job, or cancelling one,"));
    setHidden(nothing, jobs.length > 0);
    const waiting = jobs.filter((job) => job.state === "queued").length;
    setText(counts, jobs.length ? `${jobs.some((job) => job.state === "running") ? 1 : 0} running, ${waiting} waiting` : "");
    for (const [id, card] of cards)
      if (!jobs.some((job) => job.id === id)) {
        card.element.remove();
        cards.delete(id);
      }
    jobs.forEach((job, at) => {
      if (!cards.has(job.id)) cards.set(job.id, new Card(app, job, load));
      const card = cards.get(job.id);
      card.show(job, given);
      if (list.children[at] !== card.element) list.insertBefore(card.element, list.children[at] ?? null);
    });
  }

  load();
  const timer = setInterval(load, ASK_MS);
  return {
    title: "Jobs",
    element,
    stream: "stream",
    machine: null,
    onMe: load,
    keys: [[["n"], "a new job", () => ask.click()]],
    close: () => {
      clearInterval(timer);
      stop.abort();
    },
  };
}

/** One job; it is written again only where something is another. */
class Card {
  constructor(app, job, changed) {
    Object.assign(this, { app, id: job.id, changed, shown: "", loaded: false });
    this.sign = symbol("s-unknown");
    this.caution = el("p", { class: "caution", hidden: true });
    this.what = el("p", { class: "what" });
    this.facts = el("p", { class: "facts" });
    this.bar = el("progress", { max: "100", value: 0, "aria-label": `Progress of ${job.id}` });
    this.result = el("div", { class: "job-result" });
    this.details = el("details", { hidden: true, ontoggle: () => this.load() }, el("summary", {}, "Result"), this.result);
    this.button = el("button", { type: "button", class: "button", onclick: () => this.cancel() }, "Cancel");
    const title = [words(job.kind), job.machine ? ` · ${job.machine}` : ""];
    this.element = el(
      "article",
      { class: "jobcard", "data-job": job.id },
      this.sign,
      el("div", {}, el("h2", {}, title), this.caution, this.what, this.bar, this.facts, this.details),
      el("div", { class: "acts" }, this.button),
    );
  }

  show(job, given) {
    this.offersFiles = given.offers_files;
    this.button.disabled = !may("operator");
    const key = JSON.stringify([job, Math.floor(serverNow() / 10000)]);
    if (key === this.shown) return;
    this.shown = key;
    this.element.dataset.state = job.state;
    setData(this.element, "caution", job.caution ? "" : null);
    setSymbol(this.sign, job.caution ? "s-alert" : (SIGNS[job.state] ?? "s-unknown"));
    setHidden(this.caution, !job.caution);
    setText(this.caution, `Done, but ${job.caution}`);
    setText(this.what, [job.sentence, isOver(job) ? "" : job.doing, job.reason].filter(Boolean).join(" · "));
    setHidden(this.bar, job.state !== "running");
    this.bar.value = job.progress_pct ?? 0;
    setHidden(this.button, isOver(job));
    setHidden(this.details, job.state !== "done");
    const took = job.started_ms && job.ended_ms ? `took ${duration(job.ended_ms - job.started_ms)}` : "";
    const facts = [
      job.state === "running" ? `running, ${plain(Math.round(job.progress_pct ?? 0))} %` : job.state,
      job.state === "queued" && job.place > 1 ? `${job.place - 1} before it` : "",
      `asked for at ${moment(job.accepted_ms)} (${age(serverNow() - job.accepted_ms)} ago)`,
      job.by ? `by ${job.by}` : "",
      job.attempt > 1 ? `attempt ${job.attempt}` : "",
      took,
      job.id,
    ];
    this.facts.replaceChildren(...facts.filter(Boolean).map((text) => el("span", {}, text)));
  }

  cancel() {
    const about = el("p", {}, `${this.id} ends; what it has computed so far is thrown away.`);
    const act = async () => {
      await post(`jobs/${part(this.id)}/cancel`, {});
      say("Cancelled");
      this.changed();
    };
    openAsked("Cancel this job?", about, "Cancel the job", act, "Let it run");
  }

  async load() {
    if (!this.details.open || this.loaded) return;
    try {
      const { result = {} } = await get(`jobs/${part(this.id)}`);
      const { files = {}, sentence: _, ...figures } = result;
      const rows = flat(figures).map(([name, value]) => el("div", {}, el("dt", {}, words(name)), el("dd", {}, plain(value))));
      this.result.replaceChildren(el("dl", { class: "then" }, rows), this.files(Object.entries(files)));
      this.loaded = true;
    } catch (error) {
      this.result.replaceChildren(el("p", { class: "trouble" }, `The result cannot be shown: ${error.message}.`));
    }
  }

  files(files) {
    if (!this.offersFiles) {
      const where = `${this.id}/result/: ${files.map(([name]) => name).join(", ")}`;
      return el("p", { class: "note" }, `In the consumer's folder, ${where}. To have them here: cnctwin serve --jobs DIR.`);
    }
    const link = (name) =>
      el("a", { class: "button", href: `jobs/${part(this.id)}/files/${part(name)}`, target: "_blank", rel: "noopener" }, name);
    return el(
      "p",
      { class: "files" },
      files.map(([name]) => link(name)),
    );
  }
}

/** Figures by name, those in a group under both names; what is longer than a line is left to the files. */
function flat(given, before = "") {
  return Object.entries(given).flatMap(([name, value]) => {
    const whole = before ? `${before} ${name}` : name;
    if (Array.isArray(value)) return value.length ? [[whole, value.map((one) => plain(one)).join(", ")]] : [];
    if (value && typeof value === "object") return before ? [] : flat(value, name);
    return [[whole, value]];
  });
}
