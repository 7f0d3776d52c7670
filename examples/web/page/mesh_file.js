// SPDX-License-Identifier: MIT
//
// Reads a triangle mesh from an OBJ, PLY, STL or OFF file.
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";

const maxVertices = 50000;
const size = 20e-3; // the largest extent that a mesh is scaled to [m]: files do not say their unit

// Corners of triangles, three numbers each.
function cornersOf(geometry) {
  const { position } = geometry.attributes;
  if (!position) return [];
  const corners = [];
  const count = geometry.index ? geometry.index.count : position.count;
  for (let i = 0; i < count; ++i) {
    const v = geometry.index ? geometry.index.getX(i) : i;
    corners.push(position.getX(v), position.getY(v), position.getZ(v));
  }
  return corners;
}

function cornersOfObj(text) {
  const corners = [];
  new OBJLoader().parse(text).traverse((part) => {
    if (part.isMesh) for (const number of cornersOf(part.geometry)) corners.push(number);
  });
  return corners;
}

function cornersOfOff(text) {
  const numbers = text.replace(/#.*/g, "").replace(/^\s*OFF/, "").trim().split(/\s+/).map(Number);
  const [vertexCount, faceCount] = numbers;
  const corners = [];
  let at = 3 + 3 * vertexCount;
  for (let f = 0; f < faceCount; ++f) {
    const count = numbers[at];
    const face = numbers.slice(at + 1, at + 1 + count);
    if (!(count >= 0) || face.length < count) throw new Error("it ends within its faces");
    if (!face.every((v) => v >= 0 && v < vertexCount)) throw new Error(`face ${f} names no vertex`);
    for (let i = 2; i < count; ++i)
      for (const v of [face[0], face[i - 1], face[i]]) corners.push(...numbers.slice(3 + 3 * v, 6 + 3 * v));
    at += 1 + count;
  }
  return corners;
}

const readers = {
  obj: async (file) => cornersOfObj(await file.text()),
  off: async (file) => cornersOfOff(await file.text()),
  ply: async (file) => cornersOf(new PLYLoader().parse(await file.arrayBuffer())),
  stl: async (file) => cornersOf(new STLLoader().parse(await file.arrayBuffer())),
};

// Joins corners at equal positions: STL files have no others, and OBJ files may split a vertex at a seam.
function joined(corners) {
  const numbers = new Map();
  const positions = [];
  const triangles = [];
  for (let i = 0; i < corners.length; i += 3) {
    const corner = corners.slice(i, i + 3);
    const key = corner.join();
    if (!numbers.has(key)) {
      numbers.set(key, positions.length / 3);
      positions.push(...corner);
    }
    triangles.push(numbers.get(key));
  }
  return { positions, triangles };
}

// Moves the middle to the origin.
function scaled(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  const scale = size / Math.max(...high.map((x, k) => x - low[k]));
  return positions.map((x, i) => scale * (x - (low[i % 3] + high[i % 3]) / 2));
}

export async function readMesh(file) {
  const read = readers[file.name.split(".").pop().toLowerCase()];
  if (!read) throw new Error("the file is none of OBJ, PLY, STL and OFF");
  let corners;
  try {
    corners = await read(file);
  } catch (error) {
    throw new Error(`the file cannot be read: ${error.message}`);
  }
  if (corners.length === 0) throw new Error("the file has no triangle");
  const { positions, triangles } = joined(corners);
  if (positions.length > 3 * maxVertices)
    throw new Error(`the mesh has ${positions.length / 3} vertices, this page takes ${maxVertices}`);
  return { kind: "file", positions: scaled(positions), triangles };
}
