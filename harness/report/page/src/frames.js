// The frames on the lines around the clock's time: as sent, and as they went on, with damaged bytes marked; and the row
// of the trace there, exactly.
import { copyable, el, number } from "./dom.js";
import { lastAtOrBefore } from "./data.js";

const AROUND_S = 0.03;
const SHOWN_MAX = 24;
const DIFF_MAX = 400;

const bytesOf = (hex) => hex.match(/../g) ?? [];

// Marks bytes of b that are not those of a: by place when the lengths are equal, else outside the longest common subsequence.
export function damaged(a, b) {
  if (a.length === b.length) return b.map((byte, i) => byte !== a[i]);
  if (a.length > DIFF_MAX || b.length > DIFF_MAX) return b.map(() => true);
  const length = Array.from({ length: a.length + 1 }, () => new Uint16Array(b.length + 1));
  for (let i = a.length - 1; i >= 0; --i)
    for (let j = b.length - 1; j >= 0; --j)
      length[i][j] = a[i] === b[j] ? length[i + 1][j + 1] + 1 : Math.max(length[i + 1][j], length[i][j + 1]);
  const marks = new Array(b.length).fill(true);
  for (let i = 0, j = 0; i < a.length && j < b.length; ) {
    if (a[i] === b[j]) (marks[j] = false), ++i, ++j;
    else if (length[i + 1][j] >= length[i][j + 1]) ++i;
    else ++j;
  }
  return marks;
}

// Bytes in runs: damaged ones are marked, and the others say what they are, except payload.
function hexView(bytes, marks, roles) {
  const code = el("code", { class: "hex" });
  let run = "";
  let kind = "";
  const flush = () => {
    const text = run.trim();
    if (text && kind === "damaged") code.append(el("mark", { text, title: kind }), " ");
    else if (text && kind && kind !== "payload") code.append(el("i", { class: kind, text, title: kind }), " ");
    else if (text) code.append(`${text} `);
    run = "";
  };
  bytes.forEach((byte, i) => {
    const now = marks?.[i] ? "damaged" : roles?.[i] ?? "";
    if (now !== kind) {
      flush();
      kind = now;
    }
    run += `${byte} `;
  });
  flush();
  return code;
}

const rolesOf = (flight, frame) => [...(frame.roles ?? "")].map((digit) => flight.framing.roles[digit]);

// Readers of numbers as protocol files name their types, and the digits that are shown.
const READERS = { u8: "getUint8", i8: "getInt8", u16: "getUint16", i16: "getInt16", u32: "getUint32", i32: "getInt32", f32: "getFloat32", f64: "getFloat64" };
const DIGITS = { f32: 5, f64: 7, u32: 10, i32: 10 };

function fields(flight, message, payload) {
  const type = flight.messages.find((m) => m.name === message);
  if (!type || type.fields.length === 0) return null;
  const bytes = Uint8Array.from(bytesOf(payload), (byte) => parseInt(byte, 16));
  const view = new DataView(bytes.buffer);
  if (type.bytes > bytes.length) return null;
  return el("div", { class: "fields" }, type.fields.map((field) => {
    const value = field.scale * view[READERS[field.type]](field.offset, field.order === "little");
    const how = [`${field.type} at byte ${field.offset}`, /8$/.test(field.type) ? "" : `${field.order} endian`, field.scale === 1 ? "" : `times ${field.scale}`];
    return el("span", { title: how.filter(Boolean).join(", ") }, el("i", { text: field.signal }), ` ${number(value, DIGITS[field.type] ?? 6)}${field.as && ` (${field.as})`}`);
  }));
}

function frameView(flight, frame) {
  const sent = frame.sent ? bytesOf(frame.sent) : null;
  const got = frame.delivered ? bytesOf(frame.delivered.bytes) : null;
  const marks = sent && got ? damaged(sent, got) : got?.map(() => true);
  const late_ms = frame.delivered ? (frame.delivered.time_ns - frame.time_ns) / 1e6 : 0;
  const parts = [el("div", { class: "frame-head" },
    el("span", { class: "time", text: `${(frame.time_ns / 1e9).toFixed(6)} s` }),
    el("span", { class: "wire", text: [frame.client, frame.direction.replace("_", " ")].filter(Boolean).join(" ") }),
    el("b", { text: frame.message ?? frame.delivered?.message ?? "" }),
    el("span", { class: `fate ${frame.fate}`, text: frame.fate === "late" && late_ms > 0 ? `late by ${number(late_ms)} ms` : frame.fate }),
    frame.delivered?.status ? el("span", { class: "status", text: `receiver: ${frame.delivered.status.replaceAll("_", " ")}` }) : null)];
  if (sent) parts.push(el("div", { class: "line" }, got ? el("span", { class: "side", text: "sent" }) : null, hexView(sent, null, rolesOf(flight, frame))));
  if (got) parts.push(el("div", { class: "line" }, el("span", { class: "side", text: "went on" }), hexView(got, frame.fate === "damaged" || frame.fate === "extra" ? marks : null)));
  const meaning = frame.payload ? fields(flight, frame.message, frame.payload) : null;
  if (meaning) parts.push(meaning);
  if (frame.delivered?.payload && frame.delivered.payload !== frame.payload) {
    const other = fields(flight, frame.delivered.message, frame.delivered.payload);
    if (other) parts.push(el("div", { class: "line" }, el("span", { class: "side", text: "accepted as" }), other));
  }
  return el("li", { class: `frame ${frame.fate}` }, parts);
}

