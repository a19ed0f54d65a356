// Editors' completions, explanations and error marks in scenario files, from the language server that VS Code, Neovim and others
// use. A validator of another house must accept the shipped files.
//
// Usage: node editors_test.mjs TILTPROOF SOURCE_DIR OUT_DIR
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";

import { Ajv2020 } from "ajv/dist/2020.js";
import { parse } from "yaml";

import { LanguageServer } from "./language_server.mjs";

const [tiltproof, source, out] = process.argv.slice(2).map((path) => resolve(path));
rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });

const schema = JSON.parse(execFileSync(tiltproof, ["schema"], { encoding: "utf8" }));
writeFileSync(join(out, "schema.json"), JSON.stringify(schema));

// The catalogue for people is what the editor must know: "## frame.delay", a summary, and a table of parameters.
const catalogue = new Map(
  execFileSync(tiltproof, ["faults"], { encoding: "utf8" }).split(/^## /m).slice(1).map((section) => {
    const [name, , ...text] = section.split("\n");
    const rows = [...section.matchAll(/^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \| (.*) \|$/gm)];
    const parameters = rows.map(([, parameter, unit, allowed, fallback, meaning]) => ({ parameter, unit, allowed, fallback, meaning }));
    return [name, { text: text.join(" "), parameters }];
  }));

const HEAD = "name: x\nduration_s: 24\n";
const SPIRAL = `${HEAD}reference: {type: spiral}\n`;
const BLOCK = (type) => `${SPIRAL}faults:\n  - id: a\n    type: ${type}\n`;
const FAULT = (text) => `${SPIRAL}faults:\n  - {id: a, ${text}}\n`;

const server = await LanguageServer.start({ [join(out, "schema.json")]: ["*.yaml"] }, out);
const offered = async (text) => (await server.complete(text)).map((item) => item.label);
const documentation = (item) => item.documentation?.value ?? item.documentation ?? "";
// "what: where" of all mistakes, as an editor shows them.
const mistakes = async (text) => (await server.diagnose(text)).map(({ message, source: where }) => `${where.replace("yaml-schema: ", "")}: ${message}`);

// The server waits a while before it judges a document, so it is given many at once.
const each = (items, body) => Promise.all([...items].map(body));

const checks = [];
const check = (name, body) => checks.push({ name, body });

check("all types of faults are offered, each with what it does", async () => {
  for (const text of [BLOCK("¦"), FAULT("type: ¦"), `${SPIRAL}faults:\n  - id: c\n    compound:\n      - id: a\n        type: ¦\n`]) {
    const items = await server.complete(text);
    assert.deepEqual(items.map((item) => item.label).sort(), [...catalogue.keys()].sort());
    for (const item of items) assert.ok(catalogue.get(item.label).text.startsWith(documentation(item)), `${item.label}: ${documentation(item)}`);
  }
});

check("an empty place for a fault offers what every fault begins with, not all that there is", async () => {
  const items = await server.complete(`${SPIRAL}faults:\n  - ¦\n`);
  assert.deepEqual(items.filter((item) => item.kind === 10).map((item) => item.label).sort(), ["compound", "id", "type"]);
  assert.ok(items.find((item) => item.label === "type").textEdit.newText.startsWith("type:"));
});

check("within each fault its own parameters are offered, with meaning, unit, range and default", async () => {
  await each(catalogue, async ([type, { parameters }]) => {
    if (parameters.length === 0) return;
    const items = await server.complete(`${BLOCK(type)}    parameters:\n      ¦\n`);
    const keys = items.filter((item) => item.kind === 10);
    assert.deepEqual(keys.map((item) => item.label).sort(), parameters.map(({ parameter }) => parameter).sort(), type);
    for (const { parameter, unit, allowed, fallback, meaning } of parameters) {
      const text = documentation(keys.find((item) => item.label === parameter));
      assert.ok(text.startsWith(meaning) && text.includes(allowed), `${type}: ${text}`);
      if (unit !== "-" && unit !== "1") assert.ok(text.includes(unit), `${type}: ${text}`);
      if (fallback !== "required") assert.ok(text.includes(`${fallback} when not stated`), `${type}: ${text}`);
    }
  });
});

