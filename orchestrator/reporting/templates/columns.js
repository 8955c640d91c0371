// Columns of numbers as a page carries them (docs/reports.md, "Data of a plot").

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
