// One plot over time: lines, bounds, the faults' active times as bands, activations and line errors as ticks, and the
// cursor that all plots share.
import uPlot from "uplot";
import { el, number } from "./dom.js";
import { nameOf, together, yRange, yTicks } from "./lines.js";
import { colour, faultColour, palette } from "./theme.js";

const HEIGHT = 210;
const X_AXIS_px = 28;
// Widths of the vertical axis: its values, and its unit beside them. A narrow page has smaller letters.
const NARROW_px = 480;
const AXIS = { wide: { size: 66, letters: 11, label: 17 }, narrow: { size: 52, letters: 10, label: 15 } };
const PADDING_TOP_px = 4;

// Below all lines and bounds: the ticks of frames that did not go on as sent.
const STRIP_px = 9;

export class Plots {
  // `other`: {flight, name} of a second flight, whose lines are dashed; or null.
  constructor(flight, clock, other = null) {
    this.flight = flight;
    this.other = other;
    this.clock = clock;
    this.plots = [];
    this.range = null;
    this.zooming = false;
    this.faultColours = flight.scenario.faults.map((_, i) => faultColour(i));
    clock.listen(() => this.move());
    this.resizer = new ResizeObserver(() => this.plots.forEach((p) => p.uplot && p.uplot.setSize({ width: p.box.clientWidth, height: HEIGHT })));
    // Drawn when it comes into view: a page with a dozen plots opens at once.
    this.watcher = new IntersectionObserver((entries) => entries.forEach((entry) => entry.isIntersecting && this.draw(this.plots.find((p) => p.box === entry.target))), { rootMargin: "300px" });
  }

  // spec: {id, title, unit, lines: [{name, label, dash, step, colour}], bounds: [...], zero}; `scale`: what the vertical axis
  // counts when there is no unit.
  add(spec) {
    const legend = el("div", { class: "legend", "aria-hidden": "true" });
    const box = el("div", { class: "plot", id: `plot-${spec.id}` });
    const figure = el("figure", { class: "figure", role: "group", "aria-label": this.describe(spec) },
      el("figcaption", {}, el("h3", { text: spec.title + (spec.unit ? ` [${spec.unit}]` : "") }), spec.note ? el("span", { class: "hint", text: spec.note }) : null), legend, box);
    const plot = { spec, legend, box, uplot: null };
    this.plots.push(plot);
    this.resizer.observe(box);
    this.watcher.observe(box);
    this.fillLegend(plot);
    return figure;
  }

  // Without waiting until it comes into view: for a printed page.
  drawAll() {
    this.plots.forEach((plot) => this.draw(plot));
  }

  // Lines that the second flight has, too. References are dashed already.
  otherLines(spec) {
    return this.other ? spec.lines.filter((line) => !line.dash && this.other.flight.has(line.name)) : [];
  }

  dataOf(spec) {
    const own = together(this.flight, spec.lines), lines = this.otherLines(spec);
    return lines.length > 0 ? uPlot.join([own, together(this.other.flight, lines)]) : own;
  }

  get end_s() {
    return Math.max(this.flight.end_s, this.other?.flight.end_s ?? 0, 1e-3);
  }

  describe(spec) {
    const ranges = spec.lines.map((line) => {
      const entry = this.flight.entries.get(line.name);
      const word = (value) => nameOf(spec, value) ?? number(value);
      return `${line.label} from ${word(entry.low)} to ${word(entry.high)}`;
    });
    const dashed = this.otherLines(spec).length > 0 ? `; dashed: flight ${this.other.name}` : "";
    return `${spec.title}, ${spec.unit || "no unit"}, over time: ${ranges.join("; ")}${dashed}`;
  }

  colourOf(spec, i) {
    const line = spec.lines[i];
    return palette()[(line.colour ?? i) % palette().length];
  }

