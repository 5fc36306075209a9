#pragma once
/// Counts heap calls of this thread while alive.  Include in one file of an executable: it replaces malloc.
///
/// Hooks malloc itself: Eigen's dynamic matrices call malloc directly, so counting operator new would miss
/// them. glibc only; counts nothing under sanitizers (supported() says so).

#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define HAMEL_HOOK_MALLOC 0
#else
#define HAMEL_HOOK_MALLOC 1
#endif

namespace hamel::test {

class NoAlloc {
 public:
  NoAlloc() { seen_ = 0, counting_ = true; }
  ~NoAlloc() { counting_ = false; }
  NoAlloc(const NoAlloc&) = delete;
  NoAlloc& operator=(const NoAlloc&) = delete;
  int calls() const { return seen_; }
  static bool supported() { return HAMEL_HOOK_MALLOC; }
  static void count() {
    if (counting_) ++seen_;
  }

 private:
  static inline thread_local bool counting_ = false;
  static inline thread_local int seen_ = 0;
};

}  // namespace hamel::test

#if HAMEL_HOOK_MALLOC
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t n) { return hamel::test::NoAlloc::count(), __libc_malloc(n); }
void* calloc(std::size_t n, std::size_t m) { return hamel::test::NoAlloc::count(), __libc_calloc(n, m); }
void* realloc(void* p, std::size_t n) { return hamel::test::NoAlloc::count(), __libc_realloc(p, n); }
void* aligned_alloc(std::size_t a, std::size_t n) {
  return hamel::test::NoAlloc::count(), __libc_memalign(a, n);
}
}
#endif
