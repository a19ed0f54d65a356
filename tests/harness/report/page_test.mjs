// Opens reports in Chromium and checks what a reader sees, that nothing executes that should not, and that nothing is
// loaded from anywhere.
//
// Usage: node page_test.mjs TILTPROOF SOURCE_DIR OUT_DIR    screenshots stay in OUT_DIR
import assert from "node:assert/strict";
import { execFileSync, spawnSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const [tiltproof, source, out] = process.argv.slice(2).map((path) => resolve(path));
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

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
const troubles = [];
const requests = [];

async function open(file, options = {}) {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 }, colorScheme: "light", ...options });
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && !/GPU stall|GL Driver|status of 400/.test(message.text()) && troubles.push(`${file}: ${message.text()}`));
  page.on("pageerror", (error) => troubles.push(`${file}: ${error.stack}`));
  page.on("dialog", (dialog) => troubles.push(`${file}: dialog ${dialog.message()}`));
  page.on("request", (request) => requests.push(request.url()));
  await page.goto(/^http:/.test(file) ? file : `file://${file}`);
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
  assert.ok(flown.text.trimEnd().split("\n").slice(-2).some((line) => line.includes(flown.page)), flown.text);
  const without = fly("without", join(source, "scenarios/paper/hover.yaml"), "--no-report");
  assert.ok(!existsSync(without.page));
});

check("the summary lists, finds and sorts flights", async () => {
  const page = await open(flown.page);
  const names = () => page.locator(".flights tbody th").allTextContents();
  assert.deepEqual(await names(), [lost, "paper-spiral-velocity"]);  // the least margin first
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
  assert.ok(await page.locator(".frame.damaged >> nth=0").isVisible());
  await page.screenshot({ path: join(out, "frames-light.png") });
  await page.keyboard.press("Home");
  await page.waitForSelector("#frames >> text=tiltproof link-dump");
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
  writeFileSync(join(run, "results.json"), JSON.stringify(results));
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
  writeFileSync(join(run, "results.json"), JSON.stringify({ ...results, scenarios: [] }));
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
  - {id: weak, type: actuator.loss_of_effectiveness, start_s: 3, end_s: 50, parameters: {actuator: f_r, factor: 0.99}}
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
    await page.close();
  } finally {
    child.kill("SIGKILL");
  }
});

let failed = 0;
for (const { name, body } of checks) {
  const before = troubles.length;
  try {
    await body();
    assert.deepEqual(troubles.slice(before), [], "errors in the browser");
    console.log(`ok      ${name}`);
  } catch (error) {
    ++failed;
    console.log(`FAILED  ${name}\n${error.stack}`);
  }
}
await browser.close();
const outside = requests.filter((url) => !url.startsWith("file://") && !/^http:\/\/127\.0\.0\.1:\d+\/(events|abort|start|inject|flights\/\d+)?(#.*)?$/.test(url));
if (outside.length > 0) {
  ++failed;
  console.log(`FAILED  nothing is loaded from anywhere\n${outside.join("\n")}`);
}
console.log(`${checks.length - failed} of ${checks.length} checks passed; screenshots in ${out}`);
process.exit(failed === 0 ? 0 : 1);
