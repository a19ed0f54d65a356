// One flight: what was decided and why, the replay, the figures, the frames.
import { Clock } from "./clock.js";
import { Flight } from "./data.js";
import { badge, copyable, el, number, seconds } from "./dom.js";
import { figuresOf, histogram } from "./figures.js";
import { framesSection } from "./frames.js";
import { Plots } from "./plots.js";
import { Replay } from "./replay.js";
import { faultColour } from "./theme.js";

// Where the reader was, when the same flight is shown again in other colours.
let last = { index: -1, time_s: 0 };
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

export const section = (id, title, ...children) => el("section", { id, "aria-labelledby": `${id}-h` }, el("h2", { id: `${id}-h`, text: title }), children);

function criteriaTable(criteria, clock) {
  const row = (c) => el("tr", {},
    el("th", { scope: "row", text: c.name }), el("td", {}, badge(c.verdict, c.verdict === "inconclusive" ? null : "pass")),
    el("td", { class: `n ${c.margin < 0 ? "below" : ""}`, text: number(c.margin) }),
    el("td", { class: "n" }, c.time_s === null || c.time_s === undefined ? "" : clock ? el("button", { type: "button", class: "time", text: seconds(c.time_s), onclick: () => clock.set(c.time_s) }) : seconds(c.time_s)),
    el("td", { class: "why", text: c.explanation }));
  const order = { error: 0, fail: 1, inconclusive: 2, pass: 3 };
  return el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ["Criterion", "Verdict", "Margin", "Decided at", "Because"].map((text) => el("th", { scope: "col", text })))),
    el("tbody", {}, [...criteria].sort((a, b) => order[a.verdict] - order[b.verdict]).map(row))));
}

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
    if (bands.length > 1) words.push(`active ${bands.length} times`);
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

// Any column beside those that have a figure.
export function chooser(flight, plots) {
  const box = el("div");
  let figure = null;
  const select = el("select", { onchange: () => {
    if (figure) plots.remove(figure);
    box.replaceChildren();
    const name = select.value;
    if (!name) return;
    const base = name.replace(/^(sensed|commanded)_/, "");
    const lines = [{ name, label: name }];
    if (base !== name && flight.has(base)) lines.push({ name: base, label: base, dash: true });
    const spec = { id: "chosen", title: name, unit: flight.entries.get(name).unit, lines, bounds: flight.bounds.filter((b) => b.signal === name) };
    box.append(plots.add(spec));
    figure = plots.plots[plots.plots.length - 1];
  } }, el("option", { value: "", text: "choose a signal" }), [...flight.columns, "speed_m_s", "tilt_rad"].map((name) => el("option", { value: name, text: name })));
  return section("more", "Any other signal", el("label", {}, "Signal ", select), box);
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

function withoutFiles(main, run, entry) {
  const result = entry.result ?? {};
  main.replaceChildren(...head(run, entry, result),
    el("p", { class: "note", text: entry.problem ?? "This flight left no files (--keep), so there are no figures: this is what results.json has." }),
    section("criteria", "Criteria", criteriaTable(result.criteria ?? [], null)),
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
    reset.addEventListener("click", () => { follow.checked = replay.follow = false; replay.look(); });
  };
  return { panel, start, grow: () => replay?.grow(), close: () => replay?.close() };
}

// The firmware that flew, by client's id; "": the firmware of clients that are not named.
export const clientsOf = (info) => ({ "": info?.client, ...info?.clients });

// As in the command that flies it again.
const programOf = (entry) => /^(.+?) (replay|run) /.exec(entry.replay ?? "")?.[1] ?? "tiltproof";

// Returns what to call when it is left.
export async function showFlight(main, run, index, stillWanted) {
  const entry = run.flights[index];
  if (!entry.details) return withoutFiles(main, run, entry);
  let flight;
  try {
    flight = await Flight.load(entry.details);
  } catch (error) {
    if (stillWanted()) main.replaceChildren(...head(run, entry, {}), el("p", { class: "note", text: `The data of this flight cannot be read: ${error.message}` }));
    return () => {};
  }
  if (!stillWanted()) return () => {};
  const clock = new Clock(flight.end_s);
  const plots = new Plots(flight, clock);
  const flown = flight.times_s.length > 0;
  const figures = flown ? figuresOf(flight, clientsOf(run.runs[entry.run])).map((spec) => plots.add(spec)) : [];
  const histograms = Object.entries(flight.result.histograms ?? {}).sort().reverse().map(([name, h]) => histogram(name, h)).filter(Boolean);
  const replay = flown ? replayPanel(flight, clock) : null;
  const scenario = flight.scenario;
  main.replaceChildren(...head(run, entry, flight.result),
    ...(scenario.description ? [el("p", { class: "description", text: scenario.description })] : []),
    ...flight.problems.map((text) => el("p", { class: "note", text })),
    el("div", { class: "columns" },
      el("div", { class: "left" }, replay?.panel ?? el("p", { class: "nothing", role: "note" }, el("b", { text: "This flight left no trace." }), entry.reason ? ` ${entry.reason}` : "")),
      el("div", { class: "right" },
        section("criteria", "Criteria", criteriaTable(flight.result.criteria, flown ? clock : null)),
        flight.result.faults.length > 0 ? section("faults", "Faults", faultList(flight, clock)) : null,
        figures.length > 0 ? section("figures", "Figures", el("p", { class: "hint", text: "Time in s. Bands: a fault is active. Ticks above: it acted. Ticks below: a frame did not go on as sent. Red line: first violation. Drag to zoom, double-click for all." }), figures) : null,
        histograms.length > 0 ? section("timing", "Timing", histograms) : null,
        flown ? chooser(flight, plots) : null)),
    ...(flown ? [framesSection(flight, clock, programOf(entry))] : []),
    metricsTable(flight.result.metrics),
    flight.events.length > 0 ? el("details", {}, el("summary", { text: `Events (${flight.events.length})` }), el("ol", { class: "events" }, flight.events.map((e) =>
      el("li", {}, el("button", { type: "button", class: "time", text: seconds(e.time_s), onclick: () => clock.set(e.time_s) }), " ", el("b", { text: [e.client, e.kind.replaceAll("_", " ")].filter(Boolean).join(" ") }), ` ${e.text}`)))) : "",
    flight.firmware_log ? el("details", {}, el("summary", { text: "What the firmware logged" }), el("pre", { tabindex: "0", text: flight.firmware_log })) : "",
    el("details", {}, el("summary", { text: "The scenario, with all defaults" }), el("pre", { tabindex: "0", text: flight.resolved })));
  replay?.start();
  clock.set(last.index === index ? last.time_s : 0);
  const forget = keys(flight, clock);
  return () => {
    forget();
    last = { index, time_s: clock.time_s };
    clock.close();
    plots.close();
    replay?.close();
  };
}
