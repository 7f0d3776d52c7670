// SPDX-License-Identifier: MIT
//
// A recording as a CSV file: a row for each tick, numbers with all their digits.
const names = ["time [s]", "x [m]", "y [m]", "z [m]", "vx [m/s]", "vy [m/s]", "vz [m/s]", "grasping", "placed"].concat(
  ["fx [N]", "fy [N]", "fz [N]", "layers", "sweeps", "safe_step", "volume_springs"],
);

export function csvOf(rows) {
  const lines = [names.join()];
  for (let i = 0; i < rows.length; i += names.length) lines.push(rows.slice(i, i + names.length).join());
  return `${lines.join("\n")}\n`;
}

export function save(text, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
