// A virtual table: only the visible rows are in the page.

import { element } from "./data.js";

const ROW = 34; // as in the style sheet
const OVERSCAN_ROWS = 10; // rows above and below the visible ones

// columns: [{ title, width, value(row) for sorting, fill(cell, row), numeric, spare }]; spare ones are
// omitted on narrow screens.
export class Table {
  constructor(place, { caption, columns, key, empty, select }) {
    Object.assign(this, { columns, key, empty, select });
    this.rows = [];
    this.sorted = { column: columns[0], descending: false };
    this.selected = null;

    this.scroller = element("div", "scroller");
    this.table = element("table");
    this.table.append(element("caption", "hidden", caption), this.makeWidths(), this.makeHead());
    this.body = element("tbody");
    this.table.append(this.body);
    this.none = element("p", "empty");
    this.scroller.append(this.table, this.none);
    place.append(this.scroller);

    this.scroller.addEventListener("scroll", () => this.schedule(), { passive: true });
    new ResizeObserver(() => this.schedule()).observe(this.scroller);
    this.body.addEventListener("click", (event) => {
      const row = event.target.closest("tr[data-index]");
      if (row && !event.target.closest("a")) this.choose(Number(row.dataset.index));
    });
    this.body.addEventListener("keydown", (event) => this.step(event));
  }

  makeWidths() {
    const group = element("colgroup");
    for (const column of this.columns) {
      const col = element("col", column.spare ? "spare" : "");
      col.style.width = column.width;
      group.append(col);
    }
    return group;
  }

  makeHead() {
    const head = element("thead");
    const row = element("tr");
    for (const column of this.columns) {
      const cell = element("th", classes(column));
      cell.scope = "col";
      const button = element("button", "", column.title);
      button.type = "button";
      button.addEventListener("click", () => {
        const again = this.sorted.column === column;
        this.sorted = { column, descending: again ? !this.sorted.descending : !!column.numeric };
        this.show(this.rows);
      });
      cell.append(button);
      row.append(cell);
      column.head = cell;
    }
    head.append(row);
    return head;
  }

  show(rows) {
    const { column, descending } = this.sorted;
    const order = descending ? -1 : 1;
    this.rows = rows
      .map((row) => [column.value(row), this.key(row), row])
      .sort((a, b) => order * compare(a[0], b[0]) || compare(a[1], b[1]))
      .map((entry) => entry[2]);
    for (const { head } of this.columns) head.removeAttribute("aria-sort");
    column.head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    this.table.setAttribute("aria-rowcount", rows.length + 1);
    this.none.textContent = rows.length ? "" : this.empty();
    this.draw();
  }

  // Selects a row, and scrolls to it.
  mark(selected) {
    this.selected = selected;
    const index = this.rows.findIndex((row) => this.key(row) === selected);
    if (index >= 0) this.reveal(index);
    else this.draw();
  }

  schedule() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      this.draw();
    });
  }

  draw() {
    const height = this.scroller.clientHeight;
    if (!height) return;
    const count = this.rows.length;
    const seen = Math.ceil(height / ROW) + 2 * OVERSCAN_ROWS;
    const top = Math.floor(this.scroller.scrollTop / ROW) - OVERSCAN_ROWS;
    const first = Math.max(0, Math.min(top, count - seen));
    const last = Math.min(count, first + seen);
    const focused = this.body.contains(document.activeElement)
      ? document.activeElement.closest("tr")?.dataset.key
      : undefined;
    const made = [spacer(first)];
    for (let index = first; index < last; index += 1) made.push(this.line(index));
    made.push(spacer(count - last));
    this.body.replaceChildren(...made);
    if (focused !== undefined) {
      const again = made.find((line) => line.dataset.key === focused);
      again?.querySelector("button")?.focus({ preventScroll: true });
    }
  }

  line(index) {
    const row = this.rows[index];
    const line = element("tr");
    line.dataset.index = index;
    line.dataset.key = this.key(row);
    line.setAttribute("aria-rowindex", index + 2);
    if (line.dataset.key === this.selected) line.setAttribute("aria-selected", "true");
    for (const column of this.columns) {
      const cell = element("td", classes(column));
      column.fill(cell, row);
      line.append(cell);
    }
    return line;
  }

  choose(index) {
    const row = this.rows[index];
    if (row) this.select(row);
  }

  // Arrow keys move the selection.
  step(event) {
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10 }[event.key];
    const from = event.target.closest("tr[data-index]");
    if (!by || !from) return;
    event.preventDefault();
    const index = Math.max(0, Math.min(this.rows.length - 1, Number(from.dataset.index) + by));
    this.choose(index);
    this.reveal(index);
    this.body.querySelector(`tr[data-index="${index}"] button`)?.focus({ preventScroll: true });
  }

  reveal(index) {
    const { scrollTop, clientHeight } = this.scroller;
    const top = index * ROW;
    if (top < scrollTop) this.scroller.scrollTop = top;
    else if (top + 2 * ROW > scrollTop + clientHeight) {
      this.scroller.scrollTop = top + 2 * ROW - clientHeight;
    }
    this.draw();
  }
}

function classes({ numeric, spare }) {
  return [numeric ? "number" : "", spare ? "spare" : ""].join(" ").trim();
}

function spacer(rows) {
  const line = element("tr", "spacer");
  line.style.height = `${rows * ROW}px`;
  line.setAttribute("aria-hidden", "true");
  return line;
}

// Compares numbers, texts, and missing values, which come last.
function compare(a, b) {
  if (typeof a === "number" || typeof b === "number") return (a ?? -1) - (b ?? -1);
  return a < b ? -1 : a > b ? 1 : 0;
}

// Fills a cell with a text that may be truncated.
export function put(cell, text) {
  cell.textContent = text;
  cell.title = text;
}
