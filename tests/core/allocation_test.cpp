// After a run has started, integrating it asks the heap for nothing: counted by standing in for malloc.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>

#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "loop/loop_tangent.hpp"
#include "random_game.hpp"

namespace {
std::atomic<bool> counting{false};
std::atomic<int> allocations{0};
void count() {
  if (counting) ++allocations;
}
}  // namespace

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  count();
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  count();
  return __libc_calloc(number, size);
}
void* realloc(void* old, std::size_t size) {
  count();
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count();
  return __libc_memalign(alignment, size);
}
}

namespace mixed_order_game {
namespace {

TEST(Allocation, NoneAfterTheStart) {
  for (const testing::Recipe& recipe : testing::assorted_recipes()) {
    testing::PlainGame game = testing::random_game(recipe);
    game.W_max = testing::everyone(game, 1.0);  // the sphere is reached and left
    ClosedLoop loop(parse_game(testing::toml_of(game)).parameters);
    Inputs input(loop.inputs().size());
    Integrator integrator(loop, input, make_structured_newton());
    integrator.start(0.0, {1e-6, 1e-8});
    integrator.advance(0.01);
    allocations = 0;
    counting = true;
    for (int k = 2; k <= 100; ++k) integrator.advance(0.01 * k);
    counting = false;
    EXPECT_EQ(allocations, 0) << "game " << recipe.seed;
    EXPECT_GT(integrator.statistics().steps, 50);
  }
}

TEST(Allocation, NoneWhereInputsChangeAtEveryPoint) {
  for (const testing::Recipe& recipe : testing::assorted_recipes()) {
    ClosedLoop loop(parse_game(testing::toml_of(testing::random_game(recipe))).parameters);
    Inputs input(loop.inputs().size());
    Integrator integrator(loop, input, make_structured_newton());
    integrator.start(0.0, {1e-6, 1e-8});
    const auto follow = [&](int first, int last) {
      for (int k = first; k <= last; ++k) {
        input.set_value(0, 0.1 * k);
        integrator.restart(false);
        integrator.advance(0.01 * k);
      }
    };
    follow(1, 10);
    allocations = 0;
    counting = true;
    follow(11, 60);
    counting = false;
    EXPECT_EQ(allocations, 0) << "game " << recipe.seed;
  }
}

TEST(Allocation, NoneAlongADirection) {
  for (const testing::Recipe& recipe : testing::assorted_recipes()) {
    const ClosedLoop loop(parse_game(testing::toml_of(testing::random_game(recipe))).parameters);
    const Modes inside(at(loop.shape().actions()));
    const std::vector<Real> input(inside.size(), 1.0);
    Signals signals(loop.shape());
    LoopTangent tangent(loop);
    std::vector<Real> state(tangent.state.size());
    std::vector<Real> rate(state.size());
    loop.initial_state(state.data());
    allocations = 0;
    counting = true;
    loop.evaluate(0.1, state.data(), input.data(), inside, signals, rate.data());
    tangent.state.back() = 1.0;
    tangent.inputs.back() = 1.0;
    tangent.time = 1.0;
    tangent.follow(0.1, state.data(), input.data(), inside);
    counting = false;
    EXPECT_EQ(allocations, 0) << "game " << recipe.seed;
  }
}

TEST(Allocation, IsCounted) {
  counting = true;
  allocations = 0;
  std::free(std::malloc(8));
  counting = false;
  EXPECT_GE(allocations, 1);
}

}  // namespace
}  // namespace mixed_order_game
