// The page of residual errors: a figure of curves for each kind of damage, and all rows in a table.
import { el, number } from "./dom.js";
import { header } from "./header.js";
import { curves } from "./curves.js";
import { listing } from "./listing.js";
import { onPrint } from "./printing.js";
import { repaint, swatch } from "./range_bars.js";
import { onTheme } from "./theme.js";

const { rows = [], command = "", version = "" } = JSON.parse(document.getElementById("integrity").textContent);
const main = document.getElementById("main");

// Each kind of damage: its title, and what its level is.
const KINDS = {
  ber: ["Wrong bits, each on its own", "bit error rate"],
  burst: ["Bursts of wrong bits", "length [bits]"],
  stuck: ["Bytes in a row that read 00 or FF", "bytes"],
  swap: ["Neighbouring bytes that are swapped", "swaps"],
  loss: ["Lost bytes", "bytes"],
  insert: ["Added bytes", "bytes"],
  enumerate: ["Wrong bits of one frame, in all ways", "bits"],
};
const kindOf = (row) => KINDS[row.errors] ?? [row.errors, "level"];
const nameOf = (row) => `${row.protocol}, ${row.framing}, ${row.check}, ${row.message}`;
const names = [...new Set(rows.map(nameOf))];
const seriesOf = (row) => names.indexOf(nameOf(row));
const distanceText = (row) => (row.hamming_distance ? `Hamming distance ${row.hamming_distance}` : "Hamming distance not counted");

function figure(kind) {
  const own = rows.filter((row) => row.errors === kind);
  const [title, axis] = kindOf(own[0]);
  const series = names.flatMap((name, i) => {
    const points = own.filter((row) => nameOf(row) === name);
    if (points.length === 0) return [];
    return [
      { number: i, kind: "theory", points: points.filter((row) => row.theory !== null).map((row) => ({ x: row.level, y: row.theory })) },
      { number: i, kind: "check", points: points.map((row) => ({ x: row.level, y: row.passed_check_rate, low: row.passed_check_low, high: row.passed_check_high })) },
      { number: i, kind: "accepted", points: points.map((row) => ({ x: row.level, y: row.rate, low: row.low, high: row.high })) },
    ];
  });
  return el("figure", { class: "figure curves-figure", "data-errors": kind }, el("figcaption", {}, el("h3", { text: title })),
    curves({ label: `${title}: wrong frames for each frame sent`, series, axis, logarithmic: kind === "ber" }));
}

const rate = (row, of) => el("td", { class: "n", title: `${number(row[`${of}low`])} to ${number(row[`${of}high`])}, with 95 % confidence`, text: number(row[of === "" ? "rate" : `${of}rate`]) });

const tableRow = (row) =>
  el("tr", {}, el("th", { scope: "row" }, swatch(seriesOf(row)), nameOf(row)), el("td", { text: row.errors }), el("td", { class: "n", text: number(row.level) }), el("td", { class: "n", text: row.frames.toLocaleString("en") }),
    rate(row, "passed_check_"), rate(row, "passed_length_"), rate(row, ""), el("td", { class: "n muted", text: `${number(row.low)} … ${number(row.high)}` }), el("td", { class: "n", text: number(row.theory) }));

function show() {
  const kinds = [...new Set(rows.map((row) => row.errors))];
  const columns = [
    { key: "format", label: "Format", of: nameOf }, { key: "errors", label: "Damage", of: (row) => row.errors }, { key: "level", label: "Level", numeric: true, of: (row) => row.level }, { key: "frames", label: "Frames damaged", numeric: true, of: (row) => row.frames },
    { key: "check", label: "Check passed", numeric: true, of: (row) => row.passed_check_rate }, { key: "length", label: "Exact length, too", numeric: true, of: (row) => row.passed_length_rate }, { key: "rate", label: "Ranges, too", numeric: true, of: (row) => row.rate },
    { key: "bounds", label: "95 % bounds", numeric: true }, { key: "theory", label: "Check by theory", numeric: true, of: (row) => row.theory ?? -1 },
  ];
  const [filters, told, table] = listing({ label: "Rates", noun: "rates", kind: "rates", placeholder: "format, damage", items: rows, columns, row: tableRow, words: (row) => `${nameOf(row)} ${row.errors}`,
    selects: [{ label: "Damage", options: kinds.map((kind) => [kind, kind]), fits: (row, value) => row.errors === value }, { label: "Format", options: names.map((name) => [name, name]), fits: (row, value) => nameOf(row) === value }] });
  const firsts = names.map((name) => rows.find((row) => nameOf(row) === name));
  main.replaceChildren(
    el("h1", { text: "How often a wrong frame is delivered" }),
    el("p", { class: "legend" }, firsts.map((row, i) => el("span", { class: "item" }, swatch(i), `${nameOf(row)} (${distanceText(row)})`))),
    el("p", { class: "hint", text: "Wrong frames for each frame sent. Solid line: accepted, with the exact length and values in their ranges; bars: 95 % bounds. Dashed: framing and check alone. Dotted: the check by theory. Triangle: none of the frames came through, and the rate is below it." }),
    el("div", { class: "figures" }, kinds.map(figure)), el("h2", { text: "All rates" }), filters, told, rows.length > 0 ? table : el("p", { text: "There are no rows." }));
}

document.title = "Residual errors – tiltproof";
header("residual errors", [command, version ? `tiltproof ${version}` : ""].filter(Boolean));
onTheme(() => repaint(main));
onPrint(() => show());
show();
