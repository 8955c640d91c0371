// Width of a digit of a tick, in pixels.
const DIGIT = 7;

// A plot in its figure: drawn as SVG, with a cursor that reads values, and moved by mouse, buttons and keys.
// Its data, see "Data of a plot" in docs/reports.md, are given, or stand as JSON in the figure.
class Plot {
  static all = [];
  static count = 0;

  constructor(figure, data = JSON.parse(figure.querySelector("script").textContent)) {
    this.figure = figure;
    this.data = { spans: [], categories: [], ...data };
    this.read(this.data.series);
    this.id = `plot-${Plot.count++}`;
    this.hidden = new Set();
    this.cursor = null;
    this.onScreen = true;
    this.build();
    this.reset(false);
    Plot.all.push(this);
    new ResizeObserver(() => this.draw()).observe(this.svg);
    new IntersectionObserver((entries) => this.entered(entries.at(-1).isIntersecting)).observe(this.figure);
    Units.listeners.push(() => this.draw());
  }

  // Columns of the series as numbers.
  read(series) {
    const earlier = [];
    this.data.series = series.map((given) => {
      const x = decodeColumn(given.x, earlier);
      earlier.push(x);
      const curve = ["line", "steps"].includes(given.kind ?? "line");
      return { ...given, x, y: decodeColumn(given.y), low: decodeColumn(given.low), high: decodeColumn(given.high), ascending: curve && isAscending(x) };
    });
  }

  // Show other series, with everything in view unless the reader has zoomed.
  show(series) {
    this.read(series);
    this.cursor = null;
    this.hidden.clear();
    this.legend.replaceWith(this.makeLegend());
    if (this.range === this.home) this.reset(false);
    else this.draw();
  }

  build() {
    this.makeLegend();
    const buttons = element("div", { class: "buttons" },
      this.button("+", "Zoom in", () => this.zoom(0.5)),
      this.button("−", "Zoom out", () => this.zoom(2)),
      this.button("◀", "Move left", () => this.move(-0.25)),
      this.button("▶", "Move right", () => this.move(0.25)),
      this.button("Reset", "Reset", () => this.reset()));
    this.svg = shape("svg", { tabindex: 0, role: "img", "aria-label": this.description() });
    this.tip = element("div", { class: "tip", hidden: "" });
    this.spoken = element("div", { class: "quiet", "aria-live": "polite" });
    this.figure.append(element("div", { class: "tools" }, this.legend, buttons), this.svg, this.tip, this.spoken);
    this.listen();
  }

  makeLegend() {
    this.legend = element("div", { class: "legend" });
    this.data.series.forEach((series, n) => this.legend.append(this.legendButton(series, n)));
    for (const [name, span] of new Map(this.data.spans.map((span) => [span.name, span]))) {
      this.legend.append(element("span", {}, swatch(span.start === span.end ? "var(--soft)" : "var(--span)"), name));
    }
    if (this.data.diagonal) this.legend.append(element("span", {}, swatch("var(--soft)"), "equal"));
    return this.legend;
  }

  description() {
    const names = this.data.series.map((series) => series.name).join(", ");
    return `${this.data.title}: ${this.data.yLabel} against ${this.data.xLabel}; ${names}. ` +
      "Left and right arrows read the points, page up and down go further, up and down choose the series, " +
      "shift and left or right move the view, plus and minus zoom, zero resets.";
  }

  button(text, label, action) {
    const made = element("button", { type: "button", "aria-label": `${label}: ${this.data.title}`, title: label }, text);
    made.addEventListener("click", action);
    return made;
  }

  legendButton(series, n) {
    const made = element("button", { type: "button", "aria-pressed": "true" }, swatch(colour(n)), series.name);
    made.addEventListener("click", () => {
      if (!this.hidden.delete(n)) this.hidden.add(n);
      made.setAttribute("aria-pressed", String(!this.hidden.has(n)));
      this.cursor = null;
      this.draw();
    });
    return made;
  }

