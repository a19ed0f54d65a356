// Opens reports in Chromium and checks what a reader sees, that nothing executes that should not, and that nothing is
// loaded from anywhere.
//
// Usage: node page_test.mjs TILTPROOF SOURCE_DIR OUT_DIR [PATTERN]    screenshots stay in OUT_DIR; only checks whose names match
import assert from "node:assert/strict";
import { execFileSync, spawnSync, spawn } from "node:child_process";
import { cpSync, existsSync, linkSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { deflateSync, inflateSync } from "node:zlib";
import { readerChecks } from "./reader_checks.mjs";

const [tiltproof, source, out] = process.argv.slice(2, 5).map((path) => resolve(path));
const wanted = new RegExp(process.argv[5] ?? "");
const { chromium } = createRequire(join(source, "harness/report/page/package.json"))("playwright-core");
const EVIL = '<img src=x onerror="window.executed=1"></script><script>window.executed=1</script>';

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });

function fly(name, ...options) {
  const folder = join(out, name);
  const ended = spawnSync(tiltproof, ["run", ...options, "--out", folder, "--no-progress"], { encoding: "utf8" });
  assert.ok([0, 1].includes(ended.status), ended.stderr);
  const run = join(folder, readdirSync(folder).find((entry) => entry !== "latest"));
  return { run, page: join(run, "report.html"), text: ended.stdout };
}
const report = (...options) => execFileSync(tiltproof, ["report", ...options], { encoding: "utf8" });

// Below all else: without a graphics card the browser draws on every processor there is, and flights in real time need theirs.
const polite = join(out, "chromium.sh");
writeFileSync(polite, `#!/bin/sh\nexec nice -n 19 "${process.env.CHROMIUM ?? "/usr/bin/chromium"}" "$@"\n`, { mode: 0o755 });
const browser = await chromium.launch({ executablePath: polite, args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
const troubles = [];
const requests = [];

// `start` opens the page in another way than by its address.
async function open(file, options = {}, start = null) {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 }, colorScheme: "light", ...options });
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && !/GPU stall|GL Driver|status of 400/.test(message.text()) && troubles.push(`${file}: ${message.text()}`));
  page.on("pageerror", (error) => troubles.push(`${file}: ${error.stack}`));
  page.on("dialog", (dialog) => troubles.push(`${file}: dialog ${dialog.message()}`));
  page.on("request", (request) => requests.push(request.url()));
  if (start) await start(page);
  else await page.goto(/^http:/.test(file) ? file : `file://${file}`);
  await page.waitForSelector("h1");
  return page;
}

async function openFlight(file, name, options) {
  const page = await open(file, options);
  const index = await page.evaluate((wanted) => JSON.parse(document.getElementById("run").textContent).flights.findIndex((f) => f.name === wanted), name);
  assert.ok(index >= 0, `${name} is in ${file}`);
  await page.evaluate((i) => (location.hash = `#flight-${i}`), index);
  await page.waitForSelector("#criteria");
  return page;
}

const checks = [];
const check = (name, body) => checks.push({ name, body });
const now = (page) => page.locator(".now").textContent().then(parseFloat);
const picture = (page) => page.evaluate(() => document.querySelector(".view canvas").toDataURL());

const flown = fly("flown", join(source, "scenarios/paper/spiral-velocity.yaml"), join(source, "scenarios/wire/burst-fail.yaml"));
const lost = "wire-burst-fail";

check("run names the report", async () => {
  assert.ok(existsSync(flown.page));
  assert.equal(flown.text.trimEnd().split("\n").at(-1), `2 of 2 green; report: ${flown.page}`);
  const without = fly("without", join(source, "scenarios/paper/hover.yaml"), "--no-report");
  assert.ok(!existsSync(without.page));
});

check("the summary lists, finds and sorts flights", async () => {
  const page = await open(flown.page);
  const names = () => page.locator(".flights tbody th").allTextContents();
  assert.deepEqual(await names(), [lost, "paper-spiral-velocity"]);  // the least margin first
  assert.ok(!/null|undefined/.test(await page.locator("#header").textContent()));
  await page.screenshot({ path: join(out, "summary-light.png") });
  await page.fill("input[type=search]", "spiral velocity");
  assert.deepEqual(await names(), ["paper-spiral-velocity"]);
  await page.fill("input[type=search]", "");
  await page.selectOption(".filters select >> nth=0", "fail");
  assert.deepEqual(await names(), [lost]);
  await page.selectOption(".filters select >> nth=0", "");
  await page.selectOption(".filters select >> nth=1", "paper");
  assert.deepEqual(await names(), ["paper-spiral-velocity"]);
  await page.selectOption(".filters select >> nth=1", "");
  await page.click("thead button >> text=Flown");
  await page.click("thead button >> text=Flown");
  assert.deepEqual(await names(), ["paper-spiral-velocity", lost]);
  // By keyboard alone.
  await page.locator(".flights a").first().focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#replay");
  await page.close();
});

check("a flight has the figures of the paper, and more", async () => {
  const page = await openFlight(flown.page, "paper-spiral-velocity");
  for (const id of ["position", "attitude", "servos", "thrusts", "torques", "error", "robustness"]) {
    await page.locator(`#plot-${id}`).scrollIntoViewIfNeeded();
    await page.waitForSelector(`#plot-${id} canvas`);
  }
  assert.equal(await page.locator("#histogram-request_period_ms .bar").count(), 42);
  assert.equal(await page.locator(".view canvas").count(), 1);
  const headings = await page.locator("h2, h3").allTextContents();
  for (const heading of ["Roll, pitch, yaw [rad]", "Servo angles [rad]", "Control inputs: thrusts [N]", "Request periods [ms]", "Position error [m]"])
    assert.ok(headings.includes(heading), heading);
  // Each says in words what it shows.
  for (const label of await page.locator("figure[role=group]").evaluateAll((all) => all.map((f) => f.getAttribute("aria-label")))) assert.match(label, /from .* to /);
  await page.close();
});

check("an axis tells its ticks apart, and an angle that turns leaves a gap", async () => {
  const { axisLabels, together } = await import(join(source, "harness/report/page/src/lines.js"));
  for (const [first, step, count] of [[10.2751, 0.00005, 8], [0, 0.2, 6], [-1200, 0.5, 9], [999999, 0.01, 5], [3, 1, 1]]) {
    const labels = axisLabels(Array.from({ length: count }, (_, i) => first + i * step));
    assert.equal(new Set(labels).size, count, labels.join(" "));
    labels.forEach((label, i) => assert.ok(Math.abs(Number(label.replace("−", "-")) - (first + i * step)) < step / 10, label));
  }
  // The second line has rows of its own; the first is never drawn on its way from pi to -pi.
  const points = { yaw: { rows: [0, 2, 4, 6], values: [3.0, 3.1, -3.1, -3.0] }, x: { rows: [1, 3, 5, 6], values: [0, 1, 2, 3] } };
  const flight = { times_s: [0, 1, 2, 3, 4, 5, 6], points: (name) => points[name] };
  const [times, yaw] = together(flight, [{ name: "yaw", turns: true }, { name: "x" }]);
  assert.deepEqual(times, [0, 1, 2, 3, 4, 5, 6]);
  assert.deepEqual(yaw.map((v) => v && Number(v.toFixed(6))), [3.0, 3.05, 3.1, null, null, -3.05, -3.0]);
});

