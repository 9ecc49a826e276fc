#include "integration/sundials_handles.hpp"

#include <nvector/nvector_serial.h>
#include <sundials/sundials_logger.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <new>

#include "integration/nordsieck_prediction.hpp"
#include "kernels/kernels.hpp"
#include "types.hpp"

namespace mixed_order_game {

namespace {

// What a vector shares with all of its clones. N_VClone writes to what a failed clone returned (before SUNDIALS 7.2),
// so that it must never be null: when memory is short a clone is the spare vector, which is good enough until the
// set-up is given up.
struct Shared {
  explicit Shared(std::int64_t size) : prediction(size) {}
  ~Shared();
  Shared(const Shared&) = delete;
  Shared& operator=(const Shared&) = delete;

  NordsieckPrediction prediction;
  N_Vector spare = nullptr;
  bool memory_is_short = false;
};

// A serial vector whose data begin on a cache line (the library's own begin anywhere).
struct Content {
  _N_VectorContent_Serial serial;  // first, so that the library's macros find it
  std::shared_ptr<Shared> shared;
};
constexpr std::align_val_t cache_line{64};

Shared& shared_by(N_Vector vector) { return *static_cast<Content*>(vector->content)->shared; }
NordsieckPrediction& prediction_of(N_Vector vector) { return shared_by(vector).prediction; }

void free_vector(N_Vector vector) {
  ::operator delete(NV_DATA_S(vector), cache_line);
  delete static_cast<Content*>(vector->content);
  N_VFreeEmpty(vector);
}

Shared::~Shared() {
  if (spare != nullptr) free_vector(spare);
}

void destroy_vector(N_Vector vector) {
  if (vector == shared_by(vector).spare) return;
  prediction_of(vector).forget();
  free_vector(vector);
}

/// A vector without operations; null when memory is short.
N_Vector allocate_vector(SunIndex size, const std::shared_ptr<Shared>& shared, SUNContext context) {
  N_Vector vector = N_VNewEmpty(context);
  if (vector == nullptr) return nullptr;
  auto* content = new (std::nothrow) Content{{size, SUNFALSE, nullptr}, shared};
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
  N_Vector clone = allocate_vector(content.serial.length, content.shared, vector->sunctx);
  if (clone == nullptr) {
    content.shared->memory_is_short = true;
    return content.shared->spare;
  }
  N_VCopyOps(vector, clone);
  return clone;
}

/// What CVODE and its callbacks read and write by themselves, not by an operation.
SunReal* data_of(N_Vector vector) {
  prediction_of(vector).finish();
  return NV_DATA_S(vector);
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

#if SUNDIALS_VERSION_MAJOR < 7
// These stand in for the library's logger, which nobody reads: its own has files and a table that is written to even
// when there was no memory for it.
extern "C" {
int SUNLogger_Create(void* /*communicator*/, int /*rank*/, SUNLogger* logger) {
  *logger = nullptr;
  return 0;
}
int SUNLogger_CreateFromEnv(void* communicator, SUNLogger* logger) { return SUNLogger_Create(communicator, 0, logger); }
int SUNLogger_SetErrorFilename(SUNLogger, const char*) { return 0; }
int SUNLogger_SetWarningFilename(SUNLogger, const char*) { return 0; }
int SUNLogger_SetInfoFilename(SUNLogger, const char*) { return 0; }
int SUNLogger_SetDebugFilename(SUNLogger, const char*) { return 0; }
int SUNLogger_QueueMsg(SUNLogger, SUNLogLevel, const char*, const char*, const char*, ...) { return 0; }
int SUNLogger_Flush(SUNLogger, SUNLogLevel) { return 0; }
int SUNLogger_GetOutputRank(SUNLogger, int* rank) {
  *rank = 0;
  return 0;
}
int SUNLogger_Destroy(SUNLogger*) { return 0; }
}
#endif

ContextHandle make_context() {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR < 7
  if (SUNContext_Create(nullptr, &context) != 0) throw std::bad_alloc();
#else
  if (SUNContext_Create(SUN_COMM_NULL, &context) != 0) throw std::bad_alloc();
  SUNContext_ClearErrHandlers(context);
#endif
  SUNContext_SetLogger(context, nullptr);
  return ContextHandle(context);
}

VectorHandle make_vector(int size, SUNContext context) {
  // the library's own vector gives the operations that are not replaced
  const VectorHandle pattern(N_VNewEmpty_Serial(size, context));
  if (pattern == nullptr) throw std::bad_alloc();
  const auto shared = std::make_shared<Shared>(size);
  shared->spare = allocate_vector(size, {std::shared_ptr<Shared>(), shared.get()}, context);  // owns nothing
  N_Vector vector = shared->spare == nullptr ? nullptr : allocate_vector(size, shared, context);
  if (vector == nullptr) throw std::bad_alloc();
  N_VCopyOps(pattern.get(), vector);
  vector->ops->nvclone = clone_vector;
  vector->ops->nvdestroy = destroy_vector;
  vector->ops->nvgetarraypointer = data_of;
  vector->ops->nvlinearsum = vector_linear_sum;
  vector->ops->nvscale = vector_scale;
  vector->ops->nvscalevectorarray = vector_scale_several;
  vector->ops->nvconst = vector_fill;
  vector->ops->nvwrmsnorm = vector_weighted_norm;
  vector->ops->nvmaxnorm = vector_max_norm;
  vector->ops->nvscaleaddmulti = vector_scale_add_multi;
  vector->ops->nvlinearcombination = vector_linear_combination;
  N_VCopyOps(vector, shared->spare);
  N_VConst(0.0, vector);
  return VectorHandle(vector);
}

void require_whole(N_Vector vector) {
  if (shared_by(vector).memory_is_short) throw std::bad_alloc();
}

MatrixHandle make_placeholder_matrix(SUNContext context) {
  SUNMatrix matrix = SUNMatNewEmpty(context);
  if (matrix == nullptr) throw std::bad_alloc();
  matrix->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
  matrix->ops->destroy = [](SUNMatrix stub) { SUNMatFreeEmpty(stub); };
  return MatrixHandle(matrix);
}

}  // namespace mixed_order_game
