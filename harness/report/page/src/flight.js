// One flight: what was decided and why, the replay, the figures, the frames.
import { readTime } from "./address.js";
import { Clock } from "./clock.js";
import { criteriaTable } from "./criteria.js";
import { Flight } from "./data.js";
import { badge, copyable, el, number, seconds } from "./dom.js";
import { extrasSection, knownPlots } from "./extras.js";
import { figuresOf, histogram } from "./figures.js";
import { framesSection } from "./frames.js";
import { Plots } from "./plots.js";
import { isPrinting } from "./printing.js";
import { Replay } from "./replay.js";
import { section } from "./section.js";
import { faultColour } from "./theme.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

function faultList(flight, clock) {
  return el("ul", { class: "fault-list" }, flight.result.faults.map((fault, i) => {
    const swatch = el("span", { class: "block" });
    swatch.style.background = faultColour(i);
    const bands = flight.bands.filter((b) => b.fault === i);
    const ticks = flight.ticks.filter((t) => t[0] === i);
    const told = ticks.filter((t) => t[2]);
    const first = bands[0]?.begin_s ?? ticks[0]?.[1];
    const words = [`${fault.activations} activation${fault.activations === 1 ? "" : "s"}`];
    if (ticks.length < fault.activations) words.push(`ticks for the first ${ticks.length}`);
    if (bands.length === 1) words.push(`active from ${number(bands[0].begin_s, 5)} to ${number(bands[0].end_s, 5)} s`);
    if (bands.length > 1) words.push(`active ${bands.length} times${isPrinting() ? `: ${bands.map((b) => `${number(b.begin_s, 5)} to ${number(b.end_s, 5)} s`).join("; ")}` : ""}`);
    return el("li", {}, swatch, el("b", { text: fault.id }), ` ${fault.type}, ${words.join(", ")} `,
      first !== undefined ? el("button", { type: "button", text: `Go to ${number(first, 5)} s`, onclick: () => clock.set(first) }) : null,
      told.length > 0 ? el("details", {}, el("summary", { text: "What it did first" }), el("ol", {}, told.slice(0, 30).map(([, time_s, what]) => el("li", {}, el("button", { type: "button", class: "time", text: seconds(time_s), onclick: () => clock.set(time_s) }), ` ${what}`)))) : null);
  }));
}

function player(flight, clock) {
  const play = el("button", { type: "button", class: "play", title: "Space", onclick: () => clock.toggle() });
  const scrub = el("input", { type: "range", min: 0, max: flight.end_s, step: 0.004, value: 0, "aria-label": "Time in the flight", oninput: (event) => clock.set(Number(event.target.value)) });
  const now = el("output", { class: "now" });
  const speed = el("select", { "aria-label": "Speed", onchange: (event) => (clock.speed = Number(event.target.value)) }, SPEEDS.map((s) => el("option", { value: s, text: `${s}×`, selected: s === 1 })));
  const violation = flight.violation_s;
  clock.listen(() => {
    play.textContent = clock.playing ? "Pause" : "Play";
    scrub.value = clock.time_s;
    scrub.setAttribute("aria-valuetext", `${clock.time_s.toFixed(2)} seconds`);
    now.textContent = `${clock.time_s.toFixed(3)} s`;
  });
  return el("div", { class: "player" }, play, scrub, now, speed,
    violation !== null ? el("button", { type: "button", class: "jump", title: "j", text: "First violation", onclick: () => clock.set(violation) }) : null);
}

export function keys(flight, clock) {
  const onKey = (event) => {
    const { tagName: tag, type } = event.target;
    // Keys that write or choose in a field are no commands.
    if (event.ctrlKey || event.metaKey || event.altKey || tag === "SELECT" || (tag === "INPUT" && !["range", "checkbox"].includes(type))) return;
    const step = event.shiftKey ? 1 : 0.1;
    const actions = {
      " ": () => !["BUTTON", "SUMMARY"].includes(tag) && type !== "checkbox" && clock.toggle(),
      ArrowLeft: () => clock.set(clock.time_s - step),
      ArrowRight: () => clock.set(clock.time_s + step),
      Home: () => clock.set(0),
      End: () => clock.set(clock.end_s),
      j: () => flight.violation_s !== null && clock.set(flight.violation_s),
    };
    const action = actions[event.key];
    if (!action || action() === false) return;
    event.preventDefault();
  };
  addEventListener("keydown", onKey);
  return () => removeEventListener("keydown", onKey);
}

function metricsTable(metrics) {
  return el("details", {}, el("summary", { text: "All metrics" }), el("div", { class: "scroll" }, el("table", { class: "metrics" }, el("tbody", {}, Object.entries(metrics).map(([name, value]) => el("tr", {}, el("th", { scope: "row", text: name }), el("td", { class: "n", text: number(value, 6) })))))));
}

