// Elements: make("button", { onclick: act, class: "main" }, "Text", child).
export function make(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made && typeof value === "boolean") made[name] = value;
    else if (name === "value") made.value = value;
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(name, value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

let count = 0;

// A labelled control: the label's text, and the control below it.
export function field(text, control, more = "") {
  control.id ||= `control-${count++}`;
  return make("div", { class: `field ${more}` }, make("label", { for: control.id }, text), control);
}

export function check(text, checked, onchange) {
  return make("label", { class: "check" }, make("input", { type: "checkbox", checked, onchange }), text);
}

export function choice(options, value, onchange) {
  const made = make("select", { onchange: () => onchange(made.value) },
    options.map(([key, text]) => make("option", { value: key, selected: key === value }, text)));
  return made;
}

// Replace what an element holds, and keep the focus where it was by the id of what had it.
export function fill(element, ...children) {
  const focused = element.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  element.replaceChildren(...children.flat().filter(Boolean));
  if (focused) element.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

export const digits = (value, most = 4) =>
  value === null || value === undefined ? "none" : String(Number(Number(value).toPrecision(most)));

// A line of the commands as a page says it: with quotation marks in place of those of code.
export const plain = (text) => text.replace(/`([^`]*)`/g, "“$1”");
