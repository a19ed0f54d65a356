// The criteria of a flight: verdicts, and how each one stands at the cursor.
import { badge, el, number, seconds } from "./dom.js";

// Implicit criteria that hold from the start until they are violated. The others are judged when the flight has ended.
const CONTINUOUS = ["survival", "clean_line"];
const EPSILON_s = 1e-6;

// Time of the first and the last row that a formula asks for something; null when it has no curve.
function windowOf(flight, name) {
  const series = `robustness_upper/${name}`;
  if (!flight.has(series)) return null;
  const { rows, values } = flight.points(series);
  const asked = (value) => !Number.isNaN(value);
  const first = values.findIndex(asked), last = values.findLastIndex(asked);
  return first < 0 ? null : { begin_s: flight.times_s[rows[first]], end_s: flight.times_s[rows[last]] };
}

// Returns a function of time: {state, value}. `state`: holds, violated, not yet judged, or undecided. `value`: the
// robustness at that time, null where there is none.
export function stateOf(flight, criterion) {
  const curve = flight.robustness?.find((c) => c.criterion === criterion.name);
  const window = curve ? windowOf(flight, criterion.name) : null;
  const { verdict } = criterion;
  const decided_s = criterion.time_s ?? flight.end_s;
  const final = verdict === "fail" ? "violated" : verdict === "pass" ? "holds" : "undecided";
  // From when on the criterion holds as far as the flight has come; from when on its verdict is known.
  let holds_s = Infinity, final_s = flight.end_s;
  if (curve?.reading === "lowest") {
    holds_s = window?.begin_s ?? Infinity;
    if (verdict === "fail") final_s = decided_s;
  } else if (curve?.reading === "highest") {
    if (verdict === "pass") final_s = decided_s;
    else if (verdict === "fail") final_s = window?.end_s ?? flight.end_s;
  } else if (curve) {
    if (verdict === "pass" || verdict === "fail") final_s = decided_s;
  } else {
    if (CONTINUOUS.includes(criterion.name)) holds_s = 0;
    if (verdict === "fail" && criterion.time_s !== null) final_s = decided_s;
  }
  return (time_s) => {
    const state = time_s >= Math.min(final_s, flight.end_s) - EPSILON_s ? final : time_s >= holds_s - EPSILON_s ? "holds" : "not yet judged";
    const inside = window && time_s >= window.begin_s - EPSILON_s && time_s <= window.end_s + EPSILON_s;
    const value = inside ? flight.at(`robustness_upper/${criterion.name}`, time_s) : NaN;
    return { state, value: Number.isNaN(value) ? null : value };
  };
}

const WORDS = ["Criterion", "At the cursor", "Verdict", "Margin", "Decided at", "Because"];

// `flight` and `clock` are null when the flight left no trace: then nothing is at a cursor.
export function criteriaTable(criteria, flight, clock) {
  const updates = [];
  const atCursor = (c) => {
    const state = el("span", { class: "state" }), value = el("span", { class: "n" });
    const of = stateOf(flight, c);
    let shown = "";
    updates.push((time_s) => {
      const now = of(time_s), text = `${now.state} ${number(now.value)}`;
      if (text === shown) return;
      shown = text;
      state.textContent = now.state;
      state.className = `state ${now.state.replaceAll(" ", "-")}`;
      value.textContent = now.value === null ? "" : number(now.value);
      value.classList.toggle("below", now.value !== null && now.value < 0);
    });
    return el("td", { class: "now-at" }, state, value);
  };
  const untouched = (c) => c.fault_can_affect === false && c.verdict !== "fail";
  const row = (c) => el("tr", {},
    el("th", { scope: "row", text: c.name }), clock ? atCursor(c) : null, el("td", {}, badge(c.verdict, c.verdict === "inconclusive" ? null : "pass")),
    el("td", { class: `n ${c.margin < 0 ? "below" : ""}`, title: untouched(c) ? "No fault can have changed it, so it is not the flight's margin" : null }, number(c.margin), untouched(c) ? el("span", { class: "hint untouched", text: " not by a fault" }) : null),
    el("td", { class: "n" }, c.time_s === null || c.time_s === undefined ? "" : clock ? el("button", { type: "button", class: "time", text: seconds(c.time_s), onclick: () => clock.set(c.time_s) }) : seconds(c.time_s)),
    el("td", { class: "why", text: c.explanation }));
  const order = { error: 0, fail: 1, inconclusive: 2, pass: 3 };
  const words = clock ? WORDS : WORDS.filter((_, i) => i !== 1);
  const table = el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Criteria" }, el("table", { class: "criteria-table" }, el("thead", {}, el("tr", {}, words.map((text) => el("th", { scope: "col", text })))),
    el("tbody", {}, [...criteria].sort((a, b) => order[a.verdict] - order[b.verdict]).map(row))));
  clock?.listen(() => updates.forEach((update) => update(clock.time_s)));
  return table;
}