check("the robustness of a criterion is that of its window, and its lowest value the margin", async () => {
  const { number } = await import(join(source, "harness/report/page/src/dom.js"));
  const file = join(out, "windowed.yaml");
  // It begins 1 m beside the reference, long before the window of the first one.
  writeFileSync(file, `name: windowed\nduration_s: 8\ninitial: {position_m: [1, 0, 2]}\nreference: {type: hover, at_m: [0, 0, 2]}\nfirmware: tolerant\ncriteria:
  - {name: near, stl: "always[6,8](position_error_m <= 0.5)"}
  - {name: leaves, stl: "eventually[0,8](position_error_m <= 0.1)"}
  - {name: settles, stl: "always[0,2](eventually[0,5](position_error_m <= 0.2))"}
  - {name: first, stl: "(position_error_m <= 2) until[0,8] (position_error_m <= 0.3)"}\n`);
  const { run, page: windowed } = fly("windowed", file);
  for (const [report, folder, name] of [[windowed, run, "windowed"], [flown.page, flown.run, lost], [flown.page, flown.run, "paper-spiral-velocity"]]) {
    const page = await openFlight(report, name);
    const margins = Object.fromEntries(JSON.parse(readFileSync(join(folder, name, "verdict.json"), "utf8")).criteria.map((c) => [c.name, c.margin]));
    const labels = await page.locator("figure[role=group]").evaluateAll((all) => all.map((f) => f.getAttribute("aria-label")));
    const label = (title) => labels.find((text) => text.startsWith(title)) ?? "";
    const curves = [...label("Robustness of each criterion,").matchAll(/([^ ]+)( \(looks ahead\))? from (\S+) to/g)];
    assert.ok(curves.length > 0, labels.join("\n"));
    for (const [, criterion, , low] of curves) assert.equal(low, number(margins[criterion]), criterion);
    if (name === "windowed") {
      assert.deepEqual(curves.map(([, criterion, ahead]) => [criterion, Boolean(ahead)]), [["near", false], ["settles", true]]);
      assert.ok(label("Robustness of what must happen once").endsWith(` to ${number(margins.leaves)}`), label("Robustness of what"));
      assert.match(label("Robustness of criteria, as if the flight began here"), / first from/);
      assert.ok(margins.near > 0);
      // Before its window there is nothing.
      const values = page.locator("#plot-robustness").locator("xpath=..").locator(".item .value");
      assert.equal(await values.first().textContent(), "–");
      await page.keyboard.press("End");
      assert.ok(parseFloat(await values.first().textContent()) >= margins.near);
      await page.locator("#plot-robustness").scrollIntoViewIfNeeded();
      await page.waitForSelector("#plot-robustness canvas");
      await page.screenshot({ path: join(out, "robustness-light.png") });
    }
    await page.close();
  }
});

check("the states of a shipped build have their names", async () => {
  const { STATES, figuresOf } = await import(join(source, "harness/report/page/src/figures.js"));
  const words = readFileSync(join(source, "firmware/supervisor.h"), "utf8").match(/enum class SupervisorState[^}]*}/)[0];
  const numbered = [...words.matchAll(/k(\w+) = (\d+)/g)].map(([, name, value]) => [name.toLowerCase(), Number(value)]);
  assert.deepEqual(numbered, STATES.map((name, i) => [name.replace(/[ -]/g, ""), i]));
  // A firmware of others counts as it likes, and one of several is known by its id.
  const told = (columns, clients) => figuresOf({ series: [], bounds: [], states: [], inputs: [], columns, scenario: { faults: [] }, has: (name) => columns.includes(name), points: () => ({ values: [0] }) }, clients).map((f) => [f.id, f.lines.map((l) => l.name)]);
  assert.deepEqual(told(["supervisor_state"], { "": "library:a.so" }), [["supervisor-number", ["supervisor_state"]]]);
  assert.deepEqual(told(["supervisor_state"], { "": "host" }), [["supervisor", ["supervisor_state"]]]);
  assert.deepEqual(told(["supervisor_state_a", "supervisor_state_b"], { "": "host", a: "library:a.so" }), [["supervisor", ["supervisor_state_b"]], ["supervisor-number", ["supervisor_state_a"]]]);
  const file = join(out, "silence.yaml");
  writeFileSync(file, `name: silence\nduration_s: 6\nfirmware: tolerant\nreference: {type: hover, at_m: [0, 0, 2]}\nfaults:\n  - {id: quiet, type: link.silence, target: to_client, start_s: 2, end_s: 2.3}\ncriteria: []\n`);
  const page = await openFlight(fly("silence", file).page, "silence");
  const figure = page.locator("#plot-supervisor").locator("xpath=..");
  assert.match(await figure.getAttribute("aria-label"), /from run to fail-safe/);
  await page.locator("#plot-supervisor").scrollIntoViewIfNeeded();
  await page.waitForSelector("#plot-supervisor canvas");
  const value = figure.locator(".item .value");
  assert.equal(await value.textContent(), "init");
  await page.keyboard.press("Shift+ArrowRight");
  assert.equal(await value.textContent(), "run");
  for (let i = 0; i < 12; ++i) await page.keyboard.press("ArrowRight");
  assert.equal(await value.textContent(), "fail-safe");
  await page.screenshot({ path: join(out, "states-light.png") });
  await page.close();
});

check("an axis has room for line errors, and whole numbers for what is counted", async () => {
  const { yRange, yTicks } = await import(join(source, "harness/report/page/src/lines.js"));
  const count = { lines: [{ whole: true }] }, states = { lines: [{ whole: true }], names: ["run", "init", "hold"] };
  const ticks = (spec, range) => { const { splits, values } = yTicks(spec); return values(null, splits(null, 1, ...range)); };
  assert.deepEqual(ticks(count, yRange(count, 0, 0, 0)), ["0", "1"]);
  assert.deepEqual(ticks(count, yRange(count, 0, 3, 0.05)), ["0", "1", "2", "3"]);
  assert.ok(ticks(count, yRange(count, 0, 4000, 0)).length < 12);
  assert.deepEqual(ticks(states, yRange(states, 0, 0, 0)), ["run", "init", "hold"]);
  for (const zero of [true, false])
    for (const [low, high] of [[0, 0], [0, 1], [0.2, 7], [-3, 2], [-5, -4], [10, 10], [1e-6, 2e-6], [-1e6, 1e6]])
      for (const strip of [0, 0.05, 0.2]) {
        const spec = { lines: [{}], zero, bounds: [] };
        const [bottom, top] = yRange(spec, low, high, strip);
        const drawn = zero ? Math.min(low, 0) : low;
        assert.ok((drawn - bottom) / (top - bottom) >= strip - 1e-9 && bottom <= low && top >= high, `${low} to ${high}: ${bottom} to ${top}`);
        assert.ok(!zero || strip > 0 || low < 0 || bottom === 0);
      }
});

check("the colours of the first faults are none of a line in the figure of the error", async () => {
  const { FAULTS, LINES } = await import(join(source, "harness/report/page/src/colours.js"));
  const { figuresOf } = await import(join(source, "harness/report/page/src/figures.js"));
  const columns = ["position_error_m", "cross_track_error_m"];
  const [{ lines }] = figuresOf({ series: [], bounds: [], states: [], inputs: [], columns, scenario: { faults: [] }, has: (name) => columns.includes(name) }, {});
  for (const ground of ["light", "dark"]) {
    const taken = lines.map((line, i) => LINES[ground][line.colour ?? i]);
    for (const fault of FAULTS[ground].slice(0, 3)) assert.ok(!taken.includes(fault), `${ground}: ${fault}`);
    assert.equal(FAULTS[ground].length, FAULTS.light.length);
  }
});

check("a flight that never started says so in large letters, and none of its criteria is red that nobody decided", async () => {
  const file = join(out, "never.yaml");
  writeFileSync(file, `name: never\nduration_s: 0.6\nreference: {type: hover, at_m: [0, 0, 2]}\nfaults:\n  - {id: cut, type: link.silence, target: both}\ncriteria:\n  - {name: near, stl: "always(position_error_m <= 0.5)"}\n`);
  const page = await open(fly("never", file).page);
  await page.waitForSelector("#criteria");
  const reason = page.locator(".nothing");
  assert.match(await reason.textContent(), /This flight left no trace.*never started/);
  assert.ok((await reason.evaluate((e) => parseFloat(getComputedStyle(e).fontSize))) >= 18);
  assert.ok((await page.locator("#criteria .badge.inconclusive").count()) > 0);
  assert.equal(await page.locator("#criteria .badge.inconclusive.red").count(), 0);
  await page.screenshot({ path: join(out, "never-started.png") });
  // The command that flies it again stands there whole.
  const [inside, whole] = await page.locator(".again code").evaluate((e) => [e.clientWidth, e.scrollWidth]);
  assert.ok(whole <= inside, `${whole} of ${inside}`);
  await page.close();
});

