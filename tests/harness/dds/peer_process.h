// Another process on the bus: the helper program dds_peer, its lines in and out, and signals to it.
//
//   PeerProcess peer({"heartbeat", "7", "tag"});
//   EXPECT_EQ(peer.ReadLine(), "ready");
//   peer.Signal(SIGKILL);
#pragma once

#include <csignal>
#include <string>
#include <vector>

namespace tiltproof::dds {

class PeerProcess {
 public:
  // environment: NAME=value, besides that of this process.
  explicit PeerProcess(std::vector<std::string> arguments, std::vector<std::string> environment = {});
  // Kills it.
  ~PeerProcess();
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  // The next line of its output; "" at its end or after 30 s.
  std::string ReadLine();
  void WriteLine(const std::string& line);
  void Signal(int number) const { kill(pid_, number); }
  // Its exit code, or 128 and its signal.
  int Wait();

 private:
  pid_t pid_ = -1;
  int to_ = -1;
  int from_ = -1;
  std::string buffer_;
};

}  // namespace tiltproof::dds
