// SPDX-License-Identifier: MIT
import { gradient } from "./colours.js";
import { Hand } from "./hand.js";
import { readMesh } from "./mesh_file.js";
import { Physics } from "./physics.js";
import { Plot } from "./plot.js";
import { csvOf, save } from "./recording.js";
import { Scene } from "./scene.js";
import { TickTimes } from "./tick_times.js";

const maxTicks = 250; // of a frame: after a pause the membrane goes on where it was
const budget = 40; // of a frame's ticks [ms]
const measureInterval = 0.5; // between equilibria, at least [s]

const element = (id) => document.getElementById(id);
const options = { mode: "press", depth: 0.2, colour: "displacement" };
const settings = { layers: 6, sweeps: 2, safeStep: false, volumeSprings: true };

const scene = new Scene(element("view"));
const hand = new Hand(element("view"), scene, options);
const plot = new Plot(element("plot"));
const times = new TickTimes();

let physics; // of the present membrane, once it is built
let body; // { radius, size } [m]
let waiting = false; // for the frame of the loop
let last = 0; // time of the last frame that was asked for [ms]
let measured = 0; // time of the last equilibrium [s]
let rows = null; // of the recording
let recording = false;
let frames = 0;
let state = null;

function notice(text) {
  element("notice").hidden = !text;
  element("notice").querySelector("pre").textContent = text;
}

// Changes to the membrane `mesh`, unless the library refuses it.
function open(mesh, name) {
  notice("");
  const next = new Physics(mesh, settings, {
    built(message) {
      physics?.end();
      physics = next;
      body = message;
      scene.build(message);
      hand.reset();
      times.clear();
      plot.clear();
      rows = null;
      setRecording(false);
      waiting = false;
      element("error").textContent = "–";
      if (message.findings) notice(`${name} is accepted, with warnings:\n${message.findings}`);
    },
    refused({ text }) {
      next.end();
      notice(`${name} is refused. What was found:\n${text}`);
    },
    failed({ text }) {
      if (physics !== next) next.end();
      waiting = false;
      notice(`${name}: ${text}`);
    },
    frame: show,
    recorded(message) {
      rows = message.rows;
      setRecording(false);
    },
    equilibrium: showError,
  });
}

async function openFile(file) {
  if (!file) return;
  try {
    open(await readMesh(file), file.name);
  } catch (error) {
    notice(`${file.name} is refused: ${error.message}.`);
  }
}

function setRecording(on) {
  recording = on;
  element("record").textContent = on ? "Stop" : "Record";
  element("replay").disabled = element("download").disabled = on || !rows;
}

function show(message) {
  waiting = false;
  state = message;
  ++frames;
  hand.holding = message.holding;
  plot.add(message.forces);
  times.add(message.times);
  if (message.moment && message.touching) physics.measure(message.moment, plot.time);
  state.largest = scene.show(message, options.colour);
  showScale();
  const newtons = Math.hypot(...message.force);
  element("force").textContent = `${newtons.toFixed(4)} N`;
  if (newtons > 0) element("hint").classList.add("done");
}

function showError({ exact, reaction, at }) {
  if (!exact) {
    element("error").textContent = "no equilibrium found";
    return;
  }
  const size = Math.hypot(...exact);
  const error = Math.hypot(...exact.map((f, k) => f - reaction[k]));
  plot.addExact(at, size);
  state.error = error / size;
  element("error").textContent = size > 0 ? `${((100 * error) / size).toPrecision(2)} %` : "–";
}

function showScale() {
  const [low, high] = {
    displacement: ["0", `${(300 * body.size).toFixed(1)} mm`],
    layers: ["not in the queue", "layer 0"],
    contact: ["", "orange: triangles with a contact force"],
  }[options.colour];
  const [from, to] = element("scale").querySelectorAll("span");
  from.textContent = low;
  to.textContent = high;
}

function showTimes() {
  const { median, p99, worst, speed } = times.summary();
  const text = (milliseconds) => (milliseconds === undefined ? "–" : `${(1e3 * milliseconds).toFixed(0)} µs`);
  element("median").textContent = text(median);
  element("p99").textContent = text(p99);
  element("worst").textContent = text(worst);
  element("speed").textContent = speed > 0.97 ? "real time" : `${(100 * speed).toFixed(0)} % of real time`;
}