check("values: words of a choice, names of the usual vehicle, metrics", async () => {
  assert.deepEqual(await offered(`${BLOCK("frame.delay")}    parameters:\n      distribution: ¦\n`), ["constant", "uniform", "normal", "pareto"]);
  assert.ok((await offered(`${BLOCK("sensor.bias")}    parameters:\n      signal: ¦\n`)).includes("alpha_r_rad"));
  assert.deepEqual(await offered(`${BLOCK("actuator.offset")}    parameters:\n      actuator: ¦\n`), ["f_r", "f_l", "tau_r", "tau_l"]);
  assert.ok((await offered(`${BLOCK("frame.semantic")}    parameters:\n      field: ¦\n`)).includes("vx_m_s"));
  assert.ok((await offered(`${SPIRAL}criteria:\n  - name: a\n    metric: ¦\n`)).includes("tracking.rmse_m"));
});

check("flow style is completed from the first letter on", async () => {
  assert.ok((await offered(FAULT("type: frame.delay, parameters: {m¦}"))).includes("mean_ms"));
  assert.ok((await offered(FAULT("type: frame.delay, t¦"))).includes("target"));
});

check("types of references, and the keys of each", async () => {
  const types = (await offered(`${HEAD}reference: {type: ¦}\n`)).sort();
  assert.deepEqual(types, ["circle", "eight", "hover", "line", "recorded", "spiral", "waypoints"]);
  const docs = readFileSync(join(source, "docs/scenario.md"), "utf8");
  for (const type of types) {
    const table = docs.split(`### \`reference\` of type ${type}\n`)[1].split("###")[0];
    const keys = [...table.matchAll(/^\| `(\w+)`/gm)].map(([, key]) => key);
    const items = await server.complete(`${HEAD}reference:\n  type: ${type}\n  ¦\n`);
    assert.deepEqual(items.filter((item) => item.kind === 10).map((item) => item.label).sort(), keys.sort(), type);
  }
});

check("a wrong parameter of any fault is named, with its type, and nothing else is underlined", async () => {
  await each(catalogue, async ([type, { parameters }]) => {
    if (parameters.length === 0) return;
    const example = execFileSync(tiltproof, ["faults", type], { encoding: "utf8" }).match(/^- \{.*\}$/m)[0];
    const scenario = (fault) => `${SPIRAL}faults:\n  ${fault}\n`;
    assert.deepEqual(await mistakes(scenario(example)), [], type);
    assert.deepEqual(await mistakes(scenario(example.replace("parameters: {", "parameters: {mistaken: 1, "))),
      [`parameters of ${type}: Property mistaken is not allowed.`]);
    const [{ parameter }] = parameters;
    const wrong = example.replace(new RegExp(`(parameters: \\{.*?\\b${parameter}: )[^,}]*`), "$1{}");
    const [first] = await mistakes(scenario(wrong));
    assert.ok(first.startsWith(`${parameter} of ${type}: `), `${wrong}: ${first}`);
  });
});

