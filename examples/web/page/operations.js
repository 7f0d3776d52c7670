// SPDX-License-Identifier: MIT
//
// What the page shows of each operation.
const mm = (length) => `${(1e3 * length).toFixed(1)} mm`;

export const operations = {
  capsulorhexis: {
    name: "Capsulorhexis",
    hint: "Take the flap beside the cut and draw it round: the tear follows. Drag beside the capsule to turn the view.",
    maxTension: 8, // of the colours [N/m]
    force: 10e-3, // that is usual [N]
    body: 0xe2d3b4,
    progress: ({ length, circularity, finished }) =>
      !finished
        ? `${mm(length)} torn`
        : circularity > 0
          ? `${mm(length)} torn: the opening is closed, circularity ${circularity.toFixed(3)}`
          : `${mm(length)} torn: the tear has run out`,
  },
  peel: {
    name: "Peel",
    hint: "Take the free flap at the left, lift it and draw it over. Drag beside the membrane to turn the view.",
    maxTension: 0.12,
    force: 0.1e-3,
    body: 0xd9a58c,
    progress: ({ area }) => `${(1e6 * area).toFixed(2)} mm² peeled`,
  },
};
