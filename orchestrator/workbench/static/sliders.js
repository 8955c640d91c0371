/* global Plot, Units */
import { get, post } from "./api.js";
import { choice, digits, field, fill } from "./dom.js";
import { resultOf } from "./parts.js";
import { jobOf } from "./state.js";

const TITLES = { theta_m: "Motor angle", theta_l: "Load angle", theta_x: "Angle" };
const STEPS = 400;

// The model of a result under sliders: every move runs its native FMU, beside what was measured.
export async function sliders(job) {
  const model = await get(`sliders?job=${encodeURIComponent(job)}`);
  const result = await resultOf(jobOf(job));
  Units.choose(result?.record?.angle_unit ?? result?.angle_unit ?? "rad");
  const values = {}, said = make("p", { class: "note", role: "status" });
  const plots = Object.entries(model.measured).map(([name, y]) => {
    const title = TITLES[name] ?? name, titles = [title, `${title}: simulated minus measured`];
    const views = titles.map((text) => ({ title: text, figure: make("figure", { class: "plot", "aria-label": text }) }));
    return { name, title, views, said: make("p", { class: "note" }), measured: { name: "measured", x: model.time, y } };
  });
  let busy = false, again = false, begun = 0;

  // The curves, what is between them, and its rms beside that of the result's own values.
  function draw(found) {
    for (const one of plots) {
      const y = found[one.name], error = y.map((value, n) => (value === null || one.measured.y[n] === null ? null : value - one.measured.y[n]));
      const known = error.filter((value) => value !== null), rms = Math.sqrt(known.reduce((sum, value) => sum + value * value, 0) / known.length);
      const curves = [[one.measured, { name: "simulated", x: model.time, y }], [{ name: "simulated minus measured", x: model.time, y: error }]];
      const { factor, name } = Units.shown("rad");
      one.first ??= rms;
      one.said.textContent = `Rms of simulated minus measured: ${digits(factor * rms)} ${name}; with the result's values: ${digits(factor * one.first)} ${name}`;
      one.views.forEach((view, n) => {
        if (view.plot) view.plot.show(curves[n]);
        else view.plot = new Plot(view.figure, { title: view.title, xLabel: "time [s]", yLabel: "angle [rad]", series: curves[n], link: "sliders" });
      });
    }
  }

  // The latest values win: while a run is under way, later moves wait as one.
  async function run() {
    if (busy) { again = true; return; }
    busy = true;
    begun ||= performance.now();
    try {
      const found = await post("simulate", { job, values });
      draw(found.curves);
      said.textContent = `${model.kind} FMU, ${(1000 * found.seconds).toFixed(0)} ms a run`;
      performance.measure("slider to curve", { start: begun, end: performance.now() });
    } catch (error) { said.textContent = error.message; }
    busy = false;
    begun = 0;
    if (again) { again = false; begun = performance.now(); run(); }
  }

  const controls = model.sliders.map((slider) => control(slider, values, run));
  const units = choice(["rad", "deg", "arcmin", "turns"].map((unit) => [unit, unit]), Units.chosen, (unit) => { Units.choose(unit); run(); });
  const place = make("div", {});
  fill(place,
    make("div", { class: "row" }, field("Angles in", units),
      make("button", { type: "button", onclick: () => { controls.forEach(({ home }) => home()); run(); } }, "Back to the result"), said),
    make("div", { class: "cards sliders" }, controls.map(({ element }) => element)),
    plots.map(({ title, views, said: words }) => [make("h3", {}, title), words, ...views.map(({ figure }) => figure)]).flat());
  await run();
  return place;
}

// A slider and its number; `home` brings it back to the result's value.
function control(slider, values, run) {
  const shown = make("output", {}), isEffect = slider.name.startsWith("effects.");
  const input = make("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${slider.name}: ${slider.meaning}` });
  const show = (value) => {
    const { factor, name } = Units.shown(slider.unit);
    shown.textContent = `${digits(factor * value)} ${name === "1" ? "" : name}`;
    input.setAttribute("aria-valuetext", shown.textContent);
  };
  const home = () => {
    input.value = String(Math.round((STEPS * (slider.value - slider.low)) / (slider.high - slider.low)));
    delete values[slider.name];
    show(slider.value);
  };
  input.addEventListener("input", () => {
    values[slider.name] = slider.low + ((slider.high - slider.low) * Number(input.value)) / STEPS;
    show(values[slider.name]);
    run();
  });
  home();
  Units.listeners.push(() => show(values[slider.name] ?? slider.value));
  return { home, element: make("div", { class: "field" }, make("span", {}, isEffect ? slider.name.slice(8).replace(/[._]/g, " ") : slider.name), shown, input) };
}
