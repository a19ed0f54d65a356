// The signals that criteria and metrics read (harness/run/row_signals.h), over all rows of a trace.
#pragma once

#include <string_view>
#include <vector>

#include "harness/run/row_signals.h"
#include "harness/run/trace.h"
#include "link/time.h"

namespace tiltproof::harness {

// The signal in every row. NaN where the row has no value (nothing sent yet, a broken file). Throws
// std::invalid_argument when the trace lacks a column that is needed.
std::vector<double> ReadSignal(const Trace& trace, std::string_view name);

// Time of every row, from t_s, to the nanosecond. Throws std::invalid_argument when there is no such column
// or time does not increase from row to row.
std::vector<TimeNs> RowTimes(const Trace& trace);

// The value that is "a lot" of a signal (link/signal_table.h). Margins are divided by it, so that the
// robustness of different criteria can be compared.
double SignalScale(const Trace& trace, std::string_view name);

}  // namespace tiltproof::harness
