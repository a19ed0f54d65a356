// Curves of rates over levels, with a logarithmic axis of rates.
//
//   figure.append(curves({ label: "Bursts", axis: "length [bits]", logarithmic: false, series: [{ number: 0, kind: "accepted", points: [{ x: 8, y: 1e-6, low: 1e-7, high: 2e-6 }] }] }));
//
// kind: "accepted" (solid, with its bounds), "check" (dashed) or "theory" (dotted). A rate of 0 cannot stand on such an axis: a
// triangle at its upper bound takes its place. Levels stand side by side at equal distances unless `logarithmic`.
import { number, svg } from "./dom.js";
import { palette } from "./theme.js";

const WIDTH = 560, HEIGHT = 320, LEFT = 64, RIGHT = 12, TOP = 10, BOTTOM = 40;
const DECADES_MAX = 24;

const text = (attributes, words) => svg("text", attributes, document.createTextNode(words));
const power = (exponent) => `1e${exponent}`.replace("-", "−");

// The y axis: whole decades around all that is shown.
function decades(series) {
  const shown = series.flatMap(({ points }) => points.flatMap(({ y, high }) => (y > 0 ? [y] : high > 0 ? [high] : []))).filter((y) => y > 0 && Number.isFinite(y));
  if (shown.length === 0) return [-9, 0];
  const top = Math.min(Math.ceil(Math.log10(Math.max(...shown)) + 0.05), 0);
  return [Math.max(Math.floor(Math.log10(Math.min(...shown)) - 0.05), top - DECADES_MAX), top];
}

function paths(points, x, y) {
  const parts = [];
  for (const point of points) {
    if (!(point.y > 0)) parts.push([]);
    else if (parts.length === 0) parts.push([point]);
    else parts.at(-1).push(point);
  }
  return parts.filter((part) => part.length > 1).map((part) => part.map((point, i) => `${i === 0 ? "M" : "L"}${x(point.x).toFixed(1)} ${y(point.y).toFixed(1)}`).join(""));
}

export function curves({ label, series, axis, logarithmic }) {
  const levels = [...new Set(series.flatMap(({ points }) => points.map((point) => point.x)))].sort((a, b) => a - b);
  const [bottom, top] = decades(series);
  const inside = WIDTH - LEFT - RIGHT, span = Math.log10(levels.at(-1) / levels[0]) || 1;
  const x = (level) => LEFT + 16 + (inside - 32) * (levels.length < 2 ? 0.5 : logarithmic ? Math.log10(level / levels[0]) / span : levels.indexOf(level) / (levels.length - 1));
  const y = (rate) => TOP + (HEIGHT - TOP - BOTTOM) * Math.min(Math.max((top - Math.log10(rate)) / (top - bottom), 0), 1);
  const step = Math.ceil((top - bottom) / 8);
  const grid = [];
  for (let decade = top; decade >= bottom; decade -= step) {
    const at = y(10 ** decade);
    grid.push(svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: at, y2: at, class: "gridline" }), text({ x: LEFT - 6, y: at + 4, "text-anchor": "end" }, power(decade)));
  }
  for (const level of levels) grid.push(text({ x: x(level), y: HEIGHT - BOTTOM + 17, "text-anchor": "middle" }, logarithmic ? power(Math.round(Math.log10(level) * 100) / 100) : number(level)));
  grid.push(text({ x: LEFT + inside / 2, y: HEIGHT - 6, "text-anchor": "middle" }, axis));
  const shown = series.map(({ number: of, kind, points }) => {
    const colour = palette()[of % palette().length];
    const nudge = kind === "accepted" ? (of - (new Set(series.map((one) => one.number)).size - 1) / 2) * 3 : 0;
    const place = (level) => x(level) + nudge;
    const marks = kind === "theory" ? [] : points.map((point) => {
      if (!(point.y > 0)) {
        if (!(point.high > 0)) return [];
        const at = place(point.x), below = y(point.high);
        return [svg("path", { d: `M${at - 4} ${below - 3}h8l-4 7z`, class: `none ${kind}`, stroke: colour, "data-stroke": of, fill: "none" })];
      }
      const whisker = kind === "accepted" && point.high > point.low ? [svg("line", { x1: place(point.x), x2: place(point.x), y1: y(point.high), y2: y(point.low > 0 ? point.low : 10 ** bottom), stroke: colour, "data-stroke": of, class: "bounds" })] : [];
      const dot = svg("circle", { cx: place(point.x), cy: y(point.y), r: kind === "accepted" ? 3.4 : 2.2, fill: colour, "data-series": of });
      dot.append(svg("title", {}, document.createTextNode(`${number(point.y)} at ${number(point.x)}`)));
      return [...whisker, dot];
    });
    return [...paths(points, place, y).map((d) => svg("path", { d, class: `curve ${kind}`, stroke: colour, "data-stroke": of })), ...marks.flat()];
  });
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "curves", role: "img", "aria-label": label }, grid, shown);
}