  fillLegend(plot) {
    plot.values = [];
    const items = plot.spec.lines.map((line, i) => {
      const value = el("span", { class: "value" });
      plot.values.push(value);
      const swatch = el("span", { class: `swatch ${line.dash ? "dashed" : ""}` });
      swatch.style.borderColor = this.colourOf(plot.spec, i);
      return el("span", { class: "item" }, swatch, el("span", { text: line.label }), value);
    });
    for (const bound of plot.spec.bounds ?? []) {
      const swatch = el("span", { class: "swatch bound" });
      const label = plot.spec.lines.find((line) => line.name === bound.signal)?.label ?? bound.signal;
      const value = `${bound.of_magnitude ? `|${label}|` : label} ${bound.upper ? "≤" : "≥"} ${number(bound.value)}`;
      items.push(el("span", { class: "item" }, swatch, el("span", { text: `${bound.criterion}: ${value}` })));
    }
    if (this.otherLines(plot.spec).length > 0) items.push(el("span", { class: "item" }, el("span", { class: "swatch dashed other" }), el("span", { text: `dashed, and second value: ${this.other.name}` })));
    plot.legend.replaceChildren(...items);
    this.showValues(plot);
  }

  showValues(plot) {
    const others = this.otherLines(plot.spec);
    plot.spec.lines.forEach((line, i) => {
      const word = (flight) => {
        const value = flight.at(line.name, this.clock.time_s, line.step);
        return nameOf(plot.spec, value) ?? number(value, 4);
      };
      plot.values[i].textContent = others.includes(line) ? `${word(this.flight)} · ${word(this.other.flight)}` : word(this.flight);
    });
  }

