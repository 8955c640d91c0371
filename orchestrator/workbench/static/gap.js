import { post } from "./api.js";
import { check, digits, field, make, plain } from "./dom.js";
import { action, fileChoice, isLog, isModel, jobView, message, resultOf } from "./parts.js";
import { choices, choose, start } from "./state.js";

export const inputs = () => make("div", { class: "row" },
  fileChoice("Log", isLog, () => choices.log, (log) => choose({ log, columns: {}, header: null })),
  fileChoice("Model file", isModel, () => choices.model, (model) => choose({ model }), "the default machine"));

// Options that all commands have for reading a log; `reading()` gives what the user has filled in.
export function reading() {
  const part = make("input", { placeholder: "all, or 2:30", "aria-describedby": "" });
  const rate = make("input", { class: "number", inputmode: "decimal", placeholder: "all samples" });
  const stamps = make("select", {}, [["", "are uniform"], ["uniform", "jitter, the samples do not"], ["linear", "interpolate linearly"], ["cubic", "interpolate by cubics"]]
    .map(([value, text]) => make("option", { value }, text)));
  return {
    element: make("details", {}, make("summary", {}, "Reading of the log"), make("div", { class: "row" },
      field("Part [s]", part), field("Samples per second", rate), field("Times of the rows", stamps))),
    options: () => ({ part: part.value.trim(), rate: rate.value.trim() === "" ? null : Number(rate.value), resample: stamps.value }),
  };
}

export const needLog = () => { if (!choices.log) throw new Error("choose a log first, or drop one in the tab Log"); };

export function trustTag(trust) {
  return trust ? make("span", { class: `tag ${{ green: "good", amber: "warn", red: "bad" }[trust.level]}` }, `trust: ${trust.level}`) : null;
}

export function build(panel) {
  const said = message(), cost = make("p", { role: "status" });
  const read = reading(), motorOnly = check("leave the load encoder out", false, () => {});
  const options = () => ({ model: choices.model, motor_only: motorOnly.querySelector("input").checked, ...read.options() });
  const view = jobView((job) => {
    const place = make("div", {});
    resultOf(job).then((found) => {
      if (!found) return;
      const alpha = found.alpha ?? null;
      const lines = alpha === null
        ? [found.not_applicable ?? found.message ?? "no half-gap"]
        : [`Half-gap ${digits(alpha)} rad` + (found.interval ? `, 95 %: ${digits(found.interval[0])} to ${digits(found.interval[1])} rad` : "")];
      place.append(make("p", { class: "answer" }, lines.join(" "), " ", trustTag(found.trust)));
      for (const reason of found.trust?.reasons ?? []) place.append(make("p", { class: "note" }, plain(reason)));
    });
    return place;
  });

  async function price() {
    needLog();
    cost.textContent = "Working out what it takes …";
    try {
      const given = Object.fromEntries(Object.entries(options()).filter(([, value]) => value !== null && value !== "" && value !== false));
      cost.textContent = (await post("cost", { inputs: [choices.log], options: given })).cost;
    } catch (error) {
      cost.textContent = "";
      throw error;
    }
  }

  panel.append(inputs(), make("div", { class: "row" }, motorOnly), read.element, said.element,
    make("div", { class: "row" },
      action("What will it cost?", said, price),
      action("Estimate the gap", said, async () => { needLog(); view.show(await start("estimate", [choices.log], options())); }, "main")),
    cost, view.element);
}
