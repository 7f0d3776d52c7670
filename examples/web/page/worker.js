// SPDX-License-Identifier: MIT
//
// The physics, away from the drawing: as many ticks of 1 ms as time has passed. A second worker of the same code computes
// equilibria.
import { Membrane } from './membrane.js';

const dt = 1e-3;         // [s]
const longest = 50;      // most ticks made up for at once; a page that was hidden goes on where it was
const handTime = 0.012;  // [s] in which the tool follows the pointer

let membrane;
let options;
let running = true;
let tool = { position: [0, 0, 1], velocity: [0, 0, 0], radius: 2e-3, grasping: 0 };
let target = tool.position;
let replay = [];
let recording = null;
let last = performance.now();
let time = 0;
let news = emptyNews();

function emptyNews() {
    return { forces: [], times: [] };
}

function moveTo(position) {
    const velocity = position.map((p, k) => (p - tool.position[k]) / dt);
    tool = { ...tool, position, velocity };
}

function tick() {
    const replayed = replay.shift();
    if (replayed) {
        moveTo(replayed.slice(0, 3));
        tool.grasping = replayed[3];
    } else {
        const share = 1 - Math.exp(-dt / handTime);
        moveTo(tool.position.map((p, k) => p + share * (target[k] - p)));
    }
    const result = membrane.tick(tool);
    time += dt;
    news.forces.push(Math.hypot(...result.force));
    recording?.push([time, ...tool.position, tool.grasping, ...result.force, result.depth]);
    if (replayed && replay.length === 0) {
        target = [0, 0, 1];
        endRecording('replayed');
    }
    return result;
}

function endRecording(name) {
    postMessage({ [name]: recording });
    recording = null;
}

function advance() {
    const now = performance.now();
    const count = Math.min(Math.floor((now - last) / (1e3 * dt)), longest);
    if (count < 1 || !membrane || !running) {
        if (!running) last = now;
        return;
    }
    last = count === longest ? now : last + count * 1e3 * dt;
    const begun = performance.now();
    let result;
    for (let i = 0; i < count; ++i) result = tick();
    news.times.push((1e3 * (performance.now() - begun)) / count);
    news.result = result;
}

function report() {
    if (!membrane) return;
    const positions = Float32Array.from(membrane.positions), normals = Float32Array.from(membrane.normals);
    const { result, forces, times } = news;
    postMessage({ state: { positions, normals, result, forces, times, time, tool } },
        [positions.buffer, normals.buffer]);
    news = emptyNews();
}

function built() {
    membrane.setOptions(options);
    target = [0, 0, 1];
    tool = { ...tool, position: target, velocity: [0, 0, 0], grasping: 0 };
    replay = [];
    postMessage({ built: { rest: Float32Array.from(membrane.rest), triangles: Uint32Array.from(membrane.triangles) } });
}

const commands = {
    async start(message) {
        membrane = await Membrane.from(message.bytes);
        options = message.options;
        membrane.build(message.shape);
        built();
    },
    build(message) {
        membrane.build(message.shape);
        built();
    },
    buildFile(message) {
        const { refused, findings } = membrane.buildFile(message.points, message.triangles);
        if (!refused) built();
        postMessage({ findings: { refused, findings } });
    },
    options(message) {
        options = message.options;
        membrane.setOptions(options);
    },
    place(message) {
        tool = { ...tool, ...message.tool, velocity: [0, 0, 0] };
        target = tool.position;
    },
    aim(message) {
        target = message.position;
        tool.grasping = message.grasping;
    },
    run(message) {
        running = message.running;
    },
    record(message) {
        if (message.on) recording = [];
        else endRecording('recorded');
    },
    // From the shape at rest, so that the same path gives the same forces.
    replay(message) {
        membrane.build(message.shape);
        built();
        replay = message.path;
        recording = [];
    },
    // In the second worker: positions and tool of a tick, from the first.
    equilibrium(message) {
        membrane.positions.set(message.positions);
        const { force, valid } = membrane.equilibrium(message.tool);
        postMessage({ equilibrium: { force, valid } });
    },
    frame: report,
};

onmessage = ({ data }) => commands[data.command](data);
setInterval(advance, 4);
