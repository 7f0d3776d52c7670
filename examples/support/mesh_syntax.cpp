// SPDX-License-Identifier: MIT
#include "support/mesh_syntax.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <limits>
#include <system_error>
#include <utility>

namespace examples {
namespace {

constexpr std::string_view blanks = " \t\v\f";
constexpr std::int64_t max_vertices = std::numeric_limits<std::int32_t>::max();

bool digit(char c) { return c >= '0' && c <= '9'; }

std::string lower(std::string_view text) {
    std::string result(text);
    for (char& c : result) {
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    return result;
}

}  // namespace

bool Lines::next(bool comments) {
    words_.clear();
    while (words_.empty() && !rest_.empty()) {
        const std::size_t end = std::min(rest_.find('\n'), rest_.size());
        std::string_view text = rest_.substr(0, end);
        rest_.remove_prefix(std::min(end + 1, rest_.size()));
        ++line_;
        if (comments) text = text.substr(0, text.find('#'));
        while (text.find_first_not_of(blanks) != text.npos) {
            text.remove_prefix(text.find_first_not_of(blanks));
            words_.push_back(text.substr(0, text.find_first_of(blanks)));
            text.remove_prefix(words_.back().size());
        }
    }
    return !words_.empty();
}

std::string Lines::quoted(std::string_view text) {
    std::string shown(text.substr(0, 24));
    for (char& c : shown) {
        if (c < ' ' || c > '~') c = '?';
    }
    return "'" + shown + (text.size() > shown.size() ? "...'" : "'");
}

void Lines::check_number(std::size_t i) const {
    std::string_view text = word(i);
    if (text.front() == '+' && text.size() > 1 && text[1] != '-') text.remove_prefix(1);
    const auto whole = std::find_if_not(text.begin() + (text.front() == '-' ? 1 : 0), text.end(), digit);
    if (whole - text.begin() > 18 || text.size() > 64) {  // assimp makes 0 of more
        refuse("expected a number of at most 18 digits before the point and 64 characters, got ", quoted(i));
    }
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool all = end == text.data() + text.size() && error != std::errc::invalid_argument;
    const bool too_small = error == std::errc::result_out_of_range && text.find_first_of("eE") != text.npos &&
                           text[text.find_first_of("eE") + 1] == '-';
    if (!all || !(digit(text.back()) || text.back() == '.') || (error != std::errc() && !too_small)) {
        refuse("expected a finite number, got ", quoted(i));
    }
}

std::int64_t Lines::integer(std::string_view text, std::int64_t least, std::int64_t most) const {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || value < least || value > most) {
        refuse("expected an integer from ", least, " to ", most, ", got ", quoted(text));
    }
    return value;
}

void Lines::check_size(std::size_t count) const {
    if (size() != count) refuse("expected ", count, " words, got ", size());
}

std::string plain_text(const std::string& file, std::string_view bytes) {
    if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff")) {
        membrane::refuse(file, "is UTF-16, expected ASCII or UTF-8");
    }
    if (const auto nul = bytes.find('\0'); nul != bytes.npos) {
        membrane::refuse(file, "byte ", nul, " is NUL, expected text");
    }
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
    std::string text;
    text.reserve(bytes.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        if (bytes[i] != '\r') {
            text += bytes[i];
        } else if (i + 1 == bytes.size() || bytes[i + 1] != '\n') {
            text += '\n';
        }
    }
    return text;
}

namespace {

/// Lines that end in a backslash go on in the next one, but for comments; its end is put after them, so that all other
/// lines keep their numbers.
std::string joined(std::string_view text) {
    std::string result;
    std::size_t ends = 1;
    bool comment = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        comment = text[i] == '#' || (comment && text[i] != '\n');
        if (!comment && text.substr(i, 2) == "\\\n") {
            result += ' ';
            ++ends;
            ++i;
        } else if (text[i] == '\n') {
            result.append(std::exchange(ends, 1), '\n');
        } else {
            result += text[i];
        }
    }
    return result;
}

}  // namespace

/// Vertices and faces, each in the line where it was found, so that tinyobjloader's messages name that.
std::string checked_obj(const std::string& file, std::string_view bytes) {
    const std::string text = joined(plain_text(file, bytes));
    std::string result;
    Lines lines(file, text);
    std::size_t written = 1;
    std::int64_t vertices = 0;
    while (lines.next()) {
        const std::string_view kind = lines.word(0);
        if (kind != "v" && kind != "f") {
            constexpr std::array others{"vn", "vt", "vp", "g", "o", "s", "l", "p", "usemtl", "mtllib"};
            if (std::find(others.begin(), others.end(), kind) != others.end()) continue;
            lines.refuse("expected a statement of an OBJ surface, got ", lines.quoted(0));
        }
        result.append(lines.line() - written, '\n');
        written = lines.line();
        result += kind;
        vertices += kind == "v";
        if (kind == "v" && (lines.size() < 4 || lines.size() > 8)) {
            lines.refuse("expected 3 to 7 numbers of a vertex, got ", lines.size() - 1);
        }
        if (kind == "f" && (lines.size() < 4 || lines.size() > 256)) {  // tinyobjloader counts corners in a byte
            lines.refuse("expected 3 to 255 corners of a polygon, got ", lines.size() - 1);
        }
        for (std::size_t i = 1; i < lines.size(); ++i) {
            if (kind == "v") lines.check_number(i);
            if (kind == "v" && i > 3) continue;  // a weight or a colour
            const std::string_view corner = lines.word(i).substr(0, lines.word(i).find('/'));
            if (kind == "f") static_cast<void>(lines.integer(corner, -vertices, max_vertices));
            (result += ' ') += corner;
        }
    }
    return result += '\n';
}

