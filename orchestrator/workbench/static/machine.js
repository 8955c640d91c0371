import { fileAddress, get, post } from "./api.js";
import { digits, field, fill, make, numberInput } from "./dom.js";
import { action, dropZone, fileChoice, isModel, message } from "./parts.js";
import { choices, choose, session, watch } from "./state.js";

const ENCODERS = { theta_m: "motor encoder", theta_l: "load encoder" };
const TAGS = { assumed: "warn", "from the record": "", yours: "good", "the FMU's own": "" };

// What was changed of the chosen model file and is not saved, in words.
export function unsaved() {
  const { parameters = {}, encoders = {} } = choices.edits[choices.model] ?? {};
  return [...Object.keys(parameters), ...Object.keys(encoders).map((name) => ENCODERS[name])];
}

// The model file as fields: every value with unit, uncertainty and where it is from.
export function build(panel, go) {
  const said = message(), body = make("div", {});
  let shown = null;

  async function load() {
    if (shown === choices.model) return;
    const asked = shown = choices.model;
    said.say("");
    fill(body, make("p", { class: "note", role: "status" }, "Reading …"));  // no field of the model before is typed into
    try {
      const model = await get(`model?file=${encodeURIComponent(asked)}`);
      if (asked === choices.model) draw(model);
    } catch (error) {
      fill(body);
      said.say(error.message);
    }
  }

  function draw(model) {
    const edits = structuredClone(choices.edits[shown] ?? {}), changed = edits.parameters ?? {};
    const encoders = structuredClone({ ...model.encoders, ...edits.encoders });
    const main = model.parameters.filter((one) => one.linear);
    const rest = model.parameters.filter((one) => !one.linear);
    const named = new Set(model.effects.flatMap((effect) => effect.parameters));
    const state = make("p", { class: "note", role: "status" });
    const tell = () => {
      const other = Object.keys(encoders).filter((name) => JSON.stringify(encoders[name]) !== JSON.stringify(model.encoders[name] ?? {}));
      const parts = { parameters: changed, encoders: Object.fromEntries(other.map((name) => [name, encoders[name]])) };
      const now = other.length || Object.keys(changed).length ? parts : null;
      if (JSON.stringify(now) !== JSON.stringify(choices.edits[shown] ?? null)) choose({ edits: { [shown]: now } });
      state.textContent = now ? `Changed and not saved: ${unsaved().join(", ")}` : "";
    };

    function row(one) {
      const edited = changed[one.name], current = { ...one, ...edited };
      const tag = make("span", { class: `tag ${edited ? "good" : TAGS[one.source]}` }, edited ? "yours" : one.source);
      const set = (key, number) => {
        changed[one.name] ??= { value: one.value, uncertainty: one.uncertainty };
        if (key === "value") {
          if (one.value !== 0) changed[one.name].uncertainty = (one.uncertainty / Math.abs(one.value)) * Math.abs(number);
          changed[one.name].value = number;
          off.disabled = number === 0;
        } else changed[one.name].uncertainty = (number / 100) * Math.abs(changed[one.name].value);
        tag.className = "tag good";
        tag.textContent = "yours";
        tell();
      };
      const value = numberInput({ value: String(current.value), required: true, "aria-label": `${one.name}, value in ${one.unit || "1"}` }, (number) => set("value", number));
      const share = current.value === 0 ? 0 : (100 * current.uncertainty) / Math.abs(current.value);
      const off = numberInput({ value: digits(share), required: true, "aria-label": `${one.name}, off by at most, in percent` }, (number) => set("uncertainty", number), (number) => number >= 0);
      off.disabled = current.value === 0;  // no share of nothing
      return make("tr", {}, make("td", {}, make("strong", {}, one.name), make("br"), make("span", { class: "note" }, one.meaning)),
        make("td", { class: "pair" }, value, " ", one.unit === "1" ? "" : one.unit), make("td", { class: "pair", "data-label": "off by at most" }, off, " %"),
        make("td", {}, tag, make("br"), make("span", { class: "note" }, one.said.replace(/^[^:]*: (?:[^;]*; )?(?=.)/, ""))));
    }

    const table = (rows, name) => make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": name }, make("table", { class: "stack" },
      make("thead", {}, make("tr", {}, ["parameter", "value", "off by at most", "where it is from"].map((text) => make("th", { scope: "col" }, text)))),
      make("tbody", {}, rows.map(row))));
    const encoderFields = ["theta_m", "theta_l"].map((name) => make("div", { class: "card" }, make("h3", {}, name === "theta_m" ? "Motor encoder" : "Load encoder"),
      ["counts_per_rev", "noise"].map((key) => {
        const input = numberInput({ value: encoders[name]?.[key] ?? "", placeholder: "from the record" }, (number) => {
          encoders[name] ??= {};
          if (number === null) delete encoders[name][key];
          else encoders[name][key] = number;
          if (key === "counts_per_rev") delete encoders[name].resolution;
          tell();
        });
        return field(key === "noise" ? "noise [rad], before rounding" : "counts per revolution", input);
      }),
      encoders[name]?.resolution ? make("p", { class: "note" }, `resolution ${digits(encoders[name].resolution)} rad`) : null));

    fill(body,
      make("p", { class: "note" }, choices.model
        ? ["Model file: ", make("a", { href: fileAddress(choices.model), download: choices.model.split("/").at(-1) }, choices.model)].map((part) => part)
        : "No model file is chosen: these are the values of the default machine, each known to 5 %."),
      table([...main, ...rest.filter((one) => named.has(one.name))], "Parameters"),
      make("details", {}, make("summary", {}, `What the machine may have besides (${rest.filter((one) => !named.has(one.name)).length} values)`), table(rest.filter((one) => !named.has(one.name)), "Further parameters")),
      make("details", {}, make("summary", {}, "Encoders"), make("div", { class: "cards" }, encoderFields)),
      make("details", {}, make("summary", {}, "Columns that it reads a log by"), Object.keys(model.columns).length
        ? make("dl", { class: "facts" }, Object.entries(model.columns).map(([name, entry]) => make("div", {}, make("dt", {}, name), make("dd", {}, Object.entries(entry).map(([key, text]) => `${key} = ${text}`).join(", ")))))
        : make("p", { class: "note" }, "none are stated; they are recognised")),
      state,
      make("div", { class: "row" },
        action("Save as a new model file", said, async () => {
          const stem = (choices.model || "machine.toml").split("/").at(-1).replace(/(-yours)?(-\d+)?\.toml$/, "");
          const made = await post("models", { base: choices.model || null, name: `${stem}-yours.toml`, parameters: changed, encoders });
          shown = null;
          choose({ model: made.file, edits: { [choices.model]: null }, saidIn: { [made.file]: choices.saidIn[choices.model] ?? null } });
        }, "main"),
        action("Go on to the gap", said, () => go("gap"))));
    tell();
  }

  function take(file) {
    const { kind, name } = session.files.find((one) => one.file === file);
    if (kind === "model") choose({ model: file });
    else if (kind === "settings") choose({ fields: { settings: file } });
    if (kind !== "model") said.say(`${name} holds ${kind === "settings" ? "settings of a diagnosis: it is chosen in the tab Diagnosis" : "a scenario, and no model"}`);
  }

  panel.append(
    dropZone("Drop a model or settings file here", isModel, take),
    make("div", { class: "row" }, fileChoice("Model file of this session", "model", () => choices.model, (model) => choose({ model }), "the default machine")),
    said.element, body);
  watch(load);
  load();
}
