// The process that serves the live page: beside the run or the monitor, so that nothing that a viewer does can hold it
// up. The flight only writes into a ring in memory and into a socket, and waits for neither.
//
//   LiveProcess live(ListenOnLoopback(8470), options, plans);  // before any other thread or process
//   job.observe = [&live, i] { return live.Observe(i); };     // in the worker: rows of a lockstep flight
//   live.Place(i, place);                                     // a flight in real time is on the bus
//   live.Finished(i, entry);
//   while (flying) { live.Poll(); if (live.wants_abort()) Stop(); }
//
// It ends with this object, or with its parent.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/dds/bus.h"
#include "harness/live/bus_observer.h"
#include "harness/live/live_board.h"
#include "harness/live/live_server.h"
#include "harness/live/row_ring.h"
#include "harness/run/bus_place.h"
#include "harness/run/realtime/injection.h"
#include "harness/run/record.h"

namespace tiltproof::harness {

struct LiveOptions {
  std::string token;   // empty: there are no buttons
  bool waits = false;  // the first flight waits for the button `start`
  // The page, with the lines of flights that are over (LiveBoard::finished).
  std::function<std::string(const std::vector<std::string>& entries)> page;
  // Called in the process of the page, and may take its time: see LiveServer::Hooks.
  std::function<std::optional<std::string>(std::size_t flight)> details = [](auto) { return std::nullopt; };
  // Settings of the bus for its flights; domain and tag come from each flight, or from the monitor's target.
  dds::BusConfig bus;
  // A monitor: shows whatever is announced at the target.
  FindWatchTarget target = {};
  BusObserver::Loader load = {};
  BusObserver::Finisher finish = {};
};

class LiveProcess {
 public:
  // Takes the socket. Throws std::runtime_error.
  LiveProcess(const LiveSocket& socket, LiveOptions options, std::vector<LivePlan> plans);
  ~LiveProcess();
  LiveProcess(const LiveProcess&) = delete;
  LiveProcess& operator=(const LiveProcess&) = delete;

  // Called in a worker: what copies the rows of the flight of this number.
  std::unique_ptr<RecordSink> Observe(std::size_t flight);
  // Called in the worker of a flight in real time; without `add`.
  Injections TakeInjections();
  void Place(std::size_t flight, const BusPlace& place);
  void Finished(std::size_t flight, const std::string& entry);
  // Sends what waits to be sent, and reads what the viewers pressed; never waits.
  void Poll();
  bool wants_start() const { return wants_start_; }
  bool wants_abort() const { return wants_abort_; }

 private:
  void Tell(const std::string& line);

  LiveOptions options_;
  std::vector<LivePlan> plans_;
  RowRing ring_;
  pid_t pid_ = -1;
  int channel_ = -1;
  int injections_ = -1;  // the worker's end of a socket to the page's process
  std::string unsent_, unread_;
  bool wants_start_ = false, wants_abort_ = false;
};

}  // namespace tiltproof::harness
