/* The counters of an instrumented program's branches, for tests/fuzz/engine.rs (LLVM, SanitizerCoverage, inline 8-bit
   counters: https://clang.llvm.org/docs/SanitizerCoverage.html). Every instrumented crate announces the same array. */
#include <stddef.h>

static unsigned char *first, *end;

void __sanitizer_cov_8bit_counters_init(unsigned char *start, unsigned char *stop) {
  first = start;
  end = stop;
}

unsigned char *freeplay_branch_counters(size_t *count) {
  *count = (size_t)(end - first);
  return first;
}

/* Indirect calls are instrumented too; each callee has its own counters. */
void __sanitizer_cov_trace_pc_indir(void *callee) { (void)callee; }
