// The drawings of a drive: another zoom, and a cursor that reads all lanes at one moment.

/** The row of the table of events that counts at a time, in seconds of the capture. */
function eventAt(article, seconds) {
  const rows = [...article.querySelectorAll("tr[data-at]")];
  return rows.findLast((row) => parseFloat(row.dataset.at) <= seconds) ?? null;
}

/** A time in milliseconds since 1970 as the clock of who reads it shows it. */
function clock(milliseconds) {
  const time = new Date(milliseconds);
  const part = (number, digits = 2) => String(number).padStart(digits, "0");
  const seconds = `${part(time.getHours())}:${part(time.getMinutes())}:${part(time.getSeconds())}`;
  return `${seconds}.${part(time.getMilliseconds(), 3)}`;
}

for (const text of document.querySelectorAll("text.clock")) text.textContent = clock(Number(text.dataset.time));
for (const note of document.querySelectorAll("[data-timeline] .js-only")) note.hidden = false;

function zoomTo(article, number) {
  for (const button of article.querySelectorAll("[data-zoom]")) button.setAttribute("aria-pressed", String(button.dataset.zoom === number));
  for (const drawing of article.querySelectorAll("[data-drawing]")) drawing.hidden = drawing.dataset.drawing !== number;
}

/** Moves the cursor of a drawing to where the pointer is, and says what was so then. */
function pointAt(article, drawing, event) {
  const picture = drawing.querySelector("svg");
  const box = picture.viewBox.baseVal;
  const place = picture.getBoundingClientRect();
  const x = ((event.clientX - place.left) / place.width) * box.width;
  const [from, to] = [Number(drawing.dataset.left), Number(drawing.dataset.left) + Number(drawing.dataset.width)];
  const cursor = drawing.querySelector(".cursor");
  if (x < from || x > to) return leave(drawing);
  cursor.removeAttribute("hidden");
  cursor.setAttribute("transform", `translate(${x} 0)`);
  const first = Number(drawing.dataset.seconds);
  const seconds = first + ((x - from) / (to - from)) * Number(drawing.dataset.span);
  const row = eventAt(article, seconds);
  const words = [`${seconds.toFixed(3)} s`, clock(Number(drawing.dataset.begin) + seconds * 1000)];
  if (row) {
    const [frame, , word, happened, stands] = [...row.cells].map((cell) => cell.innerText.trim());
    words.push(stands, `${say("frame", { n: frame })}: ${word} ${happened}`);
  }
  drawing.querySelector("output").textContent = words.filter(Boolean).join(" · ");
}

function leave(drawing) {
  drawing.querySelector(".cursor").setAttribute("hidden", "");
  drawing.querySelector("output").textContent = "";
}

for (const article of document.querySelectorAll("[data-timeline]")) {
  for (const button of article.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => zoomTo(article, button.dataset.zoom));
  for (const drawing of article.querySelectorAll("[data-drawing]")) {
    drawing.addEventListener("pointermove", (event) => pointAt(article, drawing, event));
    drawing.addEventListener("pointerleave", () => leave(drawing));
  }
}
