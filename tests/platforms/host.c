// A small FMI 2.0 host that runs where the library runs: simulates the model to t = 20 s, saves and restores it
// half-way, and prints what it saw, so that platforms can be compared number by number.
//
// usage: host LIBRARY GUID RESOURCE-URI RUNS REFERENCE...
//   point T VALUE...           each communication point
//   log MESSAGE                what the library tells
//   restored yes|no            the second half again from the saved state, bit for bit
//   deserialized yes|no        the same in another instance from the state's bytes
//   seconds S                  shortest of RUNS simulations
#include <fmi2FunctionTypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

enum { points = 200, half = points / 2 };
static const double step = 0.1;  // s

#ifdef _WIN32
static HMODULE module;
#else
static void* module;
#endif

static void load(const char* library) {
#ifdef _WIN32
  module = LoadLibraryA(library);
#else
  module = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (module == NULL) fprintf(stderr, "host: %s\n", dlerror());
#endif
  if (module == NULL) {
    fprintf(stderr, "host: %s cannot be loaded\n", library);
    exit(1);
  }
}

/// What the library has for the end of the process must have run by now.
static void unload(void) {
#ifdef _WIN32
  FreeLibrary(module);
#else
  dlclose(module);
#endif
}

static void* function(const char* name) {
#ifdef _WIN32
  void* const address = (void*)GetProcAddress(module, name);
#else
  void* const address = dlsym(module, name);
#endif
  if (address == NULL) {
    fprintf(stderr, "host: the library has no %s\n", name);
    exit(1);
  }
  return address;
}

static void check(fmi2Status status, const char* what) {
  if (status == fmi2OK) return;
  fprintf(stderr, "host: %s returned %d\n", what, (int)status);
  exit(1);
}

static void tell(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
  (void)environment, (void)instance, (void)status, (void)category;
  printf("log %s\n", message);
}

static double now(void) {
#ifdef _WIN32
  LARGE_INTEGER ticks, frequency;
  QueryPerformanceCounter(&ticks);
  QueryPerformanceFrequency(&frequency);
  return (double)ticks.QuadPart / (double)frequency.QuadPart;
#else
  struct timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);  // whatever else the machine does
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
#endif
}

static fmi2SetupExperimentTYPE* setup_experiment;
static fmi2EnterInitializationModeTYPE* enter_initialization;
static fmi2ExitInitializationModeTYPE* exit_initialization;
static fmi2DoStepTYPE* do_step;
static fmi2GetRealTYPE* get_real;

static void initialize(fmi2Component instance) {
  check(setup_experiment(instance, fmi2False, 0.0, 0.0, fmi2True, points * step), "fmi2SetupExperiment");
  check(enter_initialization(instance), "fmi2EnterInitializationMode");
  check(exit_initialization(instance), "fmi2ExitInitializationMode");
}

/// Values at the points first .. last, row by row; the instance stands at point first.
static void simulate(fmi2Component instance, int first, int last, const fmi2ValueReference* references, size_t count,
                     double* values) {
  for (int k = first; k <= last; ++k) {
    if (k > first) check(do_step(instance, (k - 1) * step, step, fmi2True), "fmi2DoStep");
    check(get_real(instance, references, count, values + (size_t)k * count), "fmi2GetReal");
  }
}

