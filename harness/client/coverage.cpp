#include "harness/client/coverage.h"

#include <link.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <new>
#include <optional>
#include <set>
#include <utility>

namespace tiltproof::harness {
namespace {

// Code of a module, each byte of which is a place: gcc's callback comes with an address in it.
struct TracedCode {
  std::uintptr_t begin, end;
  std::uint32_t first_place;
};

// Counters of a module, in it.
struct InlineCounters {
  std::span<std::uint8_t> counts;
  std::uint32_t first_place;
};

struct CountedLibrary {
  void* handle = nullptr;
  std::vector<InlineCounters> counters;
  std::vector<TracedCode> codes;
  std::uint32_t places_end = 0;
  bool tells = false;

  std::uint32_t Take(std::size_t places_count) {
    return std::exchange(places_end, places_end + static_cast<std::uint32_t>(places_count));
  }
};

// Never destroyed: libraries may run on while the process ends.
std::vector<CountedLibrary>& libraries = *new std::vector<CountedLibrary>;
CountedLibrary* loading = nullptr;
std::size_t active = 0;  // of `libraries`

// Counts of the active library, by place; null while nothing is counted. Memory that is never touched costs nothing.
std::uint8_t* place_counts = nullptr;
std::size_t place_counts_size = 0;
const TracedCode* codes_begin = nullptr;
const TracedCode* codes_end = nullptr;
const TracedCode* last_code = nullptr;  // that has been executed

using OnCode = std::function<void(std::uintptr_t begin, std::size_t size_bytes)>;

// In the order of loading.
void ForEachCode(OnCode on_code) {
  const auto look = [](dl_phdr_info* info, std::size_t /*size*/, void* each) {
    for (int i = 0; i < info->dlpi_phnum; ++i) {
      const auto& segment = info->dlpi_phdr[i];
      if (segment.p_type == PT_LOAD && (segment.p_flags & PF_X) != 0)
        (*static_cast<OnCode*>(each))(info->dlpi_addr + segment.p_vaddr, segment.p_memsz);
    }
    return 0;
  };
  dl_iterate_phdr(look, &on_code);
}

}  // namespace

std::string_view Name(CoverageKind kind) {
  switch (kind) {
    case CoverageKind::kEdges:
      return "edges";
    case CoverageKind::kBlocks:
      return "blocks";
    case CoverageKind::kBlackBox:
      break;
  }
  return "black box";
}

std::uint32_t FeatureOf(std::uint32_t place, std::uint8_t count) {
  constexpr std::array kBucketsBegin = {1, 2, 3, 4, 8, 16, 32, 128};
  static_assert(kBucketsBegin.size() == kBucketsCount);
  const auto bucket = std::ranges::upper_bound(kBucketsBegin, static_cast<int>(count)) - 1;
  return place * kBucketsCount + static_cast<std::uint32_t>(bucket - kBucketsBegin.begin());
}

void AddFeatures(std::span<const std::uint8_t> counts, std::uint32_t first_place,
                 std::vector<std::uint32_t>& features) {
  // Most are 0.
  for (std::size_t i = 0; i < counts.size(); ++i) {
    std::uint64_t eight = 0;
    while (i + sizeof eight <= counts.size()) {
      std::memcpy(&eight, counts.data() + i, sizeof eight);
      if (eight != 0) break;
      i += sizeof eight;
    }
    if (i < counts.size() && counts[i] != 0)
      features.push_back(FeatureOf(first_place + static_cast<std::uint32_t>(i), counts[i]));
  }
}

void* LibraryCoverage::Load(const std::function<void*()>& load) {
  Count(false);
  std::set<std::uintptr_t> before;
  ForEachCode([&](std::uintptr_t begin, std::size_t /*size*/) { before.insert(begin); });
  CountedLibrary fresh;
  struct Loading {
    explicit Loading(CountedLibrary& library) { loading = &library; }
    ~Loading() { loading = nullptr; }
  };
  {
    const Loading scope(fresh);
    fresh.handle = load();
  }
  if (fresh.handle == nullptr) return nullptr;
  const auto known = std::ranges::find(libraries, fresh.handle, &CountedLibrary::handle);
  active = static_cast<std::size_t>(known - libraries.begin());
  if (known != libraries.end()) return fresh.handle;
  ForEachCode([&](std::uintptr_t begin, std::size_t size_bytes) {
    if (!before.contains(begin)) fresh.codes.push_back({begin, begin + size_bytes, fresh.Take(size_bytes)});
  });
  libraries.push_back(std::move(fresh));
  return libraries.back().handle;
}

void LibraryCoverage::Count(bool counts) {
  if (std::uint8_t* const old = std::exchange(place_counts, nullptr); old != nullptr)
    munmap(old, place_counts_size);
  if (!counts || active >= libraries.size()) return;
  const CountedLibrary& library = libraries[active];
  for (const InlineCounters& counters : library.counters) std::ranges::fill(counters.counts, std::uint8_t{0});
  codes_begin = last_code = library.codes.data();
  codes_end = codes_begin + library.codes.size();
  place_counts_size = std::max<std::size_t>(library.places_end, 1);
  void* const memory = mmap(nullptr, place_counts_size, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  place_counts = static_cast<std::uint8_t*>(memory);
}

Coverage LibraryCoverage::Read() {
  if (place_counts == nullptr) return {};
  Coverage coverage;
  const CountedLibrary& library = libraries[active];
  for (const auto& [counts, first_place] : library.counters)
    AddFeatures(counts, first_place, coverage.features);
  AddFeatures({place_counts, place_counts_size}, 0, coverage.features);
  std::ranges::sort(coverage.features);
  if (library.tells || !coverage.features.empty()) coverage.kind = CoverageKind::kEdges;
  return coverage;
}

// In a build with a fuzzer, that has these functions.
#ifndef TILTPROOF_HAS_FUZZER
namespace {

// A thread of the library may be here, too.
void CountPlace(std::size_t place) {
  std::uint8_t& count = place_counts[place];
  const std::uint8_t before = __atomic_load_n(&count, __ATOMIC_RELAXED);
  if (before != 255) __atomic_store_n(&count, static_cast<std::uint8_t>(before + 1), __ATOMIC_RELAXED);
}

bool Holds(const TracedCode& code, std::uintptr_t address) {
  return address >= code.begin && address < code.end;
}

void CountAddress(std::uintptr_t address) {
  if (place_counts == nullptr || codes_begin == codes_end) return;
  if (!Holds(*last_code, address)) {
    const auto* const found =
        std::find_if(codes_begin, codes_end, [&](const TracedCode& code) { return Holds(code, address); });
    if (found == codes_end) return;
    last_code = found;
  }
  CountPlace(last_code->first_place + (address - last_code->begin));
}

}  // namespace
#endif

}  // namespace tiltproof::harness

#ifndef TILTPROOF_HAS_FUZZER
namespace cov = tiltproof::harness;

// Functions that compilers call (clang's SanitizerCoverage, gcc's -fsanitize-coverage).
extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp, readability-identifier-naming)

