// SPDX-License-Identifier: MIT
//
// Runs an operation by its own clock. The texts of the WebAssembly module and of the clock stand in front of this one.
const module = loadMembrane();

let membrane; // the module
let loop;
let hidden = false; // no time passes while the page is hidden

function begin(kind) {
  loop?.delete();
  loop = membrane.operation(kind);
}

const handlers = {
  build({ mesh: { kind } }) {
    begin(kind);
    postMessage({
      type: "built",
      rest: new Float32Array(loop.rest()),
      triangles: new Uint32Array(loop.changedTriangles()),
      body: { positions: new Float32Array(loop.bodyPositions()), triangles: new Uint32Array(loop.bodyTriangles()) },
      radius: loop.radius(),
      size: loop.size(),
      findings: "",
    });
  },

  // Makes the membrane whole again, and may demonstrate the operation.
  reset({ kind, demonstrate }) {
    begin(kind);
    if (demonstrate) loop.demonstrate();
  },

  hide(message) {
    hidden = message.hidden;
  },

  // For a displayed frame: where the hand is, and the state after the ticks since the last frame.
  frame({ target, place, close, colour }) {
    if (place) loop.place(place);
    loop.aim(target, close);
    const { position, force, closed } = loop.forceps();
    const changed = loop.changedTriangles();
    const state = {
      type: "frame",
      elapsed: elapsed(),
      left: 0,
      differing: 0,
      positions: new Float32Array(loop.positions()),
      triangles: changed && new Uint32Array(changed),
      values: new Float32Array(loop.values(colour)),
      contact: [],
      tracked: [],
      boxes: [],
      forces: new Float64Array(loop.forces()),
      times: new Float64Array(loop.times()),
      force,
      tool: position,
      touching: closed,
      holding: closed,
      progress: loop.progress(),
    };
    loop.beginFrame();
    postMessage(state, [state.positions.buffer, state.values.buffer]);
  },
};

onmessage = async ({ data }) => {
  membrane ??= await module;
  try {
    handlers[data.type]?.(data);
  } catch (error) {
    postMessage({ type: "failed", text: error.message });
  }
};
setInterval(() => advance(loop, hidden), 1);
