import { field, fill, table } from "./dom.js";
import { duration, framed, jobButtons, message } from "./parts.js";
import { isOver, session, whenChanged } from "./state.js";

// Two results of one command side by side, and the history of the session.
export function build(panel) {
  const said = message(), page = make("div", {}), place = make("div", {});
  const first = make("select", {}), second = make("select", {});
  const whole = () => session.jobs.filter((job) => isOver(job) && job.files.includes(`${job.command}.json`));
  const alike = () => {
    const one = whole().find((job) => job.name === first.value);
    const names = whole().filter((job) => job.command === one?.command && job !== one).map((job) => job.name);
    const before = second.value;
    second.replaceChildren(...names.map((name) => make("option", { value: name, selected: name === before }, name)));
  };
  first.addEventListener("change", alike);
  whenChanged(() => session.jobs.filter(isOver).map((job) => [job.name, job.state]), () => {
    const jobs = session.jobs.filter(isOver);
    const before = first.value;
    first.replaceChildren(...whole().map((job) => make("option", { value: job.name, selected: job.name === before }, job.name)));
    alike();
    fill(place, jobs.length ? table("Results", ["result", "ended", "state", "took", "command line", "actions"], jobs.toReversed().map(row)) : make("p", {}, "No result is here yet: a job leaves one."));
  });
  const show = () => {
    said.say("");
    if (!first.value || !second.value) { said.say("two results of one command are needed"); return; }
    const address = `compare?first=${encodeURIComponent(first.value)}&second=${encodeURIComponent(second.value)}`;
    fill(page, framed(address, `${first.value} and ${second.value}`));
  };
  panel.append(
    make("div", { class: "row" }, field("One result", first, "grows"), field("Another of the same command", second, "grows"),
      make("button", { type: "button", class: "main", onclick: show }, "Compare them")),
    said.element, page, make("h2", {}, "All results of this session"), place);
}

function row(job) {
  const page = make("a", { href: `file/results/${job.name}/report.html`, target: "_blank", rel: "noopener" }, job.name);
  return [job.files.includes("report.html") ? page : job.name, job.ended ? new Date(1000 * job.ended).toLocaleString() : "", job.state,
    job.ended > job.begun ? duration(job.ended - job.begun) : "", make("td", { class: "long" }, make("code", {}, job.line)), make("td", {}, jobButtons(job, "open"))];
}
