// The plots of a capture. The library is unpacked when the first plot comes into view.
//
// Backgrounds are transparent and the colours fit light and dark, so that a change of theme, and paper, need nothing.

const COLOR = { good: "#2e9e5b", bad: "#d9483b", open: "#d08a1d", read: "#2f7fd1", change: "#9a5fd0", orphan: "#9aa4ae", sent: "#d08a1d", axis: "#7b8794", grid: "rgba(123,135,148,.28)" };
const MOST_POINTS = 6000;
const MOST_PICKED = 3000;
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
  frame(words, text, { broad = false, controls = [] } = {}) {
    const canvas = el("div", { class: "canvas", role: "img", "aria-label": `${say(words)}: ${text}` });
    const note = this.partly ? ` ${say("plot_partly")}` : "";
    const about = el("p", { class: "dim" }, text + note);
    this.place.append(el("figure", { class: `plot${broad ? " broad" : ""}` }, el("figcaption", {}, say(words)), ...controls, canvas, about));
    return [canvas, about];
  }

  figure(x, y, options = {}) {
    const figure = this.bokeh.Plotting.figure({
      sizing_mode: "stretch_both", tools: "pan,wheel_zoom,box_zoom,reset,save", toolbar_location: "above",
      background_fill_color: null, border_fill_color: null, outline_line_color: null, output_backend: "canvas", ...options,
    });
    Object.assign(figure.toolbar, { logo: null, autohide: true }); // and so there is none on paper
    for (const [axis, type] of [[figure.xaxis, options.x_axis_type], [figure.yaxis, options.y_axis_type]]) {
      if (type === "log") axis.formatter = new this.bokeh.BasicTickFormatter();
    }
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

  legend(figure) {
    Object.assign(figure.legend, {
      background_fill_color: null, border_line_color: null, label_text_color: COLOR.axis, location: "top_left",
      orientation: "horizontal", click_policy: "hide", padding: 0, margin: 2, label_text_font_size: "12px",
    });
    const [legend] = [figure.legend].flat();
    figure.add_layout(legend, "above");
  }

  show(figure, canvas) {
    this.views.push(this.bokeh.Plotting.show(figure, canvas));
  }

  hover(figure, renderers, tooltips) {
    figure.add_tools(new this.bokeh.HoverTool({ renderers, tooltips, visible: false }));
  }

  distribution(timed) {
    const { capture } = this;
    const ms = timed.map((row) => capture.get(row, "duration") / 1000).sort((a, b) => a - b);
    const at = (part) => ms[Math.max(0, Math.ceil(part * ms.length) - 1)];
    const text = say("plot_figures", { n: grouped(ms.length), p50: duration(at(0.5) * 1000), p95: duration(at(0.95) * 1000), max: duration(at(1) * 1000) });
    const [canvas] = this.frame("plot_distribution", text);
    const low = Math.max(ms.find((value) => value > 0) || 0.001, at(1) / 1e6);
    const wide = at(1) / low > 40;
    const count = Math.min(BINS, Math.max(8, Math.ceil(Math.sqrt(ms.length)) * 2));
    const [from, to] = wide ? [Math.log10(low), Math.log10(at(1) * 1.001)] : [0, at(1) * 1.001 || 1];
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

  latency(timed) {
    const { capture } = this;
    const worst = Math.max(0, ...sampled(timed, 200000).map((row) => capture.get(row, "duration")));
    const text = say("plot_figures", this.percentiles(timed));
    const [canvas, about] = this.frame("plot_latency", text);
    const figure = this.figure(say("plot_seconds"), say("plot_milliseconds"), worst > 1e6 ? { y_axis_type: "log" } : {});
    for (const operation of ["read", "change", "vendor", "unknown"]) {
      const rows = timed.filter((row) => capture.operation(row) === operation);
      if (!rows.length) continue;
      const points = thinned(rows.map((row) => ({ x: capture.get(row, "start") / 1e6, y: capture.get(row, "duration") / 1000, id: capture.get(row, "id") })));
      if (points.length < rows.length) about.append(` ${say("plot_thinned", { n: grouped(points.length), all: grouped(rows.length) })}`);
      this.points(figure, points, operation === "change" ? "change" : "read", operationName(operation), operation === "change" ? "diamond" : "circle", "ms");
    }
    this.legend(figure);
    this.show(figure, canvas);
  }

  percentiles(timed) {
    const us = timed.map((row) => this.capture.get(row, "duration")).sort((a, b) => a - b);
    const at = (part) => duration(us[Math.max(0, Math.ceil(part * us.length) - 1)]);
    return { n: grouped(us.length), p50: at(0.5), p95: at(0.95), max: at(1) };
  }

  source(data) {
    return new this.bokeh.ColumnDataSource({ data });
  }

  /** Marks that open their transaction when they are clicked. */
  points(figure, points, color, words, marker, unit) {
    const data = { x: points.map(({ x }) => x), y: points.map(({ y }) => y), id: points.map(({ id }) => id) };
    const source = this.source(data);
    const marks = figure.scatter({ field: "x" }, { field: "y" }, {
      source, marker, size: (points.length > 800 ? 4 : 7) + (marker === "circle" ? 0 : 3), line_width: marker === "x" ? 2 : 1, fill_color: COLOR[color], line_color: COLOR[color], fill_alpha: 0.7, line_alpha: 0.9, legend_label: words,
    });
    this.hover(figure, [marks], [[say("col_id"), "#@id"], ["s", "@x{0.000}"], [unit, "@y"]]);
    figure.add_tools(new this.bokeh.TapTool({ renderers: [marks], visible: false }));
    source.selected.properties.indices.change.connect(() => {
      const [first] = source.selected.indices;
      if (first !== undefined) openJob(this.capture.number, data.id[first]);
    });
    return marks;
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
    const [canvas] = this.frame("plot_load", text, { broad: false });
    const figure = this.figure(say("plot_seconds"), say("plot_jobs"));
    let bottom = new Array(BINS).fill(0);
    const left = bottom.map((_, number) => begin + number * width);
    const right = bottom.map((_, number) => begin + (number + 1) * width);
    for (const kind of LOAD_KINDS) {
      if (!kinds[kind].some(Boolean)) continue;
      const words = seen.filter((state) => capture.kinds[state] === kind).map(stateName).join(say("separator"));
      const top = bottom.map((value, number) => value + kinds[kind][number]);
      const source = this.source({ left, right, bottom, top, count: kinds[kind] });
      const bars = figure.quad({ field: "left" }, { field: "right" }, { field: "bottom" }, { field: "top" }, { source, fill_color: COLOR[kind], fill_alpha: 0.8, line_color: null, legend_label: words });
      this.hover(figure, [bars], [["s", "@left{0.0} – @right{0.0}"], [words, "@count"]]);
      bottom = top;
    }
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
          found.get(key).points.push({ x: (capture.get(row, "start") + (capture.get(row, "duration") || 0)) / 1e6, y, raw, id: capture.get(row, "id"), kind });
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
    const options = [...shown].sort((a, b) => compare(a.drive, b.drive, 1) || a.pnu - b.pnu || a.subindex - b.subindex)
      .map((each) => el("option", { value: each.key, selected: each === current }, `${each.drive}  p${each.pnu}[${each.subindex}] ${either(each.names)}`));
    const holder = el("div", {});
    const select = el("select", { "aria-label": say("plot_pick"), "data-picker": true, onchange: (event) => { this.picked = event.target.value; this.drawValue(shown.find((each) => each.key === this.picked)); } }, options);
    const [canvas, about] = this.frame("plot_value", "", { controls: [el("label", {}, `${say("plot_pick")} `, select), holder] });
    Object.assign(this, { valueCanvas: canvas, valueAbout: about });
    this.drawValue(current);
  }

  drawValue(series) {
    const canvas = this.valueCanvas;
    const count = (kind) => series.points.filter((point) => point.kind === kind).length;
    let [low, high] = [Infinity, -Infinity];
    for (const { y } of series.points) [low, high] = [Math.min(low, y), Math.max(high, y)];
    const unit = series.unit ? ` ${series.unit}` : "";
    const text = say("plot_value_text", { n: grouped(series.points.length), read: grouped(count("read")), written: grouped(count("written")), sent: grouped(count("sent")), refused: grouped(count("refused")), low: low + unit, high: high + unit });
    canvas.setAttribute("aria-label", `${say("plot_value")}, p${series.pnu}[${series.subindex}]: ${text}`);
    this.valueAbout.textContent = text;
    const figure = this.figure(say("plot_seconds"), `p${series.pnu}[${series.subindex}]${series.unit ? ` (${series.unit})` : ""}`);
    const known = thinned(series.points.filter((point) => point.kind === "read" || point.kind === "written").sort((a, b) => a.x - b.x));
    if (known.length > 1) {
      figure.step({ field: "x" }, { field: "y" }, "after", { source: this.source({ x: known.map(({ x }) => x), y: known.map(({ y }) => y) }), line_color: COLOR.axis, line_alpha: 0.55 });
    }
    for (const [kind, color, words, marker] of [["read", "read", "plot_read", "circle"], ["written", "change", "plot_written", "diamond"], ["sent", "sent", "plot_sent", "triangle"], ["refused", "bad", "plot_not_taken", "x"]]) {
      const points = thinned(series.points.filter((point) => point.kind === kind));
      if (points.length) this.points(figure, points, color, say(words), marker, series.unit || "=");
    }
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
