#include "harness/live/live_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/local/datagram_protocol.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/streambuf.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#include "harness/process/orphans.h"
#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

namespace asio = boost::asio;
using std::chrono::milliseconds;

// The rate at which viewers get updates.
constexpr milliseconds kTick{50};
// Number of ticks from one look of a monitor for its target to the next.
constexpr std::uint64_t kTicksOfTarget = 10;
// At the end: viewers get what is new for them.
constexpr milliseconds kFarewell{1'000}, kEndLimit{3'000};
constexpr int kNice = 5;
// For the flight's answer to an injected fault.
constexpr std::chrono::seconds kInjectLimit{15};

// The end that viewers get for a fault without an end; longer than any flight.
constexpr TimeNs kLongest = 1'000'000 * kNsPerS;
constexpr std::size_t kAnswerBytesMax = 20'000;

std::string Status(const char* phase, const std::string& text) {
  return JsonText({{"phase", phase}, {"text", text}});
}

// The work of the process: feeds the board, serves the page, and passes on the buttons.
class Host {
 public:
  Host(const LiveSocket& socket, int channel, int injections, const LiveOptions& options,
       const std::vector<LivePlan>& plans, const RowRing& ring)
      : options_(options),
        plans_(plans),
        ring_(ring),
        parent_(loop_, asio::local::stream_protocol(), channel),
        worker_(loop_, asio::local::datagram_protocol(), injections),
        server_(
            loop_, socket, board_,
            {.token = options.token,
             .page = [this] { return options_.page(board_.finished()); },
             .details = options.details,
             .press = [this](auto button, const auto& body, auto answer) { Press(button, body, answer); }}) {
    if (options.waits) board_.SetStatus(Status("waiting", "The run waits for the button Start."));
  }

  void Run() {
    ReadParent();
    ReadWorker();
    Tick();
    loop_.run();
  }

 private:
  void Listen(const dds::BusConfig& config) {
    feed_.reset();
    feed_.emplace(loop_, config, board_, [this] { server_.Tell(); });
  }

  // A monitor: goes to where the target is.
  void FollowTarget() {
    const WatchTarget target = options_.target();
    if (target == target_) return;
    target_ = target;
    board_.SetStatus(Status("waiting", target.text));
    feed_.reset();
    if (!target.place) return;
    dds::BusConfig config = options_.bus;
    config.domain = target.place->domain;
    config.tag = target.place->tag;
    try {
      Listen(config);
      feed_->FollowAnnounced(options_.load, options_.finish);
    } catch (const std::exception& error) {
      board_.SetStatus(Status("waiting", std::string("the bus cannot be heard: ") + error.what()));
    }
  }