  visible() {
    return this.data.series.map((series, n) => ({ series, n })).filter(({ n }) => !this.hidden.has(n));
  }

  isAngular() {
    return [this.data.xLabel, this.data.yLabel].some((label) => ANGULAR.test(Units.ofLabel(label)));
  }

  // Plots that move with this one along x.
  linked() {
    return this.data.link ? Plot.all.filter((plot) => plot !== this && plot.data.link === this.data.link) : [];
  }

  // Where the view goes -------------------------------------------------------------------------------------------

  reset(withOthers = true) {
    const { series, spans, diagonal, logX, logY, categories } = this.data;
    const flat = series.some((s) => s.kind === "bars") ? [[0]] : [];
    const edges = spans.map((span) => [span.start, span.end]);
    const names = categories.length ? [[-0.5, categories.length - 0.5]] : [];
    let x = extent([...series.map((s) => (s.ascending && !logX ? [s.x[0], s.x.at(-1)] : s.x)), ...edges, ...names], logX);
    let y = extent([...series.flatMap((s) => [s.y, s.low ?? [], s.high ?? []]), ...flat], logY);
    if (diagonal) x = y = [Math.min(x[0], y[0]), Math.max(x[1], y[1])];
    this.range = { x, y };
    this.home = this.range;
    this.draw();
    if (withOthers) this.linked().forEach((plot) => plot.follow(plot.home.x));
  }

  // Show a range; the linked plots follow along x.
  go(x, y = this.range.y, now = true) {
    this.range = { x, y };
    if (now) this.draw();
    else this.drawSoon();
    this.linked().forEach((plot) => plot.follow(x));
  }

  follow(x) {
    this.range = x === this.home.x ? this.home : { x, y: this.range.y };
    this.drawSoon();
  }

  zoom(factor, centre = this.cursor && this.pointAt(this.cursor)) {
    const middle = (scale) => scale.value((scale.from + scale.to) / 2);
    const x = this.x.zoomed(factor, centre ? centre.x : middle(this.x));
    // What is linked along time is zoomed along time; its height stays.
    this.go(x, this.data.link ? this.range.y : this.y.zoomed(factor, centre ? centre.y : middle(this.y)));
  }

  move(part) {
    this.go(this.x.moved(part));
  }

  // Drawing -------------------------------------------------------------------------------------------------------

  entered(onScreen) {
    this.onScreen = onScreen;
    if (onScreen && this.stale) this.draw();
  }

  // Draw with the next picture, or once the plot comes into view.
  drawSoon() {
    if (this.stale) return;
    this.stale = true;
    if (this.onScreen) requestAnimationFrame(() => this.stale && this.draw());
  }

  draw() {
    this.stale = false;
    const width = this.svg.clientWidth || 640;
    const height = Math.round(Math.min(420, Math.max(260, width * 0.5)));
    const [ux, uy] = [this.data.xLabel, this.data.yLabel].map((label) => Units.shown(Units.ofLabel(label)).factor);
    this.slanted = this.data.categories.some((name) => name.length * 7.5 * this.data.categories.length > width - 66);
    this.y = new Scale(...this.range.y, height - (this.slanted ? 118 : 44), 10, this.data.logY, uy);
    const longest = Math.max(0, ...this.y.ticks(6).map(({ text }) => text.length));
    const left = Math.max(66, 30 + DIGIT * longest);  // the axis's name stands left of its ticks
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.style.height = `${height}px`;
    this.x = new Scale(...this.range.x, left, width - 10, this.data.logX, ux);
    const marks = new Marks(this);
    const inside = shape("g", { "clip-path": `url(#${this.id}-clip)` });
    inside.append(...this.spans(), ...this.visible().flatMap(({ series, n }) => marks.of(series, colour(n))));
    if (this.data.diagonal) inside.append(this.diagonal());
    const clip = shape("clipPath", { id: `${this.id}-clip` });
    clip.append(this.box({}));
    this.overlay = shape("g");
    this.svg.replaceChildren(clip, ...this.axes(width, height), inside, this.box({ class: "frame" }), this.overlay);
    this.showCursor(false);
  }

