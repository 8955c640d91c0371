// A plot with a cursor that reads values, and moved by fingers, mouse, buttons and keys.
class Plot extends PlotFigure {
  static all = [];
  static count = 0;

  pointers = new Map();  // that hold the plot, by number: where they are along x

  listen() {
    this.svg.addEventListener("pointermove", (event) => this.moved(event));
    this.svg.addEventListener("pointerdown", (event) => this.pressed(event));
    this.svg.addEventListener("pointerup", (event) => this.released(event));
    this.svg.addEventListener("pointercancel", (event) => this.drop(event));
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
    if (this.pointers.has(event.pointerId)) this.pull(event.pointerId, px);
    else if (this.start) this.stretch(px, py);
    else this.seek(px, py);
  }

  pressed(event) {
    this.seek(...this.place(event));
    if (event.button !== 0) return;
    if (event.shiftKey || event.pointerType === "touch") this.grip(this.pointers.set(event.pointerId, this.place(event)[0]));
    else this.start = this.place(event);
    this.svg.setPointerCapture(event.pointerId);
  }

  // Note where the plot is held: one pointer moves it, two fingers stretch it, too.
  grip(pointers) {
    this.held = { x: this.x, ...Plot.reach(pointers) };
  }

  static reach(pointers) {
    const at = [...pointers.values()], [first, last] = [at[0], at.at(-1)];
    return { middle: (first + last) / 2, wide: Math.max(20, Math.abs(last - first)) };
  }

  pull(pointer, px) {
    const { x, middle, wide } = this.held, now = Plot.reach(this.pointers.set(pointer, px));
    const stretched = new Scale(...x.zoomed(wide / now.wide, x.value(middle)), x.from, x.to, x.logarithmic);
    this.go(stretched.moved((middle - now.middle) / (x.to - x.from)), this.range.y, false);
  }

  released(event) {
    if (!this.start) return this.drop(event);
    const [[ax, ay], [bx, by]] = [this.start, this.place(event)];
    this.drop(event);
    const between = (scale, a, b) => [scale.value(a), scale.value(b)].sort((m, n) => m - n);
    if (Math.abs(bx - ax) < 8) return;
    const tall = Math.abs(by - ay) > 24;
    this.go(between(this.x, ax, bx), tall ? between(this.y, ay, by) : this.range.y);
  }

  drop({ pointerId }) {
    this.start = null;
    this.pointers.delete(pointerId);
    this.grip(this.pointers);
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
    this.tip.replaceChildren(...words.map((text) => make("div", {}, text)));
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