check("a fault that acted too often to be listed says how far the list goes", async () => {
  const file = join(out, "often.yaml");
  writeFileSync(file, `name: often\nduration_s: 15\nreference: {type: hover, at_m: [0, 0, 2]}\nfaults:\n  - {id: late, type: frame.delay, target: both, parameters: {mean_ms: 0.01}}\ncriteria: []\n`);
  const page = await openFlight(fly("often", file).page, "often");
  assert.match(await page.locator("#faults li").first().textContent(), /ticks for the first 1000/);
  await page.close();
});

check("values at the cursor are those of the trace", async () => {
  const page = await openFlight(flown.page, lost);
  await page.keyboard.press("j");
  const t = await now(page);
  const lines = readFileSync(join(flown.run, lost, "trace.csv"), "utf8").trimEnd().split("\n").map((line) => line.split(","));
  const row = lines.find((line) => Math.abs(parseFloat(line[0]) - t) < 1e-6);
  const x = parseFloat(row[lines[0].indexOf("x_m")]);
  await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  await page.waitForFunction((time) => document.querySelector("table.row caption").textContent.includes(time.toFixed(3)), t);
  const shown = await page.locator("table.row tbody tr", { has: page.locator("th", { hasText: /^x_m$/ }) }).locator("td").first().textContent();
  assert.ok(Math.abs(parseFloat(shown.replace("−", "-")) - x) < 1e-5 * Math.abs(x), `${shown} is ${x}`);
  await page.close();
});

check("the replay moves, by keys, and jumps to the first violation", async () => {
  const page = await openFlight(flown.page, lost);
  const verdict = JSON.parse(readFileSync(join(flown.run, lost, "verdict.json"), "utf8"));
  const first = Math.min(...verdict.criteria.filter((c) => c.verdict === "fail").map((c) => c.time_s));
  await page.keyboard.press("Home");
  const still = await picture(page);
  await page.keyboard.press("j");
  assert.ok(Math.abs((await now(page)) - first) < 1e-3);
  const there = await picture(page);
  assert.notEqual(there, still);
  await page.keyboard.press("ArrowLeft");
  assert.ok(Math.abs((await now(page)) - (first - 0.1)) < 1e-3);
  await page.keyboard.press("Shift+ArrowLeft");
  assert.ok(Math.abs((await now(page)) - (first - 1.1)) < 1e-3);
  await page.keyboard.press("Home");
  assert.equal(await now(page), 0);
  await page.keyboard.press(" ");
  await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) > 0.2);
  await page.keyboard.press(" ");
  const stopped = await now(page);
  assert.notEqual(await picture(page), still);
  await page.waitForTimeout(200);
  assert.equal(await now(page), stopped);
  await page.click("#criteria button.time >> nth=0");
  await page.screenshot({ path: join(out, "flight-light.png") });
  await page.close();
});

check("one cursor goes through all plots", async () => {
  const page = await openFlight(flown.page, lost);
  await page.locator("#plot-error").scrollIntoViewIfNeeded();
  await page.waitForSelector("#plot-error canvas");
  await page.waitForSelector("#plot-robustness canvas");
  const box = await page.locator("#plot-error .u-over").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) > 1);
  const places = await page.locator(".u-cursor-x").evaluateAll((all) => all.map((line) => line.getBoundingClientRect().left));
  assert.ok(places.length >= 2);
  for (const place of places) assert.ok(Math.abs(place - (box.x + box.width / 2)) < 3, `${places}`);
  await page.close();
});

check("frames around a moment show damaged bytes", async () => {
  const page = await openFlight(flown.page, lost);
  await page.click(".moments button");
  await page.waitForSelector(".frame.damaged");
  await page.locator("#frames").scrollIntoViewIfNeeded();
  const sent = (await page.locator(".frame.damaged .hex >> nth=0").textContent()).trim().split(/\s+/);
  const got = (await page.locator(".frame.damaged .hex >> nth=1").textContent()).trim().split(/\s+/);
  const marked = (await page.locator(".frame.damaged >> nth=0").locator("mark").allTextContents()).join(" ").split(/\s+/);
  assert.equal(sent.length, got.length);
  assert.deepEqual(marked, got.filter((byte, i) => byte !== sent[i]));
  // Bytes that are not payload say what they are, and values how they are sent.
  const flag = page.locator(".frame .hex i.flag").first();
  assert.deepEqual([await flag.textContent(), await flag.getAttribute("title")], ["7e", "flag"]);
  assert.ok((await page.locator(".frame .hex i.check").count()) > 0);
  assert.match(await page.locator(".frame .fields span").first().getAttribute("title"), /^f32 at byte \d+, little endian$/);
  assert.match(await page.locator("#frames .framing").textContent(), /^Framing hdlc, check fletcher16\./);
  assert.ok(await page.locator(".frame.damaged >> nth=0").isVisible());
  await page.screenshot({ path: join(out, "frames-light.png") });
  await page.keyboard.press("Home");
  await page.waitForSelector("#frames >> text=No frames are kept here");
  // The program is that of the command above, and the command is right.
  const dump = await page.locator("#frames .dump code").textContent();
  assert.equal(dump, `${tiltproof} link-dump ${join(flown.run, lost, "link.bin")}`);
  assert.ok((await page.locator(".again code").first().textContent()).startsWith(`${tiltproof} replay `));
  assert.equal(await page.locator("#frames .dump button.copy").count(), 1);
  assert.ok(execFileSync("/bin/sh", ["-c", `${dump} | head -n 2`], { encoding: "utf8" }).length > 0);
  await page.close();
});

check("dark, light, and small", async () => {
  const page = await openFlight(flown.page, lost, { colorScheme: "dark" });
  const background = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const dark = await background();
  await page.keyboard.press("j");
  await page.waitForTimeout(200);
  await page.screenshot({ path: join(out, "flight-dark.png") });
  await page.locator("#plot-attitude").scrollIntoViewIfNeeded();
  await page.waitForSelector("#plot-attitude canvas");
  await page.screenshot({ path: join(out, "figures-dark.png") });
  await page.click("button.theme");
  assert.notEqual(await background(), dark);
  await page.setViewportSize({ width: 700, height: 900 });
  await page.waitForSelector("#criteria");
  await page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth, null, { timeout: 5000 });
  await page.close();
});

// As an older program left them: without the hashes that tell of changes.
function writeResults(run, { hash, ...results }) {
  writeFileSync(join(run, "results.json"), JSON.stringify(results));
}
function forgetHashes(flight) {
  const { files, ...verdict } = JSON.parse(readFileSync(join(flight, "verdict.json"), "utf8"));
  writeFileSync(join(flight, "verdict.json"), JSON.stringify(verdict));
}

