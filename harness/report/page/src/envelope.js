// The page of an envelope: the margins of all faults, firmwares side by side, and the flights on both sides of each.
import { copyable, el, number, seconds } from "./dom.js";
import { countBoxes, header } from "./header.js";
import { listing } from "./listing.js";
import { onPrint } from "./printing.js";
import { levelText, rangeBars, repaint, severityScale, swatch } from "./range_bars.js";
import { onTheme } from "./theme.js";

const envelope = JSON.parse(document.getElementById("envelope").textContent);
const clients = envelope.clients ?? [];
const main = document.getElementById("main");
const SIGNS = { positive: "+", negative: "−" };

const placeOf = (row) => (row.target ?? row.signal ?? row.actuator ?? "") + (SIGNS[row.side] ?? "");

// A firmware's distance from the harmless level; as scenarios/envelope/tables.py has it. Where the harmless value stands for
// infinity (a limit that falls towards 0), a level's severity is its inverse.
function distance(row) {
  const level = row.fails === null ? row.severest : row.survives;
  if (level === null) return 0;
  if (row.scale === "logarithmic" && row.severest < row.mildest) return level === 0 ? Infinity : 1 / level;
  return Math.abs(level - (row.harmless ?? row.mildest));
}

function ratioOf(first, last) {
  if (!first || !last || first.error !== undefined || last.error !== undefined) return null;
  const a = distance(first), b = distance(last);
  return a === b ? 1 : a === 0 ? Infinity : b / a;
}

// One entry for each type and place.
function lines() {
  const found = new Map();
  for (const row of envelope.rows ?? []) {
    const key = JSON.stringify([row.type, placeOf(row)]);
    if (!found.has(key)) found.set(key, { type: row.type, place: placeOf(row), of: {} });
    found.get(key).of[row.client] = row;
  }
  return [...found.values()].map((line) => {
    const rows = clients.map((client) => line.of[client]);
    const any = rows.find((row) => row);
    const known = rows.filter((row) => row && row.error === undefined);
    const scale = severityScale({ ...any, levels: known.flatMap((row) => (row.fails === null ? [] : [row.survives, row.fails])).filter((level) => level !== null) });
    const ratio = clients.length > 1 ? ratioOf(rows[0], rows[rows.length - 1]) : null;
    const shares = known.map((row) => (row.survives === null ? 0 : row.fails === null ? 1 : scale.place(row.survives)));
    return { ...line, any, rows, scale, ratio, least: shares.length > 0 ? Math.min(...shares) : 2, layer: String(line.type).split(".")[0], worse: ratio !== null && ratio < 1 - (envelope.tolerance ?? 0) };
  });
}

function missingOf(line, client) {
  const row = line.of[client];
  if (row) return row.error === undefined ? undefined : "no margin";
  return "n/a";
}

// Beyond the first level that failed: from which to which level all that were flown are survived.
function againOf(row) {
  const stretches = [];
  let failed = false, last = null;
  for (const [level, survived] of row?.levels ?? []) {
    failed ||= survived === false;
    if (failed && survived && last) stretches.at(-1)[1] = level;
    else if (failed && survived) stretches.push([level, level]);
    last = survived;
  }
  return stretches;
}

const bars = (line) =>
  rangeBars({ scale: line.scale, unit: line.any.unit === "1" ? "" : line.any.unit, label: `${line.type} ${line.place}`.trim(),
    bars: line.rows.map((row, i) => ({ name: clients[i], survives: row?.survives ?? null, fails: row?.fails ?? null, again: againOf(row), missing: missingOf(line, clients[i]) })) });

// A path from here to a page that stands beside this one, as an address.
const addressOf = (side) => `./${side.page.split("/").map(encodeURIComponent).join("/")}#flight=${encodeURIComponent(side.flight)}`;

function link(row, which) {
  const side = row.sides?.[which];
  const level = row[which];
  if (level === null || level === undefined || !side?.page) return null;
  return el("a", { href: addressOf(side), text: which === "survives" ? "survived" : "failed", title: `The flight at ${number(level, 5)}` });
}

function cell(line, client) {
  const row = line.of[client];
  const missing = missingOf(line, client);
  if (missing) return el("td", { class: "n muted", text: missing, title: row?.error });
  const links = [link(row, "survives"), link(row, "fails")].filter(Boolean);
  return el("td", { class: "n level" }, el("b", { text: levelText(row) }), links.length > 0 ? el("span", { class: "links" }, links.flatMap((a, i) => (i > 0 ? [" · ", a] : [a]))) : null);
}

