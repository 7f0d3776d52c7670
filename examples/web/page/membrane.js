// SPDX-License-Identifier: MIT
//
// The C++ of membrane_web.cpp with its arrays as views.

const tickSize = 8;

// What the module imports: it writes nothing and ends only where an input that should have been refused was not.
const imports = {
    env: { emscripten_notify_memory_growth() {} },
    wasi_snapshot_preview1: {
        proc_exit(code) { throw new Error(`the module has ended with ${code}`); },
        fd_close: () => 0,
        fd_seek: () => 0,
        fd_write: () => 0,
    },
};

export class Membrane {
    static async from(bytes) {
        const { instance } = await WebAssembly.instantiate(bytes, imports);
        instance.exports._initialize();
        return new Membrane(instance.exports);
    }

    constructor(exports) {
        this.cpp = exports;
    }

    // Views are made anew each time: memory that grows leaves old ones empty.
    view(Type, address, length) {
        return new Type(this.cpp.memory.buffer, address, length);
    }

    build(shape) {
        this.cpp.build(shape);
    }

    // Positions, 3 a vertex, and indices, 3 a triangle. Returns the findings in words, and whether the mesh is refused.
    buildFile(points, triangles) {
        this.view(Float64Array, this.cpp.file_points(points.length / 3), points.length).set(points);
        this.view(Int32Array, this.cpp.file_triangles(triangles.length / 3), triangles.length).set(triangles);
        const refused = this.cpp.build_file() !== 0;
        const address = this.cpp.message();
        const bytes = this.view(Uint8Array, address, this.cpp.memory.buffer.byteLength - address);
        return { refused, findings: new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))) };
    }

    get triangles() {
        return this.view(Int32Array, this.cpp.triangle_data(), 3 * this.cpp.triangle_count());
    }
    get rest() {
        return this.view(Float64Array, this.cpp.rest_data(), 3 * this.cpp.vertex_count());
    }
    get positions() {
        return this.view(Float64Array, this.cpp.position_data(), 3 * this.cpp.vertex_count());
    }
    get normals() {
        return this.view(Float64Array, this.cpp.normal_data(), 3 * this.cpp.vertex_count());
    }

    setOptions({ layers, sweeps, safeStep, volumeSprings }) {
        this.cpp.set_options(layers, sweeps, safeStep, volumeSprings);
    }

    tick(tool) {
        return this.result(this.cpp.tick(...tool.position, ...tool.velocity, tool.radius, tool.grasping));
    }

    equilibrium(tool) {
        return this.result(this.cpp.equilibrium(...tool.position, tool.radius, tool.grasping));
    }

    result(address) {
        const [x, y, z, depth, touching, holding, valid, updates] = this.view(Float64Array, address, tickSize);
        return { force: [x, y, z], depth, touching: touching > 0, holding: holding > 0, valid: valid > 0, updates };
    }
}
