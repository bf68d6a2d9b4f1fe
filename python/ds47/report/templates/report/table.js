// A table over many rows: sorts, filters, searches; only the rows of one page are in the document.
// What the columns are is said by transactions.js and parameters.js.

const PRINTED = 120; // rows that go to paper, where a table does not say otherwise
const SHORT = 22; // characters of a cell that is not wrapped

class Table {
  /**
   * options: columns [{key, words, value(row), cell(row), text(row), number, most}], rows, filters
   * [{words, choices() -> [[value, text]], fits(row, value)}], haystack(row) -> text to search,
   * detail(row) -> element or null, key(row), name.
   */
  constructor(place, options) {
    this.place = place;
    Object.assign(this, options);
    this.page = 0;
    this.perPage = 50;
    this.open = new Set();
    this.order = null;
    this.chosen = this.filters.map(() => "");
    this.query = "";
    this.prepare();
    this.build();
  }

  build() {
    this.selects = this.filters.map((filter, place) => el("select", {
      onchange: (event) => { this.chosen[place] = event.target.value; this.changed(); },
    }, ...filter.choices().map(([value, text]) => el("option", { value, selected: this.chosen[place] === value }, text))));
    this.input = el("input", {
      type: "search", value: this.query, placeholder: say("search_hint"), autocomplete: "off", spellcheck: "false",
      oninput: (event) => { this.query = event.target.value; this.later(); },
    });
    this.body = el("tbody");
    this.heads = this.columns.map((column) => el("th", { scope: "col", class: column.number ? "number" : null },
      el("button", { type: "button", title: [terms(column.words), say("sort", { column: say(column.words) })].filter(Boolean).join("\n"), onclick: () => this.sortBy(column) }, say(column.words))));
    this.table = el("table", { class: "grid", "aria-label": say(this.name) }, el("thead", {}, el("tr", {}, this.heads)), this.body);
    this.count = el("span", { class: "count", role: "status" });
    const turn = (sign, words, to) => el("button", { type: "button", "aria-label": say(words), title: say(words), onclick: () => this.turn(to()) }, sign);
    this.turners = [
      turn("«", "first", () => 0), turn("‹", "previous", () => this.page - 1),
      turn("›", "next", () => this.page + 1), turn("»", "last", () => this.pages() - 1),
    ];
    const sizes = [25, 50, 100, 500].map((size) => el("option", { value: size, selected: size === this.perPage }, String(size)));
    const size = el("select", { onchange: (event) => { this.perPage = Number(event.target.value); this.turn(0); } }, sizes);
    this.place.replaceChildren(
      el("div", { class: "controls" },
        el("label", { class: "search" }, say("search"), this.input),
        ...this.filters.map((filter, place) => el("label", {}, say(filter.words), this.selects[place])),
        el("button", { type: "button", onclick: () => this.reset() }, say("reset"))),
      el("div", { class: "pages" }, this.count, el("label", {}, say("per_page"), " ", size), this.turners),
      el("div", { class: "wide" }, this.table));
    this.choose();
  }

  /** Everything again, in another language: filters, order and page stay. */
  retell() {
    this.prepare();
    this.build();
  }

  /** Shows what fits these choices of the filters, and this search. */
  narrow(chosen, query) {
    this.chosen = chosen;
    this.query = query;
    this.page = 0;
    this.build();
  }

