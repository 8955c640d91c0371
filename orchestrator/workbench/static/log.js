import { adviceOf, NUMBERS, plain, TITLES } from "./advice.js";
import { post } from "./api.js";
import { ChannelList } from "./channels.js";
import { Curves } from "./curves.js";
import { choice, digits, field, fill, numberInput } from "./dom.js";
import { action, dropZone, fileChoice, isLog, jobView, message, resultOf } from "./parts.js";
import { choices, choose, jobOf, noteColumns, session, start, state, stated, watch } from "./state.js";

const ANGLES = ["rad", "deg", "arcmin", "rev", "counts", "m", "mm", "rpm", "rad/s"];
const UNITS = {
  time: ["s", "ms", "us", "min"], u: ["N.m", "mN.m", "N.mm", "lbf.in", "N", "A", "%", "p.u.", "V"], theta_m: ANGLES, theta_l: ANGLES,
};
const OF_COLUMN = {
  time: ["rate"], u: ["torque_constant", "rated_value", "resistance", "back_emf_constant", "sign_bit", "modulo", "factor"],
  theta_m: ["counts_per_rev", "modulo", "sign_bit", "factor"], theta_l: ["counts_per_rev", "modulo", "sign_bit", "factor"],
};

export const build = (panel, go) => new LogTab(panel, go);

// A log: its channels with their curves, and what each column is taken from.
class LogTab {
  constructor(panel, go) {
    Object.assign(this, { seen: null, turn: 0, looked: "", log: "", came: null });  // `came`: see `assign`
    this.said = message();
    this.changes = make("p", { class: "message calm", role: "status" });
    this.busy = make("p", { class: "note busy", role: "status" });
    [this.body, this.raw] = [make("div", {}), make("div", {})];
    this.curves = new Curves();
    this.channels = new ChannelList(this.curves, (channel, column) =>
      this.assign(`use-${channel.place}`, column, column ? String(channel.place) : "", channel.taken_as));
    this.view = jobView("log", (job) => {
      const place = make("div", {});
      resultOf(job).then((found) => fill(place, this.advised((found?.verdict ?? job.messages).join(" "))));
      return job.state === "done" ? [place, make("p", {}, action("Go on to the machine", this.said, () => go("machine")))] : place;
    });
    const pick = (log) => { if (log !== choices.log) choose({ log, model: "" }); };
    panel.append(dropZone("Drop a log here", isLog, pick),
      make("div", { class: "row" }, fileChoice("Log of this session", "log", () => choices.log, pick)),
      this.said.element, this.busy, this.body, this.view.element, this.channels.element, this.raw);
    watch(() => this.follow());
    this.follow();
  }

  // Whichever tab, or page, has chosen another log or other columns; a draft of the model file is taken once.
  follow() {
    const job = jobOf(this.view.name()), ofLog = (one) => one.command === "inspect" && one.asked.inputs?.[0] === choices.log;
    if (job && ofLog(job) && job.state === "done" && job.files.includes("model.toml") && choices.given !== job.name) {
      choose({ model: `results/${job.name}/model.toml`, given: job.name });
      return;
    }
    const now = JSON.stringify([choices.log, stated()]);
    if (now === this.looked) return;
    this.looked = now;
    const other = this.log !== choices.log;
    this.log = choices.log;
    if (other) this.seen = this.came = null;
    this.looking = this.look();
    if (other && job && !ofLog(job)) choose({ shown: { log: session.jobs.filter(ofLog).at(-1)?.name ?? null } });
  }

  asked() {
    const { columns, header } = stated();
    return { columns, ...(header === null ? {} : { header }) };
  }

  async look() {
    const mine = ++this.turn;
    this.said.say("");
    this.curves.show(choices.log, stated().header);
    if (!choices.log) { this.clear(); return; }
    this.busy.textContent = "Reading …";
    try {
      const found = await post("columns", { file: choices.log, ...this.asked() });
      if (mine !== this.turn) return;
      this.changes.textContent = this.seen ? differences(this.seen, found) : "";
      this.seen = found;
      this.draw();
    } catch (error) {
      if (mine === this.turn) { this.said.say(error.message); if (!this.seen) this.clear(); }
    }
    if (mine === this.turn) this.busy.textContent = "";
  }

