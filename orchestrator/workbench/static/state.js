import { get, post } from "./api.js";

// What this tab works on; other tabs of the browser have their own.
const KEPT = "workbench";
export const choices = { log: "", model: "", columns: {}, header: null, shown: {}, ...JSON.parse(sessionStorage.getItem(KEPT) ?? "{}") };
export const session = { folder: "", files: [], jobs: [], largest_file: 0 };
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
