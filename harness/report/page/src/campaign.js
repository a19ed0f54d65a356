// The page of a campaign: how often its flights pass, in how many ways they fail, and what was covered.
import { copyable, el, number, svg } from "./dom.js";
import { countBoxes, header } from "./header.js";
import { listing } from "./listing.js";
import { onPrint } from "./printing.js";
import { repaint } from "./range_bars.js";
import { onTheme, palette } from "./theme.js";

const campaign = JSON.parse(document.getElementById("campaign").textContent);
const main = document.getElementById("main");
const BANDS = ["mildest", "mild", "severe", "most severe"];
const PHASES = ["first quarter of the flight", "second quarter", "third quarter", "last quarter"];

const percent = (share) => (share === null || share === undefined ? "–" : `${number(100 * share, 4)} %`);
const text = (attributes, words) => svg("text", attributes, document.createTextNode(words));
const title = (words) => svg("title", {}, document.createTextNode(words));
const interval = ({ low, high }) => (low === null || low === undefined ? "" : `${percent(low)} to ${percent(high)}, with 95 % confidence`);
const count = (n) => Number(n).toLocaleString("en");

// A share from 0 to 1 with its interval.
function rateBar(rate, label) {
  const WIDTH = 220, HEIGHT = 16, EDGE = 4;
  const x = (share) => EDGE + share * (WIDTH - 2 * EDGE);
  const shapes = [0, 0.5, 1].map((share) => svg("line", { x1: x(share), x2: x(share), y1: 1, y2: HEIGHT - 1, class: "gridline" }));
  if (rate.rate !== null && rate.rate !== undefined) {
    const colour = palette()[0];
    shapes.push(svg("line", { x1: x(rate.low), x2: x(rate.high), y1: HEIGHT / 2, y2: HEIGHT / 2, class: "interval", stroke: colour, "data-stroke": 0 }),
      svg("circle", { cx: x(rate.rate), cy: HEIGHT / 2, r: 3.6, fill: colour, "data-series": 0 }));
  }
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "rate-bar", role: "img", "aria-label": `${label}: ${percent(rate.rate)}` }, title(`${percent(rate.rate)}: ${interval(rate)}`), shapes);
}

// New ways to fail over the runs: steps.
function curve(points) {
  const WIDTH = 760, HEIGHT = 250, LEFT = 52, RIGHT = 30, TOP = 12, BOTTOM = 38;
  const runs = Math.max(points.at(-1)[0], 1), most = Math.max(points.at(-1)[1], 1);
  const x = (n) => LEFT + ((WIDTH - LEFT - RIGHT) * n) / runs, y = (n) => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * n) / most;
  const ticks = (end) => {
    const raw = end / 5, size = 10 ** Math.floor(Math.log10(raw));
    const step = Math.max([1, 2, 5, 10].map((k) => k * size).find((s) => s >= raw), 1);
    return Array.from({ length: Math.floor(end / step) + 1 }, (_, i) => i * step);
  };
  const grid = [
    ...ticks(most).flatMap((n) => [svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(n), y2: y(n), class: "gridline" }), text({ x: LEFT - 7, y: y(n) + 4, "text-anchor": "end" }, count(n))]),
    ...ticks(runs).map((n) => text({ x: x(n), y: HEIGHT - BOTTOM + 17, "text-anchor": "middle" }, count(n))),
    text({ x: LEFT + (WIDTH - LEFT - RIGHT) / 2, y: HEIGHT - 5, "text-anchor": "middle" }, "runs"),
  ];
  const path = `M${x(0)} ${y(0)}` + points.map(([n, signatures]) => `H${x(n).toFixed(1)}V${y(signatures).toFixed(1)}`).join("");
  return el("figure", { class: "figure curve-figure" }, el("figcaption", {}, el("h3", { text: "Distinct ways to fail, over the runs" })),
    svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "steps", role: "img", "aria-label": `${most} ways to fail after ${runs} runs` }, grid, svg("path", { d: path, fill: "none", stroke: palette()[0], "data-stroke": 0, class: "step" })));
}

const address = (path) => `./${path.split("/").map(encodeURIComponent).join("/")}`;

function failureRow(group) {
  const span = 6;
  const more = el("tr", { class: "more", hidden: true }, el("td", { colspan: span }));
  const details = () => el("div", {},
    el("p", {}, "Runs: ", group.runs.map((run) => count(run)).join(", "), group.flights > group.runs.length ? " and more" : ""),
    group.commands?.smallest ? copyable(group.commands.smallest, "the command that flies the smallest scenario") : null,
    group.commands?.show ? copyable(group.commands.show, "the command that flies the first run again") : null);
  const button = el("button", { type: "button", class: "open", "aria-expanded": "false", "aria-label": `Runs of ${group.signature}`, text: "▸", onclick: () => {
    const open = more.hidden;
    if (open) more.firstChild.replaceChildren(details());
    more.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
    button.textContent = open ? "▾" : "▸";
  } });
  const links = [group.page ? el("a", { href: address(group.page), text: "flight" }) : null, group.smallest ? el("a", { href: address(group.smallest), text: "smallest scenario" }) : null].filter(Boolean);
  const fragment = document.createDocumentFragment();
  fragment.append(
    el("tr", { "data-signature": group.signature }, el("th", { scope: "row" }, button, " ", group.criterion || "–"), el("td", { text: group.end }),
      el("td", {}, group.types.length > 0 ? group.types.map((type) => el("span", { class: "type", text: type })) : el("span", { class: "muted", text: "no fault" })),
      el("td", { class: "n", text: count(group.flights) }), el("td", { class: "n", text: count(group.first_run) }),
      el("td", {}, links.flatMap((a, i) => (i > 0 ? [" · ", a] : [a])), links.length === 0 ? el("span", { class: "muted", text: "–" }) : null)),
    more);
  return fragment;
}

