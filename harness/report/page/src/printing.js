// While the page is printed it is light, and every list is whole.
let printing = false;
export const isPrinting = () => printing;

// `rebuild` shows the same again at once, with isPrinting() as it is then.
export function onPrint(rebuild) {
  let theme;
  const set = (on) => {
    if (on === printing) return;
    printing = on;
    const { dataset } = document.documentElement;
    if (on) {
      theme = dataset.theme;
      dataset.theme = "light";
      dataset.printing = "";
    } else {
      if (theme === undefined) delete dataset.theme;
      else dataset.theme = theme;
      delete dataset.printing;
    }
    rebuild();
  };
  addEventListener("beforeprint", () => set(true));
  addEventListener("afterprint", () => set(false));
}
