// SPDX-License-Identifier: MIT
//
// test.mjs PAGE.html REPLAY: presses and pulls the membrane in a browser, and compares with the native program REPLAY.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { pathToFileURL } from 'node:url';

const [, , file, native] = process.argv;
const { chromium } = createRequire(path.resolve('node_modules/x'))('playwright-core');
let browser, page;
const errors = [];

const state = () => page.evaluate(() => window.membrane.state());
// Waits for a force of so many millinewtons.
const felt = (least) => page.waitForFunction(
    (least) => 1e3 * Math.hypot(...(window.membrane.state()?.result?.force ?? [0])) > least, least);
const wait = (milliseconds) => page.waitForTimeout(milliseconds);
const shot = (name) => page.screenshot({ path: `${name}.png` });

async function ready() {
    await page.waitForFunction(() => window.membrane?.state()?.result);
}

// The middle of the view, shifted by parts of its size.
async function at(x, y) {
    const box = await page.locator('#view').boundingBox();
    return [box.x + (0.5 + x) * box.width, box.y + (0.5 - y) * box.height];
}

async function set(id, value) {
    await page.evaluate(([id, value]) => {
        const element = document.getElementById(id);
        element.value = value;
        element.dispatchEvent(new Event(element.tagName === 'SELECT' ? 'change' : 'input', { bubbles: true }));
        element.dispatchEvent(new Event('input', { bubbles: true }));
    }, [id, value]);
}

before(async () => {
    browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox', '--use-gl=swiftshader',
        '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'] });
    page = await browser.newPage({ viewport: { width: 960, height: 640 } });
    page.on('pageerror', (error) => errors.push(String(error)));
    page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
    await page.goto(pathToFileURL(file).href);
    await ready();
});

after(() => browser.close());

test('a press by the mouse is felt, and gone when it is let go', async () => {
    await shot('rest');
    await page.mouse.move(...await at(0, 0));
    await page.mouse.down();
    await felt(20);
    await page.mouse.move(...await at(0.1, 0.05), { steps: 10 });
    await wait(300);
    await shot('pressed');
    assert.match(await page.locator('#force').textContent(), /^[1-9]/);
    await page.mouse.up();
    await page.waitForFunction(() => Math.hypot(...window.membrane.state().result.force) < 1e-4);
});

test('a recorded path gives the forces of the native program', async () => {
    await page.click('#record');
    await wait(100);
    await page.mouse.move(...await at(-0.05, 0.05));
    await page.mouse.down();
    await wait(300);
    await page.mouse.move(...await at(0.1, 0), { steps: 20 });
    await wait(200);
    await page.mouse.up();
    await wait(500);
    await page.click('#record');
    await page.waitForFunction(() => window.membrane.record().length > 0);
    const rows = await page.evaluate(() => window.membrane.record());
    const input = rows.map((row) => row.slice(1, 5).join(' ')).join('\n');
    const lines = execFileSync(native, { input, maxBuffer: 1e8 }).toString().trim().split('\n');
    assert.equal(lines.length, rows.length);
    let largest = 0, difference = 0, equal = 0;
    lines.forEach((line, i) => {
        const expected = line.split(' ').map(Number), found = rows[i].slice(5, 8);
        largest = Math.max(largest, Math.hypot(...expected));
        difference = Math.max(difference, Math.hypot(...expected.map((f, k) => f - found[k])));
        equal += expected.every((f, k) => f === found[k]);
    });
    console.log(`${rows.length} ticks, ${equal} with the same bits, largest difference ${difference} N of ${largest} N`);
    assert.ok(largest > 0.02);
    assert.ok(difference <= 0.01 * largest);
});

test('a replay in the page gives the same forces to the bit', async () => {
    await page.click('#replay');
    await page.waitForFunction(() => window.membrane.replayed().length > 0, null, { timeout: 20000 });
    const [from, rows] = await page.evaluate(() => [window.membrane.record(), window.membrane.replayed()]);
    assert.equal(rows.length, from.length);
    from.forEach((row, i) => assert.deepEqual(rows[i].slice(1), row.slice(1)));
});

test('forceps pull the membrane outward', async () => {
    await set('shape', '3');
    await wait(300);
    await page.check('input[value=pull]');
    await page.mouse.move(...await at(0, 0.1));
    await page.mouse.down();
    await page.waitForFunction(() => window.membrane.state().result.holding);
    await page.mouse.move(...await at(0, 0.25), { steps: 10 });
    await felt(100);
    await shot('pulled');
    assert.ok((await state()).result.holding);
    await page.mouse.up();
    await page.check('input[value=press]');
});

// A tool of 2 mm to and fro at 50 mm/s, 1.5 mm deep, for four seconds: position and grasp of each tick.
function slide() {
    const path = [];
    for (let tick = 0; tick < 4000; ++tick) {
        const height = 10.5e-3 + Math.max(0, 2e-3 * (1 - tick / 100));
        const angle = 0.6 - Math.abs(((0.05 / 10.5e-3) * 1e-3 * tick) % 2.4 - 1.2);
        path.push([height * Math.sin(angle), 1e-3, height * Math.cos(angle), 0]);
    }
    return path;
}

test('more layers and sweeps are more accurate and take longer', async () => {
    const run = async (layers, sweeps, rule) => {
        await set('layers', layers);
        await set('sweeps', sweeps);
        await set('rule', rule);
        await page.evaluate((path) => window.membrane.play(path), slide());
        const errors = [];
        for (let i = 0; i < 6; ++i) {
            await wait(550);
            errors.push(await page.evaluate(() => window.membrane.error()));
        }
        const time = parseFloat(await page.locator('#median').textContent());
        return { error: errors.sort((a, b) => a - b)[3], time, updates: (await state()).result.updates };
    };
    const few = await run('1', '1', 'safe'), many = await run('8', '8', 'block');
    console.log('1 layer, 1 sweep:', few, '8 layers, 8 sweeps:', many);
    assert.ok(many.error < few.error);
    assert.ok(many.updates > few.updates);
});

test('a file is pressed, a defective one refused in words', async () => {
    const open = (name, text) => page.evaluate(async ([name, text]) => {
        await window.membrane.open(new File([text], name));
    }, [name, text]);
    const tetrahedron = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n';
    await open('good.obj', `${tetrahedron}f 2 3 4\n`);
    await wait(300);
    assert.equal((await state()).positions === undefined, false);
    await open('bad.obj', `${tetrahedron}f 2 3 4\nf 2 3 4\nv 2 2 2\nf 2 3 5\n`);
    await wait(300);
    const words = await page.locator('#notice').textContent();
    assert.match(words, /refused/);
    await shot('refused');
    await open('bad.stl', 'not a mesh');
    await wait(300);
    assert.match(await page.locator('#notice').textContent(), /refused/);
    await open('bad.txt', '');
    assert.match(await page.locator('#notice').textContent(), /only OBJ/);
});

test('time goes on while the page draws', async () => {
    await set('shape', '3');
    await set('layers', '6');
    await set('sweeps', '2');
    await ready();
    await page.mouse.move(...await at(0, 0));
    await page.mouse.down();
    const [begin, begun] = [(await state()).time, Date.now()];
    await wait(3000);
    const rate = ((await state()).time - begin) / (Date.now() - begun);
    await page.mouse.up();
    console.log(`${(1e6 * rate).toFixed(0)} ticks a second, median of a tick ${await page.locator('#median').textContent()}`);
    assert.ok(rate > 0);
});

test('no error on the console', () => assert.deepEqual(errors, []));