  void Tick() {
    if (options_.target && !ended_ && tick_count_++ % kTicksOfTarget == 0) FollowTarget();
    PollRows();
    server_.Tell();
    if (ended_ && (server_.is_told() || std::chrono::steady_clock::now() > *ended_ + kFarewell))
      return loop_.stop();
    timer_.expires_after(kTick);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) Tick();
    });
  }

  void PollRows() {
    const RowRing::Update update = ring_.Take(cursor_);
    if (update.begun && update.flight < plans_.size()) Begin(update.flight);
    for (std::size_t at = 0; at < update.values.size(); at += update.column_count)
      board_.AddRow(std::span(update.values).subspan(at, update.column_count));
  }

  void Begin(std::size_t flight) {
    board_.Begin(plans_[flight]);
    board_.SetStatus(Status("flying", ""));
  }

  void ReadParent() {
    asio::async_read_until(parent_, from_parent_, '\n',
                           [this](const boost::system::error_code& error, std::size_t size) {
                             if (error) return End();
                             const auto* begin = static_cast<const char*>(from_parent_.data().data());
                             Hear(Json::parse(std::string_view(begin, size)));
                             from_parent_.consume(size);
                             ReadParent();
                           });
  }

  void Hear(const Json& message) {
    const auto flight = message.at("flight").get<std::size_t>();
    if (flight >= plans_.size()) return;
    if (message.contains("place")) {
      const auto place = FromJson<BusPlace>(message.at("place"));
      dds::BusConfig config = options_.bus;
      config.domain = place.domain;
      config.tag = place.tag;
      try {
        Listen(config);
        feed_->Follow(place.run_id, plans_[flight]);
        board_.SetStatus(Status("flying", ""));
      } catch (const std::exception& error) {
        Begin(flight);
        board_.SetStatus(Status("flying", std::string("the flight cannot be heard: ") + error.what()));
      }
    } else {
      PollRows();
      board_.Finish(plans_[flight].name, JsonText(message.at("finished")));
    }
  }

  void Press(std::string_view button, const std::string& body, const LiveServer::Hooks::Answer& answer) {
    if (button == "inject") return Inject(body, answer);
    // A socket with room for a word: who reads it does so ten times a second.
    const std::string line = std::string(button) + "\n";
    const bool sent = send(parent_.native_handle(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
                      static_cast<ssize_t>(line.size());
    answer(sent ? LiveAnswer{200, std::string(button)} : LiveAnswer{503, "the run does not listen"});
  }

  // The worker checks it, for it flies it.
  void Inject(const std::string& fault, const LiveServer::Hooks::Answer& answer) {
    if (!board_.is_flying()) return answer({409, "no flight is under way"});
    if (injecting_) return answer({409, "another fault is being injected"});
    if (send(worker_.native_handle(), fault.data(), fault.size(), MSG_NOSIGNAL | MSG_DONTWAIT) < 0)
      return answer({503, "the flight does not listen"});
    injecting_ = answer;
    patience_.expires_after(kInjectLimit);
    patience_.async_wait([this](const boost::system::error_code& error) {
      if (!error) AnswerInjection({504, "the flight did not answer"});
    });
  }

  void AnswerInjection(const LiveAnswer& answer) {
    patience_.cancel();
    if (const auto waiting = std::exchange(injecting_, {})) waiting(answer);
  }

  void ReadWorker() {
    worker_.async_receive(
        asio::buffer(from_worker_), [this](const boost::system::error_code& error, std::size_t size) {
          if (error) return;
          const Json json = Json::parse(std::string_view(from_worker_.data(), size));
          if (json.at("accepted").get<bool>()) {
            const double begin_s = json.at("begin_s").get<double>();
            board_.Inject(json.at("id").get<std::string>(), json.at("type").get<std::string>(),
                          json.at("target").get<std::string>(), begin_s, json.at("end_s").get<double>());
            AnswerInjection({200, JsonText(json)});
          } else {
            AnswerInjection({400, json.at("text").get<std::string>()});
          }
          ReadWorker();
        });
  }

  void End() {
    ended_ = std::chrono::steady_clock::now();
    board_.SetStatus(Status("ended", options_.load ? "The monitor has ended." : "The run has ended."));
    server_.Tell();
  }

  const LiveOptions& options_;
  const std::vector<LivePlan>& plans_;
  const RowRing& ring_;
  RowRing::Cursor cursor_;
  asio::io_context loop_{1};
  asio::steady_timer timer_{loop_};
  asio::local::stream_protocol::socket parent_;
  asio::local::datagram_protocol::socket worker_;
  std::array<char, 65'536> from_worker_{};
  asio::steady_timer patience_{loop_};
  LiveServer::Hooks::Answer injecting_;  // who waits for the worker's answer
  asio::streambuf from_parent_;
  LiveBoard board_;
  LiveServer server_;
  std::optional<BusObserver> feed_;
  std::optional<WatchTarget> target_;
  std::uint64_t tick_count_ = 0;
  std::optional<std::chrono::steady_clock::time_point> ended_;
};

}  // namespace

LiveProcess::LiveProcess(const LiveSocket& socket, LiveOptions options, std::vector<LivePlan> plans)
    : options_(std::move(options)), plans_(std::move(plans)) {
  int ends[2], injections[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0 ||
      socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, injections) != 0)
    throw std::runtime_error(std::string("cannot make a socket pair: ") + std::strerror(errno));
  pid_ = fork();
  if (pid_ < 0)
    throw std::runtime_error(std::string("cannot start the live page's process: ") + std::strerror(errno));
  if (pid_ == 0) {
    // Ctrl-C reaches it, too: it ends after its parent has said its last word.
    std::signal(SIGINT, SIG_IGN);
    std::signal(SIGHUP, SIG_IGN);
    std::signal(SIGPIPE, SIG_IGN);
    close(ends[0]);
    close(injections[0]);
    setpriority(PRIO_PROCESS, 0, kNice);
    try {
      Host(socket, ends[1], injections[1], options_, plans_, ring_).Run();
    } catch (const std::exception&) {
      _exit(1);
    }
    // The parent's objects must not be destroyed here.
    _exit(0);
  }
  KeepChild(pid_);
  close(socket.descriptor);
  close(ends[1]);
  close(injections[1]);
  channel_ = ends[0];
  injections_ = injections[0];
}

