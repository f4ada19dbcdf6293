// A view of one machine while there is none; it opens again as soon as there is one.

import { el } from "../dom.js";

export function noMachine(app, title, text) {
  const told = el("div", { class: "empty" }, el("h2", {}, "No machine yet"), text ? el("p", {}, text) : null);
  return {
    title,
    element: el("div", { class: "view" }, el("div", { class: "head" }, el("h1", {}, title)), told),
    machine: null,
    keys: [],
    stream: "stream",
    update: () => {
      if (app.pick(null)) app.reopen();
    },
  };
}
