// A chart as SVG: axes, bars, steps, marks, lines, a key, what the pointer is at. What is plotted is in plots.js.
//
// A layer is one path, however many points it has, so thousands are drawn at once. Colours fit light and dark, and
// paper scales the drawing, so that a change of theme, and paper, need nothing.

const REACH = 14; // pixels from which the pointer means something
const EDGE = 6; // a mark on the edge is whole
const TIME_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200, DAY];
const LEAST_STEP = 0.001; // what a time of day is cut to
const LOG_STEPS = [[1, 2, 5], [1, 3], [1]];

/** The corners of a shape around 0; every other one is at `inner`. */
function corners(count, turn = 0, inner = 1) {
  return Array.from({ length: count }, (_, number) => {
    const angle = (2 * Math.PI * (number + turn)) / count - Math.PI / 2;
    const far = number % 2 ? inner : 1;
    return [far * Math.cos(angle), far * Math.sin(angle)];
  });
}

/** Marks: how each looks in the key, and its corners; what has none is round. */
const MARKS = {
  circle: ["●"], ring: ["○"], x: ["✕"], diamond: ["◆", corners(4)], triangle: ["▲", corners(3)], square: ["■", corners(4, 0.5)],
  inverted_triangle: ["▼", corners(3, 1.5)], hex: ["⬢", corners(6)], star: ["★", corners(10, 0, 0.45)],
};

function markPath(mark, x, y, size) {
  if (mark === "x") return `M${x - size} ${y - size}l${2 * size} ${2 * size}m0 ${-2 * size}l${-2 * size} ${2 * size}`;
  const known = MARKS[mark][1];
  if (!known) return `M${x - size} ${y}a${size} ${size} 0 1 0 ${2 * size} 0a${size} ${size} 0 1 0 ${-2 * size} 0`;
  return `M${known.map(([dx, dy]) => `${tenth(x + dx * size)} ${tenth(y + dy * size)}`).join("L")}Z`;
}

/** Each kind of layer: the path of an item, how far it is from a point, and its sign in the key. */
const KINDS = {
  marks: {
    path: (item, at, { mark, size }) => markPath(mark, at.x(item.x), at.y(item.y), size),
    away: (item, at, x, y) => Math.hypot(at.x(item.x) - x, at.y(item.y) - y),
    sign: ({ mark }) => MARKS[mark][0],
  },
  bars: {
    path: (item, at) => `M${at.x(item.left)} ${at.y(item.bottom)}H${at.x(item.right)}V${at.y(item.top)}H${at.x(item.left)}Z`,
    away: (item, at, x, y) => (x >= at.x(item.left) && x < at.x(item.right) && y <= at.y(item.bottom) && y >= at.y(item.top) ? REACH - 1 : REACH),
    sign: () => "■",
  },
  steps: {
    path: (item, at, _, number) => (number ? `H${at.x(item.x)}V${at.y(item.y)}` : `M${at.x(item.x)} ${at.y(item.y)}`),
    away: (item, at, x, y, next) => (next && x >= at.x(item.x) && x < at.x(next.x) ? Math.abs(at.y(item.y) - y) + REACH / 2 : REACH),
    sign: ({ dash }) => (dash ? "╌" : "━"),
  },
  lines: {
    path: (item, at) => `M${at.x(item.x)} 0V${at.height}`,
    away: (item, at, x) => Math.abs(at.x(item.x) - x) + REACH / 2,
    sign: () => "┃",
  },
};

/** A position as it is written: a tenth of a pixel. */
function tenth(pixels) {
  return Math.round(pixels * 10) / 10;
}

const charts = new WeakMap(); // canvas -> the chart that is drawn there
const resized = new ResizeObserver((entries) => {
  for (const { target } of entries) if (target.clientWidth !== charts.get(target).width) charts.get(target).draw();
});

/**
 * An axis is {label, range: [from, to], log, whole (numbers), clock (of times)}; charts that share one are zoomed
 * together.
 */
class Chart {
  constructor(x, y) {
    Object.assign(this, { x, y, layers: [], pointed: null, from: null });
    (x.charts ??= []).push(this);
  }

  /** look: color, filled, width, dash, mark, size; words of the key; tell(item) -> [[name, text], ...]; open(item). */
  add(kind, items, look) {
    this.layers.push({ kind: KINDS[kind], items, color: COLOR.axis, width: 1, size: 4, ...look });
  }

  show(canvas) {
    this.canvas = canvas;
    canvas.parentElement.querySelector(".keys")?.remove();
    if (this.layers.some(({ words }) => words)) canvas.before(this.key());
    charts.set(canvas, this);
    this.draw();
    resized.observe(canvas);
  }