// Asks the loop for the ticks since the last frame, unless it is still busy with them.
function frame(now) {
  requestAnimationFrame(frame);
  scene.controls.update();
  if (physics && !waiting) {
    const elapsed = now - last;
    const ticks = Math.min(Math.round(elapsed), maxTicks);
    if (ticks > 0) {
      last += elapsed > maxTicks ? elapsed : ticks;
      times.elapsed(Math.min(elapsed, maxTicks));
      const moment = !physics.measuring && plot.time > measured + measureInterval;
      if (moment) measured = plot.time;
      waiting = true;
      physics.send({ type: "frame", ticks, budget, moment, ...hand.frame(body.radius) });
    }
  }
  scene.draw();
}

function listen() {
  const apply = () => physics?.send({ type: "configure", settings });
  const dial = (id, text, set) => {
    const input = element(id);
    const changed = () => {
      set(Number(input.value));
      input.parentElement.querySelector("output").textContent = text(input.value);
    };
    input.addEventListener("input", changed);
    changed();
  };
  dial("layers", (n) => n, (n) => ((settings.layers = n), apply()));
  dial("sweeps", (n) => n, (n) => ((settings.sweeps = n), apply()));
  dial("depth", (n) => `${(10 * n).toFixed(0)} % of the size`, (n) => (options.depth = n / 10));
  element("volumeSprings").addEventListener("change", ({ target }) => {
    settings.volumeSprings = target.checked;
    apply();
  });
  element("rule").addEventListener("change", ({ target }) => {
    settings.safeStep = target.value === "safe";
    apply();
  });
  element("mode").addEventListener("change", ({ target }) => (options.mode = target.value));
  element("colour").addEventListener("change", ({ target }) => (options.colour = target.value));
  element("mesh").addEventListener("change", ({ target }) => {
    const [kind, subdivisions] = target.value.split(" ");
    open({ kind, subdivisions: Number(subdivisions) }, target.selectedOptions[0].text);
  });
  element("file").addEventListener("change", ({ target }) => openFile(target.files[0]));
  element("notice").querySelector("button").addEventListener("click", () => notice(""));
}

function listenToRecording() {
  element("record").addEventListener("click", () => {
    if (recording) return physics.send({ type: "stop" });
    begin({ type: "record", settings });
    setRecording(true);
  });
  element("replay").addEventListener("click", () => begin({ type: "replay", settings, rows }));
  element("download").addEventListener("click", () => save(csvOf(rows), "membrane.csv"));
}

// A recording and a replay begin at rest.
function begin(message) {
  physics.send(message);
  hand.reset();
  plot.clear();
}

function listenToKeys() {
  const change = (input, value) => {
    input.value = value;
    input.dispatchEvent(new Event("input"));
  };
  const actions = {
    g: () => element("mode").querySelector(`input:not(:checked)`).click(),
    "+": () => change(element("depth"), Number(element("depth").value) + 0.5),
    "-": () => change(element("depth"), Number(element("depth").value) - 0.5),
  };
  element("view").addEventListener("keydown", ({ key }) => actions[key.toLowerCase()]?.());
}

function listenToFiles() {
  const over = (on) => (event) => {
    event.preventDefault();
    document.body.classList.toggle("dropping", on);
  };
  addEventListener("dragover", over(true));
  addEventListener("dragleave", over(false));
  addEventListener("drop", (event) => {
    over(false)(event);
    openFile(event.dataTransfer.files[0]);
  });
}

const view = element("view");
view.addEventListener("webglcontextlost", () => notice("The graphics context was lost. Waiting for the browser."));
view.addEventListener("webglcontextrestored", () => notice(""));

// For tests.
window.membrane = {
  get state() {
    return { ...state, frames, time: plot.time, recording, rows: rows?.length ?? 0, ...times.summary() };
  },
  csv: () => csvOf(rows),
};

element("scale").querySelector("i").style.background = gradient;
listen();
listenToRecording();
listenToKeys();
listenToFiles();
setInterval(showTimes, 500);
element("mesh").dispatchEvent(new Event("change"));
requestAnimationFrame(frame);
