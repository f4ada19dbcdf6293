// An address that no view has: says so, and leads to the fleet.

import { el } from "../dom.js";

const NAME_MAX = 80;

export function open(app, { name }) {
  const shown = name.slice(0, NAME_MAX);
  const element = el(
    "div",
    { class: "view" },
    el("div", { class: "head" }, el("h1", {}, "No such view")),
    el(
      "div",
      { class: "empty" },
      el("p", {}, "There is no view ", el("code", {}, shown), "."),
      el("p", {}, el("a", { href: app.address("fleet") }, "To the fleet")),
    ),
  );
  return { title: "No such view", element, keys: [] };
}