check("hostile names, and numbers that are none", async () => {
  const run = join(out, "hostile");
  cpSync(flown.run, run, { recursive: true });
  const results = JSON.parse(readFileSync(join(run, "results.json"), "utf8"));
  for (const flight of results.scenarios) {
    flight.reason = flight.replay = flight.trace_hash = EVIL;
    for (const criterion of flight.criteria) Object.assign(criterion, { name: EVIL, explanation: EVIL, margin: null, robustness: null });
    for (const fault of flight.faults) fault.id = fault.type = EVIL;
    flight.metrics[EVIL] = 1e308;
    for (const histogram of Object.values(flight.histograms)) histogram.counts.fill(0);
    flight.histograms[EVIL] = { edges: [0, 1], counts: [0, 5, 0] };
  }
  results.scenarios.push({ ...results.scenarios[0], name: EVIL });
  writeResults(run, results);
  const info = JSON.parse(readFileSync(join(run, "run.json"), "utf8"));
  Object.assign(info, { suite: EVIL, client: EVIL, interrupted: true, not_applicable: [{ name: EVIL, reason: EVIL }] });
  writeFileSync(join(run, "run.json"), JSON.stringify(info));
  const flight = join(run, lost);
  const lines = readFileSync(join(flight, "trace.csv"), "utf8").trimEnd().split("\n");
  const columns = lines[0].split(",");
  // Each column is not a number somewhere; some are nowhere a number.
  const broken = lines.slice(1).map((line, r) => line.split(",").map((v, c) => (c > 0 && c < 21 && ((r + c) % 50 === 0 || c === 5 || c === 17) ? "nan" : c === 7 && r % 40 === 0 ? "inf" : v)).join(","));
  writeFileSync(join(flight, "trace.csv"), [columns.join(","), ...broken].join("\n") + "\n");
  const activations = Array.from({ length: 10000 }, (_, i) => JSON.stringify({ time_s: i / 1000, fault: "burst", type: "wire.burst", what: EVIL, before: [], after: [] }));
  writeFileSync(join(flight, "faults.jsonl"), activations.join("\n") + "\n");
  forgetHashes(flight);
  report(run);
  const file = join(run, "report.html");
  const page = await open(file);
  assert.ok((await page.locator(".flights").textContent()).includes(EVIL));
  for (const [i, expected] of [[0, "#criteria"], [1, "#criteria"], [2, "#criteria"]]) {
    await page.evaluate((index) => (location.hash = `#flight-${index}`), i);
    await page.waitForSelector(expected);
    await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
    for (const figure of await page.locator(".plot").all()) await figure.scrollIntoViewIfNeeded();
    await page.keyboard.press("j");
    await page.keyboard.press(" ");
    await page.waitForTimeout(150);
  }
  assert.equal(await page.evaluate(() => window.executed), undefined);
  assert.equal(await page.locator("main img, main script").count(), 0);
  await page.screenshot({ path: join(out, "hostile.png") });
  await page.close();
});

check("an empty run, a killed run, and one without files", async () => {
  const run = join(out, "empty");
  mkdirSync(run);
  const info = JSON.parse(readFileSync(join(flown.run, "run.json"), "utf8"));
  writeFileSync(join(run, "run.json"), JSON.stringify({ ...info, interrupted: true }));
  mkdirSync(join(run, lost));
  cpSync(join(flown.run, lost, "scenario.resolved.yaml"), join(run, lost, "scenario.resolved.yaml"));
  report(run);  // no results.json, and one flight that had begun
  const killed = await open(join(run, "report.html"));
  assert.equal(await killed.locator(".flights tbody tr").count(), 2);
  assert.match(await killed.locator("main").textContent(), /interrupted/);
  await killed.click(`text=${lost}`);
  await killed.waitForSelector("text=This flight left no trace");
  await killed.close();
  const results = JSON.parse(readFileSync(join(flown.run, "results.json"), "utf8"));
  // A run that was interrupted: what was never flown is no error of the flights.
  const never = Array.from({ length: 3 }, (_, i) => ({ ...results.scenarios[0], name: `never-${i}`, verdict: "error", reason: "not flown: the run was interrupted", replay: "", criteria: [], metrics: {} }));
  writeResults(run, { ...results, interrupted: true, scenarios: [...results.scenarios, ...never] });
  report(run);
  const interrupted = await open(join(run, "report.html"));
  const boxes = Object.fromEntries(await interrupted.locator(".count").evaluateAll((all) => all.map((box) => [box.querySelector("span").textContent, Number(box.querySelector("b").textContent)])));
  assert.deepEqual([boxes["not flown"], boxes.errors, boxes["as expected"], boxes["not as expected"]], [3, 0, 2, 0], JSON.stringify(boxes));
  assert.equal(await interrupted.locator(".flights .badge >> text=not flown").count(), 3);
  await interrupted.selectOption(".filters select >> nth=0", "not flown");
  assert.equal(await interrupted.locator(".flights tbody tr").count(), 3);
  await interrupted.selectOption(".filters select >> nth=0", "error");
  assert.equal(await interrupted.locator(".flights tbody tr").count(), 0);
  await interrupted.selectOption(".filters select >> nth=0", "");
  await interrupted.screenshot({ path: join(out, "interrupted.png") });
  await interrupted.close();
  writeResults(run, { ...results, scenarios: [] });
  report(run);
  const empty = await open(join(run, "report.html"));
  assert.match(await empty.locator("main").textContent(), /no flights/);
  await empty.close();
  const verdicts = fly("verdicts", join(source, "scenarios/wire/burst-fail.yaml"), "--keep", "verdicts");
  const page = await openFlight(verdicts.page, lost);
  assert.match(await page.locator("main").textContent(), /left no files/);
  assert.ok((await page.locator("#criteria tbody tr").count()) >= 3);
  await page.close();
});

check("what changed since a baseline", async () => {
  const other = join(out, "compared.html");
  const changed = fly("changed", join(source, "scenarios/wire/burst-fail.yaml"), join(source, "scenarios/paper/hover.yaml"), "--seed", "2");
  report(changed.run, "--baseline", flown.run, "--out", other);
  const page = await open(other);
  const rows = await page.locator(".flights tbody tr").allTextContents();
  assert.ok(rows.some((row) => row.includes("paper-hover") && row.includes("new")), rows.join("\n"));
  assert.match(await page.locator("main").textContent(), /Only there: paper-spiral-velocity/);
  await page.close();
});

// A folder as a flight of another vehicle would leave it: four rotors, none of which tilts.
function makeQuadrotor(run) {
  const flight = join(run, "paper-spiral-velocity");
  const [names, ...rows] = readFileSync(join(flight, "trace.csv"), "utf8").trimEnd().split("\n").map((line) => line.split(","));
  const rotors = ["front_left", "front_right", "rear_left", "rear_right"];
  const keep = names.flatMap((name, i) => (/alpha|(f|tau)_[rl]_n/.test(name) ? [] : [i]));
  const thrusts = (row, t) => rotors.map((_, i) => 5 + Math.sin(t * (i + 1)) * 2);
  const insert = (list, before, added) => list.splice(list.indexOf(before), 0, ...added);
  const kept = keep.map((i) => names[i]);
  const header = [...kept];
  insert(header, "x_ref_m", rotors.map((name) => `f_${name}_n`));
  insert(header, "faults_active_count", rotors.map((name) => `commanded_f_${name}_n`));
  const lines = rows.map((row) => {
    const values = new Map(kept.map((name, i) => [name, row[keep[i]]]));
    thrusts(row, Number(row[0])).forEach((force, i) => [`f_${rotors[i]}_n`, `commanded_f_${rotors[i]}_n`].forEach((name) => values.set(name, force)));
    return header.map((name) => values.get(name)).join(",");
  });
  writeFileSync(join(flight, "trace.csv"), [header.join(","), ...lines].join("\n") + "\n");
  const file = join(flight, "flight.json"), log = JSON.parse(readFileSync(file, "utf8"));
  Object.assign(log, { hover_input: [5, 5, 5, 5], input_min: [0, 0, 0, 0], input_max: [10, 10, 10, 10] });
  writeFileSync(file, JSON.stringify(log));
  forgetHashes(flight);
  return rotors;
}

