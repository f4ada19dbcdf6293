// The form that asks for a job: its kind, then what that kind needs. Files lie below the consumer's folder, or come from here.

import { post } from "../api.js";
import { openAsked } from "../dialogs.js";
import { el } from "../dom.js";

const KINDS = [
  ["optimise", "Optimise a program's feeds and speeds"],
  ["identify", "Identify a machine from recordings"],
  ["diagnose", "Diagnose the gap of a machine"],
];
const OBJECTIVES = [
  ["time", "the shortest time"],
  ["cost", "the lowest cost"],
  ["pareto", "both: the front"],
];
const SPEED_CHANGES = [
  ["anywhere", "at any line"],
  ["in_air", "only outside of the material"],
  ["per_tool", "with the tool only: one speed for each"],
];

const named = (text, field) => el("label", { class: "named" }, text, field);
const line = (name, about = {}) => el("input", { class: "field", name, maxlength: "300", ...about });
const number = (name, min, max, step, placeholder) => line(name, { type: "number", min, max, step, placeholder });
const choice = (name, options) =>
  el(
    "select",
    { class: "field", name },
    options.map(([value, text]) => el("option", { value }, text)),
  );

/** Its fields in a dialog; `accepted(answer)` where the consumer has taken the job. */
export function openNewJob(accepted) {
  const kind = choice("job", KINDS);
  const program = fileOrName("program", ".nc,.mpf,.spf,.h,.eia,.min,.tap,.ngc,.cnc,.gcode,.txt"),
    machine = fileOrName("machine", ".toml");
  const objective = choice("objective", OBJECTIVES);
  const changes = choice("speed_changes", SPEED_CHANGES);
  const force = number("force_limit_n", "0", null, "any", "as in machine.toml"),
    probability = number("probability", "0", "1", "any", "constants as stated"),
    seed = number("seed", "0", String(2 ** 32 - 1), "1", "1"),
    evolutions = number("evolutions", "1", "100000", "1", "60"),
    population = number("population", "4", "100000", "2", "64");
  const folder = line("case", { placeholder: "vmc/november" });
  const gains = el("input", { type: "checkbox", name: "free_gains" });
  const optimise = [
    program.element,
    machine.element,
    named("Wanted", objective),
    named("Cutting force at most, N", force),
    named("The limit is kept with the probability", probability),
    named("The spindle may change its speed", changes),
    el("div", { class: "search" }, named("Seed", seed), named("Evolutions", evolutions), named("Population", population)),
  ];
  const parts = {
    optimise,
    identify: [named("Case, a folder below the consumer's", folder), el("label", { class: "tick" }, gains, "servo gains are not known")],
    diagnose: [named("Case, a folder below the consumer's", folder)],
  };
  const fields = el("div", { class: "fields" });
  const show = () => fields.replaceChildren(...parts[kind.value]);
  kind.addEventListener("change", show);

  async function asked() {
    const job = kind.value;
    if (job !== "optimise") return { job, case: folder.value.trim(), ...(job === "identify" ? { free_gains: gains.checked } : {}) };
    const figures = [force, probability, seed, evolutions, population].filter((one) => one.value !== "");
    return {
      job,
      objective: objective.value,
      speed_changes: changes.value,
      ...(await program.given("program_text", true)),
      ...(await machine.given("machine_toml")),
      ...Object.fromEntries(figures.map((one) => [one.name, Number(one.value)])),
    };
  }

  openAsked("New job", [named("What", kind), fields], "Start", async () => accepted(await post("jobs", await asked())));
  show();
  kind.focus();
}

/** A file of this device, or the name of one below the consumer's folder. */
function fileOrName(name, accept) {
  const title = name === "program" ? "Program" : "Machine (machine.toml)";
  const own = line(name, { placeholder: name === "program" ? "plate.nc" : "vmc.toml" });
  const file = el("input", { class: "field", type: "file", accept, name: `${name}_file` });
  const element = el(
    "div",
    { class: "either" },
    named(`${title}: below the consumer's folder`, own),
    named(`${title}: or a file of this device`, file),
  );
  const given = async (textKey, isProgram) => {
    if (!file.files.length) return { [name]: own.value.trim() };
    const { text, encoding } = decoded(new Uint8Array(await file.files[0].arrayBuffer()));
    if (!isProgram) return { [textKey]: text };
    return { [textKey]: text, name: file.files[0].name.slice(-120), ...(encoding === "utf-8" ? {} : { encoding }) };
  };
  return { element, given };
}

/** Text and encoding of a file. What is not UTF-8 is Latin-1, as controls write it; to a browser that word is windows-1252. */
function decoded(bytes) {
  const marked = bytes[0] === 0xef && bytes[1] === 0xbb && bytes[2] === 0xbf;
  try {
    return { text: new TextDecoder("utf-8", { fatal: true }).decode(bytes), encoding: marked ? "utf-8-sig" : "utf-8" };
  } catch {
    return { text: Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""), encoding: "latin-1" };
  }
}
