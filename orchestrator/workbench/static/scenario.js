import { fileAddress, post } from "./api.js";
import { check, choice, field, fill, numberInput } from "./dom.js";
import { interfaceOf } from "./fmus.js";
import { Graph, fits, inputsOf, outputsOf } from "./graph.js";
import { action, fileChoice, message } from "./parts.js";
import { choices, choose, refresh, start, watch } from "./state.js";

const KINDS = {
  constant: [["value", "value", 0]],
  step: [["before", "before", 0], ["after", "after", 1], ["time", "at [s]", 0.1]],
  sine: [["amplitude", "amplitude", 1], ["frequency", "frequency [Hz]", 1], ["offset", "offset", 0]],
  square: [["amplitude", "amplitude", 1], ["period", "period [s]", 1], ["offset", "offset", 0]],
  table: [],
};
const WORDS = { constant: "constant", step: "step", sine: "sine", square: "square wave", table: "a table of the session" };
const MASTERS = [["gauss_seidel", "one after the other"], ["jacobi", "side by side"], ["iterated", "iterated"], ["adaptive", "adaptive steps"]];
const EMPTY = { nodes: {}, connections: [], sources: [], unwanted: [], run: { stop: 1, step: 0.001, algorithm: "gauss_seidel" } };

// A scenario of several FMUs: drawn, fed, written, run. The session keeps it; `variables` of its FMUs are read anew.
export class Scenario {
  constructor(panel, options, show) {
    Object.assign(this, structuredClone(EMPTY), { options, show, last: "", restoring: false });
    this.said = message();
    this.editor = make("div", {});
    this.written = make("p", { class: "note", role: "status" });
    this.graph = new Graph();
    this.element = make("div", {},
      make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Graph of the scenario" }, this.graph.svg), this.editor, this.said.element,
      make("div", { class: "row" }, action("Write it as TOML", this.said, () => this.write()), action("Run the scenario", this.said, () => this.simulate(), "main")), this.written);
    panel.addEventListener("change", () => this.keep());
    watch(() => this.follow());
    this.draw();
    this.follow();
  }

  plain() {
    const nodes = Object.fromEntries(Object.entries(this.nodes).map(([name, { variables, ...node }]) => [name, node]));
    return { nodes, connections: this.connections, sources: this.sources, unwanted: this.unwanted, run: this.run };
  }

  keep() {
    const now = this.plain(), text = JSON.stringify(now);
    if (this.restoring || text === this.last || (!this.last && !Object.keys(now.nodes).length)) return;
    this.last = text;
    choose({ scenario: structuredClone(now) });
  }

  // What the session keeps: of an earlier day, or of another tab of the browser.
  follow() {
    const text = choices.scenario ? JSON.stringify(choices.scenario) : "";
    if (text === this.last) return;
    this.last = text;
    this.restore(structuredClone(choices.scenario ?? EMPTY), text).catch((error) => {
      this.restoring = false;
      this.said.say(`The scenario cannot be shown: ${error.message}`);
    });
  }

  async restore(kept, text) {
    this.restoring = true;  // what stands here is not yet what the session keeps
    for (const node of Object.values(kept.nodes)) node.variables = (await interfaceOf(node.fmu)).variables;
    if (text !== this.last) return;  // a later one is on its way
    Object.assign(this, kept);
    this.restoring = false;
    this.draw();
  }

  async add(fmu) {
    const { variables } = await interfaceOf(fmu);
    const stem = fmu.split("/").at(-1).replace(/\.fmu$/i, "").replace(/[^A-Za-z0-9_]+/g, "_").toLowerCase();
    let name = stem;
    for (let n = 2; this.nodes[name]; n++) name = `${stem}${n}`;
    this.nodes[name] = { fmu, parameters: {}, variables };
    this.draw();
  }

  keys(of) {
    return Object.entries(this.nodes).flatMap(([name, node]) => of(node).map((one) => `${name}.${one.name}`));
  }

