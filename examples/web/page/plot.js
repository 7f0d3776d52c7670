// SPDX-License-Identifier: MIT
//
// The force of the last seconds, a point for each tick, in a band of its estimated error, and the forces of the
// equilibria that were found.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const seconds = 5;
const pressForce = 10; // of a press [mN]

export class Plot {
  constructor(parent) {
    this.parent = parent;
    this.clear();
    const colour = (name) => () => getComputedStyle(parent).getPropertyValue(name);
    const axis = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false } };
    this.chart = new uPlot(
      {
        width: 100,
        height: 100,
        cursor: { show: false },
        scales: {
          x: { time: false, range: () => [this.time - seconds, this.time] },
          y: { range: (_, low, high) => [0, Math.max(this.usual, 1.15 * (high || 0))] },
        },
        axes: [
          { ...axis, size: 26, values: (_, splits) => splits.map((t) => (t < 0 ? "" : `${t} s`)) },
          { ...axis, size: 72, values: (_, splits) => splits.map((f) => `${f} mN`) },
        ],
        series: [
          {},
          { stroke: colour("--accent"), width: 2, points: { show: false } },
          { stroke: colour("--tool"), fill: colour("--tool"), paths: () => null, points: { show: true, size: 6 } },
          { points: { show: false } },
          { points: { show: false } },
        ],
        bands: [{ series: [3, 4], fill: colour("--band") }],
      },
      this.ticks,
      parent,
    );
    new ResizeObserver(() => this.resize()).observe(parent);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.chart.redraw());
  }

  // `usual`: a force that is seen in any case [mN].
  clear(usual = pressForce) {
    this.usual = usual;
    this.time = 0; // [s]
    this.errors = [];
    this.ticks = [[], [], [], [], []]; // time [s], force, that of the equilibrium, ends of the band [mN]
  }

  resize() {
    const style = getComputedStyle(this.parent);
    const padding = (...sides) => sides.reduce((sum, side) => sum + parseFloat(style[`padding${side}`]), 0);
    this.chart.setSize({
      width: this.parent.clientWidth - padding("Left", "Right"),
      height: this.parent.clientHeight - padding("Top", "Bottom"),
    });
  }

  // The forces of the ticks of a frame, and an estimate of the error of the last one, if there is one [N].
  add(forces, error) {
    const [times, values, exact, upper, lower] = this.ticks;
    for (const force of forces) {
      this.time += 1e-3;
      times.push(this.time);
      values.push(1e3 * force);
      exact.push(null);
      upper.push(error > 0 ? 1e3 * (force + error) : null);
      lower.push(error > 0 ? 1e3 * (force - error) : null);
    }
    const old = times.length - 1000 * seconds;
    if (old > 500) for (const list of this.ticks) list.splice(0, old);
    this.chart.setData(this.ticks);
  }

  // The force of an equilibrium at a past time [N], and the relative error of the tick.
  addExact(time, force, error) {
    const [times, , exact] = this.ticks;
    const i = times.length - 1 - Math.round(1e3 * (this.time - time));
    if (i >= 0) exact[i] = 1e3 * force;
    this.errors.push({ time, error });
  }

  // The largest error of the seconds in the plot; null without any.
  worstError() {
    this.errors = this.errors.filter(({ time }) => time > this.time - seconds);
    return this.errors.length > 0 ? Math.max(...this.errors.map(({ error }) => error)) : null;
  }

  clearErrors() {
    this.errors = [];
  }
}
