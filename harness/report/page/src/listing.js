// A table that the reader searches, filters, sorts and groups.
//
//   main.append(...listing({ label: "Flights", noun: "flights", kind: "flights", items, columns, row, words, selects }))
//
// columns: [{key, label, of: item => sortable, numeric}], without `of` not sortable. row: (item, index) => tr. words: item =>
// the text that is searched. selects: [{label, options: [[value, text], ...], fits: (item, value) => bool}]; the value ""
// is all. order: how the items stand before a column is clicked, in words. groups: [{value, label, of: [item => name of its
// group, item => name of its group inside of that, ...]}]; grouped: the value of the one that holds at first.
import { el } from "./dom.js";
import { isPrinting } from "./printing.js";

// Rows in the table at once: more come by a button.
const ROWS_MAX = 500;
// The reader's choices in the table of each kind: they hold when the table is shown again.
const chosen = new Map();

// The items of each group, in the order of their first items: [{name, items, groups}].
function grouped(found, keys) {
  if (keys.length === 0) return null;
  const groups = new Map();
  for (const entry of found) {
    const name = keys[0](entry.item);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(entry);
  }
  return [...groups].map(([name, items]) => ({ name, items, groups: grouped(items, keys.slice(1)) }));
}

export function listing({ label, noun, kind, items, columns, row, words, selects, groups = [], grouped: first = "", placeholder = "", order = "" }) {
  const state = chosen.get(kind) ?? { text: "", sort: "", down: false, rows: ROWS_MAX, chosen: selects.map(() => ""), group: first, opened: new Set(), closed: new Set() };
  chosen.set(kind, state);
  const body = el("tbody");
  const told = el("p", { class: "told", role: "status" });
  const sortBy = (column) => {
    state.down = state.sort === column.key && !state.down;
    state.sort = column.key;
    fill();
  };
  const heads = columns.map((column) =>
    el("th", { scope: "col", class: column.numeric ? "n" : "" }, column.of ? el("button", { type: "button", text: column.label, onclick: () => sortBy(column) }) : column.label));

  // Groups are closed until the reader opens them or looks for something.
  const looksFor = () => state.text.trim() !== "" || state.chosen.some(Boolean);
  const isOpen = (path) => isPrinting() || (looksFor() ? !state.closed.has(path) : state.opened.has(path));
  function heading(group, path, depth) {
    const open = isOpen(path);
    const button = el("button", { type: "button", class: "open", "aria-expanded": String(open), onclick: () => {
      const turned = looksFor() ? state.closed : state.opened;
      if (!turned.delete(path)) turned.add(path);
      fill();
      body.querySelectorAll("tr.group").forEach((tr) => tr.dataset.path === path && tr.querySelector("button").focus());
    } }, el("span", { "aria-hidden": "true", text: open ? "▾ " : "▸ " }), group.name);
    return el("tr", { class: `group depth-${depth}`, "data-path": path }, el("th", { scope: "rowgroup", colspan: columns.length }, button, el("span", { class: "many", text: ` ${group.items.length} ${group.items.length === 1 ? noun.replace(/s$/, "") : noun}` })));
  }
  // The rows that are to be seen: headings of groups, and what is in open ones.
  function lines(all, path = "", depth = 0) {
    return all.flatMap((group) => {
      const own = JSON.stringify([path, group.name]);
      const inside = !isOpen(own) ? [] : group.groups ? lines(group.groups, own, depth + 1) : group.items;
      return [{ heading: () => heading(group, own, depth) }, ...inside];
    });
  }

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
    const keys = groups.find((group) => group.value === state.group)?.of ?? [];
    const seen = keys.length > 0 ? lines(grouped(found, keys)) : found;
    const rows = isPrinting() ? Infinity : state.rows;
    body.replaceChildren(...seen.slice(0, rows).map((line) => line.heading?.() ?? row(line.item, line.index)));
    const more = seen.length - rows;
    told.replaceChildren(`${found.length} of ${items.length} ${noun}${state.sort || !order ? "" : `, ${order}`} `);
    if (more > 0) told.append(el("button", { type: "button", text: `Show ${Math.min(more, ROWS_MAX)} more`, onclick: () => { state.rows += ROWS_MAX; fill(); } }));
  }
  const set = (change) => (event) => {
    change(event.target.value);
    state.closed.clear();
    state.rows = ROWS_MAX;
    fill();
  };
  const choose = (name, options, value, change) => el("label", {}, `${name} `, el("select", { onchange: set(change) }, options.map(([option, text]) => el("option", { value: option, text, selected: option === value }))));
  const search = el("input", { type: "search", placeholder, oninput: set((value) => (state.text = value)) });
  search.value = state.text;
  const filters = el("form", { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() },
    el("label", {}, "Find ", search),
    selects.map((select, i) => choose(select.label, [["", "all"], ...select.options], state.chosen[i], (value) => (state.chosen[i] = value))),
    groups.length > 0 ? choose("Group by", [["", "nothing"], ...groups.map((group) => [group.value, group.label])], state.group, (value) => { state.group = value; state.opened.clear(); }) : null);
  fill();
  return [filters, told, el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, el("table", { class: kind }, el("thead", {}, el("tr", {}, heads)), body))];
}
