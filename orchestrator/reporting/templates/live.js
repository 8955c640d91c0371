// A simulation in the page: sliders change the numbers of a plan, a WebAssembly module runs it, plots show the result.
class Live {
  static POINTS = 1400; // of a curve: as many as a wide plot has pixels; fewer are drawn quicker

  constructor(host) {
    this.data = JSON.parse(host.querySelector("script").textContent);
    this.said = host.querySelector(".said");
    this.plots = [...host.querySelectorAll("figure.simulated")].map((figure) => new Plot(figure));
    this.values = this.data.controls.map((control) => control.value);
    this.plan = numbers64(this.data.plan);
    this.recorded = this.data.recorded.map(numbers64);
    this.tables = this.data.runs.map((run) => numbers64(run.table));
    this.times = this.rows();
    this.form(host.querySelector("form"));
    host.live = this;
    this.begin().catch((error) => {
      this.said.textContent = `This browser cannot run the simulation: ${error.message}`;
    });
  }

  // Where each row stands in time; the runs follow one another.
  rows() {
    const { runs, step } = this.data;
    return Float64Array.from(runs.flatMap((run) => Array.from({ length: run.steps + 1 }, (_, n) => run.start + n * step)));
  }

  async begin() {
    const packed = new Blob([bytes(this.data.module)]).stream().pipeThrough(new DecompressionStream("gzip"));
    const module = await WebAssembly.instantiate(await new Response(packed).arrayBuffer());
    this.exports = module.instance.exports;
    this.exports._initialize?.();
    const longest = Math.max(...this.data.runs.map((run) => run.steps + 1));
    const room = (count) => this.exports.live_room(Math.max(count, 1));
    this.place = {
      plan: room(this.plan.length),
      table: room(Math.max(...this.tables.map((table) => table.length))),
      out: room(longest * this.data.records),
      given: room(36),
      gains: room(5),
    };
    this.run();
  }

  // Sliders ----------------------------------------------------------------------------------------------------------

