// The figures of a flight, from the names of its columns: for any number of rotors and hinges.
import { el, number, svg } from "./dom.js";

const end = (name, suffix) => name.endsWith(suffix);

// SupervisorState of firmware/supervisor.h.
export const STATES = ["run", "init", "hold", "degraded", "fail-safe", "last resort"];

// True for the builds that ship; a firmware of others counts its states as it likes. `clients`: the firmware, by id.
const hasNames = (column, clients) => ["host", "qemu"].includes(clients[column.slice("supervisor_state_".length)] ?? clients[""]);

export function figuresOf(flight, clients) {
  const has = (name) => flight.has(name);
  const line = (name, label, more = {}) => ({ name, label, ...more });
  const shown = new Set();
  const figures = [];
  const add = (id, title, unit, lines, more = {}) => {
    lines = lines.filter((l) => has(l.name));
    if (lines.length === 0) return;
    lines.forEach((l) => shown.add(l.name));
    const names = lines.map((l) => l.name);
    figures.push({ id, title, unit, lines, bounds: flight.bounds.filter((b) => names.includes(b.signal)), ...more });
  };
  const paired = (names, reference) => names.flatMap((name, i) => [line(name, name.replace(/_(m|rad)$/, ""), { colour: i }), line(reference(name), `${name.replace(/_(m|rad)$/, "")} reference`, { colour: i, dash: true })]);

  add("error", "Position error", "m", [line("position_error_m", "position error"), line("cross_track_error_m", "distance to the path", { colour: 2 })], { zero: true });
  const curves = flight.robustness ?? [];
  const robustness = (id, title, reading, note) => add(id, title, "", curves.flatMap(({ criterion, reading: own, looks_ahead }, i) => {
    if (own !== reading) return [];
    const label = criterion + (looks_ahead && own !== "from_here" ? " (looks ahead)" : "");
    return [line(`robustness_upper/${criterion}`, label, { colour: i }), line(`robustness_lower/${criterion}`, `${label}, if the worst follows`, { colour: i, dash: true })];
  }).filter((l) => has(l.name) && Number.isFinite(spread(flight, l.name))), { zero: true, note, scale: "robustness" });
  robustness("robustness", "Robustness of each criterion", "lowest", "its lowest value is the margin; below 0: violated");
  robustness("robustness-once", "Robustness of what must happen once", "highest", "its highest value is the margin; 0 and above: it happens");
  robustness("robustness-from-here", "Robustness of criteria, as if the flight began here", "from_here", "the margin is the value at 0 s");
  if (flight.why) add("why", "Chance of failing, if all faults end at this time", "", [line("why/probability", "chance"), line("why/high", "chance at most (95 %)", { colour: 2, dash: true }), line("why/low", "chance at least (95 %)", { colour: 2, dash: true })], { zero: true, scale: "chance", note: whyNote(flight.why) });
  add("position", "Position", "m", paired(["x_m", "y_m", "z_m"], (n) => n.replace("_m", "_ref_m")));
  add("attitude", "Roll, pitch, yaw", "rad", [line("roll_rad", "roll", { turns: true }), line("pitch_rad", "pitch", { turns: true }), line("yaw_rad", "yaw", { turns: true }), line("yaw_ref_rad", "yaw reference", { dash: true, colour: 2, turns: true })]);
  add("servos", "Servo angles", "rad", flight.states.filter((n) => n.startsWith("alpha_") && end(n, "_rad")).map((n) => line(n, n.slice(0, -4))));
  const inputs = (suffix) => flight.inputs.filter((n) => end(n, suffix)).map((n) => line(n, n.slice(0, -suffix.length)));
  add("thrusts", "Control inputs: thrusts", "N", inputs("_n"));
  add("torques", "Control inputs: torques of the servos", "N m", inputs("_nm"));
  add("velocity", "Velocity", "m/s", ["vx_m_s", "vy_m_s", "vz_m_s", "speed_m_s"].map((n) => line(n, n.replace("_m_s", ""))));
  const columns = flight.columns.filter((name) => /^supervisor_state(_|$)/.test(name));
  const whole = { step: true, whole: true };
  const named = columns.filter((name) => hasNames(name, clients));
  add("supervisor", "State of the firmware", "", named.map((name) => line(name, name, whole)), { names: STATES, scale: "state" });
  add("supervisor-number", "State of the firmware, in its own numbering", "", columns.filter((name) => !named.includes(name)).map((name) => line(name, name, whole)), { scale: "state" });
  add("arbiter", "Client whose actuators are in force", "", [line("arbiter_selected", "arbiter_selected", whole)], { scale: "client" });
  add("ground", "On the ground", "", [line("on_ground", "on the ground", whole)], { names: ["in the air", "on the ground"], scale: "ground" });
  // A bound on a signal that is in none of these.
  for (const name of new Set(flight.bounds.map((b) => b.signal))) if (!shown.has(name)) add(`bound-${name}`, name, flight.entries?.get(name)?.unit ?? "", [line(name, name)]);
  if (flight.scenario.faults.length > 0) add("active", "Faults active", "", [line("faults_active_count", "faults", whole)], { scale: "faults" });
  return figures;
}