  /** A button for each of its words, which hides and shows what it names. */
  key() {
    const toggle = (layer, button) => {
      layer.hidden = button.getAttribute("aria-pressed") === "true";
      button.setAttribute("aria-pressed", String(!layer.hidden));
      this.draw();
    };
    return el("div", { class: "keys" }, this.layers.filter(({ words }) => words).map((layer) => {
      const sign = el("span", { class: "sign", "aria-hidden": "true" }, layer.kind.sign(layer));
      sign.style.color = layer.color;
      return el("button", { type: "button", "aria-pressed": "true", onclick: ({ currentTarget }) => toggle(layer, currentTarget) }, sign, " ", layer.words);
    }));
  }

  draw() {
    if (charts.get(this.canvas) !== this) return; // another one is shown there by now
    this.width = this.canvas.clientWidth;
    const [width, height] = [this.width || 600, this.canvas.clientHeight || 280];
    const up = ticksOf(this.y, this.y.range, (height - 70) / 34);
    const left = 30 + 7 * Math.max(...up.map(([, text]) => text.length));
    const at = this.at = { left, width: width - left - 2 * EDGE, height: height - (this.x.clock?.dated ? 52 : 38) - EDGE };
    [at.x, at.y] = [scale(this.x, this.seen(), at.width, 0), scale(this.y, this.y.range, 0, at.height)];
    const across = ticksOf(this.x, this.seen(), at.width / (this.x.clock ? 96 : 60));
    const paths = this.layers.map((layer) => this.layer(layer));
    this.cover = svg("rect", { class: "cover", width: 0, height: at.height });
    const inside = svg("svg", { x: left - EDGE, y: 0, width: at.width + 2 * EDGE, height: at.height + 2 * EDGE }, svg("g", { transform: `translate(${EDGE} ${EDGE})` }, paths, this.cover));
    const drawn = svg("svg", { viewBox: `0 0 ${width} ${height}`, onpointermove: (event) => this.move(event), onpointerleave: () => this.point(null), onpointercancel: () => this.drop(), onpointerdown: (event) => this.press(event), onpointerup: (event) => this.release(event), ondblclick: () => this.zoom(null) }, this.axes(across, up, width, height), inside);
    this.tip = el("div", { class: "tip", hidden: true });
    this.canvas.replaceChildren(drawn, this.tip);
  }

  /** What of the axis across is seen. */
  seen() {
    return this.x.zoomed ?? this.x.range;
  }

  layer({ kind, items, color, filled, width, dash, hidden, ...look }) {
    const d = hidden ? "" : items.map((item, number) => kind.path(item, this.at, look, number)).join("");
    return svg("path", { d, fill: filled ? color : "none", "fill-opacity": filled, stroke: width ? color : "none", "stroke-width": width, "stroke-dasharray": dash });
  }

  axes(across, up, width, height) {
    const { at } = this;
    const top = EDGE, bottom = EDGE + at.height;
    const grid = [...across.map(([value]) => `M${at.left + at.x(value)} ${top}V${bottom + 4}`), ...up.map(([value]) => `M${at.left + at.width} ${top + at.y(value)}H${at.left - 4}`)];
    const words = across.flatMap(([value, text, below]) => [[text, 16], [below, 30]].filter(([each]) => each).map(([each, down]) => svg("text", { x: Math.min(at.left + at.x(value), width - 3.2 * each.length), y: bottom + down }, each)));
    return svg("g", { class: "axes" },
      svg("path", { class: "grid", d: grid.join("") }), svg("path", { d: `M${at.left} ${top}V${bottom}H${at.left + at.width}` }), words,
      up.map(([value, text]) => svg("text", { class: "up", x: at.left - 7, y: top + at.y(value) + 4 }, text)),
      svg("text", { x: at.left + at.width / 2, y: height - 4 }, this.x.label),
      svg("text", { transform: `translate(11 ${top + at.height / 2}) rotate(-90)` }, this.y.label));
  }

  // The pointer

  where(event) {
    const picture = this.canvas.firstElementChild;
    const box = picture.getBoundingClientRect();
    const size = picture.viewBox.baseVal.width / box.width;
    return [(event.clientX - box.left) * size - this.at.left, (event.clientY - box.top) * size - EDGE];
  }

  /** The nearest of what can be told: {layer, item}, null if nothing is near. */
  under([x, y]) {
    let [least, found] = [REACH, null];
    for (const layer of this.layers.filter(({ tell, hidden }) => tell && !hidden)) {
      for (const [number, item] of layer.items.entries()) {
        const away = layer.kind.away(item, this.at, x, y, layer.items[number + 1]);
        if (away < least) [least, found] = [away, { layer, item }];
      }
    }
    return found;
  }