// Changes what a page holds of a flight, in the place of a vehicle file that the plant cannot fly yet.
function changeFlight(file, id, change) {
  const text = readFileSync(file, "utf8"), begin = text.indexOf(">", text.indexOf(`id="${id}"`)) + 1, end = text.indexOf("<", begin);
  const bytes = Buffer.from(text.slice(begin, end), "base64"), size = bytes.readUInt32LE(0);
  const part = inflateSync(bytes.subarray(4, 4 + size)), length = part.readUInt32LE(0);
  const json = JSON.parse(part.subarray(4, 4 + length).toString());
  change(json);
  const u32 = (value) => { const four = Buffer.alloc(4); four.writeUInt32LE(value); return four; };
  const words = Buffer.from(JSON.stringify(json)), packed = deflateSync(Buffer.concat([u32(words.length), words, part.subarray(4 + length)]));
  writeFileSync(file, text.slice(0, begin) + Buffer.concat([u32(packed.length), packed, bytes.subarray(4 + size)]).toString("base64") + text.slice(end));
}

check("the curve of why, and its line in all figures", async () => {
  const run = join(out, "why");
  cpSync(flown.run, run, { recursive: true });
  const before = await openFlight(flown.page, lost);
  assert.equal(await before.locator("#plot-why").count(), 0);
  await before.close();
  execFileSync(tiltproof, ["why", join(run, lost), "--futures", "3"], { encoding: "utf8" });
  const why = JSON.parse(readFileSync(join(run, lost, "why.json"), "utf8"));
  const page = await openFlight(join(run, "report.html"), lost);
  await page.locator("#plot-why").scrollIntoViewIfNeeded();
  await page.waitForSelector("#plot-why canvas");
  const figure = page.locator("#plot-why").locator("xpath=..");
  assert.match(await figure.locator(".hint").textContent(), new RegExp(`point of no return at ${why.point_of_no_return_s}.* needed: `));
  assert.match(await page.locator("#figures > .hint").textContent(), /Dotted line: point of no return/);
  // The chance at the cursor is that of the curve.
  for (const point of [why.curve.find((p) => p.probability < 0.5), why.curve.find((p) => p.time_s === why.point_of_no_return_s)]) {
    await page.evaluate((t) => (location.hash = location.hash.replace(/&t=[^&]*/, "") + `&t=${t}`), point.time_s);
    await page.waitForFunction((t) => Math.abs(parseFloat(document.querySelector(".now").textContent) - t) < 0.002, point.time_s);
    assert.equal(parseFloat(await figure.locator(".item .value").first().textContent()), point.probability);
  }
  await page.screenshot({ path: join(out, "why.png") });
  await page.close();
});

check("a vehicle with four rotors and no hinge", async () => {
  const run = join(out, "quadrotor"), name = "paper-spiral-velocity";
  cpSync(flown.run, run, { recursive: true });
  const rotors = makeQuadrotor(run);
  report(run);
  const file = join(run, "report.html");
  const { details } = JSON.parse(/id="run">(.*?)<\/script>/s.exec(readFileSync(file, "utf8"))[1]).flights.find((f) => f.name === name);
  changeFlight(file, details, (flight) => {
    assert.deepEqual(flight.problems, []);
    assert.deepEqual(flight.inputs, rotors.map((rotor) => `f_${rotor}_n`));
    const places = [[0.2, 0.2, 0], [0.2, -0.2, 0], [-0.2, 0.2, 0], [-0.2, -0.2, 0]];
    flight.vehicle.rotors = rotors.map((rotor, i) => ({ name: rotor, position_m: places[i], hinge_point_m: places[i], hinge_axis: [0, 0, 0], thrust_axis: [0, 0, 1], force_max_n: 10, angle: "", force: `f_${rotor}_n` }));
  });
  const page = await openFlight(file, name);
  assert.equal(await page.locator("#plot-servos, #plot-torques").count(), 0);
  const label = await page.locator("#plot-thrusts").locator("xpath=..").getAttribute("aria-label");
  for (const rotor of rotors) assert.ok(label.includes(`f_${rotor} from `), label);
  for (const id of ["position", "attitude", "thrusts", "error", "robustness"]) {
    await page.locator(`#plot-${id}`).scrollIntoViewIfNeeded();
    await page.waitForSelector(`#plot-${id} canvas`);
  }
  const still = await picture(page);
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) === 1);
  assert.notEqual(await picture(page), still);
  await page.locator(".options input").nth(1).check();  // from nearby: discs and arrows
  await page.screenshot({ path: join(out, "quadrotor.png") });
  // The arrows show the thrusts alone: the picture of the same moment without thrust has none.
  const arrows = await picture(page);
  await page.close();
  changeFlight(file, details, (flight) => flight.vehicle.rotors.forEach((rotor) => (rotor.force_max_n = 0)));
  const without = await openFlight(file, name);
  await without.keyboard.press("Shift+ArrowRight");
  await without.locator(".options input").nth(1).check();
  assert.notEqual(await picture(without), arrows);
  await without.close();
});

check("100 flights of a minute with faults take less than 15 MB", async () => {
  const file = join(out, "minute.yaml");
  writeFileSync(file, `name: minute\nduration_s: 60\nfirmware: tolerant\nreference: {type: spiral, turns_count: 3, radius_m: 5, height_m: 10, start_m: [2, 0, 0.5], velocity: true}\nfaults:
  - {id: errors, type: wire.bit_error, target: to_client, start_s: 5, end_s: 55, parameters: {ber: 0.0001}}
  - {id: weak, type: actuator.loss_of_effectiveness, start_s: 20, end_s: 40, parameters: {actuator: f_r, factor: 0.98}}
criteria:
  - {name: on-path, stl: "always(position_error_m <= 1)"}
  - {name: upright, stl: "always(tilt_rad <= 0.6)"}\n`);
  const one = fly("minute", file, "--no-report");
  const folder = readdirSync(one.run).find((entry) => existsSync(join(one.run, entry, "trace.csv")));
  const results = JSON.parse(readFileSync(join(one.run, "results.json"), "utf8"));
  const run = join(out, "hundred");
  mkdirSync(run);
  cpSync(join(one.run, "run.json"), join(run, "run.json"));
  const names = Array.from({ length: 100 }, (_, i) => `${folder}-${i}`);
  for (const name of names) {
    mkdirSync(join(run, name));
    for (const file of readdirSync(join(one.run, folder))) linkSync(join(one.run, folder, file), join(run, name, file));
  }
  const [flight] = results.scenarios;
  writeResults(run, { ...results, scenarios: names.map((name) => ({ ...flight, name })) });
  assert.ok(flight.metrics["survival.time_s"] >= 59.9 && flight.faults.some((fault) => fault.activations > 100), JSON.stringify(flight.faults));
  report(run);
  const { size } = statSync(join(run, "report.html"));
  assert.ok(size > 1e6 && size < 15e6, `${size} bytes`);
  const begin = performance.now();
  const page = await open(join(run, "report.html"));
  assert.equal(await page.locator(".flights tbody tr").count(), 100);
  console.log(`        ${(size / 1e6).toFixed(1)} MB, its table after ${((performance.now() - begin) / 1000).toFixed(2)} s`);
  await page.close();
});

readerChecks({ check, open, openFlight, fly, report, now, picture, flown, lost, out, source, writeResults });

// The page of an envelope.

const HOVER = `name: base
duration_s: 4
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: probe, type: harness.null, start_s: 1, end_s: 3}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
  - {name: upright, stl: "always(tilt_rad <= 0.6)"}
`;
const envelopes = join(out, "envelope");
mkdirSync(envelopes);
writeFileSync(join(envelopes, "base.yaml"), HOVER);
const envelope = (folder, ...options) => execFileSync(tiltproof, ["envelope", join(envelopes, "base.yaml"), "--tolerance", "0.3", "--repeats", "2", "--firmware", "paper,tolerant", "-j", "2", "--out", folder, "--no-progress", ...options], { encoding: "utf8" });
const kept = join(envelopes, "kept");
const told = envelope(kept, "--types", "frame.drop,actuator.loss*", "--keep");
const found = JSON.parse(readFileSync(join(kept, "envelope.json"), "utf8"));
const placeOf = (row) => (row.target ?? row.signal ?? row.actuator ?? "") + ({ positive: "+", negative: "−" }[row.side] ?? "");
const rowOf = (page, row) => page.locator(`tr[data-type="${row.type}"][data-place="${placeOf(row)}"]`);

