import { get, post } from "./api.js";

// What this tab works on; other tabs of the browser have their own.
const KEPT = "workbench";
export const choices = { log: "", model: "", columns: {}, header: null, shown: {}, ...JSON.parse(sessionStorage.getItem(KEPT) ?? "{}") };
export const session = { folder: "", files: [], jobs: [], largest_file: 0 };
export const draft = { names: [] };  // what the tab Machine has changed and not saved
const watchers = new Set();

export function watch(act) { watchers.add(act); }

export function choose(changes) {
  Object.assign(choices, changes);
  sessionStorage.setItem(KEPT, JSON.stringify(choices));
  tell();
}

function tell() { watchers.forEach((act) => act()); }

// Another log: what was said of its columns is kept, should one come back to it.
export function chooseLog(log, changes = {}) {
  if (log === choices.log) return;
  const kept = { ...choices.kept, [choices.log]: { columns: choices.columns, header: choices.header } };
  choose({ columns: {}, header: null, ...kept[log], ...changes, log, kept });
}

// The model file that a command gets: the chosen one, with what the tab Log says of the columns now.
export async function modelOfLog() {
  const { log, columns, header, model } = choices, known = choices.saidIn?.[model];
  const before = known?.log === log ? known : { columns: {}, header: null };
  if (JSON.stringify([before.columns, before.header]) === JSON.stringify([columns, header])) return model;
  if (!model) throw new Error("press “Look at this log” in the tab Log first: it drafts a model file that has what was said of the columns");
  const found = await get(`model?file=${encodeURIComponent(model)}`), merged = {};
  for (const name of Object.keys({ ...found.columns, ...columns })) {
    const kept = name in before.columns || columns[name]?.name ? {} : found.columns[name];
    const entry = { ...kept, ...columns[name] };
    if (Object.keys(entry).length) merged[name] = entry;
  }
  const stated = header ?? (before.header === null ? found.header : null);
  if (JSON.stringify([merged, stated]) === JSON.stringify([found.columns, found.header])) return model;
  const stem = model.split("/").at(-1).replace(/(-columns)?(-\d+)?\.[^.]*$/, "");
  const made = await post("models", { base: model, name: `${stem}-columns.toml`, columns: merged, header: stated });
  noteColumns(made.file);
  choose({ model: made.file });
  return made.file;
}

// Note that a model file says of the columns what the tab Log does now.
export function noteColumns(model) {
  const { log, columns, header } = choices;
  choose({ saidIn: { ...choices.saidIn, [model]: { log, columns, header } } });
}

let timer = 0;

export async function refresh() {
  clearTimeout(timer);
  let busy = false;
  try {
    Object.assign(session, await get("state"), { gone: false });
    busy = session.jobs.some((job) => !isOver(job));
  } catch {
    session.gone = true;
  }
  tell();
  timer = setTimeout(refresh, busy ? 250 : 3000);
}

export const isOver = (job) => !["waiting", "running"].includes(job.state);
export const jobOf = (name) => session.jobs.find((job) => job.name === name);
export const latest = (command) => session.jobs.filter((job) => job.command === command).at(-1);

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
