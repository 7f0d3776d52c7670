// SPDX-License-Identifier: MIT
//
// Each displayed frame sends the hand to the loop, and draws the state after its last tick.
import { Hand } from "./hand.js";
import { readMesh } from "./mesh_file.js";
import { Panel } from "./panel.js";
import { Physics } from "./physics.js";
import { Plot } from "./plot.js";
import { csvOf, rowsOf, save } from "./recording.js";
import { Scene } from "./scene.js";
import { TickTimes } from "./tick_times.js";

let physics; // of the present membrane, once it is built
let radius; // of its tool [m]
let recording = false;
let rows = null; // of the last recording
let state = null; // of the last frame
let frames = 0;
let waiting = false; // for the state of the loop
let requirement = null; // of the settings to choose
let replaying = false;
let held = null; // for tests: waits for the error of a tick

const view = document.getElementById("view");
const plot = new Plot(document.getElementById("plot"));
const panel = new Panel({
  mesh: open,
  file: openFile,
  settings() {
    physics?.send({ type: "configure", settings: panel.settings });
    plot.clearErrors();
  },
  choose: beginChoice,
  record: () => (recording ? physics.send({ type: "stop" }) : begin({ type: "record" })),
  replay: () => begin({ type: "replay", rows }),
  download: () => save(csvOf(rows), "membrane.csv"),
  reset(demonstrate) {
    physics.send({ type: "reset", kind: physics.build.mesh.kind, demonstrate });
    beginAtRest();
  },
});
const scene = new Scene(view);
const hand = new Hand(view, scene, panel.options);
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
      panel.begin(mesh, name, message.size);
      scene.build(message, panel.operation);
      setRecording(false, null);
      replaying = false;
      beginAtRest();
      physics.send({ type: "hide", hidden: document.hidden });
      if (message.findings) panel.notice(`${name} is accepted, with warnings.\n${message.findings}`);
      else if (mesh.kind !== "file") panel.hint(panel.operation?.hint);
      else panel.hint(`${name} has no defect. It is scaled to 20 mm across.`);
    },
    refused({ text }) {
      next.end();
      panel.notice(`${name} is refused.\n${text}The library's repair() corrects such defects, this page does not.`);
    },
    failed({ text }) {
      if (physics !== next) next.end();
      waiting = false;
      panel.notice(`${name}: ${text}`);
    },
    frame: show,
    recorded: (message) => setRecording(false, message.rows),
    equilibrium: showError,
    stroke: choose,
    chosen: (message) => panel.showChoice(message.choice, requirement),
  });
}

async function openFile(file) {
  if (!file) return;
  try {
    panel.notice("");
    if (recording) {
      panel.notice("Stop the recording first.");
    } else if (/\.csv$/i.test(file.name)) {
      setRecording(false, rowsOf(await file.text()));
      begin({ type: "replay", rows });
    } else {
      open(await readMesh(file), file.name);
    }
  } catch (refusal) {
    panel.notice(`${file.name} is refused: ${refusal.message}.`);
  }
}

function beginAtRest() {
  hand.reset();
  plot.clear(panel.operation ? 1e3 * panel.operation.force : undefined);
  times.clear();
}

// Begins a recording or a replay.
function begin(message) {
  physics.send({ ...message, settings: panel.settings });
  replaying = message.type === "replay";
  if (message.type === "record") setRecording(true, null);
  beginAtRest();
}

function setRecording(on, recorded) {
  recording = on;
  rows = recorded;
  panel.showRecording(recording, rows);
}

function beginChoice(asked) {
  requirement = asked;
  panel.showChoosing();
  physics.send({ type: "stroke" });
}

function choose({ rows: stroke }) {
  if (stroke.length > 0) physics.choose(stroke, panel.settings, requirement);
  else panel.showChoice(null, requirement);
}

// Asks the loop for its state.
function request() {
  waiting = true;
  const { colour, show } = panel.options;
  physics.send({ type: "frame", moment: physics.idle, colour, show, ...hand.frame(radius) });
}

function show(message) {
  waiting = false;
  state = message;
  ++frames;
  hand.holding = message.holding;
  plot.add(message.forces, message.forceError);
  times.add(message.times, message.elapsed);
  if (message.moment && message.touching) physics.measure(message.moment, plot.time);
  scene.show(message, panel.scale());
  panel.showForce(Math.hypot(...message.force), message.forceError, message.touching || message.holding);
  panel.showProgress(message.progress);
  panel.showReplay(message.left > 0 ? "runs" : replaying ? "ended" : "", message.differing);
  if (plot.worstError() === null) panel.showError(undefined, null);
}

function showError({ exact, reaction, build, time }) {
  let error = null; // of the force, relative
  if (exact) {
    const force = Math.hypot(...exact);
    error = force > 0 ? Math.hypot(...exact.map((f, k) => f - reaction[k])) / force : 0;
    plot.addExact(time, force, error);
  }
  panel.showError(error, plot.worstError());
  if (held && build > held.build) held.resolve({ error, reaction });
}

function frame() {
  requestAnimationFrame(frame);
  if (physics && !waiting) request();
  scene.draw();
}

window.membrane = {
  get state() {
    const { force, touching, holding, positions, left, progress } = state ?? { force: [0, 0, 0], positions: [] };
    const vertices = positions.length / 3;
    const run = { frames, recording, left, progress, time: plot.time, ...times.summary() };
    return { force, forceError: state?.forceError, touching, holding, vertices, ...run };
  },
  // What is drawn.
  get surface() {
    return { positions: [...state.positions], triangles: [...scene.triangles] };
  },
  csv: () => csvOf(rows),

  // Replays the first ticks of a recording with the present settings and stays there. Returns the reaction of the
  // membrane [N] and its relative error.
  hold(ticks, recorded = rows) {
    return new Promise((resolve) => {
      held = { build: state.build, resolve };
      begin({ type: "hold", rows: recorded, ticks });
    });
  },
};

document.addEventListener("visibilitychange", () => physics?.send({ type: "hide", hidden: document.hidden }));
view.addEventListener("webglcontextlost", () => panel.notice("The browser has lost the graphics context."));
view.addEventListener("webglcontextrestored", () => panel.notice(""));
setInterval(() => panel.showTimes(times.summary()), 500);
document.getElementById("mesh").dispatchEvent(new Event("change"));
requestAnimationFrame(frame);
