// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <istream>
#include <limits>
#include <locale>
#include <ostream>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <membrane/replay/recording.hpp>

/// Reading and writing of recordings. Offline.
///
///     std::ofstream file("run.rec", std::ios::binary);
///     membrane::write_recording(file, recorder.recording());
///     const auto recording = membrane::read_recording<double>(stream, mesh.vertex_count());
///
/// The file is little-endian on every machine: 8 bytes of magic; version, bytes of a number (4 or 8), vertices (4 bytes
/// each); ticks (8 bytes); checksum. Then for each tick: 14 numbers (position, axis, radius, velocity, time, force;
/// IEEE 754), a byte that is 1 while grasping, checksum. In version 2, which a recording with snapshots has, their
/// number and a checksum follow, then for each: tick, bytes (8 bytes each), the state as it is in memory, checksum. A
/// checksum is the CRC-32 of everything before it except checksums, so it also detects lost or reordered ticks. A state
/// is restored only where numbers have the same order of bytes.
namespace membrane {

/// Version of the format: 1 without, 2 with snapshots.
inline constexpr std::uint32_t recording_version = 2;

/// Write errors are in the state of the stream.
template <Real Scalar>
void write_recording(std::ostream& file, const Recording<Scalar>& recording);

/// The recording as written, bit for bit.
/// @throws InvalidInput if the file is not a complete recording in this scalar, or if `vertex_count` is given and
/// differs; the message names the position, the value found and the value required
template <Real Scalar>
[[nodiscard]] Recording<Scalar> read_recording(std::istream& file, Index vertex_count = no_index);

/// A line of names and units, then one line per tick, with enough digits to distinguish all numbers.
template <Real Scalar>
void write_csv(std::ostream& text, const Recording<Scalar>& recording);

namespace detail {

inline constexpr std::string_view reader_name = "read_recording";

// No text begins with these bytes, and a conversion of line ends changes them.
inline constexpr std::array<unsigned char, 8> recording_magic{0x89, 'M', 'R', 'E', 'C', '\r', '\n', 0x1a};

/// CRC-32 as in zip and png: reflected polynomial 0xEDB88320.
class Checksum {
  public:
    void add(unsigned char byte) noexcept { state_ = table[(state_ ^ byte) & 0xffU] ^ (state_ >> 8U); }
    [[nodiscard]] std::uint32_t value() const noexcept { return ~state_; }

  private:
    static constexpr std::array<std::uint32_t, 256> table = [] {
        std::array<std::uint32_t, 256> result{};
        for (std::uint32_t i = 0; i < 256; ++i) {
            std::uint32_t value = i;
            for (int bit = 0; bit < 8; ++bit) value = (value >> 1U) ^ ((value & 1U) != 0 ? 0xedb88320U : 0U);
            result[i] = value;
        }
        return result;
    }();

    std::uint32_t state_ = 0xffffffffU;
};

class RecordingWriter {
  public:
    explicit RecordingWriter(std::ostream& file) : file_(&file) {}

    template <class Unsigned>
    void write(Unsigned value) {
        for (std::size_t i = 0; i < sizeof value; ++i) {
            const auto byte = static_cast<unsigned char>(value >> (8 * i) & 0xffU);
            sum_.add(byte);
            file_->put(static_cast<char>(byte));
        }
    }

    void write_checksum() {
        const Checksum before = sum_;
        write(before.value());
        sum_ = before;
    }

  private:
    std::ostream* file_;
    Checksum sum_;
};

class RecordingReader {
  public:
    explicit RecordingReader(std::istream& file) : file_(&file) {}

    /// The part being read, for messages: "the header", or "tick i of n".
    void enter(std::string part) { part_ = std::move(part); }

    template <class Unsigned>
    [[nodiscard]] Unsigned read() {
        Unsigned value = 0;
        for (std::size_t i = 0; i < sizeof value; ++i) {
            const int byte = file_->get();
            if (byte == std::istream::traits_type::eof()) {
                refuse(reader_name, "the file must go on, but ends after ", count_, " bytes, in ", part_);
            }
            ++count_;
            sum_.add(static_cast<unsigned char>(byte));
            value = static_cast<Unsigned>(value | static_cast<Unsigned>(byte) << (8 * i));
        }
        return value;
    }

    void check_sum() {
        const Checksum before = sum_;
        const auto found = read<std::uint32_t>();
        sum_ = before;
        if (found != sum_.value()) {
            refuse(reader_name, "checksum of ", part_, " must be ", sum_.value(), ", got ", found);
        }
    }

    void check_end() {
        if (file_->peek() != std::istream::traits_type::eof()) {
            refuse(reader_name, "the file must end after ", part_, ", but goes on beyond ", count_, " bytes");
        }
    }

