// Runs the destructors of static objects when the FMU is unloaded, as the start-up code of gcc does. That of zig for
// Linux does not: they stay with the process, which jumps into the unloaded library when it ends.

extern "C" {
extern void* __dso_handle;  // NOLINT: names of the C++ ABI
void __cxa_finalize(void* library);
}

namespace {

[[gnu::destructor]] void run_exit_handlers() { __cxa_finalize(&__dso_handle); }

}  // namespace
