// The faults that act in one direction of the line, one after the other: link::Wire passes its frames through
// them.
//
// Each frame as sent has a number, and every fault decides at once whether its trigger picks that number.
// A change by an earlier fault to the frame (drop, delay) affects neither the counts nor the draws
// of a later one. Copies and fragments share their frame's number, and so its treatment by the trigger.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "faults/fault_type.h"
#include "faults/recorder.h"
#include "faults/trigger.h"
#include "link/chunk.h"

namespace tiltproof::faults {

class WireFaults final : public link::ChunkFilter {
 public:
  // Adds a fault, which acts after those of its layer and of the layers before. `activity` and `protocol` must
  // outlive it. `open`: it has no model yet.
  void Add(std::size_t fault, const FaultSpec& spec, const WireKind& kind, const Activity& activity,
           const Parameters& parameters, std::uint64_t seed, link::Direction direction, const LineRate& rate,
           const link::Protocol& protocol, bool open = false);
  // The model of a fault that was added as an open one.
  void Give(std::size_t fault, const FaultSpec& spec, const WireKind& kind, const Parameters& parameters,
            std::uint64_t seed, link::Direction direction, const link::Protocol& protocol);
  bool empty() const { return injectors_.empty(); }

  // Faults are added in flight, and have seen the frames that passed before.
  void Grow() { grows_ = true; }

  // `recorder` must outlive the last Apply().
  void SetRecorder(Recorder* recorder) { recorder_ = recorder; }
  // Before this call only windows without a start are open.
  void SetOrigin(Origin origin) { origin_ = origin; }

  void Apply(std::vector<link::Chunk>& chunks) override;
  std::size_t held_bytes() const override;

  // The faults that put more bytes on the line than were sent, those that kept some for later, and those that
  // sent some back.
  std::vector<std::size_t> Multipliers() const;
  std::vector<std::size_t> Holders() const;
  std::vector<std::size_t> Returners() const;

  // A fault here may send bytes back to their sender.
  bool sends_back() const;
  // The chunks that the faults have sent back since the last call, with the times and numbers of their frames.
  std::vector<link::Chunk> TakeSentBack() { return std::exchange(sent_back_, {}); }

 private:
  // Decisions are kept for this many frames: more than any chain of faults holds back.
  static constexpr std::size_t kDecisions = 1024;

  struct Injector {
    std::size_t fault;
    WireLayer layer;
    const Activity* activity;
    Trigger trigger;
    std::uint64_t stream;  // of the model's draws, one generator per frame
    LineRate rate;
    bool remembers;
    bool acts_on_overlap;
    bool sends_back;
    std::unique_ptr<WireModel> model;  // null: the fault is open
    bool multiplied = false, delayed = false, returned = false;
    std::array<std::uint64_t, kDecisions> pick{};  // of a frame that is picked, from 1; 0: not picked
    std::uint64_t pick_count = 0;
  };

  static std::size_t HeldBy(const Injector& injector) {
    return injector.model == nullptr ? 0 : injector.model->held_bytes();
  }
  void Remember(const std::vector<link::Chunk>& chunks);
  void Decide(Injector& injector, const link::Chunk& sent) const;
  void Run(Injector& injector, std::vector<link::Chunk>& chunks);
  void ActAndRecord(Injector& injector, link::Chunk&& chunk, Random& random);

  std::vector<Injector> injectors_;
  Recorder* recorder_ = nullptr;
  Origin origin_;
  std::vector<link::Chunk> out_, sent_back_;
  link::Chunk before_;
  bool grows_ = false;
  std::deque<link::Chunk> past_;  // as they left the first layer, for its models that remember
  std::size_t past_bytes_ = 0;
  std::vector<link::Chunk> passed_open_;  // by the open fault
};

}  // namespace tiltproof::faults
