#include "harness/cli/session_talk.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

#include "faults/registry.h"
#include "harness/report/json_text.h"
#include "harness/run/fault_conditions.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/terminal/terminal.h"
#include "link/check.h"

namespace tiltproof::harness {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::size_t kRequestBytesMax = std::size_t{64} << 10;
constexpr int kTurn_ms = 100;
// Rows between two looks whether anyone still listens.
constexpr int kRowsUnheardMax = 64;
constexpr double kTimeMax_s = 1e6;
constexpr std::uint64_t kNumberMax = (std::uint64_t{1} << 53) - 1;

// A request that is not valid: why, and where in it.
struct RequestError : std::runtime_error {
  RequestError(std::string where_in, const std::string& message)
      : std::runtime_error(message), where(std::move(where_in)) {}
  std::string where;
};

constexpr std::array<std::string_view, 7> kVerbs = {"advance_s", "until", "inject", "remove",
                                                    "read",      "stop",  "finish"};

constexpr std::string_view kNumberKey = "request";  // of a request and of its answer

// The verb of a request, which has nothing else but its number and, with `until`, a time.
std::string VerbOf(const Json& request) {
  if (!request.is_object()) throw RequestError("", "expected a JSON object, for example {\"advance_s\": 1}");
  std::string verb;
  for (const auto& [key, value] : request.items()) {
    if (key == "timeout_s" || key == kNumberKey) continue;
    if (std::find(kVerbs.begin(), kVerbs.end(), key) == kVerbs.end())
      throw RequestError(key, fmt::format("unknown key '{}'{}", key, DidYouMean(key, kVerbs)));
    if (!verb.empty()) throw RequestError(key, fmt::format("one request at a time: '{}' or '{}'", verb, key));
    verb = key;
  }
  if (verb.empty()) throw RequestError("", fmt::format("expected one of {}", fmt::join(kVerbs, ", ")));
  if (verb != "until" && request.contains("timeout_s")) throw RequestError("timeout_s", "only with `until`");
  return verb;
}

std::int64_t NumberOf(const Json& request) {
  if (!request.is_object() || !request.contains(kNumberKey)) return -1;
  const Json& number = request.at(kNumberKey);
  if (!number.is_number_unsigned() || number.get<std::uint64_t>() > kNumberMax)
    throw RequestError(std::string(kNumberKey), fmt::format("expected a whole number from 0 to {}, found {}",
                                                            kNumberMax, JsonLine(number)));
  return number.get<std::int64_t>();
}

TimeNs Duration(const Json& request, const char* key) {
  const Json& value = request.at(key);
  const double time_s = value.is_number() ? value.get<double>() : -1;
  if (!(time_s >= 0 && time_s <= kTimeMax_s))
    throw RequestError(key, fmt::format("expected a number of seconds from 0 to {:g}, found {}", kTimeMax_s,
                                        JsonLine(value)));
  return FromSeconds(time_s);
}

std::string Text(const Json& request, const char* key, const char* what) {
  const Json& value = request.at(key);
  if (!value.is_string())
    throw RequestError(key, fmt::format("expected {}, found {}", what, JsonLine(value)));
  return value.get<std::string>();
}

void ExpectTrue(const Json& request, const std::string& verb) {
  if (request.at(verb) != true) throw RequestError(verb, fmt::format("expected {{\"{}\": true}}", verb));
}

Json NullUnlessFinite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

struct SessionTalk::Shared {
  std::array<char, kRequestBytesMax> bytes;  // read, and not taken yet
  std::size_t size = 0;
  int requests_count = 0;
  std::int64_t number = -1;  // that the open request has given itself; negative: none
  bool open = false;         // a request waits for its answer
  bool over = false;         // the stream has ended
  bool greeted = false;
};

SessionTalk::SessionTalk(Ends ends, ModelCache& models, std::vector<std::string> columns)
    : ends_(std::move(ends)),
      models_(models),
      columns_(std::move(columns)),
      names_(harness::SignalNames(columns_)) {
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw std::runtime_error(fmt::format("cannot share memory with a worker: {}", std::strerror(errno)));
  shared_ = new (memory) Shared();
  ends_.hello["signals"] = names_;
}

SessionTalk::~SessionTalk() { munmap(static_cast<void*>(shared_), sizeof(Shared)); }

void SessionTalk::Attend(SteeredFlight& flight, Scenario& flown, const std::function<void()>& alive) {
  if (!std::exchange(shared_->greeted, true)) Write(ends_.hello);
  if (goal_ && !IsReached(flight)) return;
  if (finishes_) return;
  for (;;) {
    const auto line = NextLine(alive);
    if (!line) {
      // Nobody steers any more; after an interrupt the conductor ends the flight.
      if (!*ends_.interrupted) flight.Stop();
      finishes_ = true;
      return;
    }
    try {
      const Json request = Json::parse(*line);
      shared_->number = NumberOf(request);
      if (Obey(request, flight, flown)) return;
    } catch (const Json::parse_error& error) {
      Complain(fmt::format("column {}", error.byte), "not a line of JSON");
    } catch (const RequestError& error) {
      Complain(error.where, error.what());
    }
  }
}

// Answers, when it is. An `until` that holds already is reached without time.
bool SessionTalk::IsReached(SteeredFlight& flight) {
  if (++rows_count_ % kRowsUnheardMax == 0 && !IsHeard()) {
    flight.Stop();
    finishes_ = true;
    return true;
  }
  if (goal_->condition) {
    const std::vector<double>& row = flight.Row();
    const bool holds = goal_->condition->Holds([&](std::string_view name) {
      const auto signal = std::find_if(goal_->signals.begin(), goal_->signals.end(),
                                       [&](const Signal& each) { return each.name == name; });
      return signal->reader.At(row);
    });
    if (!holds && flight.time_ns() < goal_->until_ns) return false;
    Answer(flight.time_ns(), {{"met", holds}});
  } else {
    if (flight.time_ns() < goal_->until_ns) return false;
    Answer(flight.time_ns(), Json::object());
  }
  goal_.reset();
  return true;
}

bool SessionTalk::Obey(const Json& request, SteeredFlight& flight, Scenario& flown) {
  const std::string verb = VerbOf(request);
  const TimeNs now_ns = flight.time_ns();
  if (verb == "advance_s") {
    goal_ = Goal{.until_ns = now_ns + Duration(request, "advance_s"), .condition = {}, .signals = {}};
    return !IsReached(flight);
  }
  if (verb == "until") {
    Goal goal{.until_ns = kNever, .condition = {}, .signals = {}};
    const std::string text = Text(request, "until", "a condition, for example \"z_m > 2\"");
    if (request.contains("timeout_s")) goal.until_ns = now_ns + Duration(request, "timeout_s");
    try {
      goal.condition.emplace(text, names_);
    } catch (const stl::ParseError& error) {
      throw RequestError(fmt::format("until:1:{}", error.column), error.what());
    }
    for (const std::string& name : goal.condition->Signals()) {
      if (name == kCrossTrackError && !path_) path_ = PlannedPath(flown);
      goal.signals.push_back(SignalNamed(name));
    }
    goal_ = std::move(goal);
    return !IsReached(flight);
  }
  if (verb == "inject") {
    Inject(request.at("inject"), flight, flown);
  } else if (verb == "remove") {
    Remove(request, flight, flown);
  } else if (verb == "read") {
    Read(request.at("read"), flight);
  } else {
    ExpectTrue(request, verb);
    if (verb == "stop") flight.Stop();
    finishes_ = true;
    return true;
  }
  return false;
}

void SessionTalk::Inject(const Json& fault, SteeredFlight& flight, Scenario& flown) {
  std::optional<faults::FaultSpec> added;
  try {
    AddedFault text{.text = JsonLine(fault),
                    .id = fmt::format("injected-{}", injected_count_ + 1),
                    .start_ns = flight.time_ns()};
    added = ReadFault(flown, text, models_);
    if (const TimeNs begin_ns = flight.FaultTime(*added); begin_ns > text.start_ns) {
      text.start_ns = begin_ns;
      added = ReadFault(flown, text, models_);
    }
  } catch (const std::runtime_error& error) {
    throw RequestError("inject", error.what());
  }
  if (const std::string reason = ends_.why_not(flown, *added); !reason.empty())
    throw RequestError("inject", fmt::format("fault '{}' ({}) {}", added->id, added->type, reason));
  flight.Add(*added);
  ++injected_count_;
  Answer(flight.time_ns(), {{"id", added->id}, {"start_s", ToSeconds(added->start_ns)}});
}

void SessionTalk::Remove(const Json& request, SteeredFlight& flight, const Scenario& flown) {
  const std::string id = Text(request, "remove", "the id of a fault");
  const auto& all = flown.faults;
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const faults::FaultSpec& fault) { return fault.id == id; });
  if (found == all.end()) {
    std::vector<std::string_view> ids;
    for (const faults::FaultSpec& fault : all) ids.push_back(fault.id);
    throw RequestError("remove", fmt::format("there is no fault '{}'{}", id, DidYouMean(id, ids)));
  }
  if (faults::FindFaultType(found->type)->is_command())
    throw RequestError("remove",
                       fmt::format("'{}' ({}) is on the device, which knows its end already: give it another "
                                   "window or duration_s",
                                   id, found->type));
  const TimeNs end_ns = flight.FaultTime(*found);
  flight.Remove(static_cast<std::size_t>(found - all.begin()));
  Answer(flight.time_ns(), {{"id", id}, {"end_s", ToSeconds(end_ns)}});
}

