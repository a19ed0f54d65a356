// The bytes of a message in a log are those that Cyclone DDS sends for it, by the code that idlc made of the IDL.

#include "harness/dds/cdr.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <gtest/gtest.h>

#include <string>

#include "harness/dds/domain_slot.h"
#include "harness/dds/wire.h"
#include "tests/harness/dds/random_messages.h"

namespace tiltproof::dds {
namespace {

// A domain of one process.
class LonelyDomain {
 public:
  LonelyDomain()
      : domain_(dds_create_domain(
            static_cast<dds_domainid_t>(slot_.domain()),
            "<CycloneDDS><Domain id=\"any\"><General><AllowMulticast>false</AllowMulticast><Interfaces>"
            "<NetworkInterface name=\"lo\"/></Interfaces></General></Domain></CycloneDDS>")),
        participant_(dds_create_participant(static_cast<dds_domainid_t>(slot_.domain()), nullptr, nullptr)) {}
  ~LonelyDomain() { dds_delete(domain_); }
  LonelyDomain(const LonelyDomain&) = delete;
  LonelyDomain& operator=(const LonelyDomain&) = delete;

  // The bytes that Cyclone makes of a message.
  template <class T>
  std::string Sent(const T& message) const {
    const dds_entity_t topic =
        dds_create_topic(participant_, &WireOf<T>::Descriptor(), "cdr_test", nullptr, nullptr);
    EXPECT_GT(topic, 0);
    const dds_entity_t reader = dds_create_reader(participant_, topic, nullptr, nullptr);
    const dds_entity_t writer = dds_create_writer(participant_, topic, nullptr, nullptr);
    typename WireOf<T>::Type wire{};
    Arena arena;
    Pack(message, wire, arena);
    EXPECT_EQ(dds_write(writer, &wire), DDS_RETCODE_OK);
    ddsi_serdata* serdata = nullptr;
    dds_sample_info_t info;
    EXPECT_EQ(dds_takecdr(reader, &serdata, 1, &info, DDS_ANY_STATE), 1);
    if (serdata == nullptr) return "";
    std::string bytes(ddsi_serdata_size(serdata), '\0');
    ddsi_serdata_to_ser(serdata, 0, bytes.size(), bytes.data());
    ddsi_serdata_unref(serdata);
    for (const dds_entity_t entity : {writer, reader, topic}) dds_delete(entity);
    return bytes;
  }

 private:
  DomainSlot slot_;
  dds_entity_t domain_, participant_;
};

template <class T>
void ExpectAsSent(const LonelyDomain& domain, const T& message) {
  std::string sent = domain.Sent(message);
  std::string ours = ToCdr(message);
  // Cyclone fills up to a multiple of four bytes, and says in the head by how many.
  ASSERT_GE(sent.size(), 4U);
  const auto filled = static_cast<std::size_t>(sent[3] & 3);
  ASSERT_EQ(sent.size(), ours.size() + filled);
  sent.resize(ours.size());
  sent[3] = 0;
  EXPECT_EQ(sent, ours) << WireOf<T>::Descriptor().m_typename;
}

TEST(Cdr, IsWhatGoesOverTheBus) {
  const LonelyDomain domain;
  Random random(20261123);
  const auto check = [&]<class T>() {
    // Types that a later version may extend are encoded in another way. A log has none of them.
    if constexpr (!std::is_same_v<T, Heartbeat>) {
      ExpectAsSent(domain, T{});
      for (int i = 0; i < 20; ++i) ExpectAsSent(domain, RandomMessage<T>(random, i));
    }
  };
#define TILTPROOF_CHECK(T, ...) check.template operator()<T>();
  TILTPROOF_DDS_TOPICS(TILTPROOF_CHECK)
#undef TILTPROOF_CHECK
}

TEST(Cdr, TheTextOfTheIdlIsWhole) {
  const std::string_view text = IdlText();
  EXPECT_TRUE(text.starts_with("// What the nodes"));
  EXPECT_TRUE(text.ends_with("};\n"));
  EXPECT_NE(text.find("struct PlantState {"), std::string_view::npos);
  // As MCAP wants it: a file that includes nothing.
  EXPECT_EQ(text.find('#'), std::string_view::npos);
}

}  // namespace
}  // namespace tiltproof::dds
