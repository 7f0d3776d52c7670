// SPDX-License-Identifier: MIT
//
// Draws the membrane, the tool and the force. The world's unit is the size of the membrane.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { paint } from "./colours.js";

const arrowScale = 5; // length for each newton,
const usualArrow = 0.5; // or for the usual force of an operation
const maxArrow = 1.5;
const maxVerticesWithEdges = 3000;
const up = new THREE.Vector3(0, 1, 0);
const outward = new THREE.Vector3(0, 0, 1); // of the membrane of an operation

// Each edge once, on a border or not.
function edgesOf(triangles) {
  const edges = new Map();
  for (let i = 0; i < triangles.length; i += 3)
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [triangles[i + k], triangles[i + ((k + 1) % 3)]].sort((p, q) => p - q);
      edges.set(2 ** 26 * a + b, [a, b]);
    }
  return [...edges.values()].flat();
}

function arrowOf(material) {
  const arrow = new THREE.Group();
  arrow.shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.022, 0.022, 1, 16), material);
  arrow.head = new THREE.Mesh(new THREE.ConeGeometry(0.065, 0.16, 24), material);
  arrow.add(arrow.shaft, arrow.head);
  return arrow;
}

function bodyOf({ positions, triangles }, color) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color, roughness: 0.9, side: THREE.DoubleSide }));
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
    this.operation = null;
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

  // Another membrane, at rest; of an operation with the body under it.
  build({ rest, normals, triangles, radius, size, body }, operation) {
    for (const part of this.membrane.children) part.geometry.dispose();
    this.membrane.clear();
    this.edges = null;
    this.size = size;
    this.rest = rest;
    this.triangles = triangles;
    this.operation = operation;
    this.arrowScale = operation ? usualArrow / operation.force : arrowScale;
    const positions = new THREE.BufferAttribute(rest.slice(), 3);
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    geometry.setAttribute("position", positions);
    if (normals) geometry.setAttribute("normal", new THREE.BufferAttribute(normals.slice(), 3));
    else geometry.computeVertexNormals();
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
      this.edges = new THREE.LineSegments(edges, line);
      this.membrane.add(this.edges);
    }
    if (body) this.membrane.add(bodyOf(body, operation.body));
    for (const part of this.membrane.children) part.frustumCulled = false;

    // The pointer aims at the membrane at rest, in an operation as it is.
    const still = new THREE.BufferGeometry();
    still.setIndex(geometry.index);
    still.setAttribute("position", new THREE.BufferAttribute(rest, 3));
    still.setAttribute("normal", geometry.attributes.normal.clone());
    this.still = new THREE.Mesh(still, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));

    for (const part of [this.membrane, this.still]) {
      part.scale.setScalar(1 / size);
      part.updateMatrixWorld(true);
    }
    still.computeBoundingSphere();
    const middle = still.boundingSphere.center.clone().divideScalar(size);
    this.controls.target.copy(middle);
    const from = operation ? new THREE.Vector3(0.4, -2.3, 3.1) : new THREE.Vector3(1.1, -3.4, 2.2);
    this.camera.position.copy(middle).add(from);
    this.controls.update();
    this.tool.scale.setScalar(radius / size);
    this.tool.visible = false;
    this.tool.material.depthTest = !operation; // forceps are seen through the flap
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

  // The point of the membrane under a point of the window, and its normal [m], in an operation that of the whole; null
  // beside it.
  aim(x, y) {
    const [hit] = this.rayAt(x, y).intersectObject(this.operation ? this.surface : this.still);
    if (!hit) return null;
    const normal = this.operation ? outward : hit.normal;
    return { point: hit.point.clone().multiplyScalar(this.size), normal: normal.clone().normalize() };
  }

  // The point under a point of the window in the plane through `point` [m], parallel to the screen or, in an operation,
  // to the membrane.
  onPlane(x, y, point) {
    const facing = this.operation ? outward : this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(facing, point.clone().divideScalar(this.size));
    const hit = this.rayAt(x, y).ray.intersectPlane(plane, new THREE.Vector3());
    return hit ? hit.multiplyScalar(this.size) : point.clone();
  }

  // Draws a state of the loop from now on; `max` is the value of the darkest colour.
  show(state, { max }) {
    const { position, normal, color } = this.surface.geometry.attributes;
    position.array.set(state.positions);
    if (state.triangles) this.tear(state.triangles);
    if (state.normals) normal.array.set(state.normals);
    else this.surface.geometry.computeVertexNormals();
    state.values.forEach((value, v) => paint(color.array, v, value / max));
    position.needsUpdate = normal.needsUpdate = color.needsUpdate = true;
    this.mark(this.contact, state.contact);
    const pressed = new Set(state.contact);
    this.mark(this.tracked, state.tracked.filter((f) => !pressed.has(f)));
    this.outline(state.boxes);
    this.tool.visible = true;
    this.tool.position.fromArray(state.tool).divideScalar(this.size);
    if (state.radius) this.tool.scale.setScalar(state.radius / this.size);
    this.point(new THREE.Vector3().fromArray(state.force));
  }

  // Other triangles from now on.
  tear(triangles) {
    this.triangles = triangles;
    this.surface.geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.edges?.geometry.setIndex(edgesOf(triangles));
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
    const length = Math.min(this.arrowScale * force.length(), maxArrow);
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
