import { fileAddress, get, post } from "./api.js";
import { digits, field, fill, numberInput, table } from "./dom.js";
import { action, dropZone, fileChoice, isModel, message } from "./parts.js";
import { choices, choose, session, watch } from "./state.js";

const ENCODERS = { theta_m: "motor encoder", theta_l: "load encoder" };
const TAGS = { assumed: "warn", "from the record": "", yours: "good", "the FMU's own": "" };
const HEADS = ["parameter", "value", "off by at most", "where it is from"];
const ELSEWHERE = { map: "a map for any FMU: it is chosen in the tab FMUs", settings: "settings of a diagnosis: it is chosen in the tab Diagnosis", scenario: "a scenario, and no model" };

// What was changed of the chosen model file and is not saved, in words.
export function unsaved() {
  const { parameters = {}, encoders = {} } = choices.edits[choices.model] ?? {};
  return [...Object.keys(parameters), ...Object.keys(encoders).map((name) => ENCODERS[name])];
}

export const build = (panel, go) => new MachineTab(panel, go);

// The model file as fields: every value with unit, uncertainty and where it is from.
class MachineTab {
  constructor(panel, go) {
    Object.assign(this, { go, shown: null, said: message(), body: make("div", {}), state: make("p", { class: "note", role: "status" }) });
    panel.append(
      dropZone("Drop a model or settings file here", isModel, (file) => this.take(file)),
      make("div", { class: "row" }, fileChoice("Model file of this session", "model", () => choices.model, (model) => choose({ model }), "the default machine")),
      this.said.element, this.body);
    watch(() => this.load());
    this.load();
  }

  take(file) {
    const { kind, name } = session.files.find((one) => one.file === file);
    if (kind === "model") choose({ model: file });
    if (kind === "settings") choose({ fields: { settings: file } });
    if (kind in ELSEWHERE) this.said.say(`${name} holds ${ELSEWHERE[kind]}`);
  }

  async load() {
    if (this.shown === choices.model) return;
    const asked = this.shown = choices.model;
    this.said.say("");
    fill(this.body, make("p", { class: "note", role: "status" }, "Reading …"));  // no field of the model before is typed into
    try {
      const model = await get(`model?file=${encodeURIComponent(asked)}`);
      if (asked === choices.model) this.draw(model);
    } catch (error) {
      fill(this.body);
      this.said.say(error.message);
    }
  }

  draw(model) {
    const edits = structuredClone(choices.edits[this.shown] ?? {});
    this.model = model;
    this.changed = edits.parameters ?? {};
    this.encoders = structuredClone({ ...model.encoders, ...edits.encoders });
    const named = new Set(model.effects.flatMap((effect) => effect.parameters)), isMain = (one) => one.linear || named.has(one.name);
    const rest = model.parameters.filter((one) => !isMain(one)), main = model.parameters.filter(isMain);
    const rows = (some) => some.map((one) => this.row(one)), columns = Object.entries(model.columns);
    const entries = ([name, entry]) => make("div", {}, make("dt", {}, name), make("dd", {}, Object.entries(entry).map(([key, text]) => `${key} = ${text}`).join(", ")));
    const file = make("a", { href: fileAddress(choices.model), download: choices.model.split("/").at(-1) }, choices.model);
    fill(this.body,
      make("p", { class: "note" }, ...(choices.model ? ["Model file: ", file] : ["No model file is chosen: these are the values of the default machine, each known to 5 %. “Look at this log” in the tab Log drafts the file of your machine."])),
      table("Parameters", HEADS, rows(main)),
      make("details", {}, make("summary", {}, `What the machine may have besides (${rest.length} values)`), table("Further parameters", HEADS, rows(rest))),
      make("details", {}, make("summary", {}, "Encoders"), make("div", { class: "cards" }, Object.keys(ENCODERS).map((name) => this.encoderCard(name)))),
      make("details", {}, make("summary", {}, "Columns that it reads a log by"),
        columns.length ? make("dl", { class: "facts" }, columns.map(entries)) : make("p", { class: "note" }, "none are stated; they are recognised")),
      this.state,
      make("div", { class: "row" }, action("Save as a new model file", this.said, () => this.save(), "main"), action("Go on to the gap", this.said, () => this.go("gap"))));
    this.tell();
  }

