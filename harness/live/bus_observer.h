// A flight in real time, heard on the bus and put on the live board: of this machine or any other. It only listens, as
// an onlooker for whom no node waits.
//
//   BusObserver feed(loop, bus_config, board, changed);
//   feed.Follow(run_id, plan);           // a flight that is known
//   feed.FollowAnnounced(load, finish);  // or whatever is announced: a monitor
#pragma once

#include <boost/asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>

#include "harness/dds/bus.h"
#include "harness/live/live_board.h"

namespace tiltproof::harness {

class BusObserver {
 public:
  // `changed` is called after something was put on the board.
  BusObserver(boost::asio::io_context& loop, const dds::BusConfig& config, LiveBoard& board,
              std::function<void()> changed);
  ~BusObserver();
  BusObserver(const BusObserver&) = delete;
  BusObserver& operator=(const BusObserver&) = delete;

  void Follow(const std::string& run_id, const LivePlan& plan);

  // May throw: then the flight is not shown.
  using Loader = std::function<LivePlan(const std::string& scenario_yaml)>;
  // Makes the line of the table from the score.
  using Finisher = std::function<std::string(const LivePlan& plan, const dds::Score& score)>;
  void FollowAnnounced(Loader load, Finisher finish);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tiltproof::harness
