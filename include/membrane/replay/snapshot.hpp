// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include <membrane/core/fixed_vector.hpp>
#include <membrane/core/index_set.hpp>
#include <membrane/core/types.hpp>

/// Saves the state of a running loop into a buffer, and restores it to the same bits.
///
///     std::vector<std::byte> buffer(membrane::snapshot_capacity(solver, tracker, grasper, limit, x));
///     const auto size = membrane::save_snapshot(buffer, solver, tracker, grasper, limit, x);       // at any tick
///     if (membrane::restore_snapshot({buffer.data(), size}, solver, tracker, grasper, limit, x)) tree.refit(x);
///
/// A snapshot holds what a component keeps from tick to tick, not its constants: it is restored into components that
/// were constructed from the same mesh with the same options. The tree and normals depend on the positions alone:
/// refit and update them afterwards. If the membrane tears, these and all others that follow it are saved, too.
namespace membrane {

namespace detail {

template <class T>
inline constexpr bool is_fixed_vector = false;
template <class Item>
inline constexpr bool is_fixed_vector<FixedVector<Item>> = true;

template <class T>
inline constexpr bool is_list_of_bytes = false;
template <class Item>
inline constexpr bool is_list_of_bytes<std::vector<Item>> = std::is_trivially_copyable_v<Item>;

/// Visits the parts of a state, down to pieces of memory: `store.piece(data, bytes)`, and for a list that may have up
/// to `capacity` items `store.count(present, capacity, bytes)`, which returns how many follow.
template <class Store>
class StateVisitor {
  public:
    static constexpr bool restores = Store::restores;  ///< whether the parts are overwritten

    explicit StateVisitor(Store& store) : store_(store) {}

    template <class... Parts>
    void operator()(Parts&... parts) const noexcept {
        (visit(parts), ...);
    }

  private:
    template <class Part>
    void visit(Part& part) const noexcept {
        using T = std::remove_const_t<Part>;
        if constexpr (requires { T::visit_state(part, *this); }) {
            T::visit_state(part, *this);
        } else if constexpr (is_fixed_vector<T>) {
            visit_list(part, part.capacity(), [&](const auto& item) { part.try_push_back(item); });
        } else if constexpr (std::is_same_v<T, IndexSet>) {
            visit_list(part, part.capacity(), [&](const auto& i) { part.insert(i); });
        } else if constexpr (is_list_of_bytes<T>) {
            store_.piece(part.data(), part.size() * sizeof(part[0]));
        } else if constexpr (requires { part.outerStride(); }) {
            for (Eigen::Index j = 0; j < part.cols(); ++j)
                store_.piece(part.col(j).data(), static_cast<std::size_t>(part.rows()) * sizeof(part(0, j)));
        } else {
            static_assert(std::is_trivially_copyable_v<T>, "a snapshot takes plain data, or what has visit_state");
            store_.piece(&part, sizeof part);
        }
    }

    template <class List, class Add>
    void visit_list(List& list, std::size_t capacity, Add add) const noexcept {
        using Item = std::remove_cvref_t<decltype(list.items()[0])>;
        static_assert(std::is_trivially_copyable_v<Item>);
        const std::size_t count = store_.count(list.items().size(), capacity, sizeof(Item));
        if constexpr (restores) {
            list.clear();
            for (std::size_t i = 0; i < count; ++i) {
                Item item;
                store_.piece(&item, sizeof item);
                add(item);
            }
        } else if (count > 0) {
            store_.piece(list.items().data(), count * sizeof(Item));
        }
    }

    Store& store_;
};

/// Multiplies and shifts whole words: several bytes a cycle.
class WordHash {
  public:
    void add(std::uint64_t word) noexcept {
        value_ = (value_ ^ word) * 0x9e3779b97f4a7c15U;
        value_ ^= value_ >> 32U;
    }
    void add(std::span<const std::byte> bytes) noexcept {
        for (std::size_t i = 0; i < bytes.size(); i += sizeof(std::uint64_t)) {
            std::uint64_t word = 0;
            std::memcpy(&word, bytes.data() + i, (std::min)(sizeof word, bytes.size() - i));
            add(word);
        }
        add(bytes.size());
    }
    [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

  private:
    std::uint64_t value_ = 0x6d656d6272616e65U;
};

/// The bytes that a state needs at most, and a signature of its kind: sizes and capacities of all parts in order, and
/// the order of bytes.
class StateMeasure {
  public:
    static constexpr bool restores = false;

