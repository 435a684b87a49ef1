#include "blas_kernels.h"

#include <dlfcn.h>

#include <cstdlib>

namespace fretwave {

namespace {

/// A function of the BLAS that PETSc is linked with; null where it has none of this name.
template <class Function>
Function* in_blas(char const* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

/// What OpenBLAS calls the newest kernels that this processor and its system serve; null for the oldest.
char const* best_kernels() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return nullptr;
  const bool wide = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
                    __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
                    __builtin_cpu_supports("avx512vl");
  return wide ? "SkylakeX" : "Haswell";
#else
  return nullptr;
#endif
}

}  // namespace

std::string blas_kernels() {
  auto* name = in_blas<char*()>("openblas_get_corename");
  return name ? name() : "";
}

void mend_blas_kernels() {
  constexpr char const* wish = "OPENBLAS_CORETYPE";
  auto const* best = best_kernels();
  auto *forget = in_blas<void()>("gotoblas_dynamic_quit"), *choose = in_blas<void()>("gotoblas_dynamic_init");
  if (std::getenv(wish) || !best || blas_kernels() != "Prescott" || !forget || !choose) return;
  setenv(wish, best, 0);
  forget(), choose();
  unsetenv(wish);  // a process begun from here may run on another machine
}

}  // namespace fretwave