LiveProcess::~LiveProcess() {
  Poll();
  shutdown(channel_, SHUT_WR);
  const auto until = std::chrono::steady_clock::now() + kEndLimit;
  // It closes its end when it ends.
  for (char byte[256];;) {
    pollfd polled{channel_, POLLIN, 0};
    const auto left = std::chrono::duration_cast<milliseconds>(until - std::chrono::steady_clock::now());
    const int ready = poll(&polled, 1, static_cast<int>(std::max<milliseconds::rep>(left.count(), 0)));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) kill(pid_, SIGKILL);
    if (ready <= 0 || read(channel_, byte, sizeof byte) <= 0) break;
  }
  close(channel_);
  close(injections_);
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
  ForgetChild(pid_);
}

namespace {

// Copies rows into the ring. At the end of each row it adds the states of the supervisors.
class RingWriter final : public RecordSink {
 public:
  RingWriter(RowRing& ring, std::size_t columns, std::size_t clients)
      : ring_(ring), clients_(clients), row_(columns, std::numeric_limits<double>::quiet_NaN()) {}

  void Write(const Record& record) override {
    if (const auto* row = std::get_if<record::Row>(&record.body)) {
      std::copy_n(row->values.begin(), std::min(row->values.size(), row_.size() - clients_), row_.begin());
      ring_.Append(row_);
    } else if (const auto* state = std::get_if<record::State>(&record.body)) {
      row_[row_.size() - clients_ + record.client.value_or(0)] = static_cast<double>(state->state);
    }
  }

 private:
  RowRing& ring_;
  std::size_t clients_;
  std::vector<double> row_;
};

}  // namespace

std::unique_ptr<RecordSink> LiveProcess::Observe(std::size_t flight) {
  const LivePlan& plan = plans_.at(flight);
  const std::size_t clients = plan.scenario.client_count();
  const std::size_t columns = TraceLayout(plan.vehicle, plan.scenario).columns.size() + clients;
  if (!ring_.Begin(flight, columns)) return nullptr;
  return std::make_unique<RingWriter>(ring_, columns, clients);
}

Injections LiveProcess::TakeInjections() {
  const auto next = [socket = injections_]() -> std::optional<std::string> {
    std::string text(LiveServer::kBodyBytesMax, '\0');
    const ssize_t count = recv(socket, text.data(), text.size(), MSG_DONTWAIT);
    if (count < 0) return std::nullopt;
    text.resize(static_cast<std::size_t>(count));
    return text;
  };
  // Discards requests that an earlier flight has not read.
  while (next()) {
  }
  return {.next = next, .add = {}, .answer = [socket = injections_](const Injections::Answer& answer) {
            Json json = {{"accepted", answer.accepted}};
            if (answer.accepted) {
              json["id"] = answer.fault.id;
              json["type"] = answer.fault.type;
              json["target"] = TargetText(answer.fault);
              json["begin_s"] = ToSeconds(answer.fault.start_ns);
              json["end_s"] = ToSeconds(answer.fault.end_ns == kNever ? kLongest : answer.fault.end_ns);
            } else {
              json["text"] = answer.text.substr(0, kAnswerBytesMax);
            }
            const std::string text = JsonText(json);
            send(socket, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
          }};
}

void LiveProcess::Place(std::size_t flight, const BusPlace& place) {
  Tell(JsonText({{"flight", flight}, {"place", ToJson(place)}}));
}

void LiveProcess::Finished(std::size_t flight, const std::string& entry) {
  ring_.Release(flight);
  Tell("{\"flight\":" + std::to_string(flight) + ",\"finished\":" + entry + "}");
}

void LiveProcess::Tell(const std::string& line) {
  unsent_ += line + "\n";
  Poll();
}

void LiveProcess::Poll() {
  while (!unsent_.empty()) {
    const ssize_t count = send(channel_, unsent_.data(), unsent_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) unsent_.clear();  // it is gone, and the run goes on
    if (count <= 0) break;
    unsent_.erase(0, static_cast<std::size_t>(count));
  }
  char bytes[256];
  const ssize_t count = recv(channel_, bytes, sizeof bytes, MSG_DONTWAIT);
  if (count > 0) unread_.append(bytes, static_cast<std::size_t>(count));
  for (std::size_t end; (end = unread_.find('\n')) != std::string::npos; unread_.erase(0, end + 1)) {
    const std::string_view word = std::string_view(unread_).substr(0, end);
    wants_start_ |= word == "start";
    wants_abort_ |= word == "abort";
  }
}

}  // namespace tiltproof::harness
