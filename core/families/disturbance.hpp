// External disturbances d_i of the plants, as the closed loop sees them: functions of absolute time.
#pragma once

#include <cmath>
#include <limits>
#include <memory>

#include "families/game_family.hpp"
#include "numbers/dependencies.hpp"
#include "numbers/dual.hpp"

namespace mixed_order_game {

class Disturbance : public GameFamily {
 public:
  using GameFamily::GameFamily;
  [[nodiscard]] virtual std::unique_ptr<Disturbance> clone() const = 0;

  /// The absolute time [s] from which every t below counts; call refresh() after changing it.
  Real time_origin = 0.0;

  /// d[own entry] = d_il(time_origin + t) of the hosted players; t in seconds. Switches have the values that are held,
  /// or, without any, those that they have just after t.
  virtual void values(Real t, Real* d, const Real* held = nullptr) const = 0;
  virtual void values(const CoefficientsAs<Dual>& coefficients, const Dual& t, Dual* d,
                      const Real* held = nullptr) const = 0;
  virtual void values(const CoefficientsAs<Dependencies>& coefficients, const Dependencies& t,
                      Dependencies* d) const = 0;

  /// The least change of t that values() sees.
  [[nodiscard]] virtual Real resolution(Real t) const { return std::numeric_limits<Real>::epsilon() * std::fabs(t); }
};

}  // namespace mixed_order_game