  clear() {
    this.busy.textContent = choices.log ? "" : "No log is chosen yet: drop one, or begin with the example in the tab Start.";
    [this.body, this.raw].forEach((place) => fill(place));
    this.channels.show(null);
  }

  change(column, changed) {
    const entry = { ...stated().columns[column], ...changed };
    for (const key of Object.keys(entry)) if (entry[key] === "" || entry[key] === null || Number.isNaN(entry[key])) delete entry[key];
    this.came = null;
    const columns = { ...stated().columns, [column]: entry };
    if (!Object.keys(entry).length) delete columns[column];
    state({ columns });
  }

  // Give a channel to a column; whoever had it before is asked for another one. Arrow keys pass other options on the way
  // to one: what a control does, it does to what stood there when one came to it.
  assign(key, column, place, taken = "") {
    if (this.came?.key !== key) this.came = { key, columns: stated().columns, taken };
    const { came } = this, columns = structuredClone(came.columns);
    column ||= came.taken;
    if (!column) { state({ columns }); return; }
    const label = place === "" ? "" : this.nameOf(this.seen.channels[Number(place)]);
    for (const [other, entry] of Object.entries(columns)) if (label && other !== column && entry.name === label) delete entry.name;
    const entry = label ? { name: label } : {};
    if (columns[column]?.rate) entry.rate = columns[column].rate;
    columns[column] = entry;
    if (!Object.keys(entry).length) delete columns[column];
    const kept = !label && came.taken && !came.columns[came.taken]?.name;  // taken by its own name
    state({ columns });
    const mine = this.turn;
    this.looking.then(() => kept && mine === this.turn && this.said.say(
      `It is recognised by its name: give “${TITLES[came.taken]}” another channel; the tab Gap can leave the load encoder out`));
  }

  // A channel whose name appears twice is called by its number.
  nameOf(channel) {
    const alike = this.seen.channels.filter((one) => one.label.toLowerCase() === channel.label.toLowerCase());
    return alike.length > 1 ? `#${channel.place + 1}` : channel.label;
  }

  card(one) {
    const entry = stated().columns[one.column] ?? {}, told = adviceOf(this.seen.problem);
    const list = `units-${one.column}`;
    const unit = make("input", { value: entry.unit ?? "", placeholder: one.unit || "SI", list, "data-key": `unit-${one.column}`,
      onchange: () => this.change(one.column, { unit: unit.value.trim() }) });
    const needed = new Set(one.column === "time" && one.place === null ? [...one.needs, "rate"] : one.needs);
    if (told?.column === one.column) needed.add(told.key);
    const numbers = OF_COLUMN[one.column].map((key) => this.numberField(one.column, key, entry[key], needed.has(key)));
    const part = (open) => numbers.filter((number) => number.open === open).map(({ element }) => element);
    const tag = tagOf(one, told?.column === one.column && told.key === "unit");
    const range = rangeOf(one), head = this.seen.channels[one.place];
    return make("div", { class: "card" },
      make("h3", {}, TITLES[one.column], " ", make("span", { class: `tag ${tag[1]}` }, tag[0])),
      make("p", { class: "note" }, one.place === null && !range ? one.meaning : `${labelOf(this.seen, one)}${range ? `: ${range}` : ""}`),
      head?.kind === "number" ? this.curves.figure(one.place, TITLES[one.column], one.unit, entry.factor ?? 1) : null,
      field("Channel", this.channelChoice(one, entry)), field("Unit in the file", unit),
      make("datalist", { id: list }, UNITS[one.column].map((text) => make("option", { value: text }))),
      part(true), make("details", {}, make("summary", {}, "More"), part(false)));
  }

  channelChoice(one, entry) {
    const usual = one.how === "absent" ? "none" : one.how === "named" && !entry.name ? "by its own name" : "as recognised";
    const { channels } = this.seen, near = channels.length > 200 ? channels.filter((channel) => channel.taken_as) : channels;
    const options = [["", usual], ...near.map((channel) => [String(channel.place), channel.label])];
    const made = choice(options, entry.name && one.place !== null ? String(one.place) : "", (place) => this.assign(`channel-${one.column}`, one.column, place));
    made.dataset.key = `channel-${one.column}`;
    return made;
  }

