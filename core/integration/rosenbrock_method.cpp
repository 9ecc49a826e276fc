#include "integration/rosenbrock_method.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

constexpr int stages = RosenbrockMethod::stages;
using Rows = std::array<std::array<Real, stages - 1>, stages>;

constexpr Real gamma_of_method = 0.21193756319429014;

constexpr std::array<Real, 5> last_a{-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
                                     0.030198172008377946};
constexpr Rows a{{{},
                  {3.0},
                  {2.849394379747939, 0.45842242204463923},
                  {-6.954028509809101, 2.489845061869568, -10.358996098473584},
                  {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641},
                  {last_a[0], last_a[1], last_a[2], last_a[3], last_a[4]},
                  {last_a[0], last_a[1], last_a[2], last_a[3], last_a[4], 1.0},
                  {last_a[0], last_a[1], last_a[2], last_a[3], last_a[4], 1.0, 1.0}}};
constexpr Rows C{{{},
                  {-14.155112264123755},
                  {-17.97296035885952, -2.859693295451294},
                  {147.12150275711716, -1.41221402718213, 71.68940251302358},
                  {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306},
                  {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471},
                  {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
                   -28.087943162872662},
                  {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
                   -54.66780262877968, -9.48861652309627}}};
constexpr std::array<Real, stages> c{
    0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0};
constexpr std::array<Real, stages> d{
    gamma_of_method, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0, 0.0};

}  // namespace

RosenbrockMethod::RosenbrockMethod(RosenbrockSystem& system, int size)
    : system_(system), size_(at(size)), rate_(size_), rate_by_time_(size_) {
  for (AlignedVector& stage : stage_) stage.resize(size_);
}

int RosenbrockMethod::step(Real t, Real h, Real resolution, const Real* state, const Real* weight, Real* next,
                           Real& error) {
  error = std::numeric_limits<Real>::infinity();
  const Kernels& kernel = kernels();
  const auto n = static_cast<std::int64_t>(size_);
  const Real gamma = gamma_of_method * h;
  // rounding of time and of rates, and the difference in place of the derivative, each stay far below the estimate
  const Real moment = (t + std::max(std::ldexp(h, -20), 1024.0 * resolution)) - t;
  if (const int result = system_.rate(t + moment, state, rate_by_time_.data()); result != 0) return std::min(result, 0);
  if (const int result = system_.rate(t, state, rate_.data()); result != 0) return std::min(result, 0);
  if (const int result = system_.newton_matrix(state, gamma); result != 0) return std::min(result, 0);
  kernel.linear_sum(n, 1.0 / moment, rate_by_time_.data(), -1.0 / moment, rate_.data(), rate_by_time_.data());

  std::array<const Real*, stages> stage{};
  std::array<Real, stages - 1> coupling{};
  for (std::size_t i = 0; i < stages; ++i) stage[i] = stage_[i].data();
  for (std::size_t i = 0; i < stages; ++i) {
    Real* U = stage_[i].data();
    // gamma h sum_j C_ij / h U_j
    for (std::size_t j = 0; j < i; ++j) coupling[j] = gamma_of_method * C[i][j];
    kernel.combine_stages(n, static_cast<int>(i), a[i].data(), coupling.data(), stage.data(), state, gamma * h * d[i],
                          rate_by_time_.data(), next, U);
    if (i > 0) {
      if (const int result = system_.rate(t + c[i] * h, next, rate_.data()); result != 0) return std::min(result, 0);
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
