// The table of all flights.
import { nameInAddress, writeAddress } from "./address.js";
import { badge, el, number, seconds } from "./dom.js";
import { countBoxes } from "./header.js";
import { listing } from "./listing.js";

// A margin that changed by less is the same: two builds or processors may differ by as much (compare --tolerance).
const SAME_MARGIN = 0.001;
// A longer table is grouped until the reader chooses otherwise.
const GROUPED_MIN = 101;
// From good to bad, as compare orders them.
const ORDER = ["pass", "inconclusive", "fail", "error"];

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

// In results.json an error, so that no script takes it for done: the run ended before it.
const isNotFlown = (f) => f.verdict === "error" && f.reason?.startsWith("not flown");

const verdictOf = (f) => (isNotFlown(f) ? "not flown" : f.verdict);

function counts(run) {
  const of = (test) => run.flights.filter(test).length;
  const boxes = [
    ["green", "as expected", of((f) => f.green)],
    ["red", "not as expected", of((f) => !f.green && !isNotFlown(f))],
    ["", "passed", of((f) => f.verdict === "pass")],
    ["", "failed", of((f) => f.verdict === "fail")],
    ["", "inconclusive", of((f) => f.verdict === "inconclusive")],
    ["", "errors", of((f) => f.verdict === "error" && !isNotFlown(f))],
  ];
  const notFlown = of(isNotFlown);
  if (notFlown > 0) boxes.push(["", "not flown", notFlown]);
  const notApplicable = run.runs?.reduce((n, r) => n + (r.not_applicable?.length ?? 0), 0) ?? 0;
  if (notApplicable > 0) boxes.push(["", "not applicable", notApplicable]);
  return countBoxes(boxes);
}

function notes(run) {
  const lines = [];
  for (const r of run.runs ?? []) {
    if (r.interrupted) lines.push(`${r.folder}: the run was interrupted, or is still under way. Flights that did not end are errors in results.json.`);
    if (r.problem) lines.push(r.problem);
  }
  if (run.left_out_count > 0) lines.push(`${run.left_out_count} flights more are in results.json; this page has those that are not green first.`);
  return lines.map((text) => el("p", { class: "note", role: "note", text }));
}

function change(f) {
  if (f.before === null) return el("span", { class: "new", text: "new" });
  const words = f.before.verdict === f.verdict ? "" : `was ${f.before.verdict}`;
  const by = f.before.margin === null || f.margin === null ? 0 : f.margin - f.before.margin;
  const same = Math.abs(by) < SAME_MARGIN;
  // The verdict decides; the margin does where the verdict is the same.
  const worse = Math.sign(ORDER.indexOf(f.verdict) - ORDER.indexOf(f.before.verdict)) || (same ? 0 : -Math.sign(by));
  const change = same ? (words ? "" : "same") : `${by > 0 ? "+" : ""}${number(by, 2)}`;
  return el("span", { class: worse > 0 ? "worse" : worse < 0 ? "better" : "", title: by === 0 ? null : `margin ${number(f.before.margin, 6)} before, ${number(f.margin, 6)} now`, text: [words, change].filter(Boolean).join(", ") });
}

// The criterion that failed, or the verdict of a flight without one.
const criterionOf = (f) => (isNotFlown(f) ? "Not flown" : f.verdict === "pass" ? "Passed" : f.criterion ? `${f.criterion} (${f.verdict})` : f.verdict);
const faultsOf = (f) => [...new Set(f.faults.map((x) => x.type))].sort().join(" + ") || "no fault";
const GROUPS = [
  { value: "both", label: "criterion, then fault", of: [criterionOf, faultsOf] },
  { value: "criterion", label: "criterion", of: [criterionOf] },
  { value: "fault", label: "fault", of: [faultsOf] },
];

const addressOf = (run, index, time_s = null) => writeAddress({ ...nameInAddress(run.flights, index), t: time_s === null ? null : String(+time_s.toFixed(3)), plots: [], xy: [], with: null });

