// SPDX-License-Identifier: MIT
//
// Drives build/web/membrane.html in Chromium: `node test.mjs FOLDER`, the folder with the page, the native program
// `replay` and node_modules. Saves pictures there.
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const { chromium } = createRequire(join(folder, "package.json"))("playwright-core");
const page_url = pathToFileURL(join(folder, "membrane.html")).href;
const lens = new URL("../data/lens.obj", import.meta.url);

let passed = 0;
let failed = 0;
const complaints = []; // of the pages

function check(what, holds, found) {
  if (holds) ++passed;
  else ++failed;
  console.log(`${holds ? "passed" : "FAILED"}  ${what}${found === undefined ? "" : `: ${found}`}`);
}

const browser = await chromium.launch({
  executablePath: "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"], // draws without a GPU
});

async function open(options = {}) {
  const page = await browser.newPage({ viewport: { width: 800, height: 560 }, ...options });
  page.setDefaultTimeout(90_000);
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  page.on("pageerror", (error) => complaints.push(String(error)));
  await page.goto(page_url);
  await page.waitForFunction(() => window.membrane?.state.frames > 0);
  return page;
}

const state = (page) => page.evaluate(() => window.membrane.state);
const size = (force) => Math.hypot(...force);
const picture = (page, name) => page.screenshot({ path: join(folder, `${name}.png`) });

// The point of the window at parts of the view's width and height.
async function at(page, x, y) {
  const box = await page.locator("#view").boundingBox();
  return [box.x + x * box.width, box.y + y * box.height];
}

async function choose(page, mesh) {
  const { vertices } = await state(page);
  await page.selectOption("#mesh", mesh);
  await page.waitForFunction((before) => window.membrane.state.vertices !== before, vertices);
}

const pick = (page, id, value) => page.locator(`#${id} label:has([value=${value}])`).click();

// Presses or pulls along a path of points of the view.
async function stroke(page, path, { wait = 400 } = {}) {
  await page.mouse.move(...(await at(page, ...path[0])));
  await page.mouse.down();
  await page.waitForTimeout(wait);
  for (const point of path.slice(1)) {
    await page.mouse.move(...(await at(page, ...point)), { steps: 12 });
    await page.waitForTimeout(wait);
  }
}

const path = [
  [0.5, 0.46],
  [0.6, 0.45],
  [0.45, 0.5],
];

async function testFirstPress() {
  const begin = performance.now();
  const page = await open();
  await page.mouse.move(...(await at(page, 0.5, 0.4)));
  await page.mouse.down();
  await page.waitForFunction(() => Math.hypot(...window.membrane.state.force) > 0);
  const seconds = (performance.now() - begin) / 1000;
  console.log(`        first force after ${seconds.toFixed(2)} s`);
  await page.close();
}

async function testRealTime() {
  const page = await open({ viewport: { width: 640, height: 480 } });
  await stroke(page, path);
  const before = await state(page);
  const begin = performance.now();
  await page.waitForTimeout(4000);
  const after = await state(page);
  const seconds = (performance.now() - begin) / 1000;
  const ticks = Math.round((1000 * (after.time - before.time)) / seconds);
  check("time goes on while the page draws, 642 vertices", ticks > 0, `${ticks} ticks a second`);
  console.log(`        ${((after.frames - before.frames) / seconds).toFixed(1)} frames a second, drawn without a GPU`);
  const [median, p99, worst] = [after.median, after.p99, after.worst].map((time) => time.toFixed(3));
  console.log(`        a tick, pressed: median ${median}, 99 % ${p99}, worst ${worst} ms`);
  await page.close();
}

function native(csv) {
  return execFileSync(join(folder, "replay"), ["3"], { input: csv, maxBuffer: 1 << 28 })
    .toString()
    .trim()
    .split("\n")
    .map((line) => line.split(",").map(Number));
}

async function testForces() {
  const page = await open();
  await page.click("#record");
  await stroke(page, path);
  await picture(page, "pressed");
  await page.mouse.up();
  await page.keyboard.down("Shift");
  await stroke(page, [[0.4, 0.4], [0.35, 0.15]]);
  await picture(page, "pulled");
  await page.mouse.up();
  await page.keyboard.up("Shift");
  await page.click("#record");
  await page.waitForFunction(() => !window.membrane.state.recording);
  const csv = await page.evaluate(() => window.membrane.csv());
  writeFileSync(join(folder, "stroke.csv"), csv);

  const rows = csv.trim().split("\n").slice(1).map((line) => line.split(",").map(Number));
  const forces = rows.map((row) => row.slice(9, 12));
  const exact = native(csv);
  const largest = Math.max(...forces.map(size));
  const difference = Math.max(...forces.map((force, i) => size(force.map((f, k) => f - exact[i][k])))) / largest;
  const same = forces.filter((force, i) => force.every((f, k) => f === exact[i][k])).length;
  check("the stroke presses and pulls", largest > 0.02 && rows.some((row) => row[7] === 1), `${largest} N`);
  check("force of the native program, within 1 % of the largest", difference <= 0.01, difference);
  console.log(`        ${same} of ${forces.length} ticks have the same bits`);
  await testDial(page, rows);
  await page.close();
}

