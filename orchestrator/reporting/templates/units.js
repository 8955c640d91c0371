// The unit in which a page shows angles: pages hold radians, the reader chooses.
const ANGLES = { rad: 1, deg: 180 / Math.PI, arcmin: 10800 / Math.PI, turns: 0.5 / Math.PI };
const ANGULAR = /^rad(\/s2?|\/s²)?$/;

class Units {
  static chosen = document.documentElement.dataset.angle ?? "rad";
  static listeners = [];

  // Factor and name with which a quantity in `unit` is shown.
  static shown(unit, chosen = Units.chosen) {
    const found = ANGULAR.exec(unit ?? "");
    return found ? { factor: ANGLES[chosen], name: chosen + (found[1] ?? "") } : { factor: 1, name: unit };
  }

  static choose(name) {
    Units.chosen = name;
    Units.listeners.forEach((listener) => listener());
  }

  // A label such as "angle [rad]" with the unit that is shown.
  static label(text) {
    return text.replace(/\[([^\]]*)\]$/, (_, unit) => `[${Units.shown(unit).name}]`);
  }

  static ofLabel(text) {
    return /\[([^\]]*)\]$/.exec(text)?.[1] ?? "";
  }
}

// Numbers that are no percentages.
const AMOUNT = /(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\d.]* %)/gi;

// What follows the choice: elements with `data-unit`, whose text is in that unit, or which show `data-value`.
function followUnits(element) {
  const original = element.textContent;
  const { unit, value, digits } = element.dataset;
  Units.listeners.push(() => {
    const { factor, name } = Units.shown(unit);
    if (factor === 1) element.textContent = original;
    else if (value !== undefined) element.textContent = number(Number(value) * factor, Number(digits));
    else {
      const amounts = original.replace(AMOUNT, (text) => number(Number(text) * factor, converted(text)));
      element.textContent = amounts.replace(unit, name);
    }
  });
}

// Digits of a number that was rounded to those of `text` and is then converted: the last of many would not be right.
function converted(text) {
  const significant = text.replace(/e.*$/i, "").replace(/^[-+]?0*\.?0*/, "").replace(".", "").length;
  return Math.max(2, significant > 4 ? significant - 1 : significant);
}

// The switch; a page without angles has none.
function unitSwitch(select) {
  document.querySelectorAll("[data-unit]").forEach(followUnits);
  document.querySelectorAll("[data-label]").forEach(({ dataset }) => {
    const original = dataset.label;
    Units.listeners.push(() => (dataset.label = Units.label(original)));
  });
  const angular = [...document.querySelectorAll("[data-unit]")].some(({ dataset }) => ANGULAR.test(dataset.unit));
  if (!angular && !Plot.all.some((plot) => plot.isAngular())) return;
  select.parentElement.hidden = false;
  select.append(...Object.keys(ANGLES).map((name) => make("option", { value: name }, name)));
  select.value = Units.chosen;
  select.addEventListener("change", () => Units.choose(select.value));
  if (Units.chosen !== "rad") Units.choose(Units.chosen);
}
