// SPDX-License-Identifier: MIT
//
// Inputs and outputs of the page.
import { gradient } from "./colours.js";

const element = (id) => document.getElementById(id);

export class Panel {
  options = { mode: "press", depth: 0.2, colour: "displacement" }; // depth [size of the membrane]
  settings = { layers: 6, sweeps: 2, safeStep: false, volumeSprings: true };
  size = 0; // of the membrane [m]

  // `on` has a function for each request: mesh, file, settings, record, replay, download.
  constructor(on) {
    const { options, settings } = this;
    const set = (target, key, value) => {
      target[key] = value;
      if (target === settings) on.settings();
    };
    this.dial("layers", (n) => n, (n) => set(settings, "layers", n));
    this.dial("sweeps", (n) => n, (n) => set(settings, "sweeps", n));
    this.dial("depth", (n) => `${(100 * n * this.size).toFixed(1)} mm`, (n) => set(options, "depth", n / 10));
    const changed = (id, act) => element(id).addEventListener("change", ({ target }) => act(target));
    changed("volumeSprings", ({ checked }) => set(settings, "volumeSprings", checked));
    changed("rule", ({ value }) => set(settings, "safeStep", value === "safe"));
    changed("mode", ({ value }) => set(options, "mode", value));
    changed("colour", ({ value }) => {
      set(options, "colour", value);
      this.showScale();
    });
    changed("mesh", ({ value, selectedOptions }) => {
      const [kind, subdivisions] = value.split(" ");
      const mesh = kind === "file" ? this.fileMesh : { kind, subdivisions: Number(subdivisions) };
      on.mesh(mesh, selectedOptions[0].text);
    });
    changed("file", (input) => {
      on.file(input.files[0]);
      input.value = ""; // the same file may be opened again
    });
    for (const name of ["record", "replay", "download"]) element(name).addEventListener("click", () => on[name]());
    element("notice").querySelector("button").addEventListener("click", () => this.notice(""));
    element("view").addEventListener("keydown", ({ key }) => this.onKey(key.toLowerCase()));
    element("scale").querySelector("i").style.background = gradient;
    this.listenToFiles(on);
  }

  dial(id, text, set) {
    const input = element(id);
    input.addEventListener("input", () => {
      set(Number(input.value));
      input.parentElement.querySelector("output").textContent = text(input.value);
    });
    input.dispatchEvent(new Event("input"));
  }

  onKey(key) {
    const depth = element("depth");
    if (key === "g") element("mode").querySelector("input:not(:checked)").click();
    if (key !== "+" && key !== "-") return;
    depth.value = Number(depth.value) + (key === "+" ? 0.5 : -0.5);
    depth.dispatchEvent(new Event("input"));
  }

  listenToFiles(on) {
    const dragging = (event) => {
      event.preventDefault();
      document.body.classList.toggle("dropping", event.type === "dragover");
    };
    for (const name of ["dragover", "dragleave", "drop"]) addEventListener(name, dragging);
    addEventListener("drop", ({ dataTransfer }) => on.file(dataTransfer.files[0]));
  }

  notice(text) {
    element("notice").hidden = !text;
    element("notice").querySelector("pre").textContent = text;
  }

  // Another membrane, of this size [m].
  begin(mesh, name, size) {
    this.size = size;
    element("depth").dispatchEvent(new Event("input"));
    element("error").textContent = element("worstError").textContent = "–";
    if (mesh.kind === "file") {
      const option = element("mesh").querySelector("[value=file]");
      Object.assign(option, { text: name, hidden: false, selected: true });
      this.fileMesh = mesh;
    }
    this.showScale();
  }

  hint(text) {
    element("hint").textContent = text;
    element("hint").classList.remove("done");
  }

  showScale() {
    const labels = {
      displacement: ["0", `${(300 * this.size).toFixed(1)} mm`],
      layers: ["outside the queue", "layer 0"],
      contact: ["orange: triangles with a contact force", ""],
    }[this.options.colour];
    element("scale").classList.toggle("plain", this.options.colour === "contact");
    element("scale").querySelectorAll("span").forEach((span, i) => (span.textContent = labels[i]));
  }

  showForce(newtons, replaying) {
    element("force").textContent = `${newtons.toFixed(4)} N`;
    element("caption").textContent = replaying ? "force on the hand, replayed" : "force on the hand";
    if (newtons > 0) element("hint").classList.add("done");
  }

  // Relative errors of the force; null without an equilibrium.
  showError(error, worst) {
    const text = (value) => (value < 1e-4 ? "below 0.01 %" : `${Number((100 * value).toPrecision(2))} %`);
    element("error").textContent = error === null ? "no equilibrium" : text(error);
    element("worstError").textContent = worst >= 0 ? text(worst) : "–";
  }

  showTimes({ median, p99, worst, speed }) {
    for (const [id, time] of Object.entries({ median, p99, worst }))
      element(id).textContent = time === undefined ? "–" : `${(1e3 * time).toFixed(0)} µs`;
    element("speed").textContent = speed > 0.97 ? "real time" : `${(100 * speed || 0).toFixed(0)} % of real time`;
  }

  showRecording(recording, available) {
    element("record").textContent = recording ? "Stop" : "Record";
    element("replay").disabled = element("download").disabled = recording || !available;
  }
}
