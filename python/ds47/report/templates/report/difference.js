// The plots of a difference: both captures on one axis. A is round and blue, B a violet diamond.

const SIDES = [["a", "A", "read", "circle"], ["b", "B", "change", "diamond"]];

class DifferencePlots extends Plots {
  constructor(place, data) {
    super(place, null, false);
    this.data = data;
  }

  async draw() {
    this.bokeh = await plotLibrary();
    this.place.replaceChildren();
    this.views = [];
    const { durations, elements } = this.data;
    if (durations.length) {
      const name = ({ device, operation }) => `${device} ${operationName(operation)}`;
      this.chosen("diff_plot_latency", "diff_plot_which", durations, name, (each, parts) => this.overTime(each, parts, say("plot_milliseconds")));
      this.chosen("diff_plot_share", "diff_plot_which", durations, name, (each, parts) => this.share(each, parts));
    }
    if (elements.length) {
      this.chosen("diff_plot_value", "plot_pick", elements, ({ label }) => label, (each, parts) => this.overTime(each, parts, each.name + (each.unit ? ` (${each.unit})` : "")));
    }
    await this.painted();
  }

  /** A plot of one of several things, and the choice of it. */
  chosen(words, choice, all, name, draw) {
    const options = all.map((each, number) => el("option", { value: number }, name(each)));
    const change = (event) => { parts.canvas.replaceChildren(); draw(all[Number(event.target.value)], parts); };
    const select = el("select", { "aria-label": say(choice), onchange: change }, options);
    const [canvas, about] = this.frame(words, "", { controls: [el("label", {}, `${say(choice)} `, select)] });
    const parts = { canvas, about, words };
    draw(all[0], parts);
  }

  overTime(series, parts, axis) {
    const worst = Math.max(...SIDES.flatMap(([side]) => series[side].map(([, y]) => y)));
    const least = Math.min(...SIDES.flatMap(([side]) => series[side].map(([, y]) => y)));
    const log = series.operation && least > 0 && worst / least > 100;
    const figure = this.figure(say("diff_plot_seconds"), axis, log ? { y_axis_type: "log" } : {});
    for (const [side, name, color, marker] of SIDES) {
      if (!series[side].length) continue;
      const source = this.source({ x: series[side].map(([x]) => x), y: series[side].map(([, y]) => y) });
      if (!series.operation) figure.step({ field: "x" }, { field: "y" }, "after", { source, line_color: COLOR[color], line_alpha: 0.5 });
      const marks = figure.scatter({ field: "x" }, { field: "y" }, { source, marker, size: 7, fill_color: COLOR[color], line_color: COLOR[color], fill_alpha: 0.6, legend_label: name });
      this.hover(figure, [marks], [[name, "@y"], ["s", "@x{0.000}"]]);
    }
    this.tell(parts, series);
    this.legend(figure);
    this.show(figure, parts.canvas);
  }

  /** How many of 100 transactions are done within how long. */
  share(series, parts) {
    const all = SIDES.flatMap(([side]) => series[side].map(([, y]) => y)).filter((y) => y > 0);
    const log = all.length > 0 && Math.max(...all) / Math.min(...all) > 20;
    const figure = this.figure(say("plot_milliseconds"), say("diff_plot_percent"), log ? { x_axis_type: "log" } : {});
    for (const [side, name, color] of SIDES) {
      const sorted = series[side].map(([, y]) => y).sort((a, b) => a - b);
      if (!sorted.length) continue;
      const source = this.source({ x: sorted, y: sorted.map((_, place) => ((place + 1) * 100) / sorted.length) });
      const line = figure.step({ field: "x" }, { field: "y" }, "after", { source, line_color: COLOR[color], line_width: 2, legend_label: name });
      this.hover(figure, [line], [[name, "@y{0} %"], ["ms", "@x{0.000}"]]);
    }
    this.tell(parts, series);
    this.legend(figure);
    this.show(figure, parts.canvas);
  }

  tell({ about, canvas, words }, series) {
    about.textContent = say("diff_plot_counts", { a: grouped(series.a.length), b: grouped(series.b.length) });
    canvas.setAttribute("aria-label", `${say(words)}: ${about.textContent}`);
  }
}

/** Draws the plots of a page of differences when they are seen; true where the page is one. */
async function startDifference() {
  const place = document.querySelector("[data-difference]");
  if (!place) return;
  const data = JSON.parse(await embedded("difference"));
  const plots = new DifferencePlots(place, data);
  const parts = { tables: {}, plots, drawn: null };
  parts.draw = () => (parts.drawn ??= plots.draw().catch((problem) => failed(place, problem)));
  shown.set(0, parts);
  whenSeen(place, parts.draw);
}

setTimeout(startDifference); // the page's own part stands below
