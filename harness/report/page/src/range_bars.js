// A figure of levels on a scale: one bar for each firmware, from what is harmless on the left to the most severe on the
// right. The bar ends at the last level that was survived; a tick behind it is the first that failed.
//
//   const scale = severityScale({ scale: "linear", harmless: 0, mildest: 0, severest: 10, levels: [3.2, 3.3] });
//   cell.append(rangeBars({ scale, unit: "ms", label: "frame.delay to_plant", bars: [{ name: "paper", survives: 3.2, fails: 3.3 }] }));
//
// `again`: from which to which level a bar goes on behind levels that failed. `survives` null: the mildest level failed (none); `fails` null: the most severe one was survived (all).
import { el, number, svg } from "./dom.js";
import { palette } from "./theme.js";

const WIDTH = 420, BAR = 13, GAP = 3, AXIS = 17, EDGE = 2;
// A linear axis in which no level lies beyond this share of the range ends sooner: most ranges end at the largest number
// that is allowed, and bars would be invisible.
const USED_MIN = 0.2, HEADROOM = 1.25;
const DECADES = 6;  // of a logarithmic axis from or to 0

// Where levels stand, from 0 (harmless) to 1 (the end of the axis): {place, from, to, cut}. `cut`: the range goes on
// beyond the axis. `levels`: those that are shown, without the ends of the range that were survived.
export function severityScale({ scale, harmless, mildest, severest, levels }) {
  const known = levels.filter((level) => Number.isFinite(level));
  if (scale === "logarithmic") {
    const sizes = known.map(Math.abs).filter((size) => size > 0);
    const least = (end) => Math.min(end * 10 ** -DECADES, ...sizes);
    const from = mildest === 0 ? Math.sign(severest) * least(Math.abs(severest)) : mildest;
    const to = severest === 0 ? Math.sign(mildest) * least(Math.abs(mildest)) : severest;
    const span = Math.log(to / from);
    return { from: mildest, to: severest, cut: false, logarithmic: true, place: (level) => (level === 0 ? (mildest === 0 ? 0 : 1) : Math.min(Math.max(Math.log(level / from) / span, 0), 1)) };
  }
  const from = harmless ?? mildest;
  const used = Math.max(0, ...known.map((level) => (level - from) / (severest - from)));
  const cut = used > 0 && used < USED_MIN;
  const to = cut ? from + (severest - from) * used * HEADROOM : severest;
  return { from, to: severest, cut, place: (level) => Math.min(Math.max((level - from) / (to - from), 0), 1) };
}

const colourOf = (series) => palette()[series % palette().length];

// The colour of a bar, beside its name.
export function swatch(series) {
  const block = el("span", { class: "block", "data-series": series });
  block.style.background = colourOf(series);
  return block;
}

// After light became dark, or the other way round.
export function repaint(root) {
  for (const shape of root.querySelectorAll("[data-series]")) {
    const colour = colourOf(Number(shape.dataset.series));
    if (shape instanceof SVGElement) shape.setAttribute("fill", colour);
    else shape.style.background = colour;
  }
  for (const shape of root.querySelectorAll("[data-stroke]")) shape.setAttribute("stroke", colourOf(Number(shape.dataset.stroke)));
}

export const levelText = ({ survives, fails }) => (survives === null ? "none" : fails === null ? "all" : number(survives, 4));

export function rangeBars({ scale, unit, label, bars }) {
  const height = bars.length * (BAR + GAP) + AXIS;
  const x = (share) => EDGE + share * (WIDTH - 2 * EDGE);
  const shown = bars.flatMap((bar, i) => {
    const y = i * (BAR + GAP) + 1;
    if (bar.missing) return [svg("text", { x: x(0) + 3, y: y + BAR - 3, class: "none" }, document.createTextNode(bar.missing))];
    const end = bar.survives === null ? 0 : bar.fails === null ? 1 : scale.place(bar.survives);
    const parts = [svg("rect", { x: x(0), y, width: Math.max(end * (WIDTH - 2 * EDGE), 1.5), height: BAR, rx: 2, fill: colourOf(i), "data-series": i, class: "margin" })];
    for (const [from, to] of (bar.again ?? []).map((levels) => levels.map(scale.place)).filter((places) => places.every(Number.isFinite)))
      parts.push(svg("rect", { x: x(from), y: y + 3, width: Math.max((to - from) * (WIDTH - 2 * EDGE), 1.5), height: BAR - 6, fill: colourOf(i), "data-series": i, class: "again" }));
    if (bar.fails !== null) parts.push(svg("line", { x1: x(scale.place(bar.fails)), x2: x(scale.place(bar.fails)), y1: y - 0.5, y2: y + BAR + 0.5, class: "fails" }));
    if (bar.survives === null) parts.push(svg("text", { x: x(end) + 7, y: y + BAR - 3, class: "none" }, document.createTextNode("none")));
    if (bar.fails === null) parts.push(svg("text", { x: x(1) - 5, y: y + BAR - 3, class: "all", "text-anchor": "end" }, document.createTextNode("all")));
    return parts;
  });
  const base = bars.length * (BAR + GAP) + 1;
  const ends = [
    svg("line", { x1: x(0), x2: x(1), y1: base, y2: base, class: "gridline" }),
    svg("text", { x: x(0), y: base + 12, class: "end" }, document.createTextNode(`${number(scale.from)}${unit ? ` ${unit}` : ""}`)),
    scale.logarithmic ? svg("text", { x: x(0.5), y: base + 12, class: "end", "text-anchor": "middle" }, document.createTextNode("logarithmic")) : [],
    svg("text", { x: x(1), y: base + 12, class: "end", "text-anchor": "end" }, document.createTextNode(scale.cut ? `… ${number(scale.to)}` : number(scale.to))),
  ];
  const said = bars.map((bar) => `${bar.name} ${bar.missing ?? (bar.survives === null ? "nothing" : bar.fails === null ? "everything" : `${number(bar.survives, 4)}${unit ? ` ${unit}` : ""}`)}`).join(", ");
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${height}`, class: "range-bars", role: "img", "aria-label": `${label}: survived up to: ${said}` }, ends, shown);
}
