#include <fmt/format.h>

#include "harness/cli/commands.h"
