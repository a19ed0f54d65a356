// A part of a page with its heading.
import { el } from "./dom.js";

export const section = (id, title, ...children) => el("section", { id, "aria-labelledby": `${id}-h` }, el("h2", { id: `${id}-h`, text: title }), children);