void SessionTalk::Read(const Json& names, SteeredFlight& flight) {
  const bool is_list = names.is_array() && std::all_of(names.begin(), names.end(),
                                                       [](const Json& name) { return name.is_string(); });
  if (!is_list)
    throw RequestError(
        "read", fmt::format("expected a list of signals, for example [\"z_m\"], found {}", JsonLine(names)));
  Json values = Json::object();
  const std::vector<double>& row = flight.Row();
  for (const Json& name : names) {
    const auto text = name.get<std::string>();
    if (text == kCrossTrackError && !path_)
      throw RequestError("read", fmt::format("'{}' is known in `until` only, and in the trace", text));
    values[text] = NullUnlessFinite(SignalNamed(text).reader.At(row));
  }
  Answer(flight.time_ns(), {{"values", std::move(values)}});
}

SessionTalk::Signal SessionTalk::SignalNamed(const std::string& name) const {
  if (std::find(names_.begin(), names_.end(), name) == names_.end()) {
    const std::vector<std::string_view> valid(names_.begin(), names_.end());
    throw RequestError("read", fmt::format("unknown signal '{}'{}", name, DidYouMean(name, valid)));
  }
  return {name, RowSignal(columns_, name, path_ ? &*path_ : nullptr)};
}

std::optional<std::string> SessionTalk::NextLine(const std::function<void()>& alive) {
  for (bool skips = false;;) {
    char* const begin = shared_->bytes.data();
    char* const end = begin + shared_->size;
    char* const newline = std::find(begin, end, '\n');
    if (newline == end) {
      if (shared_->size == shared_->bytes.size()) {
        skips = true;
        shared_->size = 0;
      }
      if (!Fill(alive)) return std::nullopt;
      continue;
    }
    std::string line(begin, newline);
    shared_->size = static_cast<std::size_t>(end - newline) - 1;
    std::memmove(begin, newline + 1, shared_->size);
    if (line.find_first_not_of(" \t\r") == std::string::npos && !skips) continue;
    ++shared_->requests_count;
    shared_->number = -1;
    shared_->open = true;
    if (!std::exchange(skips, false)) return line;
    Complain("", fmt::format("a request has at most {} bytes", kRequestBytesMax));
  }
}

