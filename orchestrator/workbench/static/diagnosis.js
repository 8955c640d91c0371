/* global Units */
import { check, digits, fill } from "./dom.js";
import { inputs, needLog, reading } from "./gap.js";
import { action, fileChoice, jobView, message, resultOf } from "./parts.js";
import { choices, choose, jobOf, modelOfLog, start } from "./state.js";

const SIGNALS = { theta_m: "motor angle", theta_l: "load angle" };

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
    fill(place, earlier ? misfits(found, earlier) : null, refit(job, found), back);
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

// What the ticks have changed: the misfit on test data before and now; the page below says all else.
function misfits(found, earlier) {
  const said = found.test.flatMap((test, n) => Object.entries(test.misfit).map(([signal, one]) => {
    const { factor, name } = Units.shown(one.unit, found.angle_unit), before = earlier.test[n]?.misfit[signal]?.final ?? null;
    const [was, is] = [before, one.final].map((value) => (value === null ? "none" : digits(factor * value)));
    return `${SIGNALS[signal] ?? signal} ${was} → ${is} ${name}`;
  }));
  return make("p", { class: "answer" }, `Misfit on test data (rms): ${said.join("; ")}`);
}
