// SPDX-License-Identifier: MIT
#include "support/mesh_syntax.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <system_error>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>

namespace examples {
namespace {

using membrane::refuse;

constexpr std::int64_t max_index = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t max_corners = 255;  // tinyobjloader counts them in a byte, assimp reads 4096 characters a line

/// A decimal number. The libraries read only a part of other words, and 0 if more digits stand before the point.
bool is_number(std::string_view text) {
    const auto skip = [&](std::string_view any, std::size_t most) {
        const std::size_t count = std::min({text.find_first_not_of(any), text.size(), most});
        text.remove_prefix(count);
        return count;
    };
    if (text.size() > 64) return false;
    skip("+-", 1);
    std::size_t digits = skip("0123456789", 18);
    if (skip(".", 1) > 0) digits += skip("0123456789", 64);
    if (digits > 0 && skip("eE", 1) > 0) {
        const std::size_t most = text.starts_with('-') ? 64 : 2;
        skip("+-", 1);
        digits = skip("0123456789", most);
    }
    return digits > 0 && text.empty();
}

/// The words of a text, line by line, and what is kept of them for the library. A comment goes from # to a line's end.
struct Lines {
    const std::string& file;
    std::string_view rest;  ///< of the text
    std::size_t line = 0, at = 0;
    std::vector<std::string_view> words = {};
    std::string kept = {};

    Lines(const std::string& name, std::string_view text) : file(name), rest(text) {
        if (rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);
    }

    /// Goes to the next line with a word; false at the end. If it `joins`, a backslash continues a line in the next.
    bool next(bool joins = false);
    void expect(const std::string& what) {
        if (!next()) examples::refuse(file, "the file ends after line ", line, ", expected ", what);
    }
    [[noreturn]] void refuse(const std::string& expected, std::string_view word) const;

    /// The next word of the line. Like the other functions, refuses the end of the line.
    std::string_view word() {
        if (at == words.size()) examples::refuse(file, "line ", line, ": expected more than ", at, " words");
        return words[at++];
    }
    std::string_view keep(std::string_view word) {
        (kept += word) += ' ';
        return word;
    }
    void number() {
        if (!is_number(keep(word()))) refuse("a finite number of at most 18 digits before the point", words[at - 1]);
    }
    std::int64_t integer(std::string_view word, std::int64_t least, std::int64_t most);
    void end_line() {
        if (at < words.size()) refuse("the end of the line", words[at]);
        kept += '\n';
    }
};

bool Lines::next(bool joins) {
    words.clear();
    at = 0;
    for (bool joined = false; !rest.empty() && (words.empty() || joined);) {
        std::string_view text = rest.substr(0, rest.find_first_of("\r\n"));
        rest.remove_prefix(text.size());
        rest.remove_prefix(std::min<std::size_t>(rest.starts_with("\r\n") ? 2 : 1, rest.size()));
        ++line;
        if (text.find('\0') != text.npos) refuse("text in ASCII or UTF-8 without NUL", text);
        text = text.substr(0, text.find('#'));
        joined = joins && text.ends_with('\\');
        if (joined) text.remove_suffix(1);
        for (constexpr std::string_view blanks = " \t\v\f"; text.find_first_not_of(blanks) != text.npos;) {
            text.remove_prefix(text.find_first_not_of(blanks));
            words.push_back(text.substr(0, text.find_first_of(blanks)));
            text.remove_prefix(words.back().size());
        }
    }
    return !words.empty();
}

void Lines::refuse(const std::string& expected, std::string_view word) const {
    std::string got(word.substr(0, 24));
    std::replace_if(
        got.begin(), got.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    examples::refuse(file, "line ", line, ": expected ", expected, ", got '", got, word.size() > 24 ? "...'" : "'");
}

std::int64_t Lines::integer(std::string_view word, std::int64_t least, std::int64_t most) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || value < least || value > most) {
        refuse("an integer from " + std::to_string(least) + " to " + std::to_string(most), word);
    }
    keep(word);
    return value;
}

/// Type of a number in a PLY; only the size of a number that is no integer matters.
struct Type {
    std::size_t size = 0;
    bool is_signed = false;
};

/// Numbers of a vertex or a face in a PLY; a list has a count. The library gets coordinates and corners alone.
struct Property {
    Type type = {}, count = {};
    bool is_corners = false, is_kept = true;
};

struct Element {
    std::string name;
    std::int64_t count;
    std::vector<Property> properties = {};
    std::string header = {}, body = {};  ///< what the library gets
};

Type type_of(const std::string& name, bool integer, const Lines& lines) {
    constexpr std::array<std::pair<std::size_t, std::string_view>, 4> types{
        {{1, " char int8 uchar uint8 "},
         {2, " short int16 ushort uint16 "},
         {4, " int int32 uint uint32 float float32 "},
         {8, " double float64 "}}};
    const bool real = name.starts_with('f') || name.starts_with('d');
    for (const auto& [size, names] : types) {
        if (names.find(' ' + name + ' ') != names.npos && !(integer && real)) return {size, !name.starts_with('u')};
    }
    lines.refuse(integer ? "a type of integers" : "a type of numbers", name);
}

/// The rest of a line that begins with `property`, of `element`; notes which coordinates a vertex has.
Property property_of(Lines& lines, const Element& element, std::string& coordinates) {
    std::string type(lines.keep(lines.word()));
    Property property;
    const bool is_list = type == "list";
    if (is_list) {
        property.count = type_of(std::string(lines.keep(lines.word())), true, lines);
        type = lines.keep(lines.word());
    }
    property.type = type_of(type, false, lines);
    const std::string_view name = lines.keep(lines.word());
    const bool is_coordinate = element.name == "vertex" && (name == "x" || name == "y" || name == "z");
    if (is_coordinate) coordinates += name;
    property.is_corners = element.name == "face" && (name == "vertex_indices" || name == "vertex_index");
    if (property.is_corners) static_cast<void>(type_of(type, true, lines));
    if (is_list ? is_coordinate : property.is_corners) lines.refuse("corners as a list, and other numbers alone", name);
    property.is_kept = is_coordinate || property.is_corners;
    return property;
}

/// The rows of a text, each a line. A face of an OFF may have a colour behind its corners.
struct TextRows {
    Lines& lines;
    bool off;

