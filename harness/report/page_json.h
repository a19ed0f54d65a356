// The JSON that the page reads of a run and of its flights' results (harness/report/page/src): of a report, and of a run
// that is still flown.
//
//   Json json = EntryJson(view, flight);
//   PutResult(json, flight.result);  // when it has no details
#pragma once

#include "harness/report/json_fields.h"
#include "harness/report/run_view.h"

namespace tiltproof::harness {

// One line of the page's table.
Json EntryJson(const RunView& view, const FlightEntry& flight);
// Adds the content of results.json on a flight without files.
void PutResult(Json& json, const FlightResult& result);
Json RunJson(const RunEntry& run);

}  // namespace tiltproof::harness