void __sanitizer_cov_8bit_counters_init(std::uint8_t* begin, std::uint8_t* end) {
  if (cov::loading == nullptr || begin == end) return;
  cov::loading->tells = true;
  const auto count = static_cast<std::size_t>(end - begin);
  cov::loading->counters.push_back({{begin, count}, cov::loading->Take(count)});
}
void __sanitizer_cov_pcs_init(const std::uintptr_t*, const std::uintptr_t*) {}

// A guard is 0, or its place + 1.
void __sanitizer_cov_trace_pc_guard_init(std::uint32_t* begin, std::uint32_t* end) {
  if (cov::loading == nullptr || begin == end || *begin != 0) return;
  cov::loading->tells = true;
  std::uint32_t place = cov::loading->Take(static_cast<std::size_t>(end - begin));
  for (; begin != end; ++begin) *begin = ++place;
}
void __sanitizer_cov_trace_pc_guard(const std::uint32_t* guard) {
  if (cov::place_counts != nullptr && *guard != 0 && *guard <= cov::place_counts_size)
    cov::CountPlace(*guard - 1);
}
void __sanitizer_cov_trace_pc() {
  cov::CountAddress(reinterpret_cast<std::uintptr_t>(__builtin_return_address(0)));
}

// -fsanitize=fuzzer-no-link asks for more, which is not used: comparisons, and the depth of the stack.
thread_local std::uintptr_t __sancov_lowest_stack = 0;
void __sanitizer_cov_trace_pc_indir(std::uintptr_t) {}
void __sanitizer_cov_trace_cmp1(std::uint8_t, std::uint8_t) {}
void __sanitizer_cov_trace_cmp2(std::uint16_t, std::uint16_t) {}
void __sanitizer_cov_trace_cmp4(std::uint32_t, std::uint32_t) {}
void __sanitizer_cov_trace_cmp8(std::uint64_t, std::uint64_t) {}
void __sanitizer_cov_trace_cmpf(float, float) {}
void __sanitizer_cov_trace_cmpd(double, double) {}
void __sanitizer_cov_trace_const_cmp1(std::uint8_t, std::uint8_t) {}
void __sanitizer_cov_trace_const_cmp2(std::uint16_t, std::uint16_t) {}
void __sanitizer_cov_trace_const_cmp4(std::uint32_t, std::uint32_t) {}
void __sanitizer_cov_trace_const_cmp8(std::uint64_t, std::uint64_t) {}
void __sanitizer_cov_trace_switch(std::uint64_t, const std::uint64_t*) {}
void __sanitizer_cov_trace_div4(std::uint32_t) {}
void __sanitizer_cov_trace_div8(std::uint64_t) {}
void __sanitizer_cov_trace_gep(std::uintptr_t) {}

// NOLINTEND(bugprone-reserved-identifier, cert-dcl37-c, cert-dcl51-cpp, readability-identifier-naming)
}
#endif
