import { post } from "./api.js";
import { choice, digits, field, fill, make, numberInput, plain } from "./dom.js";
import { action, dropZone, fileChoice, isLog, jobView, message, resultOf } from "./parts.js";
import { choices, choose, jobOf, noteColumns, session, start, state, stated, watch } from "./state.js";

const TITLES = { time: "Time", u: "Torque asked for", theta_m: "Motor angle", theta_l: "Load angle" };
const UNITS = {
  time: ["s", "ms", "us", "min"],
  u: ["N.m", "mN.m", "N.mm", "lbf.in", "N", "A", "%", "p.u.", "V"],
  theta_m: ["rad", "deg", "arcmin", "rev", "counts", "m", "mm", "rpm", "rad/s"],
  theta_l: ["rad", "deg", "arcmin", "rev", "counts", "m", "mm", "rpm", "rad/s"],
};
// Numbers that a unit may ask for, with what they mean.
const NUMBERS = {
  torque_constant: "torque constant [N.m/A]", rated_value: "what 100 % is [N.m]", counts_per_rev: "counts per revolution",
  resistance: "resistance of the winding [ohm]", back_emf_constant: "back-EMF constant [V.s/rad]", inductance: "inductance [H]",
  rate: "samples per second", factor: "factor (-1 turns the sign)", modulo: "the counter starts again at",
  sign_bit: "one bit is the sign; its value",
};
const OF_COLUMN = {
  time: ["rate"], u: ["torque_constant", "rated_value", "resistance", "back_emf_constant", "sign_bit", "modulo", "factor"],
  theta_m: ["counts_per_rev", "modulo", "sign_bit", "factor"], theta_l: ["counts_per_rev", "modulo", "sign_bit", "factor"],
};

