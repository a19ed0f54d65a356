#include "link/messages.h"
