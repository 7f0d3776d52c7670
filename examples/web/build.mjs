// SPDX-License-Identifier: MIT
//
// build.mjs MODULE.wasm PAGE.html: bundles page, worker and module into one file.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const [, , module, target] = process.argv;
const packages = path.resolve('node_modules');
const { build } = createRequire(path.join(packages, 'x'))('esbuild');
const page = path.join(path.dirname(fileURLToPath(import.meta.url)), 'page');

async function bundle(file, define = {}) {
    const result = await build({
        entryPoints: [path.join(page, file)], bundle: true, minify: true, write: false, format: 'iife', define,
        nodePaths: [packages], legalComments: 'none',
    });
    return result.outputFiles[0].text;
}

const worker = await bundle('worker.js');
const script = await bundle('main.js', {
    WORKER: JSON.stringify(worker),
    MODULE: JSON.stringify(readFileSync(module).toString('base64')),
});
const style = readFileSync(path.join(page, 'style.css'), 'utf8') +
    readFileSync(path.join(packages, 'uplot/dist/uPlot.min.css'), 'utf8');
const html = readFileSync(path.join(page, 'index.html'), 'utf8')
    .replace('/* STYLE */', () => style)
    .replace('/* SCRIPT */', () => script.replaceAll('</script', '<\\/script'));
writeFileSync(target, html);
console.log(`${target}: ${(html.length / 1e6).toFixed(2)} MB`);
