// An effect that the demo hides in the machine: its hash from the start, and behind Reveal what it is, with the salt of the hash.

import { post } from "../api.js";
import { openAsked } from "../dialogs.js";
import { el, say, symbol } from "../dom.js";
import { number, sentence } from "../text.js";
import { called, parameter } from "./twin_parts.js";

const SHOWN_DIGITS = 8;

/** The box. sealed: {sha256, revealed: null or {added, equation, parameters, salt, text}} */
export function sealedBox(sealed, changed) {
  const { sha256, revealed } = sealed;
  const hash = el("code", { title: sha256 }, `${sha256.slice(0, SHOWN_DIGITS)}…`);
  if (!revealed)
    return el(
      "div",
      { class: "sealed" },
      el("h3", {}, "Something is hidden in this machine"),
      el("p", {}, "It was given an effect that its twin does not know. Which one stays secret until you reveal it: it is sealed as ", hash, "."),
      el("button", { type: "button", class: "button", "data-deed": "reveal", onclick: () => ask(changed) }, "Reveal"),
    );
  const checked = el("p", { class: "note" }, "The hash is being computed again …");
  check(revealed, sha256, checked);
  return el(
    "div",
    { class: "sealed revealed" },
    el("h3", {}, "What was hidden"),
    el("p", { class: "sentence" }, called(revealed.added)),
    el(
      "ul",
      { class: "plainlist" },
      Object.entries(revealed.parameters ?? {}).map(([name, one]) =>
        el("li", {}, `${sentence(parameter(name))} `, el("strong", {}, `${number(one.value)} ${one.unit ?? ""}`.trim()), `: ${one.meaning ?? ""}`),
      ),
    ),
    checked,
    el(
      "details",
      {},
      el("summary", {}, "Check it yourself"),
      el("p", { class: "note" }, "SHA-256 of salt, line feed and text:"),
      el("pre", { tabindex: "0" }, `${sha256}\n\n${revealed.salt}\n${revealed.text}`),
    ),
  );
}

function ask(changed) {
  const about = el("p", {}, "The seal is opened for everybody who looks at this page. It cannot be closed again.");
  openAsked("Reveal what is hidden", [about], "Reveal", async () => {
    await post("demo/reveal", {});
    say("Revealed");
    changed();
  });
}

/** Computes the hash here, so that nobody has to believe the server. */
async function check(revealed, sha256, where) {
  const bytes = new TextEncoder().encode(`${revealed.salt}\n${revealed.text}`);
  if (!globalThis.crypto?.subtle) {
    where.textContent = "This browser computes no hash on this address; the command line does.";
    return;
  }
  const found = [...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))]
    .map((byte) => byte.toString(16).padStart(2, "0"))
    .join("");
  const isSame = found === sha256;
  where.replaceChildren(
    symbol(isSame ? "s-ack" : "s-alert"),
    isSame ? " Your browser has computed the hash again: it is the one that was shown from the start." : " The hash is another one.",
  );
  where.className = `equal ${isSame ? "yes" : "no"}`;
}
