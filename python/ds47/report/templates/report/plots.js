// The plots of a capture: what is plotted, and the words with it. How a chart is drawn is in chart.js; percentiles and
// groups are in plot_marks.js.

const COLOR = { good: "#2e9e5b", bad: "#d9483b", open: "#c07c10", read: "#2f7fd1", change: "#9a5fd0", orphan: "#9aa4ae", sent: "#c07c10", state: "#7b8794", axis: "#7b8794" };
const MOST_POINTS = 6000;
const MOST_PICKED = 3000;
const PALETTE = ["#2f7fd1", "#9a5fd0", "#1f9c94", "#c2762b", "#b0488f", "#6b7f2a", "#5b6bd6"];
const MARKERS = ["circle", "diamond", "triangle", "square", "inverted_triangle", "hex", "star"];
const OF_A_STRETCH = 20; // transactions of which percentiles are taken
const STRETCHES = 60;
const PERCENTS = [[50, null, "#7b8794"], [95, "7 4", "#c07c10"], [99, "2 3", "#c2502e"]];
const WIDE = 20; // from this ratio on an axis of durations is logarithmic
const WIDE_VALUES = 1000;
const BINS = 48;
const LOAD_KINDS = { good: "ok", orphan: "orphan", open: "open", bad: "failed" }; // from kind to what the legend says

class Plots {
  constructor(place, capture, partly) {
    Object.assign(this, { place, capture, partly });
    this.picked = null;
  }

  async draw() {
    const { capture } = this;
    const timed = capture.rows.filter((row) => (capture.get(row, "duration") ?? -1) >= 0);
    this.place.replaceChildren();
    this.time = this.timeAxis();
    if (timed.length) {
      this.distribution(timed);
      this.latency(timed);
    } else {
      this.place.append(el("p", {}, say("plot_no_times")));
    }
    this.load();
    this.value();
  }

  /** An empty plot in its frame: [canvas, what is said below]. */
  frame(words, text, { controls = [] } = {}) {
    const canvas = el("div", { class: "canvas", role: "img", "aria-label": `${say(words)}: ${text}` });
    const note = this.partly ? ` ${say("plot_partly")}` : "";
    const about = el("p", { class: "dim" }, text + note);
    this.place.append(el("figure", { class: "plot" }, el("figcaption", {}, say(words)), ...controls, canvas, about));
    return [canvas, about];
  }

  distribution(timed) {
    const { capture } = this;
    const ms = timed.map((row) => capture.get(row, "duration") / 1000).sort((a, b) => a - b);
    const slowest = ms[ms.length - 1];
    const [canvas] = this.frame("plot_distribution", say("plot_figures", figuresOf(ms)));
    const low = Math.max(ms.find((value) => value > 0) || 0.001, slowest / 1e6);
    const wide = slowest / low > WIDE;
    const count = Math.min(BINS, Math.max(8, Math.ceil(Math.sqrt(ms.length)) * 2));
    const [from, to] = wide ? [Math.log10(low), Math.log10(slowest * 1.001)] : [0, slowest * 1.001 || 1];
    const edge = (number) => { const value = from + ((to - from) * number) / count; return wide ? 10 ** value : value; };
    const top = new Array(count).fill(0);
    for (const value of ms) {
      const place = (wide ? Math.log10(Math.max(value, low)) : value) - from;
      top[Math.min(count - 1, Math.floor((place / (to - from)) * count))] += 1;
    }
    const bars = top.map((number, at) => ({ left: edge(at), right: edge(at + 1), bottom: 0, top: number }));
    const chart = new Chart({ label: say("plot_milliseconds"), range: [edge(0), edge(count)], log: wide }, countAxis(top));
    const tell = (bar) => [["ms", `${bar.left.toFixed(1)} – ${bar.right.toFixed(1)}`], [say("plot_jobs"), grouped(bar.top)]];
    chart.add("bars", bars, { color: COLOR.read, filled: 0.75, width: 0, tell });
    chart.show(canvas);
  }

