let count = 0;

// A labelled control: the label's text, and the control below it.
export function field(text, control, more = "") {
  control.id ||= `control-${count++}`;
  return make("div", { class: `field ${more}` }, make("label", { for: control.id }, text), control);
}

export function check(text, checked, onchange) {
  return make("label", { class: "check" }, make("input", { type: "checkbox", checked, onchange }), text);
}

// A field for a number, with a point or a comma; `taken` gets it, or null where the field was emptied and is not required.
export function numberInput(attributes, taken, able = () => true) {
  const made = make("input", { class: "number", inputmode: "decimal", ...attributes, onchange: () => {
    const number = numberIn(made), wrong = number === null ? made.required : !(Number.isFinite(number) && able(number));
    made.setAttribute("aria-invalid", String(wrong));
    if (!wrong) taken?.(number);
  } });
  return made;
}

export const numberIn = (input) => (input.value.trim() === "" ? null : Number(input.value.trim().replace(",", ".")));

// What a page says of a field that holds no number which can be meant, null where there is none.
export function wrongField(place) {
  const input = [...place.querySelectorAll('[aria-invalid="true"]:enabled')].find((one) => one.offsetParent);
  if (!input) return null;
  return { input, said: `“${input.labels?.[0]?.textContent ?? input.getAttribute("aria-label")}” must hold a number that makes sense there, but is “${input.value}”` };
}

export function choice(options, value, onchange) {
  const made = make("select", { onchange: () => onchange(made.value) },
    options.map(([key, text]) => make("option", { value: key, selected: key === value }, text)));
  return made;
}

// What can have the focus below an element, each under a key that the same control has after it was made anew.
function controlsOf(element) {
  const seen = new Map();
  return [...element.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex]")].map((one) => {
    const key = one.dataset.key ?? `${one.tagName} ${one.getAttribute("aria-label") ?? one.labels?.[0]?.textContent ?? one.textContent}`;
    seen.set(key, (seen.get(key) ?? 0) + 1);
    return { one, key: `${key} ${seen.get(key)}` };
  });
}

// Replace what an element holds; the focus stays where it was, what was unfolded stays so, and the page does not scroll.
export function fill(element, ...children) {
  const before = controlsOf(element);
  const focused = before.find(({ one }) => one === document.activeElement)?.key;
  const unfolded = new Set(before.filter(({ one }) => one.tagName === "SUMMARY" && one.parentElement.open).map(({ key }) => key));
  element.replaceChildren(...children.flat().filter(Boolean));
  for (const { one, key } of controlsOf(element)) {
    if (unfolded.has(key) && one.tagName === "SUMMARY") one.parentElement.open = true;
    if (key === focused) one.focus({ preventScroll: true });
  }
}

// A table that scrolls where it is too wide; a row is a list of its cells, texts or `td`s.
export function table(name, heads, rows, kind = "stack") {
  const cell = (one, n) => (one instanceof Node ? one : make("td", { "data-label": n ? heads[n] : null }, one));
  return make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": name }, make("table", { class: kind },
    make("thead", {}, make("tr", {}, heads.map((text) => make("th", { scope: "col" }, text)))),
    make("tbody", {}, rows.map((row) => make("tr", {}, row.map(cell))))));
}

export const digits = (value, most = 4) =>
  value === null || value === undefined ? "none" : String(Number(Number(value).toPrecision(most)));