    [[nodiscard]] std::string& kept() { return lines.kept; }
    void begin(const Element& element) { lines.expect(element.name); }
    void number(const Type&) { lines.number(); }
    std::int64_t integer(const Type&, std::int64_t least, std::int64_t most) {
        return lines.integer(lines.word(), least, most);
    }
    void end(const Element& element) {
        if (off && element.name == "face") lines.at = lines.words.size();
        lines.end_line();
    }
    void end_file() {
        if (lines.next()) lines.refuse("the end of the file", lines.words[0]);
    }
};

struct BinaryRows {
    const std::string& file;
    std::string_view bytes;
    std::size_t at;
    bool big_endian;
    std::string text = {};

    [[nodiscard]] std::string& kept() { return text; }
    void begin(const Element&) {}
    void number(const Type& type) {
        if (bytes.size() - at < type.size)
            refuse(file, "the file ends after ", bytes.size(), " bytes, within an element");
        text += bytes.substr(at, type.size);
        at += type.size;
    }
    std::int64_t integer(const Type& type, std::int64_t least, std::int64_t most) {
        number(type);
        std::uint64_t bits = 0;
        for (std::size_t i = 1; i <= type.size; ++i) {
            bits = bits << 8 | static_cast<unsigned char>(bytes[big_endian ? at - type.size - 1 + i : at - i]);
        }
        auto value = static_cast<std::int64_t>(bits);
        if (type.is_signed && bits >> (8 * type.size - 1) != 0) value -= std::int64_t{1} << (8 * type.size);
        if (value >= least && value <= most) return value;
        refuse(file, "byte ", at - type.size, ": expected an integer from ", least, " to ", most, ", got ", value);
    }
    void end(const Element&) {}
    void end_file() {
        if (at < bytes.size()) refuse(file, "byte ", at, ": expected the end of the file");
    }
};

/// Checks all rows of the elements, and keeps those of the vertices and faces.
template <class Rows>
void check_rows(std::vector<Element>& elements, std::int64_t vertices, Rows rows) {
    for (Element& element : elements) {
        rows.kept().clear();
        for (std::int64_t row = 0; row < element.count; ++row) {
            rows.begin(element);
            for (const Property& property : element.properties) {
                const std::size_t before = rows.kept().size();
                const std::int64_t least = property.is_corners ? 3 : 0;
                auto count = property.count.size == 0 ? 1 : rows.integer(property.count, least, max_corners);
                for (; count > 0; --count) {
                    if (property.is_corners) {
                        static_cast<void>(rows.integer(property.type, 0, vertices - 1));
                    } else {
                        rows.number(property.type);
                    }
                }
                if (!property.is_kept) rows.kept().resize(before);
            }
            rows.end(element);
        }
        element.body = rows.kept();
    }
    rows.end_file();
}

}  // namespace