  /** Time, the same for all plots over it: from when until when there is something. */
  timeAxis() {
    const { clock, rows, events } = this.capture;
    const starts = rows.map((row) => this.capture.get(row, "start") / 1e6);
    const [begin, end] = span([...starts, ...(events || []).map(([us]) => us / 1e6)]);
    const around = Math.max(room(begin, end), 0.01);
    const label = clock.known ? say("plot_time_of_day", { zone: clock.parts(begin * 1e6)[2] }) : say("plot_seconds");
    return { label, range: [begin - around / 4, end + around / 2], clock };
  }

  /** By what transactions are told apart: only what has several. */
  groupings() {
    const { capture } = this;
    const known = [["controller", "plot_by_controller", (row) => capture.controller(row)], ["drive", "plot_by_drive", (row) => capture.drive(row)], ["target", "plot_by_target", (row) => capture.target(row)], ["operation", "col_operation", (row) => operationName(capture.operation(row))]];
    const names = known.map(([, , of]) => new Set(capture.rows.map(of)).size);
    return known.filter(([key], place) => names[place] > 1 && !(key === "target" && names[place] === names[1])).concat(names.some((n) => n > 1) ? [] : [known[3]]);
  }

  latency(timed) {
    const all = this.groupings();
    this.grouping = all.find(([key]) => key === this.grouping?.[0]) || all[0];
    const change = (event) => { this.grouping = all.find(([key]) => key === event.target.value); this.drawLatency(timed, parts); };
    const options = all.map(([key, words]) => el("option", { value: key, selected: key === this.grouping[0] }, say(words)));
    const select = el("select", { "aria-label": say("plot_by"), "data-grouping": true, onchange: change }, options);
    const controls = all.length > 1 ? [el("label", {}, `${say("plot_by")} `, select)] : [];
    const [canvas, about] = this.frame("plot_latency", "", { controls });
    const parts = { canvas, about, table: el("div", { class: "wide" }) };
    about.after(parts.table);
    this.drawLatency(timed, parts);
  }

  drawLatency(timed, { canvas, about, table }) {
    const { capture } = this;
    const [, words, of] = this.grouping;
    const points = timed.map((row) => ({ x: capture.get(row, "start") / 1e6, y: capture.get(row, "duration") / 1000, id: capture.get(row, "id"), row }));
    const positive = points.map(({ y }) => y).filter((y) => y > 0);
    const [least, most] = span(positive);
    const log = most / least > WIDE;
    if (log) for (const point of points) Object.assign(point, { y: Math.max(point.y, least), value: point.y }); // a logarithm has no 0
    const range = log ? [least / 1.3, most * 1.3] : [0, (positive.length ? most : 1) * 1.08];
    const chart = new Chart(this.time, { label: say("plot_milliseconds"), range, log });
    const said = ({ y, value }) => [say("col_duration"), duration((value ?? y) * 1000)];
    const groups = biggest(points, ({ row }) => of(row), PALETTE.length);
    const told = [];
    for (const [place, [name, mine]] of groups.entries()) {
      const drawn = thinned(mine);
      if (drawn.length < mine.length) told.push(say("plot_thinned", { n: grouped(drawn.length), all: grouped(mine.length) }));
      this.points(chart, drawn, { color: PALETTE[place], words: name ?? say("plot_others"), mark: MARKERS[place] }, said);
    }
    const size = stretch(points.length);
    if (size) this.percentileLines(chart, points, size);
    this.findings(chart, points, said);
    this.events(chart);
    const text = [say("plot_figures", figuresOf(measured(points))), ...(size ? [say("plot_stretches", { n: grouped(size) })] : []), ...told, ...(this.partly ? [say("plot_partly")] : [])].join(" ");
    about.textContent = text;
    canvas.setAttribute("aria-label", `${say("plot_latency")}: ${text}`);
    table.replaceChildren(...(groups.length > 1 ? [figuresTable(say(words), groups)] : []));
    chart.show(canvas);
  }