  numberField(column, key, value, needed) {
    const input = numberInput({ value: value ?? "", "data-key": `${key}-${column}` }, (number) => this.change(column, { [key]: number }));
    return { open: needed || value !== undefined, element: field(NUMBERS[key], input) };
  }

  draw() {
    const { seen } = this;
    if (!seen.channels.length) {  // no table was found, but lines to look at
      fill(this.body, make("p", { class: "message", role: "alert" }, `${plain(seen.problem)}. The line of the names can be chosen below.`));
    } else {
      fill(this.body,
        make("p", { class: "note" }, plain(seen.dialect)),
        seen.problem ? make("p", { class: "message", role: "alert" }, problemOf(seen)) : make("p", {}, make("span", { class: "tag good" }, "can be read")),
        this.advised(seen.problem),
        this.curves.tools, make("div", { class: "cards" }, seen.columns.map((one) => this.card(one))), this.changes,
        make("p", {}, action("Look at this log", this.said, () => this.inspect(), "main")));
    }
    this.channels.show(seen);
    fill(this.raw, seen.lines.length ? this.lines() : null);
  }

  // A button that does what a line advises, where it says all of it.
  advised(line) {
    const told = adviceOf(line);
    if (told?.value === undefined) return null;
    const text = `Set “${NUMBERS[told.key] ?? told.key}” of “${TITLES[told.column]}” to ${told.value}`;
    return action(text, this.said, async () => this.change(told.column, { [told.key]: told.value }));
  }

  lines() {
    const { seen } = this, { header } = stated();
    const set = (line) => { this.seen = this.came = null; state({ header: line, columns: {} }); };
    const other = numberInput({ value: header || "", placeholder: "found", "data-key": "header" }, set, (line) => Number.isInteger(line) && line >= 0);
    const radio = (line, checked) => make("input", { type: "radio", name: "header", checked, onchange: () => set(line) });
    return make("details", { open: seen.names_line === null || header !== null || !seen.channels.length },
      make("summary", {}, seen.names_line ? `The names are in line ${seen.names_line}; choose another line` : "Which line holds the names?"),
      make("fieldset", { class: "raw" }, make("legend", { class: "quiet" }, "Line of the names"),
        make("label", {}, radio(0, header === 0), "none of them"),
        seen.lines.map((text, n) => make("label", { class: seen.names_line === n + 1 ? "names" : "" },
          radio(n + 1, seen.names_line === n + 1), make("span", { class: "at" }, String(n + 1)), text))),
      field("The names are in line", other));
  }

  async inspect() {
    const options = {}, { columns, header } = this.asked();
    if (Object.keys(columns).length || header !== undefined) {
      const stem = choices.log.split("/").at(-1).replace(/\.[^.]*$/, "");
      options.model = (await post("models", { name: `${stem}-columns.toml`, ...this.asked() })).file;
    }
    const name = await start("inspect", [choices.log], options);
    noteColumns(`results/${name}/model.toml`);
    this.view.show(name);
  }
}

function tagOf(one, wrong) {
  if (one.how === "absent" && one.least === null) return ["not found", one.column === "theta_l" ? "warn" : "bad"];
  if (wrong) return ["unit not known", "bad"];
  if (one.needs.length) return ["needs a number", "bad"];
  return [one.how === "named" ? "named" : "recognised", "good"];
}

// What a column is taken from, and its range.
const labelOf = (seen, one) => (one.place !== null ? seen.channels[one.place].label : one.least === null ? "nothing" : "the rows' number");
const rangeOf = (one) => (one.least === null ? "" : `${digits(one.least)} to ${digits(one.most)} ${one.si}`);

function problemOf(seen) {
  const needs = seen.columns.flatMap((one) => one.needs.map((key) => `${TITLES[one.column]}: ${NUMBERS[key] ?? key}`));
  const missing = seen.columns.filter((one) => one.how === "absent" && seen.missing.includes(one.column));
  const orRate = (one) => (one.column === "time" ? `, or ${NUMBERS.rate}` : "");
  const asked = [...missing.map((one) => `${TITLES[one.column]}: the channel that holds it${orRate(one)}`), ...needs];
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
