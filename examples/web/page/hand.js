// SPDX-License-Identifier: MIT
//
// The hand: pointer and keyboard as a target of the tool.
const hover = 0.5; // height of a lifted tool above the membrane [tool radii]
const graspDepth = 0.1; // of the tool when its forceps close [tool radii]
const maxDrag = { press: 0.8, operation: 4 }; // of the forceps [size]
const liftTime = 300; // until a lifted tool may be put elsewhere [ms]
const step = 6; // of an arrow key [px]

export class Hand {
  constructor(canvas, scene, options) {
    this.canvas = canvas;
    this.scene = scene;
    this.options = options; // { mode, depth [size] }
    this.reset();
    canvas.addEventListener("pointerdown", (event) => this.onDown(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      canvas.addEventListener(name, (event) => event.pointerId === this.pointer && this.release());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.onKey(event, true));
    canvas.addEventListener("keyup", (event) => this.onKey(event, false));
    for (const target of [window, canvas]) target.addEventListener("blur", () => this.onBlur());
  }

  // For another membrane: the tool is above its middle as seen in the window.
  reset() {
    this.down = false;
    this.holding = false;
    this.place = true;
    this.released = 0;
    this.pointer = null;
    this.keys = new Set();
    this.aim = null;
    this.drag = null;
  }

  get pulls() {
    return this.scene.operation !== null || this.options.mode === "pull";
  }

  begin(x, y, pull) {
    const aim = this.scene.aim(x, y);
    if (!aim) return false;
    Object.assign(this, { aim, x, y, down: true, place: true, pull, holding: false });
    this.start = this.scene.onPlane(x, y, aim.point);
    this.drag = this.start.clone().sub(this.start);
    return true;
  }

  moveTo(x, y) {
    if (this.down && this.pull) {
      const most = (this.scene.operation ? maxDrag.operation : maxDrag.press) * this.scene.size;
      this.drag = this.scene.onPlane(x, y, this.aim.point).sub(this.start).clampLength(0, most);
    } else {
      const aim = this.scene.aim(x, y);
      if (!aim) return;
      this.aim = aim;
      this.place ||= !this.down && performance.now() - this.released > liftTime;
    }
    Object.assign(this, { x, y });
  }

  // After a pull the tool stays where its forceps open.
  release() {
    if (this.down) {
      this.released = performance.now();
      if (this.pull) this.aim = { ...this.aim, point: this.aim.point.clone().add(this.drag) };
    }
    this.down = false;
    this.pointer = null;
    this.scene.controls.enabled = true;
  }

  onDown(event) {
    if (this.down) return;
    const pull = this.pulls || event.shiftKey || event.button === 2;
    if (!this.begin(event.clientX, event.clientY, pull)) return;
    this.scene.controls.enabled = false; // a drag on the membrane does not turn the view
    this.pointer = event.pointerId;
    this.canvas.setPointerCapture(event.pointerId);
  }

  onMove(event) {
    if (this.down && event.pointerId !== this.pointer) return;
    if (!this.down && event.buttons !== 0) return; // turns the view
    this.moveTo(event.clientX, event.clientY);
  }

  // Keys that are let go elsewhere are not seen here.
  onBlur() {
    this.keys.clear();
    this.release();
  }

  onKey(event, pressed) {
    if (event.code === "Space") {
      if (pressed && !this.down && this.x !== undefined) this.begin(this.x, this.y, this.pulls);
      if (!pressed) this.release();
    } else if (event.key.startsWith("Arrow")) {
      if (pressed) this.keys.add(event.key);
      else this.keys.delete(event.key);
    } else {
      return;
    }
    event.preventDefault();
  }

  // Moves by the arrow keys that are down.
  moveByKeys() {
    const has = (key) => Number(this.keys.has(key));
    const dx = step * (has("ArrowRight") - has("ArrowLeft"));
    const dy = step * (has("ArrowDown") - has("ArrowUp"));
    if (dx !== 0 || dy !== 0) this.moveTo(this.x + dx, this.y + dy);
  }

  // For a frame of the loop: the target [m], where to put the tool without a path, and whether to close the forceps.
  frame(radius) {
    if (!this.aim) {
      const box = this.canvas.getBoundingClientRect();
      [this.x, this.y] = [box.left + box.width / 2, box.top + 0.42 * box.height];
      this.aim = this.scene.aim(this.x, this.y);
      if (!this.aim) return { target: [0, 0, 4 * this.scene.size], place: null, close: false };
    }
    this.moveByKeys();
    const { point, normal } = this.aim;
    const at = (height) => point.clone().addScaledVector(normal, radius + height);
    const depth = this.options.depth * this.scene.size;
    const pulls = this.down && this.pull;
    let target = at(hover * radius);
    const place = this.place ? target.toArray() : null;
    this.place = false;
    if (pulls && !this.holding) target = at(-graspDepth * radius);
    else if (pulls) target = at(depth).add(this.drag);
    else if (this.down) target = at(-depth);
    return { target: target.toArray(), place, close: pulls };
  }
}
