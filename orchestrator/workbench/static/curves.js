/* global shape */
import { post } from "./api.js";
import { digits, fill } from "./dom.js";

const WIDE = 300, HIGH = 60, STRETCHES = 300;
const MOST = 24;  // channels that are asked for at once
const CUT_OFF = 0.005;  // share of the rows at one end of the range from which on it is told

// The curves of a log's channels, all over the same rows: drawn once they come into sight, and anew until all is read.
export class Curves {
  constructor() {
    this.said = make("span", { class: "note", role: "status" });
    this.tools = make("div", { class: "row" },
      ...[["Zoom in", () => this.zoom(0.5)], ["Zoom out", () => this.zoom(2)], ["◀ Earlier", () => this.move(-0.5)], ["Later ▶", () => this.move(0.5)],
        ["All rows", () => this.look(0, Infinity)]].map(([text, act]) => make("button", { type: "button", onclick: act }, text)), this.said);
    this.seen = new Map();  // figures that are in sight, and their places
    this.sight = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const place = Number(target.dataset.place);
        this.seen.delete(target);
        if (!isIntersecting) continue;
        this.seen.set(target, place);
        this.draw(target, this.known.get(place));
      }
      this.load();
    });
    this.show("", null);
  }

  // Begin with another log, or another line of its names.
  show(file, header) {
    if (this.file === file && this.header === header) return;
    Object.assign(this, { file, header, known: new Map(), first: 0, last: Infinity, rows: 0, share: 1, turn: (this.turn ?? 0) + 1 });
    this.seen.clear();
  }

  // The figure of a channel; `factor` is what its values are multiplied by before anything else.
  figure(place, label, unit, factor = 1) {
    const path = shape("path"), words = make("figcaption", { class: "note" });
    const svg = shape("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", role: "img", "aria-label": `Curve of ${label}` }, path);
    const figure = make("figure", { class: "curve", "data-place": place }, svg, words);
    Object.assign(figure, { path, words, svg, label, unit, factor });
    let start = null;
    const rowAt = (event) => this.rowAt((event.clientX - svg.getBoundingClientRect().left) / svg.clientWidth);
    svg.addEventListener("pointerdown", (event) => { start = event.pointerType === "touch" ? null : rowAt(event); });
    svg.addEventListener("pointerup", (event) => {
      const [a, b] = [start, rowAt(event)].sort((m, n) => m - n);
      if (start !== null && b - a > 0.02 * this.width()) this.look(a, b);
      start = null;
    });
    svg.addEventListener("dblclick", () => this.look(0, Infinity));
    this.sight.observe(figure);
    this.draw(figure, this.known.get(place));
    return figure;
  }

  end() { return Math.min(this.last, Math.max(1, this.rows - 1)); }
  width() { return this.end() - this.first; }
  rowAt(part) { return this.first + part * this.width(); }

  look(first, last) {
    this.first = Math.max(0, Math.round(first));
    this.last = last >= this.rows - 1 ? Infinity : Math.round(last);
    this.load();
  }

  zoom(factor) {
    const half = Math.max(5, (factor * this.width()) / 2), middle = (this.first + this.end()) / 2;
    this.look(middle - half, middle + half);
  }

  move(part) {
    const by = Math.max(-this.first, Math.min(part * this.width(), this.rows - 1 - this.end()));
    this.look(this.first + by, this.end() + by);
  }

  wanted() {
    const fresh = (place) => { const curve = this.known.get(place); return curve?.whole && curve.first === this.first && curve.last === this.last; };
    return [...new Set(this.seen.values())].filter((place) => !fresh(place)).slice(0, MOST);
  }

  // Ask for what is in sight, until all of it is there; one request at a time.
  async load() {
    if (this.busy) return;
    this.busy = true;
    for (let places = this.wanted(); places.length && this.file; places = this.wanted()) {
      const { turn, first, last, file, header } = this;
      try {
        const found = await post("curves", { file, header, places, first, last: Number.isFinite(last) ? last : 2 ** 50, stretches: STRETCHES });
        if (turn !== this.turn) continue;
        this.take(found, places, first, last);
      } catch (error) {
        if (turn === this.turn) { this.said.textContent = error.message; break; }
      }
    }
    this.busy = false;
  }

  take(found, places, first, last) {
    this.rows = Math.max(this.rows, found.rows, ...found.curves.map((curve) => (curve.rows.at(-1) ?? -1) + 1));
    for (const place of places) this.known.set(place, { whole: true, rows: [], ...found.curves.find((one) => one.place === place), first, last });
    for (const [figure, place] of this.seen) this.draw(figure, this.known.get(place));
    const rows = `rows ${(this.first + 1).toLocaleString("en")} to ${(this.end() + 1).toLocaleString("en")}`;
    this.said.textContent = found.share < 1 ? `${Math.round(100 * found.share)} % of the rows are read` : rows;
  }

  draw(figure, curve) {
    const { path, words, unit, factor } = figure;
    if (!curve) return;
    const all = [curve.least, curve.most].map((value) => value * factor).sort((a, b) => a - b);
    const ends = [...curve.low ?? [], ...curve.high ?? []].filter((value) => value !== null).map((value) => value * factor);
    const [low, high] = ends.length ? [Math.min(...ends), Math.max(...ends)] : all;
    const x = (row) => ((row - this.first) / this.width()) * WIDE;
    const y = (value) => (high > low ? 3 + ((high - value * factor) / (high - low)) * (HIGH - 6) : HIGH / 2);
    let pen = "M";
    path.setAttribute("d", curve.rows.map((row, n) => {
      if (curve.low[n] === null) { pen = "M"; return ""; }
      const part = `${pen}${x(row).toFixed(1)} ${y(curve.low[n]).toFixed(1)}V${y(curve.high[n]).toFixed(1)}`;
      pen = "L";
      return part;
    }).join(""));
    fill(words, wordsOf(curve, low, high, unit, factor));
    figure.svg.setAttribute("aria-label", `Curve of ${figure.label}: ${words.textContent}`);
  }
}

// What stands below a curve: the range in view, what is missing, and where it is cut off.
function wordsOf(curve, low, high, unit, factor) {
  if (curve.problem) return [curve.problem];
  if (!curve.rows.length) return ["no numbers to draw"];
  const said = [low === high ? `always ${digits(low)} ${unit}` : `${digits(low)} to ${digits(high)} ${unit}`];
  if (factor < 0) said.push("sign turned");
  const ends = [[curve.at_most, "largest", curve.most], [curve.at_least, "smallest", curve.least]];
  for (const [share, word, value] of curve.least < curve.most ? ends : []) {
    if (share > CUT_OFF) said.push(`${(100 * share).toPrecision(2)} % of the rows at its ${word} value ${digits(value * factor)}`);
  }
  if (curve.missing > 0) said.push(`${(100 * curve.missing).toPrecision(2)} % of the rows empty`);
  return [said.join("; ")];
}
