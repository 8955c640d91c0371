// Width of a digit of a tick, in pixels.
const DIGIT = 7;

// A plot in its figure: drawn as SVG, with a cursor that reads values, and zoom by mouse, buttons and keys.
class Plot {
  static count = 0;

  constructor(figure) {
    this.figure = figure;
    this.data = JSON.parse(figure.querySelector("script").textContent);
    this.id = `plot-${Plot.count++}`;
    this.hidden = new Set();
    this.cursor = null;
    this.build();
    this.reset();
    new ResizeObserver(() => this.draw()).observe(this.svg);
  }

  build() {
    const tools = element("div", { class: "tools" });
    const legend = element("div", { class: "legend" });
    this.data.series.forEach((series, n) => legend.append(this.legendButton(series, n)));
    for (const [name, span] of new Map(this.data.spans.map((span) => [span.name, span]))) {
      legend.append(element("span", {}, swatch(span.start === span.end ? "var(--soft)" : "var(--span)"), name));
    }
    if (this.data.diagonal) legend.append(element("span", {}, swatch("var(--soft)"), "equal"));
    tools.append(legend, element("div", { class: "buttons" },
      this.button("+", "Zoom in", () => this.zoom(0.5)),
      this.button("−", "Zoom out", () => this.zoom(2)),
      this.button("Reset", "Show everything", () => this.reset())));
    this.svg = shape("svg", { tabindex: 0, role: "img", "aria-label": this.description() });
    this.tip = element("div", { class: "tip", hidden: "" });
    this.spoken = element("div", { class: "quiet", "aria-live": "polite" });
    this.figure.append(tools, this.svg, this.tip, this.spoken);
    this.listen();
  }

