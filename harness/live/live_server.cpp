#include "harness/live/live_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <list>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr std::chrono::seconds kReadLimit{15}, kQuiet{5};
constexpr int kSendBufferBytes = 65'536;
constexpr const char* kTokenHeader = "X-Tiltproof-Token";

// Takes the same time wherever the two differ.
bool Equal(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned>(static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]));
  return difference == 0;
}

Response Respond(const Request& request, const LiveAnswer& answer,
                 const char* type = "text/plain; charset=utf-8") {
  Response response(static_cast<http::status>(answer.status), request.version());
  response.set(http::field::content_type, type);
  response.set(http::field::cache_control, "no-store");
  response.set("Content-Security-Policy", "frame-ancestors 'none'");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set("Referrer-Policy", "no-referrer");
  response.set("X-Content-Type-Options", "nosniff");
  if (answer.status == 405) response.set(http::field::allow, "GET");
  response.keep_alive(request.keep_alive());
  response.body() = answer.text;
  response.prepare_payload();
  return response;
}

constexpr std::string_view kStreamHead =
    "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\nX-Content-Type-Options: nosniff\r\nConnection: "
    "close\r\n\r\n";

}  // namespace

LiveSocket ListenOnLoopback(int port) {
  LiveSocket listening{socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), port};
  const int yes = 1;
  setsockopt(listening.descriptor, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (listening.descriptor < 0 ||
      bind(listening.descriptor, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      listen(listening.descriptor, SOMAXCONN) != 0 ||
      getsockname(listening.descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    const int error = errno;
    if (listening.descriptor >= 0) close(listening.descriptor);
    if (error == EADDRINUSE)
      throw std::runtime_error(fmt::format(
          "port {} of 127.0.0.1 is in use by another program; give another port, or 0 for any that is free",
          port));
    throw std::runtime_error(fmt::format("cannot listen on port {} of 127.0.0.1: {}{}", port,
                                         std::strerror(error),
                                         error == EACCES ? "; give a port above 1023, or 0" : ""));
  }
  listening.port = ntohs(address.sin_port);
  return listening;
}

struct LiveServer::Impl : std::enable_shared_from_this<LiveServer::Impl> {
  class Session;

  Impl(asio::io_context& loop_in, const LiveSocket& socket, const LiveBoard& board_in, Hooks hooks_in)
      : loop(loop_in), acceptor(loop_in), board(board_in), hooks(std::move(hooks_in)), port(socket.port) {
    acceptor.assign(tcp::v4(), socket.descriptor);
  }
  void Accept();
  bool IsOurHost(std::string_view host) const {
    for (const char* name : {"127.0.0.1", "localhost"})
      if (host == fmt::format("{}:{}", name, port) || (port == 80 && host == name)) return true;
    return false;
  }

  asio::io_context& loop;
  tcp::acceptor acceptor;
  const LiveBoard& board;
  const Hooks hooks;
  const int port;
  asio::steady_timer pause{loop};               // after an error of accept: too many files, most likely
  std::list<std::shared_ptr<Session>> viewers;  // until they are gone
};

// One connection.
class LiveServer::Impl::Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, std::shared_ptr<Impl> server)
      : stream_(std::move(socket)), server_(std::move(server)) {
    boost::system::error_code ignored;
    stream_.socket().set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
  }

  void Read() {
    parser_.emplace();
    parser_->header_limit(kHeaderBytesMax);
    parser_->body_limit(kBodyBytesMax);
    stream_.expires_after(kReadLimit);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = this->shared_from_this()](beast::error_code error, std::size_t) { self->OnRead(error); });
  }

  // Sends this viewer its news, once the write before is complete.
  void Push() {
    if (writing_ || ended_) return;
    const auto now = std::chrono::steady_clock::now();
    outgoing_ = server_->board.TakeUpdate(seen_);
    // The next write to a viewer shows that it has gone.
    if (outgoing_.empty() && now - wrote_ < kQuiet) return;
    if (outgoing_.empty()) outgoing_ = ":\n\n";
    Stream();
  }
  bool is_told() const {
    LiveBoard::Seen seen = seen_;
    return ended_ || (!writing_ && server_->board.TakeUpdate(seen).empty());
  }

 private:
  void OnRead(beast::error_code error) {
    if (error == http::error::body_limit || error == http::error::header_limit)
      return Answer({413, "the request is too large\n"}, true);
    if (error == http::error::end_of_stream || error == asio::error::eof) return;
    if (error && error != beast::error::timeout &&
        error.category() == http::make_error_code(http::error{}).category())
      return Answer({400, "this is not an HTTP request\n"}, true);
    if (error) return;
    request_ = parser_->release();
    Handle();
  }

  void Handle() {
    const auto target = request_.target();
    const std::string path(target.substr(0, target.find('?')));
    const auto host = request_[http::field::host];
    if (!server_->IsOurHost({host.data(), host.size()}))
      return Answer({403, fmt::format("this page is at http://127.0.0.1:{} only\n", server_->port)});
    if (request_.method() == http::verb::post) return Press(path);
    if (request_.method() != http::verb::get) return Answer({405, "only GET\n"});
    if (path == "/") return Answer({200, server_->hooks.page()}, false, "text/html; charset=utf-8");
    if (path == "/events") return BeginStream();
    if (const std::string_view folder = "/flights/"; path.starts_with(folder)) {
      std::size_t number = 0;
      const char* const end = path.data() + path.size();
      const auto parsed = std::from_chars(path.data() + folder.size(), end, number);
      if (parsed.ec == std::errc() && parsed.ptr == end)
        if (auto details = server_->hooks.details(number))
          return Answer({200, std::move(*details)}, false, "application/octet-stream");
    }
    Answer({404, "there is no such page\n"});
  }

  void Press(const std::string& path) {
    if (path != "/start" && path != "/abort" && path != "/inject")
      return Answer({404, "there is no such button\n"});
    if (server_->hooks.token.empty())
      return Answer(
          {403, "there are no buttons here: only `tiltproof run --live --mode realtime` has them\n"});
    const auto token = request_[kTokenHeader];
    if (!Equal({token.data(), token.size()}, server_->hooks.token))
      return Answer({403, "the token is missing or wrong: open the address that `tiltproof run` printed\n"});
    server_->hooks.press(std::string_view(path).substr(1), request_.body(),
                         [self = this->shared_from_this()](LiveAnswer answer) {
                           if (answer.text.empty() || answer.text.back() != '\n') answer.text += '\n';
                           self->Answer(answer);
                         });
  }

  void Answer(const LiveAnswer& answer, bool last = false, const char* type = "text/plain; charset=utf-8") {
    response_ = Respond(request_, answer, type);
    if (last) response_.keep_alive(false);
    stream_.expires_after(server_->hooks.write_limit);
    http::async_write(stream_, response_,
                      [self = this->shared_from_this()](beast::error_code error, std::size_t) {
                        if (!error && self->response_.keep_alive()) return self->Read();
                        boost::system::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  void BeginStream() {
    if (server_->viewers.size() >= kViewersMax)
      return Answer({503, fmt::format("{} viewers look already\n", kViewersMax)}, true);
    server_->viewers.push_back(this->shared_from_this());
    outgoing_ = kStreamHead;
    Stream();
  }

  void Stream() {
    writing_ = true;
    stream_.expires_after(server_->hooks.write_limit);
    asio::async_write(stream_, asio::buffer(outgoing_),
                      [self = this->shared_from_this()](boost::system::error_code error, std::size_t) {
                        self->writing_ = false;
                        self->wrote_ = std::chrono::steady_clock::now();
                        if (!error) return self->Push();
                        self->ended_ = true;
                        self->server_->viewers.remove(self);
                      });
  }

  beast::tcp_stream stream_;
  std::shared_ptr<Impl> server_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  Request request_;
  Response response_;
  // As a viewer.
  LiveBoard::Seen seen_;
  std::string outgoing_;
  bool writing_ = false, ended_ = false;
  std::chrono::steady_clock::time_point wrote_;
};

void LiveServer::Impl::Accept() {
  acceptor.async_accept([self = shared_from_this()](boost::system::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error) {
      std::make_shared<Session>(std::move(socket), self)->Read();
      return self->Accept();
    }
    self->pause.expires_after(std::chrono::milliseconds(200));
    self->pause.async_wait([self](boost::system::error_code stopped) {
      if (!stopped) self->Accept();
    });
  });
}

LiveServer::LiveServer(asio::io_context& loop, const LiveSocket& socket, const LiveBoard& board, Hooks hooks)
    : impl_(std::make_shared<Impl>(loop, socket, board, std::move(hooks))) {
  impl_->Accept();
}

LiveServer::~LiveServer() {
  try {
    boost::system::error_code ignored;
    impl_->acceptor.close(ignored);
    impl_->pause.cancel();
    impl_->viewers.clear();
  } catch (...) {
    // It is gone either way.
  }
}

void LiveServer::Tell() {
  // One who is gone leaves the list.
  const auto viewers = impl_->viewers;
  for (const auto& viewer : viewers) viewer->Push();
}

std::size_t LiveServer::viewers_count() const { return impl_->viewers.size(); }

bool LiveServer::is_told() const {
  return std::all_of(impl_->viewers.begin(), impl_->viewers.end(),
                     [](const auto& viewer) { return viewer->is_told(); });
}

}  // namespace tiltproof::harness
