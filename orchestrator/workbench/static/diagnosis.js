/* global Units */
import { get, post } from "./api.js";
import { check, digits, fill, make, plain } from "./dom.js";
import { inputs, needLog, reading, trustTag } from "./gap.js";
import { action, fileChoice, isLog, isModel, jobView, message, resultOf } from "./parts.js";
import { choices, choose, start } from "./state.js";

const GRADES = { certain: "good", likely: "good", possible: "warn" };

export function build(panel, go) {
  const said = message(), read = reading();
  let test = "", settings = "";
  const options = () => ({ model: choices.model, test, settings, ...read.options() });
  const view = jobView("diagnosis", (job) => {
    const place = make("div", {});
    show(job, place).catch((error) => said.say(error.message));
    return place;
  });

  async function show(job, place) {
    const found = await resultOf(job);
    if (!found) return;
    fill(place,
      make("p", { class: "answer" }, `Verdict: ${found.verdict} `, trustTag(found.trust)),
      (found.trust?.reasons ?? []).map((reason) => make("p", { class: "note" }, plain(reason))),
      found.effects?.length ? effects(found) : make("p", {}, "No effect is named."),
      job.files.includes("corrected.toml") ? await refit(job) : null,
      (found.notes ?? []).length ? make("div", {}, make("h3", {}, "To know"), found.notes.map((text) => make("p", {}, plain(text)))) : null);
  }

  function effects(found) {
    const size = ([key, one]) => {
      const { factor, name } = Units.shown(one.unit, found.angle_unit);
      return `${key.replaceAll("_", " ")} ${digits(factor * one.value)} ${name && name !== "1" ? name : ""}` + (one.interval ? ` (${digits(factor * one.interval[0])} to ${digits(factor * one.interval[1])})` : "");
    };
    return make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Effects" }, make("table", { class: "stack" },
      make("thead", {}, make("tr", {}, ["effect", "at", "grade", "size, 95 %", "not told apart from"].map((text) => make("th", { scope: "col" }, text)))),
      make("tbody", {}, found.effects.map((one) => make("tr", {},
        make("td", {}, one.name.replaceAll("_", " ")), make("td", { "data-label": "at" }, one.site ?? ""), make("td", { "data-label": "grade" }, make("span", { class: `tag ${GRADES[one.grade] ?? ""}` }, one.grade)),
        make("td", { "data-label": "size, 95 %" }, Object.entries(one.parameters).map(size).join("; ")), make("td", { "data-label": "not told apart from" }, (one.family ?? []).map((name) => name.replaceAll("_", " ")).join(", ") || "none"))))));
  }

  // The corrected model with some of its effects ticked off, re-fitted by `diagnose --no-search`.
  async function refit(job) {
    const base = `results/${job.name}/corrected.toml`;
    const model = await get(`model?file=${encodeURIComponent(base)}`);
    const off = new Set();
    if (!model.effects.length) return null;
    return make("fieldset", { class: "card" }, make("legend", {}, "Effects in the model"),
      make("div", { class: "row" }, model.effects.map((effect) => check(effect.label.replaceAll("_", " "), true, (event) => {
        if (event.target.checked) off.delete(effect.label);
        else off.add(effect.label);
      }))),
      action("Fit the model again with what is ticked", said, async () => {
        needLog();
        const made = await post("models", { base, name: "refit.toml", without: [...off] });
        view.show(await start("diagnose", [choices.log], { ...options(), model: made.file, no_search: true }));
      }));
  }

  panel.append(inputs(),
    make("div", { class: "row" },
      fileChoice("Test data", isLog, () => test, (file) => { test = file; choose({}); }, "the last part of the log"),
      fileChoice("Settings", isModel, () => settings, (file) => { settings = file; choose({}); }, "the usual ones")),
    read.element, said.element,
    make("div", { class: "row" },
      action("Diagnose", said, async () => { needLog(); view.show(await start("diagnose", [choices.log], options())); }, "main"),
      action("Go on to the model", said, () => go("model"))),
    view.element);
}
