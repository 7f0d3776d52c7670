// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/mesh_syntax.hpp"

namespace examples {
namespace {

using membrane::refuse;

bool blank_or_end(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// Type of a number in a binary file.
struct Type {
    std::size_t size = 0;
    bool is_signed = false, real = false;
};

struct Property {
    std::string name;
    Type type, count;  ///< `count.size` is 0 except for a list.
};

struct Element {
    std::string name;
    std::int64_t count;
    std::vector<Property> properties = {};
};

struct Header {
    std::string format, text;  ///< Lines that end in \n.
    std::vector<Element> elements;
    std::string_view body;
};

Type type_of(const Lines& lines, std::size_t word) {
    static const std::vector<std::pair<std::vector<std::string_view>, Type>> types{
        {{"char", "int8"}, {1, true}},           {{"uchar", "uint8"}, {1}},
        {{"short", "int16"}, {2, true}},         {{"ushort", "uint16"}, {2}},
        {{"int", "int32"}, {4, true}},           {{"uint", "uint32"}, {4}},
        {{"float", "float32"}, {4, true, true}}, {{"double", "float64"}, {8, true, true}}};
    for (const auto& [names, type] : types) {
        if (std::find(names.begin(), names.end(), lines.word(word)) != names.end()) return type;
    }
    lines.refuse("expected a type of numbers, got ", lines.quoted(word));
}

void add_property(const Lines& lines, std::vector<Element>& elements) {
    if (elements.empty()) lines.refuse("expected an element before its properties");
    const bool list = lines.size() > 1 && lines.word(1) == "list";
    lines.check_size(list ? 5 : 3);
    Property property{std::string(lines.word(list ? 4 : 2)), type_of(lines, list ? 3 : 1), {}};
    if (list) property.count = type_of(lines, 2);
    if (property.count.real) lines.refuse("expected an integer type for the count of a list, got ", lines.quoted(2));
    elements.back().properties.push_back(property);
}

/// Where the word that ends the header begins: at the beginning of a line.
std::size_t header_end(std::string_view bytes) {
    constexpr std::string_view last = "end_header";
    for (std::size_t at = 1; (at = bytes.find(last, at)) != bytes.npos; ++at) {
        const bool whole = bytes.size() == at + last.size() || blank_or_end(bytes[at + last.size()]);
        if (whole && (bytes[at - 1] == '\n' || bytes[at - 1] == '\r')) return at;
    }
    return bytes.npos;
}

Header read_header(const std::string& file, std::string_view bytes) {
    const std::size_t first = std::min(bytes.find_first_of("\r\n"), bytes.size()), end = header_end(bytes);
    if (!bytes.starts_with("ply") || first < 3) refuse(file, "expected a file that begins with 'ply'");
    if (end == bytes.npos) refuse(file, "expected a header that ends with 'end_header'");
    std::string_view body = bytes.substr(end + 10);
    body.remove_prefix(std::min(body.find_first_not_of(" \t"), body.size()));
    // Where lines end with \r alone, a \n belongs to a binary body.
    const bool only_r = bytes[first] == '\r' && bytes[first + 1] != '\n';
    body.remove_prefix(std::min<std::size_t>(!only_r && body.starts_with("\r\n") ? 2 : 1, body.size()));
    Header header{{}, plain_text(file, bytes.substr(0, end)), {}, body};
    Lines lines(file, header.text);
    for (lines.next(false); lines.next(false);) {
        const std::string_view kind = lines.word(0);
        if (kind == "format") {
            lines.check_size(3);
            header.format = lines.word(1);
            if (lines.word(2) != "1.0") lines.refuse("expected version 1.0, got ", lines.quoted(2));
        } else if (kind == "element") {
            lines.check_size(3);
            header.elements.push_back(
                {std::string(lines.word(1)), lines.integer(2, 0, std::numeric_limits<std::int32_t>::max())});
        } else if (kind == "property") {
            add_property(lines, header.elements);
        } else if (kind != "comment" && kind != "obj_info") {
            lines.refuse("expected a statement of a PLY header, got ", lines.quoted(0));
        }
    }
    constexpr std::array formats{"ascii", "binary_little_endian", "binary_big_endian"};
    if (std::find(formats.begin(), formats.end(), header.format) == formats.end()) {
        refuse(file, "expected the format ascii, binary_little_endian or binary_big_endian 1.0");
    }
    return header;
}

/// Refuses elements other than those from which assimp takes the right vertices and triangles.
void check_elements(const std::string& file, const std::vector<Element>& elements) {
    if (elements.size() < 2 || elements[0].name != "vertex" || elements[1].name != "face") {
        refuse(file, "expected the elements vertex and face to be the first");
    }
    for (const Element& element : elements) {
        std::size_t lists = 0;
        for (const Property& property : element.properties) lists += property.count.size > 0;
        if (element.properties.empty()) refuse(file, "element ", element.name, " has no properties");
        if (&element == &elements[1] ? lists != 1 : lists != 0) {
            refuse(file, "element ", element.name, " has ", lists, " lists, expected one of a face, else none");
        }
    }
    for (const std::string_view name : {"x", "y", "z"}) {
        const auto& all = elements[0].properties;
        const auto count = std::count_if(all.begin(), all.end(), [&](const Property& one) { return one.name == name; });
        if (count != 1) refuse(file, "expected one property ", name, " of a vertex, got ", count);
    }
    for (const Property& property : elements[1].properties) {
        if (property.count.size == 0) continue;
        if ((property.name != "vertex_indices" && property.name != "vertex_index") || property.type.real) {
            refuse(file, "expected a list vertex_indices of integers, got ", property.name);
        }
    }
}

/// An integer of a binary body.
std::int64_t integer(std::string_view bytes, const Type& type, bool big_endian) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < type.size; ++i) {
        value = value << 8 | static_cast<unsigned char>(bytes[big_endian ? i : type.size - 1 - i]);
    }
    const std::uint64_t sign = std::uint64_t{1} << (8 * type.size - 1);
    return static_cast<std::int64_t>(value) -
           (type.is_signed && (value & sign) != 0 ? static_cast<std::int64_t>(2 * sign) : 0);
}

void check_binary(const std::string& file, const Header& header) {
    const bool big_endian = header.format == "binary_big_endian";
    std::string_view rest = header.body;
    for (const Element& element : header.elements) {
        for (std::int64_t row = 0; row < element.count; ++row) {
            const auto need = [&](std::size_t size) {
                if (size <= rest.size()) return;
                refuse(file, "the file ends within ", element.name, " ", row, " of ", element.count);
            };
            for (const Property& property : element.properties) {
                need(std::max(property.type.size, property.count.size));
                if (property.count.size == 0) {
                    rest.remove_prefix(property.type.size);
                    continue;
                }
                const auto corners = integer(rest, property.count, big_endian);
                rest.remove_prefix(property.count.size);
                if (corners < 3) refuse(file, "face ", row, " has ", corners, " corners, expected 3 or more");
                need(static_cast<std::size_t>(corners) * property.type.size);
                for (std::int64_t k = 0; k < corners; ++k) {
                    const auto v = integer(rest, property.type, big_endian);
                    rest.remove_prefix(property.type.size);
                    if (v >= 0 && v < header.elements[0].count) continue;
                    refuse(file, "face ", row, " names vertex ", v, ", expected 0 to ", header.elements[0].count - 1);
                }
            }
        }
    }
    if (!rest.empty()) refuse(file, "has ", rest.size(), " bytes after the last element, expected none");
}

/// One line for each row.
std::string checked_ascii(const std::string& file, const Header& header) {
    const std::string body = plain_text(file, header.body);
    const auto header_lines = static_cast<std::size_t>(std::count(header.text.begin(), header.text.end(), '\n')) + 1;
    Lines lines(file, body, header_lines);
    std::string result;
    for (const Element& element : header.elements) {
        for (std::int64_t row = 0; row < element.count; ++row) {
            lines.expect(element.name, " ", row, " of ", element.count);
            std::size_t at = 0;
            for (const Property& property : element.properties) {
                if (at >= lines.size()) lines.refuse("expected ", property.name, " of ", element.name, " ", row);
                if (property.count.size == 0) {
                    lines.check_number(at++);
                    continue;
                }
                const auto corners =
                    static_cast<std::size_t>(lines.integer(at++, 3, std::numeric_limits<std::int32_t>::max()));
                if (lines.size() - at < corners)
                    lines.refuse("expected ", corners, " corners, got ", lines.size() - at);
                for (const std::size_t end = at + corners; at < end; ++at) {
                    static_cast<void>(lines.integer(at, 0, header.elements[0].count - 1));
                }
            }
            lines.check_size(at);
            for (std::size_t i = 0; i < at; ++i) (result += lines.word(i)) += i + 1 < at ? ' ' : '\n';
        }
    }
    if (lines.next()) lines.refuse("expected the end of the file, got ", lines.quoted(0));
    return result;
}

}  // namespace

std::string checked_ply(const std::string& file, std::string_view bytes) {
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
    const Header header = read_header(file, bytes);
    check_elements(file, header.elements);
    if (header.format == "ascii") return header.text + "end_header\n" + checked_ascii(file, header);
    check_binary(file, header);
    return header.text + "end_header\r\n" + std::string(header.body);  // after \n, assimp skips a body's first \n
}

}  // namespace examples
