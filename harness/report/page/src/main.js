// The page: the summary of the run, or one of its flights, as the address says (#flight-3).
import { run as readRun } from "./data.js";
import { showFlight } from "./flight.js";
import { header } from "./header.js";
import { LiveRun, showLive } from "./live.js";
import { showSummary } from "./summary.js";
import { onTheme } from "./theme.js";

const run = readRun();
const main = document.getElementById("main");
let close = () => {};
let shown = 0;
// The LiveRun of a run that is still flown; null in a report.
let live = null;
let liveView = null;
let table_ms = 0;

function title() {
  const suites = [...new Set((run.runs ?? []).map((r) => r.suite))].join(", ");
  return suites || (run.live?.monitor ? "monitor" : "run");
}

function facts() {
  const one = run.runs?.length === 1 ? run.runs[0] : null;
  return one
    ? [one.started?.replace("T", " ").slice(0, 16) + " UTC", `client ${one.client}`, one.mode, `seed ${one.seed}`, `tiltproof ${one.version}`]
    : [run.live ? "what is heard on the bus" : `${run.runs?.length ?? 0} runs`, `tiltproof ${run.version}`];
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
  liveView = null;
  if (live && location.hash === "#live") {
    document.title = "Live – tiltproof";
    liveView = showLive(main, live, show);
    close = liveView.close;
    return;
  }
  const index = indexOf(location.hash);
  const entry = run.flights[index];
  document.title = `${entry ? entry.name : title()} – tiltproof`;
  if (!entry) {
    table_ms = performance.now();
    return showSummary(main, run);
  }
  const done = await showFlight(main, run, index, () => turn === shown);
  if (turn === shown) close = done;
  else done();
}

// The table has new lines: not while somebody chooses in it, and not too often.
function renewTable() {
  if (/^#(live$|flight[-=])/.test(location.hash)) return;
  const busy = main.contains(document.activeElement) && document.activeElement !== main;
  const wait_ms = busy ? 2000 : table_ms + 1000 - performance.now();
  if (wait_ms > 0) return void setTimeout(renewTable, wait_ms);
  show();
}

header(title(), facts(), Boolean(run.live));
addEventListener("hashchange", () => {
  show();
  scrollTo(0, 0);
});
onTheme(show);
if (run.live) {
  let late = null;
  live = new LiveRun(run, {
    flight: () => liveView && show(),
    rows: () => liveView?.rows(),
    status: () => liveView?.status(),
    finished: () => {
      liveView?.status();
      late ??= setTimeout(() => { late = null; renewTable(); }, 300);
    },
  });
  if (location.hash === "" || location.hash.startsWith("#token=")) history.replaceState(null, "", "#live");
}
// A report of one flight is that flight.
if (!run.live && run.flights.length === 1 && location.hash === "") history.replaceState(null, "", "#flight-0");
show();