  variable(key) {
    const name = Object.keys(this.nodes).find((one) => key.startsWith(`${one}.`));
    return this.nodes[name]?.variables.find((one) => `${name}.${one.name}` === key);
  }

  connect(from, to) {
    this.connections = this.connections.filter((one) => one.to !== to).concat({ from, to });
    this.draw();
  }

  // What has the same name and measures the same; inputs that are fed already stay as they are.
  connectAlike(outs, ins) {
    const fed = new Set([...this.connections, ...this.sources].map((one) => one.to)), end = (key) => this.variable(key).name;
    for (const to of ins.filter((key) => !fed.has(key))) {
      const alike = outs.filter((key) => end(key) === end(to) && fits(this.variable(key), this.variable(to)));
      if (alike.length === 1) this.connections.push({ from: alike[0], to });
    }
    this.draw();
  }

  draw() {
    this.keep();
    this.graph.draw(this.nodes, this.connections);
    const [outs, ins] = [this.keys(outputsOf), this.keys(inputsOf)], names = Object.keys(this.nodes);
    const feed = () => { this.sources.push({ to: ins.find((key) => !this.sources.some((one) => one.to === key)) ?? ins[0], kind: "constant", value: 0 }); this.draw(); };
    fill(this.editor,
      names.length ? null : make("p", { class: "note" }, "There is no FMU yet: choose one above and add it."),
      outs.length && ins.length ? this.connecting(outs, ins) : null,
      make("ul", { class: "files" }, this.connections.map((one) => make("li", {}, `${one.from} → ${one.to} `,
        this.remover(`connection of ${one.from} to ${one.to}`, () => { this.connections = this.connections.filter((other) => other !== one); })))),
      make("ul", { class: "files" }, names.map((name) => make("li", {}, `${name} `, this.remover(name, () => this.drop(name))))),
      ins.length ? make("h3", {}, "Inputs") : null, this.sources.map((source) => this.sourceRow(source, ins)),
      ins.length ? make("button", { type: "button", onclick: feed }, "Feed an input") : null,
      Object.entries(this.nodes).map(([name, node]) => parametersOf(name, node)),
      outs.length ? [this.recorded(outs), this.running(), this.varying()] : null);
  }

  connecting(outs, ins) {
    let from = outs[0], to = "";
    const targets = make("select", { onchange: () => { to = targets.value; } }), into = () => {
      const able = ins.filter((key) => fits(this.variable(from), this.variable(key)));
      to = able[0] ?? "";
      targets.replaceChildren(...able.map((key) => make("option", { value: key }, key)));
    };
    into();
    return make("div", { class: "row" },
      field("From", choice(outs.map((key) => [key, key]), from, (key) => { from = key; into(); })), field("to an input of the same quantity", targets),
      make("button", { type: "button", onclick: () => to && this.connect(from, to) }, "Connect"),
      make("button", { type: "button", onclick: () => this.connectAlike(outs, ins) }, "Connect what has the same name"));
  }

  recorded(outs) {
    const set = (key) => (event) => { this.unwanted = event.target.checked ? this.unwanted.filter((one) => one !== key) : [...this.unwanted, key]; };
    return make("details", {}, make("summary", {}, `Recorded outputs (${outs.filter((key) => !this.unwanted.includes(key)).length} of ${outs.length})`),
      make("div", { class: "row" }, outs.map((key) => check(key, !this.unwanted.includes(key), set(key)))));
  }

  running() {
    return make("div", { class: "row" }, this.number("Stop [s]", this.run, "stop"), this.number("Step [s]", this.run, "step"),
      field("Master", choice(MASTERS, this.run.algorithm, (value) => { this.run.algorithm = value; })));
  }

