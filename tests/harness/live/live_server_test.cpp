// A viewer that does not read is dropped, and the flight does not wait for it.
#include "harness/live/live_server.h"

#include <gtest/gtest.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <string>

namespace tiltproof::harness {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

class LiveServerTest : public ::testing::Test {
 protected:
  explicit LiveServerTest(std::chrono::milliseconds write_limit = std::chrono::milliseconds(1))
      : socket_(ListenOnLoopback(0)),
        server_(loop_, socket_, board_,
                {.token = "", .page = [] { return std::string("page"); }, .write_limit = write_limit}) {}

  // Asks for the events, and reads nothing of them.
  tcp::socket View() {
    tcp::socket viewer(loop_);
    // Little room, so that what is not read soon fills it.
    viewer.open(tcp::v4());
    viewer.set_option(asio::socket_base::receive_buffer_size(4096));
    viewer.connect({asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(socket_.port)});
    const std::string place = "127.0.0.1:" + std::to_string(socket_.port);
    asio::write(viewer, asio::buffer("GET /events HTTP/1.1\r\nHost: " + place + "\r\n\r\n"));
    const std::size_t before = server_.viewers_count();
    while (server_.viewers_count() == before) loop_.run_one();
    return viewer;
  }

  asio::io_context loop_;
  LiveBoard board_;
  LiveSocket socket_;
  LiveServer server_;
};

TEST_F(LiveServerTest, OneWhoDoesNotReadIsDropped) {
  const tcp::socket deaf = View();
  ASSERT_EQ(server_.viewers_count(), 1U);
  // More than the sockets of both sides hold: at most 6 MB by the kernel's default.
  for (int i = 0; i < 64 && server_.viewers_count() == 1; ++i) {
    board_.SetStatus("\"" + std::string(1'000'000, static_cast<char>('a' + i % 26)) + "\"");
    server_.Tell();
    loop_.run_for(std::chrono::milliseconds(50));
    loop_.restart();
  }
  EXPECT_EQ(server_.viewers_count(), 0U);
  EXPECT_TRUE(server_.is_told()) << "the flight does not wait for it";
}

class PatientServerTest : public LiveServerTest {
 protected:
  PatientServerTest() : LiveServerTest(LiveServer::kWriteLimit) {}
};

TEST_F(PatientServerTest, OneWhoIsSlowStays) {
  const tcp::socket slow = View();
  for (int i = 0; i < 16; ++i) {
    board_.SetStatus("\"" + std::string(1'000'000, static_cast<char>('a' + i % 26)) + "\"");
    server_.Tell();
    loop_.poll();
    loop_.restart();
  }
  EXPECT_EQ(server_.viewers_count(), 1U);
}

}  // namespace
}  // namespace tiltproof::harness
