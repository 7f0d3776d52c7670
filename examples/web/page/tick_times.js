// SPDX-License-Identifier: MIT
//
// Times of the last thousand ticks. Browsers round their clock, to 0.1 ms and more: so the median is that of means over
// frames.
const count = 1000;

const at = (sorted, part) => sorted[Math.min(Math.floor(part * sorted.length), sorted.length - 1)];

export class TickTimes {
  constructor() {
    this.clear();
  }

  clear() {
    this.ticks = []; // [ms]
    this.means = [];
    this.due = 0; // ticks of real time, and those that were made
    this.done = 0;
  }

  // The times of the ticks of a frame, and the real time since the last frame [ms].
  add(times, elapsed) {
    this.due = 0.98 * this.due + elapsed;
    this.done = 0.98 * this.done + times.length;
    const mean = times.reduce((sum, time) => sum + time, 0) / times.length;
    for (const time of times) {
      this.ticks.push(time);
      this.means.push(mean);
    }
    for (const list of [this.ticks, this.means]) list.splice(0, list.length - count);
  }

  // [ms], and the speed of simulated time as a part of real time.
  summary() {
    const ticks = this.ticks.toSorted((a, b) => a - b);
    const means = this.means.toSorted((a, b) => a - b);
    return { median: at(means, 0.5), p99: at(ticks, 0.99), worst: at(ticks, 1), speed: this.done / this.due };
  }
}