  box(attributes) {
    const { x, y } = this;
    return shape("rect", { x: x.from, y: y.to, width: x.to - x.from, height: y.from - y.to, ...attributes });
  }

  axes(width, height) {
    const { x, y } = this;
    const made = [];
    for (const { value, text } of this.data.categories.length ? this.names() : x.ticks(Math.max(3, width / 110))) {
      const at = x.pixel(value);
      made.push(line(at, y.from, at, y.to, "grid"), this.under(at, text, width));
    }
    for (const { value, text } of y.ticks(6)) {
      const at = y.pixel(value);
      made.push(line(x.from, at, x.to, at, "grid"), label(x.from - 7, at + 4, text, "end"));
    }
    const up = label(0, 0, Units.label(this.data.yLabel), "middle");
    up.setAttribute("transform", `translate(13 ${(y.from + y.to) / 2}) rotate(-90)`);
    if (6.5 * up.textContent.length > y.from) up.setAttribute("textLength", y.from); // narrower letters, none cut
    up.setAttribute("lengthAdjust", "spacingAndGlyphs");
    made.push(label((x.from + x.to) / 2, height - 6, Units.label(this.data.xLabel), "middle"), up);
    return made;
  }

  // Ticks of an axis of named things.
  names() {
    const shown = this.data.categories.map((text, value) => ({ value, text }));
    return shown.filter(({ value }) => value >= this.x.low && value <= this.x.high);
  }

  // What stands below the axis, whole also at its right end.
  under(at, text, width) {
    if (!this.slanted) return label(Math.min(at, width - (DIGIT * text.length) / 2), this.y.from + 17, text, "middle");
    const made = label(0, 0, text.length > 18 ? `${text.slice(0, 17)}…` : text, "end");
    made.setAttribute("transform", `translate(${at + 4} ${this.y.from + 14}) rotate(-40)`);
    return made;
  }

  spans() {
    const seen = this.data.spans.filter(({ start, end }) => end >= this.x.low && start <= this.x.high);
    return seen.map((span) => {
      const [a, b] = [this.x.pixel(span.start), this.x.pixel(span.end)];
      if (a === b) return line(a, this.y.from, a, this.y.to, "moment");
      return shape("rect", { class: "span", x: a, y: this.y.to, width: Math.max(b - a, 0.5), height: this.y.from - this.y.to });
    });
  }

  diagonal() {
    const low = Math.max(this.x.low, this.y.low);
    const high = Math.min(this.x.high, this.y.high);
    if (high <= low) return shape("g");
    return line(this.x.pixel(low), this.y.pixel(low), this.x.pixel(high), this.y.pixel(high), "diagonal");
  }

  // What the reader does ------------------------------------------------------------------------------------------

  listen() {
    this.svg.addEventListener("pointermove", (event) => this.moved(event));
    this.svg.addEventListener("pointerdown", (event) => this.pressed(event));
    this.svg.addEventListener("pointerup", (event) => this.released(event));
    this.svg.addEventListener("pointercancel", () => this.drop());
    this.svg.addEventListener("pointerleave", () => this.leave());
    this.svg.addEventListener("blur", () => this.leave());
    this.svg.addEventListener("dblclick", () => this.reset());
    this.svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.svg.addEventListener("keydown", (event) => this.key(event));
  }

  place(event) {
    const svg = this.svg.getBoundingClientRect();
    const within = (value, { from, to }) => Math.min(Math.max(value, Math.min(from, to)), Math.max(from, to));
    return [within(event.clientX - svg.left, this.x), within(event.clientY - svg.top, this.y)];
  }

  moved(event) {
    const [px, py] = this.place(event);
    if (this.held) this.go(this.held.moved((this.heldAt - px) / (this.x.to - this.x.from)), this.range.y, false);
    else if (this.start) this.stretch(px, py);
    else this.seek(px, py);
  }