/// One line for each vertex and face, without colours: assimp knows no comments within.
std::string checked_off(const std::string& file, std::string_view bytes) {
    const std::string text = plain_text(file, bytes);
    Lines lines(file, text);
    lines.expect("OFF");
    if (lines.word(0) != "OFF") lines.refuse("expected OFF, in ASCII and without variants, got ", lines.quoted(0));
    const bool same_line = lines.size() > 1;
    if (same_line && lines.word(1) == "BINARY") lines.refuse("expected an OFF in ASCII, got BINARY");
    if (!same_line) lines.expect("the counts of vertices and faces");
    lines.check_size(same_line ? 4 : 3);
    const auto vertices = lines.integer(same_line ? 1 : 0, 1, max_vertices);
    const auto faces = lines.integer(same_line ? 2 : 1, 1, max_vertices);
    std::string result = "OFF\n" + std::to_string(vertices) + ' ' + std::to_string(faces) + " 0\n";
    for (std::int64_t v = 0; v < vertices; ++v) {
        lines.expect("vertex ", v, " of ", vertices);
        lines.check_size(3);
        for (std::size_t i = 0; i < 3; ++i) {
            lines.check_number(i);
            (result += lines.word(i)) += i < 2 ? ' ' : '\n';
        }
    }
    for (std::int64_t f = 0; f < faces; ++f) {
        lines.expect("face ", f, " of ", faces);
        const auto corners = static_cast<std::size_t>(lines.integer(0, 3, max_vertices));
        if (lines.size() <= corners) lines.refuse("expected ", corners, " corners, got ", lines.size() - 1);
        const std::size_t begin = result.size();
        result += lines.word(0);
        for (std::size_t i = 1; i <= corners; ++i) {
            (result += ' ') += std::to_string(lines.integer(i, 0, vertices - 1));
        }
        if (result.size() - begin > 4000) lines.refuse("expected a polygon in at most 4000 characters");  // assimp's
        result += '\n';
    }
    if (lines.next()) lines.refuse("expected the end of the file, got ", lines.quoted(0));
    return result;
}

namespace {

/// The lines of a triangle in an STL in ASCII; `#` is a number.
const std::array<std::vector<std::string_view>, 7> facet_lines{{{"facet", "normal", "#", "#", "#"},
                                                                {"outer", "loop"},
                                                                {"vertex", "#", "#", "#"},
                                                                {"vertex", "#", "#", "#"},
                                                                {"vertex", "#", "#", "#"},
                                                                {"endloop"},
                                                                {"endfacet"}}};

void check_words(const Lines& lines, const std::vector<std::string_view>& words) {
    for (std::size_t i = 0; i < words.size() && i < lines.size(); ++i) {
        if (words[i] == "#") {
            lines.check_number(i);
        } else if (lines.word(i) != words[i]) {
            lines.refuse("expected '", words[i], "', got ", lines.quoted(i));
        }
    }
    lines.check_size(words.size());
}

}  // namespace

/// Binary unchanged. ASCII in lower case and without the names, in which assimp searches for keywords.
std::string checked_stl(const std::string& file, std::string_view bytes) {
    if (bytes.size() >= 84) {
        std::uint32_t count = 0;
        for (std::size_t i = 4; i-- > 0;) count = count << 8 | static_cast<unsigned char>(bytes[80 + i]);
        if (bytes.size() == 84 + std::uint64_t{50} * count) {
            if (count == 0) membrane::refuse(file, "has no triangles");
            return std::string(bytes);
        }
        if (bytes.find('\0') != bytes.npos) {
            membrane::refuse(file, "expected ", 84 + std::uint64_t{50} * count, " bytes of a binary STL with ", count,
                             " triangles, got ", bytes.size());
        }
    }
    const std::string text = lower(plain_text(file, bytes));
    Lines lines(file, text);
    std::string result;
    lines.expect("'solid'");
    do {
        if (lines.word(0) != "solid") lines.refuse("expected 'solid', got ", lines.quoted(0));
        result += "solid\n";
        for (lines.expect("'facet' or 'endsolid'"); lines.word(0) != "endsolid"; lines.expect("'endsolid'")) {
            for (const auto& words : facet_lines) {
                if (&words != &facet_lines[0]) lines.expect("'", words[0], "'");
                check_words(lines, words);
                for (std::size_t i = 0; i < lines.size(); ++i) (result += lines.word(i)) += ' ';
                result += '\n';
            }
        }
        result += "endsolid\n";
    } while (lines.next());
    return result;
}

}  // namespace examples
