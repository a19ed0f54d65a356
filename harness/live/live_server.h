// The page over HTTP, on this machine's loopback alone: every user of it can look, and buttons need a token.
//
//   LiveServer server(loop, ListenOnLoopback(8470), board, {.token = token, .page = page});
//   loop.run();
//   server.Tell();  // after the board has changed: every viewer gets what is new for it
//
// The server never waits for a viewer. A viewer has at most one pending write, gets the next piece of the board when that
// has ended, and is dropped when it takes longer than kWriteLimit. Requests whose Host is not this address are refused, so
// that no page from elsewhere reads here under a name of its own (DNS rebinding); other origins get nothing (no CORS).
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "harness/live/live_board.h"

namespace tiltproof::harness {

inline constexpr int kLivePort = 8470;

// A socket that listens on 127.0.0.1; port 0: any that is free. Throws std::runtime_error that says what to do.
struct LiveSocket {
  int descriptor = -1;
  int port = 0;
};
LiveSocket ListenOnLoopback(int port);

struct LiveAnswer {
  int status = 200;
  std::string text;  // for a person, or what was asked for
};

class LiveServer {
 public:
  static constexpr std::chrono::seconds kWriteLimit{10};
  static constexpr std::size_t kViewersMax = 64, kBodyBytesMax = 65'536, kHeaderBytesMax = 8'192;

  struct Hooks {
    std::string token;                  // empty: there are no buttons
    std::function<std::string()> page;  // HTML
    // The details of a flight that is over, by its number (harness/report/flight_pack.h); none: it left no files.
    std::function<std::optional<std::string>(std::size_t number)> details = [](auto) { return std::nullopt; };
    // A button: "start", "abort" or "inject", with the text that was sent. `answer` is called once, later.
    using Answer = std::function<void(LiveAnswer)>;
    std::function<void(std::string_view button, const std::string& body, Answer answer)> press =
        [](auto, auto&, auto) {};
    std::chrono::milliseconds write_limit = kWriteLimit;
  };
  LiveServer(boost::asio::io_context& loop, const LiveSocket& socket, const LiveBoard& board, Hooks hooks);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  void Tell();
  std::size_t viewers_count() const;
  // True if every viewer has all that is on the board, or its connection has failed.
  bool is_told() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace tiltproof::harness