  private:
    std::istream* file_;
    Checksum sum_;
    std::size_t count_ = 0;
    std::string part_ = "the header";
};

struct RecordingHeader {
    std::uint32_t version, vertex_count;
    std::uint64_t ticks;
};

inline RecordingHeader read_header(RecordingReader& file, std::size_t scalar_size, Index vertex_count) {
    for (std::size_t i = 0; i < recording_magic.size(); ++i) {
        const unsigned found = file.read<unsigned char>();
        if (found != recording_magic[i]) {
            refuse(reader_name, "byte ", i, " of a recording must be ", unsigned{recording_magic[i]}, ", got ", found);
        }
    }
    const auto version = file.read<std::uint32_t>();
    if (version < 1 || version > recording_version) {
        refuse(reader_name, "version must be 1 or ", recording_version, ", got ", version);
    }
    if (const auto size = file.read<std::uint32_t>(); size != scalar_size) {
        refuse(reader_name, "numbers must be of ", scalar_size, " bytes, got ", size);
    }
    const auto vertices = file.read<std::uint32_t>();
    const auto ticks = file.read<std::uint64_t>();
    file.check_sum();
    const auto most = static_cast<std::uint32_t>(unlimited);
    if (vertices > most) refuse(reader_name, "vertices must be at most ", most, ", got ", vertices);
    if (vertex_count != no_index && static_cast<Index>(vertices) != vertex_count) {
        refuse(reader_name, "the membrane recorded must have ", vertex_count, " vertices, got ", vertices);
    }
    return {version, vertices, ticks};
}

template <Real Scalar>
[[nodiscard]] RecordedTick<Scalar> read_tick(RecordingReader& file) {
    std::array<Scalar, numbers_of_tick> numbers;
    for (Scalar& number : numbers) {
        const auto bits = file.read<BitsOf<Scalar>>();
        std::memcpy(&number, &bits, sizeof number);
    }
    const unsigned grasping = file.read<unsigned char>();
    file.check_sum();
    if (grasping > 1) refuse(reader_name, "grasping must be 0 or 1, got ", grasping);
    return tick_of(numbers, grasping == 1);
}

inline void write_snapshots(RecordingWriter& file, const std::vector<RecordedSnapshot>& snapshots) {
    file.write(static_cast<std::uint64_t>(snapshots.size()));
    file.write_checksum();
    for (const auto& snapshot : snapshots) {
        file.write(static_cast<std::uint64_t>(snapshot.tick));
        file.write(static_cast<std::uint64_t>(snapshot.state.size()));
        for (const std::byte byte : snapshot.state) file.write(std::to_integer<unsigned char>(byte));
        file.write_checksum();
    }
}

[[nodiscard]] inline std::vector<RecordedSnapshot> read_snapshots(RecordingReader& file, std::uint64_t ticks) {
    file.enter("the number of snapshots");
    const auto count = file.read<std::uint64_t>();
    file.check_sum();
    std::vector<RecordedSnapshot> snapshots;
    for (std::uint64_t i = 0; i < count; ++i) {
        file.enter("snapshot " + std::to_string(i) + " of " + std::to_string(count));
        RecordedSnapshot snapshot;
        snapshot.tick = static_cast<std::size_t>(file.read<std::uint64_t>());
        const std::size_t first = snapshots.empty() ? 0 : snapshots.back().tick;
        if (snapshot.tick < first || snapshot.tick >= ticks) {
            refuse(reader_name, "snapshot ", i, " must be before a tick from ", first, " to ", ticks, ", got ",
                   snapshot.tick);
        }
        const auto size = file.read<std::uint64_t>();
        for (std::uint64_t byte = 0; byte < size; ++byte)  // memory is bounded by the file, not by its numbers
            snapshot.state.push_back(static_cast<std::byte>(file.read<unsigned char>()));
        file.check_sum();
        snapshots.push_back(std::move(snapshot));
    }
    return snapshots;
}

}  // namespace detail

template <Real Scalar>
void write_recording(std::ostream& file, const Recording<Scalar>& recording) {
    detail::RecordingWriter writer(file);
    for (const unsigned char byte : detail::recording_magic) writer.write(byte);
    writer.write(recording.snapshots.empty() ? std::uint32_t{1} : recording_version);
    writer.write(static_cast<std::uint32_t>(sizeof(Scalar)));
    writer.write(static_cast<std::uint32_t>(recording.vertex_count));
    writer.write(static_cast<std::uint64_t>(recording.ticks.size()));
    writer.write_checksum();
    for (const auto& tick : recording.ticks) {
        for (const Scalar number : detail::numbers_of(tick)) {
            detail::BitsOf<Scalar> bits;
            std::memcpy(&bits, &number, sizeof bits);
            writer.write(bits);
        }
        writer.write(static_cast<unsigned char>(tick.tool.grasping ? 1 : 0));
        writer.write_checksum();
    }
    if (!recording.snapshots.empty()) detail::write_snapshots(writer, recording.snapshots);
}

template <Real Scalar>
Recording<Scalar> read_recording(std::istream& file, Index vertex_count) {
    detail::RecordingReader reader(file);
    const auto header = detail::read_header(reader, sizeof(Scalar), vertex_count);
    Recording<Scalar> recording{.vertex_count = static_cast<Index>(header.vertex_count)};
    const std::string total = " of " + std::to_string(header.ticks);
    for (std::uint64_t i = 0; i < header.ticks; ++i) {  // memory is bounded by the file, not by the header
        reader.enter("tick " + std::to_string(i) + total);
        recording.ticks.push_back(detail::read_tick<Scalar>(reader));
    }
    if (header.version > 1) recording.snapshots = detail::read_snapshots(reader, header.ticks);
    reader.check_end();
    return recording;
}

template <Real Scalar>
void write_csv(std::ostream& text, const Recording<Scalar>& recording) {
    text << "x_m,y_m,z_m,axis_x_m,axis_y_m,axis_z_m,radius_m,velocity_x_m_s,velocity_y_m_s,velocity_z_m_s,time_s,"
            "force_x_N,force_y_N,force_z_N,grasping\n";
    for (const auto& tick : recording.ticks) {
        std::ostringstream line;  // independent of locale and precision of `text`
        line.imbue(std::locale::classic());
        line.precision(std::numeric_limits<Scalar>::max_digits10);
        for (const Scalar number : detail::numbers_of(tick)) line << number << ',';
        text << line.str() << (tick.tool.grasping ? "1\n" : "0\n");
    }
}

}  // namespace membrane
