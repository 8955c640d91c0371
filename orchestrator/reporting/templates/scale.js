"use strict";

// One axis: from data to pixels and back, and where its ticks go.
class Scale {
  constructor(low, high, from, to, logarithmic, factor = 1) {
    Object.assign(this, { low, high, from, to, logarithmic, factor });  // `factor`: of the unit that is shown
    [this.inner, this.outer] = logarithmic ? [Math.log10, (v) => 10 ** v] : [Number, Number];
    [this.a, this.b] = [low, high].map(this.inner);
  }

  pixel(value) {
    return this.from + ((this.inner(value) - this.a) / (this.b - this.a)) * (this.to - this.from);
  }

  holds(value) {
    return value >= this.low && value <= this.high;
  }

  value(pixel) {
    return this.outer(this.a + ((pixel - this.from) / (this.to - this.from)) * (this.b - this.a));
  }

  ticks(count) {
    const [low, high] = [this.low * this.factor, this.high * this.factor];
    const shown = this.logarithmic && high / low > 8 ? Scale.decades(low, high, count) : Scale.even(low, high, count);
    return shown.map(({ value, text }) => ({ value: value / this.factor, text }));
  }

  static even(low, high, count) {
    const rough = (high - low) / Math.max(count, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
    const first = Math.ceil(low / step - 1e-9);
    const last = Math.floor(high / step + 1e-9);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return Array.from({ length: last - first + 1 }, (_, n) => {
      const value = (first + n) * step;
      return { value, text: tickText(value, step, digits) };
    });
  }

  static decades(low, high, count) {
    const [a, b] = [low, high].map((v) => Math.floor(Math.log10(v)));
    const stride = Math.max(1, Math.ceil((b - a) / count));
    const within = b - a <= 2 ? [1, 2, 5] : [1];
    const found = [];
    for (let decade = a; decade <= b; decade += stride) {
      for (const multiple of within) {
        const value = Number(`${multiple}e${decade}`);
        if (value >= low * 0.9999 && value <= high * 1.0001) found.push({ value, text: number(value) });
      }
    }
    return found;
  }

  // The range after moving by `part` of its width.
  moved(part) {
    return [this.a, this.b].map((end) => this.outer(end + part * (this.b - this.a)));
  }

  // The range after zooming by `factor` about `centre` (both in data).
  zoomed(factor, centre) {
    const middle = this.inner(centre);
    return [this.a, this.b].map((end) => this.outer(middle + (end - middle) * factor));
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
  if (size >= 1e-4 && size < 1e6) return String(Number(value.toPrecision(digits)));
  return value.toExponential(digits - 1).replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "").replace("e+", "e");
}

// Smallest and largest of what an axis has to show, with a margin; never an empty range.
function extent(lists, logarithmic) {
  let low = Infinity;
  let high = -Infinity;
  for (const list of lists) {
    for (const value of list) {
      if (logarithmic && value <= 0) continue; // NaN is neither less nor more
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
