/* global Units */
import { plain } from "./advice.js";
import { check, digits, fill, make, table, withInterval } from "./dom.js";
import { inputs, needLog, reading, trustTag } from "./gap.js";
import { action, fileChoice, jobView, message, resultOf } from "./parts.js";
import { choices, choose, jobOf, modelOfLog, start } from "./state.js";

const SIZES = { alpha: "half-gap" }, SIGNALS = { theta_m: "motor angle", theta_l: "load angle" };
const GRADES = { certain: "good", likely: "good", possible: "warn" };

// The verdict in a sentence: the summary's first line without the verdict's word.
const headline = (found) => plain(found.summary?.[0]?.split(". ").slice(1).join(". ") || `Verdict: ${found.verdict}`);

export function build(panel, go) {
  const said = message(), read = reading("diagnosis");
  const fileOf = (text, kind, key, none) => fileChoice(text, kind, () => choices.fields[key] ?? "", (file) => choose({ fields: { [key]: file || null } }), none);
  const options = async () => ({ model: await modelOfLog(), test: choices.fields.test ?? "", settings: choices.fields.settings ?? "", ...read.options() });
  const view = jobView("diagnosis", (job) => {
    const place = make("div", {});
    show(job, place).catch((error) => said.say(error.message));
    return place;
  });

  async function show(job, place) {
    const found = await resultOf(job);
    const from = jobOf(choices.before[job.name]), earlier = from ? await resultOf(from) : null;
    const back = earlier ? action(`Back to ${from.name}`, said, () => view.show(from.name)) : null;
    if (!found) { fill(place, earlier ? refit(from, earlier) : null, back); return; }
    fill(place,
      make("p", { class: "answer" }, `${headline(found)} `, trustTag(found.trust)),
      (found.trust?.reasons ?? []).map((reason) => make("p", { class: "note" }, plain(reason))),
      found.effects?.length || found.nuisances?.length ? effects(found) : null,
      ...misfits(found, earlier),
      refit(job, found), back,
      (found.notes ?? []).length ? make("div", {}, make("h3", {}, "To know"), found.notes.map((text) => make("p", {}, plain(text)))) : null);
  }

  // The model fitted again by `diagnose --effects`, with exactly the effects that are ticked.
  function refit(job, found) {
    const labels = Object.keys(found.library ?? {}), on = new Set(labels.filter((label) => found.library[label].in_model));
    if (!labels.length || !job.asked.inputs) return null;
    const last = found.candidates?.at(-1);
    const gains = new Map(last && !last.taken ? last.tried.map((one) => [one.effect, one.gain]) : []);
    const box = (label) => {
      const gain = gains.get(label), takes = gain > 0 ? ` (${digits(100 * gain, 2)} % of what is left)` : "";
      return check(found.library[label].words + takes, on.has(label), (event) => {
        if (event.target.checked) on.add(label);
        else on.delete(label);
      });
    };
    const lacks = labels.filter((label) => !on.has(label));
    return make("fieldset", { class: "card" }, make("legend", {}, "Effects in the model"),
      make("div", { class: "ticks" }, on.size ? labels.filter((label) => on.has(label)).map(box) : make("span", { class: "note" }, "none")),
      make("details", {}, make("summary", {}, `Effects that it lacks (${lacks.length})`), make("div", { class: "ticks" }, lacks.map(box))),
      action("Fit the model again with what is ticked", said, async () => {
        const { no_search, time_limit, ...rest } = job.asked.options;
        const name = await start("diagnose", job.asked.inputs, { ...rest, effects: [...on] });
        choose({ before: { [name]: job.name } });
        view.show(name);
      }));
  }

  panel.append(inputs(),
    make("div", { class: "row" },
      fileOf("Test data", "log", "test", "the last part of the log"), fileOf("Settings", "settings", "settings", "the usual ones")),
    read.element, said.element,
    make("div", { class: "row" },
      action("Diagnose", said, async () => { needLog(); view.show(await start("diagnose", [choices.log], await options())); }, "main"),
      action("Go on to the model", said, () => go("model"))),
    view.element);
}

function effects(found) {
  const words = (label) => found.library?.[label]?.words ?? label.replaceAll("_", " ").replace("@", " at ");
  const size = ([key, one]) => {
    const { factor, name } = Units.shown(one.unit, found.angle_unit);
    const [value, between] = withInterval(one.value, one.interval, factor);
    return `${SIZES[key] ?? key.replaceAll("_", " ")} ${value} ${name && name !== "1" ? name : ""}${between ? ` (${between})` : ""}`;
  };
  const inLog = (found.nuisances ?? []).map((one) => ({ ...one, said: `${one.name.replaceAll("_", " ")} (in the log)` }));
  return table("Effects", ["effect", "grade", "size, 95 %", "not told apart from"], [...found.effects, ...inLog].map((one) => [
    one.said ?? words(`${one.name}@${one.site ?? ""}`), make("td", { "data-label": "grade" }, make("span", { class: `tag ${GRADES[one.grade] ?? ""}` }, one.grade)),
    Object.entries(one.parameters).map(size).join("; "), (one.family ?? []).map(words).join(", ") || "none"]));
}

// Rms of free runs on test data, beside that of the model before effects were ticked.
function misfits(found, earlier) {
  const rows = found.test.flatMap((test, n) => Object.entries(test.misfit).map(([signal, one]) => {
    const { factor, name } = Units.shown(one.unit, found.angle_unit);
    const before = earlier?.test[n]?.misfit[signal]?.final;
    const cells = [one.nominal, one.parameters, ...(earlier ? [before] : []), one.final, one.noise];
    return [SIGNALS[signal] ?? signal, ...cells.map((value) => (value === null || value === undefined ? "none" : `${digits(factor * value)} ${name}`))];
  }));
  const heads = ["signal", "as given", "re-fitted", ...(earlier ? ["before"] : []), "with effects", "noise"];
  return rows.length ? [make("h3", {}, "Misfit on test data (rms)"), table("Misfit on test data", heads, rows)] : [];
}
