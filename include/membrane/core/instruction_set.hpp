// SPDX-License-Identifier: MIT
#pragma once

/// The instruction set that a translation unit is compiled for.
///
/// One program may contain units compiled for different sets, as SSE2 and AVX2. Types packed in registers (solver,
/// tree, lanes) are in an inline namespace named after the set, `membrane::avx2::QuasiStaticSolver`. Each unit uses its
/// own types; passing one to a unit compiled for another set does not link. All other types (mesh, network, positions,
/// tool, contact, report) are the same for all sets and may be passed between units.
#if defined(__AVX512F__)
#define MEMBRANE_INSTRUCTION_SET avx512
#elif defined(__AVX2__)
#define MEMBRANE_INSTRUCTION_SET avx2
#elif defined(__AVX__)
#define MEMBRANE_INSTRUCTION_SET avx
#elif defined(__SSE2__)
#define MEMBRANE_INSTRUCTION_SET sse2
#else
#define MEMBRANE_INSTRUCTION_SET portable
#endif

namespace membrane {

// With the tag, the name is also in the symbol of a function that only returns a type of the namespace.
inline namespace MEMBRANE_INSTRUCTION_SET __attribute__((abi_tag)) {}

namespace detail {

// An object of such a type may also come from another unit as a member of a type that names no instruction set. So a
// unit that constructs it defines a symbol, and a unit that uses it refers to that symbol. If only units for other sets
// construct it, the symbol is undefined. If units for each set construct it, a mix is not detected, but harmless: the
// memory layout is the same for all sets.
#if defined(__ELF__)
template <class Part>
struct MadeHere {
    friend void made_for_this_instruction_set(const Part*) noexcept __attribute__((used, visibility("default"))) {}
};

template <class Part>
void define_made() noexcept {
    static_cast<void>(sizeof(MadeHere<Part>));
    void made_for_this_instruction_set(const Part*) noexcept;
    made_for_this_instruction_set(nullptr);
}

template <class Part>
void require_made() noexcept {
    void made_for_this_instruction_set(const Part*) noexcept;
    made_for_this_instruction_set(nullptr);
}
#else
template <class Part>
void define_made() noexcept {}
template <class Part>
void require_made() noexcept {}
#endif

}  // namespace detail

}  // namespace membrane
