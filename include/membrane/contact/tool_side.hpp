// SPDX-License-Identifier: MIT
#pragma once

#include <membrane/core/types.hpp>

/// The side of a surface on which a tool is.
///
///     membrane::ToolSide<double> side;
///     side.touch(contact.patch.side, true, false);                        // a tick in contact, on a certain side
///     side.leave(false, true);                                            // one without, below a displaced border
namespace membrane {

/// The side of an open surface on which the tool is, from tick to tick. A tool keeps it until it is clear of the
/// surface or has slid off a border that it displaced:
///
/// | the tick | `sign` | `slid_off` |
/// |---|---|---|
/// | in contact, on a side that is certain | that side, if none was known | |
/// | in contact, on a side that is not certain | | |
/// | in contact, a shaft below a displaced border | | yes |
/// | no contact, clear of the surface | none | no |
/// | no contact, below a displaced border | none | |
/// | no contact, neither | | |
template <Real Scalar>
class ToolSide {
  public:
    /// 1: triangles run counter-clockwise seen from the tool; -1: clockwise; 0: not known.
    [[nodiscard]] Scalar sign() const noexcept { return sign_; }
    [[nodiscard]] bool known() const noexcept { return sign_ != 0; }  ///< Whether the side is known.

    /// Whether a shaft has slid off a displaced border: its parts may be on different sides.
    [[nodiscard]] bool slid_off() const noexcept { return slid_off_; }

    /// After a tick in contact on `side`, 1 or -1.
    void touch(Scalar side, bool is_certain, bool slides_off) noexcept {
        if (!known() && is_certain) sign_ = side;
        slid_off_ = slid_off_ || slides_off;
    }

    /// After a tick without contact.
    void leave(bool is_clear, bool is_below_border) noexcept {
        if (is_clear || is_below_border) sign_ = 0;
        slid_off_ = slid_off_ && !is_clear;
    }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.sign_, self.slid_off_);
    }

  private:
    Scalar sign_ = 0;
    bool slid_off_ = false;
};

}  // namespace membrane
