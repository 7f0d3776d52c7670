// SPDX-License-Identifier: MIT
//
// A recording as a CSV file: a row for each tick, numbers with all their digits.
const names = ["time [s]", "x [m]", "y [m]", "z [m]", "vx [m/s]", "vy [m/s]", "vz [m/s]", "grasping", "placed"].concat(
  ["fx [N]", "fy [N]", "fz [N]", "layers", "sweeps", "safe_step", "volume_springs", "coarse_correction"],
);

export function csvOf(rows) {
  const lines = [names.join()];
  for (let i = 0; i < rows.length; i += names.length) lines.push(rows.slice(i, i + names.length).join());
  return `${lines.join("\n")}\n`;
}

export function rowsOf(csv) {
  const [header, ...lines] = csv.trim().split(/\r?\n/);
  if (header !== names.join()) throw new Error("its columns are not those of a recording of this page");
  const rows = lines.map((line) => line.split(",").map(Number));
  const bad = rows.findIndex((row) => row.length !== names.length || !row.every(Number.isFinite));
  if (bad >= 0) throw new Error(`line ${bad + 2} does not have ${names.length} numbers`);
  const odd = rows.findIndex((row) => !(row[12] >= 0 && row[13] >= 1 && row[13] <= 1000));
  if (odd >= 0) throw new Error(`line ${odd + 2} must have layers of 0 or more, and 1 to 1000 sweeps`);
  return Float64Array.from(rows.flat());
}

export function save(text, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