  reset() {
    this.query = "";
    this.chosen = this.filters.map(() => "");
    this.order = null;
    this.page = 0;
    this.open.clear();
    this.build();
  }

  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.changed(), 120);
  }

  changed() {
    this.page = 0;
    this.choose();
  }

  sortBy(column) {
    const first = Boolean(column.most); // of what is counted, the most comes first
    const same = this.order && this.order.key === column.key;
    this.order = same && this.order.down !== first ? null : { key: column.key, down: same ? !first : first };
    this.page = 0;
    this.choose();
  }

  /** What is searched, row by row. */
  words() {
    this.hay ??= [];
    this.gather(Infinity);
    return this.hay;
  }

  gather(most) {
    const end = Math.min(this.rows.length, this.hay.length + most);
    for (let number = this.hay.length; number < end; number += 1) this.hay.push(this.haystack(this.rows[number]).toLowerCase());
  }

  /** Gathers what is searched while nobody waits, so that the first search does not either. */
  prepare() {
    if (typeof requestIdleCallback === "undefined") return;
    const hay = this.hay = [];
    const step = (idle) => {
      while (this.hay === hay && hay.length < this.rows.length && idle.timeRemaining() > 2) this.gather(200);
      if (this.hay === hay && hay.length < this.rows.length) requestIdleCallback(step);
    };
    requestIdleCallback(step);
  }

  choose() {
    const parts = this.query.toLowerCase().split(/\s+/).filter(Boolean);
    const hay = parts.length ? this.words() : null;
    const fitting = parts.map(finder);
    const active = this.filters.map((filter, place) => [filter, this.chosen[place]]).filter(([, value]) => value !== "");
    this.found = this.rows.filter((row, number) => active.every(([filter, value]) => filter.fits(row, value))
      && fitting.every((fits) => fits(hay[number])));
    const column = this.order && this.columns.find((each) => each.key === this.order.key);
    if (column) {
      const way = this.order.down ? -1 : 1;
      const keyed = this.found.map((row) => [column.value(row), row]);
      keyed.sort(([a], [b]) => compare(a, b, way));
      this.found = keyed.map(([, row]) => row);
    }
    this.heads.forEach((head, place) => {
      const sorted = column === this.columns[place];
      if (sorted) head.setAttribute("aria-sort", this.order.down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    this.draw();
  }

  pages() {
    return Math.max(1, Math.ceil(this.found.length / this.perPage));
  }

  turn(page) {
    this.page = Math.min(Math.max(0, page), this.pages() - 1);
    this.draw();
  }

  draw(all = false) {
    const from = all ? 0 : this.page * this.perPage;
    const to = Math.min(this.found.length, all ? this.printed ?? PRINTED : from + this.perPage);
    const rows = this.found.slice(from, to);
    this.body.replaceChildren(...rows.flatMap((row) => this.lines(row)));
    if (!rows.length) this.body.append(el("tr", {}, el("td", { colspan: this.columns.length }, say("none"))));
    const numbers = { from: grouped(rows.length ? from + 1 : 0), to: grouped(to), n: grouped(this.found.length), all: grouped(this.rows.length) };
    this.count.textContent = say(this.found.length === this.rows.length ? "shown" : "shown_of", numbers);
    this.turners[0].disabled = this.turners[1].disabled = this.page === 0;
    this.turners[2].disabled = this.turners[3].disabled = this.page >= this.pages() - 1;
  }

  lines(row) {
    const key = this.key(row);
    const open = this.open.has(key);
    const cells = this.columns.map((column) => fitted(el("td", { class: [column.number ? "number" : "", column.class || ""].join(" ").trim() || null, "data-label": say(column.words) },
      ...[column.cell ? column.cell(row, open) : column.text(row)].flat())));
    const line = el("tr", { class: `row${this.detail ? " opens" : ""}${open ? " open" : ""}`, id: this.detail ? `job-${this.id}-${key}` : null }, cells);
    if (this.detail) line.addEventListener("click", (event) => { if (!event.target.closest("a, button.copy")) this.toggle(row); });
    return open ? [line, this.opened(row)] : [line];
  }

  opened(row) {
    return el("tr", { class: "detail" }, el("td", { colspan: this.columns.length }, this.detail(row)));
  }

  toggle(row) {
    const key = this.key(row);
    if (!this.open.delete(key)) this.open.add(key);
    const line = document.getElementById(`job-${this.id}-${key}`);
    if (line.nextElementSibling && line.nextElementSibling.classList.contains("detail")) line.nextElementSibling.remove();
    const lines = this.lines(row);
    line.replaceWith(...lines);
    const button = lines[0].querySelector(".expander");
    if (button) button.focus();
  }

  /** Shows and opens the row with this key, whatever the filters hide; false where there is none. */
  show(key) {
    const row = this.rows.find((each) => this.key(each) === key);
    if (!row) return false;
    if (!this.found.includes(row)) this.reset();
    this.open.add(key);
    this.turn(Math.floor(this.found.indexOf(row) / this.perPage));
    const line = document.getElementById(`job-${this.id}-${key}`);
    line.scrollIntoView({ block: "start" });
    line.querySelector(".expander").focus({ preventScroll: true });
    return true;
  }
}

/** What is short stands in one line; what is long has room for it. */
function fitted(cell) {
  cell.classList.add(cell.textContent.length > SHORT ? "long" : "keep");
  return cell;
}

/**
 * A function that says whether a text has this word of a search. A parameter is found in every spelling (p945, r0945), and
 * as an element of a run: p945[2] in r0945[0..3].
 */
function finder(part) {
  const [, pnu, rest] = /^[pr]0*(\d+)(.*)$/.exec(part) || [];
  if (pnu === undefined) return (text) => text.includes(part);
  const number = `\\b[pr]${Number(pnu) < BARE ? "" : "?"}0*${pnu}`;
  const [, element] = /^\[0*(\d+)\]$/.exec(rest) || [];
  if (element === undefined) {
    const spelled = new RegExp(`${number}${rest.replace(/[^\w ]/g, "\\$&")}`);
    return (text) => text.includes(part) || spelled.test(text);
  }
  const runs = new RegExp(`${number}\\[(\\d+)(?:\\.\\.(\\d+))?\\]`, "g");
  const has = ([, from, to = from]) => Number(from) <= Number(element) && Number(element) <= Number(to);
  return (text) => text.includes(part) || [...text.matchAll(runs)].some(has);
}

/** Orders numbers as numbers and texts as texts; what is not known comes last either way. */
function compare(a, b, way) {
  const none = (value) => value === null || value === undefined || value === "";
  if (none(a) || none(b)) return none(a) - none(b);
  if (typeof a === "number" && typeof b === "number") return way * (a - b);
  return way * String(a).localeCompare(String(b), "en", { numeric: true });
}