  /** Percentiles of each stretch of so many transactions, in the order of time. */
  percentileLines(chart, points, size) {
    const inTime = [...points].sort((a, b) => a.x - b.x);
    const stretches = [];
    for (let from = 0; from < inTime.length; from += size) {
      if (inTime.length - from < size && stretches.length) stretches[stretches.length - 1].push(...inTime.slice(from));
      else stretches.push(inTime.slice(from, from + size));
    }
    const ends = stretches.map((each) => each[0].x).concat(inTime[inTime.length - 1].x);
    const sorted = stretches.map((each) => each.map(({ y }) => y).sort((a, b) => a - b));
    for (const [percent, dash, color] of PERCENTS) {
      const y = sorted.map((each) => nearestRank(each, percent));
      const steps = ends.map((x, at) => ({ x, y: y[at] ?? y.at(-1) }));
      const tell = (step) => [[`p${percent}`, duration(step.y * 1000)], [say("col_time"), this.capture.clock.both(step.x * 1e6)]];
      chart.add("steps", steps, { color, dash, width: 2, words: `p${percent}`, tell });
    }
  }

  /** Marks that say which transaction they are, and open it. said: what of a point is its value, [name, text]. */
  points(chart, points, look, said) {
    const { capture } = this;
    const tell = (point) => [
      [say("col_id"), `#${point.id}`], [say("col_device"), capture.target(point.row)], [say("col_time"), capture.clock.both(capture.get(point.row, "start"))],
      [say("plot_frame"), String(capture.frames(point.row)[0])], said(point), [say("plot_by_controller"), capture.controller(point.row)], [say("plot_findings"), this.rules(point.row)],
    ];
    const size = points.length > 800 ? 2.5 : look.mark === "circle" ? 3.5 : 5;
    chart.add("marks", points, { size, width: look.mark === "x" ? 2 : 1, filled: look.mark === "x" ? 0 : 0.7, tell, open: ({ id }) => openJob(capture.number, id), ...look });
  }

  /** The errors and warnings of a transaction. */
  rules(row) {
    const found = this.capture.rulesOf(row).filter(([, , severity]) => severity !== "note");
    return found.map(([id, name]) => `${id} ${name}`).join(say("separator"));
  }

  /** A ring around each transaction that has an error or a warning. */
  findings(chart, points, said) {
    const found = sampled(points.filter(({ row }) => this.rules(row)), MOST_POINTS);
    if (found.length) this.points(chart, found, { color: COLOR.bad, filled: 0, width: 1.4, size: found.length > 800 ? 4 : 6.5, mark: "ring", words: say("plot_findings") }, said);
  }

  /** What cyclic frames say of drives, as lines on the axis of time. */
  events(chart) {
    const { clock, events } = this.capture;
    for (const [kind, words, color, dash] of [["state", "plot_event_state", COLOR.state, "5 4"], ["fault", "plot_event_fault", COLOR.bad, null]]) {
      const lines = (events || []).filter((each) => each[1] === kind).map((each) => ({ x: each[0] / 1e6, each }));
      const tell = ({ each }) => [[say("col_time"), clock.both(each[0])], [say("plot_frame"), String(each[5])], [say("plot_event"), `${each[4]}: ${either(each, 2)}`]];
      if (lines.length) chart.add("lines", lines, { color, dash, words: say(words), tell });
    }
  }

  load() {
    const { capture } = this;
    let [begin, end] = [Infinity, -Infinity];
    for (const row of capture.rows) {
      const start = capture.get(row, "start") / 1e6;
      [begin, end] = [Math.min(begin, start), Math.max(end, start)];
    }
    const seconds = Math.max(end - begin, 1e-3);
    const width = (seconds * 1.0001) / BINS;
    const kinds = Object.fromEntries(Object.keys(LOAD_KINDS).map((kind) => [kind, new Array(BINS).fill(0)]));
    for (const row of capture.rows) {
      const kind = capture.kinds[capture.state(row)];
      kinds[kind][Math.min(BINS - 1, Math.floor((capture.get(row, "start") / 1e6 - begin) / width))] += 1;
    }
    const { transactions, states } = capture.totals; // of all, listed or not
    const seen = capture.states.filter((state) => states[state]);
    const text = say("plot_load_text", { n: grouped(transactions), seconds: seconds.toFixed(1), states: told(seen.map((state) => [states[state], stateName(state)])) });
    const [canvas] = this.frame("plot_load", text);
    const chart = new Chart(this.time, countAxis(Object.values(kinds).reduce((sums, more) => sums.map((sum, at) => sum + more[at]))));
    let under = new Array(BINS).fill(0);
    for (const kind of Object.keys(LOAD_KINDS)) {
      const words = stateName(LOAD_KINDS[kind]);
      const bars = kinds[kind].map((number, at) => ({ left: begin + at * width, right: begin + (at + 1) * width, bottom: under[at], top: under[at] + number, number })).filter(({ number }) => number);
      const tell = (bar) => [[say("col_time"), `${capture.clock.both(bar.left * 1e6)} – ${capture.clock.both(bar.right * 1e6)}`], [words, grouped(bar.number)]];
      if (bars.length) chart.add("bars", bars, { color: COLOR[kind], filled: 0.8, width: 0, words, tell });
      under = under.map((height, at) => height + kinds[kind][at]);
    }
    this.events(chart);
    chart.show(canvas);
  }

