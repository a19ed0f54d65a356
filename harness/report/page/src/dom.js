// Elements without markup: every text goes in as text, so names of others cannot become markup.

export function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "text") element.textContent = value;
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children.flat(Infinity));
  return element;
}

export function number(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === Infinity) return "∞";
  if (value === -Infinity) return "−∞";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return value.toExponential(2).replaceAll("-", "−");
  return value.toPrecision(size >= 1000 ? Math.max(6, digits) : digits).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "").replaceAll("-", "−");
}

export const seconds = (value) => (value === null || value === undefined ? "–" : `${value.toFixed(3)} s`);

export function copyable(text, label) {
  const button = el("button", { class: "copy", type: "button", "aria-label": `Copy ${label}` , text: "Copy" });
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      // A page from the disk may not write there: the text is selected instead.
      const range = document.createRange();
      range.selectNodeContents(code);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      button.textContent = "Press Ctrl+C";
    }
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
  const code = el("code", { text });
  return el("div", { class: "copyable" }, code, button);
}

// Grey when nothing was `expected`.
export function badge(verdict, expected) {
  const words = verdict === expected && verdict !== "pass" ? `${verdict} (expected)` : verdict;
  return el("span", { class: `badge ${expected === null ? "" : verdict === expected ? "green" : "red"} ${verdict}`, text: words });
}