  form(form) {
    this.sliders = this.data.controls.map((control, n) => this.slider(form, control, n));
    const reset = element("button", { type: "button" }, "Back to the results");
    reset.addEventListener("click", () => this.move(this.data.controls.map((control) => control.value)));
    form.append(reset);
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  slider(form, control, n) {
    const input = element("input", { type: "range", min: 0, max: 1000, step: 1 });
    const shown = element("output");
    input.addEventListener("input", () => {
      const values = [...this.values];
      values[n] = valueAt(control, Number(input.value) / 1000);
      this.move(values, input);
    });
    form.append(element("label", {}, element("span", {}, control.label), input, shown));
    const made = { input, shown, control };
    this.label(made, control.value);
    return made;
  }

  label({ input, shown, control }, value) {
    const text = `${number(value, 4)} ${control.unit}`.trim();
    shown.textContent = text;
    input.setAttribute("aria-valuetext", text);
    if (document.activeElement !== input) input.value = Math.round(1000 * partOf(control, value));
  }

  // Take other values, and simulate before the next picture.
  move(values, held = null) {
    this.values = values;
    this.moved ??= performance.now();
    this.sliders.forEach((slider, n) => {
      this.label(slider, values[n]);
      if (slider.input !== held) slider.input.value = Math.round(1000 * partOf(slider.control, values[n]));
    });
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = null;
      if (this.place) this.run();
    });
  }

  // Simulation -------------------------------------------------------------------------------------------------------

  run() {
    const begun = this.moved ?? performance.now();
    this.moved = null;
    const plan = this.planned();
    const problem = plan ? this.simulate(plan) : "There is no regulator for these weights.";
    this.plots.forEach((plot, n) => plot.show(this.data.plots[n].map((curve) => this.curve(curve))));
    this.took = performance.now() - begun;
    const steps = this.times.length - this.data.runs.length;
    this.said.textContent = problem || `${steps} steps simulated and drawn in ${Math.max(1, Math.round(this.took))} ms.`;
  }

  // The plan with the sliders' values; null where the weights have no regulator.
  planned() {
    const plan = this.plan.slice();
    const { controls, regulator } = this.data;
    const weights = regulator ? [...regulator.weights] : [];
    controls.forEach((control, n) => {
      const value = this.values[n];
      for (const place of control.places) plan[place] = value;
      if (value === 0) for (const [place, other] of control.when_zero) plan[place] = other;
      if (control.weight >= 0) weights[control.weight] = value;
    });
    if (!regulator || weights.every((weight, n) => weight === regulator.weights[n])) return plan;
    const scaled = weights.map((weight) => weight * regulator.scale);
    this.at(this.place.given, 36).set([...regulator.given, ...scaled]);
    if (!this.exports.live_gains(this.place.given, this.place.gains)) return null;
    const gains = this.at(this.place.gains, 5);
    for (const places of regulator.places) places.forEach((place, n) => { plan[place] = gains[n]; });
    return plan;
  }

  // Fill `simulated`, a row for each record; return what went wrong, or nothing.
  simulate(plan) {
    const { runs, records } = this.data;
    this.simulated = Array.from({ length: records }, () => new Float64Array(this.times.length).fill(NaN));
    let [first, problem] = [0, ""];
    runs.forEach((run, n) => {
      plan[1] = run.steps;
      for (const [place, value] of run.changes) plan[place] = value;
      this.at(this.place.plan, plan.length).set(plan);
      this.at(this.place.table, this.tables[n].length).set(this.tables[n]);
      const length = run.steps + 1;
      const done = this.exports.live_run(this.place.plan, this.place.table, this.place.out);
      const out = this.at(this.place.out, records * length);
      this.simulated.forEach((row, k) => row.set(out.subarray(k * length, k * length + done), first));
      if (done < length) problem ||= `The simulation ends at ${number(run.start + (done - 1) * this.data.step)} s: ${this.message()}`;
      first += length;
    });
    return problem;
  }

  // The module's memory moves when it grows: a view is good for one use.
  at(place, count) {
    return new Float64Array(this.exports.memory.buffer, place, count);
  }

  message() {
    const memory = new Uint8Array(this.exports.memory.buffer);
    const from = this.exports.live_message();
    return new TextDecoder().decode(memory.subarray(from, memory.indexOf(0, from))).replaceAll("%%", "%");
  }

  curve({ terms }) {
    const row = (n) => (n < 0 ? this.recorded[-1 - n] : this.simulated[n]);
    const sum = new Float64Array(this.times.length);
    for (const [n, factor] of terms) {
      const values = row(n);
      for (let m = 0; m < sum.length; m++) sum[m] += factor * values[m];
    }
    return thinned(this.times, sum, Live.POINTS);
  }
}

function valueAt({ low, high, log }, part) {
  if (part <= 0) return low;
  if (part >= 1) return high;
  return log ? low * (high / low) ** part : low + (high - low) * part;
}

function partOf({ low, high, log }, value) {
  return log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
}

// The smallest and the largest of each run of points, as the eye sees a curve; what is no number leaves a gap.
function thinned(x, y, limit) {
  const runs = Math.min(Math.ceil(limit / 2), y.length);
  const kept = [];
  for (let run = 0; run < runs; run++) {
    const [from, to] = [run, run + 1].map((n) => Math.floor((n * y.length) / runs));
    let [low, high] = [from, from];
    for (let n = from; n < to; n++) {
      if (y[n] < y[low]) low = n;
      if (y[n] > y[high]) high = n;
    }
    kept.push(...(low === high ? [low] : [Math.min(low, high), Math.max(low, high)]));
  }
  return { x: kept.map((n) => x[n]), y: kept.map((n) => (Number.isFinite(y[n]) ? y[n] : null)) };
}

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

function numbers64(text) {
  return new Float64Array(bytes(text).buffer);
}
