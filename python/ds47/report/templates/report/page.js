// The page as a whole: language, theme, copying, links into the tables, paper; and the start of everything.

const shown = new Map(); // number of a capture -> {tables, plots, ready, drawn, draw()}

/** Fills the tables of a capture, once; its plots are drawn when they are seen, or by `draw`. */
function startCapture(article) {
  const number = Number(article.dataset.capture);
  if (!article.querySelector("[data-part]")) return Promise.resolve();
  if (!shown.has(number)) {
    const parts = { tables: {}, plots: null, drawn: null };
    shown.set(number, parts);
    parts.ready = fillCapture(article, number, parts);
  }
  return shown.get(number).ready;
}

async function fillCapture(article, number, parts) {
  try {
    const data = await capture(number);
    const place = (name) => article.querySelector(`[data-part="${name}"]`);
    parts.tables.transactions = transactionTable(place("transactions"), data);
    parts.tables.parameters = parameterTable(place("parameters"), data);
    if (place("trail")) parts.tables.trail = trailTable(place("trail"), data);
    if (place("plots")) {
      parts.plots = new Plots(place("plots"), data, article.dataset.listed !== article.dataset.jobs);
      parts.draw = () => (parts.drawn ??= parts.plots.draw().catch((problem) => failed(article, problem)));
      whenSeen(place("plots"), parts.draw);
    }
    if (onPaper) drawTables(parts);
    article.dataset.ready = "";
  } catch (problem) {
    failed(article, problem);
  }
}

function failed(article, problem) {
  for (const waiting of article.querySelectorAll(".waiting")) {
    waiting.replaceWith(el("p", { class: "notice" }, say("failed", { text: problem.message })));
  }
  throw problem;
}

function whenSeen(element, run) {
  const observer = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    run();
  }, { rootMargin: "300px" });
  observer.observe(element);
}

function setLanguage(lang) {
  root.lang = lang;
  for (const button of document.querySelectorAll("button[data-lang]")) button.setAttribute("aria-pressed", String(button.dataset.lang === lang));
  for (const name of ["aria-label", "title", "data-label"]) {
    for (const element of document.querySelectorAll(`[data-${name}-en]`)) element.setAttribute(name, element.getAttribute(`data-${name}-${lang}`));
  }
  for (const { tables, plots, drawn } of shown.values()) {
    for (const table of Object.values(tables)) table.retell();
    if (plots && drawn) plots.draw();
  }
  retellCursors();
  nameTheme();
}

const THEMES = ["auto", "light", "dark"];
let theme = 0;

function nameTheme() {
  const button = document.querySelector("[data-theme-button]");
  for (const name of ["aria-label", "title"]) button.setAttribute(name, say(`theme_${THEMES[theme]}`));
  button.textContent = "◐☀☾"[theme];
}

function nextTheme() {
  theme = (theme + 1) % THEMES.length;
  root.classList.remove("light", "dark");
  if (theme) root.classList.add(THEMES[theme]);
  nameTheme();
  announce(say(`theme_${THEMES[theme]}`));
}

async function copy(button) {
  const code = button.parentElement.querySelector(".copyable");
  let done = false;
  try {
    await navigator.clipboard.writeText(code.textContent);
    done = true;
  } catch {
    getSelection().selectAllChildren(code);
    done = document.execCommand("copy");
  }
  const words = say(done ? "copied" : "copy_failed");
  announce(words);
  const before = [...button.childNodes];
  button.replaceChildren(words);
  setTimeout(() => button.replaceChildren(...before), 1500);
}

/** Opens a job in its table. */
async function openJob(number, id) {
  const fold = document.getElementById(`capture-${number}`);
  if (fold) fold.open = true;
  await startCapture(document.querySelector(`article[data-capture="${number}"]`));
  await capture(number);
  const table = shown.get(number).tables.transactions;
  return Boolean(table) && table.show(id);
}

