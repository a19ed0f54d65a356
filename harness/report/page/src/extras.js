// Plots that the reader adds: any signals over time, and any signal against another.
import { el } from "./dom.js";
import { section } from "./section.js";
import { XyPlot } from "./xy_plot.js";

// The signal that was true or in force, for one that was sent or asked for.
const baseOf = (name) => name.replace(/^(sensed|commanded)_/, "");

// {known, unknown}: the plots of which this flight has every signal, and the names that it lacks.
export function knownPlots(flight, { plots, xy }) {
  const unknown = [...plots, ...xy].flat().filter((name) => !flight.has(name));
  const fits = (names) => names.length > 0 && names.every((name) => flight.has(name));
  return { known: { plots: plots.filter(fits), xy: xy.filter((names) => names.length === 2 && fits(names)) }, unknown: [...new Set(unknown)] };
}

// `choice`: {plots: [[signal, ...], ...], xy: [[across, up], ...]}, changed in place; `changed` is called after that.
export function extrasSection(flight, clock, plots, choice, changed = () => {}) {
  const names = [...flight.entries.keys()];
  const box = el("div", { class: "extras" });
  let shown = [], spaces = [];
  const options = (first) => [first ? el("option", { value: "", text: first }) : null, ...names.map((name) => el("option", { value: name, text: name }))];
  const signal = el("select", { id: "extra-signal" }, options("choose a signal"));
  const where = el("select", { id: "extra-where" });
  const across = el("select", { id: "extra-x" }, options()), up = el("select", { id: "extra-y" }, options());
  if (names.includes("x_m")) across.value = "x_m";
  if (names.includes("y_m")) up.value = "y_m";

  const lineOf = (name) => ({ name, label: name, step: /^(supervisor_state|arbiter_selected|on_ground|role_|.*_count$)/.test(name), turns: /_rad$/.test(name) });
  const unitOf = (all) => [...new Set(all.map((name) => flight.entries.get(name).unit).filter(Boolean))].join(", ");
  const remover = (words, list, i) => el("button", { type: "button", class: "remove", "aria-label": `Remove the plot ${words}`, text: "Remove", onclick: () => { list.splice(i, 1); fill(); changed(); where.focus(); } });
  const fill = () => {
    shown.forEach((plot) => plots.remove(plot));
    spaces.forEach((space) => space.close());
    shown = [];
    const figures = choice.plots.map((all, i) => {
      const figure = plots.add({ id: `extra-${i}`, title: all.join(", "), unit: unitOf(all), lines: all.map(lineOf), bounds: flight.bounds.filter((b) => all.includes(b.signal)) });
      figure.querySelector("figcaption").append(remover(all.join(", "), choice.plots, i));
      shown.push(plots.plots[plots.plots.length - 1]);
      return figure;
    });
    spaces = choice.xy.map(([x, y], i) => {
      const space = new XyPlot(flight, clock, x, y, plots.other?.flight ?? null);
      space.caption.append(remover(`${y} against ${x}`, choice.xy, i));
      return space;
    });
    const kept = where.value;
    where.replaceChildren(el("option", { value: "", text: "a new plot" }), ...choice.plots.map((all, i) => el("option", { value: i, text: `the plot of ${all.join(", ")}` })));
    if (kept !== "" && Number(kept) < choice.plots.length) where.value = kept;
    box.replaceChildren(...figures, ...spaces.map((space) => space.figure));
    spaces.forEach((space) => space.draw());
  };
  const add = () => {
    const name = signal.value;
    if (!name) return signal.focus();
    const base = baseOf(name);
    const plot = choice.plots[where.value === "" ? choice.plots.length : Number(where.value)];
    if (!plot) choice.plots.push(base !== name && flight.has(base) ? [name, base] : [name]);
    else if (!plot.includes(name)) plot.push(name);
    fill();
    changed();
  };
  const addSpace = () => {
    choice.xy.push([across.value, up.value]);
    fill();
    changed();
  };
  fill();
  const body = section("more", "More plots",
    el("form", { class: "chooser", onsubmit: (event) => { event.preventDefault(); add(); } }, el("label", {}, "Signal ", signal), el("label", {}, "in ", where), el("button", { class: "add", text: "Add" })),
    el("form", { class: "chooser", onsubmit: (event) => { event.preventDefault(); addSpace(); } }, el("label", {}, "Up ", up), el("label", {}, "against ", across), el("button", { class: "add-xy", text: "Add" })),
    box);
  return { body, draw: () => spaces.forEach((space) => space.draw()), grow: () => spaces.forEach((space) => space.grow()), close: () => spaces.forEach((space) => space.close()) };
}
