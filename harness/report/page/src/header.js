// The line at the top of every page: what is shown, facts about it, a link to what flies now, and the
// switch of light and dark.
import { el } from "./dom.js";
import { toggleTheme } from "./theme.js";

export function header(title, facts, live = false) {
  document.getElementById("header").replaceChildren(
    el("a", { href: "#", class: "home" }, el("span", { class: "logo", "aria-hidden": "true", text: "◭" }), el("span", { text: `tiltproof · ${title}` })),
    el("span", { class: "facts", text: facts.join(" · ") }),
    ...(live ? [el("a", { href: "#live", class: "now-flying", text: "Now flying" })] : []),
    el("button", { type: "button", class: "theme", onclick: toggleTheme, text: "Light / dark" }),
  );
}

// Boxes with a number each; `kind` (green, red) colours those above 0.
export const countBoxes = (boxes) =>
  el("div", { class: "counts" }, boxes.map(([kind, label, n]) => el("div", { class: `count ${n > 0 ? kind : ""}` }, el("b", { text: n }), el("span", { text: label }))));
