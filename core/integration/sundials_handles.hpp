// SUNDIALS objects that free themselves, made the way the integrator needs them.
#pragma once

#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nvector.h>
#include <sundials/sundials_types.h>

#include <memory>
#include <type_traits>

namespace mixed_order_game {

#if SUNDIALS_VERSION_MAJOR < 7
using SunBoolean = booleantype;
#else
using SunBoolean = sunbooleantype;
#endif
using SunReal = sunrealtype;
using SunIndex = sunindextype;

struct FreeContext {
  void operator()(SUNContext context) const { SUNContext_Free(&context); }
};
struct FreeVector {
  void operator()(N_Vector vector) const { N_VDestroy(vector); }
};
struct FreeMatrix {
  void operator()(SUNMatrix matrix) const { SUNMatDestroy(matrix); }
};
struct FreeLinearSolver {
  void operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
};
using ContextHandle = std::unique_ptr<std::remove_pointer_t<SUNContext>, FreeContext>;
using VectorHandle = std::unique_ptr<std::remove_pointer_t<N_Vector>, FreeVector>;
using MatrixHandle = std::unique_ptr<std::remove_pointer_t<SUNMatrix>, FreeMatrix>;
using LinearSolverHandle = std::unique_ptr<std::remove_pointer_t<SUNLinearSolver>, FreeLinearSolver>;

/// Without output to files or streams.
ContextHandle make_context();

/// Zero, with the vector operations that CVODE spends its time in replaced by the kernels. Data are had by
/// N_VGetArrayPointer, never by the macros of the serial vector: it does first what operations have kept back.
VectorHandle make_vector(int size, SUNContext context);

/// Throws std::bad_alloc when memory was too short for a clone of the vector since it was made: the clones then share
/// their data and must not be used.
void require_whole(N_Vector vector);

/// For solvers that never form a matrix: CVODE only hands it on.
MatrixHandle make_placeholder_matrix(SUNContext context);

}  // namespace mixed_order_game