// A colour between that of failures and that of passes is not needed: the share that failed is the height of the red part.
function bandCells(bands) {
  return el("span", { class: "bands" }, bands.map((band) => {
    const share = band.flights > 0 ? band.failed / band.flights : 0;
    const cell = el("span", { class: `band ${band.flights > 0 ? "" : "none"}`, title: `${BANDS[band.band] ?? band.band}: ${count(band.passed)} of ${count(band.flights)} pass${band.flights > 0 ? `, ${interval(band)}` : ""}` });
    cell.append(el("span", { class: "failed" }));
    cell.firstChild.style.height = `${100 * share}%`;
    return cell;
  }));
}

const typeRow = (rate) =>
  el("tr", { "data-type": rate.type }, el("th", { scope: "row", text: rate.type }), el("td", { class: "n", text: count(rate.drawn) }),
    el("td", { class: `n ${rate.drawn > 0 && rate.activated === 0 ? "worse" : ""}`, text: count(rate.activated) }), el("td", { class: "n", text: count(rate.flights) }), el("td", { class: "n", text: count(rate.failed) }),
    el("td", { class: "n", title: interval(rate), text: percent(rate.rate) }), el("td", {}, rateBar(rate, rate.type)), el("td", {}, bandCells(rate.bands)));

const rateTable = (label, name, rates, nameOf) =>
  el("div", { class: "scroll" }, el("table", { class: "small rates" }, el("caption", { text: label }), el("thead", {}, el("tr", {}, [name, "Flights", "Failed", "Pass", ""].map((head, i) => el("th", { scope: "col", class: i > 0 && i < 4 ? "n" : "", text: head })))),
    el("tbody", {}, rates.map((rate) => el("tr", {}, el("th", { scope: "row", text: nameOf(rate) }), el("td", { class: "n", text: count(rate.flights) }), el("td", { class: "n", text: count(rate.failed) }), el("td", { class: "n", title: interval(rate), text: percent(rate.rate) }), el("td", {}, rateBar(rate, nameOf(rate))))))));

const outcome = (flight) => `${flight.verdict}${flight.criterion ? ` ${flight.criterion}` : ""}${flight.time_s === null ? "" : ` at ${number(flight.time_s, 4)} s`}`;
const margin = (flight) => el("td", { class: "n", text: flight.margin === null ? "–" : number(flight.margin, 3) });

// Runs that another client has flown again.
function confirmed({ client, flights, same, rows }) {
  const [filters, told, table] = listing({ label: `Flights of ${client}`, noun: "flights", kind: "confirmed", placeholder: "verdict, criterion", items: rows, words: (row) => `${outcome(row.campaign)} ${outcome(row.confirmed)} ${row.signature}`,
    row: (row) => el("tr", {}, el("th", { scope: "row", class: "n", text: count(row.run) }), el("td", { text: outcome(row.campaign) }), margin(row.campaign), el("td", { class: row.same ? "" : "worse", text: outcome(row.confirmed) }), margin(row.confirmed)),
    columns: [{ key: "run", label: "Run", numeric: true, of: (r) => r.run }, { key: "campaign", label: "In the campaign", of: (r) => outcome(r.campaign) }, { key: "margin", label: "Margin", numeric: true, of: (r) => r.campaign.margin ?? Infinity }, { key: "confirmed", label: client, of: (r) => outcome(r.confirmed) }, { key: "margin2", label: "Margin", numeric: true, of: (r) => r.confirmed.margin ?? Infinity }],
    selects: [{ label: "Verdict and criterion", options: [["same", "the same"], ["other", "another"]], fits: (row, value) => row.same === (value === "same") }] });
  return [el("h2", { text: `Confirmed by ${client}` }), el("p", { class: "hint", text: `${count(same)} of ${count(flights)} flights have the same verdict and criterion.` }), filters, told, table];
}

const coveredOf = (row) => row.cells.flat().filter((n) => n > 0).length;
const coverageRow = (row) =>
  el("tr", {}, el("th", { scope: "row", text: row.type }), el("td", { text: row.place }), el("td", { class: "n", text: count(row.drawn) }), el("td", { class: "n", text: count(row.activated) }), el("td", { class: "n", text: `${coveredOf(row)} of ${row.cells.flat().length}` }),
    el("td", {}, el("span", { class: "cells" }, row.cells.map((bands, phase) => el("span", { class: "phase" }, bands.map((n, band) => el("span", { class: `cell ${n > 0 ? "hit" : ""}`, title: `${PHASES[phase]}, ${BANDS[band]}: ${count(n)} that acted` })))))));