  pressed(event) {
    this.seek(...this.place(event));
    if (event.pointerType === "touch" || event.button !== 0) return;
    if (event.shiftKey) [this.held, [this.heldAt]] = [this.x, this.place(event)];
    else this.start = this.place(event);
    this.svg.setPointerCapture(event.pointerId);
  }

  released(event) {
    if (!this.start) return this.drop();
    const [[ax, ay], [bx, by]] = [this.start, this.place(event)];
    this.drop();
    const between = (scale, a, b) => [scale.value(a), scale.value(b)].sort((m, n) => m - n);
    if (Math.abs(bx - ax) < 8) return;
    const tall = Math.abs(by - ay) > 24;
    this.go(between(this.x, ax, bx), tall ? between(this.y, ay, by) : this.range.y);
  }

  drop() {
    this.start = null;
    this.held = null;
    this.selection?.remove();
  }

  stretch(px, py) {
    const [ax, ay] = this.start;
    const tall = Math.abs(py - ay) > 24;
    this.selection?.remove();
    this.selection = this.box({ class: "box", x: Math.min(ax, px), width: Math.abs(px - ax) });
    if (tall) {
      this.selection.setAttribute("y", Math.min(ay, py));
      this.selection.setAttribute("height", Math.abs(py - ay));
    }
    this.overlay.append(this.selection);
  }

  // With ctrl, as pinching a touchpad sends it, zoom about the pointer; sideways, move. Else the page scrolls.
  wheel(event) {
    if (!event.ctrlKey && Math.abs(event.deltaX) <= Math.abs(event.deltaY)) return;
    event.preventDefault();
    const [px, py] = this.place(event);
    if (event.ctrlKey) this.zoom(1.003 ** event.deltaY, { x: this.x.value(px), y: this.y.value(py) });
    else this.go(this.x.moved(event.deltaX / (this.x.to - this.x.from)), this.range.y, false);
  }

  leave() {
    if (!this.cursor) return;
    [this, ...this.linked()].forEach((plot) => plot.point(null));
  }

