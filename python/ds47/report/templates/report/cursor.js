// The cursor of a drawing of a drive: what was so in all lanes at one moment, followed by the pointer or held in place.
// What is known of each moment stands in the page (html/views/cursor.py); nothing is read out of the picture.

const MORE = 10; // events that Shift and an arrow key pass at once

/** The last of some moments, sorted by time, that is not behind a time; undefined before all of them. */
function newest(moments, at) {
  let [low, high] = [0, moments.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (moments[middle][0] <= at) low = middle + 1;
    else high = middle;
  }
  return moments[low - 1];
}

function inSeconds(at) {
  return `${(at / 1e6).toFixed(6)} s`;
}

class Cursor {
  constructor(drawing, known) {
    this.drawing = drawing;
    this.number = drawing.closest("[data-timeline]").dataset.timeline;
    this.clock = clockOf(this.number.split("-")[0]);
    this.known = known;
    this.left = Number(drawing.dataset.left);
    this.width = Number(drawing.dataset.width);
    this.first = Number(drawing.dataset.seconds) * 1e6;
    this.span = Number(drawing.dataset.span) * 1e6;
    this.at = null;
    this.held = false;
    this.place = drawing.querySelector("[data-reading]");
    this.stops = [...new Set([...known.states, ...known.commands, ...known.lanes.flatMap(([, jobs]) => jobs)].map(([at]) => at))]
      .filter((at) => at >= this.first && at <= this.first + this.span).sort((one, other) => one - other);
    this.tell();
  }

  /** The moment under the pointer; null beside the lanes. */
  under(event) {
    const picture = this.drawing.querySelector("svg");
    const box = picture.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * picture.viewBox.baseVal.width;
    return x < this.left || x > this.left + this.width ? null : this.first + ((x - this.left) / this.width) * this.span;
  }

  go(at, held = this.held) {
    [this.at, this.held] = [at, held && at !== null];
    const line = this.drawing.querySelector(".cursor");
    line.toggleAttribute("hidden", at === null);
    for (const each of [line, this.place]) each.classList.toggle("held", this.held);
    if (at !== null) line.setAttribute("transform", `translate(${this.left + ((at - this.first) / this.span) * this.width} 0)`);
    this.tell();
  }

  /** To the next event, or the one before; to the first or the last one where nothing was read yet. */
  step(by) {
    if (!this.stops.length) return;
    const here = this.at ?? (by > 0 ? -Infinity : Infinity);
    const place = by > 0 ? this.stops.findIndex((at) => at > here) : this.stops.findLastIndex((at) => at < here);
    const from = place < 0 ? (by > 0 ? this.stops.length - 1 : 0) : place + by - Math.sign(by);
    this.go(this.stops[Math.min(this.stops.length - 1, Math.max(0, from))], true);
  }

  pressed(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (by) this.step(event.shiftKey ? by * MORE : by);
    else if (event.key === "Home") this.go(this.stops[0] ?? null, true);
    else if (event.key === "End") this.go(this.stops.at(-1) ?? null, true);
    else if (event.key === "Escape" && this.at !== null) this.go(null);
    else return;
    event.preventDefault();
  }

  // What it reads

  tell() {
    const rows = [["read_time", this.time()], ["read_state", this.state()], ["read_setpoint", this.value("setpoint")],
      ["read_actual", this.value("actual")], ["read_command", this.command()]];
    const lanes = this.known.lanes.map(([name, jobs]) => [name, this.jobs(jobs)]);
    const told = [...rows.map(([key, found]) => [say(key), found]), ...lanes];
    this.place.replaceChildren(...told.flatMap(([name, found]) => [el("dt", {}, name), el("dd", {}, found ?? "–")]));
  }

  time() {
    if (this.at === null) return say("read_nothing");
    const found = [inSeconds(this.at), this.clock.at(this.at)].filter(Boolean).join(" · ");
    return this.held ? `${found} · ${say("read_held")}` : found;
  }

  text(place) {
    return either(this.known.texts[place]);
  }

  /** Whether frames tell anything of this moment; else why not. */
  silence() {
    if (this.at === null) return "–";
    if (this.at < this.known.known[0]) return say("read_before");
    return this.at > this.known.known[1] ? say("read_after") : null;
  }

  found(key, [at, frame, place]) {
    return [say(key, { what: this.text(place), time: inSeconds(at) }), ", ", this.frame(frame)];
  }

  frame(number) {
    const words = say("frame", { n: number });
    const row = document.getElementById(`event-${this.number}-${number}`);
    return row ? el("a", { href: `#${row.id}` }, words) : words;
  }

  state() {
    const silence = this.silence();
    if (silence) return silence;
    const found = newest(this.known.states, this.at);
    if (!found || !this.text(found[2]) || this.isCounted()) return say("read_unknown");
    return this.found("read_from", found);
  }

  command() {
    const silence = this.silence();
    if (silence) return silence;
    const found = newest(this.known.commands, this.at);
    return found ? this.found("read_happened", found) : say(this.isCounted() ? "read_unknown" : "read_no_command");
  }

  /** Whether events happened by now for which there was no room. */
  isCounted() {
    return this.known.events_until !== null && this.at > this.known.events_until;
  }

  value(name) {
    const points = this.known[name];
    const silence = this.silence();
    if (silence || !points.length) return silence ?? "–";
    const invalid = this.known.invalid.find(([from, to]) => from <= this.at && (to === null || this.at < to));
    if (invalid) return this.text(invalid[2]);
    const found = newest(points, this.at);
    if (!found) return say("read_none_yet");
    const [at, least, most, frame] = found;
    const values = least === most ? this.percent(least) : say("read_range", { least: this.percent(least), most: this.percent(most) });
    const where = frame === null ? say("read_at", { time: inSeconds(at) }) : [say("read_at", { time: inSeconds(at) }), ", ", this.frame(frame)];
    return [`${values} `, el("span", { class: "dim" }, where)];
  }

  /** `60.0 %`, with what that is where somebody said what 100 % is. */
  percent(raw) {
    const part = raw / this.known.full;
    const shown = this.known.reference.map(([whole, unit]) => `${Number((whole * part).toPrecision(4))} ${unit}`.trim());
    return [`${(part * 100).toFixed(2)} %`, ...shown].join(", ");
  }

  /** The jobs that are under way; one that is over at once, or without end, for as long as its bar is wide. */
  jobs(jobs) {
    if (this.at === null) return "–";
    const least = (3 / this.width) * this.span;
    const found = jobs.filter(([from, to]) => from <= this.at && this.at <= Math.max(to ?? from, from + least));
    const told = found.slice(0, 3).flatMap(([, , id, frame, place]) => [", ",
      el("a", { href: `#job-${this.number.split("-")[0]}-${id}` }, `#${id}`), ` ${this.text(place)} (${say("frame", { n: frame })})`]);
    return told.length ? [...told.slice(1), found.length > 3 ? ` +${found.length - 3}` : ""] : "–";
  }
}