check("each mistake is said once, for the branch that is meant", async () => {
  const cases = {
    [FAULT("type: frame.delay, target: both, parameters: {mean_ms: -1}")]: "mean_ms of frame.delay: Value is below the minimum of 0.",
    [FAULT("type: frame.delay, target: both, parameters: {}")]: 'parameters of frame.delay: Missing property "mean_ms".',
    [FAULT("type: frame.delay, parameters: {mean_ms: 1}")]: 'fault frame.delay: Missing property "target".',
    [FAULT("type: sensor.freeze, target: both, parameters: {signal: z_m}")]: "fault sensor.freeze: Property target is not allowed.",
    [FAULT("type: device.hang")]: 'fault device.hang: Missing property "start_s".',
    [FAULT("target: both")]: 'fault: Missing property "type".',
    [FAULT("compound: [{id: b, type: frame.drop, target: both, parameters: {probability: 2}}]")]: "probability of frame.drop: Value is above the maximum of 1.",
    [FAULT("compound: [{id: b, type: frame.drop, target: both, parameters: {probability: 1}}], mistaken: 1")]: "compound: Property mistaken is not allowed.",
    [`${HEAD}reference: {type: circle, turns_count: 2}\n`]: "reference circle: Property turns_count is not allowed.",
    [`${HEAD}reference: {type: hover}\n`]: 'reference hover: Missing property "at_m".',
    [`${HEAD}reference: {velocity: true}\n`]: 'reference: Missing property "type".',
    [`${SPIRAL}criteria: [{name: a, stl: "true", max: 1}]\n`]: "criteria: Property max is not allowed.",
    [`${SPIRAL}criteria: [{name: a}]\n`]: 'criteria: Missing property "stl".',
    [`${SPIRAL}link: {dialect: paper, protocol: paper}\n`]: "link: Property dialect is not allowed.",
    [`${SPIRAL}sed: 1\n`]: "tiltproof scenario: Property sed is not allowed.",
  };
  await each(Object.entries(cases), async ([text, expected]) => assert.deepEqual(await mistakes(text), [expected], text));
  for (const text of [FAULT("type: frame.delayy"), `${HEAD}reference: {type: spirl}\n`]) {
    const [only, ...more] = await mistakes(text);
    assert.deepEqual(more, []);
    assert.match(only, /^(fault|reference): Value must be "/);
  }
});

check("a type and a parameter explain themselves under the pointer", async () => {
  assert.match(await server.hover(FAULT("type: fra¦me.delay, target: both, parameters: {mean_ms: 1}")), /Holds frames back/);
  assert.match(await server.hover(FAULT("type: frame.delay, target: both, parameters: {mea¦n_ms: 1}")), /of frame.delay[^]*mean delay; in ms, 0 to 10000/);
});

const shipped = readdirSync(join(source, "scenarios"), { recursive: true }).filter((file) => /\.ya?ml$/.test(file)).map((file) => join(source, "scenarios", file));

check("nothing is underlined in the scenarios that are shipped", async () => {
  assert.ok(shipped.length > 250);
  await each(shipped, async (file) => assert.deepEqual(await mistakes(readFileSync(file, "utf8")), [], file));
});

check("another validator accepts the schema, strictly read, and the scenarios that are shipped", async () => {
  const ajv = new Ajv2020({ strict: true, strictRequired: false, strictTypes: false, allErrors: true });
  const validate = ajv.compile(schema);
  for (const file of shipped) assert.ok(validate(parse(readFileSync(file, "utf8"))), `${file}: ${ajv.errorsText(validate.errors)}`);
  assert.ok(!validate(parse(FAULT("type: frame.delay, target: both, parameters: {mean_ms: 1, mistaken: 2}"))));
});

check("the file that `tiltproof new` writes says itself where its schema is", async () => {
  execFileSync(tiltproof, ["new", join(out, "first.yaml")]);
  const text = readFileSync(join(out, "first.yaml"), "utf8");
  const alone = await LanguageServer.start({}, out);
  try {
    assert.deepEqual(await alone.diagnose(text), []);
    const [mistake] = await alone.diagnose(text.replace("type: frame.drop", "type: frame.dropp"));
    assert.equal(mistake.source, "yaml-schema: fault");
    assert.ok((await alone.complete(`${text.split("reference:")[0]}reference: {type: ¦}\n`)).some((item) => item.label === "spiral"));
  } finally {
    alone.stop();
  }
});

let failed = 0;
for (const { name, body } of checks) {
  try {
    await body();
    console.log(`passed  ${name}`);
  } catch (error) {
    failed += 1;
    console.log(`FAILED  ${name}\n${error.stack}`);
  }
}
server.stop();
console.log(`${checks.length - failed} of ${checks.length} checks passed`);
process.exit(failed === 0 ? 0 : 1);
