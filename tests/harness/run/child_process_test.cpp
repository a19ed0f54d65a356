#include "harness/process/child_process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;
using testing::AllOf;
using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

ChildSpec Shell(const std::string& script) { return {.command = {"sh", "-c", script}}; }

bool Readable(int descriptor, std::chrono::milliseconds timeout) {
  pollfd polled{descriptor, POLLIN, 0};
  return poll(&polled, 1, static_cast<int>(timeout.count())) > 0;
}

// All bytes until everybody who holds the other end has closed it; "(timeout)" at the end when they do not.
std::string ReadAll(int descriptor) {
  std::string text;
  std::array<char, 4096> buffer;
  while (Readable(descriptor, 10s)) {
    const ssize_t count = read(descriptor, buffer.data(), buffer.size());
    if (count <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  return text + "(timeout)";
}

std::string OutputOf(ChildSpec spec) {
  spec.output = ChildSpec::kPipe;
  ChildProcess child(spec);
  return ReadAll(child.output());
}

std::string StartError(std::vector<std::string> command) {
  try {
    ChildProcess child({.command = std::move(command)});
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

std::string EndOf(ChildProcess& child) {
  EXPECT_TRUE(Readable(child.pidfd(), 10s));
  EXPECT_FALSE(child.Alive());
  return child.ExitText().value_or("no text");
}

struct OutputLine {
  OutputLine() { EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0); }
  ~OutputLine() { close(ends[0]), CloseWrite(); }
  void CloseWrite() {
    if (ends[1] >= 0) close(ends[1]);
    ends[1] = -1;
  }
  int ends[2];
};

TEST(ChildProcess, ItsEndIsToldInWords) {
  ChildProcess code(Shell("exit 3"));
  EXPECT_EQ(EndOf(code), "exited with code 3");
  ChildProcess killed(Shell("kill -9 $$"));
  EXPECT_EQ(EndOf(killed), "killed by signal 9 (Killed)");
  ChildProcess lives({.command = {"sleep", "1000"}});
  EXPECT_TRUE(lives.Alive());
  EXPECT_EQ(lives.ExitText(), std::nullopt);
  EXPECT_FALSE(Readable(lives.pidfd(), 0ms));
  lives.Signal(SIGUSR1);
  EXPECT_EQ(EndOf(lives), "killed by signal 10 (User defined signal 1)");
}

TEST(ChildProcess, AProgramThatCannotBeStartedIsNamedWithTheReason) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("tiltproof-child-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const auto write = [&](const char* name, const char* text, mode_t mode) {
    std::ofstream(folder / name) << text;
    chmod((folder / name).c_str(), mode);
    return (folder / name).string();
  };
  EXPECT_THAT(StartError({"no-such-program-here"}),
              AllOf(HasSubstr("'no-such-program-here'"), HasSubstr("PATH")));
  EXPECT_THAT(StartError({"/no/such/program"}),
              AllOf(HasSubstr("'/no/such/program'"), HasSubstr("No such file")));
  EXPECT_THAT(StartError({write("no_shebang", "exit 0\n", 0755)}), HasSubstr("not a program"));
  EXPECT_THAT(StartError({write("lost", "#!/no/such/shell\n", 0755)}), HasSubstr("interpreter"));
  EXPECT_THAT(StartError({write("plain", "#!/bin/sh\n", 0644)}), HasSubstr("Permission denied"));
  EXPECT_THAT(StartError({folder}), HasSubstr("Permission denied"));
  EXPECT_THAT(StartError({}), HasSubstr("empty"));
  EXPECT_THAT(StartError({""}), HasSubstr("empty"));
  EXPECT_THAT(StartError({"sh", "-c", std::string("a\0b", 3)}), HasSubstr("zero byte"));
  std::filesystem::remove_all(folder);
}

TEST(ChildProcess, ArgumentsAndEnvironmentArriveAsTheyAre) {
  setenv("TILTPROOF_TEST_OLD", "old", 1);
  setenv("TILTPROOF_TEST_KEPT", "kept", 1);
  EXPECT_EQ(OutputOf({.command = {"sh", "-c",
                                  "printf '%s|' \"$@\" \"$TILTPROOF_TEST_OLD\" \"$TILTPROOF_TEST_KEPT\"",
                                  "name", "a b", "", "$HOME 'x'"},
                      .environment = {{"TILTPROOF_TEST_OLD", "new = 1"}}}),
            "a b||$HOME 'x'|new = 1|kept|");
}

TEST(ChildProcess, StreamsGoWhereTheyShould) {
  OutputLine line;
  ChildSpec spec = Shell("cat; echo out; echo err >&2");
  spec.output = line.ends[1];
  spec.error = ChildSpec::kPipe;
  ChildProcess child(spec);
  line.CloseWrite();
  EXPECT_EQ(ReadAll(line.ends[0]), "out\n");
  EXPECT_EQ(ReadAll(child.error()), "err\n");
  EXPECT_EQ(child.output(), -1);
  spec.output = ChildSpec::kNull;
  spec.error = ChildSpec::kNull;
  ChildProcess silent(spec);
  EXPECT_EQ(EndOf(silent), "exited with code 0");
}

TEST(ChildProcess, OnlyTheStatedDescriptorsAreInherited) {
  const int leak = open("/dev/null", O_RDONLY);  // without close-on-exec
  OutputLine first, second;
  ChildSpec spec = Shell("echo 3 >&3; echo 4 >&4; for f in /proc/self/fd/*; do echo ${f##*/}; done");
  // Numbered so that each would overwrite the other.
  const int at_4 = fcntl(first.ends[1], F_DUPFD_CLOEXEC, 4), at_3 = fcntl(second.ends[1], F_DUPFD_CLOEXEC, 3);
  spec.descriptors = {at_4, at_3};
  // The shell globs within itself: its own open folder is one more than what it was given.
  EXPECT_THAT(OutputOf(spec), testing::AnyOf("0\n1\n2\n3\n4\n", "0\n1\n2\n3\n4\n5\n", "0\n1\n10\n2\n3\n4\n"));
  close(at_3), close(at_4), first.CloseWrite(), second.CloseWrite();
  EXPECT_EQ(ReadAll(first.ends[0]), "3\n");
  EXPECT_EQ(ReadAll(second.ends[0]), "4\n");
  close(leak);
}

TEST(ChildProcess, SignalsAreAsInAFreshProcess) {
  sigset_t blocked, before;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  sigprocmask(SIG_BLOCK, &blocked, &before);
  const auto old = std::signal(SIGPIPE, SIG_IGN);
  const std::string status = OutputOf({.command = {"grep", "-E", "^Sig(Blk|Ign)", "/proc/self/status"}});
  std::signal(SIGPIPE, old);
  sigprocmask(SIG_SETMASK, &before, nullptr);
  EXPECT_EQ(status, "SigBlk:\t0000000000000000\nSigIgn:\t0000000000000000\n");
}

TEST(ChildProcess, StopEndsTheWholeGroup) {
  OutputLine line;
  ChildSpec spec =
      Shell("sleep 1000 & (trap '' TERM; sleep 1000; sleep 1000) & echo up >&3; exec sleep 1000");
  spec.descriptors = {line.ends[1]};
  ChildProcess child(spec);
  line.CloseWrite();
  EXPECT_EQ(getpgid(child.pid()), child.pid());
  std::array<char, 3> up;
  EXPECT_EQ(read(line.ends[0], up.data(), up.size()), 3);
  const auto begin = Clock::now();
  child.Stop(5s);
  EXPECT_LT(Clock::now() - begin, 4s);
  EXPECT_EQ(child.ExitText(), "killed by signal 15 (Terminated)");
  EXPECT_EQ(ReadAll(line.ends[0]), "");  // no process is left that holds it
  child.Stop(5s);
  child.SignalGroup(SIGTERM);
}

TEST(ChildProcess, AfterItsOwnEndWhatItStartedIsStoppedToo) {
  OutputLine line;
  ChildSpec spec = Shell("sleep 1000 & exit 5");
  spec.descriptors = {line.ends[1]};
  {
    ChildProcess child(spec);
    line.CloseWrite();
    EXPECT_EQ(EndOf(child), "exited with code 5");
  }
  EXPECT_EQ(ReadAll(line.ends[0]), "");
}

TEST(ChildProcess, OneThatHeedsNothingIsKilled) {
  ChildSpec spec = Shell("trap '' TERM INT HUP; echo up; while :; do sleep 1; done");
  spec.output = ChildSpec::kPipe;
  ChildProcess child(spec);
  EXPECT_TRUE(Readable(child.output(), 10s));
  child.Stop(50ms);
  EXPECT_EQ(child.ExitText(), "killed by signal 9 (Killed)");
}

TEST(ChildProcess, APausedOneIsStopped) {
  ChildProcess child({.command = {"sleep", "1000"}});
  child.SignalGroup(SIGSTOP);
  EXPECT_TRUE(child.Alive());
  child.Stop(0ms);
  EXPECT_FALSE(child.Alive());
}

// A process that starts children and is killed: kill it, and see who still holds the line.
void ExpectNobodySurvives(const ChildSpec& wanted) {
  OutputLine line;
  const pid_t parent = fork();
  if (parent == 0) {
    ChildSpec spec = wanted;
    spec.descriptors = {line.ends[1]};
    ChildProcess child(spec);
    line.CloseWrite();
    while (true) pause();
  }
  line.CloseWrite();
  std::array<char, 3> up{};
  EXPECT_TRUE(Readable(line.ends[0], 10s));
  EXPECT_EQ(read(line.ends[0], up.data(), up.size()), 3);
  kill(parent, SIGKILL);
  EXPECT_EQ(waitpid(parent, nullptr, 0), parent);
  EXPECT_EQ(ReadAll(line.ends[0]), "");
}

TEST(ChildProcess, ItDiesWithAKilledParent) {
  ExpectNobodySurvives(Shell("echo up >&3; exec sleep 1000"));
  ExpectNobodySurvives(Shell("trap '' TERM HUP; echo up >&3; while :; do sleep 0.1; done"));
}

TEST(ChildProcess, AGuardedGroupDiesWithAKilledParent) {
  ChildSpec spec = Shell("sleep 1000 & sleep 1000 | sleep 1000 & echo up >&3; exec sleep 1000");
  spec.guard_group = true;
  ExpectNobodySurvives(spec);
  // Paused as well.
  spec.command[2] = "sleep 1000 & echo up >&3; kill -STOP 0; exec sleep 1000";
  ExpectNobodySurvives(spec);
}

TEST(ChildProcess, NothingIsLeftBehind) {
  const auto descriptors = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                         std::filesystem::directory_iterator());
  };
  const auto before = descriptors();
  for (int i = 0; i < 20; ++i) {
    ChildSpec spec = Shell(i % 2 == 0 ? "sleep 1000" : "exit 0");
    spec.output = spec.error = ChildSpec::kPipe;
    spec.guard_group = i % 4 < 2;
    ChildProcess child(spec);
    StartError({"no-such-program-here"});
    StartError({"/no/such/program"});
  }
  EXPECT_EQ(descriptors(), before);
  // No child at all, zombies included.
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
  EXPECT_EQ(errno, ECHILD);
}

TEST(ChildProcess, DieWithParentEndsAnOrphanAtOnce) {
  const pid_t child = fork();
  if (child == 0) {
    DieWithParent(1 << 29);  // no process has this id
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) != 0);
}

}  // namespace
}  // namespace tiltproof::harness
