// SPDX-License-Identifier: MIT
//
// Finds the equilibrium of a moment of the loop: the measure of its error; and settings for a stroke. The text of the
// WebAssembly module stands in front of this one.
const module = loadMembrane();

let loop; // only its mesh and its constants are used

const handlers = {
  build(membrane, { mesh, settings }) {
    const { kind, subdivisions, positions, triangles } = mesh;
    loop?.delete();
    if (kind === "file") loop = membrane.surface(positions, triangles, settings);
    else loop = kind === "sphere" ? membrane.sphere(subdivisions, settings) : membrane[kind](settings);
  },

  measure(membrane, { moment, time }) {
    let exact = null;
    try {
      exact = loop.equilibrium(moment, moment.positions);
    } finally {
      postMessage({ type: "equilibrium", exact, reaction: moment.reaction, build: moment.build, time });
    }
  },

  choose(membrane, { settings, stroke, forceError, time }) {
    let choice = null;
    try {
      choice = loop.choose(settings, stroke, forceError, time);
    } finally {
      postMessage({ type: "chosen", choice });
    }
  },
};

onmessage = async ({ data }) => handlers[data.type](await module, data);