  key(event) {
    const far = Math.max(1, Math.round(this.rowsInView() / 20));
    const actions = {
      ArrowLeft: () => (event.shiftKey ? this.move(-0.1) : this.step(-1)),
      ArrowRight: () => (event.shiftKey ? this.move(0.1) : this.step(1)),
      PageUp: () => this.step(-far), PageDown: () => this.step(far),
      ArrowUp: () => this.change(-1), ArrowDown: () => this.change(1),
      "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), 0: () => this.reset(), Escape: () => this.reset(),
    };
    const action = actions[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  }

  // The cursor ----------------------------------------------------------------------------------------------------

  // Nearest point of a curve along x, of a cloud in the plane.
  seek(px, py) {
    let best = null;
    for (const { series, n } of this.visible()) {
      const flat = series.kind !== "points";
      const found = series.ascending ? [nearest(series, this.x.value(px))] : series.x.keys();
      for (const m of found) {
        if (m < 0 || Number.isNaN(series.x[m] + series.y[m])) continue;
        if (!this.x.holds(series.x[m]) || (!flat && !this.y.holds(series.y[m]))) continue;
        const dx = this.x.pixel(series.x[m]) - px;
        const dy = this.y.pixel(series.y[m]) - py;
        const distance = dx * dx + dy * dy * (flat ? 0.05 : 1);
        if (!best || distance < best.distance) best = { n, m, distance };
      }
    }
    this.point(best);
    this.tell();
  }

  point(cursor, speak = false) {
    this.cursor = cursor;
    this.showCursor(speak);
  }

  // Let the linked plots that are on the screen point to the same x.
  tell() {
    if (!this.cursor) return;
    const { x } = this.pointAt(this.cursor);
    for (const plot of this.linked().filter(({ onScreen }) => onScreen)) {
      const first = plot.visible().find(({ series }) => series.ascending);
      plot.point(first ? { n: first.n, m: nearest(first.series, x) } : null);
    }
  }

  rowsInView() {
    const { series } = this.visible().find(({ n }) => n === (this.cursor?.n ?? n)) ?? {};
    if (!series) return 0;
    if (!series.ascending) return series.x.length;
    return firstAtLeast(series.x, this.x.high) - firstAtLeast(series.x, this.x.low);
  }

  step(by) {
    const shown = this.visible();
    if (!shown.length) return;
    const { n, m } = this.cursor ?? { n: shown[0].n, m: by > 0 ? -1 : 0 };
    const { length } = this.data.series[n].x;
    this.point({ n, m: (((m + by) % length) + length) % length }, true);
    this.tell();
  }

  change(by) {
    const shown = this.visible();
    if (!shown.length) return;
    const now = Math.max(0, shown.findIndex(({ n }) => n === this.cursor?.n));
    const { n, series } = shown[(now + by + shown.length) % shown.length];
    this.point({ n, m: Math.min(this.cursor?.m ?? 0, series.x.length - 1) }, true);
    this.tell();
  }

  pointAt({ n, m }) {
    const series = this.data.series[n];
    return { x: series.x[m], y: series.y[m] };
  }

  showCursor(speak) {
    this.overlay?.replaceChildren(...(this.start && this.selection ? [this.selection] : []));
    this.tip.hidden = !this.cursor;
    if (!this.cursor) return;
    const { x, y } = this.pointAt(this.cursor);
    const words = this.words();
    this.tip.replaceChildren(...words.map((text) => element("div", {}, text)));
    if (speak) this.spoken.textContent = words.join(", ");
    if (Number.isNaN(x + y) || !this.x.holds(x)) return;
    const [px, py] = [this.x.pixel(x), this.y.pixel(y)];
    this.overlay.prepend(line(px, this.y.from, px, this.y.to, "cursor"),
      shape("circle", { cx: px, cy: py, r: 5, fill: "none", stroke: colour(this.cursor.n), "stroke-width": 2 }));
    const width = this.svg.clientWidth;
    this.tip.style.left = `${px > width / 2 ? Math.max(0, px - this.tip.offsetWidth - 12) : Math.min(px + 12, width - this.tip.offsetWidth)}px`;
    const above = this.svg.getBoundingClientRect().top - this.figure.getBoundingClientRect().top;
    this.tip.style.top = `${above + Math.max(4, Math.min(py + 8, this.y.from - this.tip.offsetHeight))}px`;
  }

  // What the cursor says: the point itself, and the other curves at the same x.
  words() {
    const { n, m } = this.cursor;
    const main = this.data.series[n];
    const inX = (value) => number(value * this.x.factor);
    const inY = (value) => number(value * this.y.factor);
    const said = [this.data.categories[main.x[m]] ?? `${Units.label(this.data.xLabel)}: ${inX(main.x[m])}`];
    for (const { series, n: other } of this.visible()) {
      const at = other === n ? m : series.kind === "points" ? -1 : nearest(series, main.x[m]);
      if (at < 0) continue;
      const interval = series.low ? ` (${inY(series.low[at])} to ${inY(series.high[at])})` : "";
      said.push(`${series.name}: ${inY(series.y[at])}${interval}`);
    }
    if (main.labels) said.push(main.labels[m]);
    return said;
  }
}

// The row of a series whose x is nearest to a value, -1 where there is none.
function nearest(series, value) {
  const { x } = series;
  if (series.ascending) {
    const after = firstAtLeast(x, value);
    if (after === x.length || (after > 0 && value - x[after - 1] < x[after] - value)) return after - 1;
    return after;
  }
  let best = -1;
  for (let n = 0; n < x.length; n++) {
    if (!Number.isNaN(x[n]) && (best < 0 || Math.abs(x[n] - value) < Math.abs(x[best] - value))) best = n;
  }
  return best;
}

addEventListener("beforeprint", () => Plot.all.filter(({ stale }) => stale).forEach((plot) => plot.draw()));
