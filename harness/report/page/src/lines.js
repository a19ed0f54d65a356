// What a plot draws, without the plot: its rows, and the labels of its axis.
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
