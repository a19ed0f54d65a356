// Builds the pages in dist: each one file with its script and style inside, and a policy that allows only these.
//   node build.mjs [FOLDER]
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "dist");
// Parts of each page: the script that starts it, its style, and the packages that are in it.
const PAGES = [
  { name: "report", script: "src/main.js", style: "src/style.css", packages: ["uplot", "three"] },
  { name: "envelope", script: "src/envelope.js", style: "src/envelope.css", packages: [] },
  { name: "campaign", script: "src/campaign.js", style: "src/campaign.css", packages: [] },
  { name: "integrity", script: "src/integrity.js", style: "src/integrity.css", packages: [] },
];

const bundle = async (entry, options = {}) => {
  const result = await build({ absWorkingDir: here, entryPoints: [entry], bundle: true, minify: true, write: false, legalComments: "none", target: ["chrome100", "firefox113", "safari16.4"], charset: "ascii", ...options });
  return result.outputFiles[0].text.trim().replaceAll("</script", "<\\/script");
};
const sha = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;

mkdirSync(out, { recursive: true });
for (const { name, script: entry, style: sheet, packages } of PAGES) {
  const script = await bundle(entry, { format: "iife" });
  const style = await bundle(sheet);
  const licences = packages.map((name) => {
    const { version } = JSON.parse(readFileSync(join(here, "node_modules", name, "package.json"), "utf8"));
    return `${name} ${version}\n\n${readFileSync(join(here, "node_modules", name, "LICENSE"), "utf8").trim()}`;
  }).join("\n\n");
  const policy = `default-src 'none'; script-src ${sha(script)}; style-src ${sha(style)}; base-uri 'none'; form-action 'none'`;
  let page = readFileSync(join(here, "src", "index.html"), "utf8");
  for (const [place, text] of Object.entries({ POLICY: policy, STYLE: style, SCRIPT: script, LICENCES: licences.replaceAll("--", "- -") || "code of tiltproof only" })) {
    if (!page.includes(`{{${place}}}`)) throw new Error(`src/index.html has no {{${place}}}`);
    page = page.replace(`{{${place}}}`, () => text);
  }
  const file = join(out, `${name}.html`);
  writeFileSync(file, page);
  console.log(`${file}: ${(page.length / 1024).toFixed(0)} KiB`);
}