function head(run, entry, result) {
  const version = run.runs[entry.run]?.version ?? run.version;
  const facts = [["Seed", entry.seed], ["tiltproof", version], ["Trace", result.trace_hash], ["Ended", result.end_reason], ["Outcome", result.outcome]].filter(([, v]) => v !== null && v !== undefined && v !== "");
  return [
    el("nav", { "aria-label": "Flights" }, el("a", { href: run.live ? "#all" : "#", text: "All flights" })),
    el("h1", {}, entry.name, " ", badge(entry.verdict, entry.expected)),
    entry.reason ? el("p", { class: `reason ${entry.verdict}`, text: entry.reason }) : null,
    el("p", { class: "facts" }, facts.map(([key, value], i) => [i > 0 ? " · " : "", `${key} `, el("b", { text: value })])),
    entry.replay ? el("div", { class: "again" }, el("span", { text: "Again: " }), copyable(entry.replay, "the command that flies this flight again")) : null,
  ].filter(Boolean);
}

function withoutFiles(main, run, entry, problems) {
  const result = entry.result ?? {};
  main.replaceChildren(...head(run, entry, result), ...problems.map(note),
    el("p", { class: "note", text: entry.problem ?? "This flight left no files (--keep), so there are no figures: this is what results.json has." }),
    section("criteria", "Criteria", criteriaTable(result.criteria ?? [], null, null)),
    ...Object.entries(result.histograms ?? {}).map(([name, h]) => histogram(name, h)).filter(Boolean),
    metricsTable(result.metrics ?? {}));
  return () => {};
}

export function replayPanel(flight, clock) {
  const view = el("div", { class: "view" });
  const panel = el("section", { class: "replay", id: "replay", "aria-label": "Replay" });
  const large = el("input", { type: "checkbox", checked: true });
  const follow = el("input", { type: "checkbox" });
  const reset = el("button", { type: "button", text: "Whole path" });
  panel.append(view, player(flight, clock),
    el("div", { class: "options" }, el("label", {}, large, " enlarged vehicle"), el("label", {}, follow, " follow"), reset,
      el("span", { class: "hint", text: "Space plays; ← → 0.1 s, with Shift 1 s; j goes to the first violation. Drag to turn, wheel to zoom." })));
  let replay = null;
  const start = () => {
    try {
      replay = new Replay(flight, clock, view);
    } catch {
      view.append(el("p", { class: "note", text: "This browser has no WebGL: the path is in the figure “Position”." }));
      return;
    }
    large.addEventListener("change", () => replay.enlarge(large.checked));
    follow.addEventListener("change", () => replay.followVehicle(follow.checked));
    reset.addEventListener("click", () => { follow.checked = replay.follow = replay.turned = false; replay.look(); });
  };
  return { panel, start, grow: () => replay?.grow(), close: () => replay?.close() };
}

// The firmware that flew, by client's id; "": the firmware of clients that are not named.
export const clientsOf = (info) => ({ "": info?.client, ...info?.clients });

// As in the command that flies it again.
const programOf = (entry) => /^(.+?) (replay|run) /.exec(entry.replay ?? "")?.[1] ?? "tiltproof";

const note = (text) => el("p", { class: "note", role: "alert", text });

// The flight that was shown last stays in memory: it is shown again in other colours, and for a printer at once.
const loaded = new Map();
async function load(details, kept) {
  for (const id of loaded.keys()) if (!kept.includes(id)) loaded.delete(id);
  if (!loaded.has(details)) loaded.set(details, await Flight.load(details));
  return loaded.get(details);
}

// The second flight of the address: {other, problem}.
async function secondFlight(run, index, name, kept) {
  if (name === null) return { other: null };
  const entry = run.flights.find((f, i) => f.name === name && i !== index);
  if (!entry) return { other: null, problem: `This report has no other flight “${name}” to lay over this one.` };
  if (!entry.details) return { other: null, problem: `The flight “${name}” left no files, so it cannot be laid over this one.` };
  try {
    return { other: { flight: await load(entry.details, [...kept, entry.details]), name } };
  } catch (error) {
    return { other: null, problem: `The data of the flight “${name}” cannot be read: ${error.message}` };
  }
}

function secondChooser(run, index, name, choose) {
  const names = [...new Set(run.flights.filter((f, i) => i !== index && f.details).map((f) => f.name))];
  if (names.length === 0) return null;
  const select = el("select", { id: "second", onchange: () => choose(select.value || null) }, el("option", { value: "", text: "none" }), names.map((n) => el("option", { value: n, text: n, selected: n === name })));
  return el("label", { class: "second" }, "Second flight, dashed: ", select);
}

// Where the flight opens: where the address says, else at the first violation, else at its start.
function startOf(flight, address, problems) {
  const { time_s, problem } = readTime(address.t, flight.end_s);
  if (problem) {
    problems.push(problem);
    address.t = null;
  }
  return time_s ?? flight.violation_s ?? 0;
}