  draw(plot) {
    if (plot.uplot || !plot.box.isConnected) return;
    const { spec, box } = plot;
    const { size, letters, label } = box.clientWidth < NARROW_px ? AXIS.narrow : AXIS.wide;
    const font = `${letters}px system-ui, sans-serif`;
    const axis = { stroke: colour("muted"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1, size: 4 }, gap: 4, font };
    const line = (line, i, dash) => ({
      label: line.label,
      stroke: this.colourOf(spec, i),
      width: dash ? 1.3 : 1.6,
      dash,
      points: { show: false },
      paths: line.step ? uPlot.paths.stepped({ align: 1 }) : undefined,
    });
    const options = {
      width: Math.max(box.clientWidth, 200),
      height: HEIGHT,
      padding: [PADDING_TOP_px, 14, 0, 0],
      legend: { show: false },
      scales: { x: { time: false, range: () => this.range ?? [0, this.end_s] }, y: { range: (u, low, high) => yRange(spec, low, high, this.flight.line_errors.length > 0 ? STRIP_px / (HEIGHT - X_AXIS_px - PADDING_TOP_px) : 0) } },
      axes: [
        { ...axis, values: (u, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`), size: X_AXIS_px, space: 64 },
        { ...axis, size, label: spec.names ? "" : spec.unit || spec.scale || "no unit", labelSize: label, labelGap: 0, labelFont: font, ...yTicks(spec) },
      ],
      series: [{}, ...spec.lines.map((one, i) => line(one, i, one.dash ? [5, 4] : undefined)), ...this.otherLines(spec).map((one) => line(one, spec.lines.indexOf(one), [7, 4]))],
      cursor: { y: false, points: { show: false }, drag: { x: true, y: false, setScale: true } },
      hooks: {
        ready: [() => this.move()],
        drawClear: [(u) => this.drawBands(u)],
        draw: [(u) => this.drawMarks(u, spec)],
        setCursor: [(u) => this.hovered(u)],
        setScale: [(u, key) => key === "x" && this.zoomed(u)],
      },
    };
    plot.uplot = new uPlot(options, this.dataOf(spec), box);
    plot.uplot.over.addEventListener("dblclick", () => this.zoom(null));
    plot.uplot.over.addEventListener("mouseenter", () => (this.under = plot.uplot));
    plot.uplot.over.addEventListener("mouseleave", () => { this.under = null; this.move(); });
    this.move();
  }

  // The flight has more rows.
  grow() {
    this.zooming = true;
    for (const { spec, uplot, box } of this.plots) {
      box.parentElement?.setAttribute("aria-label", this.describe(spec));
      uplot?.setData(this.dataOf(spec));
    }
    this.zooming = false;
  }

  drawBands(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const band of this.flight.bands) {
      const left = u.valToPos(band.begin_s, "x", true);
      const width = Math.max(u.valToPos(band.end_s, "x", true) - left, devicePixelRatio);
      ctx.fillStyle = this.faultColours[band.fault];
      ctx.globalAlpha = 0.13;
      ctx.fillRect(left, bbox.top, width, bbox.height);
      ctx.globalAlpha = 0.9;
      ctx.fillRect(left, bbox.top, width, 2 * devicePixelRatio);
    }
    ctx.restore();
  }

  drawMarks(u, spec) {
    const { ctx, bbox } = u;
    const px = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const bottom = bbox.top + bbox.height;
    let last = -1;
    for (const [fault, time_s] of this.flight.ticks) {
      const x = Math.round(u.valToPos(time_s, "x", true));
      if (x === last) continue;
      last = x;
      ctx.fillStyle = this.faultColours[fault];
      ctx.fillRect(x, bbox.top, px, 7 * px);
    }
    ctx.fillStyle = colour("error");
    last = -1;
    for (const [time_s] of this.flight.line_errors) {
      const x = Math.round(u.valToPos(time_s, "x", true));
      if (x === last) continue;
      last = x;
      ctx.fillRect(x, bottom - 6 * px, px, 6 * px);
    }
    ctx.strokeStyle = colour("bound");
    ctx.lineWidth = 1.4 * px;
    ctx.setLineDash([3 * px, 3 * px]);
    for (const bound of spec.bounds ?? []) {
      const left = u.valToPos(bound.begin_s, "x", true);
      const right = u.valToPos(Math.min(bound.end_s ?? this.flight.end_s, this.flight.end_s), "x", true);
      for (const value of bound.of_magnitude ? [bound.value, -bound.value] : [bound.value]) {
        const y = u.valToPos(value, "y", true);
        ctx.beginPath();
        ctx.moveTo(left, y);
        ctx.lineTo(right, y);
        ctx.stroke();
      }
    }
    if (spec.zero) {
      ctx.setLineDash([]);
      ctx.strokeStyle = colour("muted");
      ctx.lineWidth = px;
      const y = u.valToPos(0, "y", true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    const noReturn_s = this.flight.why?.point_of_no_return_s ?? null;
    if (noReturn_s !== null) {
      ctx.strokeStyle = colour("ink");
      ctx.lineWidth = 1.2 * px;
      ctx.setLineDash([1 * px, 3 * px]);
      const x = u.valToPos(noReturn_s, "x", true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bottom);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    for (const [violation, dash] of [[this.flight.violation_s, []], [this.other?.flight.violation_s ?? null, [5 * px, 4 * px]]]) {
      if (violation === null) continue;
      ctx.strokeStyle = colour("error");
      ctx.lineWidth = 1.2 * px;
      ctx.setLineDash(dash);
      const x = u.valToPos(violation, "x", true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bottom);
      ctx.stroke();
    }
    ctx.restore();
  }

  hovered(u) {
    if (this.moving || this.under !== u || u.cursor.left < 0 || this.clock.playing) return;
    this.clock.set(u.posToVal(u.cursor.left, "x"));
  }

  move() {
    this.moving = true;
    for (const plot of this.plots) {
      if (!plot.uplot) continue;
      if (plot.uplot !== this.under || this.clock.playing) {
        const left = plot.uplot.valToPos(this.clock.time_s, "x");
        plot.uplot.setCursor({ left, top: 10 }, false);
      }
      this.showValues(plot);
    }
    this.moving = false;
  }

  zoomed(u) {
    if (this.zooming || !this.plots.some((p) => p.uplot === u)) return;
    const { min, max } = u.scales.x;
    if (u.select.width > 0 || this.range) this.zoom([min, max]);
  }

  zoom(range) {
    this.range = range;
    this.zooming = true;
    for (const { uplot } of this.plots) if (uplot) uplot.setScale("x", { min: range ? range[0] : 0, max: range ? range[1] : this.end_s });
    this.zooming = false;
    this.move();
  }

  remove(plot) {
    this.resizer.unobserve(plot.box);
    this.watcher.unobserve(plot.box);
    plot.uplot?.destroy();
    this.plots = this.plots.filter((p) => p !== plot);
  }

  close() {
    this.resizer.disconnect();
    this.watcher.disconnect();
    this.plots.forEach((p) => p.uplot?.destroy());
    this.plots = [];
  }
}