// One side of a margin: its level, what happened, and how to see it.
function side(row, which) {
  const level = row[which];
  if (level === null || level === undefined) return el("p", { text: which === "survives" ? "None: even the mildest level failed." : "All: even the most severe level was survived." });
  const at = `${number(level, 6)}${row.unit && row.unit !== "1" ? ` ${row.unit}` : ""}`;
  const text = which === "survives" ? `Survives ${at}.` : `Fails at ${at} with seed ${row.seed}: ${row.reason || row.first_criterion}`;
  const where = row.sides?.[which];
  return el("div", { class: `side ${which}` }, el("p", {}, text, where?.page ? [" ", el("a", { href: addressOf(where), text: "Look at this flight" })] : null), where?.command ? copyable(where.command, "the command that flies this level") : null);
}

function details(line) {
  return line.rows.map((row, i) => {
    const title = el("h3", {}, swatch(i), clients[i]);
    if (!row) {
      const why = (envelope.not_applicable ?? []).find((other) => other.type === line.type && other.client === clients[i] && other.place.replace(/positive|negative/, "") === line.place.replace(/[+−]$/, ""));
      return el("section", {}, title, el("p", { text: why ? `Not applicable: ${why.reason}` : "Not found yet." }));
    }
    if (row.error !== undefined) return el("section", {}, title, el("p", { text: row.error }));
    const when = row.time_s === null || row.time_s === undefined ? "" : `, at ${seconds(row.time_s)}`;
    const unit = row.unit && row.unit !== "1" ? ` ${row.unit}` : "";
    const sure = row.seeds === 1 ? "Nothing is drawn at random: one flight speaks for all seeds." : `${row.seeds} of ${row.seeds} seeds pass at each level up to the limit: 95 % sure that at least ${number(100 * row.sure_share, 2)} % of all seeds do.`;
    const share = row.survived_share === null || row.survived_share === undefined ? "" : ` Survives ${number(100 * row.survived_share, 3)} % of the range.`;
    return el("section", {}, title, side(row, "survives"), side(row, "fails"),
      (row.pockets ?? []).length > 0 ? el("p", { class: "pockets", text: `Fails from ${row.pockets.map(([from, to]) => `${number(from, 5)} to ${number(to, 5)}${unit}`).join(", and from ")}, and survives more severe levels.` }) : null,
      row.levels ? el("p", { class: "hint", text: `${sure}${share} ${row.levels.length} levels were flown.` }) : null,
      el("p", { class: "hint", text: `${row.fails === null ? "" : `First violated: ${row.first_criterion}${when}. `}${row.runs} flights.` }));
  });
}

function row(line) {
  const span = 6 + clients.length;
  const more = el("tr", { class: "more", hidden: true }, el("td", { colspan: span }));
  const button = el("button", { type: "button", class: "open", "aria-expanded": "false", "aria-label": `Flights of ${line.type} ${line.place}`.trim(), text: "▸", onclick: () => {
    const open = more.hidden;
    if (open) more.firstChild.replaceChildren(el("div", { class: "sides" }, details(line)));
    more.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
    button.textContent = open ? "▾" : "▸";
  } });
  const ratio = line.ratio === null ? "–" : line.ratio === Infinity ? "∞" : number(line.ratio);
  const fragment = document.createDocumentFragment();
  fragment.append(
    el("tr", { class: line.worse ? "worse-row" : "", "data-type": line.type, "data-place": line.place },
      el("th", { scope: "row" }, button, " ", line.type), el("td", { text: line.place }), el("td", { class: "muted" }, line.any.parameter, line.any.unit && line.any.unit !== "1" ? ` [${line.any.unit}]` : ""),
      el("td", { class: "bars" }, bars(line)), line.rows.map((_, i) => cell(line, clients[i])),
      clients.length > 1 ? el("td", { class: `n ratio ${line.worse ? "worse" : line.ratio > 1 + (envelope.tolerance ?? 0) ? "better" : ""}` }, ratio, line.worse ? el("span", { class: "less", text: " ▼ less" }) : null) : null),
    more);
  return fragment;
}

function map(one) {
  const axis = ({ type, parameter, unit }) => `${type}, ${parameter}${unit && unit !== "1" ? ` [${unit}]` : ""}`;
  const rows = one.survived.map((cells, i) => ({ cells, level: one.y.levels[i] })).reverse();
  return el("figure", { class: "figure map" }, el("figcaption", {}, el("h3", { text: one.client }), el("span", { class: "hint", text: `up: ${axis(one.y)}; across: ${axis(one.x)}` })),
    el("table", { class: "grid" }, el("tbody", {}, rows.map(({ cells, level }) => el("tr", {}, el("th", { scope: "row", class: "n", text: number(level, 4) }), cells.map((ok) => el("td", { class: ok === null ? "" : ok ? "yes" : "no", text: ok === null ? "?" : ok ? "✓" : "✕" }))))),
      el("tfoot", {}, el("tr", {}, el("td"), one.x.levels.map((level) => el("td", { class: "n", text: number(level, 3) }))))));
}

