import { fileAddress, upload } from "./api.js";
import { plain } from "./advice.js";
import { choice, fill, field, wrongField } from "./dom.js";
import { choices, choose, discard, isOver, jobOf, open, refresh, runAgain, session, stop, watch, whenChanged } from "./state.js";

const NO_LOGS = /\.(toml|fmu|ssp|json|html|png)$/i;
const PLACES = "logs go into the tab Log, model files (.toml) into Machine, FMUs and SSP files into FMUs";
export const isLog = (name) => !NO_LOGS.test(name);
export const isModel = (name) => /\.toml$/i.test(name);
export const isFmu = (name) => /\.(fmu|ssp)$/i.test(name);

// All files of the session of one kind: model files and FMUs of results, too.
export function filesOf(kind) {
  const uploads = session.files.filter((file) => file.kind === kind).map((file) => [file.file, file.name]);
  const isMap = (name) => /map\.toml$/.test(name);
  const made = { model: (name) => isModel(name) && !isMap(name), fmu: isFmu, map: isMap }[kind] ?? (() => false);
  const results = session.jobs.flatMap((job) => job.files.filter(made).map((name) => [`results/${job.name}/${name}`, `${job.name}: ${name}`]));
  return [...uploads, ...results];
}

// A control whose value the session keeps.
export function kept(key, control, usual = "") {
  const what = control.type === "checkbox" ? "checked" : "value";
  const show = () => { if (control !== document.activeElement) control[what] = choices.fields[key] ?? usual; };
  control.addEventListener("change", () => choose({ fields: { [key]: control[what] === usual ? null : control[what] } }));
  watch(show);
  show();
  return control;
}

// A place to drop a file on, with a button for those who do not drag; `able` says which names are meant for it.
export function dropZone(text, able, taken, multiple = false) {
  const said = make("span", { "aria-live": "polite" });
  const input = make("input", { type: "file", multiple, hidden: true, "aria-label": text });
  const open = make("button", { type: "button", "aria-label": `${text}, or choose ${multiple ? "files" : "a file"}`, onclick: () => input.click() }, multiple ? "Choose files" : "Choose a file");
  const zone = make("div", { class: "drop" }, make("strong", {}, text), open, input, said);
  const take = async (files) => {
    for (const file of files) {
      try {
        if (!able(file.name)) throw new Error(`${file.name}: ${PLACES}`);
        said.textContent = `${file.name} …`;
        const found = await upload(file);
        said.textContent = `${found.name} is here`;
        await refresh();
        await taken(found.file);
      } catch (error) {
        said.replaceChildren(make("span", { class: "tag bad" }, "not taken"), ` ${error.message}`);
      }
    }
    input.value = "";
  };
  input.addEventListener("change", () => take([...input.files]));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    take([...event.dataTransfer.files].slice(0, multiple ? 50 : 1));
  });
  return zone;
}

// A choice among files of the session that follows what comes and goes.
export function fileChoice(text, kind, value, picked, none = "none") {
  const place = make("div", { class: "field grows" });
  whenChanged(() => [[["", none], ...filesOf(kind)], value()], ([options, now]) => {
    const made = choice(options, options.some(([key]) => key === now) ? now : "", picked);
    made.dataset.key = text;
    fill(place, ...field(text, made).children);
  });
  return place;
}

const STATES = { waiting: "", running: "", done: "good", stopped: "warn", ended: "warn", failed: "bad" };

// One job: its stage, the time left, Stop; then what it said, and its page. `key` keeps which one over a reload of the page.
export function jobView(key, result = () => []) {
  const place = make("div", {}), name = () => choices.shown[key];
  const draw = () => {
    const job = jobOf(name());
    if (!name()) fill(place);
    if (!job) return;
    fill(place, isOver(job) ? finished(job) : make("p", { class: "note", role: "status" }, `${job.name} is ${job.state}; its stage and Stop stand at the top.`));
    if (isOver(job)) for (const part of [result(job)].flat()) place.append(part);
    if (isOver(job) && job.files.includes("report.html")) place.append(framed(fileAddress(`results/${job.name}/report.html`), `Page of ${job.name}`));
  };
  const again = whenChanged(() => [name(), jobOf(name())?.state], draw);
  return { element: place, show(job) { choose({ shown: { ...choices.shown, [key]: job } }); again(); }, name };
}

