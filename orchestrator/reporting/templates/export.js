// What a plot shows, to keep: its picture as SVG, its numbers as CSV.

function save(plot, ending, kind, content) {
  const name = plot.data.title.replace(/[^\p{L}\p{N}]+/gu, "-").toLowerCase();
  const link = make("a", { href: URL.createObjectURL(new Blob([content], { type: kind })), download: `${name}.${ending}` });
  link.click();
  URL.revokeObjectURL(link.href);
}

// The picture stands alone: colours as they are shown, and above it the title and the names of the curves.
function savePicture(plot) {
  const { svg } = plot, copy = svg.cloneNode(true), [, , width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
  const shown = [svg, ...svg.querySelectorAll("*")], copies = [copy, ...copy.querySelectorAll("*")];
  shown.forEach((one, n) => {
    const style = getComputedStyle(one);
    for (const name of ["fill", "fill-opacity", "stroke", "stroke-opacity", "stroke-width", "stroke-dasharray", "font-size", "font-family"]) {
      copies[n].removeAttribute(name);
      copies[n].style[name] = style[name];
    }
  });
  const head = 22 * (1 + plot.visible().length), paper = getComputedStyle(document.body);
  const swatches = [...plot.legend.querySelectorAll("button i")].map((one) => getComputedStyle(one).backgroundColor);
  const write = (text, line, fill) => shape("text", { x: 10, y: 22 * (line + 1) - head - 6, style: `fill:${fill};font:14px sans-serif` }, text);
  copy.prepend(shape("rect", { y: -head, width, height: height + head, style: `fill:${paper.backgroundColor}` }),
    write(plot.data.title, 0, paper.color), ...plot.visible().map(({ series, n }, line) => write(series.name, line + 1, swatches[n])));
  for (const [name, value] of Object.entries({ width, height: height + head, viewBox: `0 ${-head} ${width} ${height + head}`, style: "" })) copy.setAttribute(name, value);
  save(plot, "svg", "image/svg+xml", new XMLSerializer().serializeToString(copy));
}

// The rows in view of each curve that is shown, in the units that are shown.
function saveNumbers(plot) {
  const { x, y } = plot, quoted = (text) => `"${text.replaceAll('"', '""').replace(/^[=+@-]/, "'$&")}"`;  // no formula of a spreadsheet
  const lines = [["curve", Units.label(plot.data.xLabel), Units.label(plot.data.yLabel), "low", "high"].map(quoted).join(",")];
  for (const { series } of plot.visible()) {
    const at = (column, n) => (column && !Number.isNaN(column[n]) ? column[n] * y.factor : "");
    for (let n = 0; n < series.x.length; n++) {
      const where = plot.data.categories[series.x[n]];
      if (x.holds(series.x[n])) lines.push([quoted(series.name), where === undefined ? series.x[n] * x.factor : quoted(where), at(series.y, n), at(series.low, n), at(series.high, n)].join(","));
    }
  }
  save(plot, "csv", "text/csv", `${lines.join("\n")}\n`);
}