export function build(panel, go) {
  const said = message(), changes = make("p", { class: "message calm", role: "status" });
  const busy = make("p", { class: "note busy", role: "status" }), body = make("div", {}), rows = make("div", {});
  let seen = null, turn = 0, looked = "", came = null, looking = null;
  const view = jobView("log", (job) => {
    const place = make("div", {});
    resultOf(job).then((found) => fill(place, advised((found?.verdict ?? job.messages).join(" "))));
    return job.state === "done" ? [place, make("p", {}, action("Go on to the machine", said, () => go("machine")))] : place;
  });
  let log = "";
  const follow = () => {  // whichever tab, or page, has chosen another log or other columns
    const now = JSON.stringify([choices.log, stated()]);
    if (now === looked) return;
    looked = now;
    if (log !== choices.log) {
      seen = came = null;
      const of = session.jobs.filter((job) => job.command === "inspect" && job.asked.inputs?.[0] === choices.log).at(-1);
      if (jobOf(view.name())?.asked.inputs[0] !== choices.log) choose({ shown: { log: of?.name ?? null } });
    }
    log = choices.log;
    looking = look();
  };
  watch(() => {
    const job = jobOf(view.name());
    const made = job && `results/${job.name}/model.toml`;
    if (job && job.asked.inputs[0] !== choices.log) return;
    if (job?.state === "done" && job.files.includes("model.toml") && choices.given !== job.name) choose({ model: made, given: job.name });
  });

  const asked = () => ({ columns: stated().columns, ...(stated().header === null ? {} : { header: stated().header }) });

  async function look() {
    const mine = ++turn;
    if (!choices.log) { clear(); busy.textContent = ""; return; }
    said.say("");
    busy.textContent = "Reading …";
    try {
      const found = await post("columns", { file: choices.log, ...asked() });
      if (mine !== turn) return;
      changes.textContent = seen ? differences(seen, found) : "";
      seen = found;
      draw();
    } catch (error) {
      if (mine === turn) { said.say(error.message); if (!seen) clear(); }
    }
    if (mine === turn) busy.textContent = "";
  }

  function clear() {
    fill(body);
    fill(rows);
  }

  function pick(log) {
    if (log !== choices.log) choose({ log, model: "" });
  }

  function change(column, changed) {
    const entry = { ...stated().columns[column], ...changed };
    for (const key of Object.keys(entry)) if (entry[key] === "" || entry[key] === null || Number.isNaN(entry[key])) delete entry[key];
    came = null;
    const columns = { ...stated().columns, [column]: entry };
    if (!Object.keys(entry).length) delete columns[column];
    state({ columns });
  }

  // Give a channel to a column; whoever had it before is asked for another one. Arrow keys pass other options on the way
  // to one: what a control does, it does to what stood there when one came to it.
  function assign(key, column, place, taken = "") {
    if (came?.key !== key) came = { key, columns: stated().columns, taken };
    column ||= came.taken;
    const columns = structuredClone(came.columns);
    if (!column) { state({ columns }); return; }
    const label = place === "" ? "" : nameOf(seen.channels[Number(place)]);
    for (const [other, entry] of Object.entries(columns)) if (label && other !== column && entry.name === label) delete entry.name;
    const entry = label ? { name: label } : {};
    if (columns[column]?.rate) entry.rate = columns[column].rate;
    columns[column] = entry;
    if (!Object.keys(entry).length) delete columns[column];
    const kept = !label && came.taken && !came.columns[came.taken]?.name;  // taken by its own name
    state({ columns });
    const mine = turn;
    looking.then(() => kept && mine === turn && said.say(`It is recognised by its name: give “${TITLES[came.taken]}” another channel; the tab Gap can leave the load encoder out`));
  }

  // A channel whose name appears twice is called by its number.
  function nameOf(channel) {
    const alike = seen.channels.filter((one) => one.label.toLowerCase() === channel.label.toLowerCase());
    return alike.length > 1 ? `#${channel.place + 1}` : channel.label;
  }

  function card(one) {
    const entry = stated().columns[one.column] ?? {};
    const options = [["", one.how === "absent" ? "none" : one.how === "named" && !entry.name ? "by its own name" : "as recognised"],
      ...seen.channels.map((channel) => [String(channel.place), channel.label])];
    const pickChannel = choice(options, entry.name && one.place !== null ? String(one.place) : "", (place) => assign(`channel-${one.column}`, one.column, place));
    pickChannel.dataset.key = `channel-${one.column}`;
    const list = `units-${one.column}`;
    const told = adviceOf(seen.problem), wrong = told?.column === one.column && told.key === "unit";
    const unit = make("input", { value: entry.unit ?? "", placeholder: one.unit || "SI", list, "data-key": `unit-${one.column}`,
      onchange: () => change(one.column, { unit: unit.value.trim() }) });
    const needed = new Set(one.column === "time" && one.place === null ? [...one.needs, "rate"] : one.needs);
    if (told?.column === one.column) needed.add(told.key);
    const numbers = OF_COLUMN[one.column].map((key) => numberField(one.column, key, entry[key], needed.has(key)));
    const asked = numbers.filter(({ open }) => open).map(({ element }) => element);
    const rest = numbers.filter(({ open }) => !open).map(({ element }) => element);
    const tag = one.how === "absent" && one.least === null ? ["not found", one.column === "theta_l" ? "warn" : "bad"]
      : wrong ? ["unit not known", "bad"] : one.needs.length ? ["needs a number", "bad"] : one.how === "named" ? ["named", "good"] : ["recognised", "good"];
    const range = rangeOf(one);
    return make("div", { class: "card" },
      make("h3", {}, TITLES[one.column], " ", make("span", { class: `tag ${tag[1]}` }, tag[0])),
      make("p", { class: "note" }, one.place === null && !range ? one.meaning : `${labelOf(seen, one)}${range ? `: ${range}` : ""}`),
      field("Channel", pickChannel), field("Unit in the file", unit),
      make("datalist", { id: list }, UNITS[one.column].map((text) => make("option", { value: text }))),
      asked, make("details", {}, make("summary", {}, "More"), rest));
  }

  function numberField(column, key, value, needed) {
    const input = numberInput({ value: value ?? "", "data-key": `${key}-${column}` }, (number) => change(column, { [key]: number }));
    return { open: needed || value !== undefined, element: field(NUMBERS[key], input) };
  }

  function draw() {
    const count = Math.max(0, ...seen.channels.map((channel) => channel.rows.length));
    const unused = seen.channels.filter((channel) => !channel.taken_as).map((channel) => channel.label);
    if (!seen.channels.length) {  // no table was found, but lines to look at
      fill(body, make("p", { class: "message", role: "alert" }, `${plain(seen.problem)}. The line of the names can be chosen below.`));
      fill(rows, lines());
      return;
    }
    fill(body,
      make("p", { class: "note" }, plain(seen.dialect)),
      seen.problem ? make("p", { class: "message", role: "alert" }, problemOf(seen)) : make("p", {}, make("span", { class: "tag good" }, "can be read")),
      ...namesakes(seen.problem), advised(seen.problem),
      make("div", { class: "cards" }, seen.columns.map(card)),
      changes,
      make("p", {}, action("Look at this log", said, inspect, "main")));
    fill(rows,
      make("p", { class: "note" }, unused.length ? `Not used: ${unused.join(", ")}` : "Every channel is used."),
      make("h3", {}, "First rows"),
      make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "First rows" }, make("table", {},
        make("thead", {}, make("tr", {}, seen.channels.map((channel) => make("th", { class: channel.taken_as ? "" : "unused", scope: "col" }, channel.label, make("br"), useOf(channel))))),
        make("tbody", {}, Array.from({ length: count }, (_, n) =>
          make("tr", {}, seen.channels.map((channel) => make("td", { class: channel.taken_as ? "number" : "number unused" }, channel.rows[n] ?? ""))))))),
      seen.lines.length ? lines() : null);
  }

  // A button that does what a line advises, where it says all of it.
  function advised(line) {
    const told = adviceOf(line);
    if (told?.value === undefined) return null;
    return action(`Set “${NUMBERS[told.key] ?? told.key}” of “${TITLES[told.column]}” to ${told.value}`, said, async () => change(told.column, { [told.key]: told.value }));
  }

  // A button for each channel of which a line says that both look like one column.
  function namesakes(line) {
    const { column, names } = rivalsOf(line) ?? { names: [] };
    return names.map((name) => action(`Use “${name}” as “${TITLES[column]}”`, said, async () => change(column, { name })));
  }

  function useOf(channel) {
    const made = choice([["", "not used"], ...Object.entries(TITLES)], channel.taken_as,
      (column) => assign(`use-${channel.place}`, column, column ? String(channel.place) : "", channel.taken_as));
    made.setAttribute("aria-label", `Use ${channel.label} as`);
    made.dataset.key = `use-${channel.place}`;
    return made;
  }

  function lines() {
    const { header } = stated(), set = (line) => { seen = came = null; state({ header: line, columns: {} }); };
    const other = numberInput({ value: header || "", placeholder: "found", "data-key": "header" }, set, (line) => Number.isInteger(line) && line >= 0);
    return make("details", { open: seen.names_line === null || header !== null || !seen.channels.length },
      make("summary", {}, seen.names_line ? `The names are in line ${seen.names_line}; choose another line` : "Which line holds the names?"),
      make("fieldset", { class: "raw" }, make("legend", { class: "visually-hidden" }, "Line of the names"),
        make("label", {}, make("input", { type: "radio", name: "header", checked: header === 0, onchange: () => set(0) }), "none of them"),
        seen.lines.map((text, n) => make("label", { class: seen.names_line === n + 1 ? "names" : "" },
          make("input", { type: "radio", name: "header", checked: seen.names_line === n + 1, onchange: () => set(n + 1) }),
          make("span", { class: "at" }, String(n + 1)), text))),
      field("The names are in line", other));
  }

  async function inspect() {
    const options = {};
    const { columns, header } = asked();
    if (Object.keys(columns).length || header !== undefined) {
      const stem = choices.log.split("/").at(-1).replace(/\.[^.]*$/, "");
      const model = await post("models", { name: `${stem}-columns.toml`, columns, header });
      options.model = model.file;
    }
    const name = await start("inspect", [choices.log], options);
    noteColumns(`results/${name}/model.toml`);
    view.show(name);
  }

  panel.append(
    dropZone("Drop a log here", isLog, pick),
    make("div", { class: "row" }, fileChoice("Log of this session", "log", () => choices.log, pick)),
    said.element, busy, body, view.element, rows);
  watch(follow);
  follow();
}

