#include "link/fletcher16.h"