// In one line: when the flight was lost, and by which faults.
function whyNote({ criterion, point_of_no_return_s, needed, sets }) {
  const when = point_of_no_return_s === null ? "it could be saved until the end" : `point of no return at ${number(point_of_no_return_s, 6)} s`;
  const faults = needed.length > 0 ? `needed: ${needed.join(", ")}` : sets.length === 1 && sets[0].length === 0 ? "it fails without any fault" : `each of these suffices: ${sets.map((set) => set.join(" with ")).join("; ")}`;
  return `${criterion}: ${when}; ${faults}`;
}

// NaN when a series has no finite value.
function spread(flight, name) {
  const { values } = flight.points(name);
  return values.some(Number.isFinite) ? 1 : NaN;
}

// The paper's Figure 14.
export function histogram(name, { edges, counts }) {
  const total = counts.reduce((a, b) => a + b, 0);
  if (total === 0 || edges.length < 2) return null;
  // A narrow page draws a narrow figure, so that its letters keep their size.
  const width = innerWidth < 700 ? 340 : 640, height = 200, left = 60, bottom = 40, top = 10;
  const step = edges[1] - edges[0];
  const low = edges[0] - step, high = edges[edges.length - 1] + step;
  const x = (v) => left + ((v - low) / (high - low)) * (width - left - 10);
  const most = Math.max(...counts);
  // Logarithmic, or a single late request would not be seen.
  const y = (n) => height - bottom - (Math.log10(n + 1) / Math.log10(most + 1)) * (height - bottom - top);
  const bars = counts.map((n, i) => {
    const from = i === 0 ? low : edges[i - 1];
    const to = i === counts.length - 1 ? high : edges[i];
    const bar = svg("rect", { x: x(from) + 0.5, y: y(n), width: Math.max(x(to) - x(from) - 1, 1), height: height - bottom - y(n), class: i === 0 || i === counts.length - 1 ? "bar beyond" : "bar" });
    const where = i === 0 ? `below ${edges[0].toFixed(2)} ms` : i === counts.length - 1 ? `${edges[i - 1].toFixed(2)} ms and more` : `${from.toFixed(2)} to ${to.toFixed(2)} ms`;
    bar.append(svg("title"));
    bar.lastChild.textContent = `${where}: ${n}`;
    return bar;
  });
  const labels = [];
  for (let power = 1; power <= most * 1.0001; power *= 10) {
    labels.push(svg("line", { x1: left, x2: width - 10, y1: y(power), y2: y(power), class: "gridline" }));
    const text = svg("text", { x: left - 6, y: y(power) + 4, "text-anchor": "end" });
    text.textContent = power;
    labels.push(text);
  }
  const every = Math.ceil(edges.length / (width < 640 ? 4 : 8));
  edges.forEach((edge, i) => {
    if (i % every !== 0) return;
    const text = svg("text", { x: x(edge), y: height - 24, "text-anchor": "middle" });
    text.textContent = +edge.toFixed(2);
    labels.push(text);
  });
  labels.push(svg("text", { x: (left + width) / 2, y: height - 6, "text-anchor": "middle" }, document.createTextNode("ms")));
  labels.push(svg("text", { transform: `translate(12 ${(height - bottom + top) / 2}) rotate(-90)`, "text-anchor": "middle" }, document.createTextNode("count")));
  const title = name.includes("request_period") ? "Request periods" : "Latencies of replies";
  const id = name.replace(/[^a-z0-9_.-]/gi, "_");
  return el("figure", { class: "figure histogram", id: `histogram-${id}` }, el("figcaption", {}, el("h3", { text: `${title} [ms]` }), el("span", { class: "hint", text: `${total} ${name.includes(".") ? `(${name}) ` : ""}counts, logarithmic; outer bars: everything beyond` })),
    svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `Histogram of ${title.toLowerCase()}: ${total} values, most of them ${edges[Math.max(counts.indexOf(most) - 1, 0)].toFixed(2)} ms` }, labels, bars));
}
