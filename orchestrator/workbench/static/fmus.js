import { plain } from "./advice.js";
import { get, post } from "./api.js";
import { field, fill, numberIn, numberInput } from "./dom.js";
import { action, dropZone, fileChoice, isFmu, isLog, isModel, jobView, kept, message } from "./parts.js";
import { Scenario } from "./scenario.js";
import { choices, choose, refresh, start, watch } from "./state.js";
import { drawTree } from "./tree.js";

const known = new Map();  // interfaces, by file

export async function interfaceOf(file) {
  if (!known.has(file)) known.set(file, await get(`variables?file=${encodeURIComponent(file)}`));
  return known.get(file);
}

export const build = (panel) => new FmuTab(panel);

// FMUs and SSP files: what they are, their variables, their check and their run; below, a scenario of several.
class FmuTab {
  constructor(panel) {
    this.fmu = "";
    this.said = message();
    [this.head, this.tree] = [make("div", {}), make("div", {})];
    this.limit = kept("fmus.time_limit", numberInput({ placeholder: "the usual one" }));
    this.checked = jobView("fmu");
    this.ran = jobView("fmus");
    this.scenario = new Scenario(panel, () => ({ time_limit: numberIn(this.limit) }), (job) => this.ran.show(job));
    panel.append(
      dropZone("Drop FMUs, SSP files, logs or maps here", (name) => isFmu(name) || isLog(name) || isModel(name), (file) => isFmu(file) && this.pick(file), true),
      make("div", { class: "row" }, fileChoice("FMU or SSP file", "fmu", () => this.fmu, (file) => this.pick(file)), field("Time limit [s]", this.limit)),
      this.said.element, this.head,
      make("div", { class: "row" },
        action("Run this FMU", this.said, () => this.run(), "main"),
        action("Check this FMU", this.said, async () => this.checked.show(await start("check", [this.needed()], { time_limit: numberIn(this.limit) }))),
        action("Add it to the scenario", this.said, async () => this.scenario.add(this.needed(/\.fmu$/i, "an FMU")))),
      this.measured(), this.tree, this.checked.element,
      make("h2", {}, "Scenario of several FMUs"), this.scenario.element, this.ran.element);
    watch(() => this.follow());
    this.follow();
  }

  // What a log says of this FMU; a map connects columns with variables.
  measured() {
    const map = () => choices.fields["fmus.map"] ?? "";
    const run = (command, draft_map = false) => async () => {
      const fmu = this.needed(/\.fmu$/i, "an FMU");
      if (!choices.log) throw new Error("choose a log first, or drop one above");
      if (!draft_map && !map()) throw new Error("choose a map first: “Draft a map” writes one to complete");
      this.checked.show(await start(command, [choices.log], { fmu, ...(draft_map ? { draft_map } : { map: map() }) }));
    };
    return make("details", {}, make("summary", {}, "Compare it with a log"),
      make("div", { class: "row" }, fileChoice("Log", "log", () => choices.log, (log) => choose({ log })),
        fileChoice("Map", "map", map, (file) => choose({ fields: { "fmus.map": file || null } }))),
      make("div", { class: "row" }, action("Draft a map", this.said, run("diagnose", true)),
        action("Fit its parameters", this.said, run("calibrate")), action("Find what it lacks", this.said, run("diagnose"))));
  }

  needed(kind = /\.(fmu|ssp)$/i, what = "an FMU or SSP file") {
    if (!kind.test(this.fmu)) throw new Error(`choose ${what} first, or drop one above`);
    return this.fmu;
  }

  follow() {
    const now = choices.fields.fmu ?? "";
    if (now !== this.fmu || !this.head.childElementCount) this.pick(now);
  }

  async pick(file) {
    this.fmu = file;
    if (file !== (choices.fields.fmu ?? "")) choose({ fields: { fmu: file || null } });
    this.said.say("");
    fill(this.tree);
    fill(this.head, make("p", { class: "note", role: "status" }, file ? "Reading …" : "No FMU is chosen yet: drop one, or choose one that a diagnosis has left."));
    if (!file) return;
    try {
      const found = await interfaceOf(file);
      if (file !== this.fmu) return;
      fill(this.head, found.components ? ofSystem(found) : ofModel(found));
      fill(this.tree, drawTree(found.variables));
    } catch (error) {
      if (file === this.fmu) { fill(this.head, make("p", { class: "note" }, "It cannot be read.")); this.said.say(error.message); }
    }
  }

  // One FMU alone over its own time, its inputs at their starts; an SSP file as it stands.
  async run() {
    const fmu = this.needed(), limit = { time_limit: numberIn(this.limit) };
    if (/\.ssp$/i.test(fmu)) { this.checked.show(await start("ssp", [fmu], limit)); return; }
    const { variables, stop, step } = await interfaceOf(fmu), name = "model";
    const outputs = variables.filter((one) => one.causality === "output"), numbers = variables.filter((one) => one.causality === "local" && one.type === "Real");
    const record = (outputs.length ? outputs : numbers.slice(0, 20)).map((one) => `${name}.${one.name}`);
    if (!record.length) throw new Error("this FMU has no outputs and no other numbers to record");
    const end = stop ?? 1, master = { algorithm: "gauss_seidel", step: step ?? end / 1000 };
    const made = await post("scenarios", { name: `${fmu.split("/").at(-1).replace(/\.fmu$/i, "")}-alone.toml`, stop: end, master, instances: { [name]: { fmu } }, record });
    await refresh();
    this.checked.show(await start("simulate", [], { scenario: made.file, ...limit }));
  }
}

const fact = (name, value) => (value ? make("div", {}, make("dt", {}, name), make("dd", {}, value)) : null);

function ofModel(found) {
  const over = found.stop === null ? "1 s, for it names no time" : `${found.stop} s`;
  return [
    make("h3", {}, found.name), found.description ? make("p", {}, found.description) : null,
    make("dl", { class: "facts" }, fact("made by", found.tool || "it does not say"), fact("FMI", `${found.version}, ${found.kind}`), fact("platforms", found.platforms.join(", ") || "none"),
      fact("variables", String(found.variables.length)), fact("runs over", over)),
    found.left_out ? make("p", { class: "note" }, plain(found.left_out)) : null];
}

function ofSystem(found) {
  const parts = Object.entries(found.components).map(([name, model]) => `${name} (${model})`);
  return [
    make("p", {}, `System of ${parts.length} FMU${parts.length === 1 ? "" : "s"} until ${found.stop} s: ${parts.join(", ")}`),
    ...found.remarks.map((text) => make("p", { class: "note" }, plain(text))),
    make("details", {}, make("summary", {}, `Connections (${found.connections.length})`),
      make("ul", { class: "files" }, found.connections.map(([from, to]) => make("li", {}, `${from} → ${to}`))))];
}