  // Keep what differs from the file, and say so.
  tell() {
    const other = Object.keys(this.encoders).filter((name) => JSON.stringify(this.encoders[name]) !== JSON.stringify(this.model.encoders[name] ?? {}));
    const parts = { parameters: this.changed, encoders: Object.fromEntries(other.map((name) => [name, this.encoders[name]])) };
    const now = other.length || Object.keys(this.changed).length ? parts : null;
    if (JSON.stringify(now) !== JSON.stringify(choices.edits[this.shown] ?? null)) choose({ edits: { [this.shown]: structuredClone(now) } });
    this.state.textContent = now ? `Changed and not saved: ${unsaved().join(", ")}` : "";
  }

  row(one) {
    const edited = this.changed[one.name], current = { ...one, ...edited };
    const tag = make("span", { class: `tag ${edited ? "good" : TAGS[one.source]}` }, edited ? "yours" : one.source);
    const set = (key, number) => {
      const entry = this.changed[one.name] ??= { value: one.value, uncertainty: one.uncertainty };
      if (key === "uncertainty") entry.uncertainty = (number / 100) * Math.abs(entry.value);
      else {
        if (one.value !== 0) entry.uncertainty = (one.uncertainty / Math.abs(one.value)) * Math.abs(number);
        entry.value = number;
        off.disabled = number === 0;
      }
      tag.className = "tag good";
      tag.textContent = "yours";
      this.tell();
    };
    const value = numberInput({ value: String(current.value), required: true, "aria-label": `${one.name}, value in ${one.unit || "1"}` }, (number) => set("value", number));
    const share = current.value === 0 ? 0 : (100 * current.uncertainty) / Math.abs(current.value);
    const off = numberInput({ value: digits(share), required: true, "aria-label": `${one.name}, off by at most, in percent` }, (number) => set("uncertainty", number), (number) => number >= 0);
    off.disabled = current.value === 0;  // no share of nothing
    return [make("td", {}, make("strong", {}, one.name), make("br"), make("span", { class: "note" }, one.meaning)),
      make("td", { class: "pair" }, value, " ", one.unit === "1" ? "" : one.unit), make("td", { class: "pair", "data-label": "off by at most" }, off, " %"),
      make("td", {}, tag, make("br"), make("span", { class: "note" }, one.said.replace(/^[^:]*: (?:[^;]*; )?(?=.)/, "")))];
  }

  encoderCard(name) {
    const { encoders } = this, { resolution } = encoders[name] ?? {};
    const input = (key) => numberInput({ value: encoders[name]?.[key] ?? "", placeholder: "from the record" }, (number) => {
      encoders[name] ??= {};
      if (number === null) delete encoders[name][key];
      else encoders[name][key] = number;
      if (key === "counts_per_rev") delete encoders[name].resolution;
      this.tell();
    });
    return make("div", { class: "card" }, make("h3", {}, name === "theta_m" ? "Motor encoder" : "Load encoder"),
      field("counts per revolution", input("counts_per_rev")), field("noise [rad], before rounding", input("noise")),
      resolution ? make("p", { class: "note" }, `resolution ${digits(resolution)} rad`) : null);
  }

  async save() {
    const { model } = choices, stem = (model || "machine.toml").split("/").at(-1).replace(/(-yours)?(-\d+)?\.toml$/, "");
    const made = await post("models", { base: model || null, name: `${stem}-yours.toml`, parameters: this.changed, encoders: this.encoders });
    this.shown = null;
    choose({ model: made.file, edits: { [model]: null }, saidIn: { [made.file]: choices.saidIn[model] ?? null } });
  }
}