  description() {
    const names = this.data.series.map((series) => series.name).join(", ");
    return `${this.data.title}: ${this.data.yLabel} against ${this.data.xLabel}; ${names}. ` +
      "Left and right arrows read the points, up and down choose the series, plus and minus zoom, zero resets.";
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

  reset() {
    const { series, spans, diagonal, logX, logY, categories } = this.data;
    const flat = series.some((s) => s.kind === "bars") ? [[0]] : [];
    const edges = spans.map((span) => [span.start, span.end]);
    const names = categories.length ? [[-0.5, categories.length - 0.5]] : [];
    let x = extent([...series.map((s) => s.x), ...edges, ...names], logX);
    let y = extent([...series.flatMap((s) => [s.y, s.low ?? [], s.high ?? []]), ...flat], logY);
    if (diagonal) x = y = [Math.min(x[0], y[0]), Math.max(x[1], y[1])];
    this.range = { x, y };
    this.home = this.range;
    this.draw();
  }

  zoom(factor) {
    const point = this.cursor && this.pointAt(this.cursor);
    const middle = (scale) => scale.value((scale.from + scale.to) / 2);
    this.range = {
      x: this.x.zoomed(factor, point ? point.x : middle(this.x)),
      y: this.y.zoomed(factor, point ? point.y : middle(this.y)),
    };
    this.draw();
  }

  draw() {
    const width = this.svg.clientWidth || 640;
    const height = Math.round(Math.min(420, Math.max(260, width * 0.5)));
    this.slanted = this.data.categories.some((name) => name.length * 7.5 * this.data.categories.length > width - 66);
    this.y = new Scale(...this.range.y, height - (this.slanted ? 118 : 44), 10, this.data.logY);
    const longest = Math.max(0, ...this.y.ticks(6).map(({ text }) => text.length));
    const left = Math.max(66, 30 + DIGIT * longest);  // the axis's name stands left of its ticks
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.style.height = `${height}px`;
    this.x = new Scale(...this.range.x, left, width - 10, this.data.logX);
    const inside = shape("g", { "clip-path": `url(#${this.id}-clip)` });
    inside.append(...this.spans(), ...this.visible().flatMap(({ series, n }) => this.marks(series, colour(n))));
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
    const up = label(0, 0, this.data.yLabel, "middle");
    up.setAttribute("transform", `translate(13 ${(y.from + y.to) / 2}) rotate(-90)`);
    made.push(label((x.from + x.to) / 2, height - 6, this.data.xLabel, "middle"), up);
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
    return this.data.spans.map((span) => {
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

  marks(series, stroke) {
    const made = [];
    if (series.low) made.push(shape("path", { d: this.whiskers(series), stroke, "stroke-width": 1, fill: "none" }));
    if (series.kind === "points") made.push(shape("path", { d: this.dots(series), fill: stroke }));
    else if (series.kind === "bars") made.push(shape("path", { d: this.bars(series), fill: stroke, "fill-opacity": 0.75 }));
    else made.push(shape("path", { d: this.curve(series), stroke, class: "curve" }));
    return made;
  }

  at(series, n) {
    const [x, y] = [series.x[n], series.y[n]];
    if (x === null || y === null) return null;
    if ((this.data.logX && x <= 0) || (this.data.logY && y <= 0)) return null;
    return [this.x.pixel(x).toFixed(1), this.y.pixel(y).toFixed(1)];
  }

  curve(series) {
    let path = "";
    let pen = false;
    for (let n = 0; n < series.x.length; n++) {
      const place = this.at(series, n);
      if (!place) {
        pen = false;
      } else {
        if (pen && series.kind === "steps") path += `H${place[0]}`;
        path += `${pen ? "L" : "M"}${place[0]} ${place[1]}`;
        pen = true;
      }
    }
    return path;
  }

  dots(series) {
    const places = series.x.map((_, n) => this.at(series, n)).filter(Boolean);
    const radius = places.length > 400 ? 2 : 3.5;
    return places.map(([x, y]) => `M${x - radius} ${y}a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`).join("");
  }

  bars(series) {
    const count = series.x.length;
    const half = Math.max(1, Math.min(24, ((this.x.to - this.x.from) / Math.max(count, 1)) * 0.35));
    const floor = this.y.pixel(this.data.logY ? this.y.low : 0);
    return series.x.map((_, n) => this.at(series, n)).filter(Boolean)
      .map(([x, y]) => `M${x - half} ${floor}V${y}h${2 * half}V${floor}Z`).join("");
  }

  whiskers(series) {
    let path = "";
    for (let n = 0; n < series.x.length; n++) {
      const [x, end, high] = [series.x[n], series.low[n], series.high[n]];
      if (x === null || end === null || high === null || (this.data.logY && high <= 0)) continue;
      const low = this.data.logY && end <= 0 ? this.y.low : end; // a logarithmic axis has no zero to reach down to
      path += `M${this.x.pixel(x).toFixed(1)} ${this.y.pixel(low).toFixed(1)}V${this.y.pixel(high).toFixed(1)}`;
    }
    return path;
  }

  listen() {
    this.svg.addEventListener("pointermove", (event) => this.moved(event));
    this.svg.addEventListener("pointerdown", (event) => this.pressed(event));
    this.svg.addEventListener("pointerup", (event) => this.released(event));
    this.svg.addEventListener("pointercancel", () => this.drop());
    this.svg.addEventListener("pointerleave", () => this.leave());
    this.svg.addEventListener("blur", () => this.leave());
    this.svg.addEventListener("dblclick", () => this.reset());
    this.svg.addEventListener("keydown", (event) => this.key(event));
  }

  place(event) {
    const svg = this.svg.getBoundingClientRect();
    const within = (value, { from, to }) => Math.min(Math.max(value, Math.min(from, to)), Math.max(from, to));
    return [within(event.clientX - svg.left, this.x), within(event.clientY - svg.top, this.y)];
  }

  moved(event) {
    const [px, py] = this.place(event);
    if (this.start) this.stretch(px, py);
    else this.seek(px, py);
  }

  pressed(event) {
    this.seek(...this.place(event));
    if (event.pointerType === "touch" || event.button !== 0) return;
    this.start = this.place(event);
    this.svg.setPointerCapture(event.pointerId);
  }

  released(event) {
    if (!this.start) return;
    const [[ax, ay], [bx, by]] = [this.start, this.place(event)];
    this.drop();
    const between = (scale, a, b) => [scale.value(a), scale.value(b)].sort((m, n) => m - n);
    if (Math.abs(bx - ax) < 8) return;
    const tall = Math.abs(by - ay) > 24;
    this.range = { x: between(this.x, ax, bx), y: tall ? between(this.y, ay, by) : this.range.y };
    this.draw();
  }

  drop() {
    this.start = null;
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

  leave() {
    this.cursor = null;
    this.showCursor(false);
  }

  // Nearest point of a curve along x, of a cloud in the plane.
  seek(px, py) {
    let best = null;
    for (const { series, n } of this.visible()) {
      const flat = series.kind !== "points";
      for (let m = 0; m < series.x.length; m++) {
        if (series.x[m] === null || series.y[m] === null) continue;
        if (!this.x.holds(series.x[m]) || (!flat && !this.y.holds(series.y[m]))) continue;
        const dx = this.x.pixel(series.x[m]) - px;
        const dy = this.y.pixel(series.y[m]) - py;
        const distance = dx * dx + dy * dy * (flat ? 0.05 : 1);
        if (!best || distance < best.distance) best = { n, m, distance };
      }
    }
    this.cursor = best;
    this.showCursor(false);
  }

  key(event) {
    const actions = {
      ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1),
      ArrowUp: () => this.change(-1), ArrowDown: () => this.change(1),
      "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), 0: () => this.reset(), Escape: () => this.reset(),
    };
    const action = actions[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  }

  step(by) {
    const shown = this.visible();
    if (!shown.length) return;
    this.cursor ??= { n: shown[0].n, m: by > 0 ? -1 : 0 };
    const { length } = this.data.series[this.cursor.n].x;
    this.cursor = { n: this.cursor.n, m: (this.cursor.m + by + length) % length };
    this.showCursor(true);
  }

  change(by) {
    const shown = this.visible();
    if (!shown.length) return;
    const now = Math.max(0, shown.findIndex(({ n }) => n === this.cursor?.n));
    const { n, series } = shown[(now + by + shown.length) % shown.length];
    this.cursor = { n, m: Math.min(this.cursor?.m ?? 0, series.x.length - 1) };
    this.showCursor(true);
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
    if (x === null || y === null || !this.x.holds(x)) return;
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
    const said = [this.data.categories[main.x[m]] ?? `${this.data.xLabel}: ${number(main.x[m])}`];
    for (const { series, n: other } of this.visible()) {
      const at = other === n ? m : series.kind === "points" ? -1 : nearest(series.x, main.x[m]);
      if (at < 0) continue;
      const interval = series.low ? ` (${number(series.low[at])} to ${number(series.high[at])})` : "";
      said.push(`${series.name}: ${number(series.y[at])}${interval}`);
    }
    if (main.labels) said.push(main.labels[m]);
    return said;
  }
}

function nearest(list, value) {
  let best = -1;
  for (let n = 0; n < list.length; n++) {
    if (list[n] !== null && (best < 0 || Math.abs(list[n] - value) < Math.abs(list[best] - value))) best = n;
  }
  return best;
}
