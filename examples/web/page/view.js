// SPDX-License-Identifier: MIT
//
// The picture: membrane with displacement as colour, tool, and its force as an arrow.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

// From cividis: colour-blind people see the differences, and brightness alone shows them.
const stops = [[0.95, 0.91, 0.73], [0.80, 0.72, 0.44], [0.55, 0.53, 0.47], [0.30, 0.36, 0.43], [0.0, 0.14, 0.31]]
    .map(([r, g, b]) => new THREE.Color(r, g, b).convertSRGBToLinear());

const metresPerNewton = 0.08, longestArrow = 0.012;  // [m/N], [m]

// One metre long, along y.
function arrow(colour) {
    const material = new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6 });
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.035, 0.035, 0.75, 16), material);
    const head = new THREE.Mesh(new THREE.ConeGeometry(0.11, 0.25, 24), material);
    shaft.position.y = 0.375;
    head.position.y = 0.875;
    return new THREE.Group().add(shaft, head);
}

export class View {
    constructor(canvas) {
        this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
        this.camera = new THREE.PerspectiveCamera(35, 1, 0.001, 1);
        this.camera.up.set(0, 0, 1);
        this.controls = new OrbitControls(this.camera, canvas);
        this.controls.enablePan = false;

        this.scene = new THREE.Scene();
        this.scene.add(new THREE.HemisphereLight(0xffffff, 0xe8e4de, 2.6));
        const lamp = new THREE.DirectionalLight(0xffffff, 0.8);
        this.camera.add(lamp);
        lamp.position.set(-1, 2, 1);
        this.scene.add(this.camera);

        this.tool = new THREE.Mesh(new THREE.SphereGeometry(1, 48, 24),
            new THREE.MeshStandardMaterial({ color: 0x8fa3b3, metalness: 0.3, roughness: 0.35, transparent: true, opacity: 0.85 }));
        this.arrow = arrow(0xd1495b);
        this.scene.add(this.tool, this.arrow);
        this.tool.visible = this.arrow.visible = false;
        this.ray = new THREE.Raycaster();
    }

    setMesh({ rest, triangles }) {
        for (const old of [this.membrane, this.edges]) {
            if (!old) continue;
            this.scene.remove(old);
            old.geometry.dispose();
            old.material.dispose();
        }
        this.rest = rest;
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute('position', new THREE.BufferAttribute(rest.slice(), 3));
        geometry.setAttribute('normal', new THREE.BufferAttribute(new Float32Array(rest.length), 3));
        geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(rest.length), 3));
        geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
        geometry.computeVertexNormals();
        this.membrane = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial(
            { vertexColors: true, roughness: 0.8, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1 }));
        this.membrane.frustumCulled = false;
        this.edges = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(
            { color: 0x333333, wireframe: true, transparent: true, opacity: rest.length > 20000 ? 0.06 : 0.18 }));
        this.edges.frustumCulled = false;
        this.scene.add(this.membrane, this.edges);

        geometry.computeBoundingSphere();
        const { center, radius } = geometry.boundingSphere;
        this.controls.target.copy(center);
        this.camera.position.copy(center).add(new THREE.Vector3(0.2, -0.8, 0.55).normalize().multiplyScalar(4.6 * radius));

        // The pointer meets the shape at rest: what it presses must not move away under it.
        const shape = new THREE.BufferGeometry();
        shape.setAttribute('position', new THREE.BufferAttribute(rest, 3));
        shape.setIndex(geometry.index);
        this.shape = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    }

    // Of a pointer at `x`, `y` in [-1, 1]: the point and the outward normal of the shape at rest, or nothing.
    surfaceAt(x, y) {
        this.ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
        const [hit] = this.ray.intersectObject(this.shape);
        return hit && { point: hit.point.toArray(), normal: hit.face.normal.toArray(), distance: hit.distance };
    }

    // The point at `distance` from the eye under a pointer.
    spaceAt(x, y, distance) {
        this.ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
        return this.ray.ray.at(distance, new THREE.Vector3()).toArray();
    }

    update({ positions, normals, result, tool }, largest) {
        const { attributes } = this.membrane.geometry;
        attributes.position.array.set(positions);
        attributes.normal.array.set(normals);
        const colour = new THREE.Color();
        for (let i = 0; i < positions.length; i += 3) {
            const moved = Math.hypot(positions[i] - this.rest[i], positions[i + 1] - this.rest[i + 1],
                positions[i + 2] - this.rest[i + 2]);
            const place = Math.min(moved / largest, 0.9999) * (stops.length - 1);
            const below = Math.floor(place);
            colour.lerpColors(stops[below], stops[below + 1], place - below).toArray(attributes.color.array, i);
        }
        for (const name of ['position', 'normal', 'color']) attributes[name].needsUpdate = true;
        this.tool.visible = tool.position[2] < 0.5;
        this.tool.position.fromArray(tool.position);
        this.tool.scale.setScalar(tool.radius);
        const force = result ? new THREE.Vector3(...result.force) : new THREE.Vector3();
        this.arrow.visible = this.tool.visible && force.length() > 1e-4;
        if (this.arrow.visible) {
            const direction = force.clone().normalize();
            this.arrow.position.fromArray(tool.position).addScaledVector(direction, tool.radius);
            this.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), direction);
            this.arrow.scale.setScalar(Math.min(metresPerNewton * force.length(), longestArrow));
        }
    }

    draw() {
        const { clientWidth: width, clientHeight: height } = this.renderer.domElement;
        const size = this.renderer.getSize(new THREE.Vector2());
        if (size.x !== width || size.y !== height) {
            this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
            this.renderer.setSize(width, height, false);
            this.camera.aspect = width / height;
            this.camera.fov = width < height ? 50 : 35;
            this.camera.updateProjectionMatrix();
        }
        this.controls.update();
        this.renderer.render(this.scene, this.camera);
    }
}
