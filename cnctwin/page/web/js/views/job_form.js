// What a job is asked for with: its kind, then what that kind needs. Files lie below the consumer's folder, or come from here.

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

const named = (text, field) => el("label", { class: "named" }, text, field);
const line = (name, about = {}) => el("input", { class: "field", name, maxlength: "300", ...about });
const choice = (name, options) =>
  el(
    "select",
    { class: "field", name },
    options.map(([value, text]) => el("option", { value }, text)),
  );

/** Its fields in a dialog; `accepted(answer)` where the consumer has taken the job. */
export function openNewJob(accepted) {
  const kind = choice("job", KINDS);
  const program = fileOrName("program", ".nc,.txt,.tap,.mpf,.h,.eia,.min"),
    machine = fileOrName("machine", ".toml");
  const objective = choice("objective", OBJECTIVES);
  const force = line("force_limit_n", { type: "number", min: "0", step: "any", placeholder: "as in machine.toml" });
  const probability = line("probability", { type: "number", min: "0", max: "1", step: "any", placeholder: "by the mean twin" });
  const folder = line("case", { placeholder: "vmc/november" });
  const gains = el("input", { type: "checkbox", name: "free_gains" });
  const optimise = [
    program.element,
    machine.element,
    named("Wanted", objective),
    named("Cutting force at most, N", force),
    named("The limit is kept with the probability", probability),
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
    const numbers = [force, probability].filter((one) => one.value !== "").map((one) => [one.name, Number(one.value)]);
    return {
      job,
      objective: objective.value,
      ...(await program.given("program_text")),
      ...(await machine.given("machine_toml")),
      ...Object.fromEntries(numbers),
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
  const given = async (textKey) =>
    file.files.length ? { [textKey]: decoded(await file.files[0].arrayBuffer()) } : { [name]: own.value.trim() };
  return { element, given };
}

/** What is not UTF-8 is read as Latin-1, as controls write it. */
function decoded(bytes) {
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder("iso-8859-1").decode(bytes);
  }
}
