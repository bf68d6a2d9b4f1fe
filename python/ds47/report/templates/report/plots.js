// The plots of a capture. The library is unpacked when the first plot comes into view.
//
// Backgrounds are transparent and the colours fit light and dark, so that a change of theme, and paper, need nothing.
// Keys, marks of findings and events of drives, which several plots have, are in plot_marks.js.

const COLOR = { good: "#2e9e5b", bad: "#d9483b", open: "#d08a1d", read: "#2f7fd1", change: "#9a5fd0", orphan: "#9aa4ae", sent: "#d08a1d", state: "#7b8794", axis: "#7b8794", grid: "rgba(123,135,148,.28)" };
const MOST_POINTS = 6000;
const MOST_PICKED = 3000;
const PALETTE = ["#2f7fd1", "#9a5fd0", "#1f9c94", "#c2762b", "#b0488f", "#6b7f2a", "#5b6bd6"];
const MARKERS = ["circle", "diamond", "triangle", "square", "inverted_triangle", "hex", "star"];
const OF_A_STRETCH = 20; // transactions of which percentiles are taken
const STRETCHES = 60;
const PERCENTS = [[50, "solid", "#7b8794"], [95, "dashed", "#d08a1d"], [99, "dotted", "#c2502e"]];
const WIDE = 20; // from this ratio on an axis of durations is logarithmic
const WIDE_VALUES = 1000;
const BINS = 48;
const LOAD_KINDS = ["good", "orphan", "open", "bad"];
let libraryReady = null;

/** The plotting library, started once. */
function plotLibrary() {
  libraryReady ??= (async () => {
    for (let number = 0; document.getElementById(`library-${number}`); number += 1) {
      const script = document.createElement("script");
      script.textContent = await embedded(`library-${number}`);
      document.head.append(script);
    }
    return window.Bokeh;
  })();
  return libraryReady;
}

class Plots {
  constructor(place, capture, partly) {
    Object.assign(this, { place, capture, partly });
    this.picked = null;
    this.views = [];
  }

  async draw() {
    this.bokeh = await plotLibrary();
    const { capture } = this;
    const timed = capture.rows.filter((row) => (capture.get(row, "duration") ?? -1) >= 0);
    this.place.replaceChildren();
    this.views = [];
    this.reach = this.ends();
    if (timed.length) {
      this.distribution(timed);
      this.latency(timed);
    } else {
      this.place.append(el("p", {}, say("plot_no_times")));
    }
    this.load();
    this.value();
    await this.painted();
  }

