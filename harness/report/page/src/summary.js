// The table of all flights.
import { badge, el, number, seconds } from "./dom.js";

const COLUMNS = [
  { key: "name", label: "Flight", of: (f) => f.name },
  { key: "verdict", label: "Verdict", of: (f) => (f.green ? "1" : "0") + f.verdict },
  { key: "margin", label: "Least margin", of: (f) => f.margin ?? (f.verdict === "pass" ? Infinity : 0), numeric: true },
  { key: "criterion", label: "First failing criterion", of: (f) => f.criterion ?? "" },
  { key: "time", label: "At", of: (f) => f.time_s ?? Infinity, numeric: true },
  { key: "flown", label: "Flown", of: (f) => f.flown_s ?? -1, numeric: true },
  { key: "rmse", label: "RMSE", of: (f) => f.rmse_m ?? -1, numeric: true },
  { key: "faults", label: "Faults", of: (f) => f.faults.map((x) => x.type).join() },
  { key: "seed", label: "Seed", of: (f) => f.seed, numeric: true },
];
// Rows in the table at once: more come by a button.
const ROWS_MAX = 500;

function counts(run) {
  const of = (test) => run.flights.filter(test).length;
  const boxes = [
    ["green", "as expected", of((f) => f.green)],
    ["red", "not as expected", of((f) => !f.green)],
    ["", "passed", of((f) => f.verdict === "pass")],
    ["", "failed", of((f) => f.verdict === "fail")],
    ["", "inconclusive", of((f) => f.verdict === "inconclusive")],
    ["", "errors", of((f) => f.verdict === "error")],
  ];
  const notApplicable = run.runs?.reduce((n, r) => n + (r.not_applicable?.length ?? 0), 0) ?? 0;
  if (notApplicable > 0) boxes.push(["", "not applicable", notApplicable]);
  return el("div", { class: "counts" }, boxes.map(([kind, label, n]) => el("div", { class: `count ${n > 0 ? kind : ""}` }, el("b", { text: n }), el("span", { text: label }))));
}

function notes(run) {
  const lines = [];
  for (const r of run.runs ?? []) {
    if (r.interrupted) lines.push(`${r.folder}: the run was interrupted, or is still under way. Flights that did not end are errors.`);
    if (r.problem) lines.push(r.problem);
  }
  if (run.left_out_count > 0) lines.push(`${run.left_out_count} flights more are in results.json; this page has those that are not green first.`);
  return lines.map((text) => el("p", { class: "note", role: "note", text }));
}

function change(f) {
  if (f.before === null) return el("span", { class: "new", text: "new" });
  const words = f.before.verdict === f.verdict ? "" : `was ${f.before.verdict}`;
  if (f.before.margin === null || f.margin === null) return el("span", { text: words || "same" });
  const by = f.margin - f.before.margin;
  return el("span", { class: by < 0 ? "worse" : by > 0 ? "better" : "" , text: [words, by === 0 ? "same" : `${by > 0 ? "+" : ""}${number(by, 2)}`].filter(Boolean).join(", ") });
}

function row(run, f, index) {
  const kinds = [...new Set(f.faults.map((x) => x.type))];
  const cells = [
    el("th", { scope: "row" }, el("a", { href: `#flight-${index}`, text: f.name })),
    el("td", {}, badge(f.verdict, f.expected)),
    el("td", { class: `n ${f.margin !== null && f.margin < 0 ? "below" : ""}`, text: number(f.margin) }),
    el("td", { text: f.criterion ?? "", title: f.reason }),
    el("td", { class: "n", text: f.time_s === undefined || f.time_s === null ? "" : seconds(f.time_s) }),
    el("td", { class: "n", text: f.flown_s === undefined ? "" : `${f.flown_s.toFixed(1)} s` }),
    el("td", { class: "n", text: f.rmse_m === undefined ? "" : `${f.rmse_m.toFixed(3)} m` }),
    el("td", { class: "faults", text: kinds.slice(0, 3).join(", ") + (kinds.length > 3 ? ` +${kinds.length - 3}` : ""), title: kinds.join(", ") }),
    el("td", { class: "n", text: f.seed }),
  ];
  if (run.baseline) cells.push(el("td", {}, change(f)));
  if (run.runs.length > 1) cells.push(el("td", { text: run.runs[f.run].started?.slice(0, 16).replace("T", " ") ?? "" }));
  return el("tr", {}, cells);
}