function show() {
  const { failures = [], by_type: types = [], by_firmware: firmwares = [], by_scenario: scenarios = [], by_severity: bands = [], coverage = { rows: [] }, confirmed: others = [] } = campaign;
  const notJudged = campaign.inconclusive + campaign.errors;
  const ends = [...new Set(failures.map((group) => group.end))], layers = [...new Set(types.map((rate) => rate.type.split(".")[0]))];
  const [failureFilters, failureTold, failureTable] = listing({ label: "Ways to fail", noun: "ways to fail", kind: "failures", placeholder: "criterion, fault", items: failures, row: failureRow, words: (group) => group.signature,
    columns: [{ key: "criterion", label: "Criterion", of: (g) => g.criterion }, { key: "end", label: "End", of: (g) => g.end }, { key: "types", label: "Faults", of: (g) => g.types.join() }, { key: "flights", label: "Flights", numeric: true, of: (g) => g.flights }, { key: "first", label: "First run", numeric: true, of: (g) => g.first_run }, { key: "links", label: "See" }],
    selects: [{ label: "End", options: ends.map((end) => [end, end]), fits: (group, value) => group.end === value }] });
  const [typeFilters, typeTold, typeTable] = listing({ label: "Fault types", noun: "types", kind: "types", placeholder: "fault type", order: "the lowest pass rate first", items: types, row: typeRow, words: (rate) => rate.type,
    columns: [{ key: "type", label: "Fault", of: (r) => r.type }, { key: "drawn", label: "Drawn", numeric: true, of: (r) => r.drawn }, { key: "activated", label: "Acted", numeric: true, of: (r) => r.activated }, { key: "flights", label: "Flights", numeric: true, of: (r) => r.flights }, { key: "failed", label: "Failed", numeric: true, of: (r) => r.failed },
      { key: "rate", label: "Pass", numeric: true, of: (r) => r.rate ?? 2 }, { key: "bar", label: "0 to 100 %, 95 % bounds" }, { key: "bands", label: "Failed, by severity" }],
    selects: [{ label: "Layer", options: layers.map((x) => [x, x]), fits: (rate, value) => rate.type.split(".")[0] === value }] });
  const [coverageFilters, coverageTold, coverageTable] = listing({ label: "Coverage", noun: "faults at a place", kind: "coverage", placeholder: "fault type, place", items: coverage.rows, row: coverageRow, words: (row) => `${row.type} ${row.place}`, selects: [],
    columns: [{ key: "type", label: "Fault", of: (r) => r.type }, { key: "place", label: "Where", of: (r) => r.place }, { key: "drawn", label: "Drawn", numeric: true, of: (r) => r.drawn }, { key: "activated", label: "Acted", numeric: true, of: (r) => r.activated }, { key: "covered", label: "Covered", numeric: true, of: coveredOf }, { key: "cells", label: "By time of the flight (groups), and severity" }] });
  main.replaceChildren(
    el("h1", { text: `Campaign ${campaign.campaign}` }),
    countBoxes([["", "runs", count(campaign.flown)], ["green", "passed", campaign.passed], ["red", "failed", campaign.failed], ["red", "ways to fail", campaign.signatures], ...(notJudged > 0 ? [["", "not judged", notJudged]] : [])]),
    ...(campaign.complete ? [] : [el("p", { class: "note", role: "note", text: `${count(campaign.flown)} of ${count(campaign.runs)} runs: the campaign was interrupted, is still under way, or has other shards.` })]),
    el("p", { class: "reason", text: campaign.flights > 0 ? `${percent(campaign.rate)} of the flights pass: ${interval(campaign)}.` : "No flight was judged." }),
    ...(campaign.curve.length > 0 ? [curve(campaign.curve)] : []),
    el("h2", { text: "Ways to fail" }), ...(failures.length > 0 ? [failureFilters, failureTold, failureTable] : [el("p", { text: "No flight failed." })]),
    ...others.flatMap(confirmed),
    el("h2", { text: "Fault types" }), typeFilters, typeTold, typeTable,
    el("h2", { text: "Other shares" }), el("div", { class: "tables" }, rateTable("Flights with a fault of this severity", "Severity", bands, (rate) => BANDS[rate.band] ?? String(rate.band)), rateTable("By firmware", "Firmware", firmwares, (rate) => rate.name || "–"), rateTable("By scenario", "Scenario", scenarios, (rate) => rate.name || "–")),
    el("h2", { text: "Coverage" }), el("p", { class: "hint", text: `${count(coverage.covered ?? 0)} of ${count(coverage.cells ?? 0)} cells (type, place, quarter of the flight, quarter of the severity) have a fault that acted; ${count(coverage.drawn ?? 0)} have one that was drawn.` }), coverageFilters, coverageTold, coverageTable);
}

document.title = `${campaign.campaign} – tiltproof`;
header(campaign.campaign, [`seed ${campaign.seed}`, `tiltproof ${campaign.version}`]);
onTheme(() => repaint(main));
onPrint(() => show());
show();
