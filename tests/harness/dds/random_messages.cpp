#include "tests/harness/dds/random_messages.h"

#include <cmath>
#include <limits>

namespace tiltproof::dds {
namespace {

std::string Id(Random& random, int index) {
  auto id = std::to_string(index);
  id += '-';
  id += random.Text(kIdBytesMax - id.size());
  return id;
}

template <class E>
E Any(Random& random, E last) {
  return static_cast<E>(random.Below(static_cast<std::uint64_t>(last) + 1));
}

std::vector<double> Numbers(Random& random) {
  std::vector<double> numbers(random.Count(kSignalsCountMax));
  for (auto& number : numbers) number = random.Number();
  return numbers;
}
std::vector<std::int64_t> Integers(Random& random) {
  std::vector<std::int64_t> values(random.Count(500));
  for (auto& value : values) value = random.Integer();
  return values;
}

std::vector<Port> Ports(Random& random) {
  std::vector<Port> ports(random.Count(kNamesCountMax));
  for (auto& port : ports) port = {random.Text(kIdBytesMax), random.Text(kPathBytesMax)};
  return ports;
}

std::vector<Chunk> Chunks(Random& random) {
  std::vector<Chunk> chunks(random.Count(20));
  for (auto& chunk : chunks) chunk = {random.Integer(), random.Bytes(200)};
  return chunks;
}

std::string Full(std::size_t bytes) { return std::string(bytes, 'x'); }

}  // namespace

double Random::Number() {
  switch (Below(8)) {
    case 0:
      return 0;
    case 1:
      return -std::numeric_limits<double>::infinity();
    case 2:
      return std::numeric_limits<double>::denorm_min();
    case 3:
      return std::numeric_limits<double>::max();
    default:
      return std::ldexp(static_cast<double>(Integer()), static_cast<int>(Below(200)) - 150);
  }
}

std::size_t Random::Count(std::size_t limit) {
  switch (Below(8)) {
    case 0:
      return 0;
    case 1:
      return limit;
    case 2:
      return 1;
    default:
      return Below(std::min<std::size_t>(limit, 10) + 1);
  }
}

std::string Random::Text(std::size_t bytes_max) {
  std::string text(Count(bytes_max), ' ');
  for (auto& c : text) c = static_cast<char>(1 + Below(255));
  return text;
}

std::vector<std::uint8_t> Random::Bytes(std::size_t count_max) {
  std::vector<std::uint8_t> bytes(Count(count_max));
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(Below(256));
  return bytes;
}

std::vector<std::string> Random::Names() {
  std::vector<std::string> names(Count(kNamesCountMax));
  for (auto& name : names) name = Text(kIdBytesMax);
  return names;
}

template <>
Heartbeat RandomMessage(Random& r, int index) {
  Heartbeat m;
  m.node_id = Id(r, index);
  m.kind = Any(r, NodeKind::kMonitor);
  m.host = r.Text(kIdBytesMax);
  m.pid = r.Integer();
  m.sequence = r.Integer();
  m.run_id = r.Text(kIdBytesMax);
  m.capabilities = r.Names();
  m.version = r.Text(kIdBytesMax);
  return m;
}
template <>
RunScenario RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kDocumentBytesMax), r.Names(), r.Names()};
}
template <>
RunCommand RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Integer(), Any(r, Verb::kRelease), Ports(r)};
}
template <>
RunAck RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Integer(), r.Below(2) == 1, r.Text(kTextBytesMax), Ports(r)};
}
template <>
RunState RandomMessage(Random& r, int index) {
  RunState m;
  m.run_id = Id(r, index);
  m.node_id = r.Text(kIdBytesMax);
  m.phase = Any(r, Phase::kFailed);
  m.time_ns = r.Integer();
  m.origin_ns = r.Integer();
  m.end_reason = r.Text(kIdBytesMax);
  m.text = r.Text(kTextBytesMax);
  return m;
}
template <>
PlantState RandomMessage(Random& r, int index) {
  PlantState m{Id(r, index), r.Integer(), r.Integer(), {}, {}};
  m.state = Numbers(r);
  m.in_force = Numbers(r);
  return m;
}
template <>
Reference RandomMessage(Random& r, int index) {
  Reference m{Id(r, index), r.Text(kIdBytesMax), r.Integer(), r.Integer(), {}};
  m.values = Numbers(r);
  return m;
}
template <>
SerialTap RandomMessage(Random& r, int index) {
  SerialTap m{Id(r, index), r.Text(kIdBytesMax), 1, {}, Integers(r), Integers(r)};
  m.frames.resize(r.Count(30));
  for (auto& frame : m.frames) {
    frame = {r.Integer(), static_cast<std::uint8_t>(r.Below(256)), r.Below(2) == 1, r.Bytes(2000), r.Names()};
  }
  return m;
}
template <>
FaultCommand RandomMessage(Random& r, int index) {
  FaultCommand m{Id(r, index), r.Text(kIdBytesMax), r.Integer(), r.Text(kIdBytesMax), r.Text(kIdBytesMax),
                 {},           r.Integer()};
  m.parameters.resize(r.Count(kNamesCountMax));
  for (auto& parameter : m.parameters) parameter = {r.Text(kIdBytesMax), r.Number()};
  return m;
}
template <>
FaultActivation RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax),   1,         r.Text(kIdBytesMax),
          r.Integer(),  r.Text(kTextBytesMax), Chunks(r), Chunks(r)};
}
template <>
RunEvent RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), 1, r.Integer(), r.Text(kIdBytesMax), r.Text(kTextBytesMax)};
}
template <>
TraceRows RandomMessage(Random& r, int index) {
  TraceRows m{Id(r, index), r.Text(kIdBytesMax), 1, r.Integer(), {}, Integers(r), Integers(r)};
  m.values.resize(r.Count(3000));
  for (auto& value : m.values) value = r.Number();
  return m;
}
template <>
NodeReport RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Bytes(60'000), r.Integer(),
          r.Integer(),  r.Integer(),         r.Integer()};
}
template <>
Score RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Text(kIdBytesMax), r.Text(kTextBytesMax),
          r.Text(kDocumentBytesMax)};
}
template <>
StepRequest RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Integer(), r.Bytes(60'000)};
}
template <>
StepResponse RandomMessage(Random& r, int index) {
  return {Id(r, index), r.Text(kIdBytesMax), r.Integer(), r.Bytes(60'000)};
}

namespace {
const std::string kId = Full(kIdBytesMax);
const std::vector<std::string> kNames(kNamesCountMax, kId);
const std::vector<Port> kPorts(kNamesCountMax, Port{kId, Full(kPathBytesMax)});
const std::vector<std::int64_t> kIntegers(kNumbersCountMax, std::numeric_limits<std::int64_t>::min());
const std::vector<double> kSignals(kSignalsCountMax, 0.1);
const std::vector<std::uint8_t> kPayload(kPayloadBytesMax, 0x7E);
const std::vector<std::uint8_t> kChunkBytes(kChunkBytesMax, 0x7E);
// As many as there may be, the last of them as long as it may be.
std::vector<Chunk> FullChunks() {
  std::vector<Chunk> chunks(kChunksCountMax, Chunk{-1, {1, 2}});
  chunks.back().bytes = kChunkBytes;
  return chunks;
}
}  // namespace

template <>
Heartbeat LargestMessage() {
  return {kId, NodeKind::kMonitor, kId, -1, -1, kId, kNames, kId};
}
template <>
RunScenario LargestMessage() {
  return {kId, Full(kDocumentBytesMax), kNames, kNames};
}
template <>
RunCommand LargestMessage() {
  return {kId, kId, -1, Verb::kRelease, kPorts};
}
template <>
RunAck LargestMessage() {
  return {kId, kId, -1, true, Full(kTextBytesMax), kPorts};
}
template <>
RunState LargestMessage() {
  return {kId, kId, Phase::kFailed, -1, -1, kId, Full(kTextBytesMax)};
}
template <>
PlantState LargestMessage() {
  return {kId, -1, -1, kSignals, kSignals};
}
template <>
Reference LargestMessage() {
  return {kId, kId, -1, -1, kSignals};
}
template <>
SerialTap LargestMessage() {
  SerialTap m{kId, kId, 1, std::vector<TapFrame>(kChunksCountMax), kIntegers, kIntegers};
  m.frames.back() = {-1, 2, true, kChunkBytes, kNames};
  return m;
}
template <>
FaultCommand LargestMessage() {
  return {kId, kId, -1, kId, kId, std::vector<std::pair<std::string, double>>(kNamesCountMax, {kId, 1.5}),
          -1};
}
template <>
FaultActivation LargestMessage() {
  return {kId, kId, 1, kId, -1, Full(kTextBytesMax), FullChunks(), FullChunks()};
}
template <>
RunEvent LargestMessage() {
  return {kId, kId, 1, -1, kId, Full(kTextBytesMax)};
}
template <>
TraceRows LargestMessage() {
  return {kId, kId, 1, -1, std::vector<double>(kNumbersCountMax, 0.1), kIntegers, kIntegers};
}
template <>
NodeReport LargestMessage() {
  return {kId, kId, kPayload, -1, -1, -1, -1};
}
template <>
Score LargestMessage() {
  return {kId, kId, kId, Full(kTextBytesMax), Full(kDocumentBytesMax)};
}
template <>
StepRequest LargestMessage() {
  return {kId, kId, -1, kPayload};
}
template <>
StepResponse LargestMessage() {
  return {kId, kId, -1, kPayload};
}

}  // namespace tiltproof::dds
