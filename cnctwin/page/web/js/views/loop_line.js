// One line about the twin's loop, for a view that is about something else: what it does now, and the way to it.

import { get, part } from "../api.js";
import { el, setHidden, setText } from "../dom.js";
import { told } from "./twin_parts.js";

const ASK_MS = 3000;

export function loopLine(app, name) {
  const about = el("strong"),
    said = el("span"),
    stop = new AbortController();
  const element = el(
    "p",
    { class: "loopline", hidden: true },
    about,
    said,
    el("a", { href: app.address("gap", name) }, "See the gap"),
  );

  async function load() {
    if (document.hidden) return;
    try {
      const loop = await get(["twin", part(name)].join("/"), { signal: stop.signal });
      const isTaken = loop.step === "promoted" && Boolean(loop.last),
        text = isTaken ? loop.last.text : loop.text;
      setText(about, isTaken ? "Cause found and taken into the twin" : "Twin");
      setHidden(element, !text);
      setText(said, told(text));
    } catch (error) {
      if (error.status !== -1) setHidden(element, true); // without a loop there is nothing to say here
    }
  }

  load();
  const timer = setInterval(load, ASK_MS);
  return {
    element,
    close() {
      stop.abort();
      clearInterval(timer);
    },
  };
}
