// One signal against another: the line of the whole flight, and where it is at the cursor. Positions have equal scales.
import { el, svg } from "./dom.js";
import { axisLabels, equalScale, padded, ticksOf } from "./lines.js";
import { palette } from "./theme.js";

const HEIGHT_MAX = 420, LEFT = 78, BOTTOM = 46, TOP = 8, RIGHT = 16;

export class XyPlot {
  // `other`: null, or another flight, whose line is dashed.
  constructor(flight, clock, across, up, other) {
    Object.assign(this, { flight, across, up, other });
    const word = (name) => `${name}${this.unit(name) ? ` [${this.unit(name)}]` : ""}`;
    this.labels = [word(across), word(up)];
    this.isSpace = this.unit(across) === "m" && this.unit(up) === "m";
    this.box = el("div", { class: "xy" });
    this.caption = el("figcaption", {}, el("h3", { text: `${up} against ${across}` }), this.isSpace ? el("span", { class: "hint", text: "equal scales" }) : null);
    this.figure = el("figure", { class: "figure", role: "group", "aria-label": `${this.labels[1]} up, against ${this.labels[0]} across` }, this.caption, this.box);
    this.lines = [this.points(flight), other ? this.points(other) : []];
    this.clock = clock;
    clock.listen(() => this.move());
    this.resizer = new ResizeObserver(() => this.box.clientWidth !== this.width && this.draw());
    this.resizer.observe(this.box);
  }

  unit(name) {
    return this.flight.entries.get(name)?.unit ?? "";
  }

  points(flight) {
    if (!flight.has(this.across) || !flight.has(this.up)) return [];
    const rows = Uint32Array.from(new Set([this.across, this.up].flatMap((name) => Array.from(flight.points(name).rows)))).sort();
    return Array.from(rows, (row) => [flight.atRow(this.across, row), flight.atRow(this.up, row)]);
  }

  // The flight has more rows.
  grow() {
    this.lines[0] = this.points(this.flight);
    this.draw();
  }

  draw() {
    this.width = this.box.clientWidth;
    if (this.width === 0) return;
    const all = this.lines.flat().filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
    const ends = (i) => padded(all.reduce((low, p) => Math.min(low, p[i]), Infinity), all.reduce((high, p) => Math.max(high, p[i]), -Infinity));
    const height = Math.min(HEIGHT_MAX, Math.max(this.width * 0.7, 220));
    const inner = [this.width - LEFT - RIGHT, height - TOP - BOTTOM];
    let [xs, ys] = [ends(0), ends(1)];
    if (this.isSpace) [xs, ys] = equalScale(xs, ys, ...inner);
    this.x = (v) => LEFT + ((v - xs[0]) / (xs[1] - xs[0])) * inner[0];
    this.y = (v) => TOP + (1 - (v - ys[0]) / (ys[1] - ys[0])) * inner[1];
    const text = (words, attributes) => svg("text", attributes, document.createTextNode(words));
    const xTicks = ticksOf(...xs, inner[0] / 80), yTicks = ticksOf(...ys, inner[1] / 45);
    const parts = [
      ...xTicks.map((v) => svg("line", { x1: this.x(v), x2: this.x(v), y1: TOP, y2: TOP + inner[1], class: "gridline" })),
      ...yTicks.map((v) => svg("line", { x1: LEFT, x2: LEFT + inner[0], y1: this.y(v), y2: this.y(v), class: "gridline" })),
      ...axisLabels(xTicks).map((label, i) => text(label, { x: this.x(xTicks[i]), y: TOP + inner[1] + 16, "text-anchor": "middle", class: "tick" })),
      ...axisLabels(yTicks).map((label, i) => text(label, { x: LEFT - 6, y: this.y(yTicks[i]) + 4, "text-anchor": "end", class: "tick" })),
      text(this.labels[0], { x: LEFT + inner[0] / 2, y: height - 8, "text-anchor": "middle" }),
      text(this.labels[1], { x: 0, y: 0, transform: `translate(14 ${TOP + inner[1] / 2}) rotate(-90)`, "text-anchor": "middle" }),
    ];
    this.lines.forEach((points, i) => {
      let path = "", pen = false;
      for (const [x, y] of points) {
        const drawn = Number.isFinite(x) && Number.isFinite(y);
        if (drawn) path += `${pen ? "L" : "M"}${this.x(x).toFixed(1)} ${this.y(y).toFixed(1)}`;
        pen = drawn;
      }
      if (path) parts.push(svg("path", { d: path, fill: "none", stroke: palette()[0], "stroke-width": i === 0 ? 1.6 : 1.3, "stroke-dasharray": i === 0 ? "none" : "5 4", class: i === 0 ? "own" : "other" }));
    });
    this.dot = svg("circle", { r: 5, fill: palette()[1], stroke: "none" });
    parts.push(this.dot);
    this.box.replaceChildren(svg("svg", { viewBox: `0 0 ${this.width} ${height}`, width: this.width, height, role: "img", "aria-label": this.figure.getAttribute("aria-label") }, parts));
    this.move();
  }

  move() {
    if (!this.dot) return;
    const [x, y] = [this.across, this.up].map((name) => this.flight.at(name, this.clock.time_s));
    const seen = Number.isFinite(x) && Number.isFinite(y);
    this.dot.setAttribute("visibility", seen ? "visible" : "hidden");
    if (!seen) return;
    this.dot.setAttribute("cx", this.x(x).toFixed(1));
    this.dot.setAttribute("cy", this.y(y).toFixed(1));
  }

  close() {
    this.resizer.disconnect();
    this.dot = null;
  }
}
