// Writes MCAP (https://mcap.dev/spec), the log format of Foxglove and PlotJuggler: compressed chunks with an index, one
// schema for each topic, and checksums.
//
//   McapWriter mcap([&](std::string_view bytes) { file.Write(bytes); });
//   const auto topic = mcap.AddTopic({.topic = "/wind", .schema = "Wind", .message_encoding = "json"});
//   mcap.Write(topic, time_ns, R"({"speed_m_s": 3})");
//   mcap.Finish();
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

struct McapTopic {
  std::string topic;
  std::string schema;  // its name
  std::string schema_encoding = {};
  std::string schema_data = {};
  std::string message_encoding;
  std::map<std::string, std::string> metadata = {};
};

class McapWriter {
 public:
  using Topic = std::uint16_t;
  static constexpr std::size_t kChunkBytes = 1 << 18;  // a chunk ends with the message that reaches this

  explicit McapWriter(std::function<void(std::string_view)> sink);

  // All topics come before the first message.
  Topic AddTopic(const McapTopic& topic);
  // A log has no time before 0: such messages are at 0.
  void Write(Topic topic, TimeNs time_ns, std::string_view message);
  // The index and the end. Without it the file is readable only from its start.
  void Finish();

 private:
  struct Index {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> messages;  // time, offset in the chunk
  };
  void Emit(std::string_view bytes);
  void EndChunk();
  std::string Statistics() const;

  std::function<void(std::string_view)> sink_;
  std::uint64_t offset_ = 0;  // in the file
  std::uint32_t crc_ = 0;     // of all that was written
  std::string schemas_, channels_, chunk_indexes_;
  std::vector<std::uint64_t> counts_;  // messages by topic
  std::uint32_t chunks_count_ = 0;
  std::uint64_t begin_ns_ = 0, end_ns_ = 0;
  std::string chunk_;
  std::map<Topic, Index> chunk_index_;
  std::uint64_t chunk_begin_ns_ = 0, chunk_end_ns_ = 0;
};

}  // namespace tiltproof::harness
