// Light and dark, as the system says or as the reader chose; colours that a colour-blind reader tells apart
// (Okabe and Ito).

const LIGHT = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7a5c00", "#555555"];
const DARK = ["#56B4E9", "#E69F00", "#00c08b", "#CC79A7", "#ff7a2e", "#F0E442", "#4aa3df", "#bbbbbb"];

// Of faults: none of them is near the colour of what went wrong.
const LIGHT_FAULTS = ["#E69F00", "#CC79A7", "#56B4E9", "#009E73", "#7a5c00", "#0072B2"];
const DARK_FAULTS = ["#F0E442", "#CC79A7", "#56B4E9", "#00c08b", "#E69F00", "#bbbbbb"];

const system = matchMedia("(prefers-color-scheme: dark)");
const listeners = [];

export const isDark = () => (document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
export const palette = () => (isDark() ? DARK : LIGHT);
export const faultColour = (fault) => (isDark() ? DARK_FAULTS : LIGHT_FAULTS)[fault % LIGHT_FAULTS.length];
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export function onTheme(listener) {
  listeners.push(listener);
}
const tell = () => listeners.forEach((listener) => listener());
system.addEventListener("change", tell);

export function toggleTheme() {
  document.documentElement.dataset.theme = isDark() ? "light" : "dark";
  tell();
}
