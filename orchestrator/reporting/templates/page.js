// Tables that sort: a button in every heading.
function sortable(table) {
  const body = table.tBodies[0];
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    const cells = [...body.rows].map((row) => row.cells[column]);
    if (cells.length && cells.every((cell) => cell.classList.contains("number") || cell.dataset.key === "")) {
      heading.classList.add("number");
      cells.forEach((cell) => cell.classList.add("number"));
    }
    const button = make("button", { type: "button" });
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") === "ascending";
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
      sortRows(body, column, down ? -1 : 1);
    });
  });
}

// Missing values go last in either direction.
function sortRows(body, column, sign) {
  const key = (row) => row.cells[column].dataset.key;
  const numeric = [...body.rows].every((row) => key(row) === "" || !Number.isNaN(Number(key(row))));
  const compare = (a, b) => {
    const [first, second] = [key(a), key(b)];
    if (first === "" || second === "") return (first === "") - (second === "");
    return sign * (numeric ? first - second : first.localeCompare(second));
  };
  body.append(...[...body.rows].sort(compare));
}

document.querySelectorAll("table.sortable").forEach(sortable);
document.querySelectorAll("figure.plot").forEach((figure) => new Plot(figure));
unitSwitch(document.getElementById("units"));

// Paper shows what is folded, and a link into a fold opens it.
function openFolds(folds) {
  folds.forEach((fold) => (fold.open = true));
  return folds;
}

let opened = [];
addEventListener("beforeprint", () => (opened = openFolds([...document.querySelectorAll("details.fold:not([open])")])));
addEventListener("afterprint", () => opened.forEach((fold) => (fold.open = false)));
addEventListener("hashchange", () => {
  const fold = document.getElementById(location.hash.slice(1))?.closest("details.fold");
  if (fold) openFolds([fold]);
});
