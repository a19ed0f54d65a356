// Reads what harness/report/flight_pack.h wrote: the data of a flight, decoded when it is looked at.

const LEVEL_MAX = 16380;
const text = new TextDecoder();

export const run = () => JSON.parse(document.getElementById("run").textContent);

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function open(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const size = view.getUint32(0, true);
  return { json: JSON.parse(text.decode(bytes.subarray(4, 4 + size))), numbers: bytes.subarray(4 + size) };
}

function levelValue(level, low, high) {
  if (level === 65535) return NaN;
  if (level === 65534) return -Infinity;
  if (level === 65533) return Infinity;
  if (level === LEVEL_MAX) return high;
  const share = level / LEVEL_MAX;
  return low * (1 - share) + high * share;
}

// Rows and values of a series.
function unpack(series, numbers) {
  const rows = new Uint32Array(series.count);
  const values = new Float64Array(series.count);
  let at = series.at;
  let row = 0;
  for (let i = 0; i < series.count; ++i) {
    let distance = 0;
    let scale = 1;
    for (;;) {
      const byte = numbers[at++];
      distance += (byte & 0x7f) * scale;
      if (byte < 0x80) break;
      scale *= 128;
    }
    rows[i] = row += distance;
  }
  let level = 0;
  for (let i = 0; i < series.count; ++i) {
    const code = numbers[at + i] | (numbers[at + series.count + i] << 8);
    level = (level + ((code >> 1) ^ -(code & 1))) & 0xffff;
    values[i] = levelValue(level, series.low, series.high);
  }
  return { rows, values };
}

// Index of the last element that is not after `value`; -1 when all are.
export function lastAtOrBefore(sorted, value) {
  let low = 0;
  let high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// In the page, or with the server of a run that is still flown.
async function bytesOf(id) {
  const element = document.getElementById(id);
  if (element) return Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
  const response = await fetch(id);
  if (!response.ok) throw new Error(`the server has no data of it (${response.status})`);
  return new Uint8Array(await response.arrayBuffer());
}

export class Flight {
  static async load(id) {
    const bytes = await bytesOf(id);
    const sizeAt = (at) => new DataView(bytes.buffer).getUint32(at, true);
    const placesAt = 4 + sizeAt(0);
    const closeUpsAt = placesAt + 4 + sizeAt(placesAt);
    const { json, numbers } = open(await inflate(bytes.subarray(4, placesAt)));
    const places = open(await inflate(bytes.subarray(placesAt + 4, closeUpsAt)));
    const closeUps = await Promise.all(
      places.json.close_ups.map(async (entry) => {
        const begin = closeUpsAt + entry.at;
        return { ...entry, ...open(await inflate(bytes.subarray(begin, begin + entry.size))) };
      }),
    );
    return new Flight(json, numbers, closeUps);
  }

  constructor(json, numbers, closeUps) {
    Object.assign(this, json);
    this.numbers = numbers;
    this.closeUps = closeUps.sort((a, b) => a.begin_s - b.begin_s);
    this.times_s = this.readTimes();
    this.cache = new Map();
    this.entries = new Map(this.series.map((series) => [series.name, series]));
  }

  readTimes() {
    const { count, first_ns, at } = this.times;
    const view = new DataView(this.numbers.buffer, this.numbers.byteOffset + at, 4 * count);
    const times = new Float64Array(count);
    let time_ns = first_ns;
    for (let i = 0; i < count; ++i) times[i] = (time_ns += view.getUint32(4 * i, true)) / 1e9;
    return times;
  }

  has(name) {
    return this.entries.has(name);
  }

  get end_s() {
    return this.times_s.length > 0 ? this.times_s[this.times_s.length - 1] : 0;
  }

  // {rows, values}: decimated, and every row where there are close-ups.
  points(name) {
    if (!this.cache.has(name)) this.cache.set(name, this.merge(name, unpack(this.entries.get(name), this.numbers)));
    return this.cache.get(name);
  }

  merge(name, points) {
    const column = this.columns.indexOf(name);
    if (column < 0 || this.closeUps.length === 0) return points;
    const merged = new Map();
    points.rows.forEach((row, i) => merged.set(row, points.values[i]));
    for (const { json, numbers } of this.closeUps) {
      const count = json.row_count;
      const at = 8 * count * column;
      const bytes = new DataView(new ArrayBuffer(8));
      for (let r = 0; r < count; ++r) {
        for (let b = 0; b < 8; ++b) bytes.setUint8(b, numbers[at + b * count + r]);
        merged.set(json.first_row + r, bytes.getFloat64(0, true));
      }
    }
    const rows = Uint32Array.from(merged.keys()).sort();
    return { rows, values: Float64Array.from(rows, (row) => merged.get(row)) };
  }

  // The value at a row, between the points on a line between them.
  atRow(name, row, step = false) {
    const { rows, values } = this.points(name);
    const i = lastAtOrBefore(rows, row);
    if (i < 0) return NaN;
    if (rows[i] === row || i + 1 >= rows.length || step) return values[i];
    const share = (row - rows[i]) / (rows[i + 1] - rows[i]);
    return values[i] + share * (values[i + 1] - values[i]);
  }

  // Between rows, on a line or on a step.
  at(name, time_s, step = false) {
    if (!this.has(name) || this.times_s.length === 0) return NaN;
    const row = Math.max(0, lastAtOrBefore(this.times_s, time_s));
    const value = this.atRow(name, row, step);
    if (step || row + 1 >= this.times_s.length) return value;
    const share = (time_s - this.times_s[row]) / (this.times_s[row + 1] - this.times_s[row]);
    return share <= 0 ? value : value + Math.min(share, 1) * (this.atRow(name, row + 1) - value);
  }

  closeUpAt(time_s) {
    return this.closeUps.find((c) => c.begin_s <= time_s && time_s < c.end_s);
  }

  // The first violation of a criterion; null when there is none.
  get violation_s() {
    const times = this.result.criteria.filter((c) => c.verdict === "fail" && c.time_s !== null).map((c) => c.time_s);
    return times.length > 0 ? Math.min(...times) : null;
  }
}