  move(event) {
    const [x, y] = this.where(event);
    if (this.from === null) return this.point(this.under([x, y]), x, y);
    this.cover.setAttribute("x", Math.min(x, this.from));
    this.cover.setAttribute("width", Math.abs(x - this.from));
  }

  point(found, x, y) {
    this.pointed = found && found.item;
    this.tip.hidden = !found;
    this.canvas.classList.toggle("opens", Boolean(found && found.layer.open));
    if (!found) return;
    this.tip.replaceChildren(...found.layer.tell(found.item).filter(([, text]) => text).flatMap(([name, text]) => [el("span", { class: "dim" }, name), el("span", {}, text)]));
    const { left, width, height } = this.at;
    const before = x > width / 2, above = y > height / 2;
    Object.assign(this.tip.style, { left: before ? "" : `${left + x + 12}px`, right: before ? `${width - x + 24}px` : "", top: above ? "" : `${y + 14}px`, bottom: above ? `${height - y + 50}px` : "" });
  }

  /** A mouse that is drawn across zooms; a finger scrolls the page. */
  press(event) {
    if (event.pointerType !== "mouse" || event.button) return;
    [this.from] = this.where(event);
    event.currentTarget.setPointerCapture(event.pointerId);
  }

  drop() {
    this.from = null;
    this.cover.setAttribute("width", 0);
  }

  /** What the pointer was at opens; a finger says first what it is. */
  release(event) {
    const [x, y] = this.where(event), { from } = this;
    this.drop();
    if (from !== null && Math.abs(x - from) > REACH) return this.zoom([from, x].sort((a, b) => a - b).map(this.at.x.back));
    const found = this.under([x, y]);
    if (found && found.item === this.pointed) found.layer.open?.(found.item);
    else this.point(found, x, y);
  }

  /** Shows a part of the axis across, null for all of it. */
  zoom(range) {
    this.x.zoomed = range;
    for (const each of this.x.charts) each.draw();
  }
}

/** From a value to pixels, and `back`. */
function scale({ log }, [from, to], end, start) {
  const [plain, value] = log ? [Math.log10, (power) => 10 ** power] : [Number, Number];
  const [low, high] = [plain(from), plain(to)];
  const found = (number) => tenth(start + ((plain(number) - low) / (high - low)) * (end - start));
  found.back = (pixels) => value(low + ((pixels - start) / (end - start)) * (high - low));
  return found;
}

/** The marks of an axis: [value, text, text below], about so many. */
function ticksOf(axis, [low, high], most) {
  if (axis.clock) return timeTicks(axis.clock, low, high, most);
  const found = axis.log ? logTicks(low, high, most) : [];
  const values = found.length > 1 ? found : stepped(low, high, decimal(Math.max((high - low) / most, axis.whole ? 1 : 0)));
  return values.map((value) => [value, tidy(value)]);
}

/** The next of 1, 2, 5, 10, 20 ... */
function decimal(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((times) => times * power).find((step) => step >= least * 0.999);
}

function stepped(low, high, step, shift = 0) {
  const first = Math.ceil((low + shift) / step - 1e-9);
  const last = Math.floor((high + shift) / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, number) => (first + number) * step - shift);
}

function logTicks(low, high, most) {
  const powers = stepped(Math.floor(Math.log10(low)), Math.log10(high), 1).map((power) => 10 ** power);
  const each = LOG_STEPS.map((steps) => powers.flatMap((power) => steps.map((step) => step * power)).filter((value) => value >= low && value <= high));
  const fitting = each.find((values) => values.length <= most) ?? each.at(-1);
  return fitting.filter((_, number) => number % Math.ceil(fitting.length / most) === 0);
}

/** Times of day, round ones; the date stands below the first of a day where there are several. */
function timeTicks(clock, low, high, most) {
  const least = Math.max((high - low) / most, LEAST_STEP);
  const step = least > DAY ? DAY * decimal(least / DAY) : least > 0.5 ? TIME_STEPS.find((each) => each >= least) : decimal(least);
  const shown = step < 1 ? 12 : step < 60 ? 8 : 5;
  let day = null;
  return stepped(low, high, step, clock.known ? clock.secondOfDay() : 0).map((value) => {
    if (!clock.known) return [value, tidy(value)];
    const [time, date] = clock.parts((value + LEAST_STEP / 10) * 1e6);
    const below = clock.dated && date !== day ? date : "";
    day = date;
    return [value, time.slice(0, shown), below];
  });
}

/** A number as an axis says it. */
function tidy(value) {
  const short = Number(value.toPrecision(6));
  return Math.abs(short) >= 1e7 ? short.toExponential() : String(short);
}
