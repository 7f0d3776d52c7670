// SPDX-License-Identifier: MIT
//
// Puts the page into one file: `node build.mjs OUTPUT`, where node_modules are beside the output.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const output = process.argv[2];
const page = join(dirname(fileURLToPath(import.meta.url)), "page");
const { buildSync } = createRequire(join(output))("esbuild");

const { outputFiles } = buildSync({
  entryPoints: [join(page, "main.js"), join(page, "style.css")],
  outdir: dirname(output),
  bundle: true,
  minify: true,
  write: false,
  nodePaths: [join(dirname(output), "node_modules")],
  loader: { ".worker.js": "text", ".wasm.js": "text" },
  legalComments: "inline",
  charset: "utf8",
});
const text = (name) => outputFiles.find(({ path }) => path.endsWith(name)).text.trim();

const style = `<style>${text("main.css")}${text("style.css")}</style>`;
const script = `<script>${text("main.js").replaceAll("</script", "<\\/script")}</script>`;

// Functions as replacements: `$` has no meaning in their results.
const html = readFileSync(join(page, "index.html"), "utf8")
  .replace('<link rel="stylesheet" href="style.css">', () => style)
  .replace('<script src="main.js"></script>', () => script);
writeFileSync(output, html);
