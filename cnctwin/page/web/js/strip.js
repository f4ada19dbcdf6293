// Lanes of what was the case, one under the other, over the same time as the charts above: states, tools, events.

import { drawn, el } from "./dom.js";
import { execution } from "./text.js";

export class Strip {
  constructor(names, label) {
    this.lanes = names.map((name) => ({
      name: el("span", { class: "name" }, name),
      svg: drawn("svg", { "aria-hidden": "true" }),
      key: "",
    }));
    this.element = el(
      "div",
      { class: "strip", role: "img", "aria-label": label },
      this.lanes.map(({ name, svg }) => [name, el("div", { class: "lane" }, svg)]),
    );
  }

  /** items of a lane: {from, to, text, kind, title}; without `to` a mark of a moment. */
  show(lanes, from, to) {
    this.lanes.forEach((lane, i) => this.#lane(lane, lanes[i] ?? [], from, to));
  }

  #lane({ svg }, items, from, to) {
    const wide = svg.clientWidth || 800,
      x = (t) => (wide * (t - from)) / (to - from),
      made = [];
    for (const { from: begin, to: end, text, kind, title } of items) {
      if (end === undefined || end === null) {
        if (begin < from || begin > to) continue;
        const at = x(begin),
          mark = drawn("path", { d: `M${at - 5} 5h10l-5 9zM${at - 0.75} 14h1.5v12h-1.5z`, class: `x-event ${kind}` });
        mark.append(drawn("title", {}, title ?? text));
        made.push(mark);
        continue;
      }
      if (end < from || begin > to) continue;
      const left = Math.max(0, x(begin)),
        right = Math.min(wide, x(end));
      const block = drawn("rect", {
        x: left.toFixed(1),
        y: 0,
        width: Math.max(1, right - left).toFixed(1),
        height: 26,
        class: `x-${kind}`,
      });
      if (title ?? text) block.append(drawn("title", {}, title ?? text));
      made.push(block);
      if (text && right - left > 8 * text.length + 8)
        made.push(
          drawn(
            "text",
            { x: (left + 6).toFixed(1), y: 18, class: `text ${["active", "stopped", "held"].includes(kind) ? "on" : ""}` },
            text,
          ),
        );
    }
    svg.replaceChildren(...made);
  }
}

/** Items of a lane of execution states, from stretches [from, to, state]. */
export const stateItems = (stretches) =>
  stretches.map(([from, to, state]) => {
    const [word, , kind] = execution(state);
    return { from, to, text: word, kind };
  });

/** Items of a lane of tools, and of gates behind them. */
export const toolItems = (tools, gates) => [
  ...gates.filter(([, , on]) => on === true).map(([from, to]) => ({ from, to, text: "", kind: "gate", title: "suppression window (tool change)" })),
  ...tools.map(([from, to, tool]) => ({
    from,
    to,
    text: tool === null ? "" : `T${tool}`,
    kind: "none",
    title: tool === null ? "no tool" : `tool ${tool}`,
  })),
];
