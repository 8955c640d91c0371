import { field, fill, table } from "./dom.js";

const MOST = 300;  // variables of one table
const HEADS = ["variable", "causality", "type", "start", "unit", "limits", "description"];

// The parts of a name: at its points, but not at those within brackets or quotes, as in der(a.b) and a[1.2].
export const partsOf = (name) => name.match(/(?:\((?:[^()]|\([^()]*\))*\)|\[[^\]]*\]|'[^']*'|[^.])+/g) ?? [name];

// Variables as a tree, with a field that finds some of them.
export function drawTree(variables) {
  const words = make("input", { type: "search", oninput: () => list() }), place = make("div", {});
  const all = variables.map((one) => ({ ...one, parts: partsOf(one.name) }));
  const list = () => {
    const text = words.value.trim().toLowerCase();
    const shown = all.filter((one) => !text || `${one.name} ${one.description} ${one.causality}`.toLowerCase().includes(text));
    fill(place, branch(shown, 0, text !== ""), shown.length ? null : make("p", { class: "note" }, "no variable has these words"));
  };
  list();
  return [field("Find a variable", words), place];
}

// Variables by the parts of their names; of a large branch what stands below it comes when it is opened.
function branch(variables, depth, open) {
  const groups = Map.groupBy(variables, (one) => (one.parts.length > depth + 1 ? one.parts[depth] : ""));
  const leaves = groups.get("") ?? [];
  groups.delete("");
  return [
    ...[...groups].map(([name, inside]) => {
      const body = make("div", { class: "branch" });
      const grow = () => { if (made.open && !body.childElementCount) body.append(...branch(inside, depth + 1, open)); };
      const made = make("details", { open: open && inside.length < 60, ontoggle: grow }, make("summary", {}, `${name} (${inside.length})`), body);
      grow();
      return made;
    }),
    leaves.length ? leafTable(leaves.slice(0, MOST)) : null,
    leaves.length > MOST ? make("p", { class: "note" }, `${leaves.length - MOST} more: find them by their names`) : null,
  ].filter(Boolean);
}

function leafTable(leaves) {
  const bound = (limit, words) => (limit === null || Math.abs(limit) > 1e11 ? "" : `${words} ${limit}`);
  const range = (one) => [bound(one.minimum, "from"), bound(one.maximum, "to")].join(" ").trim();
  const above = leaves[0].parts.slice(0, -1).join(".");
  return table(above ? `Variables of ${above}` : "Variables", HEADS, leaves.map((one) => [
    one.name, one.causality, one.items.length ? one.items.join(", ") : one.type, make("td", { class: "number" }, one.start === null ? "" : String(one.start)),
    one.unit, range(one), make("td", { class: "long" }, one.description)]), "plain");
}
