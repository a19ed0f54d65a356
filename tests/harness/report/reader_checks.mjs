// Checks of page_test.mjs that follow a reader: where a flight opens, what a link to it holds, what stands at the cursor,
// what is printed, which plots and flights are added, and how many flights are found.
import assert from "node:assert/strict";
import { cpSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const HOVER = `duration_s: 6
reference: {type: hover, at_m: [0, 0, 2]}
firmware: tolerant
faults:
  - {id: late, type: frame.delay, target: to_client, start_s: 3, end_s: 5, parameters: {mean_ms: 4}}
`;
// It begins 0.3 m beside the reference: nearest to the first bound before the fault, and then always far from it.
const TOUCHED = `name: touched\n${HOVER}initial: {position_m: [0.3, 0, 2]}
criteria:
  - {name: at-first, stl: "always(position_error_m <= 0.31)"}
  - {name: later, stl: "always[3,6](position_error_m <= 0.5)"}
  - {name: arrives, stl: "eventually[1,6](position_error_m <= 0.25)"}
`;

export function readerChecks({ check, open, openFlight, fly, report, now, picture, flown, lost, out, source, writeResults }) {
  const passed = "paper-spiral-velocity";
  const criterion = (page, name) => page.locator("#criteria tbody tr", { has: page.locator("th", { hasText: new RegExp(`^${name}$`) }) });
  const stateAt = (page, name) => criterion(page, name).locator(".state").textContent();
  const verdict = JSON.parse(readFileSync(join(flown.run, lost, "verdict.json"), "utf8"));
  const violated = verdict.criteria.filter((c) => c.verdict === "fail" && c.time_s !== null).sort((a, b) => a.time_s - b.time_s)[0];
  const trace = readFileSync(join(flown.run, lost, "trace.csv"), "utf8").trimEnd().split("\n").map((line) => line.split(","));
  const hash = (page) => page.evaluate(() => location.hash);
  const goTo = (page, time_s) => page.locator(".player input[type=range]").evaluate((slider, t) => { slider.value = t; slider.dispatchEvent(new Event("input")); }, time_s);

  check("a failed flight opens at its first violation, the others at their start", async () => {
    const page = await open(`${flown.page}#flight=${lost}`);
    await page.waitForSelector("#plot-error canvas");
    assert.ok(Math.abs((await now(page)) - violated.time_s) < 1e-3, `${await now(page)} is ${violated.time_s}`);
    const opened = await picture(page);
    // The cursor of the plots is there, and in sight.
    const [cursor, over] = await page.locator("#plot-error").evaluate((plot) => [".u-cursor-x", ".u-over"].map((part) => plot.querySelector(part).getBoundingClientRect().toJSON()));
    const share = violated.time_s / Number(trace.at(-1)[0]);
    assert.ok(Math.abs(cursor.left - (over.left + share * over.width)) < 3, `${cursor.left}: ${share} of ${over.width} from ${over.left}`);
    await page.keyboard.press("Home");
    assert.notEqual(await picture(page), opened);
    await page.keyboard.press("j");
    assert.equal(await picture(page), opened);
    await page.close();
    const other = await open(`${flown.page}#flight=${passed}`);
    await other.waitForSelector("#criteria");
    assert.equal(await now(other), 0);
    await other.close();
  });

  check("the address holds the flight and the time, and opens them again", async () => {
    const page = await open(`${flown.page}#flight=${lost}&t=1.5`);
    await page.waitForSelector("#criteria");
    assert.equal(await now(page), 1.5);
    const build = await page.locator("#criteria").elementHandle();
    await page.keyboard.press("ArrowRight");
    await page.waitForFunction((wanted) => location.hash === wanted, `#flight=${lost}&t=1.6`);
    await page.keyboard.press(" ");
    await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) > 1.7);
    await page.keyboard.press(" ");
    const stopped = await now(page);
    await page.waitForFunction((t) => location.hash.endsWith(`&t=${t}`), stopped);
    // Another time of the same flight: nothing is built again.
    await page.evaluate((name) => (location.hash = `#flight=${name}&t=2.25`), lost);
    await page.waitForFunction(() => parseFloat(document.querySelector(".now").textContent) === 2.25);
    assert.ok(await build.evaluate((element) => element.isConnected));
    await page.click("nav a");
    await page.waitForSelector(".flights");
    // The table has a link to the time of the first violation.
    const link = page.locator(".flights tbody tr", { hasText: lost }).locator("td a");
    assert.equal(await link.getAttribute("href"), `#flight=${lost}&t=${violated.time_s}`);
    await page.goBack();
    await page.waitForSelector("#criteria");
    assert.equal(await now(page), 2.25);
    // Links of older reports.
    await page.evaluate(() => (location.hash = "#flight-1"));
    await page.waitForFunction((name) => location.hash === `#flight=${name}`, passed);
    await page.waitForSelector(`h1 >> text=${passed}`);
    // The way past the header leaves the address alone.
    await page.locator(".skip").focus();
    await page.keyboard.press("Enter");
    assert.equal(await hash(page), `#flight=${passed}`);
    assert.equal(await page.evaluate(() => document.activeElement.id), "main");
    await page.close();
  });

  check("an address that names no flight or no time says so", async () => {
    const page = await open(`${flown.page}#flight=nope&t=3`);
    const say = async (address, words, selector) => {
      await page.evaluate((wanted) => (location.hash = wanted), address);
      await page.waitForSelector(`[role=alert] >> text=${words}`);
      assert.ok((await page.locator(selector).count()) > 0, address);
    };
    await say("#flight=nope&t=3", "no flight “nope”", ".flights tbody tr");
    await say("#flight-99", "no flight number 99: it has 2", ".flights tbody tr");
    await say("#flight=%E0%A4%A", "no flight “%E0%A4%A”", ".flights tbody tr");
    await say(`#flight=${lost}&t=soon`, "t=soon, which is no number of seconds", "#criteria");
    assert.ok(Math.abs((await now(page)) - violated.time_s) < 1e-3);
    assert.equal(await hash(page), `#flight=${lost}`);
    await say(`#flight=${lost}&t=99999`, "t=99999, but this flight lasts from 0 to", "#criteria");
    await say(`#flight=${lost}&t=-1`, "t=-1, but this flight lasts from 0 to", "#criteria");
    assert.equal(await page.locator(".wrong-time").count(), 1);
    await say(`#flight=${lost}&plot=x_m,nothing_m`, "no signal “nothing_m”", "#criteria");
    await say(`#flight=${lost}&with=nobody`, "no other flight “nobody”", "#criteria");
    await page.close();
  });

  check("criteria stand at the cursor as the trace has them", async () => {
    const page = await openFlight(flown.page, lost);
    const column = (row, name) => Number(row[trace[0].indexOf(name)]);
    const error_m = (row) => Math.hypot(...["x", "y", "z"].map((axis) => column(row, `${axis}_m`) - column(row, `${axis}_ref_m`)));
    const value = async (name) => parseFloat((await criterion(page, name).locator(".now-at .n").textContent()).replace("−", "-"));
    const rowAt = (t) => trace.slice(1).findLast((row) => Number(row[0]) <= t + 1e-9);
    for (const [t, before, on_path] of [[0, "not yet judged", "not yet judged"], [9, "holds", "not yet judged"], [10.2, "holds", "holds"], [violated.time_s, "holds", null]]) {
      await goTo(page, t);
      assert.equal(await stateAt(page, "fine-before-the-fault"), before, `at ${t} s`);
      if (on_path) assert.equal(await stateAt(page, "stays-on-path"), on_path, `at ${t} s`);
    }
    assert.equal(await stateAt(page, violated.name), "violated");
    const path = verdict.criteria.find((c) => c.name === "stays-on-path");
    for (const t of [8.4, 9.6]) {  // 0.2 m from the reference, in units of 1 m
      await goTo(page, t);
      assert.ok(Math.abs((await value("fine-before-the-fault")) - (0.2 - error_m(rowAt(await now(page))))) < 1e-3, `at ${t} s`);
    }
    await goTo(page, path.time_s);
    assert.equal(await stateAt(page, "stays-on-path"), "violated");
    assert.ok((await value("stays-on-path")) < 0);
    assert.equal(await stateAt(page, "survival"), verdict.criteria[0].time_s > path.time_s ? "holds" : "violated");
    assert.equal(await stateAt(page, "firmware-flies-blind"), "not yet judged");
    await page.keyboard.press("End");
    assert.equal(await stateAt(page, "firmware-flies-blind"), "holds");
    assert.equal(await stateAt(page, "survival"), "violated");
    await page.close();
  });

  const touchedFile = join(out, "touched.yaml"), calmFile = join(out, "calm.yaml");
  writeFileSync(touchedFile, TOUCHED);
  writeFileSync(calmFile, TOUCHED.replace("name: touched", "name: calm").replace("mean_ms: 4", "mean_ms: 1"));
  const two = fly("touched", touchedFile, calmFile);

  check("a flight's margin is that of a criterion that its fault can have changed", async () => {
    const { criteria } = JSON.parse(readFileSync(join(two.run, "touched/verdict.json"), "utf8"));
    const margin = Object.fromEntries(criteria.map((c) => [c.name, c.margin]));
    assert.ok(margin["at-first"] < margin.later && margin["at-first"] < margin.arrives, JSON.stringify(margin));
    const page = await open(two.page);
    const cell = page.locator(".flights tbody tr", { hasText: "touched" }).locator("td.n").first();
    assert.equal(await cell.getAttribute("title"), "Margin of later");
    assert.ok(Math.abs(parseFloat(await cell.textContent()) - margin.later) < 1e-3);
    assert.ok(two.text.includes(`margin ${Number(margin.later.toPrecision(3))}`), two.text);
    await page.click(".flights a >> text=touched");
    await page.waitForSelector("#criteria");
    assert.equal(await criterion(page, "at-first").locator(".untouched").count(), 1);
    assert.equal(await criterion(page, "later").locator(".untouched").count(), 0);
    // A criterion of something that must happen once is open until it happens.
    assert.equal(await stateAt(page, "arrives"), "not yet judged");
    await page.keyboard.press("End");
    assert.equal(await stateAt(page, "arrives"), "holds");
    await page.close();
  });

  check("margins that changed by less than 0.001 are the same", async () => {
    const results = JSON.parse(readFileSync(join(flown.run, "results.json"), "utf8"));
    const good = results.scenarios.find((f) => f.name === passed);
    const cases = [[0.0009, "", "same"], [-0.0009, "", "same"], [0.002, "worse", "−0.002"], [-0.002, "better", "+0.002"], [0.0009, "better", "was fail", "fail"]];
    const write = (name, change) => {
      const run = join(out, name);
      mkdirSync(run);
      cpSync(join(flown.run, "run.json"), join(run, "run.json"));
      writeResults(run, { ...results, scenarios: cases.map(([by, , , verdict], i) => change({ ...structuredClone(good), name: `case-${i}` }, by, verdict)) });
      return run;
    };
    const after = write("after", (flight) => flight);
    const before = write("before", (flight, by, verdict = "pass") => ({ ...flight, verdict, criteria: flight.criteria.map((c) => ({ ...c, margin: c.margin === null ? null : c.margin + by })) }));
    report(after, "--baseline", before);
    const page = await open(join(after, "report.html"));
    for (const [i, [by, kind, text]] of cases.entries()) {
      const cell = page.locator(".flights tbody tr", { hasText: `case-${i}` }).locator("td").last().locator("span");
      assert.deepEqual([await cell.getAttribute("class"), await cell.textContent()], [kind, text], `${by}`);
    }
    await page.close();
  });

  // Texts that a page writes on the canvas of a plot: [text, colour, left, top, right, bottom] in CSS pixels.
  const recorder = () => {
    window.written = new Map();
    const draw = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (text, x, y, ...rest) {
      const { actualBoundingBoxLeft: l, actualBoundingBoxRight: r, actualBoundingBoxAscent: a, actualBoundingBoxDescent: d } = this.measureText(text);
      const points = [[x - l, y - a], [x + r, y + d], [x - l, y + d], [x + r, y - a]].map(([px, py]) => this.getTransform().transformPoint(new DOMPoint(px, py)));
      const list = window.written.get(this.canvas) ?? [];
      list.push([text, this.fillStyle, Math.min(...points.map((p) => p.x)), Math.min(...points.map((p) => p.y)), Math.max(...points.map((p) => p.x)), Math.max(...points.map((p) => p.y))]);
      window.written.set(this.canvas, list);
      return draw.call(this, text, x, y, ...rest);
    };
    const clear = CanvasRenderingContext2D.prototype.clearRect;
    CanvasRenderingContext2D.prototype.clearRect = function (...all) { window.written.delete(this.canvas); return clear.apply(this, all); };
  };
  const written = () => [...document.querySelectorAll(".plot")].map((plot) => {
    const canvas = plot.querySelector("canvas");
    return { id: plot.id, width: canvas?.width ?? 0, height: canvas?.height ?? 0, texts: canvas ? (window.written.get(canvas) ?? []) : [], muted: getComputedStyle(document.documentElement).getPropertyValue("--muted").trim() };
  });
  const writtenOn = (page) => page.evaluate(written);
  const atPrint = `() => ({
    plots: (${written})(),
    exact: getComputedStyle(document.body).printColorAdjust, background: getComputedStyle(document.body).backgroundColor,
    times: [...document.querySelectorAll("button.time, .now")].filter((time) => !time.checkVisibility()).length,
    closed: document.querySelectorAll("details:not([open])").length,
    cut: [...document.querySelectorAll("main *")].filter((e) => /auto|scroll|hidden/.test(getComputedStyle(e).overflow) && !e.closest(".plot, .view, .replay") && (e.scrollHeight > e.clientHeight + 1 || e.scrollWidth > e.clientWidth + 1)).map((e) => e.className || e.tagName),
    wide: [...document.querySelectorAll("main *")].filter((e) => e.getBoundingClientRect().right > 701 && !e.closest(".plot, .view")).map((e) => e.className || e.tagName),
  })`;
  const drawAll = async (page) => {
    for (const figure of await page.locator(".plot").all()) await figure.scrollIntoViewIfNeeded();
    await page.waitForFunction(() => [...document.querySelectorAll(".plot")].every((plot) => window.written.has(plot.querySelector("canvas"))));
  };
  const checkAxes = (plots, where) => {
    assert.ok(plots.length >= 7, where);
    for (const { id, width, height, texts, muted } of plots) {
      const words = texts.map(([text]) => text);
      assert.ok(words.filter((text) => /^\d+(\.\d+)? s$/.test(text)).length >= 2, `${where} ${id}: ${words}`);
      assert.ok(words.filter((text) => text && !/ s$/.test(text)).length >= 3, `${where} ${id}: two values and a unit: ${words}`);
      const unit = { error: "m", position: "m", attitude: "rad", servos: "rad", thrusts: "N", torques: "N m", velocity: "m/s", robustness: "robustness", active: "faults" }[id.replace("plot-", "")];
      if (unit) assert.ok(words.includes(unit), `${where} ${id}: ${words}`);
      for (const [text, colour, left, top, right, bottom] of texts) {
        assert.ok(left >= -1 && top >= -1 && right <= width + 1 && bottom <= height + 1, `${where} ${id}: “${text}” is cut off: ${[left, top, right, bottom]} in ${width} x ${height}`);
        assert.equal(colour, muted, `${where} ${id}: ${text}`);
      }
    }
  };

  check("every plot has ticks with values and units, light and dark, wide and narrow", async () => {
    for (const [colorScheme, width] of [["light", 1440], ["dark", 390]]) {
      const page = await open("about:blank", { colorScheme, viewport: { width, height: 900 } }, async (page) => {
        await page.addInitScript(recorder);
        await page.goto(`file://${flown.page}#flight=${lost}`);
      });
      await page.waitForSelector("#criteria");
      await drawAll(page);
      checkAxes(await writtenOn(page), `${colorScheme} ${width}`);
      await page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth, null, { timeout: 5000 });
      // The letters of the histograms keep their size.
      for (const size of await page.locator(".histogram svg").evaluateAll((all) => all.map((figure) => (figure.getBoundingClientRect().width / figure.viewBox.baseVal.width) * parseFloat(getComputedStyle(figure).fontSize)))) assert.ok(size > 9, `${size} px`);
      assert.deepEqual(await page.locator(".histogram text >> text=/^(ms|count)$/").allTextContents(), ["ms", "count", "ms", "count"]);
      await page.evaluate(() => scrollTo(0, 0));
      await page.screenshot({ path: join(out, `flight-${colorScheme}-${width}.png`) });
      await page.close();
    }
  });

  check("a printed flight is whole: all plots over the whole flight, all times and lists, in its colours", async () => {
    // As wide as paper, so that its style is that of the printed page.
    const page = await open("about:blank", { colorScheme: "dark", viewport: { width: 718, height: 1000 } }, async (page) => {
      await page.addInitScript(recorder);
      await page.goto(`file://${flown.page}#flight=${lost}&plot=tilt_rad`);
    });
    await page.locator("#plot-error").scrollIntoViewIfNeeded();
    await page.waitForSelector("#plot-error canvas");
    // The reader has zoomed: what is printed is the whole flight all the same.
    const box = await page.locator("#plot-error .u-over").boundingBox();
    await page.mouse.move(box.x + 20, box.y + 50);
    await page.mouse.down();
    await page.mouse.move(box.x + 120, box.y + 50);
    await page.mouse.up();
    await page.keyboard.press("j");
    const t = await now(page), zoomed = (await writtenOn(page))[0].texts.map(([text]) => text);
    // The state of the page at the moment in which the browser prints.
    await page.evaluate(`addEventListener("beforeprint", () => (window.printed = (${atPrint})()), { once: true })`);
    const pdf = await page.pdf({ format: "A4", printBackground: false });
    assert.ok(pdf.length > 50000);
    const { plots, ...state } = await page.evaluate(() => window.printed);
    checkAxes(plots, "printed");
    assert.ok(plots.some(({ id }) => id === "plot-extra-0"));
    const end_s = Number(trace.at(-1)[0]);
    for (const { id, texts } of plots) {
      const seconds = texts.map(([text]) => text).filter((text) => / s$/.test(text)).map(parseFloat);
      assert.ok(seconds[0] === 0 && seconds.at(-1) > 0.7 * end_s, `${id}: ${seconds} of ${end_s}`);
    }
    assert.deepEqual(state, { exact: "exact", background: "rgb(255, 255, 255)", times: 0, closed: 0, cut: [], wide: [] });
    await page.waitForSelector("html:not([data-printing])");
    await page.waitForSelector("#plot-error canvas");
    assert.equal(await now(page), t);
    assert.deepEqual((await writtenOn(page))[0].texts.map(([text]) => text), zoomed);
    await page.close();
  });

  check("any signals are plotted, against time and each other, and the address holds them", async () => {
    const { equalScale, ticksOf } = await import(join(source, "harness/report/page/src/lines.js"));
    assert.deepEqual(ticksOf(-0.1, 2.1, 5), [0, 0.5, 1, 1.5, 2]);
    assert.deepEqual(equalScale([0, 10], [0, 1], 500, 100), [[0, 10], [-0.5, 1.5]]);
    const page = await openFlight(flown.page, lost);
    const { series } = await page.evaluate(() => ({ series: [...document.querySelectorAll("#extra-signal option")].map((option) => option.value) }));
    for (const name of ["x_m", "tau_l_nm", "sensed_yaw_rad", "tilt_rad", "robustness_upper/upright"]) assert.ok(series.includes(name), name);
    for (const column of trace[0]) assert.ok(column === "t_s" || column.startsWith("active_") || series.includes(column), column);
    const add = async (name, where) => { await page.selectOption("#extra-signal", name); await page.selectOption("#extra-where", where); await page.click("button.add"); };
    await add("sensed_z_m", "");
    await add("tilt_rad", "");
    await add("speed_m_s", "1");
    await page.selectOption("#extra-y", "y_m");
    await page.selectOption("#extra-x", "x_m");
    await page.click("button.add-xy");
    assert.equal(await hash(page), `#flight=${lost}&plot=sensed_z_m,z_m&plot=tilt_rad,speed_m_s&xy=x_m,y_m`);
    const titles = () => page.locator(".extras h3").allTextContents();
    assert.deepEqual(await titles(), ["sensed_z_m, z_m [m]", "tilt_rad, speed_m_s [rad, m/s]", "y_m against x_m"]);
    await page.locator("#plot-extra-1").scrollIntoViewIfNeeded();
    await page.waitForSelector("#plot-extra-1 canvas");
    // A metre is as long across as up, and the dot is where the vehicle is.
    const scale = (which) => page.locator(".xy text.tick").evaluateAll((all, at) => {
      const ticks = all.filter((text) => (text.getAttribute("text-anchor") === "middle") === (at === "x")).map((text) => [parseFloat(text.textContent.replace("−", "-")), Number(text.getAttribute(at))]);
      const [a, b] = [ticks[0], ticks.at(-1)];
      return { per: Math.abs((b[1] - a[1]) / (b[0] - a[0])), zero: a[1] - (a[0] * (b[1] - a[1])) / (b[0] - a[0]), sign: Math.sign((b[1] - a[1]) / (b[0] - a[0])) };
    }, which);
    const [across, up] = [await scale("x"), await scale("y")];
    assert.ok(Math.abs(across.per / up.per - 1) < 0.01, `${across.per} and ${up.per} px for 1 m`);
    await goTo(page, 9);
    const t = await now(page), row = trace.slice(1).findLast((line) => Number(line[0]) <= t + 1e-9);
    const dot = await page.locator(".xy circle").evaluate((circle) => Number(circle.getAttribute("cx")));
    assert.ok(Math.abs(dot - (across.zero + across.sign * across.per * Number(row[trace[0].indexOf("x_m")]))) < 2, `${dot}`);
    await page.locator(".xy").scrollIntoViewIfNeeded();
    await page.screenshot({ path: join(out, "extras-light.png") });
    // The address gets the time once the reader has stopped for a moment.
    await page.waitForFunction((wanted) => location.hash.includes(`&t=${wanted}`), t);
    const address = await page.url();
    await page.close();
    const again = await open(address.replace("file://", ""));
    await again.waitForSelector(".extras h3 >> nth=2");
    assert.equal(await now(again), t);
    assert.deepEqual(await again.locator(".extras h3").allTextContents(), ["sensed_z_m, z_m [m]", "tilt_rad, speed_m_s [rad, m/s]", "y_m against x_m"]);
    await again.click(".extras button.remove >> nth=0");
    await again.click(".extras button.remove >> nth=1");
    await again.waitForFunction(() => !location.hash.includes("xy=") && !location.hash.includes("sensed"));
    assert.deepEqual(await again.locator(".extras h3").allTextContents(), ["tilt_rad, speed_m_s [rad, m/s]"]);
    await again.close();
  });

  check("a second flight is drawn over the first one, dashed", async () => {
    const page = await openFlight(two.page, "touched");
    const label = () => page.locator("#plot-error").locator("xpath=..").getAttribute("aria-label");
    assert.ok(!/dashed/.test(await label()));
    await page.waitForSelector("#plot-error canvas");
    const alone = await page.locator("#plot-error canvas").evaluate((canvas) => canvas.toDataURL());
    await page.selectOption("#second", "calm");
    await page.waitForFunction(() => location.hash === "#flight=touched&with=calm");
    await page.waitForFunction(() => document.querySelector("#plot-error")?.parentElement.getAttribute("aria-label").endsWith("dashed: flight calm"));
    await page.waitForSelector("#plot-error canvas");
    assert.notEqual(await page.locator("#plot-error canvas").evaluate((canvas) => canvas.toDataURL()), alone);
    // Both values at the cursor, each from its own trace.
    await goTo(page, 4.5);
    const t = await now(page);
    const errors = ["touched", "calm"].map((name) => {
      const [names, ...rows] = readFileSync(join(two.run, name, "trace.csv"), "utf8").trimEnd().split("\n").map((line) => line.split(","));
      const row = rows.findLast((line) => Number(line[0]) <= t + 1e-9);
      return Math.hypot(...["x", "y", "z"].map((axis) => row[names.indexOf(`${axis}_m`)] - row[names.indexOf(`${axis}_ref_m`)]));
    });
    const shown = (await page.locator("#plot-error").locator("xpath=..").locator(".value").first().textContent()).split(" · ").map(parseFloat);
    errors.forEach((error, i) => assert.ok(Math.abs(shown[i] - error) < 2e-3 * Math.max(1, error), `${shown} is ${errors}`));
    await page.screenshot({ path: join(out, "second-light.png") });
    await page.selectOption("#second", "");
    await page.waitForFunction(() => !location.hash.includes("with="));
    await page.close();
  });

  check("hundreds of flights are grouped by what failed and by fault", async () => {
    const run = join(out, "many");
    mkdirSync(run);
    cpSync(join(flown.run, "run.json"), join(run, "run.json"));
    const results = JSON.parse(readFileSync(join(flown.run, "results.json"), "utf8"));
    const [failed, good] = [results.scenarios.find((f) => f.name === lost), results.scenarios.find((f) => f.name === passed)];
    const kinds = ["wire.burst", "sensor.bias", "frame.drop"], names = ["stays-on-path", "upright"];
    const scenarios = Array.from({ length: 300 }, (_, i) => {
      const flight = structuredClone(i % 3 === 0 ? good : failed);
      flight.name = `flight-of-${i}`;
      flight.faults = [{ id: "one", type: kinds[i % 5 === 0 ? 2 : i % 2], activations: 1 }];
      if (i % 3 !== 0) flight.criteria = flight.criteria.filter((c) => c.verdict !== "fail").concat({ ...violated, name: names[i % 2] });
      return flight;
    });
    writeResults(run, { ...results, scenarios });
    report(run);
    const page = await open(join(run, "report.html"));
    const groups = (depth) => page.locator(`tr.group.depth-${depth}`).evaluateAll((all) => all.map((tr) => [tr.querySelector("button").textContent.replace(/^. /, ""), parseInt(tr.querySelector(".many").textContent, 10)]));
    const rows = () => page.locator(".flights tbody tr:not(.group)").count();
    const count = (test) => scenarios.filter((f, i) => test(f, i)).length;
    const failing = (name) => (f, i) => i % 3 !== 0 && names[i % 2] === name;
    const wanted = new Map([["Passed", count((f, i) => i % 3 === 0)], ...names.map((name) => [`${name} (fail)`, count(failing(name))])]);
    assert.deepEqual(new Map(await groups(0)), wanted);
    assert.equal(await rows(), 0);
    // By keyboard, twice inwards.
    await page.locator("tr.group button", { hasText: "upright" }).focus();
    await page.keyboard.press("Enter");
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-expanded")), "true");
    const inner = new Map(kinds.map((kind) => [kind, count((f, i) => failing("upright")(f, i) && f.faults[0].type === kind)]).filter(([, n]) => n > 0));
    assert.deepEqual(new Map(await groups(1)), inner);
    await page.locator("tr.depth-1 button").first().click();
    const [[, most]] = await groups(1);
    assert.equal(await rows(), most);
    await page.screenshot({ path: join(out, "groups-light.png") });
    // Search and filters open what they find.
    await page.fill("input[type=search]", "flight-of-299");
    assert.equal(await rows(), 1);
    assert.deepEqual(await groups(0), [["upright (fail)", 1]]);
    assert.equal(await page.locator("tr.group .many").first().textContent(), " 1 flight");
    await page.fill("input[type=search]", "");
    await page.selectOption(".filters select >> nth=0", "pass");
    assert.deepEqual([await groups(0), await rows()], [[["Passed", 100]], 100]);
    await page.selectOption(".filters select >> nth=0", "");
    await page.locator(".filters select").last().selectOption("fault");
    assert.deepEqual(new Map(await groups(0)), new Map(kinds.map((kind) => [kind, count((f) => f.faults[0].type === kind)])));
    await page.locator(".filters select").last().selectOption("");
    assert.equal(await rows(), 300);
    // The choice holds when the reader comes back.
    await page.locator(".filters select").last().selectOption("criterion");
    await page.locator("tr.group button").first().click();
    await page.locator(".flights tbody tr:not(.group) a").first().click();
    await page.waitForSelector("#criteria");
    await page.goBack();
    assert.equal((await groups(0)).length, 3);
    assert.ok((await rows()) > 0);
    await page.close();
  });
}
