// The drawings of a drive: another zoom, and for each drawing its cursor (cursor.js).

for (const note of document.querySelectorAll("[data-timeline] .js-only")) note.hidden = false;

const asked = new Map(); // drawing -> a promise of its cursor, once it was seen
const cursors = new Map(); // drawing -> its cursor, once that is there

function zoomTo(article, number) {
  for (const button of article.querySelectorAll("[data-zoom]")) button.setAttribute("aria-pressed", String(button.dataset.zoom === number));
  for (const drawing of article.querySelectorAll("[data-drawing]")) drawing.hidden = drawing.dataset.drawing !== number;
}

async function unpacked(drawing) {
  const cursor = new Cursor(drawing, JSON.parse(await embedded(drawing.dataset.readings)));
  cursors.set(drawing, cursor);
  return cursor;
}

/** The cursor of a drawing; what it knows is unpacked when it is asked for the first time. */
function cursorOf(drawing) {
  if (!asked.has(drawing)) asked.set(drawing, unpacked(drawing));
  return asked.get(drawing);
}

async function pointed(drawing, event) {
  const cursor = await cursorOf(drawing);
  if (event.type === "click") cursor.go(cursor.under(event), true);
  else if (!cursor.held) cursor.go(event.type === "pointerleave" ? null : cursor.under(event));
}

/** Tells anew what cursors read, in the present language. */
function retellCursors() {
  for (const cursor of cursors.values()) cursor.tell();
}

for (const article of document.querySelectorAll("[data-timeline]")) {
  for (const button of article.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => zoomTo(article, button.dataset.zoom));
  for (const drawing of article.querySelectorAll("[data-drawing]")) {
    const picture = drawing.querySelector("svg");
    for (const name of ["pointermove", "pointerleave", "click"]) picture.addEventListener(name, (event) => pointed(drawing, event));
    drawing.addEventListener("focus", () => cursorOf(drawing));
    drawing.addEventListener("keydown", (event) => cursors.get(drawing)?.pressed(event));
    whenSeen(drawing, () => cursorOf(drawing));
  }
}
