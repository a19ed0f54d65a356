#include "harness/dds/library_log.h"

#include <dds/ddsrt/log.h>

#include <cstdint>
#include <cstdio>
#include <type_traits>
#include <utility>

#include "harness/terminal/terminal.h"

namespace tiltproof::dds {
namespace {

constexpr std::size_t kCapturedBytesMax = 1000;

struct Recorded {
  std::mutex mutex;
  std::string* captured = nullptr;  // where a message goes while a caller captures the log
  int shown_count = 0;
  std::int64_t more_count = 0;
};
// Threads of the library may speak until the process has ended: it is never destroyed.
constinit Recorded the_log;
static_assert(std::is_trivially_destructible_v<Recorded>);

std::string OneLine(std::string_view message) {
  while (!message.empty() && message.back() == '\n') message.remove_suffix(1);
  return harness::Plain(message);
}

}  // namespace

std::mutex LibraryCapture::one_at_a_time_;

LibraryCapture::LibraryCapture() : lock_(one_at_a_time_) {
  {
    const std::lock_guard lock(the_log.mutex);
    the_log.captured = &text_;
  }
  // Waits for messages that are under way, so without our lock.
  dds_set_log_sink(
      [](void*, const dds_log_data_t* data) {
        OnLibraryMessage({data->message, data->size}, (data->priority & DDS_LC_FATAL) != 0);
      },
      nullptr);
}

LibraryCapture::~LibraryCapture() {
  const std::lock_guard lock(the_log.mutex);
  the_log.captured = nullptr;
}

std::string LibraryCapture::text() const {
  const std::lock_guard lock(the_log.mutex);
  return text_;
}

void OnLibraryMessage(std::string_view message, bool fatal) {
  const auto line = OneLine(message);
  const std::lock_guard lock(the_log.mutex);
  if (the_log.captured != nullptr && !fatal) {
    if (the_log.captured->size() < kCapturedBytesMax) *the_log.captured += ": " + line;
    return;
  }
  if (the_log.shown_count == kLibraryLinesShownMax && !fatal) {
    ++the_log.more_count;
    return;
  }
  if (!fatal) ++the_log.shown_count;
  harness::Print(stderr, "tiltproof: the bus library reports: {}\n", line);
}

void PrintLibraryTotal() {
  const std::lock_guard lock(the_log.mutex);
  the_log.shown_count = 0;
  const auto count = std::exchange(the_log.more_count, 0);
  if (count == 0) return;
  harness::Print(stderr, "tiltproof: the bus library reported {} more line{}\n", count,
                 count == 1 ? "" : "s");
}

}  // namespace tiltproof::dds
