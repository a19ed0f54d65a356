// A run while it is flown: the flight that flies now, as far as it has come, from the server's events.
import { Clock } from "./clock.js";
import { Flight } from "./data.js";
import { badge, el, seconds } from "./dom.js";
import { extrasSection } from "./extras.js";
import { figuresOf } from "./figures.js";
import { clientsOf, keys, replayPanel } from "./flight.js";
import { Plots } from "./plots.js";
import { section } from "./section.js";
import { faultColour } from "./theme.js";

// Beyond so many rows, every second one is dropped.
const ROWS_MAX = 6000;
const REFRESH_ms = 200;

class LiveFlight extends Flight {
  constructor(head) {
    const result = { criteria: [], faults: [], metrics: {}, histograms: {} };
    super({ ...head, result, bands: [], ticks: [], line_errors: [], events: [], series: [], times: { count: 0, first_ns: 0, at: 0 } }, new Uint8Array(0), []);
    this.id = head.flight;
    this.times_s = [];
    this.values = new Map();
    for (const name of this.row.slice(1)) {
      this.values.set(name, []);
      this.entries.set(name, { name, low: Infinity, high: -Infinity });
    }
    this.open = new Map(); // bands of faults that are active now
    this.injected = new Map(); // [begin, end) of faults that the user injected, which have no column
  }

  // Where a value has come: not every client tells the state of its supervisor.
  has(name) {
    const entry = this.entries.get(name);
    return entry !== undefined && entry.low <= entry.high;
  }

  get names_count() {
    return this.row.filter((name) => this.has(name)).length;
  }

  add(rows) {
    for (const row of rows) {
      this.times_s.push(row[0]);
      this.row.forEach((name, i) => {
        if (i === 0) return;
        const value = row[i] ?? NaN;
        this.values.get(name).push(value);
        const entry = this.entries.get(name);
        if (value < entry.low) entry.low = value;
        if (value > entry.high) entry.high = value;
      });
      this.scenario.faults.forEach((fault, i) => this.addBand(i, row[0], row[this.row.indexOf(`active_${fault.id}`)] === 1 || this.isInjected(i, row[0])));
    }
    if (this.times_s.length > ROWS_MAX) this.thin();
    this.indices = null;
  }

  isInjected(fault, time_s) {
    const { begin_s, end_s } = this.injected.get(fault) ?? { begin_s: Infinity, end_s: Infinity };
    return begin_s <= time_s && time_s < end_s;
  }

  inject({ fault, begin_s, end_s }) {
    const place = this.scenario.faults.push(fault) - 1;
    this.injected.set(place, { begin_s, end_s });
    // Rows may have come before the word of it.
    this.times_s.forEach((time_s) => this.isInjected(place, time_s) && this.addBand(place, time_s, true));
  }

  addBand(fault, time_s, active) {
    const band = this.open.get(fault);
    if (band) band.end_s = time_s;
    if (band && !active) this.open.delete(fault);
    if (!active || band) return;
    const begun = { fault, begin_s: time_s, end_s: time_s };
    this.open.set(fault, begun);
    this.bands.push(begun);
  }

  thin() {
    const half = (list) => list.filter((_, i) => i % 2 === 0);
    this.times_s = half(this.times_s);
    for (const [name, list] of this.values) this.values.set(name, half(list));
  }

  points(name) {
    this.indices ??= Uint32Array.from(this.times_s, (_, i) => i);
    return { rows: this.indices, values: this.values.get(name) };
  }
}

// The server's events, and the buttons that were pressed.
export class LiveRun {
  constructor(run, on) {
    this.run = run;
    this.on = on;
    this.flight = null;
    this.over = false;
    this.notes = [];
    this.told = 0; // lines of the table
    this.status = { phase: run.live.waits ? "waiting" : "flying", text: "" };
    const match = /^#token=([0-9a-f]+)$/.exec(location.hash);
    // Out of the address, where others might read it; a reload keeps it.
    if (match) sessionStorage.setItem("tiltproof-token", match[1]);
    this.token = sessionStorage.getItem("tiltproof-token") ?? "";
    let known = run.flights.length;
    const source = new EventSource("events");
    this.source = source;
    const hear = (name, listener) => source.addEventListener(name, (event) => listener(JSON.parse(event.data)));
    // After an interruption the server tells everything again.
    source.addEventListener("open", () => {
      this.told = 0;
      this.connected = true;
      on.status();
    });
    source.addEventListener("error", () => {
      this.connected = false;
      on.status();
    });
    hear("flight", (head) => {
      this.flight = new LiveFlight(head);
      this.over = false;
      this.notes = [];
      on.flight();
    });
    hear("rows", ({ flight, rows }) => {
      if (this.flight?.id !== flight) return;
      this.flight.add(rows);
      on.rows();
    });
    hear("injected", (injected) => {
      if (this.flight?.id !== injected.flight) return;
      this.flight.inject(injected);
      on.flight();
    });
    hear("over", ({ flight }) => {
      if (this.flight?.id === flight) this.over = true;
      on.status();
    });
    hear("note", (note) => {
      this.notes.push(note);
      on.status();
    });
    hear("status", (status) => {
      this.status = status;
      if (status.phase === "ended") source.close();
      on.status();
    });
    hear("finished", (entry) => {
      // The page came with the first ones.
      if (++this.told <= known) return;
      known = this.told;
      run.flights.push(entry);
      on.finished();
    });
  }