check("an envelope has a page with a bar for each margin", async () => {
  assert.match(told, /report: .*envelope\.html/);
  assert.ok(!/report: /.test(envelope(join(envelopes, "without"), "--types", "device.reset", "--no-report")));
  assert.ok(!existsSync(join(envelopes, "without/envelope.html")));
  const page = await open(join(kept, "envelope.html"));
  assert.equal(await page.locator("tr[data-type]").count(), found.rows.length / 2);
  for (const row of found.rows) {
    const line = rowOf(page, row), which = found.clients.indexOf(row.client);
    const label = await line.locator("svg").getAttribute("aria-label");
    const text = await line.locator("td.level").nth(which).locator("b").textContent();
    assert.equal(text, row.survives === null ? "none" : row.fails === null ? "all" : String(Number(row.survives.toPrecision(4))), label);
    // The bar is as long as the level says, by a formula of its own: distance from harmless, or decades above a millionth.
    const all = await line.locator("rect.margin").nth(which).evaluate((bar) => bar.getAttribute("width") / (bar.ownerSVGElement.viewBox.baseVal.width - 4));
    const share = row.fails === null ? 1 : row.scale === "linear" ? (row.survives - row.harmless) / (row.severest - row.harmless) : 1 + Math.log10(row.survives / row.severest) / 6;
    assert.ok(Math.abs(all - share) < 0.01, `${label}: ${all} is ${share}`);
  }
  // Where a bar goes on behind levels that failed: at the beginnings of stretches of survived levels.
  for (const line of await page.locator("tr[data-type]").all()) {
    const [type, place] = [await line.getAttribute("data-type"), await line.getAttribute("data-place")];
    const rows = found.rows.filter((row) => row.type === type && (row.target ?? row.actuator) === place);
    const again = rows.flatMap(({ levels }) => levels.filter(([, survived], i) => survived && i > 0 && levels[i - 1][1] === false));
    assert.equal(await line.locator("rect.again").count(), again.length, `${type} ${place}`);
    assert.equal(again.length, rows.flatMap((row) => row.pockets).length);
  }
  await page.screenshot({ path: join(out, "envelope-light.png"), fullPage: true });
  await page.close();
});

check("ratios are those of the survival tables", async () => {
  const script = "import sys, json, pathlib; sys.path.insert(0, sys.argv[1]); import tables; rows = {}; tables.read_envelope(pathlib.Path(sys.argv[2]), 0, '', [], rows, {}); print(json.dumps([[k[0], k[1].replace('-', '\u2212'), r.halves[0].ratio] for k, r in rows.items()]))";
  const ratios = JSON.parse(execFileSync("python3", ["-B", "-c", script, join(source, "scenarios/envelope"), join(kept, "envelope.json")], { encoding: "utf8" }).replaceAll("Infinity", "1e999"));
  const page = await open(join(kept, "envelope.html"));
  for (const [type, place, ratio] of ratios) {
    const text = await rowOf(page, { type, target: place }).locator("td.ratio").textContent();
    assert.ok(ratio > 1e300 ? text === "∞" : Math.abs(parseFloat(text) - ratio) <= 0.006 * ratio, `${type} ${place}: ${text} is ${ratio}`);
  }
  const order = () => page.locator("td.ratio").allTextContents().then((all) => all.map((text) => (text === "∞" ? Infinity : parseFloat(text))));
  await page.click("thead button >> text=Ratio");
  assert.deepEqual(await order(), (await order()).sort((a, b) => a - b));
  await page.selectOption(".filters select >> nth=0", "frame");
  assert.equal(await page.locator("tr[data-type]").count(), 4);
  await page.selectOption(".filters select >> nth=0", "");
  await page.selectOption(".filters select >> nth=1", "actuator.loss_of_effectiveness");
  assert.equal(await page.locator("tr[data-type]").count(), 2);
  await page.fill("input[type=search]", "tau_r");
  assert.equal(await page.locator("tr[data-type]").count(), 1);
  await page.close();
});

check("both sides of a margin are a flight, and a command", async () => {
  const row = found.rows.find((r) => r.client === "paper" && r.target === "both");
  const page = await open(join(kept, "envelope.html"));
  const links = rowOf(page, row).locator("td.level").first().locator("a");
  assert.deepEqual(await links.allTextContents(), ["survived", "failed"]);
  for (const [i, verdict, level, seed] of [[0, "pass", row.survives, found.seed], [1, "fail", row.fails, row.seed]]) {
    await links.nth(i).click();
    await page.waitForSelector("#criteria");
    assert.match(await page.locator("h1").textContent(), /paper-frame\.drop-both/);
    const [name, flown] = await page.evaluate(() => { const run = JSON.parse(document.getElementById("run").textContent); const name = decodeURIComponent(location.hash.slice(8)); return [name, run.flights.find((f) => f.name === name)]; });
    assert.deepEqual([flown.verdict, flown.seed], [verdict, seed]);
    assert.ok(readFileSync(join(kept, "levels/paper", `${name}.yaml`), "utf8").includes(`probability: ${level}`), `${level}`);
    if (verdict === "fail") assert.equal(flown.reason, row.reason);
    await page.goBack();
    await page.waitForSelector(".margins");
  }
  await rowOf(page, row).locator("button.open").click();
  const commands = await page.locator(".sides section").first().locator("code").allTextContents();
  assert.equal(commands.length, 2);
  const told = await page.locator(".sides section").first().textContent();
  assert.match(told, /2 of 2 seeds pass at each level up to the limit: 95 % sure that at least 22 % of all seeds do\./);
  assert.ok(told.includes(`${row.levels.length} levels were flown`), told);
  for (const [i, verdict] of [[0, "PASS"], [1, "FAIL (expected)"]]) {
    const flown = spawnSync("/bin/sh", ["-c", `${commands[i]} --out ${join(envelopes, "again")} --no-report`], { encoding: "utf8" });
    assert.equal(flown.status, 0, flown.stderr);
    assert.ok(flown.stdout.includes(`\n${verdict} `), flown.stdout);
  }
  await page.screenshot({ path: join(out, "envelope-sides.png") });
  await page.close();
  // Kept flights of other levels than those of the table are not shown.
  const side = join(kept, "levels/paper/paper-frame.drop-both-fails.yaml"), text = readFileSync(side, "utf8");
  writeFileSync(side, text.replace(`probability: ${row.fails}`, "probability: 1"));
  report(kept, "--out", join(out, "elsewhere.html"));
  writeFileSync(side, text);
  const other = await open(join(out, "elsewhere.html"));
  assert.deepEqual(await rowOf(other, row).locator("td.level").first().locator("a").allTextContents(), ["survived"]);
  await rowOf(other, row).locator("td.level a").first().click();  // the way from another folder
  await other.waitForSelector("#criteria");
  await other.close();
});

// As large as that of all types, and in it what no search would find.
function madeUp(folder, count, change) {
  mkdirSync(folder);
  const rows = Array.from({ length: count }, (_, i) => found.clients.map((client, j) => ({ ...found.rows[0], type: `layer${i % 9}.type${i >> 2}`, target: `place${i % 4}`, client, survives: 10 ** -(1 + ((i * 7 + j) % 5)), fails: 1.1 * 10 ** -(1 + ((i * 7 + j) % 5)) }))).flat();
  writeFileSync(join(folder, "envelope.json"), JSON.stringify(change({ ...found, rows })));
  report(folder);
  return join(folder, "envelope.html");
}