  /** Every element that has numbers, with its points in the order of time. */
  series() {
    if (this.found) return this.found;
    const { capture } = this;
    const found = new Map();
    for (const row of capture.rows) {
      const state = capture.state(row);
      if (state === "mismatch" || state === "orphan" || !["read", "change"].includes(capture.operation(row))) continue;
      const change = capture.operation(row) === "change";
      for (const item of capture.parameters(row)) {
        if (item.pnu === null || item.attribute !== "value") continue;
        const refused = change && (item.error !== null || state === "refused");
        const unsure = change && !["ok", "partial"].includes(state);
        item.values.forEach((value, number) => {
          const y = item.scaled ? Number.parseFloat(item.scaled[number]) : Number(value);
          const raw = item.scaled && item.described ? Number(value) : null; // as it stands where nothing was described yet
          if (!Number.isFinite(y) || value === "") return;
          const subindex = item.subindex + number;
          const global = capture.global_pnus.includes(item.pnu); // the device has it once, whichever drive object is asked
          const key = `${global ? `device ${capture.get(row, "device")}` : capture.get(row, "object")}/${item.pnu}/${subindex}`;
          if (!found.has(key)) {
            found.set(key, { key, pnu: item.pnu, subindex, names: item.names, units: new Set(), drive: global ? capture.drive(row) : capture.target(row), points: [], kinds: new Set() });
          }
          const kind = refused ? "refused" : unsure ? "sent" : change ? "written" : "read";
          found.get(key).points.push({ x: (capture.get(row, "start") + (capture.get(row, "duration") || 0)) / 1e6, y, raw, id: capture.get(row, "id"), kind, row });
          found.get(key).kinds.add(kind);
          if (item.unit) found.get(key).units.add(item.unit);
          if (item.names[0]) found.get(key).names = item.names;
        });
      }
    }
    for (const each of found.values()) measure(each);
    this.found = [...found.values()].sort((a, b) => b.kinds.size - a.kinds.size || varies(b) - varies(a) || b.points.length - a.points.length);
    return this.found;
  }

  value() {
    const all = this.series();
    if (!all.length) {
      this.place.append(el("figure", { class: "plot" }, el("figcaption", {}, say("plot_value")), el("p", {}, say("plot_none"))));
      return;
    }
    const shown = all.slice(0, MOST_PICKED);
    const current = shown.find((each) => each.key === this.picked) || shown[0];
    const label = (each) => `${each.drive}  ${this.capture.element(each.pnu, each.subindex)} ${either(each.names)}`;
    const sorted = [...shown].sort((a, b) => compare(a.drive, b.drive, 1) || a.pnu - b.pnu || a.subindex - b.subindex);
    const pick = (key) => { this.picked = key; this.drawValue(shown.find((each) => each.key === key)); };
    const select = el("select", { "aria-label": say("plot_pick"), "data-picker": true, onchange: (event) => pick(event.target.value) });
    const offer = (those) => select.replaceChildren(...those.map((each) => el("option", { value: each.key, selected: each.key === (this.picked ?? current.key) }, label(each))));
    offer(sorted);
    const count = el("span", { class: "dim", role: "status" });
    const search = (event) => {
      const parts = event.target.value.toLowerCase().split(/\s+/).filter(Boolean).map(finder);
      const those = sorted.filter((each) => parts.every((has) => has(label(each).toLowerCase())));
      count.textContent = parts.length ? say("plot_found", { n: grouped(those.length), all: grouped(sorted.length) }) : "";
      offer(those);
      if (those.length && !those.some((each) => each.key === this.picked)) pick(select.value);
    };
    const input = el("input", { type: "search", placeholder: say("plot_search"), "aria-label": say("plot_search"), "data-picker-search": true, autocomplete: "off", spellcheck: "false", oninput: search });
    const controls = [el("div", { class: "picker" }, ...(sorted.length > 8 ? [input] : []), select, count)];
    const [canvas, about] = this.frame("plot_value", "", { controls });
    Object.assign(this, { valueCanvas: canvas, valueAbout: about });
    this.drawValue(current);
  }