  // The line of the flight that is shown, once it is over.
  get entryIndex() {
    return this.over ? this.run.flights.findLastIndex((entry) => entry.name === this.flight.name) : -1;
  }

  async press(button, body = "") {
    try {
      const response = await fetch(button, { method: "POST", headers: { "X-Tiltproof-Token": this.token }, body });
      return { ok: response.ok, text: (await response.text()).trim() };
    } catch {
      return { ok: false, text: "The run does not answer." };
    }
  }
}

const EXAMPLE = "{type: frame.delay, target: to_client, duration_s: 2, parameters: {mean_ms: 12}}";

function say(element, said) {
  if (!element || !said) return;
  element.className = said.ok ? "said" : "said refused";
  element.textContent = said.words;
}

function controls(live) {
  if (!live.run.live.buttons) return null;
  if (!live.token) return el("p", { class: "note", text: "To look only: the buttons need the address that tiltproof run printed, with its token." });
  const said = el("output", { class: "said", "aria-live": "polite" });
  const press = async (button, body) => {
    const { ok, text } = await live.press(button, body);
    let words = ok ? "" : text;
    if (ok && button === "inject") {
      const { id, begin_s } = JSON.parse(text);
      words = `${id} acts from ${seconds(begin_s)} on.`;
    }
    live.said = { ok, words };
    // The view may be another by now.
    say(document.querySelector(".controls .said"), live.said);
  };
  say(said, live.said);
  const fault = el("textarea", { rows: 2, spellcheck: "false", "aria-label": "Fault to inject, as in a scenario" });
  fault.value = live.faultText ?? EXAMPLE;
  fault.addEventListener("input", () => (live.faultText = fault.value));
  const abort = el("button", { type: "button", class: "abort", text: "Abort the run", onclick: () => {
    if (abort.dataset.asked) return press("abort");
    abort.dataset.asked = "1";
    abort.textContent = "Abort: sure?";
    setTimeout(() => {
      delete abort.dataset.asked;
      abort.textContent = "Abort the run";
    }, 4000);
  } });
  return el("div", { class: "controls" },
    live.status.phase === "waiting" ? el("button", { type: "button", class: "start", text: "Start", onclick: () => press("start") }) : null,
    fault, el("button", { type: "button", class: "inject", text: "Inject now", onclick: () => press("inject", fault.value) }), abort, said);
}