  // Many runs, in which one parameter takes several values.
  varying() {
    const keys = Object.entries(this.nodes).flatMap(([name, node]) => numbersOf(node).map((one) => `${name}.${one.name}`)), { run } = this;
    if (!keys.length) return null;
    const sweep = async () => {
      const values = [run.from, run.to, run.count], key = keys.includes(run.vary) ? run.vary : keys[0];
      if (values.some((value) => !Number.isFinite(value))) throw new Error("say from which value to which the parameter goes, and how many runs there are");
      this.show(await start("sweep", [], { scenario: await this.write(), vary: `${key}=range:${values.join(":")}`, ...this.options() }));
    };
    run.count ??= 5;
    return make("details", {}, make("summary", {}, "Sweep a parameter"), make("div", { class: "row" },
      field("Parameter", choice(keys.map((key) => [key, key]), run.vary ?? keys[0], (key) => { run.vary = key; })),
      this.number("from", run, "from", false), this.number("to", run, "to", false), this.number("runs", run, "count"), action("Run the sweep", this.said, sweep)));
  }

  drop(name) {
    const inside = (key) => key.startsWith(`${name}.`);
    delete this.nodes[name];
    this.connections = this.connections.filter((one) => !inside(one.from) && !inside(one.to));
    this.sources = this.sources.filter((one) => !inside(one.to));
  }

  remover(what, act) {
    return make("button", { type: "button", "aria-label": `Remove ${what}`, onclick: () => { act(); this.draw(); } }, "Remove");
  }

  number(text, table, key, required = true) {
    return field(text, numberInput({ value: table[key] ?? "", required }, (value) => { table[key] = value; }));
  }

  sourceRow(source, ins) {
    const kind = choice(Object.entries(WORDS), source.kind, (value) => {
      source.kind = value;
      for (const [key, , usual] of KINDS[value]) source[key] ??= usual;
      this.draw();
    });
    const column = make("input", { value: source.column ?? "", placeholder: "name, or #2", onchange: () => { source.column = column.value.trim(); } });
    return make("div", { class: "card" }, make("div", { class: "row" },
      field("Input", choice(ins.map((key) => [key, key]), source.to, (value) => { source.to = value; })), field("is", kind),
      KINDS[source.kind].map(([key, text]) => this.number(text, source, key)),
      source.kind === "table" ? [fileChoice("Table", "log", () => source.file ?? "", (file) => { source.file = file; this.keep(); }), field("Column", column)] : null,
      this.remover(`source of ${source.to}`, () => { this.sources = this.sources.filter((one) => one !== source); })));
  }

  async write() {
    if (!Object.keys(this.nodes).length) throw new Error("add an FMU first");
    const { run } = this, sources = this.sources.map((source) => ({
      to: source.to, kind: source.kind, ...Object.fromEntries(KINDS[source.kind].map(([key]) => [key, source[key]])),
      ...(source.kind === "table" ? { file: source.file, ...(source.column ? { column: source.column } : {}) } : {}),
    }));
    const record = this.keys(outputsOf).filter((key) => !this.unwanted.includes(key));
    const instances = Object.fromEntries(Object.entries(this.nodes).map(([name, node]) => [name, { fmu: node.fmu, parameters: node.parameters }]));
    const master = { algorithm: run.algorithm, step: run.step };
    const made = await post("scenarios", { name: "scenario.toml", stop: run.stop, master, instances, connections: this.connections, sources, record });
    await refresh();
    fill(this.written, "Written: ", make("a", { href: fileAddress(made.file), download: made.name }, made.name));
    return made.file;
  }

  async simulate() {
    this.show(await start("simulate", [], { scenario: await this.write(), ...this.options() }));
  }
}

const numbersOf = (node) => node.variables.filter((one) => one.causality === "parameter" && ["Real", "Integer"].includes(one.type)).slice(0, 200);

function parametersOf(name, node) {
  const open = numbersOf(node);
  if (!open.length) return null;
  return make("details", {}, make("summary", {}, `Parameters of ${name} (${open.length})`), make("div", { class: "row" }, open.map((one) => {
    const input = numberInput({ placeholder: String(one.start ?? ""), value: node.parameters[one.name] ?? "" }, (value) => {
      if (value === null) delete node.parameters[one.name];
      else node.parameters[one.name] = value;
    });
    return field(`${one.name}${one.unit && one.unit !== "1" ? ` [${one.unit}]` : ""}`, input);
  })));
}
