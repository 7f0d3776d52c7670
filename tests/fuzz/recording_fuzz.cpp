// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <optional>
#include <sstream>
#include <string>

#include <membrane/replay/recording_file.hpp>

#include "bytes.hpp"

// Any bytes as the file of a recording: refused, or a recording that is written as the same bytes. Any recording is
// read as it was written; with one byte changed, cut off or added it is refused.

using test::Bytes;
using test::require;

namespace {

template <class Scalar>
std::optional<membrane::Recording<Scalar>> read(const std::string& bytes) {
    std::istringstream file(bytes);
    try {
        return membrane::read_recording<Scalar>(file);
    } catch (const membrane::InvalidInput&) {
        return std::nullopt;
    }
}

template <class Scalar>
std::string written(const membrane::Recording<Scalar>& recording) {
    std::ostringstream file;
    membrane::write_recording(file, recording);
    return file.str();
}

template <class Scalar>
void read_any(const Bytes& bytes) {
    const std::string file(reinterpret_cast<const char*>(bytes.data()), bytes.left());
    if (const auto recording = read<Scalar>(file)) require(written(*recording) == file);
}

template <class Scalar>
void write_any(Bytes bytes) {
    membrane::Recording<Scalar> recording{.vertex_count = bytes.next<std::uint16_t>()};
    const auto at = bytes.next<std::uint16_t>();
    const auto change = bytes.next<std::uint8_t>();
    while (bytes.left() > 0 && recording.ticks.size() < 50) {
        std::array<Scalar, membrane::detail::numbers_of_tick> numbers;
        for (Scalar& number : numbers) number = bytes.next<Scalar>();
        recording.ticks.push_back(membrane::detail::tick_of(numbers, bytes.index(2) == 1));
    }
    std::string file = written(recording);
    const auto back = read<Scalar>(file);
    require(back && written(*back) == file);
    require(!read<Scalar>(file + static_cast<char>(change)));
    require(!read<Scalar>(file.substr(0, at % file.size())));
    std::ostringstream text;
    membrane::write_csv(text, recording);
    if (change == 0) return;
    char& byte = file[at % file.size()];
    byte = static_cast<char>(static_cast<std::uint8_t>(byte) ^ change);
    require(!read<Scalar>(file));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Bytes bytes(data, size);
    switch (bytes.index(4)) {
        case 0: read_any<float>(bytes); break;
        case 1: read_any<double>(bytes); break;
        case 2: write_any<float>(bytes); break;
        default: write_any<double>(bytes);
    }
    return 0;
}
