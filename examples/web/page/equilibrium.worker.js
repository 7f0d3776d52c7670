// SPDX-License-Identifier: MIT
//
// Finds the equilibrium of a moment of the loop: the measure of its error. The text of the WebAssembly module stands in
// front of this one.
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
    const exact = loop.equilibrium(moment, moment.positions);
    postMessage({ exact, reaction: moment.reaction, time });
  },
};

onmessage = async ({ data }) => {
  const membrane = await module;
  try {
    handlers[data.type](membrane, data);
  } catch {
    postMessage({ exact: null });
  }
};
