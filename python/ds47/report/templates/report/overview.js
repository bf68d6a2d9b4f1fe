// The overview of several captures stands in the page as it is, the worst first; here its heads learn to sort.

function sortable(table) {
  const body = table.tBodies[0];
  const lines = [...body.rows]; // in the order of the page, to which the third click leads back
  const heads = [...table.tHead.rows[0].cells];
  let sorted = null;
  let down = false;
  const value = (line, place) => {
    const cell = line.cells[place];
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    return cell.classList.contains("number") ? Number(cell.textContent.replaceAll(",", "")) : cell.textContent;
  };
  const sort = (head, place) => {
    [sorted, down] = sorted !== head ? [head, false] : down ? [null, false] : [head, true];
    const way = down ? -1 : 1;
    body.append(...(sorted ? [...lines].sort((a, b) => compare(value(a, place), value(b, place), way)) : lines));
    for (const each of heads) {
      if (each === sorted) each.setAttribute("aria-sort", down ? "descending" : "ascending");
      else each.removeAttribute("aria-sort");
    }
  };
  heads.forEach((head, place) => {
    head.replaceChildren(el("button", { type: "button", onclick: () => sort(head, place) }, ...head.childNodes));
  });
}

for (const table of document.querySelectorAll("table.overview")) sortable(table);