export function framesSection(flight, clock, program) {
  const list = el("ol", { class: "frames", tabindex: "0", "aria-label": "Frames" });
  const told = el("p", { class: "told" });
  const table = el("table", { class: "row" });
  const errors = el("div", { class: "moments" });
  const fates = new Map();
  for (const [time_s, , direction, fate] of flight.line_errors) {
    const key = `${fate}, ${direction.replace("_", " ")}`;
    if (!fates.has(key)) fates.set(key, { count: 0, times: [] });
    const entry = fates.get(key);
    ++entry.count;
    entry.times.push(time_s);
  }
  for (const [key, { count, times }] of fates)
    errors.append(el("button", { type: "button", text: `${count} ${key}: next`, onclick: () => clock.set(times.find((t) => t > clock.time_s + 1e-6) ?? times[0]) }));
  if (flight.line_error_count > flight.line_errors.length) errors.append(el("span", { class: "hint", text: `${flight.line_error_count} frames in all did not go on as sent; the first ${flight.line_errors.length} are here` }));
  const { name, check } = flight.framing;
  const about = el("p", { class: "hint framing", text: `Framing ${name}${check && `, check ${check}`}. Bytes that are not payload are slanted; the pointer shows what they are, and how a field is sent.` });
  const dump = el("div", { class: "again dump" }, el("span", { text: "All frames: " }), copyable(`${program} link-dump ${flight.folder}/link.bin`, "the command that prints all frames"));

  let drawn = null;
  const fill = () => {
    const t = clock.time_s;
    if (drawn === t) return;
    drawn = t;
    const near = [flight.closeUpAt(t - AROUND_S), flight.closeUpAt(t), flight.closeUpAt(t + AROUND_S)].filter((c, i, all) => c && all.indexOf(c) === i);
    const frames = near.flatMap((c) => c.json.frames).filter((f) => Math.abs(f.time_ns / 1e9 - t) <= AROUND_S);
    if (near.length === 0) {
      const around = flight.closeUps.map((c) => (c.begin_s + c.end_s) / 2).sort((a, b) => Math.abs(a - t) - Math.abs(b - t))[0];
      told.replaceChildren(`No frames are kept here for ${t.toFixed(3)} s. `);
      if (around !== undefined) told.append(el("button", { type: "button", text: `Nearest close-up: ${around.toFixed(2)} s`, onclick: () => clock.set(around) }));
      list.replaceChildren();
    } else {
      told.replaceChildren(`${frames.length} frames within ${AROUND_S * 1000} ms of ${t.toFixed(3)} s.`);
      const shown = frames.slice(0, SHOWN_MAX);
      list.replaceChildren(...shown.map((f) => frameView(flight, f)));
      // To what is at the cursor, with a little of what was before it.
      const at = shown.findIndex((f) => f.time_ns / 1e9 >= t - 0.001);
      if (at > 0) list.scrollTop = list.children[at - 1].offsetTop;
    }
    fillRow(t, near.length > 0);
  };
  const fillRow = (t, exact) => {
    if (flight.times_s.length === 0) return;
    const row = Math.max(0, lastAtOrBefore(flight.times_s, t));
    const groups = new Map();
    for (const name of flight.columns) {
      const sensed = /^(sensed|commanded)_(.*)$/.exec(name);
      const base = sensed ? sensed[2] : name;
      if (!groups.has(base)) groups.set(base, {});
      groups.get(base)[sensed ? "other" : "own"] = name;
    }
    const value = (name) => el("td", { class: "n", text: name ? number(flight.atRow(name, row), exact ? 7 : 4) : "" });
    table.replaceChildren(
      el("caption", { text: `Row ${row} of the trace, t = ${flight.times_s[row].toFixed(3)} s${exact ? "" : " (between the points that this page has; the flight's trace has it exactly)"}` }),
      el("thead", {}, el("tr", {}, ["signal", "truth, or in force", "sent, or commanded"].map((text) => el("th", { scope: "col", text })))),
      el("tbody", {}, [...groups].map(([base, { own, other }]) => el("tr", {}, el("th", { scope: "row", text: base }), value(own), value(other)))));
  };
  let timer = null;
  clock.listen(() => {
    clearTimeout(timer);
    if (!clock.closed) timer = setTimeout(fill, clock.playing ? 400 : 80);
  });
  fill();
  return el("section", { id: "frames", "aria-labelledby": "frames-h" }, el("h2", { id: "frames-h", text: "On the lines at the cursor" }), errors, told, about, dump, list,
    el("details", {}, el("summary", { text: "All signals at the cursor" }), el("div", { class: "scroll" }, table)));
}