// What a line of the commands advises to say of a column: which, and of what; `value` where it names one.
export function adviceOf(line) {
  const [, column, key, text] = /`\[columns\.(\w+)\] (\w+) = ([^`]+)`/.exec(line ?? "") ?? [];
  if (!(column in TITLES) || !(key in NUMBERS || key === "unit")) return null;
  if (key === "unit") return { column, key, value: text === '"..."' ? undefined : text.replace(/^"(.*)"$/, "$1") };
  return { column, key, value: Number.isFinite(Number(text)) ? Number(text) : undefined };
}

// The two channels of which a line of the commands says that both look like one column.
export function rivalsOf(line) {
  const [, column, first, second] = /both look like .*`\[columns\.(\w+)\] name = "([^"]+)"` \(or `([^`]+)`\)/.exec(line ?? "") ?? [];
  return column in TITLES ? { column, names: [first, second] } : null;
}

// What a column is taken from, and its range.
const labelOf = (seen, one) => (one.place !== null ? seen.channels[one.place].label : one.least === null ? "nothing" : "the rows' number");
const rangeOf = (one) => (one.least === null ? "" : `${digits(one.least)} to ${digits(one.most)} ${one.si}`);

function problemOf(seen) {
  const rivals = rivalsOf(seen.problem);
  const needs = seen.columns.flatMap((one) => one.needs.map((key) => `${TITLES[one.column]}: ${NUMBERS[key] ?? key}`));
  const missing = seen.columns.filter((one) => one.how === "absent" && seen.missing.includes(one.column));
  const orRate = (one) => (one.column === "time" ? `, or ${NUMBERS.rate}` : "");
  const alike = (one) => (one.column === rivals?.column ? ` (${rivals.names.map((name) => `“${name}”`).join(" and ")} both look like it)` : "");
  const asked = [...missing.map((one) => `${TITLES[one.column]}: the channel that holds it${alike(one)}${orRate(one)}`), ...needs];
  return asked.length ? `Still needed. ${asked.join("; ")}` : plain(seen.problem);
}

// What a choice has changed, column by column.
function differences(before, after) {
  const said = after.columns.flatMap((now, n) => {
    const was = before.columns[n];
    const [old, fresh] = [[before, was], [after, now]].map(([seen, one]) => labelOf(seen, one) + (rangeOf(one) && ` (${rangeOf(one)})`));
    return old === fresh ? [] : [`${TITLES[now.column]}: ${old} → ${fresh}`];
  });
  return said.length ? `Changed. ${said.join("; ")}` : "";
}
