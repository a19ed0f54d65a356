// The page: the summary of the run, or one of its flights, as the address says (#flight-3).
import { run as readRun } from "./data.js";
import { showFlight } from "./flight.js";
import { header } from "./header.js";
import { showSummary } from "./summary.js";
import { onTheme } from "./theme.js";

const run = readRun();
const main = document.getElementById("main");
let close = () => {};
let shown = 0;

function title() {
  const suites = [...new Set((run.runs ?? []).map((r) => r.suite))].join(", ");
  return suites || "run";
}

function facts() {
  const one = run.runs?.length === 1 ? run.runs[0] : null;
  return one
    ? [one.started?.replace("T", " ").slice(0, 16) + " UTC", `client ${one.client}`, one.mode, `seed ${one.seed}`, `tiltproof ${one.version}`]
    : [`${run.runs?.length ?? 0} runs`, `tiltproof ${run.version}`];
}

// #flight-3 by its place, #flight=NAME by its name: what other pages link to.
function indexOf(hash) {
  const place = /^#flight-(\d+)$/.exec(hash);
  if (place) return Number(place[1]);
  if (!hash.startsWith("#flight=")) return -1;
  try {
    const name = decodeURIComponent(hash.slice("#flight=".length));
    return run.flights.findIndex((f) => f.name === name);
  } catch {
    return -1;  // not encoded as an address is
  }
}

async function show() {
  const turn = ++shown;
  close();
  close = () => {};
  const index = indexOf(location.hash);
  const entry = run.flights[index];
  document.title = `${entry ? entry.name : title()} – tiltproof`;
  if (!entry) return showSummary(main, run);
  const done = await showFlight(main, run, index, () => turn === shown);
  if (turn === shown) close = done;
  else done();
}

header(title(), facts());
addEventListener("hashchange", () => {
  show();
  scrollTo(0, 0);
});
onTheme(show);
// A report of one flight is that flight.
if (run.flights.length === 1 && location.hash === "") history.replaceState(null, "", "#flight-0");
show();
