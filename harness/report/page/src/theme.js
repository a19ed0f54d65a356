// Light and dark, as the system says or as the reader chose.
import { FAULTS, LINES } from "./colours.js";

const system = matchMedia("(prefers-color-scheme: dark)");
const listeners = [];

export const isDark = () => (document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
const ground = () => (isDark() ? "dark" : "light");
export const palette = () => LINES[ground()];
export const faultColour = (fault) => FAULTS[ground()][fault % FAULTS.light.length];
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
