import { check, field, numberIn, numberInput } from "./dom.js";
import { action, fileChoice, jobView, kept, message } from "./parts.js";
import { choices, choose, modelOfLog, start, watch } from "./state.js";
import { unsaved } from "./machine.js";

export function inputs() {
  const note = make("p", { class: "note", role: "status" });
  const tell = () => {
    note.textContent = unsaved().length ? `Changed in the tab Machine and not saved: ${unsaved().join(", ")}`
      : !choices.log ? "No log is chosen yet: drop one in the tab Log, or take the example in the tab Start."
      : !choices.model ? "Without a model file the machine is the default one; “Look at this log” in the tab Log drafts one from the record." : "";
  };
  watch(tell);
  tell();
  return make("div", {}, make("div", { class: "row" },
    fileChoice("Log", "log", () => choices.log, (log) => choose({ log })),
    fileChoice("Model file", "model", () => choices.model, (model) => choose({ model }), "the default machine")), note);
}

// Options that all commands have for reading a log, kept for a tab; `options()` gives what the user has filled in.
export function reading(tab) {
  const part = kept(`${tab}.part`, make("input", { placeholder: "all, or 2:30" }));
  const rate = kept(`${tab}.rate`, numberInput({ placeholder: "what the motion needs" }));
  const stamps = make("select", {}, [["", "are uniform"], ["uniform", "jitter, the samples do not"], ["linear", "interpolate linearly"], ["cubic", "interpolate by cubics"]]
    .map(([value, text]) => make("option", { value }, text)));
  kept(`${tab}.stamps`, stamps);
  return {
    element: make("details", {}, make("summary", {}, "Reading of the log"), make("div", { class: "row" },
      field("Part [s]", part), field("Samples per second", rate), field("Times of the rows", stamps))),
    options: () => ({ part: part.value.trim(), rate: numberIn(rate), resample: stamps.value }),
  };
}

export const needLog = () => { if (!choices.log) throw new Error("choose a log first, or drop one in the tab Log"); };

export function build(panel) {
  const said = message();
  const read = reading("gap"), motorOnly = check("leave the load encoder out", false, () => {});
  kept("gap.motor_only", motorOnly.querySelector("input"), false);
  const options = async () => ({ model: await modelOfLog(), motor_only: motorOnly.querySelector("input").checked, ...read.options() });
  const view = jobView("gap");

  // An experiment that would show the gap better, by the command's own design.
  const limits = [["size", "Half-gap to be seen [rad]", "the estimate"], ["torque_limit", "Largest torque [N.m]", "250"], ["speed_limit", "Largest motor speed [rad/s]", "50"], ["duration", "Length [s]", "10"]]
    .map(([key, text, usual]) => ({ key, text, input: kept(`design.${key}`, numberInput({ placeholder: usual })) }));
  const wanted = () => Object.fromEntries(limits.map(({ key, input }) => [key, numberIn(input)]));
  const proposal = make("details", {}, make("summary", {}, "What to log next: propose an experiment"),
    make("div", { class: "row" }, limits.map(({ text, input }) => field(text, input)),
      action("Propose an experiment", said, async () => view.show(await start("estimate", [], { model: choices.model, design: true, ...wanted() })))));

  panel.append(inputs(), make("div", { class: "row" }, motorOnly), read.element, said.element,
    make("div", { class: "row" },
      action("Estimate the gap", said, async () => { needLog(); view.show(await start("estimate", [choices.log], await options())); }, "main")),
    proposal, view.element);
}
