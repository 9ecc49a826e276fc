#include "integration/rosenbrock_method.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

constexpr int stages = RosenbrockMethod::stages;
using Rows = std::array<std::array<Real, stages - 1>, stages>;

constexpr Real gamma_of_method = 0.25;

constexpr std::array<Real, 4> last_a{7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775};
constexpr Rows a{{{},
                  {3.0},
                  {0.906377755268814, -0.189707390391685},
                  {3.758617027739064, 1.161741776019525, -0.849258085312803},
                  {last_a[0], last_a[1], last_a[2], last_a[3]},
                  {last_a[0], last_a[1], last_a[2], last_a[3], 1.0}}};
constexpr Rows C{
    {{},
     {-12.0},
     {-6.354581592719008, 0.338972550544623},
     {-8.575016317114033, -7.606483992117508, 12.22499765012482},
     {-5.888975457523102, -8.157396617841821, 24.805546872612922, 12.790401512796979},
     {-4.408651676063871, -6.692003137674639, 24.625568527593117, 16.627521966636085, -5.714285714285718}}};
constexpr std::array<Real, stages> c{0.0, 0.75, 0.321448134013046, 0.519745732277726, 1.0, 1.0};
constexpr std::array<Real, stages> d{gamma_of_method, -0.5, -0.189532918363016, 0.085612108792769, 0.0, 0.0};

}  // namespace

RosenbrockMethod::RosenbrockMethod(RosenbrockSystem& system, int size)
    : system_(system), size_(at(size)), rate_(size_) {
  for (AlignedVector& stage : stage_) stage.resize(size_);
}

int RosenbrockMethod::step(const RosenbrockStart& start, Real h, const Real* weight, Real* next, Real& error) {
  error = std::numeric_limits<Real>::infinity();
  const Kernels& kernel = kernels();
  const auto n = static_cast<std::int64_t>(size_);
  const Real gamma = gamma_of_method * h;
  if (const int result = system_.factor(gamma); result != 0) return std::min(result, 0);

  std::array<const Real*, stages> stage{};
  std::array<Real, stages - 1> coupling{};
  for (std::size_t i = 0; i < stages; ++i) stage[i] = stage_[i].data();
  kernel.linear_sum(n, gamma, start.rate, gamma * h * d[0], start.rate_by_time, stage_[0].data());
  if (const int result = system_.solve(stage_[0].data()); result != 0) return std::min(result, 0);
  for (std::size_t i = 1; i < stages; ++i) {
    Real* U = stage_[i].data();
    // gamma h sum_j C_ij / h U_j
    for (std::size_t j = 0; j < i; ++j) coupling[j] = gamma_of_method * C[i][j];
    kernel.combine_stages(n, static_cast<int>(i), a[i].data(), coupling.data(), stage.data(), start.state,
                          gamma * h * d[i], start.rate_by_time, next, U);
    if (const int result = system_.rate(start.t + c[i] * h, next, rate_.data()); result != 0) {
      return std::min(result, 0);
    }
    kernel.linear_sum(n, gamma, rate_.data(), 1.0, U, U);
    if (const int result = system_.solve(U); result != 0) return std::min(result, 0);
  }
  const Real* estimate = stage_.back().data();
  kernel.linear_sum(n, 1.0, estimate, 1.0, next, next);
  error = std::sqrt(kernel.weighted_square_sum(n, estimate, weight) / static_cast<Real>(n));
  return 0;
}

}  // namespace mixed_order_game
