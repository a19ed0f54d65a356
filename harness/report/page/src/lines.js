// Content of a plot, without the plot: its rows, and the labels of its axis.
import { number } from "./dom.js";

// From pi to -pi an angle has not moved: there the line has a gap.
const turns = (line, from, to) => line.turns && Math.abs(to - from) > Math.PI;

// As many digits as tell neighbours apart.
export function axisLabels(ticks) {
  const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) : 0;
  const largest = Math.max(...ticks.map(Math.abs));
  const digits = step > 0 ? Math.ceil(Math.log10(largest / step)) + 2 : 4;
  return ticks.map((t) => number(t, Math.min(Math.max(digits, 4), 12)));
}

// The name of a value that stands for something, as states do.
export const nameOf = (spec, value) => (Number.isInteger(value) ? spec.names?.[value] : undefined);

// States and counts have ticks at whole numbers alone.
const isWhole = (spec) => spec.lines.every((line) => line.whole);

export function yTicks(spec) {
  if (!isWhole(spec)) return { values: (u, ticks) => axisLabels(ticks) };
  const splits = (u, axis, low, high) => {
    const step = Math.max(1, Math.ceil((high - low) / 8));
    const first = Math.ceil(low / step);
    return Array.from({ length: Math.max(0, Math.floor(high / step) - first + 1) }, (_, i) => (first + i) * step);
  };
  return { splits, values: (u, ticks) => ticks.map((t) => nameOf(spec, t) ?? (spec.names ? "" : `${t}`)) };
}

// The ends of the vertical axis for values from low to high. At least the share `strip` of its height is left free below
// all that is drawn.
export function yRange(spec, low, high, strip) {
  const [bottom, top] = rangeOfLines(spec, low, high);
  const lowest = Math.min(spec.zero ? 0 : Infinity, low ?? Infinity);
  return [Math.min(bottom, (lowest - strip * top) / (1 - strip)), top];
}

function rangeOfLines(spec, low, high) {
  if (low === null || high === null || low === undefined) return [-1, 1];
  // All states; of a count 0 and 1 at least.
  if (spec.names) return [-0.4, spec.names.length - 0.6];
  if (isWhole(spec)) return [Math.min(low, 0) - 0.2, Math.max(high, 1) + 0.2];
  // A bound far away would flatten the lines: then it stays outside.
  for (const bound of spec.bounds ?? []) {
    const size = Math.max(high - low, Math.abs(high), Math.abs(low), 1e-9);
    for (const value of bound.of_magnitude ? [bound.value, -bound.value] : [bound.value]) {
      if (value > high && value - high < 4 * size && (bound.upper || !bound.of_magnitude)) high = value;
      if (value < low && low - value < 4 * size && !(bound.of_magnitude && spec.lines.length === 1 && low >= 0)) low = value;
    }
  }
  if (spec.zero) low = Math.min(low, 0), (high = Math.max(high, 0));
  const pad = (high - low) * 0.07 || Math.abs(high) * 0.1 || 1;
  return [spec.zero && low === 0 ? 0 : low - pad, high + pad];
}

// Ticks at round numbers, some `count` of them.
export function ticksOf(low, high, count) {
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.max(0, Math.floor(high / step + 1e-9) - first + 1) }, (_, i) => (first + i) * step);
}

// The ends of an axis for values from low to high, with a little room.
export function padded(low, high) {
  if (!(low <= high)) return [-1, 1];
  const room = (high - low) * 0.05 || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

// The wider of the two scales for both.
export function equalScale([x0, x1], [y0, y1], width, height) {
  const scale = Math.max((x1 - x0) / width, (y1 - y0) / height);
  const around = (low, high, size) => [(low + high - scale * size) / 2, (low + high + scale * size) / 2];
  return [around(x0, x1, width), around(y0, y1, height)];
}

// All lines on the rows of any of them, so that each keeps its own extremes.
export function together(flight, lines) {
  const rows = new Set();
  for (const line of lines) for (const row of flight.points(line.name).rows) rows.add(row);
  const sorted = Uint32Array.from(rows).sort();
  const data = [Array.from(sorted, (row) => flight.times_s[row])];
  for (const line of lines) {
    const points = flight.points(line.name);
    let i = 0;
    data.push(
      Array.from(sorted, (row) => {
        while (i + 1 < points.rows.length && points.rows[i + 1] <= row) ++i;
        const value = points.values[i];
        const here = points.rows[i] === row;
        if (here && i > 0 && turns(line, points.values[i - 1], value)) return null;
        if (here || line.step || i + 1 >= points.rows.length) return Number.isFinite(value) ? value : null;
        if (turns(line, value, points.values[i + 1])) return null;
        const share = (row - points.rows[i]) / (points.rows[i + 1] - points.rows[i]);
        const between = value + share * (points.values[i + 1] - value);
        return Number.isFinite(between) ? between : null;
      }),
    );
  }
  return data;
}
