// An incident again: a stretch of the past with a slider. Charts with a cursor, what was the case at that moment, what happened,
// and whether the processors, run again over the stored messages, give what they published then.

import { get, part } from "../api.js";
import { TILES, chartOf, firstOf, tileOf } from "../charted.js";
import { el, say, setHidden, setText } from "../dom.js";
import { onFrame } from "../frame.js";
import { Panels } from "../panels.js";
import { columnsOf, livedThrough } from "../past.js";
import { Machine } from "../plant.js";
import { Ring } from "../ring.js";
import { duration, fromLocalField, localField, moment, title } from "../text.js";
import { Happenings } from "./happenings.js";
import { MomentShown } from "./moment_shown.js";
import { noMachine } from "./no_machine.js";
import { Recompute } from "./recompute.js";

const LATELY = [
  [300000, "5 min"],
  [1800000, "30 min"],
  [28800000, "8 h"],
];
const SPEEDS = [1, 4, 16, 60, 240];
export function open(app, { machine: named, search }) {
  const name = app.pick(named);
  if (name === null) return noMachine(app, "Replay", "What is replayed is the past of a machine; there is none so far.");
  const element = el("div", { class: "view replay-view" }),
    live = app.plant.machine(name),
    known = new Machine(name), // what it has now, for this view alone: nothing of a replay gets into what is shown as live
    stop = new AbortController();
  let past = null,
    panels = null,
    from = Number(search.get("from")) || null,
    to = Number(search.get("to")) || null,
    at = Number(search.get("at")) || null;
  let signal = search.get("signal"),
    playing = false,
    speed = 4,
    last = 0,
    asking = 0;

  const select = el("select", {
    class: "field",
    "aria-label": "Machine",
    onchange: () => app.go(app.address("replay", select.value, from ? { from, to } : undefined)),
  });
  const begin = el("input", { class: "field", type: "datetime-local", step: "1", required: true }),
    end = el("input", { class: "field", type: "datetime-local", step: "1", required: true });
  const asked = el(
    "form",
    {
      class: "stretch",
      onsubmit: (event) => {
        event.preventDefault();
        load(fromLocalField(begin.value), fromLocalField(end.value));
      },
    },
    el("label", { class: "named" }, "Machine", select),
    el("label", { class: "named" }, "From", begin),
    el("label", { class: "named" }, "To", end),
    el("button", { class: "button main" }, "Load"),
    el(
      "div",
      { class: "lately" },
      el("span", {}, "The last"),
      el(
        "div",
        { class: "group", role: "group", "aria-label": "The last" },
        LATELY.map(([ms, word]) =>
          el(
            "button",
            {
              type: "button",
              class: "button",
              "aria-label": `the last ${word}`,
              onclick: () => load(null, null, ms),
            },
            word,
          ),
        ),
      ),
    ),
  );
  const trouble = el("p", { class: "trouble", role: "alert", hidden: true }),
    what = el("p", { class: "note" });
  const clock = el("output", { class: "moment" }),
    slider = el("input", {
      type: "range",
      min: "0",
      max: "1000",
      step: "1",
      value: "0",
      "aria-label": "Moment",
      oninput: () => seek(from + ((to - from) * Number(slider.value)) / 1000, false),
    });
  const play = el(
    "button",
    { type: "button", class: "button", "aria-keyshortcuts": "Space", onclick: () => run(!playing) },
    "Play",
  );
  const pace = el(
    "select",
    {
      class: "field",
      "aria-label": "Speed of the replay",
      onchange: () => {
        speed = Number(pace.value);
      },
    },
    SPEEDS.map((one) => el("option", { value: String(one) }, `${one}×`)),
  );
  pace.value = String(speed);
  const choose = el("select", {
    class: "field",
    "aria-label": "Signal to chart",
    onchange: () => {
      signal = choose.value;
      chart();
    },
  });
  const then = new MomentShown(),
    host = el("div"),
    happenings = new Happenings((t) => seek(t)),
    recompute = new Recompute(name, () => [from, to], stop.signal);
  const player = el("div", { class: "player", hidden: true }, play, clock, slider, pace, choose);
  const shown = el(
    "div",
    { hidden: true },
    then.element,
    host,
    el("section", {}, el("h2", {}, "What happened"), happenings.element),
    el(
      "section",
      {},
      el("h2", {}, "Recompute"),
      el(
        "p",
        { class: "note" },
        "Runs the processors once more over the stored messages of this stretch, and compares each value with what was published then.",
      ),
      recompute.element,
    ),
  );
  element.append(el("div", { class: "head" }, el("h1", {}, "Replay"), what), asked, trouble, player, shown);
  function fields() {
    const names = app.plant.names.includes(name) ? app.plant.names : [name, ...app.plant.names];
    if (select.options.length !== names.length) select.replaceChildren(...names.map((one) => el("option", { value: one }, one)));
    select.value = name;
  }

  /** The end of "the last minutes": now, or the newest value where it is old. */
  const newest = () => Math.round(known.now() - known.lastT > LATELY[0][0] && known.lastT > 0 ? known.lastT : known.now());

  async function know() {
    const state = await get(`state/${part(name)}`, { signal: stop.signal }).catch(() => null);
    if (!state) return;
    known.state(state);
    if (live.otherClock) [known.otherClock, known.lastHeard] = [true, performance.now()];
  }

  /** Loads a stretch; start and finish null: the last `lately` ms. */
  async function load(start, finish, lately = LATELY[0][0]) {
    const number_ = ++asking;
    run(false);
    setText(what, "Loading …");
    await know();
    if (number_ !== asking || stop.signal.aborted) return;
    finish = Math.ceil(finish ?? newest());
    start = Math.floor(start ?? finish - lately);
    if (!(finish > start)) {
      setText(what, "");
      tell("The end has to be after the beginning.");
      return;
    }
    begin.value = localField(start);
    end.value = localField(finish);
    history.replaceState(
      null,
      "",
      app.address("replay", name, { from: start, to: finish, ...(at ? { at: Math.round(at) } : {}) }),
    );
    app.replaceShown?.(location.hash);
    try {
      const found = await columnsOf(known, start, finish, signal, stop.signal);
      if (number_ !== asking) return;
      const lived = livedThrough(known, found.columns);
      [past, from, to] = [lived, start, finish];
      tell("");
      const empty = lived.values.size === 0;
      setText(
        what,
        empty
          ? ""
          : `${duration(to - from)}, ${found.every >= 1000 ? `means of ${duration(found.every)}` : `every ${found.every} ms`}${found.source ? `, from the ${found.source}` : ""}`,
      );
      setHidden(player, empty);
      setHidden(shown, empty);
      if (empty) {
        tell(`Nothing is stored of ${name} between ${moment(from)} and ${moment(to)}.`);
        return;
      }
      recompute.clear();
      chart();
      const first = Math.min(...found.columns.filter((column) => column.t?.length).map((column) => column.t[0]));
      seek(at !== null && at >= from && at <= to ? at : Math.min(Math.max(from, first) + 2 * found.every, to));
      say("Loaded");
      await happenings.load(lived, start, finish, stop.signal);
      if (number_ === asking) {
        draw();
        point();
      }
    } catch (error) {
      if (error.status === -1 || number_ !== asking) return;
      setText(what, "");
      tell(`The past of ${name} cannot be shown: ${error.message}.`);
    }
  }

  function tell(text) {
    setText(trouble, text);
    trouble.hidden = !text;
  }

  function chart() {
    const measured = TILES.filter((tile) => tileOf(past, tile)).map((tile) => tile.id);
    const names = [
      ...measured,
      ...[...past.values]
        .filter(([one, held]) => past.series.get(one) instanceof Ring && !TILES.some((tile) => tile.own.includes(one)) && held)
        .map(([one]) => one)
        .sort(),
    ];
    const first = firstOf(past);
    signal = names.includes(signal) ? signal : names.includes(first) ? first : (names[0] ?? null);
    choose.replaceChildren(
      ...names.map((one) => el("option", { value: one }, TILES.find((tile) => tile.id === one)?.name ?? title(one))),
    );
    if (signal) choose.value = signal;
    panels?.destroy();
    panels = new Panels(past, { lanes: ["events"] });
    panels.onTap((t) => seek(t));
    host.replaceChildren(panels.element);
    if (signal) panels.choose(chartOf(past, signal));
    draw();
  }

  function draw() {
    if (!panels?.charted) return;
    panels.stripAt = -Infinity;
    panels.draw(from, to, true, [happenings.lane()]);
    panels.pointAt(at);
  }

  function seek(t, moves = true) {
    at = Math.min(Math.max(t, from), to);
    if (moves) slider.value = String(Math.round((1000 * (at - from)) / (to - from)));
    onFrame(point);
  }

  function point() {
    if (!past) return;
    setText(clock, moment(at));
    slider.setAttribute("aria-valuetext", moment(at));
    then.write(past, at, happenings.description(at));
    panels?.pointAt(at);
    happenings.mark(at);
  }

  function run(on) {
    playing = on && past !== null;
    if (playing && at >= to) at = from;
    setText(play, playing ? "Pause" : "Play");
    play.setAttribute("aria-pressed", String(playing));
    last = performance.now();
    if (playing) requestAnimationFrame(step);
  }

  function step(now) {
    if (!playing) return;
    seek(at + Math.min(now - last, 250) * speed);
    last = now;
    if (at >= to) run(false);
    else requestAnimationFrame(step);
  }

  const jump = (step) => {
    if (past) seek(at + (step * (to - from)) / 200);
  };
  fields();
  load(from, to);
  return {
    title: `Replay of ${name}`,
    element,
    machine: name,
    stream: "stream",
    keys: [
      [[" "], "play, pause", () => run(!playing)],
      [["ArrowLeft", "ArrowRight"], "earlier, later", (key) => jump(key === "ArrowLeft" ? -1 : 1)],
      [
        ["Home", "End"],
        "to the beginning, to the end",
        (key) => {
          if (past) seek(key === "Home" ? from : to);
        },
      ],
      [
        ["n", "b"],
        "next event, the one before",
        (key) => {
          const next = key === "n" ? happenings.next(at) : happenings.before(at);
          if (next && past) seek(next.t);
        },
      ],
      [
        ["x"],
        "recompute and compare",
        () => {
          if (past) recompute.run();
        },
      ],
    ],
    update: fields,
    close() {
      stop.abort();
      run(false);
      panels?.destroy();
    },
  };
}
