#pragma once

#include <string>

#include "harness/dds/bus.h"

namespace tiltproof::dds {

inline BusConfig OnDomain(int domain, const std::string& tag = "test") {
  BusConfig config;
  config.domain = domain;
  config.tag = tag;
  return config;
}

}  // namespace tiltproof::dds
