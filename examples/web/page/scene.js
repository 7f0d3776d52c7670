// SPDX-License-Identifier: MIT
//
// Draws the membrane, the tool and the force. The world's unit is the size of the membrane.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { paint } from "./colours.js";

const arrowScale = 5; // length for each newton
const maxArrow = 1.5;
const maxVerticesWithEdges = 3000;
const up = new THREE.Vector3(0, 1, 0);

function edgesOf(triangles) {
  const edges = [];
  for (let i = 0; i < triangles.length; i += 3)
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [triangles[i + k], triangles[i + ((k + 1) % 3)]];
      if (a < b) edges.push(a, b);
    }
  return edges;
}

function arrowOf(material) {
  const arrow = new THREE.Group();
  arrow.shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.022, 0.022, 1, 16), material);
  arrow.head = new THREE.Mesh(new THREE.ConeGeometry(0.065, 0.16, 24), material);
  arrow.add(arrow.shaft, arrow.head);
  return arrow;
}

export class Scene {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.05, 50);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.minDistance = 2;
    this.controls.maxDistance = 10;
    this.scene = new THREE.Scene();
    const light = new THREE.DirectionalLight(0xffffff, 2.2);
    light.position.set(-2, 1.5, 3);
    this.camera.add(light);
    this.scene.add(this.camera, new THREE.HemisphereLight(0xffffff, 0x9aa4b2, 1.6));

    const orange = new THREE.MeshStandardMaterial({ color: 0xd9691e, roughness: 0.45 });
    const steel = new THREE.MeshStandardMaterial({ color: 0x8b95a3, roughness: 0.35 });
    Object.assign(steel, { transparent: true, opacity: 0.82 });
    this.membrane = new THREE.Group();
    this.tool = new THREE.Mesh(new THREE.SphereGeometry(1, 32, 24), steel);
    this.arrow = arrowOf(orange);
    orange.depthTest = false; // the force is seen through tool and membrane
    orange.transparent = true;
    this.arrow.shaft.renderOrder = 1;
    this.arrow.head.renderOrder = 2;
    this.scene.add(this.membrane, this.tool, this.arrow);
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement.parentElement;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.fov = this.camera.aspect < 1 ? 46 : 34;
    this.camera.updateProjectionMatrix();
  }

  // Another membrane, at rest.
  build({ rest, normals, triangles, radius, size }) {
    for (const part of this.membrane.children) part.geometry.dispose();
    this.membrane.clear();
    this.size = size;
    this.rest = rest;
    this.triangles = triangles;
    const positions = new THREE.BufferAttribute(rest.slice(), 3);
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    geometry.setAttribute("position", positions);
    geometry.setAttribute("normal", new THREE.BufferAttribute(normals.slice(), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(rest.length), 3));
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(), 10);
    const skin = new THREE.MeshStandardMaterial({
      vertexColors: true,
      roughness: 0.7,
      side: THREE.DoubleSide,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    this.surface = new THREE.Mesh(geometry, skin);

    const patch = (color) => {
      const material = new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide });
      const mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
      mesh.geometry.setAttribute("position", positions);
      mesh.geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(triangles.length), 1));
      return mesh;
    };
    this.contact = patch(0xd9691e);
    this.tracked = patch(0xf0c9a0);
    this.boxes = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0x7b3294 }));
    this.boxes.visible = false;
    this.membrane.add(this.surface, this.contact, this.tracked, this.boxes);
    if (rest.length <= 3 * maxVerticesWithEdges) {
      const edges = new THREE.BufferGeometry();
      edges.setAttribute("position", positions);
      edges.setIndex(edgesOf(triangles));
      const line = new THREE.LineBasicMaterial({ color: 0x1d2530, transparent: true, opacity: 0.16 });
      this.membrane.add(new THREE.LineSegments(edges, line));
    }
    for (const part of this.membrane.children) part.frustumCulled = false;

    // The pointer aims at the membrane at rest.
    const still = new THREE.BufferGeometry();
    still.setIndex(geometry.index);
    still.setAttribute("position", new THREE.BufferAttribute(rest, 3));
    still.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    this.still = new THREE.Mesh(still, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));

    for (const part of [this.membrane, this.still]) {
      part.scale.setScalar(1 / size);
      part.updateMatrixWorld(true);
    }
    still.computeBoundingSphere();
    const middle = still.boundingSphere.center.clone().divideScalar(size);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new THREE.Vector3(1.1, -3.4, 2.2));
    this.controls.update();
    this.tool.scale.setScalar(radius / size);
    this.tool.visible = false;
  }

  rayAt(x, y) {
    const box = this.renderer.domElement.getBoundingClientRect();
    const pointer = new THREE.Vector2(
      (2 * (x - box.left)) / box.width - 1,
      1 - (2 * (y - box.top)) / box.height,
    );
    const caster = new THREE.Raycaster();
    this.camera.updateMatrixWorld();
    caster.setFromCamera(pointer, this.camera);
    return caster;
  }

  // The point of the membrane at rest under a point of the window, and its normal [m]; null beside it.
  aim(x, y) {
    const [hit] = this.rayAt(x, y).intersectObject(this.still);
    if (!hit) return null;
    return { point: hit.point.clone().multiplyScalar(this.size), normal: hit.normal.clone().normalize() };
  }

  // The point under a point of the window in the plane through `point` parallel to the screen [m].
  onPlane(x, y, point) {
    const facing = this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(facing, point.clone().divideScalar(this.size));
    const hit = this.rayAt(x, y).ray.intersectPlane(plane, new THREE.Vector3());
    return hit ? hit.multiplyScalar(this.size) : point.clone();
  }

  // Draws a state of the loop from now on; `max` is the value of the darkest colour.
  show(state, { max }) {
    const { position, normal, color } = this.surface.geometry.attributes;
    position.array.set(state.positions);
    normal.array.set(state.normals);
    state.values.forEach((value, v) => paint(color.array, v, value / max));
    position.needsUpdate = normal.needsUpdate = color.needsUpdate = true;
    this.mark(this.contact, state.contact);
    const pressed = new Set(state.contact);
    this.mark(this.tracked, state.tracked.filter((f) => !pressed.has(f)));
    this.outline(state.boxes);
    this.tool.visible = true;
    this.tool.position.fromArray(state.tool).divideScalar(this.size);
    this.point(new THREE.Vector3().fromArray(state.force));
  }

  // Covers some triangles.
  mark({ geometry }, marked) {
    let count = 0;
    for (const f of marked)
      for (let k = 0; k < 3; ++k) geometry.index.array[count++] = this.triangles[3 * f + k];
    geometry.index.needsUpdate = true;
    geometry.setDrawRange(0, count);
  }

  // Draws boxes, each by two corners.
  outline(boxes) {
    this.boxes.visible = boxes.length > 0;
    const ends = [];
    for (let i = 0; i < boxes.length; i += 6)
      for (let corner = 0; corner < 8; ++corner)
        for (const axis of [1, 2, 4])
          if (!(corner & axis))
            for (const end of [corner, corner | axis])
              for (let k = 0; k < 3; ++k) ends.push(boxes[i + 3 * ((end >> k) & 1) + k]);
    this.boxes.geometry.dispose();
    this.boxes.geometry = new THREE.BufferGeometry();
    this.boxes.geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
  }

  // The arrow of the force, from the tool's centre.
  point(force) {
    const length = Math.min(arrowScale * force.length(), maxArrow);
    this.arrow.visible = length > 0.005;
    if (!this.arrow.visible) return;
    this.arrow.shaft.scale.y = length;
    this.arrow.shaft.position.y = length / 2;
    this.arrow.head.position.y = length + 0.08;
    this.arrow.position.copy(this.tool.position);
    this.arrow.quaternion.setFromUnitVectors(up, force.normalize());
  }

  draw() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }
}