export function showSummary(main, run) {
  const state = { text: "", verdict: "", tag: "", sort: "", down: false, rows: ROWS_MAX };
  const body = el("tbody");
  const told = el("p", { class: "told", role: "status" });
  const heads = COLUMNS.map((column) =>
    el("th", { scope: "col", class: column.numeric ? "n" : "" }, el("button", { type: "button", text: column.label, onclick: () => {
      state.down = state.sort === column.key && !state.down;
      state.sort = column.key;
      fill();
    } })));

  function fill() {
    const words = state.text.toLowerCase().split(/\s+/).filter(Boolean);
    let found = run.flights.map((f, index) => ({ f, index })).filter(({ f }) => {
      if (state.verdict === "red" && f.green) return false;
      if (state.verdict && state.verdict !== "red" && f.verdict !== state.verdict) return false;
      if (state.tag && !f.tags?.includes(state.tag)) return false;
      const text = [f.name, f.criterion, f.reason, ...f.faults.flatMap((x) => [x.type, x.id]), ...(f.tags ?? [])].join(" ").toLowerCase();
      return words.every((word) => text.includes(word));
    });
    const column = COLUMNS.find((c) => c.key === state.sort);
    if (column) {
      const order = (a, b) => (column.of(a.f) < column.of(b.f) ? -1 : column.of(a.f) > column.of(b.f) ? 1 : 0);
      found = found.sort(order);
      if (state.down) found.reverse();
    }
    heads.forEach((head, i) => head.setAttribute("aria-sort", COLUMNS[i].key === state.sort ? (state.down ? "descending" : "ascending") : "none"));
    body.replaceChildren(...found.slice(0, state.rows).map(({ f, index }) => row(run, f, index)));
    const more = found.length - state.rows;
    told.replaceChildren(`${found.length} of ${run.flights.length} flights${state.sort ? "" : ", the least margin first"} `);
    if (more > 0) told.append(el("button", { type: "button", text: `Show ${Math.min(more, ROWS_MAX)} more`, onclick: () => { state.rows += ROWS_MAX; fill(); } }));
  }

  const option = (value, text) => el("option", { value, text });
  const tags = [...new Set(run.flights.flatMap((f) => f.tags ?? []))].sort();
  const on = (key) => (event) => { state[key] = event.target.value; state.rows = ROWS_MAX; fill(); };
  const filters = el("form", { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() },
    el("label", {}, "Find ", el("input", { type: "search", placeholder: "name, fault, criterion", oninput: on("text") })),
    el("label", {}, "Verdict ", el("select", { onchange: on("verdict") }, option("", "all"), option("red", "not as expected"), ["pass", "fail", "inconclusive", "error"].map((v) => option(v, v)))),
    tags.length > 0 ? el("label", {}, "Tag ", el("select", { onchange: on("tag") }, option("", "all"), tags.map((t) => option(t, t)))) : null);
  const extra = [];
  if (run.baseline) extra.push(el("th", { scope: "col", text: "Since the baseline" }));
  if (run.runs.length > 1) extra.push(el("th", { scope: "col", text: "Run" }));
  fill();
  const table = el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Flights" }, el("table", { class: "flights" }, el("thead", {}, el("tr", {}, heads, extra)), body));
  const left = run.runs.flatMap((r) => r.not_applicable ?? []);
  main.replaceChildren(
    el("h1", { text: "Flights" }), counts(run), ...notes(run),
    ...(run.baseline ? [el("p", { class: "note", text: `Baseline: ${run.baseline}${run.only_in_baseline.length > 0 ? `. Only there: ${run.only_in_baseline.slice(0, 20).join(", ")}` : ""}` })] : []),
    filters, told, run.flights.length > 0 ? table : el("p", { text: "This run has no flights." }),
    ...(left.length > 0 ? [el("details", {}, el("summary", { text: `${left.length} scenarios that this client cannot fly` }), el("ul", {}, left.map((s) => el("li", { text: `${s.name}: ${s.reason}` }))))] : []));
}
