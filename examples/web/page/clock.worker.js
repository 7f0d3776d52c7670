// SPDX-License-Identifier: MIT
//
// The time of a loop: as many ticks as milliseconds have passed, however often the page is drawn. The text of each
// worker with a loop stands behind this one.
const maxPause = 100; // longer ones are not made up for: the membrane goes on where it was [ms]
const budget = 25; // of ticks in a row: messages are read in between [ms]

let last = 0; // time up to which ticks were made [ms]
let lastFrame = 0; // [ms]

// Runs a loop up to now, unless it stands still.
function advance(loop, still) {
  const now = performance.now();
  if (!loop || still) {
    last = now;
    return;
  }
  const due = Math.min(now - last, maxPause);
  const ticks = Math.floor(due);
  last = now - due + ticks;
  loop.run(ticks, budget);
}

// The time since the last frame [ms].
function elapsed() {
  const begin = lastFrame;
  lastFrame = performance.now();
  return lastFrame - begin;
}