/** Shows the trail of a drive object or a parameter. */
async function openTrail(number, query) {
  const fold = document.getElementById(`capture-${number}`);
  if (fold) fold.open = true;
  await startCapture(document.querySelector(`article[data-capture="${number}"]`));
  const section = document.getElementById(`trail-${number}`);
  const { trail } = shown.get(number)?.tables || {};
  if (trail) narrowTrail(trail, query);
  if (section) section.scrollIntoView();
  return Boolean(section);
}

/** Follows a link into the page: what is folded opens. */
function follow(hash) {
  const trail = /^#trail-(\d+)\?(.*)$/.exec(hash);
  if (trail) return openTrail(Number(trail[1]), trail[2]);
  const job = /^#job-(\d+)-(\d+)$/.exec(hash);
  if (job) return openJob(Number(job[1]), Number(job[2]));
  const target = hash.length > 1 ? document.getElementById(hash.slice(1)) : null;
  if (target instanceof HTMLDetailsElement) target.open = true;
  const fold = target && target.closest("details:not([open])");
  if (fold) fold.open = true;
  if (target) target.scrollIntoView();
  return Promise.resolve(Boolean(target));
}

/** The list of parts is a menu on a phone, and always open where there is room. */
const narrow = matchMedia("(max-width: 44rem)");
function foldParts() {
  for (const menu of document.querySelectorAll(".parts")) menu.open = !narrow.matches;
}
narrow.addEventListener("change", foldParts);
foldParts();

const folded = [];
let onPaper = false;

function drawTables({ tables }) {
  for (const table of Object.values(tables)) table.draw(onPaper);
}

/** Begins all that waits to be opened or seen; settles when it is there. */
async function everything() {
  await Promise.all([...document.querySelectorAll("article[data-capture]")].map(startCapture));
  await Promise.all([...shown.values()].map((parts) => parts.draw && parts.draw()));
}

/** Prints when everything is there: a browser that prints by itself does not wait for what begins then. */
async function print(button) {
  if (button.disabled) return;
  button.disabled = true;
  announce(say("preparing"));
  await everything().catch(() => null); // what failed says so in its place
  button.disabled = false;
  window.print();
}

function beforePaper() {
  onPaper = true;
  for (const fold of document.querySelectorAll("main details:not([open])")) {
    fold.open = true;
    folded.push(fold);
  }
  for (const parts of shown.values()) drawTables(parts);
  for (const waiting of document.querySelectorAll("[data-part=plots] > .waiting")) waiting.textContent = say("print_again");
  everything().catch(() => null);
}

function afterPaper() {
  onPaper = false;
  for (const fold of folded.splice(0)) fold.open = false;
  for (const parts of shown.values()) drawTables(parts);
}

document.addEventListener("click", (event) => {
  const target = event.target.closest("button, a[href^='#']");
  if (!target) return;
  if (target.matches("a")) {
    event.preventDefault();
    history.replaceState(null, "", target.getAttribute("href"));
    if (target.closest(".parts")) foldParts();
    follow(target.getAttribute("href"));
  } else if (target.dataset.lang) setLanguage(target.dataset.lang);
  else if ("themeButton" in target.dataset) nextTheme();
  else if ("print" in target.dataset) print(target);
  else if ("copy" in target.dataset) copy(target);
});
document.addEventListener("keydown", (event) => {
  if (event.key.toLowerCase() !== "p" || !(event.ctrlKey || event.metaKey) || event.shiftKey || event.altKey) return;
  event.preventDefault();
  print(document.querySelector("[data-print]"));
});
window.addEventListener("hashchange", () => follow(location.hash));
window.addEventListener("beforeprint", beforePaper);
window.addEventListener("afterprint", afterPaper);

nameTheme();
for (const article of document.querySelectorAll("article[data-capture]")) {
  const fold = article.closest("details.capture-fold");
  if (fold && !fold.open) fold.addEventListener("toggle", () => startCapture(article), { once: true });
  else requestAnimationFrame(() => setTimeout(() => startCapture(article)));
}
if (location.hash) follow(location.hash);
