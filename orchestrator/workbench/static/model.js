import { fileAddress } from "./api.js";
import { make, fill } from "./dom.js";
import { action, fileChoice, isFmu, jobView, message } from "./parts.js";
import { choose, latest, session, start, watch } from "./state.js";

// What a diagnosis leaves: the corrected FMU, its model file, the check of it.
export function build(panel) {
  const said = message(), list = make("div", {}), view = jobView();
  let fmu = "", shown = "";
  const draw = () => {
    const jobs = session.jobs.filter((job) => job.files.some((name) => /\.(fmu|ssp)$/i.test(name) || name === "corrected.toml"));
    const now = JSON.stringify(jobs.map((job) => job.name));
    if (now === shown) return;
    shown = now;
    const last = latest("diagnose")?.files.find((name) => /\.(fmu|ssp)$/i.test(name));
    if (last) fmu = `results/${latest("diagnose").name}/${last}`;
    fill(list, jobs.length ? jobs.toReversed().map((job) => make("div", { class: "job" }, make("strong", {}, job.name),
      make("ul", { class: "files" }, job.files.filter((name) => /\.(fmu|ssp|toml)$/i.test(name)).map((name) =>
        make("li", {}, make("a", { href: fileAddress(`results/${job.name}/${name}`), download: name }, name))))))
      : make("p", {}, "A diagnosis leaves the corrected model here."));
  };
  watch(draw);
  draw();
  panel.append(list,
    make("div", { class: "row" }, fileChoice("Model", isFmu, () => fmu, (file) => { fmu = file; choose({}); })),
    said.element,
    make("div", { class: "row" }, action("Check it", said, async () => {
      if (!fmu) throw new Error("choose an FMU first");
      view.show(await start("check", [fmu]));
    }, "main")),
    view.element);
}