check("258 margins of two firmwares, dark and small", async () => {
  const file = madeUp(join(envelopes, "large"), 258, (all) => ({ ...all, tolerance: 0.01 }));
  assert.ok(readFileSync(file).length < 1000000);
  const page = await open(file, { colorScheme: "dark" });
  assert.equal(await page.locator("rect.margin").count(), 516);
  const less = await page.locator("tr.worse-row").count();
  assert.ok(less > 0);
  assert.equal(less, await page.locator("span.less").count());
  await page.selectOption(".filters select >> nth=2", "less");
  assert.equal(await page.locator("tr[data-type]").count(), less);
  await page.screenshot({ path: join(out, "envelope-dark.png") });
  const colours = () => page.locator("rect.margin").evaluateAll((all) => all.slice(0, 2).map((bar) => bar.getAttribute("fill")));
  const dark = await colours();
  await page.click("button.theme");
  assert.notDeepEqual(await colours(), dark);
  assert.equal(await page.locator("tr[data-type]").count(), less, "the reader's filter stays");
  await page.setViewportSize({ width: 700, height: 900 });
  await page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth, null, { timeout: 5000 });
  await page.close();
});

check("residual errors have a page with a curve for each kind of damage", async () => {
  const file = join(out, "integrity.html");
  const text = execFileSync(tiltproof, ["integrity", "--errors", "burst,swap", "--check", "fletcher16,crc32_iso_hdlc", "--frames", "20000", "--page", file, "--format", "json"], { encoding: "utf8" });
  const { rows } = JSON.parse(text);
  const page = await open(file);
  assert.equal(await page.locator("svg.curves").count(), 2);
  assert.equal(await page.locator(".rates tbody tr").count(), rows.length);
  const burst = page.locator('[data-errors="burst"] svg');
  // Every rate above 0 has a point in both lines, and every 0 a triangle.
  const own = rows.filter((row) => row.errors === "burst");
  const above = own.flatMap((row) => [row.rate, row.passed_check_rate]).filter((rate) => rate > 0).length;
  assert.equal(await burst.locator("circle").count(), above);
  assert.equal(await burst.locator("path.none").count(), 2 * own.length - above);
  await page.screenshot({ path: join(out, "integrity-light.png"), fullPage: true });
  await page.close();
});

// A summary as a campaign writes it. `change` gets it, and what it returns is the file.
function campaignPage(name, change = (summary) => summary) {
  const rate = (passed, failed) => ({ flights: passed + failed, passed, failed, rate: passed + failed > 0 ? passed / (passed + failed) : null, low: passed + failed > 0 ? 0.2 : null, high: passed + failed > 0 ? 0.9 : null });
  const bands = [0, 1, 2, 3].map((band) => ({ band, ...rate(4 - band, band) }));
  const failures = [["near", "diverged", ["wire.drop", "clock.drift"], 5], ["upright", "completed", ["wire.drop"], 3], ["survival", "firmware_crashed", [], 1]].map(([criterion, end, types, flights], i) => ({ signature: `${criterion},${end},${types.join("+") || "no_fault"}`, criterion, end, types, flights, first_run: 10 * i, runs: [10 * i], ...(i === 0 ? { minimal: "failures/first/run-0.yaml" } : {}) }));
  const summary = { format: 1, version: "0", campaign: "night", seed: 7, runs: 40, flown: 40, complete: true, ...rate(31, 9), inconclusive: 0, errors: 0, signatures: 3, by_firmware: [{ name: "paper", ...rate(31, 9) }], by_scenario: [{ name: "hover", ...rate(31, 9) }],
    by_type: [{ type: "wire.drop", drawn: 20, activated: 15, ...rate(10, 8), bands }, { type: "clock.drift", drawn: 0, activated: 0, ...rate(0, 0), bands }], by_severity: bands, failures, curve: [[1, 1], [11, 2], [21, 3], [40, 3]],
    coverage: { cells: 20, drawn: 12, covered: 7, rows: [{ type: "wire.drop", place: "to_plant", drawn: 20, activated: 15, cells: [[1, 0, 2, 0], [0, 0, 0, 0], [1, 1, 1, 1], [0, 0, 0, 3]] }, { type: "clock.drift", place: "", drawn: 0, activated: 0, cells: [[0], [0], [0], [0]] }] } };
  const folder = join(out, "campaigns", name);
  mkdirSync(join(folder, "failures", "first"), { recursive: true });
  writeFileSync(join(folder, "failures", "first", "run-0.yaml"), "");
  writeFileSync(join(folder, "campaign.json"), JSON.stringify(change(summary)));
  report(folder);
  return join(folder, "campaign.html");
}

check("a campaign has a page with its ways to fail, types, curve and coverage", async () => {
  const page = await open(campaignPage("plain"));
  assert.deepEqual(await page.locator(".count b").allTextContents(), ["40", "31", "9", "3"]);
  assert.deepEqual(await page.locator(".failures th[scope=row]").allTextContents(), ["▸ near", "▸ upright", "▸ survival"]);
  // Steps: right to each run, up to the number of ways to fail then.
  const steps = (await page.locator("path.step").getAttribute("d")).match(/[HV][\d.]+/g);
  assert.equal(steps.length, 8);
  await page.fill(".filters input >> nth=0", "clock");
  assert.equal(await page.locator(".failures tbody tr[data-signature]").count(), 1);
  await page.locator(".failures button.open").click();
  assert.match(await page.locator(".failures tr.more").textContent(), /campaign show .*plain 0/);
  assert.equal(await page.locator(".failures a", { hasText: "smallest scenario" }).getAttribute("href"), "./failures/first/run-0.yaml");
  assert.equal(await page.locator(".coverage .cell.hit").count(), 7);
  assert.match(await page.locator(".types tr[data-type='clock.drift']").textContent(), /–/);
  await page.screenshot({ path: join(out, "campaign-light.png"), fullPage: true });
  await page.close();
});

check("a campaign shows where another client differs", async () => {
  const flight = (verdict, criterion, time_s, margin) => ({ verdict, criterion, time_s, margin });
  const rows = [
    { run: 3, signature: "near,completed,wire.drop", campaign: flight("fail", "near", 3.5, -0.2), confirmed: flight("fail", "near", 3.512, -0.19), same: true },
    { run: 17, signature: "", campaign: flight("pass", "", null, 0.004), confirmed: flight("fail", "<img src=x>", 2, -1), same: false },
  ];
  const page = await open(campaignPage("confirmed", (all) => ({ ...all, confirmed: [{ client: "qemu:night.elf", flights: 2, same: 1, differ: 1, rows }] })));
  assert.match(await page.locator("main").textContent(), /Confirmed by qemu:night.elf1 of 2 flights have the same verdict/);
  assert.deepEqual(await page.locator(".confirmed tbody th").allTextContents(), ["3", "17"]);
  await page.locator(".filters select").filter({ hasText: "another" }).selectOption("other");
  assert.deepEqual(await page.locator(".confirmed tbody th").allTextContents(), ["17"]);
  assert.match(await page.locator(".confirmed tbody tr").textContent(), /pass.*fail <img src=x> at 2 s/);
  assert.equal(await page.locator("main img").count(), 0);
  await page.close();
});

check("a campaign with hostile names, and one without a run", async () => {
  const page = await open(campaignPage("hostile", (all) => ({ ...all, campaign: EVIL, complete: false, failures: all.failures.map((group) => ({ ...group, criterion: EVIL, end: EVIL, types: [EVIL] })), by_type: all.by_type.map((rate) => ({ ...rate, type: EVIL })), by_firmware: [{ ...all.by_firmware[0], name: EVIL }] })));
  for (const button of await page.locator("button.open").all()) await button.click();
  assert.match(await page.locator("main").textContent(), /still under way/);
  assert.equal(await page.evaluate(() => window.executed), undefined);
  assert.equal(await page.locator("main img, main script").count(), 0);
  await page.close();
  const empty = await open(campaignPage("empty", (all) => ({ ...all, flown: 0, flights: 0, passed: 0, failed: 0, rate: null, low: null, high: null, signatures: 0, failures: [], by_type: [], by_firmware: [], by_scenario: [], curve: [], coverage: { cells: 0, drawn: 0, covered: 0, rows: [] } })));
  assert.match(await empty.locator("main").textContent(), /No flight failed/);
  assert.ok(!/NaN|undefined/.test(await empty.locator("main").textContent()));
  await empty.close();
});

