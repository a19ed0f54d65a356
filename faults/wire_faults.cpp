#include "faults/wire_faults.h"

#include "faults/registry.h"

#include <algorithm>
#include <span>
#include <utility>

namespace tiltproof::faults {
namespace {

bool SameBytesAndTime(const link::Chunk& a, const link::Chunk& b) {
  return a.begin_ns == b.begin_ns && a.bytes == b.bytes && a.parity_errors == b.parity_errors;
}

std::size_t Weight(std::span<const link::Chunk> chunks) {
  std::size_t bytes = 0;
  for (const link::Chunk& chunk : chunks) bytes += link::WeightOf(chunk);
  return bytes;
}

}  // namespace

void WireFaults::Add(std::size_t fault, const FaultSpec& spec, const WireKind& kind, const Activity& activity,
                     const Parameters& parameters, std::uint64_t seed, link::Direction direction,
                     const LineRate& rate, const link::Protocol& protocol, bool open) {
  const std::string_view way = link::Name(direction);
  const std::uint64_t stream = StreamKey(seed, {spec.id, "model", way});
  std::optional<std::uint8_t> message;
  if (const link::MessageType* type = FindMessage(protocol, spec.message))
    message = static_cast<std::uint8_t>(type - protocol.messages.data());
  Injector injector{.fault = fault,
                    .layer = kind.wire_layer,
                    .activity = &activity,
                    .trigger = Trigger(spec, StreamKey(seed, {spec.id, "trigger", way}), message),
                    .stream = stream,
                    .rate = rate,
                    .remembers = kind.remembers,
                    .acts_on_overlap = kind.acts_on_overlap,
                    .sends_back = kind.sends_back,
                    .model = nullptr};
  if (!open)
    injector.model =
        kind.make({parameters, rate, StreamKey(seed, {spec.id, "events", way}), protocol, direction});
  // No model of a later layer depends on frames before its window.
  const bool looks_back = injector.remembers && injector.layer == WireLayer::kFrame && !open;
  for (std::size_t i = 0; looks_back && i < past_.size(); ++i) {
    const link::Chunk& past = past_[i];
    if (!injector.trigger.Sees(past.message)) continue;
    out_.clear();
    injector.model->Pass(link::Chunk(past), out_);
    injector.model->Release(out_);
  }
  const auto later = [&](const Injector& other) { return other.layer > injector.layer; };
  injectors_.insert(std::find_if(injectors_.begin(), injectors_.end(), later), std::move(injector));
}

void WireFaults::Give(std::size_t fault, const FaultSpec& spec, const WireKind& kind,
                      const Parameters& parameters, std::uint64_t seed, link::Direction direction,
                      const link::Protocol& protocol) {
  for (Injector& injector : injectors_) {
    if (injector.fault != fault) continue;
    const std::uint64_t events = StreamKey(seed, {spec.id, "events", link::Name(direction)});
    injector.model = kind.make({parameters, injector.rate, events, protocol, direction});
    for (link::Chunk& passed : passed_open_) {
      out_.clear();
      injector.model->Pass(std::move(passed), out_);
      injector.model->Release(out_);
    }
  }
  passed_open_.clear();
}

void WireFaults::Apply(std::vector<link::Chunk>& chunks) {
  for (const link::Chunk& chunk : chunks)
    for (Injector& injector : injectors_) Decide(injector, chunk);
  auto injector = injectors_.begin();
  const auto run = [&](auto end) {
    for (; injector != end; ++injector) {
      Run(*injector, chunks);
      if (Weight(chunks) > link::kLineBytesMax) return false;
    }
    return true;
  };
  if (grows_) {
    const auto is_later = [](const Injector& other) { return other.layer > WireLayer::kFrame; };
    if (!run(std::find_if(injectors_.begin(), injectors_.end(), is_later))) return;
    Remember(chunks);
  }
  run(injectors_.end());
}

// More frames than any model looks back, or as many as fit into the limit.
void WireFaults::Remember(const std::vector<link::Chunk>& chunks) {
  constexpr std::size_t kPastBytesMax = std::size_t{8} << 20;
  for (const link::Chunk& chunk : chunks) {
    past_bytes_ += link::WeightOf(past_.emplace_back(chunk));
    while (past_bytes_ > kPastBytesMax) {
      past_bytes_ -= link::WeightOf(past_.front());
      past_.pop_front();
    }
  }
}

std::size_t WireFaults::held_bytes() const {
  std::size_t bytes = 0;
  for (const Injector& injector : injectors_) bytes += HeldBy(injector);
  return bytes;
}

std::vector<std::size_t> WireFaults::Multipliers() const {
  std::vector<std::size_t> faults;
  for (const Injector& injector : injectors_)
    if (injector.multiplied) faults.push_back(injector.fault);
  return faults;
}

std::vector<std::size_t> WireFaults::Holders() const {
  std::vector<std::size_t> faults;
  for (const Injector& injector : injectors_)
    if (injector.delayed || HeldBy(injector) > 0) faults.push_back(injector.fault);
  return faults;
}

std::vector<std::size_t> WireFaults::Returners() const {
  std::vector<std::size_t> faults;
  for (const Injector& injector : injectors_)
    if (injector.returned) faults.push_back(injector.fault);
  return faults;
}

bool WireFaults::sends_back() const {
  return std::any_of(injectors_.begin(), injectors_.end(),
                     [](const Injector& injector) { return injector.sends_back; });
}

void WireFaults::Decide(Injector& injector, const link::Chunk& sent) const {
  const auto time = injector.acts_on_overlap ? static_cast<std::int64_t>(sent.bytes.size()) : 0;
  const BootTime end_ns = sent.begin_ns + injector.rate.BytesTime(time);
  const bool inside =
      injector.activity->Touches(origin_.SimulationTime(sent.begin_ns), origin_.SimulationTime(end_ns));
  const bool picked = inside && injector.trigger.Sees(sent.message) && injector.trigger.Picks(sent.number);
  injector.pick[sent.number % kDecisions] = picked ? ++injector.pick_count : 0;
}

void WireFaults::Run(Injector& injector, std::vector<link::Chunk>& chunks) {
  const auto picked = [&injector](const link::Chunk& chunk) {
    return injector.pick[chunk.number % kDecisions] != 0;
  };
  if (!injector.remembers && std::none_of(chunks.begin(), chunks.end(), picked)) return;

  out_.clear();
  Random random(0);
  std::optional<std::uint64_t> random_number;  // of the frame that `random` belongs to
  for (link::Chunk& chunk : chunks) {
    if (!picked(chunk)) {
      if (injector.remembers && injector.trigger.Sees(chunk.message)) {
        if (injector.model == nullptr) {
          passed_open_.push_back(chunk);
          out_.push_back(std::move(chunk));
          continue;
        }
        injector.model->Pass(std::move(chunk), out_);
        injector.model->Release(out_);
      } else {
        out_.push_back(std::move(chunk));
      }
      continue;
    }
    // Copies and fragments go on with their frame's draws.
    if (random_number != chunk.number) {
      random_number = chunk.number;
      random = Random(KeyOf(injector.stream, chunk.number));
    }
    ActAndRecord(injector, std::move(chunk), random);
    if (injector.remembers) injector.model->Release(out_);
  }
  chunks.swap(out_);
}

void WireFaults::ActAndRecord(Injector& injector, link::Chunk&& chunk, Random& random) {
  if (injector.model == nullptr) throw OpenFaultActs();
  before_ = chunk;
  const std::size_t out_begin = out_.size(), back_begin = sent_back_.size();
  std::string what;
  const bool keeps = recorder_->Keeps(injector.fault) &&
                     link::WeightOf(before_) <= kActivationBytesMax;  // else no text either
  injector.model->Act(std::move(chunk),
                      {random, *injector.activity, origin_, sent_back_, keeps ? &what : nullptr,
                       injector.pick[before_.number % kDecisions] - 1},
                      out_);
  const auto after = std::span<const link::Chunk>(out_).subspan(out_begin);
  const bool returned = sent_back_.size() > back_begin;
  if (!returned && after.size() == 1 && SameBytesAndTime(after[0], before_)) return;
  injector.returned = injector.returned || returned;
  // Other bytes than came in are sent with the parity bits that fit them.
  for (link::Chunk& made : std::span(out_).subspan(out_begin))
    if (made.parity_errors.size() != made.bytes.size()) made.parity_errors.clear();
  const std::size_t weight = Weight(after);
  injector.multiplied = injector.multiplied || weight > link::WeightOf(before_);
  injector.delayed = injector.delayed || (after.size() == 1 && after[0].begin_ns > before_.begin_ns);
  recorder_->Count(injector.fault, link::WeightOf(before_) + weight + what.size(), [&]() -> BootActivation {
    return {.time_ns = before_.begin_ns,
            .fault = injector.fault,
            .what = std::move(what),
            .before = {before_},
            .after = {after.begin(), after.end()}};
  });
}

}  // namespace tiltproof::faults
