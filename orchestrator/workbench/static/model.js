import { fileAddress } from "./api.js";
import { choice, field, fill, make } from "./dom.js";
import { action, fileChoice, jobView, message } from "./parts.js";
import { sliders } from "./sliders.js";
import { choose, isOver, latest, session, start, watch } from "./state.js";

// What a diagnosis leaves: the corrected FMU, its model file, the check of it, and a simulation under sliders.
export function build(panel) {
  const said = message(), list = make("div", {}), moving = make("div", {}), which = make("div", { class: "field grows" }), view = jobView("model");
  let fmu = "", shown = "", simulated = "", wanted = "";
  const able = () => session.jobs.filter((job) => isOver(job) && ["diagnose", "estimate"].includes(job.command) && job.files.includes(`${job.command}.csv`));
  const draw = () => {
    const jobs = session.jobs.filter((job) => job.files.some((name) => /\.(fmu|ssp)$/i.test(name) || /(^|\/)corrected\.toml$/.test(name)));
    const names = able().map((job) => job.name), now = JSON.stringify([jobs.map((job) => job.name), names]);
    if (now === shown) return;
    shown = now;
    const last = latest("diagnose")?.files.find((name) => /\.(fmu|ssp)$/i.test(name));
    if (last) fmu = `results/${latest("diagnose").name}/${last}`;
    fill(list, jobs.length ? jobs.toReversed().map((job) => make("div", { class: "job" }, make("strong", {}, job.name),
      make("ul", { class: "files" }, job.files.filter((name) => /\.(fmu|ssp|toml)$/i.test(name)).map((name) =>
        make("li", {}, make("a", { href: fileAddress(`results/${job.name}/${name}`), download: name.split("/").at(-1) }, name))))))
      : make("p", {}, "A diagnosis leaves the corrected model here."));
    simulated = names.includes(wanted) ? wanted : names.at(-1) ?? "";
    const made = choice(names.length ? names.map((name) => [name, name]) : [["", "none yet"]], simulated, (name) => { simulated = wanted = name; });
    fill(which, ...field("Model of", made).children);
  };
  watch(draw);
  draw();
  panel.append(list,
    make("div", { class: "row" }, fileChoice("FMU or SSP file", "fmu", () => fmu, (file) => { fmu = file; choose({}); })),
    said.element,
    make("div", { class: "row" }, action("Check it", said, async () => {
      if (!fmu) throw new Error("choose an FMU first");
      view.show(await start("check", [fmu]));
    }, "main")),
    view.element,
    make("h2", {}, "Simulate it"), make("div", { class: "row" }, which,
      action("Simulate under sliders", said, async () => {
        if (!simulated) throw new Error("a diagnosis or an estimate is needed first");
        fill(moving, make("p", { class: "note", role: "status" }, "Building the FMU …"));
        try { fill(moving, await sliders(simulated)); } catch (error) { fill(moving); throw error; }
      }, "main")),
    moving);
}