function row(run, f, index) {
  const kinds = [...new Set(f.faults.map((x) => x.type))];
  const cells = [
    el("th", { scope: "row" }, el("a", { href: addressOf(run, index), text: f.name })),
    el("td", {}, isNotFlown(f) ? badge("not flown", null) : badge(f.verdict, f.expected)),
    el("td", { class: `n ${f.margin !== null && f.margin < 0 ? "below" : ""}`, title: f.margin_of ? `Margin of ${f.margin_of}` : null, text: number(f.margin) }),
    el("td", { text: f.criterion ?? "", title: f.reason }),
    el("td", { class: "n" }, f.time_s === undefined || f.time_s === null ? "" : el("a", { href: addressOf(run, index, f.time_s), text: seconds(f.time_s), "aria-label": `${f.name} at ${seconds(f.time_s)}` })),
    el("td", { class: "n", text: f.flown_s === undefined ? "" : `${f.flown_s.toFixed(1)} s` }),
    el("td", { class: "n", text: f.rmse_m === undefined ? "" : `${f.rmse_m.toFixed(3)} m` }),
    el("td", { class: "faults", text: kinds.slice(0, 3).join(", ") + (kinds.length > 3 ? ` +${kinds.length - 3}` : ""), title: kinds.join(", ") }),
    el("td", { class: "n", text: f.seed }),
  ];
  if (run.baseline) cells.push(el("td", {}, change(f)));
  if (run.runs.length > 1) cells.push(el("td", { text: run.runs[f.run].started?.slice(0, 16).replace("T", " ") ?? "" }));
  return el("tr", {}, cells);
}

const wordsOf = (f) => [f.name, f.criterion, f.reason, ...f.faults.flatMap((x) => [x.type, x.id]), ...(f.tags ?? [])].join(" ");

// `problem`: why the flight that the address names is not shown; in words.
export function showSummary(main, run, problem = null) {
  const tags = [...new Set(run.flights.flatMap((f) => f.tags ?? []))].sort();
  const selects = [{ label: "Verdict", options: [["red", "not as expected"], ...["pass", "fail", "inconclusive", "error"].map((v) => [v, v]), ...(run.flights.some(isNotFlown) ? [["not flown", "not flown"]] : [])], fits: (f, value) => (value === "red" ? !f.green && !isNotFlown(f) : value === verdictOf(f)) }];
  if (tags.length > 0) selects.push({ label: "Tag", options: tags.map((t) => [t, t]), fits: (f, value) => f.tags?.includes(value) });
  const columns = [...COLUMNS];
  if (run.baseline) columns.push({ key: "before", label: "Since the baseline" });
  if (run.runs.length > 1) columns.push({ key: "run", label: "Run" });
  const [filters, told, table] = listing({
    label: "Flights", noun: "flights", kind: "flights", order: "the least margin first", placeholder: "name, fault, criterion",
    items: run.flights, columns, selects, words: wordsOf, row: (f, index) => row(run, f, index),
    groups: GROUPS, grouped: run.flights.length >= GROUPED_MIN ? "both" : "",
  });
  const left = run.runs.flatMap((r) => r.not_applicable ?? []);
  main.replaceChildren(
    ...(problem ? [el("p", { class: "note", role: "alert", text: problem })] : []),
    el("h1", { text: "Flights" }), counts(run), ...notes(run),
    ...(run.baseline ? [el("p", { class: "note", text: `Baseline: ${run.baseline}${run.only_in_baseline.length > 0 ? `. Only there: ${run.only_in_baseline.slice(0, 20).join(", ")}` : ""}` })] : []),
    filters, told, run.flights.length > 0 ? table : el("p", { text: "This run has no flights." }),
    ...(left.length > 0 ? [el("details", {}, el("summary", { text: `${left.length} scenarios that this client cannot fly` }), el("ul", {}, left.map((s) => el("li", { text: `${s.name}: ${s.reason}` }))))] : []));
}