    void piece(const void* /*data*/, std::size_t bytes) noexcept {
        capacity_ += bytes;
        kind_.add(bytes);
    }
    [[nodiscard]] std::size_t count(std::size_t /*present*/, std::size_t capacity, std::size_t bytes) noexcept {
        piece(nullptr, sizeof(std::uint64_t));
        piece(nullptr, capacity * bytes);
        return 0;
    }
    [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
    [[nodiscard]] std::uint64_t signature() const noexcept {
        WordHash all = kind_;
        all.add(std::endian::native == std::endian::little ? 1 : 2);
        return all.value();
    }

  private:
    std::size_t capacity_ = 0;
    WordHash kind_;
};

/// Writes into a buffer until it is full.
class StateWriter {
  public:
    static constexpr bool restores = false;

    explicit StateWriter(std::span<std::byte> buffer) : buffer_(buffer) {}

    void piece(const void* data, std::size_t bytes) noexcept {
        if (full_ || buffer_.size() - size_ < bytes) {
            full_ = true;
            return;
        }
        if (bytes > 0) std::memcpy(buffer_.data() + size_, data, bytes);
        size_ += bytes;
    }
    [[nodiscard]] std::size_t count(std::size_t present, std::size_t /*capacity*/, std::size_t /*bytes*/) noexcept {
        const auto number = static_cast<std::uint64_t>(present);
        piece(&number, sizeof number);
        return present;
    }
    [[nodiscard]] std::span<const std::byte> written() const noexcept { return buffer_.first(size_); }
    [[nodiscard]] bool full() const noexcept { return full_; }

  private:
    std::span<std::byte> buffer_;
    std::size_t size_ = 0;
    bool full_ = false;
};

/// Reads what a `StateWriter` wrote.
class StateReader {
  public:
    static constexpr bool restores = true;

    explicit StateReader(std::span<const std::byte> bytes) : left_(bytes) {}

    void piece(void* data, std::size_t bytes) noexcept {
        MEMBRANE_ASSERT(bytes <= left_.size());
        if (bytes > 0) std::memcpy(data, left_.data(), bytes);
        left_ = left_.subspan(bytes);
    }
    [[nodiscard]] std::size_t count(std::size_t /*present*/, std::size_t /*capacity*/, std::size_t /*bytes*/) noexcept {
        std::uint64_t number = 0;
        piece(&number, sizeof number);
        return static_cast<std::size_t>(number);
    }

  private:
    std::span<const std::byte> left_;
};

struct SnapshotHeader {
    std::uint64_t signature = 0;  // of the components, see `StateMeasure`
    std::uint64_t size = 0;       // of what follows the header [bytes]
    std::uint64_t checksum = 0;   // of what follows the header
};

template <class... Components>
[[nodiscard]] StateMeasure measure(const Components&... components) noexcept {
    StateMeasure result;
    StateVisitor<StateMeasure>{result}(components...);
    return result;
}

}  // namespace detail

/// The size of a buffer that is sufficient for every state of these components [bytes]: solvers, trackers, graspers,
/// limiters, moving bodies, force policies, matrices of positions. Plain data of one's own is taken as it is; a type
/// with a static `visit_state(self, visit)` names its parts. O(1) but for the number of components.
template <class... Components>
[[nodiscard]] std::size_t snapshot_capacity(const Components&... components) noexcept {
    return sizeof(detail::SnapshotHeader) + detail::measure(components...).capacity();
}

/// Saves the state of the components between two ticks. Returns the number of bytes written, 0 if the buffer is too
/// small. Online. Cost: some 200 bytes a vertex for a solver, copied.
template <class... Components>
[[nodiscard]] std::size_t save_snapshot(std::span<std::byte> buffer, const Components&... components) noexcept {
    detail::SnapshotHeader header;
    if (buffer.size() < sizeof header) return 0;
    detail::StateWriter writer(buffer.subspan(sizeof header));
    detail::StateVisitor<detail::StateWriter>{writer}(components...);
    if (writer.full()) return 0;
    detail::WordHash checksum;
    checksum.add(writer.written());
    header = {detail::measure(components...).signature(), writer.written().size(), checksum.value()};
    std::memcpy(buffer.data(), &header, sizeof header);
    return sizeof header + writer.written().size();
}

/// Restores the state of the components, in the order in which they were saved, so that the next ticks have the same
/// bits as those after the save. Returns false and changes nothing if the snapshot is damaged, or of other components:
/// other types, numbers of vertices or capacities. Constants are not compared. Online. Cost: as `save_snapshot`.
template <class... Components>
[[nodiscard]] bool restore_snapshot(std::span<const std::byte> snapshot, Components&&... components) noexcept {
    detail::SnapshotHeader header;
    if (snapshot.size() < sizeof header) return false;
    std::memcpy(&header, snapshot.data(), sizeof header);
    const auto state = snapshot.subspan(sizeof header);
    detail::WordHash checksum;
    checksum.add(state);
    if (header.signature != detail::measure(components...).signature() || header.size != state.size() ||
        header.checksum != checksum.value()) {
        return false;
    }
    detail::StateReader reader(state);
    detail::StateVisitor<detail::StateReader>{reader}(components...);
    return true;
}

}  // namespace membrane