std::string lower(std::string_view text) {
    std::string result(text);
    for (char& c : result) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
    return result;
}

std::string checked_obj(const std::string& file, std::string_view bytes) {
    constexpr std::array unused{"vn", "vt", "vp", "g", "o", "s", "l", "p", "usemtl", "mtllib"};
    Lines lines(file, bytes);
    for (std::int64_t vertices = 0; lines.next(true);) {
        const std::string_view kind = lines.word();
        const bool vertex = kind == "v";
        if (std::find(unused.begin(), unused.end(), kind) != unused.end()) continue;
        if (!vertex && kind != "f") lines.refuse("a statement of an OBJ surface", kind);
        const std::size_t most = vertex ? 7 : max_corners;  // with a weight and a colour
        if (lines.words.size() > 1 + most)
            lines.refuse("at most " + std::to_string(most) + " words in a statement", kind);
        lines.keep(kind);
        vertices += vertex;
        for (std::size_t i = 0; i < 3 || lines.at < lines.words.size(); ++i) {
            if (vertex) {
                lines.number();
                continue;
            }
            const std::string_view word = lines.word(), corner = word.substr(0, word.find('/'));
            if (lines.integer(corner, -vertices, max_index) == 0) lines.refuse("a vertex, counted from 1", word);
        }
        lines.end_line();
    }
    return lines.kept;
}

std::string checked_off(const std::string& file, std::string_view bytes) {
    const auto most = static_cast<std::int64_t>(bytes.size());
    Lines lines(file, bytes);
    lines.expect("OFF");
    if (lines.keep(lines.word()) != "OFF") lines.refuse("OFF, in ASCII and without variants", lines.words[0]);
    if (lines.words.size() == 1) lines.expect("the counts of vertices and faces");
    const std::int64_t vertices = lines.integer(lines.word(), 1, most), faces = lines.integer(lines.word(), 1, most);
    lines.number();
    lines.end_line();
    const std::string header = lines.kept;
    std::vector<Element> elements{{"vertex", vertices, std::vector<Property>(3)}, {"face", faces, {{{}, {1}, true}}}};
    check_rows(elements, vertices, TextRows{lines, true});
    return header + elements[0].body + elements[1].body;
}

