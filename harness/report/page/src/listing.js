// A table that the reader searches, filters and sorts.
//
//   main.append(...listing({ label: "Flights", noun: "flights", kind: "flights", items, columns, row, words, selects }))
//
// columns: [{key, label, of: item => sortable, numeric}], without `of` not sortable. row: (item, index) => tr. words: item =>
// the text that is searched. selects: [{label, options: [[value, text], ...], fits: (item, value) => bool}]; the value ""
// is all. order: how the items stand before a column is clicked, in words.
import { el } from "./dom.js";

// Rows in the table at once: more come by a button.
const ROWS_MAX = 500;

export function listing({ label, noun, kind, items, columns, row, words, selects, placeholder = "", order = "" }) {
  const state = { text: "", sort: "", down: false, rows: ROWS_MAX, chosen: selects.map(() => "") };
  const body = el("tbody");
  const told = el("p", { class: "told", role: "status" });
  const sortBy = (column) => {
    state.down = state.sort === column.key && !state.down;
    state.sort = column.key;
    fill();
  };
  const heads = columns.map((column) =>
    el("th", { scope: "col", class: column.numeric ? "n" : "" }, column.of ? el("button", { type: "button", text: column.label, onclick: () => sortBy(column) }) : column.label));

  function fill() {
    const wanted = state.text.toLowerCase().split(/\s+/).filter(Boolean);
    const found = items.map((item, index) => ({ item, index })).filter(({ item }) => {
      if (!selects.every((select, i) => state.chosen[i] === "" || select.fits(item, state.chosen[i]))) return false;
      const text = words(item).toLowerCase();
      return wanted.every((word) => text.includes(word));
    });
    const column = columns.find((c) => c.key === state.sort);
    if (column) {
      found.sort((a, b) => (column.of(a.item) < column.of(b.item) ? -1 : column.of(a.item) > column.of(b.item) ? 1 : 0));
      if (state.down) found.reverse();
    }
    heads.forEach((head, i) => columns[i].of && head.setAttribute("aria-sort", columns[i].key === state.sort ? (state.down ? "descending" : "ascending") : "none"));
    body.replaceChildren(...found.slice(0, state.rows).map(({ item, index }) => row(item, index)));
    const more = found.length - state.rows;
    told.replaceChildren(`${found.length} of ${items.length} ${noun}${state.sort || !order ? "" : `, ${order}`} `);
    if (more > 0) told.append(el("button", { type: "button", text: `Show ${Math.min(more, ROWS_MAX)} more`, onclick: () => { state.rows += ROWS_MAX; fill(); } }));
  }
  const set = (change) => (event) => {
    change(event.target.value);
    state.rows = ROWS_MAX;
    fill();
  };
  const filters = el("form", { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() },
    el("label", {}, "Find ", el("input", { type: "search", placeholder, oninput: set((value) => (state.text = value)) })),
    selects.map((select, i) => el("label", {}, `${select.label} `, el("select", { onchange: set((value) => (state.chosen[i] = value)) },
      [["", "all"], ...select.options].map(([value, text]) => el("option", { value, text }))))));
  fill();
  return [filters, told, el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, el("table", { class: kind }, el("thead", {}, el("tr", {}, heads)), body))];
}
