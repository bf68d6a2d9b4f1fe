// The plots of a difference: both captures on one axis. A is round and blue, B a violet diamond.

const SIDES = [["a", "A", "read", "circle"], ["b", "B", "change", "diamond"]];

class DifferencePlots extends Plots {
  constructor(place, data) {
    super(place, null, false);
    this.data = data;
  }

  async draw() {
    this.place.replaceChildren();
    const { durations, elements } = this.data;
    if (durations.length) {
      const name = ({ device, operation }) => `${device} ${operationName(operation)}`;
      this.chosen("diff_plot_latency", "diff_plot_which", durations, name, (each, parts) => this.overTime(each, parts, say("plot_milliseconds")));
      this.chosen("diff_plot_share", "diff_plot_which", durations, name, (each, parts) => this.share(each, parts));
    }
    if (elements.length) {
      this.chosen("diff_plot_value", "plot_pick", elements, ({ label }) => label, (each, parts) => this.overTime(each, parts, each.name + (each.unit ? ` (${each.unit})` : "")));
    }
  }

  /** A plot of one of several things, and the choice of it. */
  chosen(words, choice, all, name, draw) {
    const options = all.map((each, number) => el("option", { value: number }, name(each)));
    const change = (event) => draw(all[Number(event.target.value)], parts);
    const select = el("select", { "aria-label": say(choice), onchange: change }, options);
    const [canvas, about] = this.frame(words, "", { controls: [el("label", {}, `${say(choice)} `, select)] });
    const parts = { canvas, about, words };
    draw(all[0], parts);
  }

  overTime(series, parts, axis) {
    const points = SIDES.flatMap(([side]) => series[side]);
    const [first, last] = span(points.map(([x]) => x));
    const [least, worst] = span(points.map(([, y]) => y));
    const log = Boolean(series.operation) && least > 0 && worst / least > 100;
    const range = log ? [least / 1.3, worst * 1.3] : [least - room(least, worst), worst + room(least, worst)];
    const chart = new Chart({ label: say("diff_plot_seconds"), range: [first - room(first, last) / 4, last + room(first, last) / 4] }, { label: axis, range, log });
    for (const [side, name, color, mark] of SIDES) {
      if (!series[side].length) continue;
      const items = series[side].map(([x, y]) => ({ x, y }));
      if (!series.operation) chart.add("steps", items, { color: COLOR[color] });
      chart.add("marks", items, { color: COLOR[color], filled: 0.6, mark, words: name, tell: ({ x, y }) => [[name, tidy(y)], ["s", x.toFixed(3)]] });
    }
    this.tell(parts, series);
    chart.show(parts.canvas);
  }

  /** How many of 100 transactions are done within how long. */
  share(series, parts) {
    const [least, most] = span(SIDES.flatMap(([side]) => series[side].map(([, y]) => y)).filter((y) => y > 0));
    const log = most / least > WIDE;
    const chart = new Chart({ label: say("plot_milliseconds"), range: [log ? least / 1.3 : 0, log ? most * 1.3 : Math.max(most, 0.001) * 1.08], log }, { label: say("diff_plot_percent"), range: [0, 104] });
    for (const [side, name, color] of SIDES) {
      const sorted = series[side].map(([, y]) => y).sort((a, b) => a - b);
      const steps = sorted.map((x, at) => ({ x, y: ((at + 1) * 100) / sorted.length }));
      if (steps.length) chart.add("steps", steps, { color: COLOR[color], width: 2, words: name, tell: ({ x, y }) => [[name, `${y.toFixed(0)} %`], ["ms", x.toFixed(3)]] });
    }
    this.tell(parts, series);
    chart.show(parts.canvas);
  }

  tell({ about, canvas, words }, series) {
    about.textContent = say("diff_plot_counts", { a: say("points", { n: grouped(series.a.length) }), b: say("points", { n: grouped(series.b.length) }) });
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
