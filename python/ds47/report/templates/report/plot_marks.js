// What several plots have: percentiles, groups, axes of numbers of something. What is plotted is in plots.js.

/** The nearest-rank percentile of sorted numbers: always one that was measured. */
function nearestRank(sorted, percent) {
  return sorted[Math.max(0, Math.ceil((percent * sorted.length) / 100) - 1)];
}

/** The figures of sorted durations in ms, as words. */
function figuresOf(ms) {
  const at = (percent) => duration(nearestRank(ms, percent) * 1000);
  return { n: grouped(ms.length), p50: at(50), p95: at(95), p99: at(99), max: at(100) };
}

/** What was measured of points, sorted: `value` where they are drawn elsewhere. */
function measured(points) {
  return points.map(({ y, value }) => value ?? y).sort((a, b) => a - b);
}

/** How many transactions are a stretch of time whose percentiles are drawn; 0 for too few. */
function stretch(count) {
  return count < 2 * OF_A_STRETCH ? 0 : Math.max(OF_A_STRETCH, Math.ceil(count / STRETCHES));
}

/** Items by what they are part of, the biggest groups first; of more than `most` the rest is one, without a name. */
function biggest(items, of, most) {
  const found = new Map();
  for (const item of items) {
    const name = of(item);
    if (!found.has(name)) found.set(name, []);
    found.get(name).push(item);
  }
  const groups = [...found].sort((a, b) => b[1].length - a[1].length);
  if (groups.length <= most) return groups;
  return [...groups.slice(0, most - 1), [null, groups.slice(most - 1).flatMap(([, mine]) => mine)]];
}

/** How long the transactions of each group take. */
function figuresTable(words, groups) {
  const heads = [words, say("plot_count"), "p50", "p95", "p99", say("plot_slowest")];
  const lines = groups.map(([name, points]) => {
    const of = figuresOf(measured(points));
    return el("tr", {}, el("th", { scope: "row" }, name ?? say("plot_others")), [of.n, of.p50, of.p95, of.p99, of.max].map((text) => el("td", { class: "number" }, text)));
  });
  return el("table", { class: "plain figures" }, el("thead", {}, el("tr", {}, heads.map((text, place) => el("th", { scope: "col", class: place ? "number" : null }, text)))), el("tbody", {}, lines));
}

/** Least and greatest of numbers. */
function span(numbers) {
  return numbers.reduce(([low, high], number) => [Math.min(low, number), Math.max(high, number)], [Infinity, -Infinity]);
}

/** What is free above and below values on a plot. */
function room(low, high) {
  return (high - low) * 0.08 || Math.abs(high) * 0.1 || 1;
}

/** The axis of numbers of transactions. */
function countAxis(numbers) {
  return { label: say("plot_jobs"), range: [0, Math.max(1, ...numbers) * 1.08], whole: true };
}
