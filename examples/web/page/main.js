// SPDX-License-Identifier: MIT
//
// Joins the parts: pointer and keys move the tool, the worker computes, the view draws.
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { STLLoader } from 'three/addons/loaders/STLLoader.js';
import { Plot } from './plot.js';
import { View } from './view.js';

/* global WORKER, MODULE: the bundled worker's source, and the module of C++ in base 64 */
const bytes = Uint8Array.from(atob(MODULE), (c) => c.charCodeAt(0)).buffer;
const workerAddress = URL.createObjectURL(new Blob([WORKER], { type: 'text/javascript' }));
const [loop, solver] = [new Worker(workerAddress), new Worker(workerAddress)];

const $ = (id) => document.getElementById(id);
const view = new View($('view'));
const plot = new Plot($('plot'));
const radius = 2e-3;     // of the tool [m]
const above = 0.3e-3;    // how far above the membrane a press begins [m]
const longestPull = 5e-3;
const statistics = 100;  // batches of ticks

let state = null;
let touch = null;        // the point and normal under the tool, while it is down
let times = [];
let record = [];
let waiting = false;     // for an equilibrium
let replayed = [];
let asked = null;        // the force whose equilibrium is being computed
let error = NaN;         // of the last one [%]

const options = () => ({
    layers: Number($('layers').value),
    sweeps: Number($('sweeps').value),
    safeStep: $('rule').value === 'safe',
    volumeSprings: $('springs').checked,
});
const both = (message) => [loop, solver].forEach((worker) => worker.postMessage(message));
const add = (p, n, s) => p.map((x, k) => x + s * n[k]);
const pulls = () => document.querySelector('input[name=mode]:checked').value === 'pull';
const depth = () => 1e-3 * Number($('depth').value);

// ---- The tool

function touchDown(hit) {
    touch = { ...hit, pulls: pulls() };
    loop.postMessage({ command: 'place', tool: { position: add(hit.point, hit.normal, radius + above), radius, grasping: 0 } });
    aim();
}

// A press goes to its depth below the shape at rest; a pull dips in, closes, and follows the pointer outward.
function aim() {
    const { point, normal } = touch;
    if (!touch.pulls) {
        loop.postMessage({ command: 'aim', position: add(point, normal, radius - depth()), grasping: 0 });
    } else if (!touch.held) {
        loop.postMessage({ command: 'aim', position: add(point, normal, radius - 0.3e-3), grasping: 0 });
    } else {
        loop.postMessage({ command: 'aim', position: touch.held, grasping: 1 });
    }
}

function lift() {
    if (!touch) return;
    const { point, normal } = touch;
    touch = null;
    loop.postMessage({ command: 'aim', position: add(point, normal, radius + 5e-3), grasping: 0 });
}

function pointerAt(event) {
    const box = $('view').getBoundingClientRect();
    return [2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height];
}

$('view').addEventListener('pointerdown', (event) => {
    const hit = event.button === 0 && view.surfaceAt(...pointerAt(event));
    view.controls.enabled = !hit;
    if (!hit) return;
    $('view').setPointerCapture(event.pointerId);
    $('hint').hidden = true;
    touchDown(hit);
}, { capture: true });

$('view').addEventListener('pointermove', (event) => {
    if (!touch) return;
    const pointer = pointerAt(event);
    if (touch.pulls) {
        const moved = view.spaceAt(...pointer, touch.distance).map((x, k) => x - touch.point[k]);
        const length = Math.hypot(...moved), limit = Math.min(1, longestPull / length);
        const start = add(touch.point, touch.normal, radius - 0.3e-3);
        touch.held = add(add(start, moved, limit), touch.normal, 0.5 * limit * length);
    } else {
        Object.assign(touch, view.surfaceAt(...pointer));
    }
    aim();
});

for (const name of ['pointerup', 'pointercancel']) {
    $('view').addEventListener(name, () => {
        lift();
        view.controls.enabled = true;
    });
}

$('view').addEventListener('keydown', ({ key, preventDefault }) => {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (key in steps) {
        const [x, y] = touch?.keys ?? [0, 0];
        const keys = [x + 0.02 * steps[key][0], y + 0.02 * steps[key][1]];
        const hit = view.surfaceAt(...keys);
        if (!hit) return;
        if (touch) Object.assign(touch, hit, { keys });
        else touchDown(hit);
        touch.keys = keys;
        aim();
    } else if (key === '+' || key === '-') {
        $('depth').value = Number($('depth').value) + (key === '+' ? 0.1 : -0.1);
        showDial();
        if (touch) aim();
    } else if (key === 'Escape') {
        lift();
    }
});

// ---- The dial

function showDial() {
    $('depth_value').textContent = `${$('depth').value} mm`;
    for (const id of ['layers', 'sweeps']) $(`${id}_value`).textContent = $(id).value;
}

for (const id of ['layers', 'sweeps', 'rule', 'springs', 'depth']) {
    $(id).addEventListener('input', () => {
        showDial();
        if (id !== 'depth') {
            both({ command: 'options', options: options() });
            times = [];
        } else if (touch) {
            aim();
        }
    });
}

$('shape').addEventListener('change', () => both({ command: 'build', shape: Number($('shape').value) }));
$('reset').addEventListener('click', () => both({ command: 'build', shape: Number($('shape').value) }));

