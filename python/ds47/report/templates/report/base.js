// What every other part uses: making elements, words in two languages, numbers as people read them.

const root = document.documentElement;
const SVG = "http://www.w3.org/2000/svg";
const BARE = 60000; // from here on numbers of parameters have no letter (ds47.profidrive.naming)

/** An element with attributes and children; text always becomes text, never markup. */
function el(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** The same for an element of a drawing. */
function svg(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

const allWords = JSON.parse(document.getElementById("words").textContent);

function language() {
  return root.lang === "zh" ? "zh" : "en";
}

/** A text of the page in its present language, with values filled in; `n` also chooses between `one|several`. */
function say(key, values = {}) {
  const [one, several = one] = (allWords[language()][key] ?? key).split("|");
  return (String(values.n) === "1" ? one : several).replace(/\{(\w+)\}/g, (all, name) => (name in values ? String(values[name]) : all));
}

// What is explained by which terms of the glossary: heads of columns, facts, parts of a message.
const TERMS = {
  col_id: ["transaction"], col_axis: ["axis", "drive_object"], col_what: ["pnu", "subindex"], col_parameter: ["pnu", "subindex"],
  col_state: ["state"], col_findings: ["finding"], col_reason: ["error_number", "status"], trail_way: ["access_point", "record_index"],
  channel: ["access_point", "record_index"], reference: ["reference"], axis: ["axis", "drive_object"], address: ["pnu", "subindex"],
};

/** The terms with a text, a line each; null for none. */
function terms(words) {
  return TERMS[words]?.map((each) => say(`term_${each}`)).join("\n") ?? null;
}

/** The name of a state of a transaction, that of every report. */
function stateName(state) {
  return say(`state_${state}`);
}

function operationName(operation) {
  return say(`operation_${operation}`);
}

/** `84 ok, 3 error`, of pairs of a number and a word. */
function told(pairs) {
  return pairs.map(([n, word]) => say("told", { n: grouped(n), word })).join(say("separator"));
}

/** One of two texts that stand side by side as [English, Chinese]. */
function either(texts, start = 0) {
  return texts[start + (language() === "zh" ? 1 : 0)];
}

function grouped(number) {
  return number.toLocaleString("en-US");
}

/** A time given in microseconds, in the unit that fits it. */
function duration(us) {
  const ms = us / 1000;
  if (Math.abs(ms) >= 1000) return `${(ms / 1000).toFixed(Math.abs(ms) >= 10000 ? 1 : 2)} s`;
  return `${ms.toFixed(Math.abs(ms) < 1 ? 3 : 1)} ms`;
}

function announce(text) {
  document.getElementById("announce").textContent = text;
}
