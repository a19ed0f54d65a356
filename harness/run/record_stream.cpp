#include "harness/run/record_stream.h"

#include <algorithm>
#include <utility>

namespace tiltproof::harness {

void ReadPacked(std::span<const std::uint8_t> bytes, RecordSink& sink) {
  Unpacker unpacker(bytes);
  while (!unpacker.empty()) sink.Write(unpacker.Next<Record>());
}

void PartRecords::Write(BootTime at, RecordBody body) {
  if (!origin_.known()) return waiting_(at, body);
  sink_.Write({origin_.SimulationTime(at), record_.client, std::move(body)});
}

void PartRecords::WriteBytes(BootTime begin, link::Direction direction, ByteSide side,
                             std::span<const std::uint8_t> bytes) {
  do {
    const auto piece = bytes.first(std::min(bytes.size(), kBytesMax));
    bytes = bytes.subspan(piece.size());
    if (!origin_.known()) {
      waiting_(begin, RecordBody(record::Bytes{direction, side, {piece.begin(), piece.end()}}));
      continue;
    }
    record_.time_ns = origin_.SimulationTime(begin);
    auto& body = std::get<record::Bytes>(record_.body);
    body.direction = direction;
    body.side = side;
    body.bytes.assign(piece.begin(), piece.end());
    sink_.Write(record_);
  } while (!bytes.empty());
}

void PartRecords::SetOrigin(Origin origin) {
  if (origin_.known() || !origin.known()) return;
  origin_ = origin;
  const Packer waiting = std::exchange(waiting_, {});
  for (Unpacker unpacker(waiting.bytes()); !unpacker.empty();) {
    const auto at = unpacker.Next<BootTime>();
    Write(at, unpacker.Next<RecordBody>());
  }
}

}  // namespace tiltproof::harness
