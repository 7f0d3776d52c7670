// SPDX-License-Identifier: MIT
//
// Runs the loop of one membrane by its own clock. The texts of the WebAssembly module, `loadMembrane`, and of the clock
// stand in front of this one.
const module = loadMembrane();

let membrane; // the module
let loop;
let mesh; // what the loop was built from
let builds = 0;
let hidden = false; // no time passes while the page is hidden,
let held = false; // or shows a tick of a recording,
let aimed = false; // or the pointer has put the tool nowhere yet

function built({ settings }) {
  loop?.delete();
  held = aimed = false;
  ++builds;
  const { kind, subdivisions, positions, triangles } = mesh;
  loop = {
    sphere: () => membrane.sphere(subdivisions, settings),
    cornea: () => membrane.cornea(settings),
    lens: () => membrane.lens(settings),
    file: () => membrane.surface(positions, triangles, settings),
  }[kind]();
}

const handlers = {
  build(message) {
    mesh = message.mesh;
    const findings =
      mesh.kind === "file" ? membrane.validate(mesh.positions, mesh.triangles) : { valid: true, text: "" };
    if (!findings.valid) return postMessage({ type: "refused", text: findings.text });
    built(message);
    postMessage({
      type: "built",
      rest: new Float32Array(loop.rest()),
      normals: new Float32Array(loop.normals()),
      triangles: new Uint32Array(loop.triangles()),
      radius: loop.radius(),
      size: loop.size(),
      findings: findings.text,
    });
  },

  configure({ settings }) {
    loop.configure(settings);
  },

  hide(message) {
    hidden = message.hidden;
  },

  // For a displayed frame: where the hand is, and the state after the ticks since the last frame.
  frame({ target, place, close, colour, show, moment }) {
    if (!held) {
      if (place || !aimed) loop.place(place ?? target);
      loop.aim(target, close);
      aimed = true;
    }
    const now = loop.moment();
    const state = {
      type: "frame",
      build: builds,
      elapsed: elapsed(),
      left: loop.left(),
      differing: loop.differing(),
      positions: new Float32Array(loop.positions()),
      normals: new Float32Array(loop.normals()),
      values: new Float32Array(loop.values(colour)),
      contact: show.contact ? new Uint32Array(loop.contactTriangles()) : [],
      tracked: show.contact ? new Uint32Array(loop.trackedTriangles()) : [],
      boxes: show.boxes ? new Float32Array(loop.treeBoxes()) : [],
      forces: new Float64Array(loop.forces()),
      times: new Float64Array(loop.times()),
      force: loop.force(),
      forceError: loop.forceError(),
      tool: now.tool.position,
      radius: loop.drawnRadius(),
      touching: now.contact.touching,
      holding: now.grasp.triangle >= 0,
    };
    if (moment) state.moment = { ...now, build: builds, positions: new Float64Array(loop.positions()) };
    loop.beginFrame();
    postMessage(state, [state.positions.buffer, state.normals.buffer, state.values.buffer]);
  },

  // A recording begins at rest, so that a replay can begin where it did.
  record(message) {
    built(message);
    loop.startRecording();
  },

  stop() {
    loop.stopRecording();
    postMessage({ type: "recorded", rows: new Float64Array(loop.recording()) });
  },

  replay(message) {
    built(message);
    loop.load(message.rows);
  },

  // Replays some ticks at once, and stays there.
  hold(message) {
    built(message);
    held = true;
    loop.load(message.rows);
    loop.run(message.ticks, Infinity);
  },

  stroke() {
    postMessage({ type: "stroke", rows: new Float64Array(loop.stroke()) });
  },
};

onmessage = async ({ data }) => {
  membrane ??= await module;
  try {
    handlers[data.type](data);
  } catch (error) {
    postMessage({ type: "failed", text: error.message });
  }
};
setInterval(() => advance(loop, hidden || held || !aimed), 1);