  /** Waits, not for ever, until the library has painted what it was given: it does so in its own time. */
  async painted() {
    const documents = (await Promise.all(this.views)).map((view) => view.model.document);
    for (let patience = 100; patience && documents.some((each) => each && !each.is_idle); patience -= 1) {
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  /** An empty plot in its frame: [canvas element, figure maker]. */
  frame(words, text, { controls = [] } = {}) {
    const canvas = el("div", { class: "canvas", role: "img", "aria-label": `${say(words)}: ${text}` });
    const note = this.partly ? ` ${say("plot_partly")}` : "";
    const about = el("p", { class: "dim" }, text + note);
    this.place.append(el("figure", { class: "plot" }, el("figcaption", {}, say(words)), ...controls, canvas, about));
    return [canvas, about];
  }

  figure(x, y, options = {}) {
    const figure = this.bokeh.Plotting.figure({
      sizing_mode: "stretch_both", tools: "pan,wheel_zoom,box_zoom,reset,save", toolbar_location: "above",
      background_fill_color: null, border_fill_color: null, outline_line_color: null, output_backend: "canvas", ...options,
    });
    Object.assign(figure.toolbar, { logo: null, autohide: true }); // and so there is none on paper
    for (const axis of [figure.xaxis, figure.yaxis]) axis.formatter = new this.bokeh.BasicTickFormatter({ power_limit_high: 7 });
    for (const [axis, title] of [[figure.xaxis, x], [figure.yaxis, y]]) {
      Object.assign(axis, {
        axis_label: title, axis_label_text_color: COLOR.axis, major_label_text_color: COLOR.axis, axis_label_text_font_style: "normal",
        axis_line_color: COLOR.axis, major_tick_line_color: COLOR.axis, minor_tick_line_color: null,
      });
    }
    figure.xgrid.grid_line_color = COLOR.grid;
    figure.ygrid.grid_line_color = COLOR.grid;
    return figure;
  }

  /** The key stands above the canvas, as buttons: whole at any width, and each hides what it names. */
  legend(figure) {
    figure.legend.visible = false;
    figure.keyed = true;
  }

  show(figure, canvas) {
    canvas.parentElement.querySelector(".keys")?.remove();
    if (figure.keyed) canvas.before(plotKey(figure));
    this.views.push(this.bokeh.Plotting.show(figure, canvas));
  }

  /** When something was, for each of its points: time of day and seconds since the first frame. */
  times(seconds) {
    return seconds.map((each) => this.capture.clock.both(each * 1e6));
  }

  hover(figure, renderers, tooltips) {
    figure.add_tools(new this.bokeh.HoverTool({ renderers, tooltips, visible: false }));
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
    const figure = this.figure(say("plot_milliseconds"), say("plot_jobs"), wide ? { x_axis_type: "log" } : {});
    const left = top.map((_, number) => edge(number));
    const right = top.map((_, number) => edge(number + 1));
    const source = this.source({ left, right, top });
    const bars = figure.quad({ field: "left" }, { field: "right" }, { value: 0 }, { field: "top" }, { source, fill_color: COLOR.read, fill_alpha: 0.75, line_color: null });
    this.hover(figure, [bars], [["ms", "@left{0.0} – @right{0.0}"], [say("plot_jobs"), "@top"]]);
    this.show(figure, canvas);
  }

  /** From when until when there is something: all plots over time have the same axis. */
  ends() {
    const starts = this.capture.rows.map((row) => this.capture.get(row, "start") / 1e6);
    const [begin, end] = span([...starts, ...(this.capture.events || []).map(([us]) => us / 1e6)]);
    return { start: begin - room(begin, end) / 4, end: end + room(begin, end) / 2 };
  }

  /** A figure whose axis is time. */
  overTimeFigure(y, options = {}) {
    return this.figure(say("plot_seconds"), y, { x_range: new this.bokeh.Range1d(this.reach), ...options });
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
    const figure = this.overTimeFigure(say("plot_milliseconds"), log ? { y_axis_type: "log" } : {});
    const groups = biggest(points, ({ row }) => of(row), PALETTE.length);
    const told = [];
    for (const [place, [name, mine]] of groups.entries()) {
      const drawn = thinned(mine);
      if (drawn.length < mine.length) told.push(say("plot_thinned", { n: grouped(drawn.length), all: grouped(mine.length) }));
      this.points(figure, drawn, PALETTE[place], name ?? say("plot_others"), MARKERS[place], "ms");
    }
    const size = stretch(points.length);
    if (size) this.percentileLines(figure, points, size);
    this.findings(figure, points);
    this.events(figure);
    this.legend(figure);
    canvas.replaceChildren();
    const text = [say("plot_figures", figuresOf(measured(points))), ...(size ? [say("plot_stretches", { n: grouped(size) })] : []), ...told, ...(this.partly ? [say("plot_partly")] : [])].join(" ");
    about.textContent = text;
    canvas.setAttribute("aria-label", `${say("plot_latency")}: ${text}`);
    table.replaceChildren(...(groups.length > 1 ? [figuresTable(say(words), groups)] : []));
    this.show(figure, canvas);
  }

  /** Percentiles of each stretch of so many transactions, in the order of time. */
  percentileLines(figure, points, size) {
    const inTime = [...points].sort((a, b) => a.x - b.x);
    const stretches = [];
    for (let from = 0; from < inTime.length; from += size) {
      if (inTime.length - from < size && stretches.length) stretches[stretches.length - 1].push(...inTime.slice(from));
      else stretches.push(inTime.slice(from, from + size));
    }
    const ends = stretches.map((each) => each[0].x).concat(inTime[inTime.length - 1].x);
    const sorted = stretches.map((each) => each.map(({ y }) => y).sort((a, b) => a - b));
    for (const [percent, line_dash, line_color] of PERCENTS) {
      const y = sorted.map((each) => nearestRank(each, percent));
      const source = this.source({ x: ends, y: y.concat(y[y.length - 1]), time: this.times(ends) });
      const line = figure.step({ field: "x" }, { field: "y" }, "after", { source, line_color, line_dash, line_width: 2, legend_label: `p${percent}` });
      this.hover(figure, [line], [[`p${percent}`, "@y{0.000} ms"], [say("col_time"), "@time"]]);
    }
  }

  source(data) {
    return new this.bokeh.ColumnDataSource({ data });
  }

  /** Marks that open their transaction when they are clicked. */
  points(figure, points, color, words, marker, unit) {
    const data = { x: points.map(({ x }) => x), y: points.map(({ y }) => y), id: points.map(({ id }) => id), value: points.map(({ y, value }) => value ?? y), by: points.map(({ row }) => this.capture.controller(row)), frame: points.map(({ row }) => this.capture.frames(row)[0]), time: this.times(points.map(({ row }) => this.capture.get(row, "start") / 1e6)) };
    const source = this.source(data);
    const marks = figure.scatter({ field: "x" }, { field: "y" }, {
      source, marker, size: (points.length > 800 ? 4 : 7) + (marker === "circle" ? 0 : 3), line_width: marker === "x" ? 2 : 1, fill_color: color, line_color: color, fill_alpha: 0.7, line_alpha: 0.9, legend_label: words,
    });
    this.hover(figure, [marks], [[say("col_id"), "#@id"], [say("col_time"), "@time"], [say("plot_frame"), "@frame"], [unit, "@value"], [say("plot_by_controller"), "@by"]]);
    this.opens(figure, marks, source, data.id);
    return marks;
  }

  /** A click on one of the marks opens its transaction. */
  opens(figure, marks, source, ids) {
    figure.add_tools(new this.bokeh.TapTool({ renderers: [marks], visible: false }));
    source.selected.properties.indices.change.connect(() => {
      const [first] = source.selected.indices;
      if (first !== undefined) openJob(this.capture.number, ids[first]);
    });
  }

  /** A ring around each transaction that has an error or a warning. */
  findings(figure, points) {
    const found = points.flatMap((point) => {
      const rules = this.capture.rulesOf(point.row).filter(([, , severity]) => severity !== "note");
      return rules.length ? [{ ...point, rules: rules.map(([id, name]) => `${id} ${name}`).join(say("separator")) }] : [];
    });
    if (!found.length) return;
    const shown = sampled(found, MOST_POINTS);
    const source = this.source({ x: shown.map(({ x }) => x), y: shown.map(({ y }) => y), id: shown.map(({ id }) => id), rules: shown.map(({ rules }) => rules) });
    const rings = figure.scatter({ field: "x" }, { field: "y" }, { source, marker: "circle", size: shown.length > 800 ? 8 : 13, fill_color: null, line_color: COLOR.bad, line_width: 1.4, legend_label: say("plot_findings") });
    this.hover(figure, [rings], [[say("col_id"), "#@id"], [say("plot_findings"), "@rules"]]);
    this.opens(figure, rings, source, shown.map(({ id }) => id));
  }

  /** What cyclic frames say of drives, as lines on the axis of time. */
  events(figure) {
    for (const [kind, words, line_dash] of [["state", "plot_event_state", "dashed"], ["fault", "plot_event_fault", "solid"]]) {
      const events = (this.capture.events || []).filter((each) => each[1] === kind);
      if (!events.length) continue;
      const source = this.source({ x: events.map(([us]) => us / 1e6), text: events.map((each) => either(each, 2)), place: events.map((each) => each[4]), frame: events.map((each) => each[5]), time: this.times(events.map(([us]) => us / 1e6)) });
      const lines = figure.vspan({ field: "x" }, { source, line_color: kind === "fault" ? COLOR.bad : COLOR.state, line_dash, line_alpha: 0.8, legend_label: say(words) });
      this.hover(figure, [lines], [[say("col_time"), "@time"], [say("plot_frame"), "@frame"], [say("plot_event"), "@place: @text"]]);
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
    const kinds = Object.fromEntries(LOAD_KINDS.map((kind) => [kind, new Array(BINS).fill(0)]));
    for (const row of capture.rows) {
      const kind = capture.kinds[capture.state(row)];
      kinds[kind][Math.min(BINS - 1, Math.floor((capture.get(row, "start") / 1e6 - begin) / width))] += 1;
    }
    const { transactions, states } = capture.totals; // of all, listed or not
    const seen = capture.states.filter((state) => states[state]);
    const text = say("plot_load_text", { n: grouped(transactions), seconds: seconds.toFixed(1), states: told(seen.map((state) => [states[state], stateName(state)])) });
    const [canvas] = this.frame("plot_load", text);
    const figure = this.overTimeFigure(say("plot_jobs"));
    let bottom = new Array(BINS).fill(0);
    const left = bottom.map((_, number) => begin + number * width);
    const right = bottom.map((_, number) => begin + (number + 1) * width);
    for (const kind of LOAD_KINDS) {
      if (!kinds[kind].some(Boolean)) continue;
      const words = seen.filter((state) => capture.kinds[state] === kind).map(stateName).join(say("separator"));
      const top = bottom.map((value, number) => value + kinds[kind][number]);
      const source = this.source({ left, right, bottom, top, count: kinds[kind], from: this.times(left), to: this.times(right) });
      const bars = figure.quad({ field: "left" }, { field: "right" }, { field: "bottom" }, { field: "top" }, { source, fill_color: COLOR[kind], fill_alpha: 0.8, line_color: null, legend_label: words });
      this.hover(figure, [bars], [[say("col_time"), "@from – @to"], [words, "@count"]]);
      bottom = top;
    }
    this.events(figure);
    this.legend(figure);
    this.show(figure, canvas);
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
    const text = say("plot_value_text", { n: grouped(points.length), read: grouped(count("read")), written: grouped(count("written")), sent: grouped(count("sent")), refused: grouped(count("refused")), low: low + unit, high: high + unit })
      + (beyond ? ` ${say("plot_beyond", { n: grouped(beyond) })}` : "");
    canvas.setAttribute("aria-label", `${say("plot_value")}, ${parameter}: ${text}`);
    this.valueAbout.textContent = text;
    const figure = this.overTimeFigure(`${parameter}${series.unit ? ` (${series.unit})` : ""}`, { y_range: new this.bokeh.Range1d({ start: edges[0], end: edges[1] }), ...(log ? { y_axis_type: "log" } : {}) });
    const known = thinned(points.filter(({ kind }) => kind === "read" || kind === "written").sort((a, b) => a.x - b.x));
    if (known.length > 1) {
      figure.step({ field: "x" }, { field: "y" }, "after", { source: this.source({ x: known.map(({ x }) => x), y: known.map(({ y }) => y) }), line_color: COLOR.axis, line_alpha: 0.55 });
    }
    for (const [kind, color, words, marker] of [["read", "read", "plot_read", "circle"], ["written", "change", "plot_written", "diamond"], ["sent", "sent", "plot_sent", "triangle"], ["refused", "bad", "plot_not_taken", "x"]]) {
      const mine = thinned(points.filter((point) => point.kind === kind));
      if (mine.length) this.points(figure, mine, COLOR[color], say(words), marker, series.unit || "=");
    }
    this.findings(figure, points);
    this.events(figure);
    this.legend(figure);
    canvas.replaceChildren();
    this.show(figure, canvas);
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
