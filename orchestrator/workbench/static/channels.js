import { TITLES } from "./advice.js";
import { choice, fill } from "./dom.js";

const SHOWN = 40;  // channels at once: more are found by their names
const VALUES = 5;  // of the first rows

// The channels of a log, each with its curve, its first values, and what it is used as.
export class ChannelList {
  constructor(curves, assign) {
    Object.assign(this, { curves, assign, most: SHOWN });
    this.words = make("input", { type: "search", "data-key": "find-channel", oninput: () => { this.most = SHOWN; this.draw(); } });
    this.list = make("div", { class: "channels" });
    this.note = make("p", { class: "note", role: "status" });
    this.more = make("button", { type: "button", onclick: () => { this.most += SHOWN; this.draw(); } }, "Show more");
    this.element = make("section", {}, make("h3", {}, "Channels of the file"), this.note,
      make("div", { class: "row" }, make("label", { class: "field grows" }, "Find a channel by its name", this.words)), this.list, make("p", {}, this.more));
  }

  show(seen) {
    this.seen = seen;
    this.element.hidden = !seen?.channels.length;
    if (!this.element.hidden) this.draw();
  }

  draw() {
    const { channels } = this.seen, unused = channels.filter((channel) => !channel.taken_as).map((channel) => channel.label);
    const text = this.words.value.trim().toLowerCase();
    const found = channels.filter((channel) => `${channel.label} ${TITLES[channel.taken_as] ?? ""}`.toLowerCase().includes(text));
    const some = unused.length > 12 ? `${unused.slice(0, 12).join(", ")} and ${unused.length - 12} more` : unused.join(", ");
    this.note.textContent = unused.length ? `Not used: ${some}` : "Every channel is used.";
    fill(this.list, found.slice(0, this.most).map((channel) => this.row(channel)), found.length ? null : make("p", { class: "note" }, "no channel has these letters"));
    this.more.parentElement.hidden = found.length <= this.most;
    this.more.textContent = `Show more (${found.length - this.most} are left)`;
  }

  row(channel) {
    const use = choice([["", "not used"], ...Object.entries(TITLES)], channel.taken_as, (column) => this.assign(channel, column));
    use.setAttribute("aria-label", `Use ${channel.label} as`);
    use.dataset.key = `use-${channel.place}`;
    const first = channel.rows.slice(0, VALUES).join(", ");
    return make("div", { class: channel.taken_as ? "channel taken" : "channel" },
      make("div", {}, make("strong", {}, channel.label), make("div", {}, use), make("div", { class: "note" }, first ? `first rows: ${first}` : "")),
      this.curves.figure(channel.place, channel.label, channel.unit));
  }
}
