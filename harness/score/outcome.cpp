#include "harness/score/outcome.h"

#include <algorithm>

namespace tiltproof::harness {
namespace {

double MetricOr(const Score& score, const char* name, double otherwise) {
  const auto found = score.metrics.find(name);
  return found == score.metrics.end() ? otherwise : found->second;
}

// A firmware that never sent a request did not fly. Of a flight that was not judged, silence says nothing.
bool IsSilentAtTheEnd(const RunLog& log) {
  const auto is_silent = [&](const ClientLog& client) {
    const auto& sent = client.sent_request_times_ns;
    return !sent.empty() && log.end_ns - sent.back() > kSilentNs;
  };
  // Redundant clients that are left fly the vehicle.
  return log.redundancy ? std::ranges::all_of(log.clients, is_silent)
                        : std::ranges::any_of(log.clients, is_silent);
}

}  // namespace

std::string_view Name(Outcome outcome) {
  switch (outcome) {
    case Outcome::kError:
      return "error";
    case Outcome::kCrashed:
      return "crashed";
    case Outcome::kHung:
      return "hung";
    case Outcome::kFailed:
      return "failed";
    case Outcome::kDetected:
      return "detected";
    case Outcome::kDegraded:
      return "degraded";
    case Outcome::kUnaffected:
      return "unaffected";
  }
  return "unknown";
}

Outcome OutcomeOf(const RunLog& log, const Score& score) {
  if (score.verdict == Verdict::kError) return Outcome::kError;
  if (log.end_reason == EndReason::kFirmwareCrashed || log.end_reason == EndReason::kFirmwareLost)
    return Outcome::kCrashed;
  if (log.end_reason == EndReason::kFirmwareHung ||
      (score.verdict != Verdict::kInconclusive && IsSilentAtTheEnd(log)))
    return Outcome::kHung;
  if (score.verdict == Verdict::kFail) return Outcome::kFailed;
  const bool failsafe = std::any_of(log.clients.begin(), log.clients.end(), [](const ClientLog& client) {
    return client.failsafe_entered_count.value_or(0) > 0;
  });
  const bool took_over =
      (log.redundancy && log.redundancy->switches_count > 0) ||
      std::ranges::any_of(log.clients, [](const ClientLog& client) { return client.loss.has_value(); });
  if (score.restarts > 0 || failsafe || took_over) return Outcome::kDetected;
  const double before_m = MetricOr(score, "tracking.rmse_before_faults_m", 0);
  const double since_m = MetricOr(score, "tracking.rmse_since_faults_m", 0);
  if (before_m > 0 && since_m > kDegradedRatio * before_m) return Outcome::kDegraded;
  return Outcome::kUnaffected;
}

}  // namespace tiltproof::harness
