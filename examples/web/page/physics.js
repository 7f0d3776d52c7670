// SPDX-License-Identifier: MIT
//
// The two workers: one runs the loop, the other finds equilibria. Each membrane gets new ones, so that no membrane can
// leave anything behind.
import module from "../../../build/web/membrane.wasm.js";
import clock from "./clock.worker.js";
import equilibriumSource from "./equilibrium.worker.js";
import operationSource from "./operation.worker.js";
import { operations } from "./operations.js";
import physicsSource from "./physics.worker.js";

// A page that was opened as a file may start a worker only from a blob.
function start(sources, receive) {
  const url = URL.createObjectURL(new Blob([module, ...sources], { type: "text/javascript" }));
  const worker = new Worker(url);
  URL.revokeObjectURL(url);
  worker.onmessage = ({ data }) => receive(data);
  return worker;
}

export class Physics {
  // `on` has a function for each type of message from the workers.
  constructor(mesh, settings, on) {
    this.on = on;
    this.busy = false; // the worker of equilibria
    this.next = 0; // time of the next measurement, at least [ms]
    this.build = { type: "build", mesh, settings };
    const source = mesh.kind in operations ? operationSource : physicsSource;
    this.loop = start([clock, source], (message) => on[message.type](message));
    this.loop.postMessage(this.build);
  }

  send(message) {
    this.loop.postMessage(message);
  }

  // Whether a measurement may begin: they take a quarter of a processor at most.
  get idle() {
    return !this.busy && performance.now() > this.next;
  }

  // Finds the equilibrium of a moment at `time`.
  measure(moment, time) {
    this.compute({ type: "measure", moment, time }, [moment.positions.buffer]);
  }

  // Finds settings for a stroke.
  choose(stroke, settings, requirement) {
    this.compute({ type: "choose", stroke, settings, ...requirement }, [stroke.buffer]);
  }

  // The worker starts with the first request, after the page is up.
  compute(message, buffers) {
    this.equilibria ??= this.startEquilibria();
    this.busy = true;
    this.begun = performance.now();
    this.equilibria.postMessage(message, buffers);
  }

  startEquilibria() {
    const worker = start([equilibriumSource], (message) => {
      const now = performance.now();
      this.busy = false;
      this.next = now + 3 * (now - this.begun);
      this.on[message.type](message);
    });
    worker.onerror = (event) => event.preventDefault(); // the message says it
    worker.postMessage(this.build);
    return worker;
  }

  end() {
    this.loop.terminate();
    this.equilibria?.terminate();
  }
}
