#include "sundials_handles.hpp"

#include <nvector/nvector_serial.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <new>

#include "errors.hpp"
#include "kernels/kernels.hpp"
#include "nordsieck_prediction.hpp"
#include "types.hpp"

namespace mixed_order_game {

namespace {

// A serial vector whose data begin on a cache line (the library's own begin anywhere), with what it shares with all of
// its clones.
struct Content {
  _N_VectorContent_Serial serial;  // first, so that the library's macros find it
  std::shared_ptr<NordsieckPrediction> prediction;
};
constexpr std::align_val_t cache_line{64};

NordsieckPrediction& prediction_of(N_Vector vector) { return *static_cast<Content*>(vector->content)->prediction; }

void destroy_vector(N_Vector vector) {
  prediction_of(vector).forget();
  ::operator delete(NV_DATA_S(vector), cache_line);
  delete static_cast<Content*>(vector->content);
  N_VFreeEmpty(vector);
}

/// A vector without operations; null when memory is short.
N_Vector allocate_vector(SunIndex size, const std::shared_ptr<NordsieckPrediction>& prediction, SUNContext context) {
  N_Vector vector = N_VNewEmpty(context);
  if (vector == nullptr) return nullptr;
  auto* content = new (std::nothrow) Content{{size, SUNFALSE, nullptr}, prediction};
  auto* data =
      static_cast<SunReal*>(::operator new(static_cast<std::size_t>(size) * sizeof(SunReal), cache_line, std::nothrow));
  if (content == nullptr || data == nullptr) {
    ::operator delete(data, cache_line);
    delete content;
    N_VFreeEmpty(vector);
    return nullptr;
  }
  content->serial.data = data;
  vector->content = content;
  return vector;
}
N_Vector clone_vector(N_Vector vector) {
  const Content& content = *static_cast<Content*>(vector->content);
  N_Vector clone = allocate_vector(content.serial.length, content.prediction, vector->sunctx);
  if (clone != nullptr) N_VCopyOps(vector, clone);
  return clone;
}

// CVODE spends its time in a handful of vector operations: these replace the library's by the kernels. The others
// belong to the choice of the first step, when no prediction is kept back.

void vector_linear_sum(SunReal a, N_Vector x, SunReal b, N_Vector y, N_Vector z) {
  NordsieckPrediction& prediction = prediction_of(z);
  if (a == 1.0 && std::fabs(b) == 1.0 && x == z) return prediction.add(NV_DATA_S(z), NV_DATA_S(y), b < 0.0);
  prediction.finish();
  kernels().linear_sum(NV_LENGTH_S(x), a, NV_DATA_S(x), b, NV_DATA_S(y), NV_DATA_S(z));
}
void vector_scale(SunReal c, N_Vector x, N_Vector z) {
  prediction_of(z).finish();
  kernels().scale(NV_LENGTH_S(x), c, NV_DATA_S(x), NV_DATA_S(z));
}
int vector_scale_several(int count, SunReal* c, N_Vector* x, N_Vector* z) {
  NordsieckPrediction& prediction = prediction_of(z[0]);
  if (x == z && count <= NordsieckPrediction::most_order) {
    std::array<Real*, NordsieckPrediction::most_order> columns{};
    for (int j = 0; j < count; ++j) columns[at(j)] = NV_DATA_S(z[j]);
    prediction.scale(count, c, columns.data());
    return 0;
  }
  for (int j = 0; j < count; ++j) vector_scale(c[j], x[j], z[j]);
  return 0;
}
void vector_fill(SunReal c, N_Vector z) {
  prediction_of(z).finish();
  kernels().fill(NV_LENGTH_S(z), c, NV_DATA_S(z));
}
SunReal vector_weighted_norm(N_Vector x, N_Vector w) {
  prediction_of(x).finish();
  const SunIndex n = NV_LENGTH_S(x);
  return std::sqrt(kernels().weighted_square_sum(n, NV_DATA_S(x), NV_DATA_S(w)) / static_cast<Real>(n));
}

// Operations on several vectors go block by block, so that each number is read from memory once.
template <typename Action>
void for_each_block(N_Vector vector, Action action) {
  constexpr SunIndex block = 1024;
  for (SunIndex begin = 0, n = NV_LENGTH_S(vector); begin < n; begin += block)
    action(begin, std::min(block, n - begin));
}
int vector_scale_add_multi(int count, SunReal* a, N_Vector x, N_Vector* y, N_Vector* z) {
  prediction_of(x).finish();
  for_each_block(x, [&](SunIndex begin, SunIndex n) {
    for (int k = 0; k < count; ++k) {
      kernels().linear_sum(n, a[k], NV_DATA_S(x) + begin, 1.0, NV_DATA_S(y[k]) + begin, NV_DATA_S(z[k]) + begin);
    }
  });
  return 0;
}
int vector_linear_combination(int count, SunReal* c, N_Vector* x, N_Vector z) {  // z may be x[0]
  prediction_of(z).finish();
  for_each_block(z, [&](SunIndex begin, SunIndex n) {
    kernels().scale(n, c[0], NV_DATA_S(x[0]) + begin, NV_DATA_S(z) + begin);
    for (int k = 1; k < count; ++k) {
      kernels().linear_sum(n, c[k], NV_DATA_S(x[k]) + begin, 1.0, NV_DATA_S(z) + begin, NV_DATA_S(z) + begin);
    }
  });
  return 0;
}
SunReal vector_max_norm(N_Vector x) {
  prediction_of(x).finish();
  return kernels().max_norm(NV_LENGTH_S(x), NV_DATA_S(x));
}

}  // namespace

ContextHandle make_context() {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR < 7
  if (SUNContext_Create(nullptr, &context) != 0) throw Error("SUNDIALS could not make a context");
#else
  if (SUNContext_Create(SUN_COMM_NULL, &context) != 0) throw Error("SUNDIALS could not make a context");
  SUNContext_ClearErrHandlers(context);
#endif
  SUNContext_SetLogger(context, nullptr);
  return ContextHandle(context);
}

VectorHandle make_vector(int size, SUNContext context) {
  // the library's own vector gives the operations that are not replaced
  const VectorHandle pattern(N_VNewEmpty_Serial(size, context));
  if (pattern == nullptr) throw std::bad_alloc();
  N_Vector vector = allocate_vector(size, std::make_shared<NordsieckPrediction>(size), context);
  if (vector == nullptr) throw std::bad_alloc();
  N_VCopyOps(pattern.get(), vector);
  vector->ops->nvclone = clone_vector;
  vector->ops->nvdestroy = destroy_vector;
  vector->ops->nvlinearsum = vector_linear_sum;
  vector->ops->nvscale = vector_scale;
  vector->ops->nvscalevectorarray = vector_scale_several;
  vector->ops->nvconst = vector_fill;
  vector->ops->nvwrmsnorm = vector_weighted_norm;
  vector->ops->nvmaxnorm = vector_max_norm;
  vector->ops->nvscaleaddmulti = vector_scale_add_multi;
  vector->ops->nvlinearcombination = vector_linear_combination;
  N_VConst(0.0, vector);
  return VectorHandle(vector);
}

MatrixHandle make_placeholder_matrix(SUNContext context) {
  SUNMatrix matrix = SUNMatNewEmpty(context);
  if (matrix == nullptr) throw std::bad_alloc();
  matrix->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
  matrix->ops->destroy = [](SUNMatrix stub) { SUNMatFreeEmpty(stub); };
  return MatrixHandle(matrix);
}

}  // namespace mixed_order_game