// ---- Recording

$('record').addEventListener('click', () => {
    const on = $('record').getAttribute('aria-pressed') === 'false';
    $('record').setAttribute('aria-pressed', on);
    if (on) loop.postMessage({ command: 'build', shape: Number($('shape').value) });
    loop.postMessage({ command: 'record', on });
});

const play = (path) => loop.postMessage({ command: 'replay', shape: Number($('shape').value), path });

$('replay').addEventListener('click', () => {
    play(record.map((row) => row.slice(1, 5)));
});

$('download').addEventListener('click', () => {
    const header = 'time_s,x_m,y_m,z_m,grasping,force_x_N,force_y_N,force_z_N,depth_m\n';
    const blob = new Blob([header + record.map((row) => `${row.join(',')}\n`).join('')], { type: 'text/csv' });
    const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(blob), download: 'membrane.csv' });
    link.click();
    URL.revokeObjectURL(link.href);
});

// ---- Files

function notice(text) {
    $('notice').textContent = text;
    $('notice').hidden = text === '';
}

// Positions of all triangles, three corners each: corners at the same position are joined in C++.
function soup(geometry) {
    const { array } = (geometry.index ? geometry.toNonIndexed() : geometry).attributes.position;
    return [...array];
}

async function readFile(file) {
    const kind = file.name.split('.').pop().toLowerCase();
    const content = await file.arrayBuffer();
    const points = [];
    if (kind === 'obj') {
        new OBJLoader().parse(new TextDecoder().decode(content)).traverse((o) => o.isMesh && points.push(...soup(o.geometry)));
    } else if (kind === 'ply') {
        points.push(...soup(new PLYLoader().parse(content)));
    } else if (kind === 'stl') {
        points.push(...soup(new STLLoader().parse(content)));
    } else {
        throw new Error('only OBJ, PLY and STL are read here');
    }
    if (points.length === 0) throw new Error('it has no triangles');
    return points;
}

addEventListener('dragover', (event) => event.preventDefault());
addEventListener('drop', async (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (file) await open(file);
});

async function open(file) {
    try {
        const points = await readFile(file);
        both({ command: 'buildFile', points, triangles: points.slice(0, points.length / 3).map((_, i) => i) });
    } catch (error) {
        notice(`${file.name} is refused: ${error.message}`);
    }
}

// ---- What comes back

loop.onmessage = ({ data }) => {
    if (data.built) {
        state = null;
        touch = null;
        view.setMesh(data.built);
        plot.clear();
    } else if (data.findings) {
        const { refused, findings } = data.findings;
        notice(`${refused ? 'The mesh is refused.\n' : ''}${findings}`);
    } else if (data.recorded) {
        record = data.recorded;
        for (const id of ['replay', 'download']) $(id).disabled = record.length === 0;
    } else if (data.replayed) {
        replayed = data.replayed;
    } else {
        show(data.state);
    }
};

solver.onmessage = ({ data }) => {
    if (!data.equilibrium) return;
    waiting = false;
    const { force, valid } = data.equilibrium;
    error = 100 * Math.hypot(...force.map((f, k) => f - asked[k])) / Math.hypot(...force);
    $('error').textContent = !valid ? '-' : error < 0.01 ? 'less than 0.01 %' : `${error.toFixed(error < 1 ? 2 : 1)} %`;
};

const quantile = (sorted, share) => `${sorted[Math.floor(share * (sorted.length - 1))].toFixed(0)} µs`;

function show(next) {
    state = next;
    times.push(...next.times);
    times.splice(0, times.length - statistics);
    view.update(next, 1e-3 * 2);
    plot.add(next.time, next.forces);
    $('force').textContent = (1e3 * Math.hypot(...(next.result?.force ?? [0]))).toFixed(1);
    if (times.length > 10) {
        const sorted = [...times].sort((a, b) => a - b);
        $('median').textContent = quantile(sorted, 0.5);
        $('p99').textContent = quantile(sorted, 0.99);
        $('worst').textContent = quantile(sorted, 1);
    }
    if (touch?.pulls && !touch.held && next.result?.touching) {
        touch.held = next.tool.position;
        aim();
    }
}

function askForEquilibrium() {
    if (waiting) return;
    if (!state?.result?.touching || state.result.holding) {
        $('error').textContent = '-';
        return;
    }
    waiting = true;
    asked = state.result.force;
    solver.postMessage({ command: 'equilibrium', positions: state.positions, tool: state.tool });
}

function frame() {
    loop.postMessage({ command: 'frame' });
    if (view.membrane) view.draw();
    requestAnimationFrame(frame);
}

document.addEventListener('visibilitychange', () => loop.postMessage({ command: 'run', running: !document.hidden }));
$('view').addEventListener('webglcontextlost', (event) => {
    event.preventDefault();
    notice('The graphics context is lost; the picture returns when the browser restores it.');
});
$('view').addEventListener('webglcontextrestored', () => notice(''));

showDial();
both({ command: 'start', bytes, shape: Number($('shape').value), options: options() });
solver.postMessage({ command: 'run', running: false });
setInterval(askForEquilibrium, 500);
requestAnimationFrame(frame);

/// For tests: what a person sees as numbers.
window.membrane = { state: () => state, record: () => record, replayed: () => replayed, error: () => error, open, play };
