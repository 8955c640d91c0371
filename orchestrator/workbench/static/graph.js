/* global label, shape */
// A scenario as a picture: a box for each FMU, inputs left, outputs right, and a wire for each connection.
const WIDE = 270, LINE = 22, HEAD = 30, MOST = 12, GAP = 60, ROOM = 18;
const LANES = 9, LANE = 4;  // wires that run beside each other in a gap, and the width of one

// Whether an output may be connected to an input: kinds of numbers that convert, and units of one quantity.
export function fits(from, to) {
  const number = (one) => (["Real", "Integer"].includes(one.type) ? "number" : one.type);
  return number(from) === number(to) && (!from.quantity || !to.quantity || from.quantity === to.quantity);
}

export const inputsOf = (node) => node.variables.filter((one) => one.causality === "input");
export const outputsOf = (node) => node.variables.filter((one) => one.causality === "output");

// `nodes`: { name: { variables } }; `connections`: [{ from, to }].
export class Graph {
  svg = shape("svg", { class: "graph", role: "img" });

  draw(nodes, connections) {
    this.ports = new Map();
    const places = Object.values(nodes).map((node, n) => ({ node, ...place(n) }));
    const boxes = Object.keys(nodes).map((name, n) => this.box(name, places[n]));
    const right = Math.max(600, ...places.map(({ x }) => x + WIDE + GAP));
    const low = Math.max(120, ...places.map(({ y, node }) => y + this.height(node) + 20));
    this.svg.setAttribute("viewBox", `0 0 ${right} ${low}`);
    this.svg.style.width = `${right}px`;
    this.svg.setAttribute("aria-label", `Scenario: ${Object.keys(nodes).join(", ") || "no FMU yet"}; ` +
      (connections.map(({ from, to }) => `${from} to ${to}`).join("; ") || "nothing is connected"));
    this.svg.replaceChildren(...boxes, ...connections.map(({ from, to }, n) => this.line(from, to, n)).filter(Boolean));
  }

  height(node) {
    return HEAD + LINE * Math.max(1, Math.min(MOST + 1, inputsOf(node).length), Math.min(MOST + 1, outputsOf(node).length)) + 8;
  }

  box(name, { node, x, y }) {
    const made = shape("g", { transform: `translate(${x} ${y})` });
    made.append(shape("rect", { class: "node", width: WIDE, height: this.height(node), rx: 8 }));
    const title = label(WIDE / 2, 20, name, "middle");
    title.setAttribute("class", "title");
    made.append(title);
    for (const [side, list] of [["to", inputsOf(node)], ["from", outputsOf(node)]]) {
      list.slice(0, MOST).forEach((one, n) => made.append(this.port(`${name}.${one.name}`, { x, y }, one, side, n)));
      if (list.length > MOST) {
        const more = label(side === "to" ? 12 : WIDE - 12, HEAD + LINE * MOST + 15, `${list.length - MOST} more`, side === "to" ? "start" : "end");
        more.setAttribute("class", "more");
        made.append(more);
      }
    }
    return made;
  }

  port(key, box, one, side, n) {
    const x = side === "to" ? 0 : WIDE, y = HEAD + LINE * n + 10;
    const made = shape("g", { class: "port", "data-port": key });
    const dot = shape("circle", { cx: x, cy: y, r: 7 });
    const label = shape("text", { x: side === "to" ? 13 : WIDE - 13, y: y + 4, "text-anchor": side === "to" ? "start" : "end" });
    const unit = one.unit && one.unit !== "1" ? ` [${one.unit}]` : "", most = ROOM - unit.length;
    label.textContent = (one.name.length > most ? `…${one.name.slice(1 - most)}` : one.name) + unit;
    const title = shape("title");
    title.textContent = `${key}${one.unit ? ` [${one.unit}]` : ""}: ${one.description || one.causality}`;
    made.append(title, dot, label);
    this.ports.set(key, { x: box.x + x, y: box.y + y, top: box.y });
    return made;
  }

  line(from, to, n) {
    const [a, b] = [this.ports.get(from), this.ports.get(to)];
    return a && b ? shape("path", { class: "wire", d: route(a, b, 8 + LANE * (n % LANES)) }) : null;
  }
}

const place = (n) => ({ x: GAP + (n % 3) * (WIDE + GAP), y: GAP + Math.floor(n / 3) * (HEAD + LINE * (MOST + 1) + GAP) });

// A wire to the next column bends in the gap between both; any other one runs in the gaps, past no name of a port.
function route(a, b, lane) {
  if (b.x - a.x === GAP) return `M${a.x} ${a.y} C${a.x + GAP} ${a.y} ${b.x - GAP} ${b.y} ${b.x} ${b.y}`;
  return `M${a.x} ${a.y} h${lane} V${b.top - lane} H${b.x - lane} V${b.y} H${b.x}`;
}
