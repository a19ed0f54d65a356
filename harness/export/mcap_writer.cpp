#include "harness/export/mcap_writer.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "harness/report/results.h"
#include "harness/report/zstd_bytes.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kMagic = "\x89MCAP0\r\n";
constexpr std::string_view kCompression = "zstd";

enum class Opcode : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kSummaryOffset = 14,
  kDataEnd = 15,
};

std::uint32_t AddCrc(std::uint32_t crc, std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// The content of a record, field by field.
class McapRecord {
 public:
  template <class Unsigned>
  McapRecord& Number(Unsigned value) {
    for (std::size_t i = 0; i < sizeof value; ++i)
      content_ += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i));
    return *this;
  }
  McapRecord& Bytes(std::string_view bytes) {
    content_ += bytes;
    return *this;
  }
  McapRecord& Text(std::string_view text) {
    return Number(static_cast<std::uint32_t>(text.size())).Bytes(text);
  }

  const std::string& content() const { return content_; }
  std::string As(Opcode opcode) const {
    return McapRecord().Number(static_cast<std::uint8_t>(opcode)).Number(content_.size()).content_ + content_;
  }

 private:
  std::string content_;
};

}  // namespace

McapWriter::McapWriter(std::function<void(std::string_view)> sink) : sink_(std::move(sink)) {
  Emit(kMagic);
  Emit(McapRecord().Text("").Text("tiltproof " + std::string(Version())).As(Opcode::kHeader));
}

void McapWriter::Emit(std::string_view bytes) {
  sink_(bytes);
  offset_ += bytes.size();
  crc_ = AddCrc(crc_, bytes);
}

McapWriter::Topic McapWriter::AddTopic(const McapTopic& topic) {
  Check(chunks_count_ == 0 && chunk_.empty(), "all topics come before the first message");
  Check(counts_.size() < std::numeric_limits<Topic>::max(), "a log has fewer topics than ids");
  counts_.push_back(0);
  const auto id = static_cast<Topic>(counts_.size());  // 0 is no schema
  const std::string schema = McapRecord()
                                 .Number(id)
                                 .Text(topic.schema)
                                 .Text(topic.schema_encoding)
                                 .Text(topic.schema_data)
                                 .As(Opcode::kSchema);
  McapRecord metadata;
  for (const auto& [key, value] : topic.metadata) metadata.Text(key).Text(value);
  const std::string channel = McapRecord()
                                  .Number(id)
                                  .Number(id)
                                  .Text(topic.topic)
                                  .Text(topic.message_encoding)
                                  .Text(metadata.content())
                                  .As(Opcode::kChannel);
  Emit(schema);
  Emit(channel);
  schemas_ += schema;
  channels_ += channel;
  return id;
}

void McapWriter::Write(Topic topic, TimeNs time_ns, std::string_view message) {
  Check(topic > 0, "a message has a topic that was added");
  CheckIndex(topic - std::size_t{1}, counts_.size(), "a message has a topic that was added");
  const auto time = static_cast<std::uint64_t>(std::max<TimeNs>(time_ns, 0));
  chunk_begin_ns_ = chunk_.empty() ? time : std::min(chunk_begin_ns_, time);
  chunk_end_ns_ = chunk_.empty() ? time : std::max(chunk_end_ns_, time);
  chunk_index_[topic].messages.emplace_back(time, chunk_.size());
  const auto sequence = static_cast<std::uint32_t>(++counts_[topic - std::size_t{1}]);
  chunk_ += McapRecord().Number(topic).Number(sequence).Number(time).Number(time).Bytes(message).As(
      Opcode::kMessage);
  if (chunk_.size() >= kChunkBytes) EndChunk();
}

void McapWriter::EndChunk() {
  if (chunk_.empty()) return;
  const std::string compressed = CompressZstd(chunk_);
  const std::uint64_t chunk_offset = offset_;
  Emit(McapRecord()
           .Number(chunk_begin_ns_)
           .Number(chunk_end_ns_)
           .Number(chunk_.size())
           .Number(AddCrc(0, chunk_))
           .Text(kCompression)
           .Number(compressed.size())
           .Bytes(compressed)
           .As(Opcode::kChunk));
  const std::uint64_t chunk_length = offset_ - chunk_offset, index_offset = offset_;
  McapRecord offsets;
  for (const auto& [topic, index] : chunk_index_) {
    offsets.Number(topic).Number(offset_);
    McapRecord entries;
    for (const auto& [time, offset] : index.messages) entries.Number(time).Number(offset);
    Emit(McapRecord().Number(topic).Text(entries.content()).As(Opcode::kMessageIndex));
  }
  chunk_indexes_ += McapRecord()
                        .Number(chunk_begin_ns_)
                        .Number(chunk_end_ns_)
                        .Number(chunk_offset)
                        .Number(chunk_length)
                        .Text(offsets.content())
                        .Number(offset_ - index_offset)
                        .Text(kCompression)
                        .Number(compressed.size())
                        .Number(chunk_.size())
                        .As(Opcode::kChunkIndex);
  begin_ns_ = chunks_count_ == 0 ? chunk_begin_ns_ : std::min(begin_ns_, chunk_begin_ns_);
  end_ns_ = std::max(end_ns_, chunk_end_ns_);
  ++chunks_count_;
  chunk_.clear();
  chunk_index_.clear();
}

std::string McapWriter::Statistics() const {
  McapRecord counts;
  for (std::size_t i = 0; i < counts_.size(); ++i)
    counts.Number(static_cast<Topic>(i + 1)).Number(counts_[i]);
  return McapRecord()
      .Number(std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0}))
      .Number(static_cast<std::uint16_t>(counts_.size()))
      .Number(static_cast<std::uint32_t>(counts_.size()))
      .Number(std::uint32_t{0})  // attachments
      .Number(std::uint32_t{0})  // metadata records
      .Number(chunks_count_)
      .Number(begin_ns_)
      .Number(end_ns_)
      .Text(counts.content())
      .As(Opcode::kStatistics);
}

void McapWriter::Finish() {
  EndChunk();
  Emit(McapRecord().Number(crc_).As(Opcode::kDataEnd));
  // The summary's own checksum covers all from here on.
  const std::uint64_t summary_offset = offset_;
  crc_ = 0;
  std::string offsets;
  const auto emit_group = [&](Opcode opcode, const std::string& records) {
    if (records.empty()) return;
    offsets += McapRecord()
                   .Number(static_cast<std::uint8_t>(opcode))
                   .Number(offset_)
                   .Number(records.size())
                   .As(Opcode::kSummaryOffset);
    Emit(records);
  };
  emit_group(Opcode::kSchema, schemas_);
  emit_group(Opcode::kChannel, channels_);
  emit_group(Opcode::kStatistics, Statistics());
  emit_group(Opcode::kChunkIndex, chunk_indexes_);
  const std::uint64_t offsets_offset = offset_;
  Emit(offsets);
  // The footer has a fixed size, and its last field is the checksum of what is before it.
  McapRecord footer;
  footer.Number(summary_offset).Number(offsets_offset);
  const std::string start = McapRecord()
                                .Number(static_cast<std::uint8_t>(Opcode::kFooter))
                                .Number(footer.content().size() + 4)
                                .content();
  Emit(start + footer.content());
  Emit(McapRecord().Number(crc_).content());
  Emit(kMagic);
}

}  // namespace tiltproof::harness
