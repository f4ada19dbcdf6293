// The head of all views of one machine: which one, its state, program, tool, gate and alert.

import { el, setClass, setHidden, setSymbol, setText, symbol } from "../dom.js";
import { SUPPRESSION_MEANS, age, execution, moment } from "../text.js";
import { serverNow } from "../clock.js";
import { alertName, sentence, worstFirst } from "./alerts.js";
import { ALERT_STATE, TOOL_CHANGE_GATE } from "../vocabulary.js";

/** The worst alert of a machine that stands. Its own signal tells it only while it is online, and not that it is gone. */
function worstAlert(app, machine) {
  const listed = app.alerts?.available === false ? [] : (app.alerts?.alerts ?? []);
  return listed.filter((one) => one.labels?.machine === machine.name && one.phase !== "resolved").sort(worstFirst)[0];
}

export function machineHead(app, machine, viewName, ...after) {
  const select = el("select", {
    class: "field",
    "aria-label": "Machine",
    "aria-keyshortcuts": "[ ]",
    onchange: () => app.go(app.address(viewName, select.value)),
  });
  const sign = symbol("s-unknown"),
    word = el("span"),
    state = el("span", { class: "chip state" }, sign, word);
  const job = el("span", { class: "job" }),
    block = el("code", { class: "nc" }),
    gate = el("span", { class: "chip gate", hidden: true, title: SUPPRESSION_MEANS }, "tool change");
  const alertSign = symbol("s-alert"),
    alertWord = el("span"),
    alert = el("a", { class: "chip medium", href: app.address("alerts"), hidden: true }, alertSign, alertWord);
  const old = el("span", { class: "why old" });
  const element = el(
    "div",
    { class: "head machine-head" },
    el(
      "div",
      { class: "choose" },
      el("button", { type: "button", class: "round", "aria-label": "Previous machine", onclick: () => app.neighbour(-1) }, "‹"),
      el("h1", { class: "unseen" }, machine.name),
      select,
      el("button", { type: "button", class: "round", "aria-label": "Next machine", onclick: () => app.neighbour(1) }, "›"),
    ),
    state,
    old,
    job,
    block,
    gate,
    alert,
    after.length ? el("div", { class: "after" }, ...after) : null,
  );
  let names = "";

  function write() {
    const now = app.plant.names,
      key = now.join("\n");
    if (key !== names) {
      names = key;
      select.replaceChildren(
        ...(now.includes(machine.name) ? now : [machine.name, ...now]).map((name) => el("option", { value: name }, name)),
      );
    }
    if (select.value !== machine.name) select.value = machine.name;
    const [text, id, kind] = machine.online
      ? execution(machine.bare("exec_state"))
      : [machine.lastT === -Infinity ? "Unknown machine" : "Offline", "s-offline", "offline"];
    setText(word, text);
    setSymbol(sign, id);
    state.className = `chip state kind-${kind}`;
    const since = machine.offlineSince ?? machine.lastT;
    setText(old, machine.online || !Number.isFinite(since) ? "" : `stale since ${moment(since)} (${age(serverNow() - since)})`);
    const program = machine.bare("program"),
      tool = machine.bare("tool_number"),
      line = machine.bare("nc_line");
    setText(
      job,
      [program ?? "no program", tool === null ? null : `T${tool}`, line === null ? null : `line ${line}`]
        .filter((one) => one !== null)
        .join(" · "),
    );
    setText(block, machine.bare("nc_block") === null ? "" : String(machine.bare("nc_block")));
    setHidden(block, !block.textContent);
    setHidden(gate, machine.bare(TOOL_CHANGE_GATE) !== true);
    const worst = worstAlert(app, machine),
      phase = worst ? worst.phase : machine.bare(ALERT_STATE),
      alarm = machine.value("alarm")?.quality === "good" ? machine.bare("alarm") : null;
    setHidden(alert, (!phase || phase === "none") && !alarm);
    setSymbol(alertSign, { acknowledged: "s-ack", pending: "s-pending" }[phase] ?? "s-alert");
    alert.title = worst ? sentence(worst) : "";
    setText(
      alertWord,
      [phase && phase !== "none" ? `alert ${phase}${worst ? `: ${alertName(worst)}` : ""}` : "", alarm ? `control: ${alarm}` : ""].filter(Boolean).join(" · "),
    );
    setClass(element, "is-offline", !machine.online);
  }
  write();
  return { element, write };
}
