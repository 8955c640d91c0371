"use strict";

// One axis: from data to pixels and back, and where its ticks go.
class Scale {
  constructor(low, high, from, to, logarithmic) {
    this.logarithmic = logarithmic;
    this.low = low;
    this.high = high;
    this.from = from;
    this.to = to;
  }

  static forward(value, logarithmic) {
    return logarithmic ? Math.log10(value) : value;
  }

  pixel(value) {
    const [a, b] = [this.low, this.high].map((v) => Scale.forward(v, this.logarithmic));
    const part = (Scale.forward(value, this.logarithmic) - a) / (b - a);
    return this.from + part * (this.to - this.from);
  }

  holds(value) {
    return value >= this.low && value <= this.high;
  }

  value(pixel) {
    const part = (pixel - this.from) / (this.to - this.from);
    const [a, b] = [this.low, this.high].map((v) => Scale.forward(v, this.logarithmic));
    const inner = a + part * (b - a);
    return this.logarithmic ? 10 ** inner : inner;
  }

  ticks(count) {
    return this.logarithmic && this.high / this.low > 8 ? this.decades(count) : this.even(count);
  }

  even(count) {
    const rough = (this.high - this.low) / Math.max(count, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
    const first = Math.ceil(this.low / step - 1e-9);
    const last = Math.floor(this.high / step + 1e-9);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return Array.from({ length: last - first + 1 }, (_, n) => {
      const value = (first + n) * step;
      return { value, text: tickText(value, step, digits) };
    });
  }

  decades(count) {
    const [a, b] = [this.low, this.high].map((v) => Math.floor(Math.log10(v)));
    const stride = Math.max(1, Math.ceil((b - a) / count));
    const within = b - a <= 2 ? [1, 2, 5] : [1];
    const found = [];
    for (let decade = a; decade <= b; decade += stride) {
      for (const multiple of within) {
        const value = Number(`${multiple}e${decade}`);
        if (value >= this.low * 0.9999 && value <= this.high * 1.0001) found.push({ value, text: number(value) });
      }
    }
    return found;
  }

  // The range after zooming by `factor` about `centre` (both in data).
  zoomed(factor, centre) {
    const inner = (v) => Scale.forward(v, this.logarithmic);
    const outer = (v) => (this.logarithmic ? 10 ** v : v);
    const middle = inner(centre);
    return [this.low, this.high].map((end) => outer(middle + (inner(end) - middle) * factor));
  }
}

function tickText(value, step, digits) {
  const size = Math.max(Math.abs(value), step);
  if (size >= 1e5 || size < 1e-3) return number(Math.abs(value) < step / 2 ? 0 : value);
  return value.toFixed(digits);
}

function number(value, digits = 5) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 1) : value.toPrecision(digits);
  return text.replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "").replace("e+", "e");
}

// Smallest and largest of what an axis has to show, with a margin; never an empty range.
function extent(lists, logarithmic) {
  let low = Infinity;
  let high = -Infinity;
  for (const list of lists) {
    for (const value of list) {
      if (value === null || (logarithmic && value <= 0)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return logarithmic ? [0.1, 1] : [0, 1];
  if (logarithmic) {
    const margin = low === high ? 2 : (high / low) ** 0.04;
    return [low / margin, high * margin];
  }
  const margin = low === high ? Math.abs(low) * 0.1 || 0.5 : (high - low) * 0.04;
  return [low - margin, high + margin];
}
