// The one stream that is open, and whether it lives. EventSource begins again by itself after most failures, but not after an HTTP
// error, and it does not notice a connection that is dead without being closed; so there is a watchdog beside it.
//
// link: "connecting" never heard yet · "live" heard within SILENT_MS · "lost" nothing since · "broker" the API lives, its broker does not

import { get } from "./api.js";
import { heardClock, serverNow } from "./clock.js";

const SILENT_MS = 5000;
const BROKEN_MS = 2000; // after a connection that broke audibly
const HOLE_MS = 4000;
const TRY_MS_MAX = 8000;
const HIDDEN_MS_MAX = 60000;
const EVENTS = ["state", "rows", "fleet", "fleet_rows", "alerts", "processors", "ping"];

export class Stream extends EventTarget {
  constructor() {
    super();
    this.url = null;
    this.source = null;
    this.link = "connecting";
    this.heardMs = null;
    this.openedMs = 0;
    this.tries = 0;
    this.reconnects = 0;
    this.messages = 0;
    this.hidden = 0;
    this.retry = 0;
    this.isBroken = false;
    this.isBrokerLost = false;
    setInterval(() => this.#watch(), 500);
    addEventListener("online", () => this.#again());
    document.addEventListener("visibilitychange", () => this.#seen());
  }

  /** Opens this stream in place of the one that is open; the same address again changes nothing. */
  open(url) {
    if (this.url === url) return;
    this.url = url;
    this.tries = 0;
    this.#connect();
  }

  /** Note what was found out otherwise: whether the server has lost its broker. */
  knowBroker(isLost) {
    this.isBrokerLost = isLost;
    if (this.link === "live" || this.link === "broker") this.#say(isLost ? "broker" : "live");
  }

  /** Begins again, at once. */
  restart() {
    this.tries = 0;
    this.#connect();
  }

  #connect() {
    clearTimeout(this.retry);
    this.retry = 0;
    this.source?.close();
    if (!this.url || (document.hidden && this.hidden === -1)) return;
    this.openedMs = performance.now();
    const source = new EventSource(this.url);
    this.source = source;
    for (const name of EVENTS)
      source.addEventListener(name, (event) => source === this.source && this.#message(name, event.data));
    source.addEventListener("error", () => source === this.source && this.#failed());
  }

  #message(name, text) {
    let data;
    try {
      data = JSON.parse(text);
    } catch {
      return; // half a message of a server that dies; the stream begins again by itself
    }
    const silentMs = this.heardMs === null ? 0 : performance.now() - this.heardMs;
    this.heardMs = performance.now();
    this.messages += 1;
    this.isBroken = false;
    if (Number.isFinite(data.now)) heardClock(data.now);
    this.tries = 0;
    if (name !== "alerts") this.#say(data.broker === false || this.isBrokerLost ? "broker" : "live");
    if (silentMs > HOLE_MS) this.dispatchEvent(new CustomEvent("hole", { detail: { silentMs } }));
    this.dispatchEvent(new CustomEvent(name, { detail: data }));
  }

  #failed() {
    this.isBroken = true;
    if (this.source.readyState !== EventSource.CLOSED) return; // it tries again by itself
    this.#again();
    get("health", { limitMs: 3000 }).catch(() => {}); // an EventSource says no status: this finds a 401
  }

  #again() {
    if (this.retry || !this.url) return;
    const wait = Math.min(TRY_MS_MAX, 500 * 2 ** this.tries) * (0.75 + Math.random() / 2);
    this.tries += 1;
    this.reconnects += 1;
    this.retry = setTimeout(() => this.#connect(), wait);
  }

  #watch() {
    if (!this.url || (document.hidden && this.hidden === -1)) return;
    const now = performance.now();
    const heard = this.heardMs === null ? this.openedMs : this.heardMs;
    const silent = now - heard;
    if (silent < (this.isBroken ? BROKEN_MS : SILENT_MS)) return;
    if (this.heardMs !== null || silent > 2 * SILENT_MS) this.#say("lost");
    if (now - this.openedMs > SILENT_MS + 500 * this.tries) this.#again();
  }

  #seen() {
    if (document.hidden) {
      this.hidden = setTimeout(() => {
        this.hidden = -1;
        this.source?.close();
      }, HIDDEN_MS_MAX);
      return;
    }
    const slept = this.hidden === -1;
    clearTimeout(this.hidden);
    this.hidden = 0;
    if (slept) this.restart();
  }

  #say(link) {
    if (this.link === link) return;
    this.link = link;
    this.lostAt = link === "live" ? null : serverNow() - (this.heardMs === null ? 0 : performance.now() - this.heardMs);
    this.dispatchEvent(new Event("link"));
  }
}