  drawValue(series) {
    const canvas = this.valueCanvas, parameter = this.capture.element(series.pnu, series.subindex);
    const count = (kind) => series.points.filter((point) => point.kind === kind).length;
    const accepted = series.points.filter(({ kind }) => kind === "read" || kind === "written");
    const [low, high] = span((accepted.length ? accepted : series.points).map(({ y }) => y));
    const log = low > 0 && high / low > WIDE_VALUES;
    const edges = log ? [low / 1.6, high * 1.6] : [low - room(low, high), high + room(low, high)];
    // what was not accepted does not set the scale: beyond it, it stands at the edge with its value
    const points = series.points.map((point) => ({ ...point, value: point.y, y: Math.min(Math.max(point.y, edges[0]), edges[1]) }));
    const beyond = points.filter(({ y, value }) => y !== value).length;
    const unit = series.unit ? ` ${series.unit}` : "";
    const range = say(low === high ? "plot_one_value" : "plot_range", { low: low + unit, high: high + unit });
    const text = say("plot_value_text", { points: say("points", { n: grouped(points.length) }), read: grouped(count("read")), written: grouped(count("written")), sent: grouped(count("sent")), refused: grouped(count("refused")), range })
      + (beyond ? ` ${say("plot_beyond", { n: grouped(beyond) })}` : "");
    canvas.setAttribute("aria-label", `${say("plot_value")}, ${parameter}: ${text}`);
    this.valueAbout.textContent = text;
    const chart = new Chart(this.time, { label: `${parameter}${series.unit ? ` (${series.unit})` : ""}`, range: edges, log });
    const said = ({ value }) => [parameter, value + unit];
    const known = thinned(points.filter(({ kind }) => kind === "read" || kind === "written").sort((a, b) => a.x - b.x));
    if (known.length > 1) chart.add("steps", known, {});
    for (const [kind, color, words, mark] of [["read", "read", "plot_read", "circle"], ["written", "change", "plot_written", "diamond"], ["sent", "sent", "plot_sent", "triangle"], ["refused", "bad", "plot_not_taken", "x"]]) {
      const mine = thinned(points.filter((point) => point.kind === kind));
      if (mine.length) this.points(chart, mine, { color: COLOR[color], words: say(words), mark }, said);
    }
    this.findings(chart, points, said);
    this.events(chart);
    chart.show(canvas);
  }
}

/** One axis has one unit: where a description scales some of the values only, all of them stand as they were sent. */
function measure(series) {
  const mixed = series.points.some(({ raw }) => raw !== null) && series.points.some(({ raw }) => raw === null);
  if (mixed) for (const point of series.points) point.y = point.raw ?? point.y;
  series.unit = mixed || series.units.size !== 1 ? null : [...series.units][0];
}

function varies({ points }) {
  return points.some(({ y }) => y !== points[0].y);
}

/** At most so many points: of each stretch of time the lowest and the highest. */
function thinned(points, most = MOST_POINTS) {
  if (points.length <= most) return points;
  const size = Math.ceil((points.length * 2) / most);
  const kept = [];
  for (let from = 0; from < points.length; from += size) {
    let [low, high] = [points[from], points[from]];
    for (const point of points.slice(from, from + size)) {
      if (point.y < low.y) low = point;
      if (point.y > high.y) high = point;
    }
    kept.push(low);
    if (high !== low) kept.push(high);
  }
  return kept;
}

function sampled(rows, most) {
  return rows.length <= most ? rows : rows.filter((_, number) => number % Math.ceil(rows.length / most) === 0);
}
