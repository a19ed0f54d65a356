// The C header of each protocol against the harness's own encoder and readers: the same bytes for the same values, and the
// same messages out of damaged streams.
#include "harness/protocol/c_header.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>

#include "header_glue.h"
#include "header_protocols.h"

namespace tiltproof::harness {
namespace {

using link::Direction;
using link::MessageField;
using link::MessageStatus;
using link::MessageType;
using link::Protocol;

// TILTPROOF_HEADER_CASES multiplies the cases of a test, for a long run by hand.
int Times() {
  const char* times = std::getenv("TILTPROOF_HEADER_CASES");
  return times == nullptr ? 1 : std::max(1, std::atoi(times));
}

using Random = std::mt19937_64;
double Fraction(Random& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

// A value as the struct of the header can hold it: of its range, beyond it, at a limit of the type, or any bits.
double AnyValue(const MessageField& field, Random& random) {
  const std::string_view type = CFieldType(field);
  if (type.ends_with("_t")) return static_cast<double>(random() >> (64 - 8 * NumberBytes(field.type)));
  double value = 0;
  switch (random() % 8) {
    case 0:
      value = field.scale * (random() % 2 == 0 ? LeastNumber(field.type) : LargestNumber(field.type));
      break;
    case 1:
      value = random() % 2 == 0 ? field.min : field.max;
      break;
    case 2:
      value = field.scale * (std::floor(Fraction(random) * 200) - 100 + 0.5);  // halves are rounded
      break;
    case 3:
      value = random() % 4 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1e300 * (Fraction(random) - 0.5);
      break;
    default:
      value = field.min + (Fraction(random) * 1.1 - 0.05) * (field.max - field.min);
  }
  if (type != "float" || std::isnan(value)) return value;
  if (std::abs(value) > std::numeric_limits<float>::max())
    return std::copysign(std::numeric_limits<double>::infinity(), value);
  return static_cast<double>(static_cast<float>(value));
}

bool Same(double a, double b) { return std::memcmp(&a, &b, sizeof(a)) == 0; }

// A payload that is taken from a line, and what it says.
struct Taken {
  std::vector<std::uint8_t> payload;
  MessageStatus status{};
  int type = -1;
  std::vector<double> values;
};
void ExpectEqual(const Taken& own, const Taken& expected, const std::string& where) {
  ASSERT_EQ(own.payload, expected.payload) << where;
  ASSERT_EQ(own.status, expected.status) << where;
  ASSERT_EQ(own.type, expected.type) << where;
  ASSERT_EQ(own.values.size(), expected.values.size()) << where;
  for (std::size_t i = 0; i < own.values.size(); ++i)
    ASSERT_TRUE(Same(own.values[i], expected.values[i]))
        << where << " field " << i << ": " << own.values[i] << ", expected " << expected.values[i];
}

class HeaderTest : public testing::TestWithParam<const HeaderGlue*> {
 protected:
  // Both get the same bytes on a line and give what they took.
  std::vector<Taken> ByHeader(int line, std::span<const std::uint8_t> bytes) const {
    std::vector<Taken> all;
    glue_->reset();
    for (const std::uint8_t byte : bytes) {
      const std::uint8_t* payload = nullptr;
      const std::size_t size = glue_->take(byte, &payload);
      if (size == 0) continue;
      Taken taken;
      taken.payload.assign(payload, payload + size);
      std::array<double, link::kPayloadBytesMax> values{};
      int type = -1;
      taken.status = static_cast<MessageStatus>(glue_->decode(line, payload, size, &type, values.data()));
      if (taken.status == MessageStatus::kOk) {
        taken.type = type;
        taken.values.assign(
            values.begin(),
            values.begin() + static_cast<std::ptrdiff_t>(
                                 protocol_.messages[static_cast<std::size_t>(type)].fields.size()));
      }
      all.push_back(std::move(taken));
    }
    return all;
  }
  std::vector<Taken> ByHarness(int line, std::span<const std::uint8_t> bytes) const {
    std::vector<Taken> all;
    const auto reader = protocol_.framing->MakeReader();
    while (const auto reading = reader->Next(bytes)) {
      if (!reading->ok || reading->payload.size() > Longest()) continue;  // no message is longer
      Taken taken;
      taken.payload.assign(reading->payload.begin(), reading->payload.end());
      link::Message message;
      taken.status = protocol_.Decode(static_cast<Direction>(line), reading->payload, message);
      if (taken.status == MessageStatus::kOk) {
        taken.type = static_cast<int>(message.type - protocol_.messages.data());
        for (std::size_t i = 0; i < message.values.size(); ++i)
          taken.values.push_back(CFieldType(message.type->fields[i]) == "float"
                                     ? static_cast<double>(static_cast<float>(message.values[i]))
                                     : message.values[i]);
      }
      all.push_back(std::move(taken));
    }
    return all;
  }
  std::size_t Longest() const {
    std::size_t longest = 0;
    for (const MessageType& type : protocol_.messages) longest = std::max(longest, type.payload_bytes);
    return longest;
  }
  std::vector<std::uint8_t> RandomFrame(Random& random) const {
    const MessageType& type = protocol_.messages[random() % protocol_.messages.size()];
    std::vector<double> values;
    for (const MessageField& field : type.fields) values.push_back(AnyValue(field, random));
    return protocol_.framing->Encode(protocol_.Encode(type, values).span());
  }

  const HeaderGlue* glue_ = GetParam();
  const Protocol protocol_ = [this] {
    for (const Protocol& each : HeaderProtocols())
      if (each.name == glue_->protocol) return each;
    throw std::logic_error("a protocol with glue");
  }();
};

TEST_P(HeaderTest, EncodesAndDecodesAsTheHarnessDoes) {
  Random random(1);
  for (int n = 0; n < 600 * Times(); ++n) {
    const std::size_t index = random() % protocol_.messages.size();
    const MessageType& type = protocol_.messages[index];
    std::vector<double> values;
    for (const MessageField& field : type.fields) values.push_back(AnyValue(field, random));
    std::vector<std::uint8_t> frame(glue_->frame_bytes_max);
    frame.resize(glue_->send(static_cast<int>(index), values.data(), frame.data()));
    ASSERT_EQ(frame, protocol_.framing->Encode(protocol_.Encode(type, values).span()))
        << type.name << " " << n;
    const int line = static_cast<int>(type.direction);
    const auto own = ByHeader(line, frame), expected = ByHarness(line, frame);
    ASSERT_EQ(own.size(), 1u) << type.name << " " << n;
    ASSERT_EQ(expected.size(), 1u) << type.name << " " << n;
    ExpectEqual(own.front(), expected.front(), type.name + " " + std::to_string(n));
  }
}

TEST_P(HeaderTest, TakesTheSameMessagesOutOfADamagedStream) {
  Random random(2);
  std::size_t ok_count = 0, refused_count = 0;
  for (int n = 0; n < 100 * Times(); ++n) {
    std::vector<std::uint8_t> stream;
    for (int k = 0; k < 12; ++k) {
      std::vector<std::uint8_t> part = RandomFrame(random);
      if (random() % 5 == 0) {  // a payload of any bytes in a right frame; some begin with an id
        std::vector<std::uint8_t> payload(random() % (Longest() + 20));
        for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(random());
        part = protocol_.framing->Encode(payload);
      }
      const std::uint64_t damage = random() % 8;
      if (damage == 0) part[random() % part.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
      if (damage == 1) part.erase(part.begin() + static_cast<std::ptrdiff_t>(random() % part.size()));
      if (damage == 2) part.resize(random() % part.size());
      const auto special = protocol_.framing->special_bytes();
      if (damage == 3)
        part.insert(part.begin() + static_cast<std::ptrdiff_t>(random() % part.size()),
                    special[random() % special.size()]);
      if (damage == 4)
        for (std::uint64_t i = random() % 300; i > 0; --i)
          part.push_back(random() % 3 == 0 ? special[random() % special.size()]
                                           : static_cast<std::uint8_t>(random()));
      stream.insert(stream.end(), part.begin(), part.end());
    }
    const int line = static_cast<int>(random() % link::kDirectionCount);
    const auto own = ByHeader(line, stream), expected = ByHarness(line, stream);
    ASSERT_EQ(own.size(), expected.size()) << n;
    for (std::size_t i = 0; i < own.size(); ++i) {
      ExpectEqual(own[i], expected[i], std::to_string(n) + " frame " + std::to_string(i));
      ++(own[i].status == MessageStatus::kOk ? ok_count : refused_count);
    }
  }
  EXPECT_GT(ok_count, 0u);
  EXPECT_GT(refused_count, 0u);
}

TEST_P(HeaderTest, RefusesEveryOtherPayloadWithTheSameReason) {
  Random random(3);
  for (int n = 0; n < 500 * Times(); ++n) {
    const MessageType& type = protocol_.messages[random() % protocol_.messages.size()];
    std::vector<double> values;
    for (const MessageField& field : type.fields) values.push_back(AnyValue(field, random));
    const auto payload = protocol_.Encode(type, values);
    std::vector<std::uint8_t> bytes(payload.span().begin(), payload.span().end());
    if (random() % 3 == 0 && !bytes.empty())
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    if (random() % 4 == 0) bytes.resize(random() % (bytes.size() + 3), 0);
    const int line = static_cast<int>(random() % link::kDirectionCount);
    int found = -1;
    std::array<double, link::kPayloadBytesMax> own{};
    const auto status =
        static_cast<MessageStatus>(glue_->decode(line, bytes.data(), bytes.size(), &found, own.data()));
    link::Message message;
    ASSERT_EQ(status, protocol_.Decode(static_cast<Direction>(line), bytes, message))
        << type.name << " " << n;
  }
}

std::vector<const HeaderGlue*> AllGlue() {
  std::vector<const HeaderGlue*> all;
  for (const HeaderGlue* table : {kHeadersInC, kHeadersInCpp})
    for (const HeaderGlue* glue = table; glue->protocol != nullptr; ++glue) all.push_back(glue);
  return all;
}
INSTANTIATE_TEST_SUITE_P(All, HeaderTest, testing::ValuesIn(AllGlue()));

TEST(CHeader, NamesAreIdentifiersThatDiffer) {
  Protocol protocol = HeaderProtocols().back();
  EXPECT_EQ(CPrefix(protocol), "_2_bytes_none");
  EXPECT_EQ(CMessageNames(protocol),
            (std::vector<std::string>{"start", "actuators", "status", "Status_", "long_", "reference"}));
  EXPECT_EQ(CFieldNames(protocol.messages[3]),
            (std::vector<std::string>{"sequence", "time_us", "int_", "x_m"}));
}

}  // namespace
}  // namespace tiltproof::harness
