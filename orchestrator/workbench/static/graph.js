/* global label, shape */
// A scenario as a graph: a box for each FMU, inputs left, outputs right; an output is dragged to an input.
const WIDE = 270, LINE = 22, HEAD = 30, MOST = 12, GAP = 60, ROOM = 18;

// Whether an output may be connected to an input: kinds of numbers that convert, and units of one quantity.
export function fits(from, to) {
  const number = (one) => (["Real", "Integer"].includes(one.type) ? "number" : one.type);
  return number(from) === number(to) && (!from.quantity || !to.quantity || from.quantity === to.quantity);
}

export const inputsOf = (node) => node.variables.filter((one) => one.causality === "input");
export const outputsOf = (node) => node.variables.filter((one) => one.causality === "output");

// `nodes`: { name: { variables, x, y } }; `connections`: [{ from, to }]; `connect(from, to)` is called at a drop.
export class Graph {
  constructor(connect, moved) {
    this.connect = connect;
    this.moved = moved;
    this.svg = shape("svg", { class: "graph", role: "img" });
    this.dragged = null;
    this.svg.addEventListener("pointermove", (event) => this.move(event));
    this.svg.addEventListener("pointerup", (event) => this.drop(event));
    this.svg.addEventListener("pointercancel", () => { this.dragged = null; this.draw(this.nodes, this.connections); });
  }

  draw(nodes, connections) {
    Object.assign(this, { nodes, connections, ports: new Map() });
    const boxes = Object.entries(nodes).map(([name, node]) => this.box(name, node));
    const right = Math.max(600, ...Object.values(nodes).map((node) => node.x + WIDE + 20));
    const low = Math.max(120, ...Object.values(nodes).map((node) => node.y + this.height(node) + 20));
    this.svg.setAttribute("viewBox", `0 0 ${right} ${low}`);
    this.svg.style.width = `${right}px`;
    this.svg.setAttribute("aria-label", `Scenario: ${Object.keys(nodes).join(", ") || "no FMU yet"}; ` +
      (connections.map(({ from, to }) => `${from} to ${to}`).join("; ") || "nothing is connected"));
    this.wire = shape("path", { class: "wire new" });
    this.svg.replaceChildren(...boxes, ...connections.map(({ from, to }) => this.line(from, to)).filter(Boolean), this.wire);
  }

  height(node) {
    return HEAD + LINE * Math.max(1, Math.min(MOST + 1, inputsOf(node).length), Math.min(MOST + 1, outputsOf(node).length)) + 8;
  }

  box(name, node) {
    const made = shape("g", { transform: `translate(${node.x} ${node.y})` });
    made.append(shape("rect", { class: "node", width: WIDE, height: this.height(node), rx: 8 }));
    const title = label(WIDE / 2, 20, name, "middle");
    title.setAttribute("class", "title");
    const grip = shape("rect", { class: "grip", width: WIDE, height: HEAD, rx: 8 });
    grip.addEventListener("pointerdown", (event) => this.take(event, { node, dx: node.x - this.at(event).x, dy: node.y - this.at(event).y }));
    made.append(title, grip);
    for (const [side, list] of [["to", inputsOf(node)], ["from", outputsOf(node)]]) {
      list.slice(0, MOST).forEach((one, n) => made.append(this.port(name, node, one, side, n)));
      if (list.length > MOST) {
        const more = label(side === "to" ? 12 : WIDE - 12, HEAD + LINE * MOST + 15, `${list.length - MOST} more`, side === "to" ? "start" : "end");
        more.setAttribute("class", "more");
        made.append(more);
      }
    }
    return made;
  }

  port(name, node, one, side, n) {
    const x = side === "to" ? 0 : WIDE, y = HEAD + LINE * n + 10, key = `${name}.${one.name}`;
    const made = shape("g", { class: `port ${side}`, "data-port": key });
    const dot = shape("circle", { cx: x, cy: y, r: 7 });
    const label = shape("text", { x: side === "to" ? 13 : WIDE - 13, y: y + 4, "text-anchor": side === "to" ? "start" : "end" });
    const unit = one.unit && one.unit !== "1" ? ` [${one.unit}]` : "", most = ROOM - unit.length;
    label.textContent = (one.name.length > most ? `…${one.name.slice(1 - most)}` : one.name) + unit;
    const title = shape("title");
    title.textContent = `${key}${one.unit ? ` [${one.unit}]` : ""}: ${one.description || one.causality}`;
    made.append(title, dot, label);
    this.ports.set(key, { one, side, x: node.x + x, y: node.y + y, element: made });
    if (side === "from") made.addEventListener("pointerdown", (event) => this.take(event, { from: key }));
    return made;
  }

  line(from, to) {
    const [a, b] = [this.ports.get(from), this.ports.get(to)];
    return a && b ? shape("path", { class: "wire", d: curve(a, b) }) : null;
  }

  at(event) {
    const point = new DOMPoint(event.clientX, event.clientY);
    return point.matrixTransform(this.svg.getScreenCTM().inverse());
  }

  take(event, what) {
    event.preventDefault();
    this.dragged = what;
    this.svg.setPointerCapture(event.pointerId);
    if (!what.from) return;
    const { one } = this.ports.get(what.from);
    for (const port of this.ports.values()) {
      if (port.side === "to") port.element.classList.add(fits(one, port.one) ? "fits" : "misfits");
    }
  }

  move(event) {
    if (!this.dragged) return;
    const { x, y } = this.at(event);
    if (this.dragged.from) this.wire.setAttribute("d", curve(this.ports.get(this.dragged.from), { x, y }));
    else {
      const { node, dx, dy } = this.dragged;
      node.x = Math.max(10, x + dx);
      node.y = Math.max(10, y + dy);
      this.draw(this.nodes, this.connections);
    }
  }

  drop(event) {
    const dragged = this.dragged;
    this.dragged = null;
    if (!dragged) return;
    if (!dragged.from) { this.moved(); return; }
    const { x, y } = this.at(event);
    const near = [...this.ports].filter(([, port]) => port.side === "to" && x - port.x > -25 && x - port.x < 130 && Math.abs(y - port.y) < LINE / 2);
    this.draw(this.nodes, this.connections);
    if (near.length) this.connect(dragged.from, near[0][0]);
  }
}

export function place(count) {
  return { x: 20 + (count % 3) * (WIDE + GAP), y: 20 + Math.floor(count / 3) * 240 };
}

function curve(a, b) {
  const bend = Math.max(40, Math.abs(b.x - a.x) / 2);
  return `M${a.x} ${a.y} C${a.x + bend} ${a.y} ${b.x - bend} ${b.y} ${b.x} ${b.y}`;
}
