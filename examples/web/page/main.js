// SPDX-License-Identifier: MIT
//
// Each displayed frame asks the loop for the ticks since the last one, and draws the state after the last tick.
import { Hand } from "./hand.js";
import { readMesh } from "./mesh_file.js";
import { Panel } from "./panel.js";
import { Physics } from "./physics.js";
import { Plot } from "./plot.js";
import { csvOf, save } from "./recording.js";
import { Scene } from "./scene.js";
import { TickTimes } from "./tick_times.js";

const maxTicks = 250; // of a frame: after a pause the membrane goes on where it was
const [minBudget, maxBudget] = [40, 100]; // for the ticks of a frame [ms]

let physics; // of the present membrane, once it is built
let radius; // of its tool [m]
let recording = false;
let rows = null; // of the last recording
let state = null; // of the last frame
let frames = 0;
let waiting = false; // for a frame of the loop
let last = 0; // time up to which ticks were asked for [ms]

const view = document.getElementById("view");
const panel = new Panel({
  mesh: open,
  file: openFile,
  settings: () => physics?.send({ type: "configure", settings: panel.settings }),
  record: () => (recording ? physics.send({ type: "stop" }) : begin({ type: "record" })),
  replay: () => begin({ type: "replay", rows }),
  download: () => save(csvOf(rows), "membrane.csv"),
});
const scene = new Scene(view);
const hand = new Hand(view, scene, panel.options);
const plot = new Plot(document.getElementById("plot"));
const times = new TickTimes();

// Changes to the membrane `mesh`, unless the library refuses it.
function open(mesh, name) {
  panel.notice("");
  const next = new Physics(mesh, panel.settings, {
    built(message) {
      physics?.end();
      physics = next;
      waiting = false;
      radius = message.radius;
      scene.build(message);
      panel.begin(mesh, name, message.size);
      times.clear();
      setRecording(false, null);
      beginAtRest();
      if (message.findings) panel.notice(`${name} is accepted, with warnings.\n${message.findings}`);
      else if (mesh.kind === "file") panel.hint(`${name} has no defect. It is scaled to 20 mm across.`);
    },
    refused({ text }) {
      next.end();
      panel.notice(`${name} is refused.\n${text}`);
    },
    failed({ text }) {
      if (physics !== next) next.end();
      waiting = false;
      panel.notice(`${name}: ${text}`);
    },
    frame: show,
    recorded: (message) => setRecording(false, message.rows),
    equilibrium: showError,
  });
}

async function openFile(file) {
  if (!file) return;
  try {
    open(await readMesh(file), file.name);
  } catch (refusal) {
    panel.notice(`${file.name} is refused: ${refusal.message}.`);
  }
}

function beginAtRest() {
  hand.reset();
  plot.clear();
}

// Begins a recording or a replay.
function begin(message) {
  physics.send({ ...message, settings: panel.settings });
  if (message.type === "record") setRecording(true, null);
  beginAtRest();
}

function setRecording(on, recorded) {
  recording = on;
  rows = recorded;
  panel.showRecording(recording, rows);
}

// Asks the loop for the ticks since the last frame.
function advance(now) {
  const elapsed = Math.min(now - last, maxTicks);
  const ticks = Math.round(elapsed);
  if (ticks === 0) return;
  last = now - elapsed + ticks;
  const budget = Math.min(Math.max(elapsed, minBudget), maxBudget);
  waiting = true;
  physics.send({ type: "frame", ticks, elapsed, budget, moment: physics.idle, ...hand.frame(radius) });
}

function show(message) {
  waiting = false;
  state = message;
  ++frames;
  hand.holding = message.holding;
  plot.add(message.forces);
  times.add(message.times, message.elapsed);
  if (message.moment && message.touching) physics.measure(message.moment, plot.time);
  else if (message.moment) probe?.measured({ error: null, reaction: message.force });
  scene.show(message, panel.options.colour);
  panel.showForce(Math.hypot(...message.force), message.left > 0);
}

function showError({ exact, reaction, time }) {
  let error = null; // of the force, relative
  if (exact) {
    const force = Math.hypot(...exact);
    error = force > 0 ? Math.hypot(...exact.map((f, k) => f - reaction[k])) / force : 0;
    plot.addExact(time, force, error);
  }
  panel.showError(error, plot.worstError());
  probe?.measured({ error, reaction });
}

function frame(now) {
  requestAnimationFrame(frame);
  if (physics && !waiting && probe) probe.start();
  else if (physics && !waiting) advance(now);
  scene.draw();
}

// For tests: replays the first ticks of the recording with the present settings, and returns the reaction of the
// membrane there [N] and its relative error.
let probe = null;
function replayTo(ticks) {
  return new Promise((resolve) => {
    probe = {
      start() {
        if (physics.measuring) return;
        begin({ type: "replay", rows });
        waiting = true;
        physics.send({ type: "frame", ticks, elapsed: ticks, budget: Infinity, moment: true });
        this.measured = (value) => {
          probe = null;
          resolve(value);
        };
        this.start = () => {};
      },
      measured() {},
    };
  });
}
window.membrane = {
  get state() {
    const { force, touching, holding, positions } = state ?? { force: [0, 0, 0], positions: [] };
    const vertices = positions.length / 3;
    return { force, touching, holding, vertices, frames, recording, time: plot.time, ...times.summary() };
  },
  csv: () => csvOf(rows),
  replayTo,
};

view.addEventListener("webglcontextlost", () => panel.notice("The browser has lost the graphics context."));
view.addEventListener("webglcontextrestored", () => panel.notice(""));
setInterval(() => panel.showTimes(times.summary()), 500);
document.getElementById("mesh").dispatchEvent(new Event("change"));
requestAnimationFrame(frame);
