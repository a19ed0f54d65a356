#include "harness/report/line_frames.h"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <string_view>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

std::string_view Text(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool SameBytes(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  return Text(a) == Text(b);
}

// Records of one wire.
struct WireRecords {
  std::vector<LinkRecord> sent, delivered;
};

struct Pairing {
  const WireRecords& records;
  std::vector<LineFrame> frames;  // one for each sent record, in its order; then those that are extra
  std::vector<bool> taken;        // of the delivered records

  explicit Pairing(const WireRecords& of)
      : records(of), frames(of.sent.size()), taken(of.delivered.size(), false) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const LinkRecord& sent = records.sent[i];
      frames[i] = {sent.wire, sent.begin_ns, sent.bytes, FrameFate::kLost};
    }
  }

  void Take(std::size_t frame, std::size_t delivered) {
    CheckIndex(delivered, taken.size(), "a delivered record is one of the wire's");
    CheckIndex(frame, frames.size(), "a delivered record goes to a frame of its wire");
    taken[delivered] = true;
    frames[frame].delivered.push_back(records.delivered[delivered]);
  }

  void PairIntact() {
    std::size_t d = 0;
    for (LineFrame& frame : frames) {
      while (d < taken.size() && records.delivered[d].begin_ns < frame.begin_ns) ++d;
      for (std::size_t same = d; same < taken.size() && records.delivered[same].begin_ns == frame.begin_ns;
           ++same) {
        if (taken[same] || !SameBytes(records.delivered[same].bytes, frame.sent)) continue;
        taken[same] = true;
        frame.fate = FrameFate::kIntact;
        break;
      }
    }
  }

  void PairLate() {
    std::map<std::string_view, std::deque<std::size_t>> waiting;
    for (std::size_t d = 0; d < taken.size(); ++d)
      if (!taken[d]) waiting[Text(records.delivered[d].bytes)].push_back(d);
    if (waiting.empty()) return;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      LineFrame& frame = frames[i];
      const auto same = waiting.find(Text(frame.sent));
      if (frame.fate != FrameFate::kLost || same == waiting.end()) continue;
      auto& places = same->second;
      while (!places.empty() && records.delivered[places.front()].begin_ns < frame.begin_ns)
        places.pop_front();
      if (places.empty() || records.delivered[places.front()].begin_ns > frame.begin_ns + kLateMax_ns)
        continue;
      Take(i, places.front());
      places.pop_front();
      frame.fate = FrameFate::kLate;
    }
  }

  // The others belong to the last frame that was sent before them, if that went on as nothing else.
  void PairRest() {
    std::size_t next = 0;
    for (std::size_t d = 0; d < taken.size(); ++d) {
      const LinkRecord& record = records.delivered[d];
      while (next < records.sent.size() && records.sent[next].begin_ns <= record.begin_ns) ++next;
      if (taken[d]) continue;
      LineFrame* frame = next > 0 ? &frames[next - 1] : nullptr;
      if (frame != nullptr && (frame->fate == FrameFate::kLost || frame->fate == FrameFate::kDamaged)) {
        Take(next - 1, d);
        frame->fate = FrameFate::kDamaged;
      } else {
        frames.push_back({record.wire, record.begin_ns, {}, FrameFate::kExtra, {record}});
      }
    }
  }

  // Pieces that make up the whole frame are not damage.
  void JoinPieces() {
    for (LineFrame& frame : frames) {
      if (frame.fate != FrameFate::kDamaged) continue;
      std::string whole;
      for (const LinkRecord& piece : frame.delivered) whole += Text(piece.bytes);
      if (whole == Text(frame.sent)) frame.fate = FrameFate::kLate;
    }
  }
};

}  // namespace

std::string_view Name(FrameFate fate) {
  static constexpr std::array<std::string_view, 5> kNames = {"intact", "late", "damaged", "lost", "extra"};
  return kNames.at(static_cast<std::size_t>(fate));
}

std::vector<LineFrame> FramesOf(const LinkLog& log) {
  std::map<std::pair<std::size_t, link::Direction>, WireRecords> wires;
  std::size_t offset = 0;
  while (const auto record = log.Next(offset)) {
    WireRecords& wire = wires[{record->wire.client, record->wire.direction}];
    (record->delivered ? wire.delivered : wire.sent).push_back(*record);
  }
  const auto by_time = [](const auto& a, const auto& b) { return a.begin_ns < b.begin_ns; };
  std::vector<LineFrame> frames;
  for (auto& [id, records] : wires) {
    std::stable_sort(records.sent.begin(), records.sent.end(), by_time);
    std::stable_sort(records.delivered.begin(), records.delivered.end(), by_time);
    Pairing pairing(records);
    pairing.PairIntact();
    pairing.PairLate();
    pairing.PairRest();
    pairing.JoinPieces();
    for (LineFrame& frame : pairing.frames) frames.push_back(std::move(frame));
  }
  std::stable_sort(frames.begin(), frames.end(), by_time);
  return frames;
}

}  // namespace tiltproof::harness
