// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

/// Checks of mesh files for what tinyobjloader (OBJ) and assimp (others) hang on, misread, or accept though it is
/// wrong.
namespace examples {

/// The file for the library, from one with these bytes; of a text only what describes vertices and triangles.
/// @throws InvalidInput for a wrong file; the message names the line, or the byte of a binary file
[[nodiscard]] std::string checked_obj(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_off(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_stl(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_ply(const std::string& file, std::string_view bytes);

/// `text` with the letters A to Z in lower case.
[[nodiscard]] std::string lower(std::string_view text);

}  // namespace examples
