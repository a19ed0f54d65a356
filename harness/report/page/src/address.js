// The part of the page's address behind #, which names what is shown, so that a copy of it opens the same again.
//
//   readAddress("#flight=hover&t=10.5&plot=x_m,y_m&xy=x_m,y_m&with=spiral")
//   // {flight: "hover", index: -1, t: "10.5", plots: [["x_m", "y_m"]], xy: [["x_m", "y_m"]], with: "spiral"}
//
// #flight-3 is a flight by its place, for names that stand twice.

const decode = (text) => {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;  // not encoded as an address is: shown as it stands
  }
};
const list = (text) => text.split(",").filter(Boolean).map(decode);

export function readAddress(hash) {
  const address = { flight: null, index: -1, t: null, plots: [], xy: [], with: null };
  hash.replace(/^#/, "").split("&").forEach((part, i) => {
    const place = i === 0 && /^flight-(\d+)$/.exec(part);
    if (place) address.index = Number(place[1]);
    const at = part.indexOf("=");
    if (at < 0) return;
    const key = part.slice(0, at), value = part.slice(at + 1);
    if (key === "flight") address.flight = decode(value);
    else if (key === "t" || key === "with") address[key] = decode(value);
    else if (key === "plot") address.plots.push(list(value));
    else if (key === "xy") address.xy.push(list(value));
  });
  return address;
}

export function writeAddress({ flight, index, t, plots, xy, with: other }) {
  const names = (all) => all.map(encodeURIComponent).join(",");
  const parts = [flight !== null ? `flight=${encodeURIComponent(flight)}` : `flight-${index}`];
  if (t !== null) parts.push(`t=${encodeURIComponent(t)}`);
  parts.push(...plots.map((all) => `plot=${names(all)}`), ...xy.map((all) => `xy=${names(all)}`));
  if (other !== null) parts.push(`with=${encodeURIComponent(other)}`);
  return `#${parts.join("&")}`;
}

// {index} of the flight that an address names, {problem} in words when there is no such flight, {} when it names none.
export function findFlight(flights, address) {
  if (address.flight !== null) {
    const index = flights.findIndex((f) => f.name === address.flight);
    return index >= 0 ? { index } : { problem: `This report has no flight “${address.flight}”. Choose one of these.` };
  }
  if (address.index < 0) return {};
  return address.index < flights.length ? { index: address.index } : { problem: `This report has no flight number ${address.index}: it has ${flights.length}, counted from 0. Choose one of these.` };
}

// The name of a flight in an address; by its place when an earlier flight has the same name.
export const nameInAddress = (flights, index) =>
  flights.findIndex((f) => f.name === flights[index].name) === index ? { flight: flights[index].name, index: -1 } : { flight: null, index };

// {time_s}, or {problem} in words.
export function readTime(text, end_s) {
  if (text === null) return {};
  const time_s = /^-?\d+(\.\d*)?(e-?\d+)?$/i.test(text) ? Number(text) : NaN;
  if (Number.isNaN(time_s)) return { problem: `The address asks for t=${text}, which is no number of seconds, such as t=10.5.` };
  if (time_s < 0 || time_s > end_s + 5e-4) return { problem: `The address asks for t=${text}, but this flight lasts from 0 to ${end_s.toFixed(3)} s.` };
  return { time_s: Math.min(time_s, end_s) };
}
