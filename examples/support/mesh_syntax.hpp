// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>

/// Checks a mesh file before a library reads it: libraries crash on some malformed files, and repair others silently.
/// Returns no coordinates, only the text for the library, without comments and without other parts that it misreads.
namespace examples {

/// The words of a text, line by line.
///
///     Lines lines("cube.off", text);
///     while (lines.next()) lines.refuse("expected nothing, got ", lines.word(0));    // cube.off: line 3: expected ...
class Lines {
  public:
    /// The lines of `text`, which come after `before` others in the file.
    Lines(std::string file, std::string_view text, std::size_t before = 0)
        : file_(std::move(file)), rest_(text), line_(before) {}

    /// Goes to the next line with a word in it; false at the end. What follows `#` is a comment, if `comments`.
    bool next(bool comments = true);
    /// Goes to the next line; at the end refuses the file: "the file ends, expected vertex 7 of 8".
    template <class... Parts>
    void expect(const Parts&... what) {
        if (!next()) membrane::refuse(file_, "the file ends after line ", line_, ", expected ", what...);
    }

    [[nodiscard]] std::size_t size() const { return words_.size(); }
    [[nodiscard]] std::string_view word(std::size_t i) const { return words_[i]; }
    [[nodiscard]] std::size_t line() const { return line_; }

    /// Refuses word `i` if it is no plain finite decimal number, or one that a library reads as another.
    void check_number(std::size_t i) const;
    /// Word `i`, or `text` of this line, as an integer from `least` to `most`; else refuses it.
    [[nodiscard]] std::int64_t integer(std::size_t i, std::int64_t least, std::int64_t most) const {
        return integer(word(i), least, most);
    }
    [[nodiscard]] std::int64_t integer(std::string_view text, std::int64_t least, std::int64_t most) const;
    /// Refuses a line with another number of words.
    void check_size(std::size_t count) const;

    template <class... Parts>
    [[noreturn]] void refuse(const Parts&... parts) const {
        membrane::refuse(file_, "line ", line_, ": ", parts...);
    }
    /// Word `i`, or `text`, as it can stand in a message.
    [[nodiscard]] std::string quoted(std::size_t i) const { return quoted(word(i)); }
    [[nodiscard]] static std::string quoted(std::string_view text);

  private:
    std::string file_;
    std::string_view rest_;
    std::size_t line_;
    std::vector<std::string_view> words_;
};

/// The text of a file: lines that end in \n, no mark of the byte order.
/// @throws InvalidInput for UTF-16, or NUL bytes
[[nodiscard]] std::string plain_text(const std::string& file, std::string_view bytes);

/// The text for the library from a file with these bytes.
/// @throws InvalidInput if the file violates the format, or the library would misread it
[[nodiscard]] std::string checked_obj(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_off(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_stl(const std::string& file, std::string_view bytes);
[[nodiscard]] std::string checked_ply(const std::string& file, std::string_view bytes);

}  // namespace examples
