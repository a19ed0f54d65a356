// A DDS domain of this machine that no other harness uses.
//
// Runs on one domain are kept apart by their tag, but every participant still talks to every other: many runs
// in one domain slow each other's start. So each harness takes a domain of its own.
//
//   DomainSlot slot;
//   dds::Bus bus({.domain = slot.domain(), .tag = run_id});
//
// The mark of a slot is the name of an abstract unix socket. The kernel frees it when the last process that
// holds it ends, however it ends, and nothing is left on disk.
#pragma once

namespace tiltproof::dds {

class DomainSlot {
 public:
  static constexpr int kFirst = 1;
  static constexpr int kLast = 100;

  // Takes the first free slot. Throws std::runtime_error when all are taken.
  DomainSlot();
  ~DomainSlot();
  DomainSlot(const DomainSlot&) = delete;
  DomainSlot& operator=(const DomainSlot&) = delete;

  // kFirst to kLast.
  int domain() const { return domain_; }

 private:
  int domain_ = 0;
  int socket_ = -1;
};

}  // namespace tiltproof::dds
