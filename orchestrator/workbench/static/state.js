import { get, post } from "./api.js";

// What the session keeps of the work, for every tab of the browser, after a restart, and at another port.
const EMPTY = { log: "", model: "", given: "", logs: {}, fields: {}, shown: {}, before: {}, saidIn: {}, edits: {} };
const NOTHING = { columns: {}, header: null };
export const choices = structuredClone(EMPTY);
export const session = { folder: "", files: [], jobs: [], version: 0, gone: false, unkept: "" };
const watchers = new Set();
let pending = {}, sending = false;

export function watch(act) { watchers.add(act); }

// Call `act` with what `look` gives, now and whenever that has changed; the function that is returned forgets what it was.
export function whenChanged(look, act) {
  let shown;
  const draw = () => {
    const found = look(), now = JSON.stringify(found);
    if (now === shown) return;
    shown = now;
    act(found);
  };
  watch(draw);
  draw();
  return () => { shown = undefined; draw(); };
}

function tell() { watchers.forEach((act) => act()); }

const isTable = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

// As the server does: a table entry by entry, anything else in place of what was there; null removes.
function merge(table, changes) {
  for (const [name, value] of Object.entries(changes)) {
    table[name] = isTable(value) && isTable(table[name]) ? { ...table[name], ...value } : value;
  }
}

export function choose(changes) {
  merge(choices, changes);
  merge(pending, changes);
  send();
  tell();
}

async function send() {
  if (sending) return;
  sending = true;
  while (Object.keys(pending).length) {
    const sent = pending;
    pending = {};
    try {
      const { version } = await post("notes", sent, true);
      if (version === session.version + 1) session.version = version;  // else another tab has kept something, too
      session.unkept = "";
    } catch (error) {
      merge(sent, pending);
      pending = sent;
      session.unkept = error.message;
      tell();
      break;
    }
  }
  sending = false;
}

// What was said of the columns of the chosen log.
export const stated = () => choices.logs[choices.log] ?? NOTHING;

export function state(changes) {
  choose({ logs: { [choices.log]: { ...stated(), ...changes } } });
}

// The model file that a command gets: the chosen one, with what the tab Log says of the columns now.
export async function modelOfLog() {
  const { log, model } = choices, { columns, header } = stated(), known = choices.saidIn[model];
  const before = known?.log === log ? known : NOTHING;
  if (JSON.stringify([before.columns, before.header]) === JSON.stringify([columns, header])) return model;
  if (!model) throw new Error("press “Look at this log” in the tab Log first: it drafts a model file that has what was said of the columns");
  const found = await get(`model?file=${encodeURIComponent(model)}`), merged = {};
  for (const name of Object.keys({ ...found.columns, ...columns })) {
    const kept = name in before.columns || columns[name]?.name ? {} : found.columns[name];
    const entry = { ...kept, ...columns[name] };
    if (Object.keys(entry).length) merged[name] = entry;
  }
  const line = header ?? (before.header === null ? found.header : null);
  if (JSON.stringify([merged, line]) === JSON.stringify([found.columns, found.header])) return model;
  const stem = model.split("/").at(-1).replace(/(-columns)?(-\d+)?\.[^.]*$/, "");
  const made = await post("models", { base: model, name: `${stem}-columns.toml`, columns: merged, header: line });
  noteColumns(made.file);
  choose({ model: made.file });
  return made.file;
}

// Note that a model file says of the columns what the tab Log does now.
export function noteColumns(model) {
  choose({ saidIn: { [model]: { log: choices.log, ...stated() } } });
}

let timer = 0;

export async function refresh() {
  clearTimeout(timer);
  let busy = false;
  try {
    const { notes, version, ...found } = await get(`state?notes=${session.version}`);
    Object.assign(session, found, { gone: false });
    if (notes && version > session.version && !sending) {
      session.version = version;
      for (const name of Object.keys(choices)) delete choices[name];
      Object.assign(choices, structuredClone(EMPTY), notes);
      merge(choices, pending);
    }
    busy = session.jobs.some((job) => !isOver(job));
  } catch {
    session.gone = true;
  }
  tell();
  timer = setTimeout(refresh, busy ? 250 : 3000);
}

export const isOver = (job) => !["waiting", "running"].includes(job.state);
export const jobOf = (name) => session.jobs.find((job) => job.name === name);

export async function start(command, inputs, options = {}) {
  const given = Object.fromEntries(Object.entries(options).filter(([, value]) => value !== null && value !== "" && value !== false));
  const job = await post("jobs", { command, inputs, options: given });
  await refresh();
  return job.name;
}

export async function stop(name) {
  await post(`jobs/${encodeURIComponent(name)}/stop`);
  await refresh();
}

// Where the results of a command are shown: the tab, and its view of a job.
const PLACES = {
  inspect: ["log", "log"], estimate: ["gap", "gap"], diagnose: ["diagnosis", "diagnosis"],
  check: ["fmus", "fmu"], ssp: ["fmus", "fmu"], simulate: ["fmus", "fmus"], sweep: ["fmus", "fmus"],
  calibrate: ["fmus", "fmu"], compensate: ["model", "control"], regulator: ["model", "control"],
};

// Whether a result compares a log with an FMU of any kind, which the tab of FMUs asks for, and not with a plant of ours.
export const isOfFmu = (job) => Boolean(job.asked.options?.fmu);

// Show a result in its tab, beside the log and the model file that it was made of.
export function open(job) {
  const [tab, view] = isOfFmu(job) ? PLACES.check : PLACES[job.command], [log] = job.asked.inputs ?? [], { model = "" } = job.asked.options ?? {};
  const ofLog = ["log", "gap", "diagnosis"].includes(tab) && log;
  choose({ shown: { [view]: job.name }, ...(ofLog ? { log } : {}), ...(ofLog && tab !== "log" ? { model } : {}) });
  location.hash = tab;
}

export async function runAgain(job) {
  const name = await start(job.command, job.asked.inputs, job.asked.options);
  if (choices.before[job.name]) choose({ before: { [name]: choices.before[job.name] } });
  open(jobOf(name));
}

// Remove a result; nothing chosen is left that points into it.
export async function discard(job) {
  const users = session.jobs.filter((one) => JSON.stringify(one.asked).includes(`"results/${job.name}/`)).map((one) => one.name);
  const more = users.length ? `\n${users.join(", ")} used files of it and cannot run again without them.` : "";
  if (!confirm(`Remove ${job.name} and its files for good?${more}`)) return;
  await post(`jobs/${encodeURIComponent(job.name)}/remove`);
  const views = Object.keys(choices.shown).filter((view) => choices.shown[view] === job.name);
  choose({
    shown: Object.fromEntries(views.map((view) => [view, null])), before: { [job.name]: null },
    ...(choices.model.startsWith(`results/${job.name}/`) ? { model: "" } : {}),
  });
  await refresh();
}
