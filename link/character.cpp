#include "link/character.h"

namespace tiltproof::link {

std::string_view Name(Parity parity) {
  switch (parity) {
    case Parity::kNone:
      return "none";
    case Parity::kEven:
      return "even";
    case Parity::kOdd:
      return "odd";
  }
  return "unknown";
}

std::string Name(const CharacterFormat& format) {
  const char letter = format.parity == Parity::kNone ? 'N' : format.parity == Parity::kEven ? 'E' : 'O';
  return std::to_string(format.data_bits) + letter + std::to_string(format.stop_bits);
}

}  // namespace tiltproof::link
