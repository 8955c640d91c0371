// Columns of numbers as a page carries them (docs/reports.md, "Data of a plot"), and their levels of detail.

// A column as numbers; NaN leaves a gap. `earlier` are the plot's columns so far, for those that are told once.
function decodeColumn(column, earlier = []) {
  if (column === undefined || column === null) return null;
  if (ArrayBuffer.isView(column)) return column;
  if (Array.isArray(column)) return Float64Array.from(column, (value) => value ?? NaN);
  if ("of" in column) return earlier[column.of];
  if ("step" in column) return Float64Array.from({ length: column.count }, (_, n) => column.start + n * column.step);
  if ("f8" in column) return new Float64Array(decodeBytes(column.f8).buffer);
  const small = new Float32Array(decodeBytes(column.f4).buffer);
  return column.offset ? Float64Array.from(small, (value) => value + column.offset) : small;
}

function decodeBytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const made = new Uint8Array(raw.length);
  for (let n = 0; n < raw.length; n++) made[n] = raw.charCodeAt(n);
  return made;
}

function isAscending(values) {
  for (let n = 1; n < values.length; n++) if (!(values[n] >= values[n - 1])) return false;
  return true;
}

// The first index whose value is at least `wanted`, of ascending values.
function firstAtLeast(values, wanted) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

// Smallest and largest values of blocks of 8, 16, 32, ... rows: a curve of any length is drawn from a few thousand.
class Pyramid {
  static LEAST = 8;

  constructor(values) {
    this.levels = [Pyramid.base(values)];
    while (this.levels.at(-1).low.length > 512) this.levels.push(Pyramid.above(this.levels.at(-1)));
  }

  static base(values) {
    const count = Math.ceil(values.length / Pyramid.LEAST);
    const [low, high] = [new Float64Array(count), new Float64Array(count)];
    for (let block = 0; block < count; block++) {
      let [least, most] = [NaN, NaN];
      const end = Math.min((block + 1) * Pyramid.LEAST, values.length);
      for (let n = block * Pyramid.LEAST; n < end; n++) {
        const value = values[n];
        if (Number.isNaN(value)) continue;
        if (!(least <= value)) least = value;
        if (!(most >= value)) most = value;
      }
      low[block] = least;
      high[block] = most;
    }
    return { size: Pyramid.LEAST, low, high };
  }

  static above({ size, low, high }) {
    const count = Math.ceil(low.length / 2);
    const made = { size: 2 * size, low: new Float64Array(count), high: new Float64Array(count) };
    for (let n = 0; n < count; n++) {
      const [a, b] = [2 * n, Math.min(2 * n + 1, low.length - 1)];
      made.low[n] = low[b] < low[a] || Number.isNaN(low[a]) ? low[b] : low[a];
      made.high[n] = high[b] > high[a] || Number.isNaN(high[a]) ? high[b] : high[a];
    }
    return made;
  }

  // The finest level that shows `rows` rows in at most `most` blocks.
  level(rows, most) {
    return this.levels.find(({ size }) => rows / size <= most) ?? this.levels.at(-1);
  }
}
