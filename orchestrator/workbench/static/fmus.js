import { fileAddress, get, post, upload } from "./api.js";
import { plain } from "./advice.js";
import { check, choice, digits, field, fill, make, numberIn, numberInput } from "./dom.js";
import { Graph, fits, inputsOf, outputsOf, place, shape } from "./graph.js";
import { action, dropZone, fileChoice, isFmu, isLog, jobView, kept as remembered, message } from "./parts.js";
import { choices, choose, refresh, start, watch } from "./state.js";

const KINDS = {
  constant: [["value", "value", 0]],
  step: [["before", "before", 0], ["after", "after", 1], ["time", "at [s]", 0.1]],
  sine: [["amplitude", "amplitude", 1], ["frequency", "frequency [Hz]", 1], ["offset", "offset", 0]],
  square: [["amplitude", "amplitude", 1], ["period", "period [s]", 1], ["offset", "offset", 0]],
  table: [],
  drawn: [],
};
const WORDS = { constant: "constant", step: "step", sine: "sine", square: "square wave", table: "a table of the session", drawn: "drawn by hand" };

// Time and value of a line such as "0.5, 2" or "0,5; 2"; null: it does not hold two numbers.
function pairOf(line) {
  const parts = /[;\t]/.test(line) ? line.split(/[;\t]/).map((part) => part.trim().replace(",", ".")) : line.trim().split(/\s*,\s*|\s+/);
  const numbers = parts.map((part) => (part === "" ? NaN : Number(part)));
  return numbers.length === 2 && numbers.every(Number.isFinite) ? numbers : null;
}

