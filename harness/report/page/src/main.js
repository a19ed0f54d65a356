// The page: the summary of the run, or one of its flights, as the address says (#flight-3).
import { el } from "./dom.js";
import { run as readRun } from "./data.js";
import { showFlight } from "./flight.js";
import { showSummary } from "./summary.js";
import { onTheme, toggleTheme } from "./theme.js";

const run = readRun();
const main = document.getElementById("main");
let close = () => {};
let shown = 0;

function title() {
  const suites = [...new Set((run.runs ?? []).map((r) => r.suite))].join(", ");
  return suites || "run";
}

function header() {
  const one = run.runs?.length === 1 ? run.runs[0] : null;
  const facts = one
    ? [one.started?.replace("T", " ").slice(0, 16) + " UTC", `client ${one.client}`, one.mode, `seed ${one.seed}`, `tiltproof ${one.version}`]
    : [`${run.runs?.length ?? 0} runs`, `tiltproof ${run.version}`];
  document.getElementById("header").replaceChildren(
    el("a", { href: "#", class: "home" }, el("span", { class: "logo", "aria-hidden": "true", text: "◭" }), el("span", { text: `tiltproof · ${title()}` })),
    el("span", { class: "facts", text: facts.join(" · ") }),
    el("button", { type: "button", class: "theme", onclick: toggleTheme, text: "Light / dark" }),
  );
}

async function show() {
  const turn = ++shown;
  close();
  close = () => {};
  const match = /^#flight-(\d+)$/.exec(location.hash);
  const index = match ? Number(match[1]) : -1;
  const entry = run.flights[index];
  document.title = `${entry ? entry.name : title()} – tiltproof`;
  if (!entry) return showSummary(main, run);
  const done = await showFlight(main, run, index, () => turn === shown);
  if (turn === shown) close = done;
  else done();
}

header();
addEventListener("hashchange", () => {
  show();
  scrollTo(0, 0);
});
onTheme(show);
// A report of one flight is that flight.
if (run.flights.length === 1 && location.hash === "") history.replaceState(null, "", "#flight-0");
show();
