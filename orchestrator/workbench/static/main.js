import { fill } from "./dom.js";
import { isOver, refresh, session, watch, whenChanged } from "./state.js";
import { jobLine } from "./parts.js";
import * as begin from "./start.js";
import * as log from "./log.js";
import * as machine from "./machine.js";
import * as gap from "./gap.js";
import * as diagnosis from "./diagnosis.js";
import * as model from "./model.js";
import * as fmus from "./fmus.js";
import * as compare from "./compare.js";

const TABS = [
  ["start", "Start", begin], ["log", "Log", log], ["machine", "Machine", machine], ["gap", "Gap", gap], ["diagnosis", "Diagnosis", diagnosis],
  ["model", "Model", model], ["fmus", "FMUs", fmus], ["compare", "Results", compare],
];
await refresh();  // the work as it was
const tabs = document.getElementById("tabs"), panels = document.getElementById("panels");

function go(key, focus = true) {
  for (const [name] of TABS) {
    const tab = document.getElementById(`tab-${name}`), on = name === key;
    tab.setAttribute("aria-selected", String(on));
    tab.tabIndex = on ? 0 : -1;
    document.getElementById(`panel-${name}`).hidden = !on;
    if (on && focus) tab.focus();
  }
  if (location.hash !== `#${key}`) history[focus ? "pushState" : "replaceState"](null, "", `#${key}`);
}

const asked = () => (TABS.some(([name]) => name === location.hash.slice(1)) ? location.hash.slice(1) : "start");
addEventListener("popstate", () => go(asked(), false));  // Back: to the tab before

for (const [name, title, part] of TABS) {
  tabs.append(make("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => go(name) }, title));
  const panel = make("section", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}` });
  panels.append(panel);
  panel.append(make("h2", { class: "quiet" }, title));
  part.build(panel, go);
}

tabs.addEventListener("keydown", (event) => {
  const names = TABS.map(([name]) => name), at = names.indexOf(document.activeElement.id.slice(4));
  const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: names.length - 1 }[event.key];
  if (to === undefined || at < 0) return;
  event.preventDefault();
  go(names[(to + names.length) % names.length]);
});

// Jobs that run, whoever of the open tabs has started them.
const running = document.getElementById("running");
const lines = new Map();
watch(() => {
  document.getElementById("folder").textContent = session.folder;
  const jobs = session.jobs.filter((job) => !isOver(job));
  for (const name of lines.keys()) if (!jobs.some((job) => job.name === name)) lines.delete(name);
  for (const job of jobs) {
    if (!lines.has(job.name)) lines.set(job.name, jobLine(job));
    lines.get(job.name).update(job);
  }
});
whenChanged(() => [session.gone, session.unkept, [...lines.keys()]], () => {
  const held = running.contains(document.activeElement);
  const alarm = session.gone ? "The workbench has ended: start it again; files, choices and results are in its directory."
    : session.unkept && `What you chose is not kept: ${session.unkept}`;
  fill(running, alarm ? make("p", { class: "message", role: "alert" }, alarm) : null, [...lines.values()].map(({ element }) => element));
  if (held && document.activeElement === document.body) tabs.querySelector("[aria-selected=true]").focus({ preventScroll: true });  // its Stop went with the job
});

go(asked(), false);