// False when nothing more comes.
bool SessionTalk::Fill(const std::function<void()>& alive) {
  while (!shared_->over && !unheard_) {
    if (*ends_.interrupted) return false;
    pollfd wait{ends_.in, POLLIN, 0};
    const int ready = poll(&wait, 1, kTurn_ms);
    alive();
    if (ready <= 0) continue;
    const ssize_t count =
        read(ends_.in, shared_->bytes.data() + shared_->size, shared_->bytes.size() - shared_->size);
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    shared_->over = count <= 0;
    if (count > 0) shared_->size += static_cast<std::size_t>(count);
    return count > 0;
  }
  return false;
}

bool SessionTalk::IsHeard() const {
  pollfd wait{ends_.out, 0, 0};
  return !unheard_ && (poll(&wait, 1, 0) <= 0 || (wait.revents & (POLLERR | POLLHUP)) == 0);
}

void SessionTalk::Answer(TimeNs time_ns, const Json& answer) {
  Json line = {{"time_s", ToSeconds(time_ns)}};
  line.update(answer);
  Write(line);
}

void SessionTalk::Complain(const std::string& where, const std::string& message) {
  Write(
      {{"error",
        {{"place", fmt::format("request {}{}{}", shared_->requests_count, where.empty() ? "" : ": ", where)},
         {"message", message}}}});
}

void SessionTalk::Write(Json line) {
  shared_->open = false;
  if (shared_->number >= 0) line[kNumberKey] = shared_->number;
  const std::string text = JsonLine(line) + "\n";
  for (std::size_t done = 0; done < text.size() && !unheard_;) {
    const ssize_t count = write(ends_.out, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    unheard_ = count < 0;
    if (unheard_ && errno != EPIPE)
      Print(stderr, "tiltproof: session: the answers cannot be written: {}\n", std::strerror(errno));
    if (count > 0) done += static_cast<std::size_t>(count);
  }
}

void SessionTalk::TellEnd(const Json& ended) {
  if (shared_->open || !shared_->greeted) Write(ended);
  while (NextLine([] {})) Write(ended);
}

}  // namespace tiltproof::harness
