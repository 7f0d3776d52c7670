// SPDX-License-Identifier: MIT
//
// Inputs and outputs of the page.
import { gradient } from "./colours.js";
import { operations } from "./operations.js";

const maxTension = 4; // [N/m]
const pressFirst = "Press or pull first: settings are tried on your last stroke.";

const percent = (value) => (value < 1e-4 ? "below 0.01 %" : `${Number((100 * value).toPrecision(2))} %`);
const element = (id) => document.getElementById(id);
const firstHint = element("hint").textContent;

export class Panel {
  // depth [size of the membrane]
  options = { mode: "press", depth: 0.2, colour: "displacement", show: { contact: false, boxes: false } };
  settings = { layers: 6, sweeps: 2, safeStep: false, volumeSprings: true, coarseCorrection: false };
  size = 0; // of the membrane [m]

  operation = null; // what is shown of it; null: press and pull

  // `on` has a function for each request: mesh, file, settings, choose, record, replay, download, reset.
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
    for (const name of ["volumeSprings", "coarseCorrection"])
      changed(name, ({ checked }) => set(settings, name, checked));
    changed("rule", ({ value }) => set(settings, "safeStep", value === "safe"));
    changed("mode", ({ value }) => set(options, "mode", value));
    changed("colour", ({ value }) => {
      set(options, "colour", value);
      this.showScale();
    });
    for (const name of ["contact", "boxes"]) changed(name, ({ checked }) => set(options.show, name, checked));
    changed("mesh", ({ value, selectedOptions }) => {
      const [kind, subdivisions] = value.split(" ");
      const mesh = kind === "file" ? this.fileMesh : { kind, subdivisions: Number(subdivisions) };
      on.mesh(mesh, selectedOptions[0].text);
    });
    changed("operation", ({ value }) => {
      if (value === "press") element("mesh").dispatchEvent(new Event("change"));
      else on.mesh({ kind: value }, operations[value].name);
    });
    element("demonstrate").addEventListener("click", () => on.reset(true));
    element("reset").addEventListener("click", () => on.reset(false));
    changed("file", (input) => {
      on.file(input.files[0]);
      input.value = ""; // the same file may be opened again
    });
    for (const button of element("choose").querySelectorAll("button"))
      button.addEventListener("click", () => on.choose({ forceError: 0, time: 0, ...JSON.parse(button.value) }));
    for (const name of ["record", "replay", "download"]) element(name).addEventListener("click", () => on[name]());
    element("notice").querySelector("button").addEventListener("click", () => this.notice(""));
    addEventListener("keydown", ({ key }) => key === "Escape" && this.notice(""));
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
    this.operation = operations[mesh.kind] ?? null;
    const kind = this.operation ? mesh.kind : "press";
    document.body.dataset.operation = kind;
    element("operation").querySelector(`[value=${kind}]`).checked = true;
    if (this.operation) element("colour").querySelector("[value=tension]").click();
    element("depth").dispatchEvent(new Event("input"));
    element("error").textContent = element("worstError").textContent = "–";
    element("choice").textContent = "";
    this.enableChoice(true);
    if (mesh.kind === "file") {
      const option = element("mesh").querySelector("[value=file]");
      Object.assign(option, { text: name, hidden: false, selected: true });
      this.fileMesh = mesh;
    }
    this.showScale();
  }

  hint(text = firstHint) {
    element("hint").textContent = text;
    element("hint").classList.remove("done");
  }

  // Of the colours: the value of the darkest, and what stands at the two ends.
  scale() {
    const most = this.operation?.maxTension ?? maxTension; // [N/m]
    return {
      displacement: { max: 0.3 * this.size, labels: ["0", `${(300 * this.size).toFixed(1)} mm`] },
      tension: { max: most, labels: ["0", `${most} N/m`] },
      layers: { max: 1, labels: ["outside the queue", "layer 0"] },
    }[this.options.colour];
  }

  showScale() {
    const { labels } = this.scale();
    element("scale").querySelectorAll("span").forEach((span, i) => (span.textContent = labels[i]));
  }

  // `error`: an estimate of that of the force [N], if there is one.
  showForce(newtons, error, touching) {
    const number = newtons.toFixed(4) + (error > 0 ? ` ± ${error.toFixed(4)}` : "");
    element("force").textContent = this.operation ? `${(1e3 * newtons).toPrecision(3)} mN` : `${number} N`;
    if (newtons > 0) element("hint").classList.add("done");
    if (touching && element("choice").textContent === pressFirst) element("choice").textContent = "";
  }

  showProgress(progress) {
    if (this.operation) element("progress").textContent = this.operation.progress(progress);
  }

  // `differing`: replayed ticks that have other forces than the recording.
  showReplay(phase, differing) {
    const result = differing > 0 ? `${differing} ticks differ: other settings, or another membrane` : "to the bit";
    const texts = { runs: ", replayed", ended: `. Replayed ${result}` };
    element("caption").textContent = `force on the hand${texts[phase] ?? ""}`;
  }

  // Relative errors of the force: null without an equilibrium, undefined if none was asked for.
  showError(error, worst) {
    element("error").textContent = error === null ? "no equilibrium" : error === undefined ? "–" : percent(error);
    element("worstError").textContent = worst === null ? "–" : percent(worst);
  }

  showChoosing() {
    element("choice").textContent = "Settings are tried on your last stroke …";
    this.enableChoice(false);
  }

  // What was chosen for the requirement; null if there was nothing to try.
  showChoice(choice, { forceError }) {
    this.enableChoice(true);
    if (!choice) {
      element("choice").textContent = pressFirst;
      return;
    }
    for (const name of ["layers", "sweeps"]) {
      element(name).value = choice[name];
      element(name).dispatchEvent(new Event("input"));
    }
    if (element("coarseCorrection").checked) element("coarseCorrection").click(); // the choice is of steps alone
    const result = `${percent(choice.forceError)} and ${(1e6 * choice.time).toFixed(0)} µs on your last stroke`;
    const kept = forceError > 0 ? "the quickest that keeps the error" : "the most accurate that keeps the time";
    const text = choice.satisfied ? kept : "no setting does what you ask, this comes closest";
    element("choice").textContent = `${result}: ${text}.`;
  }

  enableChoice(enabled) {
    for (const button of element("choose").querySelectorAll("button")) button.disabled = !enabled;
  }

  showTimes({ median, p99, worst, speed }) {
    for (const [id, time] of Object.entries({ median, p99, worst }))
      element(id).textContent = time === undefined ? "–" : `${(1e3 * time).toFixed(0)} µs`;
    element("speed").textContent = speed > 0.97 ? "real time" : `${(100 * speed || 0).toFixed(0)} % of real time`;
  }

  showRecording(recording, available) {
    element("record").textContent = recording ? "Stop" : "Record";
    element("mesh").disabled = element("file").disabled = recording; // a recording is of one membrane
    element("replay").disabled = element("download").disabled = recording || !available;
  }
}
