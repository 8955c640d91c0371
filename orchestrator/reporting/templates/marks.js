// Paths of curves, clouds and intervals. `x` and `y` are the plot's scales.
const round = (pixel) => Math.round(pixel * 10) / 10;

class Marks {
  constructor(plot) {
    this.x = plot.x;
    this.y = plot.y;
    this.several = plot.data.series.length > 1;
  }

  // Elements of a series.
  of(series, stroke) {
    const made = [];
    if (series.low) made.push(shape("path", { d: this.whiskers(series), stroke, "stroke-width": 1, fill: "none" }));
    if (series.kind === "points") made.push(shape("path", { d: this.dots(series), fill: stroke }));
    else made.push(shape("path", { d: this.curve(series), stroke, class: series.name === "measured" && this.several ? "curve broad" : "curve" }));
    return made;
  }

  at(series, n) {
    const [x, y] = [series.x[n], series.y[n]];
    if (Number.isNaN(x) || Number.isNaN(y)) return null;
    if ((this.x.logarithmic && x <= 0) || (this.y.logarithmic && y <= 0)) return null;
    return [round(this.x.pixel(x)), round(this.y.pixel(y))];
  }

  // A curve: each row where there are few in view, else blocks of rows from their smallest to their largest value.
  curve(series) {
    if (!series.ascending) return this.rows(series, 0, series.x.length);
    const first = Math.max(0, firstAtLeast(series.x, this.x.low) - 1);
    const end = Math.min(series.x.length, firstAtLeast(series.x, this.x.high) + 1);
    const pixels = this.x.to - this.x.from;
    const size = Math.ceil((end - first) / pixels);
    return size > 3 ? this.blocks(series, size, first, end) : this.rows(series, first, end);
  }

  rows(series, first, end) {
    const parts = [];
    let pen = false;
    for (let n = first; n < end; n++) {
      const place = this.at(series, n);
      if (!place) {
        pen = false;
      } else {
        if (pen && series.kind === "steps") parts.push("H", place[0]);
        parts.push(pen ? "L" : "M", place[0], " ", place[1]);
        pen = true;
      }
    }
    return parts.join("");
  }

  // Blocks begin at multiples of their size, so that they stay the same where the view moves.
  blocks(series, size, first, end) {
    const parts = [];
    let [pen, last] = [false, 0];
    for (let start = first - (first % size); start < end; start += size) {
      let [least, most] = [NaN, NaN];
      for (let n = start; n < Math.min(start + size, series.y.length); n++) {
        const value = series.y[n];
        if (!(least <= value) && !Number.isNaN(value)) least = value;
        if (!(most >= value) && !Number.isNaN(value)) most = value;
      }
      if (Number.isNaN(most) || (this.y.logarithmic && most <= 0)) {
        pen = false;
        continue;
      }
      const bottom = this.y.logarithmic && least <= 0 ? this.y.low : least;
      const ends = [bottom, most].map((value) => round(this.y.pixel(value)));
      const [from, to] = Math.abs(ends[0] - last) <= Math.abs(ends[1] - last) ? ends : ends.reverse(); // a slope has no teeth
      parts.push(pen ? "L" : "M", round(this.x.pixel(series.x[start])), " ", from);
      if (to !== from || !pen) parts.push("V", to);
      [pen, last] = [true, to];
    }
    return parts.join("");
  }

  dots(series) {
    const places = Array.from(series.x, (_, n) => this.at(series, n)).filter(Boolean);
    const radius = places.length > 400 ? 2 : 3.5;
    return places.map(([x, y]) => `M${x - radius} ${y}a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`).join("");
  }

  whiskers(series) {
    const parts = [];
    for (let n = 0; n < series.x.length; n++) {
      const [x, end, high] = [series.x[n], series.low[n], series.high[n]];
      if (Number.isNaN(x + end + high) || (this.y.logarithmic && high <= 0)) continue;
      const low = this.y.logarithmic && end <= 0 ? this.y.low : end; // a logarithmic axis has no zero to reach down to
      parts.push(`M${round(this.x.pixel(x))} ${round(this.y.pixel(low))}V${round(this.y.pixel(high))}`);
    }
    return parts.join("");
  }
}
