// SPDX-License-Identifier: MIT
#pragma once

/// The instruction set that a translation unit is compiled for.
///
/// One program may have units compiled for several, as for SSE2 and for AVX2. What is packed in registers (solver, tree,
/// packs of lanes) is in an inline namespace named after the set, `membrane::avx2::QuasiStaticSolver`: each unit uses its
/// own, and what a unit is to get from one compiled otherwise does not link. All else (mesh, network, positions, tool,
/// contact, report) is the same everywhere and may be handed on.
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

// With the tag, the name is also in the symbol of a function that only returns something of the namespace.
inline namespace MEMBRANE_INSTRUCTION_SET __attribute__((abi_tag)) {}

namespace detail {

// A part may also come from another unit inside a type that names no instruction set. So a unit that can make such parts
// defines a symbol, which a unit that uses them refers to: if only units for other sets can, it is undefined. Where one for
// each set can, nothing tells, but then nothing breaks: parts lie in memory alike for all.
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
