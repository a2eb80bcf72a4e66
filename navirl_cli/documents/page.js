"use strict";

// Tables: clicks on the header of a column sort by it in ascending, descending and original order.

const words = new Intl.Collator("en", { numeric: true });

// Numbers come first, then words, then missing values, in both directions.
function rank(cell) {
  return "missing" in cell.dataset ? 2 : "number" in cell.dataset ? 0 : 1;
}

function compare(a, b, direction) {
  if (rank(a) !== rank(b)) return rank(a) - rank(b);
  if (rank(a) === 1) return direction * words.compare(a.textContent, b.textContent);
  const [x, y] = [Number(a.dataset.number), Number(b.dataset.number)];
  return direction * ((x > y) - (x < y));
}

function makeSortable(table) {
  const body = table.tBodies[0];
  const written = [...body.rows];
  const headers = [...table.tHead.rows[0].cells];
  const next = { none: "ascending", ascending: "descending", descending: "none" };

  function sortBy(column) {
    const order = next[headers[column].getAttribute("aria-sort") ?? "none"];
    for (const header of headers) header.removeAttribute("aria-sort");
    const rows = [...written];
    if (order !== "none") {
      headers[column].setAttribute("aria-sort", order);
      const direction = order === "ascending" ? 1 : -1;
      rows.sort((a, b) => compare(a.cells[column], b.cells[column], direction));
    }
    body.append(...rows);
  }

  headers.forEach((header, column) => {
    if (!header.textContent) return; // a button needs a name
    const button = document.createElement("button");
    button.type = "button";
    button.append(...header.childNodes);
    button.addEventListener("click", () => sortBy(column));
    header.append(button);
  });
}

for (const table of document.querySelectorAll("table")) {
  if (table.tBodies[0].rows.length > 1) makeSortable(table);
}

// Figures: a click or a key on one shows it as large as the window; a click or Esc closes it.

const dialog = document.createElement("dialog");
const enlarged = document.createElement("img");
const close = document.createElement("button");
close.type = "button";
close.textContent = "Close";
dialog.append(close, enlarged);
dialog.addEventListener("click", () => dialog.close());
document.body.append(dialog);

for (const image of document.querySelectorAll("figure img")) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "enlarge";
  button.title = "Enlarge";
  const whole = image.closest("picture") ?? image;
  whole.replaceWith(button);
  button.append(whole);
  button.addEventListener("click", () => {
    enlarged.src = image.currentSrc || image.src;
    dialog.style.background = getComputedStyle(image).backgroundColor;
    enlarged.alt = image.alt;
    dialog.setAttribute("aria-label", image.alt);
    dialog.showModal();
  });
}