function show() {
  const all = lines();
  const names = [clients[0], clients[clients.length - 1]];
  const two = clients.length > 1;
  const of = (test) => all.filter(test).length;
  const boxes = [["", "faults at a place", all.length]];
  if (two) boxes.push(["green", `${names[1]} survives more`, of((l) => l.ratio !== null && l.ratio > 1 + (envelope.tolerance ?? 0))], ["", "as much", of((l) => l.ratio !== null && !l.worse && l.ratio <= 1 + (envelope.tolerance ?? 0))], ["red", `${names[1]} survives less`, of((l) => l.worse)]);
  const left = envelope.not_applicable ?? [];
  if (left.length > 0) boxes.push(["", "not applicable", left.length]);
  const layers = [...new Set(all.map((l) => l.layer))], types = [...new Set(all.map((l) => l.type))];
  const columns = [
    { key: "type", label: "Fault", of: (l) => l.type },
    { key: "place", label: "Where", of: (l) => l.place },
    { key: "parameter", label: "Severity", of: (l) => l.any.parameter },
    { key: "least", label: "Least margin: from harmless to most severe", of: (l) => l.least },
    ...clients.map((client, i) => ({ key: `client-${i}`, label: client, numeric: true, of: (l) => (l.of[client] && l.of[client].error === undefined ? distance(l.of[client]) : -1) })),
  ];
  if (two) columns.push({ key: "ratio", label: "Ratio", numeric: true, of: (l) => l.ratio ?? -1 });
  const selects = [
    { label: "Layer", options: layers.map((x) => [x, x]), fits: (l, value) => l.layer === value },
    { label: "Type", options: types.map((x) => [x, x]), fits: (l, value) => l.type === value },
  ];
  if (two) selects.push({ label: "Compared", options: [["less", `${names[1]} survives less`], ["more", `${names[1]} survives more`]], fits: (l, value) => (value === "less" ? l.worse : l.ratio !== null && l.ratio > 1 + (envelope.tolerance ?? 0)) });
  const [filters, told, table] = listing({ label: "Margins", noun: "margins", kind: "margins", placeholder: "fault, place, criterion", items: all, columns, selects, row,
    words: (l) => [l.type, l.place, l.any.parameter, ...l.rows.flatMap((r) => (r ? [r.first_criterion, r.reason] : []))].filter(Boolean).join(" ") });
  const share = 100 * (envelope.tolerance ?? 0);
  main.replaceChildren(
    el("h1", { text: "How severe may a fault be" }), countBoxes(boxes),
    ...(envelope.complete ? [] : [el("p", { class: "note", role: "note", text: "The envelope is not complete: it was interrupted, or is still under way." })]),
    el("p", { class: "legend" }, clients.map((client, i) => el("span", { class: "item" }, swatch(i), client)),
      el("span", { class: "item hint", text: "bar: survived up to here · line: the first level that failed · pale: survived again · none: the mildest failed · all: the most severe was survived · … : the range goes on" })),
    el("p", { class: "hint", text: `${envelope.repeats} seeds at each level from seed ${envelope.seed} on, exact to ${number(share)} % of the distance from harmless.${two ? ` Ratio: how many times as far from harmless ${names[1]} goes as ${names[0]}; ▼ marks less.` : ""}` }),
    filters, told, all.length > 0 ? table : el("p", { text: "This envelope has no rows." }),
    ...((envelope.map ?? []).length > 0 ? [el("h2", { text: "Two faults at once" }), el("div", { class: "maps" }, envelope.map.map(map))] : []),
    ...(left.length > 0 ? [el("details", {}, el("summary", { text: `${left.length} that a firmware's client cannot take` }), el("ul", {}, left.map((x) => el("li", { text: `${x.type} ${x.place} of ${x.client}: ${x.reason}` }))))] : []));
}

document.title = `${envelope.scenario ?? "envelope"} – tiltproof`;
header(envelope.scenario ?? "envelope", [clients.join(", "), `seed ${envelope.seed}`, `tiltproof ${envelope.version}`]);
onTheme(() => repaint(main));
onPrint(() => repaint(main));
show();
