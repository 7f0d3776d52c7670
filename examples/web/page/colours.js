// SPDX-License-Identifier: MIT
//
// One sequential scale, pale to dark: its lightness alone orders the values, for all kinds of colour vision.
const stops = [0xf3f1ee, 0xd9dfe8, 0xa6bddb, 0x74a9cf, 0x3690c0, 0x0570b0, 0x045a8d, 0x023858];

const channels = stops.map((stop) => [16, 8, 0].map((shift) => ((stop >> shift) & 255) / 255));
// three.js computes in linear light.
const toLinear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
const linear = channels.map((colour) => colour.map(toLinear));

const css = stops.map((stop) => `#${stop.toString(16).padStart(6, "0")}`);
export const gradient = `linear-gradient(to right, ${css.join(", ")})`;

// Writes the colour of `value`, 0 to 1, at `index` of an array of colours.
export function paint(colours, index, value) {
  const at = Math.min(Math.max(value, 0), 1) * (linear.length - 1);
  const below = Math.min(Math.floor(at), linear.length - 2);
  for (let k = 0; k < 3; ++k) {
    const low = linear[below][k];
    colours[3 * index + k] = low + (at - below) * (linear[below + 1][k] - low);
  }
}