export function build(panel) {
  const said = message(), graphSaid = message(), tree = make("div", {}), editor = make("div", {}), view = jobView("fmus"), checked = jobView("fmu");
  const nodes = {}, known = new Map(), drawings = [];
  let connections = [], sources = [], fmu = "", last = "", restoring = false;
  const run = { stop: 1, step: 0.001, algorithm: "gauss_seidel" }, unwanted = new Set();
  const graph = new Graph(connect, keep);

  async function variablesOf(file) {
    if (!known.has(file)) known.set(file, await get(`variables?file=${encodeURIComponent(file)}`));
    return known.get(file);
  }

  async function pick(file) {
    fmu = file;
    if (file !== (choices.fields.fmu ?? "")) choose({ fields: { fmu: file || null } });
    said.say("");
    fill(tree);
    if (!file) return;
    try {
      const found = await variablesOf(file);
      if (file === fmu) drawTree(found);
    } catch (error) { said.say(error.message); }
  }

  function drawTree(found) {
    const words = make("input", { type: "search", oninput: () => list() }), place = make("div", {});
    const list = () => {
      const text = words.value.trim().toLowerCase();
      const shown = found.variables.filter((one) => !text || `${one.name} ${one.description} ${one.causality}`.toLowerCase().includes(text));
      fill(place, branch(shown, 0, text !== ""), shown.length ? null : make("p", { class: "note" }, "no variable has these words"));
    };
    fill(tree,
      make("p", { class: "note" }, found.components ? ofSystem(found) : `FMI ${found.version}, ${found.kind}, ${found.variables.length} variables${found.left_out ? `; ${found.left_out}` : ""}`),
      ...(found.components ? [...found.remarks.map((text) => make("p", { class: "note" }, plain(text))), make("details", {}, make("summary", {}, `Connections (${found.connections.length})`),
        make("ul", { class: "files" }, found.connections.map(([from, to]) => make("li", {}, `${from} → ${to}`))))] : []),
      field("Find a variable", words), place);
    list();
  }

  function ofSystem(found) {
    const parts = Object.entries(found.components).map(([name, model]) => `${name} (${model})`);
    return `System of ${parts.length} FMU${parts.length === 1 ? "" : "s"} until ${found.stop} s: ${parts.join(", ")}`;
  }

  // Variables by the parts of their names; of a large branch what stands below it comes when it is opened.
  function branch(variables, depth, open) {
    const groups = Map.groupBy(variables, (one) => one.name.split(".").slice(depth, -1)[0] ?? "");
    const leaves = groups.get("") ?? [];
    groups.delete("");
    return [
      ...[...groups].map(([name, inside]) => {
        const body = make("div", { class: "branch" });
        const made = make("details", { open: open && inside.length < 60, ontoggle: () => { if (made.open && !body.childElementCount) body.append(...branch(inside, depth + 1, open)); } },
          make("summary", {}, `${name} (${inside.length})`), body);
        if (made.open) body.append(...branch(inside, depth + 1, open));
        return made;
      }),
      leaves.length ? leafTable(leaves.slice(0, 300)) : null,
      leaves.length > 300 ? make("p", { class: "note" }, `${leaves.length - 300} more: find them by their names`) : null,
    ].filter(Boolean);
  }

  function leafTable(leaves) {
    const bound = (limit, words) => (limit === null || Math.abs(limit) > 1e11 ? "" : `${words} ${limit}`);
    const range = (one) => [bound(one.minimum, "from"), bound(one.maximum, "to")].join(" ").trim();
    return make("div", { class: "scroll low", tabindex: 0, role: "region", "aria-label": "Variables" }, make("table", {},
      make("thead", {}, make("tr", {}, ["variable", "causality", "type", "start", "unit", "limits", "description"].map((text) => make("th", { scope: "col" }, text)))),
      make("tbody", {}, leaves.map((one) => make("tr", {},
        make("td", {}, one.name), make("td", {}, one.causality), make("td", {}, one.items.length ? one.items.join(", ") : one.type),
        make("td", { class: "number" }, one.start === null ? "" : String(one.start)), make("td", {}, one.unit), make("td", {}, range(one)), make("td", { class: "long" }, one.description))))));
  }

  async function add() {
    if (!/\.fmu$/i.test(fmu)) throw new Error("choose an FMU first, or drop one");
    const found = await variablesOf(fmu);
    const stem = fmu.split("/").at(-1).replace(/\.fmu$/i, "").replace(/[^A-Za-z0-9_]+/g, "_").toLowerCase();
    let name = stem;
    for (let n = 2; nodes[name]; n++) name = `${stem}${n}`;
    nodes[name] = { fmu, variables: found.variables, parameters: {}, ...place(Object.keys(nodes).length) };
    draw();
  }

  const variable = (key) => {
    const name = Object.keys(nodes).find((one) => key.startsWith(`${one}.`));
    return nodes[name]?.variables.find((one) => `${name}.${one.name}` === key);
  };

  function connect(from, to) {
    graphSaid.say("");
    const [out, into] = [variable(from), variable(to)];
    if (!fits(out, into)) { graphSaid.say(`${from} [${out.unit || out.type}] and ${to} [${into.unit || into.type}] do not measure the same`); return; }
    connections = connections.filter((one) => one.to !== to).concat({ from, to });
    draw();
  }

  function draw() {
    keep();
    graph.draw(nodes, connections);
    drawings.length = 0;
    const outs = Object.entries(nodes).flatMap(([name, node]) => outputsOf(node).map((one) => `${name}.${one.name}`));
    const ins = Object.entries(nodes).flatMap(([name, node]) => inputsOf(node).map((one) => `${name}.${one.name}`));
    let from = outs[0] ?? "", to = "";
    const targets = make("select", {}), into = () => {
      const able = ins.filter((key) => from && fits(variable(from), variable(key)));
      to = able[0] ?? "";
      targets.replaceChildren(...able.map((key) => make("option", { value: key }, key)));
    };
    targets.addEventListener("change", () => { to = targets.value; });
    into();
    fill(editor,
      Object.keys(nodes).length ? null : make("p", { class: "note" }, "Choose an FMU above and add it."),
      outs.length && ins.length ? make("div", { class: "row" },
        field("From", choice(outs.map((key) => [key, key]), from, (key) => { from = key; into(); })), field("to an input of the same quantity", targets),
        make("button", { type: "button", onclick: () => to && connect(from, to) }, "Connect")) : null,
      make("ul", { class: "files" }, connections.map((one) => make("li", {}, `${one.from} → ${one.to} `,
        remove(`connection of ${one.from} to ${one.to}`, () => { connections = connections.filter((other) => other !== one); })))),
      make("ul", { class: "files" }, Object.keys(nodes).map((name) => make("li", {}, `${name} `, remove(name, () => {
        delete nodes[name];
        connections = connections.filter((one) => !`${one.from} ${one.to}`.split(" ").some((key) => key.startsWith(`${name}.`)));
        sources = sources.filter((one) => !one.to.startsWith(`${name}.`));
      })))),
      ins.length ? make("h3", {}, "Inputs") : null, sources.map(sourceRow),
      ins.length ? make("button", { type: "button", onclick: () => { sources.push({ to: ins.find((key) => !sources.some((one) => one.to === key)) ?? ins[0], kind: "constant", value: 0 }); draw(); } }, "Feed an input") : null,
      Object.entries(nodes).map(([name, node]) => parameters(name, node)),
      outs.length ? make("details", {}, make("summary", {}, `Recorded outputs (${outs.filter((key) => !unwanted.has(key)).length} of ${outs.length})`),
        make("div", { class: "row" }, outs.map((key) => check(key, !unwanted.has(key), (event) => (event.target.checked ? unwanted.delete(key) : unwanted.add(key)))))) : null,
      outs.length ? make("div", { class: "row" }, number("Stop [s]", run, "stop"), number("Step [s]", run, "step"),
        field("Master", choice([["gauss_seidel", "one after the other"], ["jacobi", "side by side"], ["iterated", "iterated"], ["adaptive", "adaptive steps"]], run.algorithm, (value) => { run.algorithm = value; }))) : null);
    return ins;
  }

  function remove(what, act) {
    return make("button", { type: "button", "aria-label": `Remove ${what}`, onclick: () => { act(); draw(); } }, "Remove");
  }

  function number(text, table, key) {
    return field(text, numberInput({ value: table[key] ?? "", required: true }, (value) => {
      table[key] = value;
      drawings.forEach((show) => show());  // over another time
    }));
  }

  function parameters(name, node) {
    const open = node.variables.filter((one) => one.causality === "parameter" && ["Real", "Integer"].includes(one.type)).slice(0, 200);
    if (!open.length) return null;
    return make("details", {}, make("summary", {}, `Parameters of ${name} (${open.length})`), make("div", { class: "row" }, open.map((one) => {
      const input = numberInput({ placeholder: String(one.start ?? ""), value: node.parameters[one.name] ?? "" }, (value) => {
        if (value === null) delete node.parameters[one.name];
        else node.parameters[one.name] = value;
      });
      return field(`${one.name}${one.unit && one.unit !== "1" ? ` [${one.unit}]` : ""}`, input);
    })));
  }

  function sourceRow(source) {
    const ins = Object.entries(nodes).flatMap(([name, node]) => inputsOf(node).map((one) => `${name}.${one.name}`));
    const kind = choice(Object.entries(WORDS), source.kind, (value) => {
      source.kind = value;
      for (const [key, , usual] of KINDS[value]) source[key] ??= usual;
      draw();
    });
    return make("div", { class: "card" }, make("div", { class: "row" },
      field("Input", choice(ins.map((key) => [key, key]), source.to, (value) => { source.to = value; })), field("is", kind),
      KINDS[source.kind].map(([key, text]) => number(text, source, key)),
      source.kind === "table" ? [fileChoice("Table", "log", () => source.file ?? "", (file) => { source.file = file; keep(); }),
        field("Column", make("input", { value: source.column ?? "", placeholder: "name, or #2", onchange: (event) => { source.column = event.target.value.trim(); } }))] : null,
      remove(`source of ${source.to}`, () => { sources = sources.filter((one) => one !== source); })),
      source.kind === "drawn" ? drawing(source) : null);
  }

  // A curve by clicks into the field, or as lines of time and value.
  function drawing(source) {
    source.points ??= [[0, 0], [run.stop / 2, 1], [run.stop, 0]];
    const text = make("textarea", { rows: 4, cols: 22, onchange: () => {
      const lines = text.value.split("\n").filter((line) => line.trim() !== ""), points = lines.map(pairOf);
      const wrong = !lines.length || points.includes(null);
      text.setAttribute("aria-invalid", String(wrong));
      if (wrong) return;
      source.points = points.sort((a, b) => a[0] - b[0]);
      show();
    } });
    const box = shape("svg", { class: "draw", viewBox: "0 0 400 160", role: "img" });
    const size = () => Math.max(1e-9, ...source.points.map(([, value]) => Math.abs(value))) * 1.25;
    let scale = size();
    const show = () => {
      text.value = source.points.map(([t, v]) => `${t}, ${v}`).join("\n");
      scale = Math.max(scale, size());
      const line = shape("polyline", { points: source.points.map(([t, v]) => `${(400 * t) / run.stop},${80 - (75 * v) / scale}`).join(" ") });
      box.setAttribute("aria-label", `Drawn curve of ${source.points.length} points from ${-scale} to ${scale}; the lines beside it are the same`);
      const mark = (x, y, anchor, words) => Object.assign(shape("text", { x, y, "text-anchor": anchor }), { textContent: words });
      box.replaceChildren(shape("line", { x1: 0, y1: 80, x2: 400, y2: 80 }), mark(4, 14, "start", digits(scale, 3)), mark(4, 155, "start", digits(-scale, 3)), mark(396, 76, "end", `${run.stop} s`), line);
    };
    drawings.push(show);
    box.addEventListener("click", (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(box.getScreenCTM().inverse());
      const time = Number(((run.stop * x) / 400).toPrecision(4)), value = Number((((80 - y) * scale) / 75).toPrecision(3));
      source.points = source.points.filter(([t]) => Math.abs(t - time) > run.stop / 200).concat([[time, value]]).sort((a, b) => a[0] - b[0]);
      show();
    });
    show();
    return make("div", { class: "row" }, box, field("Time [s], value", text));
  }

  async function write() {
    if (!Object.keys(nodes).length) throw new Error("add an FMU first");
    const fed = [];
    for (const { points, ...source } of sources) {
      const keys = KINDS[source.kind].map(([key]) => key);
      const made = { to: source.to, kind: source.kind, ...Object.fromEntries(keys.map((key) => [key, source[key]])) };
      if (source.kind === "table") Object.assign(made, { file: source.file, ...(source.column ? { column: source.column } : {}) });
      if (source.kind === "drawn") {
        const table = new File([`time,value\n${points.map((pair) => pair.join(",")).join("\n")}\n`], "drawn.csv");
        const { file } = await upload(table);
        choose({ drawn: { [file]: true } });  // no log
        Object.assign(made, { kind: "table", file, column: "value" });
      }
      fed.push(made);
    }
    const record = Object.entries(nodes).flatMap(([name, node]) => outputsOf(node).map((one) => `${name}.${one.name}`)).filter((key) => !unwanted.has(key));
    const instances = Object.fromEntries(Object.entries(nodes).map(([name, node]) => [name, { fmu: node.fmu, parameters: node.parameters }]));
    const made = await post("scenarios", { name: "scenario.toml", stop: run.stop, master: { algorithm: run.algorithm, ...(run.algorithm === "adaptive" ? {} : { step: run.step }) }, instances, connections, sources: fed, record });
    await refresh();
    return made;
  }

  const limit = remembered("fmus.time_limit", numberInput({ placeholder: "the usual one" }));
  const limited = () => ({ time_limit: numberIn(limit) });
  const written = make("p", { class: "note", role: "status" });
  panel.append(
    dropZone("Drop FMUs, SSP files or tables here", (name) => isFmu(name) || isLog(name), (file) => (isFmu(file) ? pick(file) : undefined), true),
    make("div", { class: "row" }, fileChoice("FMU or SSP file", "fmu", () => fmu, pick), field("Time limit [s]", limit)),
    said.element,
    make("div", { class: "row" },
      action("Check this FMU", said, async () => { if (!fmu) throw new Error("choose an FMU first"); checked.show(await start("check", [fmu], limited())); }),
      action("Run this SSP file", said, async () => { if (!/\.ssp$/i.test(fmu)) throw new Error("choose an SSP file first"); checked.show(await start("ssp", [fmu], limited())); }),
      action("Add it to the scenario", said, add, "main")),
    tree, checked.element, make("h2", {}, "Scenario"), make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Graph of the scenario" }, graph.svg), graphSaid.element, editor,
    make("div", { class: "row" },
      action("Write it as TOML", said, async () => {
        const made = await write();
        fill(written, "Written: ", make("a", { href: fileAddress(made.file), download: made.name }, made.name));
      }),
      action("Run the scenario", said, async () => {
        const made = await write();
        fill(written, "Written: ", make("a", { href: fileAddress(made.file), download: made.name }, made.name));
        view.show(await start("simulate", [], { scenario: made.file, ...limited() }));
      }, "main")),
    written, view.element);
  panel.addEventListener("change", keep);
  watch(follow);
  follow();
  draw();

  function keep() {
    const plain = Object.fromEntries(Object.entries(nodes).map(([name, { variables, ...node }]) => [name, node]));
    const now = { nodes: plain, connections, sources, unwanted: [...unwanted], run }, text = JSON.stringify(now);
    if (restoring || text === last || (!last && !Object.keys(plain).length)) return;
    last = text;
    choose({ scenario: structuredClone(now) });
  }

  // The scenario and the FMU that the session keeps: of an earlier day, or of another tab of the browser.
  function follow() {
    const kept = choices.scenario, text = kept ? JSON.stringify(kept) : "";
    if (fmu !== (choices.fields.fmu ?? "")) pick(choices.fields.fmu ?? "");
    if (text !== last) {
      last = text;
      if (kept) restore(structuredClone(kept), text).catch((error) => said.say(`The scenario cannot be shown: ${error.message}`));
    }
  }

  async function restore(kept, text) {
    const found = {};
    restoring = true;  // what stands here is not yet what the session keeps
    for (const [name, node] of Object.entries(kept.nodes)) found[name] = { ...node, variables: (await variablesOf(node.fmu)).variables };
    if (text !== last) return;  // a later one is on its way
    for (const name of Object.keys(nodes)) delete nodes[name];
    Object.assign(nodes, found);
    Object.assign(run, kept.run);
    ({ connections, sources } = kept);
    unwanted.clear();
    kept.unwanted.forEach((key) => unwanted.add(key));
    restoring = false;
    draw();
  }
}