// The error while the tool moves, and the time of all ticks, for one stroke and several numbers of sweeps.
async function testDial(page, rows) {
  const replayTo = (ticks) => page.evaluate((count) => window.membrane.replayTo(count), ticks);
  const moves = (row) => size(row.slice(9, 12)) > 0.02 && size(row.slice(4, 7)) > 0.01 && row[7] === 0;
  const moving = rows.findLastIndex(moves);
  const { reaction } = await replayTo(moving + 1);
  check("a replay has the force of the recording", reaction.every((f, k) => f === rows[moving][9 + k]));
  const errors = [];
  const means = [];
  for (const sweeps of [1, 4, 16]) {
    await page.locator("#sweeps").fill(String(sweeps));
    errors.push((await replayTo(moving + 1)).error);
    means.push((await state(page)).median);
  }
  const found = errors.map((error) => error.toPrecision(3)).join(", ");
  check("1, 4, 16 sweeps: smaller error", errors[0] > errors[1] && errors[1] > errors[2], found);
  check("1, 4, 16 sweeps: more time [ms]", means[0] < means[2], means.map((t) => t.toFixed(3)).join(", "));
}

async function testFiles() {
  const page = await open({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  const twisted = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n";
  const refused = async (name, text) => {
    await page.setInputFiles("#file", { name, mimeType: "text/plain", buffer: Buffer.from(text) });
    await page.waitForSelector(`#notice:not([hidden]) :text("${name} is refused")`);
    return (await page.textContent("#notice pre")).trim().replace("\n", " ");
  };
  check("a defective mesh is refused in words", true, await refused("twisted.obj", twisted));
  await picture(page, "refused");
  const bad = { "a.obj": "nonsense", "a.off": "OFF 1 1e9 0", "a.ply": "ply", "a.stl": "", "a.txt": "x" };
  for (const [name, text] of Object.entries(bad)) await refused(name, text);
  check("bad files are refused", size((await state(page)).force) === 0);
  await page.setInputFiles("#file", lens.pathname);
  await page.waitForFunction(() => window.membrane.state.vertices !== 642);
  const [x, y] = await at(page, 0.5, 0.45);
  await page.touchscreen.tap(x, y);
  await page.locator("#view").focus();
  await page.keyboard.down("Space");
  await page.waitForFunction(() => Math.hypot(...window.membrane.state.force) > 0.001);
  check("a mesh file is pressed by key", true, `${(await state(page)).vertices} vertices`);
  await picture(page, "file_on_a_phone");
  await page.keyboard.up("Space");
  await page.close();
}

async function testMembranes() {
  const page = await open({ colorScheme: "dark" });
  for (const mesh of ["sphere 2", "sphere 4", "sphere 5", "lens", "cornea"]) {
    await choose(page, mesh);
    await stroke(page, path, { wait: 300 });
    await page.waitForFunction(() => document.getElementById("error").textContent !== "–");
    const { force, speed, median } = await state(page);
    const error = await page.textContent("#error");
    const found = `${size(force).toFixed(4)} N, error ${error}, tick ${(1e3 * median).toFixed(0)} µs`;
    check(`${mesh} is pressed`, size(force) > 1e-3, `${found}, ${(100 * speed).toFixed(0)} % of real time`);
    await page.mouse.up();
  }
  await pick(page, "colour", "layers");
  await stroke(page, path.slice(0, 2));
  await picture(page, "layers_dark");
  await page.mouse.up();
  await page.uncheck("#volumeSprings");
  await pick(page, "rule", "safe");
  await stroke(page, path.slice(0, 2));
  const { force, touching } = await state(page);
  check("without volume springs, by safe steps", touching && size(force) > 0, `${(1e3 * size(force)).toFixed(3)} mN`);
  await page.mouse.up();
  await page.close();
}

async function testMishaps() {
  const page = await open();
  await stroke(page, path.slice(0, 1));
  const before = (await state(page)).time;
  await page.evaluate(() => {  // as in a hidden tab, no frame is displayed
    window.displayed = window.requestAnimationFrame;
    window.requestAnimationFrame = (frame) => (window.held = frame);
  });
  await page.waitForTimeout(3000);
  await page.evaluate(() => {
    window.requestAnimationFrame = window.displayed;
    window.requestAnimationFrame(window.held);
  });
  await page.waitForTimeout(300);
  const passedTime = (await state(page)).time - before;
  check("a hidden page stops the time [s]", passedTime < 1.5, passedTime);
  await page.waitForTimeout(500);
  check("the press goes on", size((await state(page)).force) > 0.01);

  await page.setViewportSize({ width: 500, height: 900 });
  await page.evaluate(() => {
    window.lost = document.getElementById("view").getContext("webgl2").getExtension("WEBGL_lose_context");
    window.lost.loseContext();
  });
  await page.waitForTimeout(300);
  await page.evaluate(() => window.lost.restoreContext());
  await page.waitForTimeout(500);
  const { frames } = await state(page);
  await page.waitForTimeout(500);
  const noticed = await page.isVisible("#notice");
  check("a lost graphics context comes back", (await state(page)).frames > frames && !noticed);
  await page.close();
}

const tests = [testFirstPress, testRealTime, testForces, testFiles, testMembranes, testMishaps];
try {
  for (const test of tests) await test();
} catch (error) {
  check("no test breaks off", false, error.stack);
}
const own = complaints.filter((text) => !/GPU stall|Context Lost|WebGL.*(lost|restored)/i.test(text));
check("no message on the console", own.length === 0, own.join("\n"));
await browser.close();
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed > 0 ? 1 : 0);
