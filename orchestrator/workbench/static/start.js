import { upload } from "./api.js";
import { fill } from "./dom.js";
import { action, message } from "./parts.js";
import { choices, choose, isOfFmu, refresh, session, whenChanged } from "./state.js";

const EXAMPLE = "example-drive.csv";

// The latest result of a command that was made of the chosen log.
const resultOf = (command) =>
  session.jobs.filter((job) => job.command === command && job.state === "done" && !isOfFmu(job) && choices.log && job.asked.inputs?.[0] === choices.log).at(-1);
const fileName = (reference) => reference.split("/").at(-1);

// Tab, title, what it is for; then what is done, and what is missing: one of the two is empty.
function steps() {
  const [look, gap, diagnosis] = ["inspect", "estimate", "diagnose"].map(resultOf);
  const needsLog = choices.log ? "" : "a log is missing";
  const fmu = diagnosis?.files.find((name) => name.endsWith(".fmu"));
  return [
    ["log", "Log", "Drop a log, see its curves, and say what its columns are.", look && `${fileName(choices.log)} was looked at`, needsLog || "press “Look at this log”"],
    ["machine", "Machine", "Say what is known of the machine: inertias, ratio, stiffness.", choices.model && fileName(choices.model), needsLog || "press “Look at this log”, which drafts it"],
    ["gap", "Gap", "How large is the play? With its 95 % interval.", gap?.name, needsLog || "press “Estimate the gap”"],
    ["diagnosis", "Diagnosis", "Which effects does the model of the machine lack?", diagnosis?.name, needsLog || "press “Diagnose”"],
    ["model", "Model", "Move the sliders of the corrected model, and design a controller for it.", fmu, "run the diagnosis first"],
  ];
}

// Where one begins: what this is, an example, and how far the work has come.
export function build(panel, go) {
  const said = message(), list = make("ol", { class: "steps" });
  const link = (tab, text) => make("a", { href: `#${tab}`, onclick: (event) => { event.preventDefault(); go(tab); } }, text);
  async function example() {
    const known = session.files.find((file) => file.name === EXAMPLE)?.file;
    const content = known ? null : await (await fetch(`static/${EXAMPLE}`)).blob();
    const log = known ?? (await upload(new File([content], EXAMPLE))).file;
    await refresh();
    choose({ log, model: "", logs: { [log]: { columns: { u: { torque_constant: 0.5 } }, header: null } } });
    go("log");
  }
  whenChanged(steps, (now) => {
    fill(list, now.map(([tab, title, what, done, missing]) => make("li", { class: done ? "done" : "" },
      make("h3", {}, link(tab, title)), make("p", {}, what),
      make("p", { class: "note" }, make("span", { class: done ? "tag good" : "tag" }, done ? "✓ done" : "to do"), ` ${done || missing}`))));
  });
  panel.append(
    make("p", { class: "answer" }, "From the log of a drive, find the play of its gears with an interval, and the effects that a model of the machine lacks."),
    make("div", { class: "row" },
      make("button", { type: "button", class: "main", onclick: () => go("log") }, "Begin with a log"),
      action("Try it with an example record", said, example),
      make("button", { type: "button", onclick: () => go("fmus") }, "Work with FMUs")),
    said.element, make("h2", {}, "The steps"), list,
    make("p", { class: "note" }, "Apart from these steps, ", link("fmus", "FMUs"), " shows, checks, and runs any FMU or SSP file, and several together. ",
      link("compare", "Results"), " has all results: open, run again, compare, remove."));
}
