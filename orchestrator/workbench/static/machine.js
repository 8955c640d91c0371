import { fileAddress, get, post } from "./api.js";
import { digits, field, fill, make, numberInput } from "./dom.js";
import { action, dropZone, fileChoice, isModel, message } from "./parts.js";
import { choices, choose, draft, watch } from "./state.js";

const ENCODERS = { theta_m: "motor encoder", theta_l: "load encoder" };
const TAGS = { assumed: "warn", "from the record": "", yours: "good", "the FMU's own": "" };

// The model file as fields: every value with unit, uncertainty and where it is from.
export function build(panel, go) {
  const said = message(), body = make("div", {});
  let shown = null;

  async function load() {
    if (shown === choices.model) return;
    const asked = shown = choices.model;
    draft.names = [];
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
    const changed = {}, encoders = structuredClone(model.encoders);
    const main = model.parameters.filter((one) => one.linear);
    const rest = model.parameters.filter((one) => !one.linear);
    const named = new Set(model.effects.flatMap((effect) => effect.parameters));
    const state = make("p", { class: "note", role: "status" });
    const tell = () => {
      const names = draft.names = [...Object.keys(changed), ...Object.keys(ENCODERS).filter((name) => JSON.stringify(encoders[name]) !== JSON.stringify(model.encoders[name])).map((name) => ENCODERS[name])];
      choose({});
      state.textContent = names.length ? `Changed and not saved: ${names.join(", ")}` : "";
    };

    function row(one) {
      const tag = make("span", { class: `tag ${TAGS[one.source]}` }, one.source);
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
      const value = numberInput({ value: String(one.value), required: true, "aria-label": `${one.name}, value in ${one.unit || "1"}` }, (number) => set("value", number));
      const share = one.value === 0 ? 0 : (100 * one.uncertainty) / Math.abs(one.value);
      const off = numberInput({ value: digits(share), required: true, "aria-label": `${one.name}, off by at most, in percent` }, (number) => set("uncertainty", number), (number) => number >= 0);
      off.disabled = one.value === 0;  // no share of nothing
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
          choose({ model: made.file, saidIn: { ...choices.saidIn, [made.file]: choices.saidIn?.[choices.model] } });
        }, "main"),
        action("Go on to the gap", said, () => go("gap"))));
    tell();
  }

  panel.append(
    dropZone("Drop a model file here", isModel, (file) => choose({ model: file })),
    make("div", { class: "row" }, fileChoice("Model file of this session", isModel, () => choices.model, (model) => choose({ model }), "the default machine")),
    said.element, body);
  watch(load);
  load();
}