// A job that runs: its line stays, so that Stop can be pressed at any moment; `update` brings what it says up to date.
export function jobLine({ name, line }) {
  const bar = make("progress", { max: 1, "aria-label": `${name}: share that is done` }), [stage, time] = [make("span", {}), make("span", { "aria-live": "off" })];
  const button = make("button", { type: "button", "data-key": `stop-${name}`, onclick: () => stop(name) });
  const update = (job) => {
    const now = Date.now() / 1000, left = job.left === null ? null : Math.round(job.left - Math.max(0, now - job.told));
    const words = job.stops > 0 ? (job.stops > 1 ? "Kill" : "Stop at once") : "Stop";
    stage.textContent = job.stops ? "stopping" : job.stage || job.state;
    if (job.share === null) bar.removeAttribute("value");
    else bar.value = job.share;
    time.textContent = `${duration(Math.round(Math.max(0, now - job.begun)))} gone${left === null ? "" : left > 0 ? `, about ${duration(left)} left` : ", longer than was expected"}`;
    button.textContent = words;
    button.setAttribute("aria-label", `${words}: ${name}`);
  };
  return { update, element: make("div", { class: "job" }, make("div", { class: "row" }, make("strong", {}, name), stage, bar, time, button), make("code", {}, line)) };
}

function finished(job) {
  const seconds = job.ended - job.begun;
  const words = job.messages.filter((line) => !line.startsWith("The fit"));  // what it would take
  return make("div", { class: "job" },
    make("div", { class: "row" },
      make("strong", {}, job.name), make("span", { class: `tag ${STATES[job.state]}` }, job.state),
      make("span", { class: "note" }, seconds > 0 ? duration(seconds) : ""),
      make("span", { class: "note" }, job.files.length > 1 ? "" : job.state === "stopped" ? "no results were left" : "")),
    jobButtons(job),
    words.map((text) => make("p", { class: job.state === "failed" ? "message" : "message calm" }, plain(text.replace(/^error: /, "").replaceAll("Ctrl-C", "Stop")))),
    make("code", {}, job.line),
    make("ul", { class: "files" }, job.files.map((name) => make("li", {}, make("a", { href: fileAddress(`results/${job.name}/${name}`),
      ...(name.endsWith(".html") ? { target: "_blank", rel: "noopener" } : { download: name.split("/").at(-1) }) }, name)))));
}

// What can be done with a job that has ended; `more`: further buttons.
export function jobButtons(job, more = null) {
  const said = message(), named = (text, act) => {
    const made = action(text, said, () => act(job));
    made.setAttribute("aria-label", `${text}: ${job.name}`);
    return made;
  };
  return make("div", {}, make("div", { class: "row" }, more === "open" ? named("Open", open) : null, named("Run again", runAgain), named("Remove", discard)), said.element);
}

// A page of the session's own, walled off, and a way to see it alone.
export function framed(address, title) {
  return make("div", {},
    make("p", {}, make("a", { href: address, target: "_blank", rel: "noopener" }, "Open this page in a tab of its own")),
    make("iframe", { src: address, title, sandbox: "allow-scripts allow-downloads allow-popups" }));
}

export function duration(seconds) {
  if (seconds < 10) return `${Number(seconds.toFixed(1))} s`;
  const whole = Math.round(seconds);
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

export function message() {
  const place = make("p", { class: "message", role: "alert" });
  return { element: place, say(text) { place.textContent = plain(text ?? ""); } };
}

// Run an action of a button: disabled meanwhile, an error becomes a line.
export function action(text, said, act, kind = "") {
  const made = make("button", { type: "button", class: kind, async onclick() {
    said.say("");
    const wrong = wrongField(made.closest("[role=tabpanel]"));
    if (wrong) { said.say(wrong.said); wrong.input.focus(); return; }
    made.disabled = true;
    try { await act(); } catch (error) { said.say(error.message); }
    made.disabled = false;
    if (document.activeElement === document.body) made.focus({ preventScroll: true });
  } }, text);
  return made;
}

export async function resultOf(job) {
  if (!job.files.includes(`${job.command}.json`)) return null;
  const response = await fetch(fileAddress(`results/${job.name}/${job.command}.json`));
  return response.ok ? (await response.json()).results : null;
}
