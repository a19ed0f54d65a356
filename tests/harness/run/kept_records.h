// Records in memory, for tests of the parts that write them.
#pragma once

#include <variant>
#include <vector>

#include "harness/run/record.h"

namespace tiltproof::harness {

struct KeptRecords final : RecordSink {
  void Write(const Record& record) override { all.push_back(record); }
  // The bodies of one type, in order.
  template <class T>
  std::vector<T> Of() const {
    std::vector<T> bodies;
    for (const Record& record : all)
      if (const T* body = std::get_if<T>(&record.body)) bodies.push_back(*body);
    return bodies;
  }
  std::vector<Record> all;
};

}  // namespace tiltproof::harness