// Returns what to call when it is left; `again` shows it once more.
export function showLive(main, live, again) {
  const { flight, run } = live;
  const head = el("h1", {}, flight ? flight.name : "Live", " ");
  const state = el("span", { class: "badge flying" });
  head.append(state);
  const bar = el("progress", { max: flight?.scenario.duration_s ?? 1, value: 0, "aria-label": "Flown time" });
  const words = el("span", { class: "words" });
  const newest = el("button", { type: "button", class: "newest", text: "Follow the newest", onclick: () => follow(true) });
  const over = el("p", { class: "reason" });
  const notes = el("ol", { class: "events" });
  const buttons = controls(live);
  const top = [el("nav", { "aria-label": "Flights" }, el("a", { href: "#all", text: "All flights" })), head, over, el("div", { class: "live" }, bar, words, newest), buttons].filter(Boolean);
  let following = true;
  let clock = null;
  const follow = (on) => {
    following = on;
    newest.hidden = on || !clock;
    if (on && clock) clock.set(clock.end_s);
  };
  const tell = () => {
    const entry = run.flights[live.entryIndex];
    const ended = live.status.phase === "ended";
    const lost = !live.connected && !ended;
    state.replaceChildren(entry ? badge(entry.verdict, entry.expected) : live.over || ended ? "over" : live.status.phase === "waiting" ? "waits" : "flying");
    state.className = entry ? "" : "badge flying";
    // The server has gone with the run: then the report has it.
    const whole = ended ? (run.live.folder ? `Report: ${run.live.folder}/report.html` : "") : el("a", { href: `#flight-${live.entryIndex}`, text: "The whole flight" });
    over.replaceChildren(...(entry ? [entry.reason ?? "", " ", whole] : []));
    if (buttons) buttons.hidden = ended;
    const done = `${run.flights.length}${run.live.flights_count ? ` of ${run.live.flights_count}` : ""} flight${run.flights.length === 1 ? "" : "s"} flown`;
    const flown = flight ? `${seconds(flight.end_s)} of ${flight.scenario.duration_s} s` : "";
    words.textContent = [flown, done, live.status.text, lost ? "The connection is lost." : ""].filter(Boolean).join(" · ");
    bar.value = flight?.end_s ?? 0;
    notes.replaceChildren(...live.notes.map((note) => el("li", {}, `${seconds(note.time_s)} `, el("b", { text: note.kind.replaceAll("_", " ") }), ` ${note.text}`)));
  };
  if (!flight || flight.times_s.length === 0) {
    newest.hidden = true;
    main.replaceChildren(...top, el("p", { class: "note", text: live.status.phase === "ended" ? "Nothing more comes." : "The flight has not begun, or its parts fly in other processes: then only its verdict comes." }));
    tell();
    return { rows: () => flight?.times_s.length > 0 && again(), status: tell, close: () => {} };
  }
  clock = new Clock(flight.end_s);
  const plots = new Plots(flight, clock);
  const figures = figuresOf(flight, clientsOf(run.runs?.[0])).map((spec) => plots.add(spec));
  const names = flight.names_count;
  live.plots ??= { plots: [], xy: [] };  // those that the reader added
  const extras = extrasSection(flight, clock, plots, live.plots);
  const replay = replayPanel(flight, clock);
  const scrub = replay.panel.querySelector("input[type=range]");
  const faults = el("ul", { class: "fault-list" });
  const ended = () => live.over || live.status.phase === "ended";
  const tellFaults = () => faults.replaceChildren(...flight.scenario.faults.map((fault, i) => {
    const swatch = el("span", { class: "block" });
    swatch.style.background = faultColour(i);
    const bands = flight.bands.filter((band) => band.fault === i).length;
    return el("li", {}, swatch, el("b", { text: fault.id }), ` ${fault.type}, ${!flight.open.has(i) ? (bands > 0 ? "over" : ended() ? "was not active" : "not yet") : ended() ? "active to the end" : "active now"}`);
  }));
  tellFaults();
  main.replaceChildren(...top,
    ...(flight.scenario.description ? [el("p", { class: "description", text: flight.scenario.description })] : []),
    el("div", { class: "columns" },
      el("div", { class: "left" }, replay.panel),
      el("div", { class: "right" },
        section("criteria", "Criteria", el("ul", { class: "criteria-list" }, flight.scenario.criteria.map((c) => el("li", {}, el("b", { text: c.name }), " ", el("code", { text: c.stl || c.metric }))))),
        flight.scenario.faults.length > 0 ? section("faults", "Faults", faults) : null,
        section("figures", "Figures", el("p", { class: "hint", text: "Time in s, some 20 samples a second. Bands: a fault is active. The verdict, peaks and frames come with the whole flight." }), figures),
        extras.body)),
    el("details", {}, el("summary", { text: "Events" }), notes));
  extras.draw();
  replay.start();
  clock.listen(() => {
    if (following && !grows && clock.time_s < clock.end_s - 1e-9) follow(false);
  });
  let grows = false;
  let dirty = true;
  let wide = 0;
  const refresh = () => {
    if (!dirty || document.hidden) return;
    dirty = false;
    // A signal that appears for the first time has a figure now.
    if (flight.names_count !== names) return again();
    grows = true;
    clock.end_s = flight.end_s;
    scrub.max = flight.end_s;
    plots.grow();
    extras.grow();
    // A long path is drawn less often.
    if (flight.times_s.length < 500 || ++wide % 5 === 0 || live.over) replay.grow();
    if (following) clock.set(clock.end_s);
    grows = false;
    tellFaults();
    tell();
  };
  const timer = setInterval(refresh, REFRESH_ms);
  const forget = keys(flight, clock);
  follow(true);
  refresh();
  return {
    rows: () => (dirty = true),
    status: () => { tell(); dirty = true; },
    close: () => {
      clearInterval(timer);
      forget();
      extras.close();
      clock.close();
      plots.close();
      replay.close();
    },
  };
}