int main(int argc, char** argv) {
  if (argc < 6) {
    fprintf(stderr, "usage: host LIBRARY GUID RESOURCE-URI RUNS REFERENCE...\n");
    return 2;
  }
  load(argv[1]);
  const int runs = atoi(argv[4]);
  const size_t count = (size_t)argc - 5;
  const size_t row = count * sizeof(double);
  fmi2ValueReference* references = malloc(count * sizeof *references);
  double* values = malloc((points + 1) * row);
  double* again = malloc((points + 1) * row);
  for (size_t k = 0; k < count; ++k) references[k] = (fmi2ValueReference)strtoul(argv[5 + k], NULL, 10);

  fmi2InstantiateTYPE* instantiate = (fmi2InstantiateTYPE*)function("fmi2Instantiate");
  fmi2FreeInstanceTYPE* free_instance = (fmi2FreeInstanceTYPE*)function("fmi2FreeInstance");
  fmi2TerminateTYPE* terminate = (fmi2TerminateTYPE*)function("fmi2Terminate");
  fmi2ResetTYPE* reset = (fmi2ResetTYPE*)function("fmi2Reset");
  fmi2GetFMUstateTYPE* get_state = (fmi2GetFMUstateTYPE*)function("fmi2GetFMUstate");
  fmi2SetFMUstateTYPE* set_state = (fmi2SetFMUstateTYPE*)function("fmi2SetFMUstate");
  fmi2FreeFMUstateTYPE* free_state = (fmi2FreeFMUstateTYPE*)function("fmi2FreeFMUstate");
  fmi2SerializedFMUstateSizeTYPE* state_size = (fmi2SerializedFMUstateSizeTYPE*)function("fmi2SerializedFMUstateSize");
  fmi2SerializeFMUstateTYPE* serialize = (fmi2SerializeFMUstateTYPE*)function("fmi2SerializeFMUstate");
  fmi2DeSerializeFMUstateTYPE* deserialize = (fmi2DeSerializeFMUstateTYPE*)function("fmi2DeSerializeFMUstate");
  setup_experiment = (fmi2SetupExperimentTYPE*)function("fmi2SetupExperiment");
  enter_initialization = (fmi2EnterInitializationModeTYPE*)function("fmi2EnterInitializationMode");
  exit_initialization = (fmi2ExitInitializationModeTYPE*)function("fmi2ExitInitializationMode");
  do_step = (fmi2DoStepTYPE*)function("fmi2DoStep");
  get_real = (fmi2GetRealTYPE*)function("fmi2GetReal");

  const fmi2CallbackFunctions callbacks = {tell, calloc, free, NULL, NULL};
  fmi2Component first = instantiate("first", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
  fmi2Component second = instantiate("second", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2False);
  if (first == NULL || second == NULL) {
    fprintf(stderr, "host: fmi2Instantiate returned no instance\n");
    return 1;
  }

  initialize(first);
  simulate(first, 0, half, references, count, values);
  fmi2FMUstate state = NULL;
  check(get_state(first, &state), "fmi2GetFMUstate");
  size_t size = 0;
  check(state_size(first, state, &size), "fmi2SerializedFMUstateSize");
  char* bytes = malloc(size);
  check(serialize(first, state, bytes, size), "fmi2SerializeFMUstate");
  simulate(first, half, points, references, count, values);
  for (int k = 0; k <= points; ++k) {
    printf("point %.17g", k * step);
    for (size_t l = 0; l < count; ++l) printf(" %.17g", values[(size_t)k * count + l]);
    printf("\n");
  }

  check(set_state(first, state), "fmi2SetFMUstate");
  simulate(first, half, points, references, count, again);
  const size_t rest = (points + 1 - half) * row;
  printf("restored %s\n", memcmp(again + half * count, values + half * count, rest) == 0 ? "yes" : "no");
  check(free_state(first, &state), "fmi2FreeFMUstate");
  check(terminate(first), "fmi2Terminate");

  initialize(second);
  fmi2FMUstate copy = NULL;
  check(deserialize(second, bytes, size, &copy), "fmi2DeSerializeFMUstate");
  check(set_state(second, copy), "fmi2SetFMUstate");
  simulate(second, half, points, references, count, again);
  printf("deserialized %s\n", memcmp(again + half * count, values + half * count, rest) == 0 ? "yes" : "no");
  check(free_state(second, &copy), "fmi2FreeFMUstate");

  double shortest = -1.0;
  for (int run = 0; run < runs; ++run) {
    check(reset(second), "fmi2Reset");
    const double begin = now();
    initialize(second);
    simulate(second, 0, points, references, count, again);
    const double seconds = now() - begin;
    if (shortest < 0.0 || seconds < shortest) shortest = seconds;
  }
  if (runs > 0) printf("seconds %.9g\n", shortest);

  free_instance(first);
  free_instance(second);
  free(bytes);
  free(again);
  free(values);
  free(references);
  unload();
  return 0;
}