/// ASCII in lower case and without the names, in which assimp searches for keywords; normals are 0.
std::string checked_stl(const std::string& file, std::string_view bytes) {
    std::uint64_t count = 0;
    if (bytes.size() >= 84) {
        for (std::size_t i = 4; i-- > 0;) count = count << 8 | static_cast<unsigned char>(bytes[80 + i]);
        const std::uint64_t size = 84 + 50 * count;
        // Some programs write more behind the triangles; whole triangles there are a wrong count.
        if (bytes.size() == size || (bytes.size() > size && (bytes.size() - size) % 50 != 0 && count > 0)) {
            std::string kept(bytes.substr(0, size));
            for (std::size_t at = 84; at < size; at += 50)
                std::fill_n(kept.begin() + static_cast<std::ptrdiff_t>(at), 12, '\0');
            return kept;
        }
        if (bytes.find('\0') != bytes.npos) {
            refuse(file, "expected ", size, " bytes of a binary STL with ", count, " triangles, got ", bytes.size());
        }
    }
    Lines facet(file,
                "facet normal n n n ; outer loop ; vertex 0 0 0 ; vertex 0 0 0 ; vertex 0 0 0 ; endloop ; endfacet");
    facet.next();
    const std::string text = lower(bytes);
    Lines lines(file, text);
    lines.expect("'solid'");
    do {
        if (lines.keep(lines.word()) != "solid") lines.refuse("'solid'", lines.words[0]);
        lines.kept += '\n';
        for (lines.expect("'facet'"); lines.words[0] != "endsolid"; lines.expect("'endsolid'")) {
            for (const std::string_view wanted : facet.words) {
                if (wanted == "0") {
                    lines.number();
                } else if (wanted == "n") {
                    const std::string_view word = lines.word();  // some programs write NaN, as nan(ind)
                    if (!is_number(word) && word.size() > 16) lines.refuse("a number of a normal", word);
                    lines.keep("0");
                } else if (wanted == ";") {
                    lines.end_line();
                    lines.expect("a line of a facet");
                } else if (lines.keep(lines.word()) != wanted) {
                    lines.refuse(std::string("'").append(wanted).append("'"), lines.words[lines.at - 1]);
                }
            }
            lines.end_line();
        }
        lines.kept += "endsolid\n";
    } while (lines.next());
    return lines.kept;
}

std::string checked_ply(const std::string& file, std::string_view bytes) {
    std::vector<Element> elements;
    std::string format, coordinates;
    Lines lines(file, bytes);
    lines.expect("'ply'");
    if (lines.keep(lines.word()) != "ply") lines.refuse("'ply'", lines.words[0]);
    for (lines.end_line(), lines.expect("'end_header'"); lines.words[0] != "end_header"; lines.expect("'end_header'")) {
        const std::string_view kind = lines.word();
        if (kind == "comment" || kind == "obj_info") continue;
        lines.kept.clear();
        lines.keep(kind);
        if (kind == "format") {
            format = lines.keep(lines.word());
            if (lines.keep(lines.word()) != "1.0") lines.refuse("version 1.0", lines.words[2]);
        } else if (kind == "element") {
            const std::string name(lines.keep(lines.word()));
            elements.push_back({name, lines.integer(lines.word(), 0, static_cast<std::int64_t>(bytes.size()))});
            elements.back().header = lines.kept + '\n';
        } else if (kind == "property" && !elements.empty()) {
            elements.back().properties.push_back(property_of(lines, elements.back(), coordinates));
            if (elements.back().properties.back().is_kept) elements.back().header += lines.kept + '\n';
        } else {
            lines.refuse("a statement of a PLY header", kind);
        }
        lines.end_line();
    }
    const auto element = [&](std::string_view name) {
        const auto is_named = [&](const Element& each) { return each.name == name; };
        if (std::count_if(elements.begin(), elements.end(), is_named) != 1) {
            refuse(file, "expected the elements vertex and face, once each");
        }
        return std::find_if(elements.begin(), elements.end(), is_named);
    };
    const auto vertex = element("vertex"), face = element("face");
    std::sort(coordinates.begin(), coordinates.end());
    if (coordinates != "xyz") refuse(file, "expected a property x, y and z of a vertex, got '", coordinates, "'");
    const auto is_corners = [](const Property& each) { return each.is_corners; };
    if (std::count_if(face->properties.begin(), face->properties.end(), is_corners) != 1) {
        refuse(file, "expected a list vertex_indices of a face, once");
    }
    if (format == "ascii") {
        check_rows(elements, vertex->count, TextRows{lines, false});
    } else {
        check_rows(elements, vertex->count,
                   BinaryRows{file, bytes, bytes.size() - lines.rest.size(), format == "binary_big_endian"});
    }
    // After \n, assimp skips a binary body's first \n.
    return "ply\nformat " + format + " 1.0\n" + vertex->header + face->header + "end_header\r\n" + vertex->body +
           face->body;
}

}  // namespace examples
