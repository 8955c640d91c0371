import { check, choice, field, fill, numberIn, numberInput } from "./dom.js";
import { action, fileChoice, jobView, kept, message } from "./parts.js";
import { sliders } from "./sliders.js";
import { choices, choose, isOfFmu, isOver, session, start, whenChanged } from "./state.js";

const CORRECTED = /(^|\/)corrected\.toml$/;

export function build(panel) {
  panel.append(make("p", { class: "note" }, "A diagnosis or an estimate writes the corrected model: its FMU and corrected.toml are among the files of the result."),
    make("h2", {}, "Simulate it"), ...simulation(), make("h2", {}, "A controller for it"), ...controller());
}

// The model of a result under sliders.
function simulation() {
  const said = message(), moving = make("div", {}), which = make("div", { class: "field grows" });
  const able = () => session.jobs.filter((job) => isOver(job) && ["diagnose", "estimate"].includes(job.command) && !isOfFmu(job) && job.files.includes(`${job.command}.csv`)).map((job) => job.name);
  const chosen = () => { const names = able(); return names.includes(choices.fields.sliders) ? choices.fields.sliders : names.at(-1) ?? ""; };
  whenChanged(() => [able(), chosen()], ([names, now]) => {
    const options = names.length ? names.map((name) => [name, name]) : [["", "none yet"]];
    fill(which, ...field("Model of", choice(options, now, (name) => choose({ fields: { sliders: name } }))).children);
  });
  return [make("div", { class: "row" }, which, action("Simulate under sliders", said, async () => {
    if (!chosen()) throw new Error("a diagnosis or an estimate is needed first");
    fill(moving, make("p", { class: "note", role: "status" }, "Building the FMU …"));
    try { fill(moving, await sliders(chosen())); } catch (error) { fill(moving); throw error; }
  }, "main")), said.element, moving];
}

// From the corrected model to a controller: one that crosses the gap softly, or the gains of a regulator.
function controller() {
  const said = message(), view = jobView("control"), force = check("go on with a model that cannot be trusted", false, () => {});
  const speed = kept("control.impact_speed", numberInput({ placeholder: "by the machine" })), torque = kept("control.torque_limit", numberInput({ placeholder: "the model's" }));
  const usual = () => session.jobs.flatMap((job) => job.files.filter((name) => CORRECTED.test(name)).map((name) => `results/${job.name}/${name}`)).at(-1) ?? "";
  const model = () => choices.fields["control.model"] ?? usual();
  const needed = () => { if (!model()) throw new Error("choose a model file first; a diagnosis or an estimate leaves corrected.toml"); return model(); };
  kept("control.force", force.querySelector("input"), false);
  return [
    make("div", { class: "row" }, fileChoice("Model file", "model", model, (file) => choose({ fields: { "control.model": file } })),
      field("Speed at which the teeth shall meet [rad/s]", speed), field("Torque limit of the drive [N.m]", torque), force),
    said.element,
    make("div", { class: "row" },
      action("Design a controller that crosses the gap", said, async () => view.show(await start("compensate", [], {
        model: needed(), impact_speed: numberIn(speed), torque_limit: numberIn(torque), force: force.querySelector("input").checked })), "main"),
      action("Design a regulator", said, async () => view.show(await start("regulator", [], { model: needed() })))),
    view.element];
}
