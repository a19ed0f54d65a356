#include "link/chunk.h"

namespace tiltproof::link {

std::string_view Name(Direction direction) {
  switch (direction) {
    case Direction::kToPlant:
      return "to_plant";
    case Direction::kToClient:
      return "to_client";
    case Direction::kReference:
      return "reference";
  }
  return "unknown";
}

}  // namespace tiltproof::link
