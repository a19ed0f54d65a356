// The page: the summary of the run, or one of its flights, as the address says (address.js).
import { findFlight, nameInAddress, readAddress, writeAddress } from "./address.js";
import { run as readRun } from "./data.js";
import { showFlight } from "./flight.js";
import { header } from "./header.js";
import { LiveRun, showLive } from "./live.js";
import { onPrint } from "./printing.js";
import { showSummary } from "./summary.js";
import { onTheme } from "./theme.js";

// The address follows the reader when a time has been looked at for so long.
const STOPPED_ms = 300;

const run = readRun();
const main = document.getElementById("main");
const nothing = { close: () => {}, rebuild: () => {}, go: () => {} };
let view = nothing;
let address = null;  // of the flight that is shown
let index = -1;      // its place; -1: none
let shown = 0;
let stopped = null;
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

const follow = () => history.replaceState(null, "", writeAddress(address));

// The reader stopped at a time, or (null) changed the plots.
function moved(time_s) {
  clearTimeout(stopped);
  if (time_s === null) return follow();
  address.t = String(+time_s.toFixed(3));
  stopped = setTimeout(follow, STOPPED_ms);
}

function leave() {
  clearTimeout(stopped);
  view.close();
  view = nothing;
  liveView = null;
  address = null;
  index = -1;
}

async function show() {
  const turn = ++shown;
  leave();
  if (live && location.hash === "#live") {
    document.title = "Live – tiltproof";
    liveView = showLive(main, live, show);
    view = { close: liveView.close, rebuild: show };
    return;
  }
  const wanted = readAddress(location.hash);
  const { index: found = -1, problem } = findFlight(run.flights, wanted);
  const entry = run.flights[found];
  document.title = `${entry ? entry.name : title()} – tiltproof`;
  if (!entry) {
    table_ms = performance.now();
    const table = () => showSummary(main, run, problem);
    view = { close: () => {}, rebuild: table };
    return table();
  }
  index = found;
  address = Object.assign(wanted, nameInAddress(run.flights, index));
  follow();
  const flight = await showFlight(main, run, index, address, {
    wanted: () => turn === shown,
    moved,
    again: async (other) => {
      address.with = other;
      follow();
      await show();
      document.getElementById("second")?.focus({ preventScroll: true });
    },
  });
  if (turn !== shown) return flight.close();
  view = flight;
  follow();
}

// Another address: of the same flight only the time changes, and nothing is built again.
function changed() {
  const wanted = readAddress(location.hash);
  if (address && findFlight(run.flights, wanted).index === index) {
    const plots = ({ t, ...rest }) => JSON.stringify([rest.plots, rest.xy, rest.with]);
    const { t } = wanted;
    if (plots(wanted) === plots(address) || location.hash === `#flight-${index}`) {
      if (t !== null) view.go(t);
      return follow();
    }
  }
  show();
  scrollTo(0, 0);
}

// Shows the table's new lines: not while the reader chooses in it, and not too often.
function renewTable() {
  if (/^#(live$|flight[-=])/.test(location.hash)) return;
  const busy = main.contains(document.activeElement) && document.activeElement !== main;
  const wait_ms = busy ? 2000 : table_ms + 1000 - performance.now();
  if (wait_ms > 0) return void setTimeout(renewTable, wait_ms);
  show();
}

header(title(), facts(), Boolean(run.live));
// Not by the address, which says what is shown.
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
addEventListener("hashchange", changed);
onTheme(() => view.rebuild());
onPrint(() => view.rebuild());
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
