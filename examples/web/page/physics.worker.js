// SPDX-License-Identifier: MIT
//
// Runs the loop of one membrane. The text of the WebAssembly module, `loadMembrane`, stands in front of this one.
const module = loadMembrane();

let membrane; // the module
let loop;
let mesh; // what the loop was built from
let replaying = false;
let placed = false; // whether the pointer has put the tool anywhere yet

function built({ settings }) {
  loop?.delete();
  placed = false;
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

  // A displayed frame: the ticks since the last one, at most as long as `budget` [ms].
  frame({ ticks, elapsed, budget, target, place, close, moment }) {
    let left = 0;
    let done = ticks;
    if (replaying) {
      left = loop.replay(ticks, budget);
      replaying = left > 0;
    } else {
      if (place || !placed) loop.place(place ?? target);
      placed = true;
      done = loop.run(ticks, budget, target, close);
    }
    const now = loop.moment();
    const state = {
      type: "frame",
      done,
      elapsed,
      left,
      positions: new Float32Array(loop.positions()),
      normals: new Float32Array(loop.normals()),
      layers: new Uint8Array(loop.layers()),
      contact: new Uint32Array(loop.contactTriangles()),
      forces: new Float64Array(loop.forces()),
      times: new Float64Array(loop.times()),
      force: loop.force(),
      tool: now.tool.position,
      touching: now.contact.touching,
      holding: now.grasp.triangle >= 0,
    };
    if (moment) state.moment = { ...now, positions: new Float64Array(loop.positions()) };
    postMessage(state, [state.positions.buffer, state.normals.buffer]);
  },

  // A recording begins at rest, so that a replay can begin where it did.
  record(message) {
    replaying = false;
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
    replaying = true;
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
