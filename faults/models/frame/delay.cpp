#include <algorithm>
#include <cmath>
#include <cstdio>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

// No draw of a heavy tail is longer than this.
constexpr double kDelayMaxMs = 60'000.0;

class Delay : public WireModel {
 public:
  explicit Delay(const Parameters& parameters)
      : mean_ms_(parameters.Number("mean_ms")),
        jitter_ms_(parameters.Number("jitter_ms")),
        distribution_(FromName(parameters.Choice("distribution"))) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const double delay_ms = std::clamp(Draw(context.random), 0.0, kDelayMaxMs);
    chunk.begin_ns += FromSeconds(delay_ms * 1e-3);
    if (context.what != nullptr && delay_ms > 0.0) {
      char text[48];
      std::snprintf(text, sizeof text, "delayed by %.6g ms", delay_ms);
      context.Say(text);
    }
    out.push_back(std::move(chunk));
  }

 private:
  enum class Distribution : std::uint8_t { kConstant, kUniform, kNormal, kPareto };

  static Distribution FromName(std::string_view name) {
    if (name == "uniform") return Distribution::kUniform;
    if (name == "normal") return Distribution::kNormal;
    if (name == "pareto") return Distribution::kPareto;
    return Distribution::kConstant;
  }

  double Draw(Random& random) const {
    switch (distribution_) {
      case Distribution::kConstant:
        return mean_ms_;
      case Distribution::kUniform:
        return mean_ms_ + jitter_ms_ * (2.0 * random.Uniform() - 1.0);
      case Distribution::kNormal:
        return mean_ms_ + jitter_ms_ * random.StandardNormal();
      case Distribution::kPareto: {
        if (mean_ms_ <= 0.0 || jitter_ms_ <= 0.0) return mean_ms_;
        // P(delay > d) = (least / d)^shape has mean least shape / (shape - 1) and standard deviation
        // mean / sqrt(shape (shape - 2)).
        const double ratio = mean_ms_ / jitter_ms_;
        const double shape = 1.0 + std::sqrt(1.0 + ratio * ratio);
        const double least_ms = mean_ms_ * (shape - 1.0) / shape;
        return least_ms * std::pow(1.0 - random.Uniform(), -1.0 / shape);
      }
    }
    return mean_ms_;
  }

  double mean_ms_;
  double jitter_ms_;
  Distribution distribution_;
};

}  // namespace

FaultType FrameDelay() {
  return {.name = "frame.delay",
          .summary = "Holds frames back for a fixed or random time.",
          .semantics =
              "Models a radio, a gateway or a busy sender between the two ends. Every frame that the "
              "trigger picks enters the line later, by a delay that is drawn for it alone. Frames keep "
              "their order: a frame that would overtake another one waits behind it. With `constant`, the "
              "delay is `mean_ms`. With `uniform`, all values within `jitter_ms` of `mean_ms` are equally "
              "likely. With `normal` and `pareto`, the delay has the mean `mean_ms` and the standard "
              "deviation `jitter_ms`. A negative draw counts as 0, and a draw beyond 60 s as 60 s. A Pareto "
              "delay has a heavy tail and is never shorter than a minimum, which follows from the two "
              "parameters.",
          .source =
              "Nilsson, Real-Time Control Systems with Delays, Ph.D. thesis, Lund Institute of Technology, "
              "1998; Hemminger, Network Emulation with NetEm, linux.conf.au, 2005 (distributions).",
          .parameters = {{.name = "mean_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 10'000.0,
                          .doc = "mean delay",
                          .example = 3.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic},
                         {.name = "jitter_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 10'000.0,
                          .doc = "spread of the delay; not used by `constant`",
                          .example = 1.0,
                          .default_value = 0.0,
                          .zero = 0.0},
                         {.name = "distribution",
                          .unit = "",
                          .kind = ParameterKind::kChoice,
                          .doc = "distribution of the delay",
                          .example = "uniform",
                          .default_value = "constant",
                          .choices = {"constant", "uniform", "normal", "pareto"}}},
          .kind = WireKind{.wire_layer = WireLayer::kTiming,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Delay>(setup.parameters);
                           }}};
}

}  // namespace tiltproof::faults