// Shows a flight as `address` says (address.js). `on`: {wanted: () => whether it is still to be shown, moved: what to call
// when the reader has stopped at another time or chosen other plots, again: what to call to show it with a second flight}.
// Returns {close, rebuild, go}.
export async function showFlight(main, run, index, address, on) {
  const entry = run.flights[index];
  const nothing = { close: () => {}, rebuild: () => {}, go: () => {} };
  if (!entry.details) {
    withoutFiles(main, run, entry, address.t === null ? [] : ["The address asks for a time, but this flight left no files, so the page cannot show it."]);
    return nothing;
  }
  let flight;
  try {
    flight = await load(entry.details, [entry.details]);
  } catch (error) {
    if (on.wanted()) main.replaceChildren(...head(run, entry, {}), el("p", { class: "note", text: `The data of this flight cannot be read: ${error.message}` }));
    return nothing;
  }
  const { other, problem } = await secondFlight(run, index, address.with, [entry.details]);
  if (!on.wanted()) return nothing;
  const { known, unknown } = knownPlots(flight, address);
  const problems = [problem, unknown.length > 0 ? `This flight has no signal ${unknown.map((name) => `“${name}”`).join(", ")}.` : null].filter(Boolean);
  Object.assign(address, known);
  const state = { time_s: startOf(flight, address, problems), range: null };
  let view = build(main, run, index, flight, other, address, problems, state, on);
  return {
    close: () => view.close(),
    rebuild: () => {
      view.close();
      view = build(main, run, index, flight, other, address, problems, state, on);
    },
    go: (t) => {
      const found = readTime(t, flight.end_s);
      main.querySelector(".wrong-time")?.remove();
      if (found.problem) main.prepend(el("div", { class: "wrong-time" }, note(found.problem)));
      else if (found.time_s !== undefined) view.clock.set(found.time_s);
    },
  };
}

function build(main, run, index, flight, other, address, problems, state, on) {
  const entry = run.flights[index];
  const clock = new Clock(flight.end_s);
  const plots = new Plots(flight, clock, other);
  const flown = flight.times_s.length > 0;
  const figures = flown ? figuresOf(flight, clientsOf(run.runs[entry.run])).map((spec) => plots.add(spec)) : [];
  const histograms = Object.entries(flight.result.histograms ?? {}).sort().reverse().map(([name, h]) => histogram(name, h)).filter(Boolean);
  const replay = flown ? replayPanel(flight, clock) : null;
  const extras = flown ? extrasSection(flight, clock, plots, address, () => on.moved(null)) : null;
  const scenario = flight.scenario;
  main.replaceChildren(...head(run, entry, flight.result), ...problems.map(note),
    ...(scenario.description ? [el("p", { class: "description", text: scenario.description })] : []),
    ...flight.problems.map((text) => el("p", { class: "note", text })),
    el("div", { class: "columns" },
      el("div", { class: "left" }, replay?.panel ?? el("p", { class: "nothing", role: "note" }, el("b", { text: "This flight left no trace." }), entry.reason ? ` ${entry.reason}` : "")),
      el("div", { class: "right" },
        section("criteria", "Criteria", criteriaTable(flight.result.criteria, flown ? flight : null, flown ? clock : null)),
        flight.result.faults.length > 0 ? section("faults", "Faults", faultList(flight, clock)) : null,
        figures.length > 0 ? section("figures", "Figures", secondChooser(run, index, other?.name ?? null, on.again), el("p", { class: "hint", text: `Time in s. Bands: a fault is active. Ticks above: it acted. Ticks below: a frame did not go on as sent. Red line: first violation.${flight.why ? " Dotted line: point of no return." : ""} Drag to zoom, double-click for all.` }), figures) : null,
        histograms.length > 0 ? section("timing", "Timing", histograms) : null,
        extras?.body ?? null)),
    ...(flown ? [framesSection(flight, clock, programOf(entry))] : []),
    metricsTable(flight.result.metrics),
    flight.events.length > 0 ? el("details", {}, el("summary", { text: `Events (${flight.events.length})` }), el("ol", { class: "events" }, flight.events.map((e) =>
      el("li", {}, el("button", { type: "button", class: "time", text: seconds(e.time_s), onclick: () => clock.set(e.time_s) }), " ", el("b", { text: [e.client, e.kind.replaceAll("_", " ")].filter(Boolean).join(" ") }), ` ${e.text}`)))) : "",
    flight.firmware_log ? el("details", {}, el("summary", { text: "What the firmware logged" }), el("pre", { tabindex: "0", text: flight.firmware_log })) : "",
    el("details", {}, el("summary", { text: "The scenario, with all defaults" }), el("pre", { tabindex: "0", text: flight.resolved })));
  const printed = isPrinting();
  if (printed) main.querySelectorAll("details").forEach((details) => (details.open = true));
  replay?.start();
  extras?.draw();
  clock.set(state.time_s);
  // A printed page has all plots, over the whole flight.
  if (printed) plots.drawAll();
  else plots.zoom(state.range);
  let stopped_s = clock.time_s;
  clock.listen(() => {
    state.time_s = clock.time_s;
    if (clock.playing || stopped_s === clock.time_s) return;
    stopped_s = clock.time_s;
    on.moved(stopped_s);
  });
  const forget = keys(flight, clock);
  return {
    clock,
    close: () => {
      forget();
      if (!printed) state.range = plots.range;
      extras?.close();
      clock.close();
      plots.close();
      replay?.close();
    },
  };
}
