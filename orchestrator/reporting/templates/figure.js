// Width of a digit of a tick, in pixels.
const DIGIT = 7;

// A plot in its figure, drawn as SVG: its data, its legend, the range in view.
// Its data, see "Data of a plot" in docs/reports.md, are given, or stand as JSON in the figure.
class PlotFigure {
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

  // Show other series, with everything in view unless the reader has zoomed; where the names stay, so does what is hidden.
  show(series) {
    const names = () => JSON.stringify(this.data.series.map(({ name }) => name)), before = names();
    this.read(series);
    this.cursor = null;
    if (names() !== before) {
      this.hidden.clear();
      this.legend.replaceWith(this.makeLegend());
    }
    if (this.range === this.home) this.reset(false);
    else this.draw();
  }

  build() {
    this.makeLegend();
    const buttons = make("div", { class: "buttons" },
      this.button("+", "Zoom in", () => this.zoom(0.5)),
      this.button("−", "Zoom out", () => this.zoom(2)),
      this.button("◀", "Move left", () => this.move(-0.25)),
      this.button("▶", "Move right", () => this.move(0.25)),
      this.button("Reset", "Reset", () => this.reset()),
      this.button("SVG", "Save the picture as SVG", () => savePicture(this)),
      this.button("CSV", "Save the numbers in view as CSV", () => saveNumbers(this)));
    this.svg = shape("svg", { tabindex: 0, role: "img", "aria-label": this.description() });
    this.tip = make("div", { class: "tip", hidden: "" });
    this.spoken = make("div", { class: "quiet", "aria-live": "polite" });
    this.figure.append(make("div", { class: "tools" }, this.legend, buttons), this.svg, this.tip, this.spoken);
    this.listen();
  }

  makeLegend() {
    this.legend = make("div", { class: "legend" });
    this.data.series.forEach((series, n) => this.legend.append(this.legendButton(series, n)));
    for (const [name, span] of new Map(this.data.spans.map((span) => [span.name, span]))) {
      this.legend.append(make("span", {}, swatch(span.start === span.end ? "var(--soft)" : "var(--span)"), name));
    }
    if (this.data.diagonal) this.legend.append(make("span", {}, swatch("var(--soft)"), "equal"));
    return this.legend;
  }

  description() {
    const names = this.data.series.map((series) => series.name).join(", ");
    return `${this.data.title}: ${this.data.yLabel} against ${this.data.xLabel}; ${names}. ` +
      "Left and right arrows read the points, page up and down go further, up and down choose the series, " +
      "shift and left or right move the view, plus and minus zoom, zero resets.";
  }

  button(text, label, action) {
    const made = make("button", { type: "button", "aria-label": `${label}: ${this.data.title}`, title: label }, text);
    made.addEventListener("click", action);
    return made;
  }

  legendButton(series, n) {
    const made = make("button", { type: "button", "aria-pressed": "true" }, swatch(colour(n)), series.name);
    made.addEventListener("click", () => {
      if (!this.hidden.delete(n)) this.hidden.add(n);
      made.setAttribute("aria-pressed", String(!this.hidden.has(n)));
      this.cursor = null;
      if (this.range === this.home) this.reset(false);
      else this.draw();
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
    const { spans, diagonal, logX, logY, categories } = this.data, shown = this.visible().map((one) => one.series);
    const series = shown.length ? shown : this.data.series;
    const edges = spans.map((span) => [span.start, span.end]);
    const names = categories.length ? [[-0.5, categories.length - 0.5]] : [];
    let x = extent([...series.map((s) => (s.ascending && !logX ? [s.x[0], s.x.at(-1)] : s.x)), ...edges, ...names], logX);
    let y = extent([...series.flatMap((s) => [s.y, s.low ?? [], s.high ?? []])], logY);
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
}