check("an envelope with hostile names, odd numbers, and little in it", async () => {
  const odd = (all) => {
    all.rows.forEach((row, i) => Object.assign(row, { type: EVIL.replaceAll("/", ""), target: EVIL.replaceAll("/", "") + i, client: EVIL, parameter: EVIL, unit: EVIL, reason: EVIL, first_criterion: EVIL }));
    const [none, everything, error, zero, towards, infinite] = all.rows;
    Object.assign(none, { survives: null });
    Object.assign(everything, { fails: null, survives: 1 });
    Object.assign(error, { survives: null, fails: null, error: EVIL });
    Object.assign(zero, { survives: 0, fails: 0, mildest: 0, severest: 0, harmless: 0 });
    Object.assign(towards, { mildest: 1e6, harmless: 1e6, severest: 0, survives: 0, fails: null });
    Object.assign(infinite, { scale: "linear", mildest: 0, severest: 1e308, survives: -5, fails: 1e300 });
    return { ...all, scenario: EVIL, clients: [EVIL], columns: { [EVIL]: { scenario: EVIL, flags: EVIL, build: EVIL } }, complete: false, not_applicable: [{ type: EVIL, place: EVIL, client: EVIL, reason: EVIL }],
      map: [{ client: EVIL, x: { type: EVIL, parameter: EVIL, unit: EVIL, levels: [1, 2] }, y: { type: EVIL, parameter: EVIL, unit: EVIL, levels: [1] }, survived: [[true, null]] }] };
  };
  const page = await open(madeUp(join(envelopes, "hostile"), 10, odd));
  assert.match(await page.locator("main").textContent(), /not complete/);
  for (const button of await page.locator("button.open").all()) await button.click();
  assert.deepEqual((await page.locator("td.level b").allTextContents()).slice(0, 2), ["none", "all"]);
  assert.equal(await page.evaluate(() => window.executed), undefined);
  assert.equal(await page.locator("main img, main script").count(), 0);
  assert.ok(!(await page.locator("svg").evaluateAll((all) => all.some((figure) => /NaN|Infinity/.test(figure.outerHTML.replaceAll(/aria-label="[^"]*"/g, ""))))));
  await page.screenshot({ path: join(out, "envelope-hostile.png") });
  await page.close();
  const empty = await open(madeUp(join(envelopes, "empty"), 0, (all) => all));
  assert.match(await empty.locator("main").textContent(), /no rows/);
  await empty.close();
  const damaged = join(envelopes, "damaged");
  mkdirSync(damaged);
  writeFileSync(join(damaged, "envelope.json"), "{}");
  const refused = spawnSync(tiltproof, ["report", damaged], { encoding: "utf8" });
  assert.deepEqual([refused.status, /is not an envelope/.test(refused.stderr)], [3, true], refused.stderr);
});

// The live page.

// Starts a command that serves a live page.
function serve(...options) {
  const child = spawn(tiltproof, options, { cwd: out });
  let told = "";
  const address = new Promise((resolve, reject) => {
    child.stderr.on("data", (piece) => {
      told += piece;
      const found = /http:\/\/127\.0\.0\.1:\d+\/\S*/.exec(told);
      if (found) resolve(found[0]);
    });
    child.on("exit", () => reject(new Error(`no page: ${told}`)));
  });
  const ended = new Promise((resolve) => child.on("exit", (code) => resolve(code)));
  return { child, address, ended };
}

const LIVE = `name: live-circle
description: A circle, with a weak rotor on the way.
duration_s: 60
reference: {type: circle, radius_m: 2, period_s: 12, start_m: [2, 0, 2]}
faults:
  - {id: weak, type: actuator.loss_of_effectiveness, start_s: 3, parameters: {actuator: f_r, factor: 0.99}}
criteria:
  - {name: near, stl: "always(position_error_m <= 2.0)"}
`;

check("a run is shown while it is flown, and obeys its buttons", async () => {
  writeFileSync(join(out, "live-circle.yaml"), LIVE);
  const { child, address, ended } = serve("run", "live-circle.yaml", "--mode", "realtime", "--live", "0", "--live-wait", "--repeat", "5", "--out", "live");
  try {
    const page = await open(await address);
    assert.ok(!page.url().includes("token"), page.url());
    assert.match(await page.locator("h1").textContent(), /waits/);
    const other = await open((await address).replace(/#.*/, ""));
    await other.waitForSelector("text=To look only");
    assert.equal(await other.locator(".controls").count(), 0);
    await other.close();
    await page.click("button.start");
    await page.waitForSelector("#plot-position canvas", { timeout: 60000 });
    // Figures are there before the flight begins, and until then it refuses every fault.
    await page.waitForFunction(() => document.querySelector("progress").value > 0.5, null, { timeout: 60000 });
    await page.fill(".controls textarea", "{type: frame.dorp, target: to_client}");
    await page.click("button.inject");
    await page.waitForSelector(".said.refused >> text=frame.drop");
    await page.fill(".controls textarea", "{id: by-hand, type: frame.drop, target: to_client, duration_s: 5, parameters: {probability: 0.1}}");
    await page.click("button.inject");
    await page.waitForSelector(".fault-list >> text=by-hand");
    await page.waitForSelector(".said >> text=by-hand acts from");
    const rows = () => page.locator("progress").evaluate((bar) => bar.value);
    const first = await rows();
    const still = await picture(page);
    await page.waitForFunction((before) => document.querySelector("progress").value > before + 1, first, { timeout: 60000 });
    assert.notEqual(await picture(page), still);
    await page.waitForSelector("text=active now", { timeout: 60000 });
    await page.waitForFunction(() => document.querySelector("progress").value > 6, null, { timeout: 60000 });
    // The reader looks back, and follows again.
    await page.keyboard.press("Home");
    assert.equal(await now(page), 0);
    await page.waitForTimeout(600);
    assert.equal(await now(page), 0);
    await page.click("button.newest");
    await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) > 6);
    await page.screenshot({ path: join(out, "live-light.png") });
    await page.click("button.theme");
    await page.waitForSelector("#plot-position canvas");
    await page.waitForTimeout(500);
    await page.screenshot({ path: join(out, "live-dark.png") });
    await page.click("button.abort");
    await page.click("button.abort");
    assert.equal(await ended, 130);
    await page.waitForSelector("text=The run has ended.");
    assert.match(await page.locator("h1").textContent(), /inconclusive|error|fail|pass/);
    await page.waitForSelector(".fault-list >> text=active to the end");
    assert.ok(!/active now/.test(await page.locator(".fault-list").textContent()));
    await page.close();
  } finally {
    child.kill("SIGKILL");
  }
});

let failed = 0;
const chosen = checks.filter((one) => wanted.test(one.name));
for (const { name, body } of chosen) {
  const before = troubles.length, began = performance.now();
  const took = () => `${((performance.now() - began) / 1000).toFixed(1)} s`.padStart(7);
  try {
    await body();
    assert.deepEqual(troubles.slice(before), [], "errors in the browser");
    console.log(`ok     ${took()}  ${name}`);
  } catch (error) {
    ++failed;
    console.log(`FAILED ${took()}  ${name}\n${error.stack}`);
  }
}
await browser.close();
const outside = requests.filter((url) => !url.startsWith("file://") && !/^http:\/\/127\.0\.0\.1:\d+\/(events|abort|start|inject|flights\/\d+)?(#.*)?$/.test(url));
if (outside.length > 0) {
  ++failed;
  console.log(`FAILED  nothing is loaded from anywhere\n${outside.join("\n")}`);
}
console.log(`${chosen.length - failed} of ${chosen.length} checks passed; screenshots in ${out}`);
process.exit(failed === 0 ? 0 : 1);
