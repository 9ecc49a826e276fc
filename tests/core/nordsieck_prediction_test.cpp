#include "integration/nordsieck_prediction.hpp"

#include <gtest/gtest.h>
#include <nvector/nvector_serial.h>

#include <bit>

#include "integration/sundials_handles.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::RandomNumbers;

/// Columns as CVODE has them, with and without the operations that keep back a prediction.
class Columns {
 public:
  Columns(int size, int count, std::uint64_t seed) : context_(make_context()) {
    RandomNumbers random(seed);
    own_.push_back(make_vector(size, context_.get()));
    while (static_cast<int>(own_.size()) < count) own_.emplace_back(N_VClone(own_.front().get()));
    for (const VectorHandle& own : own_) {
      plain_.emplace_back(N_VNew_Serial(size, context_.get()));
      for (int k = 0; k < size; ++k) {
        NV_Ith_S(own.get(), k) = NV_Ith_S(plain_.back().get(), k) = random.between(-2.0, 2.0);
      }
    }
  }

  void add(int to, int from, Real sign = 1.0) {
    for (auto* columns : {&own_, &plain_}) {
      N_VLinearSum(1.0, (*columns)[at(to)].get(), sign, (*columns)[at(from)].get(), (*columns)[at(to)].get());
    }
  }
  void scale(int first, std::vector<Real> factors) {
    for (auto* columns : {&own_, &plain_}) {
      std::vector<N_Vector> several;
      for (std::size_t j = 0; j < factors.size(); ++j) several.push_back((*columns)[at(first) + j].get());
      N_VScaleVectorArray(static_cast<int>(factors.size()), factors.data(), several.data(), several.data());
    }
  }
  void predict(int order, Real sign = 1.0) {
    for (int k = 1; k <= order; ++k) {
      for (int j = order; j >= k; --j) add(j - 1, j, sign);
    }
  }
  /// The operation that ends a prediction.
  void fill(int column) {
    for (auto* columns : {&own_, &plain_}) N_VConst(0.5, (*columns)[at(column)].get());
  }
  /// Without a look at the data, which would end a prediction.
  void expect_equal() const {
    expect_equal([](N_Vector vector) { return NV_DATA_S(vector); });
  }
  /// As callbacks see them.
  void expect_equal_data() const { expect_equal(N_VGetArrayPointer); }

 private:
  template <typename DataOf>
  void expect_equal(DataOf data_of) const {
    for (std::size_t j = 0; j < own_.size(); ++j) {
      for (int k = 0; k < NV_LENGTH_S(own_[j].get()); ++k) {
        const Real own = data_of(own_[j].get())[k];
        const Real plain = data_of(plain_[j].get())[k];
        EXPECT_EQ(std::bit_cast<std::uint64_t>(own), std::bit_cast<std::uint64_t>(plain))
            << "column " << j << ", " << k;
      }
    }
  }

  ContextHandle context_;
  std::vector<VectorHandle> own_, plain_;
};

TEST(NordsieckPrediction, GivesTheBitsOfSeparateOperations) {
  for (const int size : {1, 7, 180, 1320}) {
    for (int order = 1; order <= NordsieckPrediction::most_order; ++order) {
      Columns columns(size, order + 2, 10U * static_cast<unsigned>(size) + static_cast<unsigned>(order));
      for (int step = 0; step < 3; ++step) {
        if (step != 1) {
          std::vector<Real> powers;
          for (Real power = 0.9; static_cast<int>(powers.size()) < order; power *= 0.9) powers.push_back(power);
          columns.scale(1, powers);
        }
        columns.predict(order);
        columns.fill(order + 1);
        columns.expect_equal();
        if (step == 2) columns.predict(order, -1.0);  // a step that failed
        columns.fill(order + 1);
        columns.expect_equal();
      }
    }
  }
}

TEST(NordsieckPrediction, WorksInAnyOtherOrderOfOperations) {
  Columns columns(37, 8, 3);
  const auto settle = [&] {
    columns.fill(7);
    columns.expect_equal();
  };
  columns.scale(1, {0.5, 0.25});  // scaled only
  settle();
  columns.scale(1, {0.5, 0.25});  // of another order than what follows
  columns.predict(3);
  settle();
  columns.scale(2, {0.5, 0.25});  // other columns than those that follow
  columns.predict(2);
  settle();
  columns.predict(2);  // not finished
  columns.add(0, 1);
  settle();
  columns.add(3, 2);  // as many additions as a prediction has, of other columns
  columns.add(1, 2);
  columns.add(0, 5);
  settle();
  columns.add(2, 2);
  settle();
  columns.predict(6);  // longer than any of BDF
  settle();
  columns.predict(2);  // there, back and there again
  columns.predict(2, -1.0);
  columns.scale(1, {0.5, 0.25});
  columns.predict(2);
  settle();
  columns.scale(1, {0.5, 0.25});  // scaled, then back
  columns.predict(2, -1.0);
  settle();
  columns.add(0, 1);  // of either sign
  columns.add(1, 2, -1.0);
  columns.add(0, 1);
  settle();
  columns.predict(5);  // two in a row
  columns.predict(5);
  settle();
  columns.predict(1);
  columns.scale(1, {2.0});
  columns.scale(1, {3.0});
  columns.predict(1);
  settle();
  columns.scale(0, {0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5});  // more than BDF has
  settle();
}

TEST(NordsieckPrediction, IsDoneBeforeAnyoneLooksAtTheData) {
  // CVODE evaluates the rate at z_0 itself right after it took a prediction back
  for (const Real sign : {1.0, -1.0}) {
    Columns columns(37, 4, 8);
    columns.predict(2, sign);
    columns.expect_equal_data();
  }
}

}  // namespace
}  // namespace mixed_order_game
