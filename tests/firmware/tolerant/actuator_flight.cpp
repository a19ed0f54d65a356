#include "tests/firmware/tolerant/actuator_flight.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "firmware/builds.h"
#include "firmware/tolerant/tolerant_control.h"
#include "plant/plant.h"

namespace tiltproof::firmware {
namespace {

constexpr TimeNs kRequestNs = 90 * kNsPerUs;
constexpr TimeNs kReplyNs = 830 * kNsPerUs;
constexpr TimeNs kWireNs = 300 * kNsPerUs;
constexpr TimeNs kTimeoutNs = 2 * kNsPerMs;

plant::VehicleModel LoadOther(double drag_torque) {
  std::ifstream in(TILTPROOF_SOURCE_DIR "/plant/models/tiltrotor.sdf");
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string ratio = "drag_ratio_m=\"0.0178947368\"";
  for (std::size_t at = text.find(ratio); at != std::string::npos; at = text.find(ratio, at + 1)) {
    text.replace(at, ratio.size(), "drag_ratio_m=\"" + std::to_string(0.0178947368 * drag_torque) + "\"");
  }
  const std::string sensors = "<tiltproof:sensors/>";
  text.insert(text.find(sensors), "<tiltproof:drag quadratic_n_s2_m2=\"0.02\"/>");
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("tolerant_flight_" + std::to_string(::getpid()) + ".sdf");
  std::ofstream(file) << text;
  std::vector<std::string> warnings;
  plant::VehicleModel model = plant::LoadVehicle(file, {}, warnings);
  std::filesystem::remove(file);
  return model;
}

class ActuatorFlight {
 public:
  explicit ActuatorFlight(const FlightPlan& plan)
      : plan_(plan),
        model_(LoadOther(plan.drag_torque)),
        plant_(model_, {.step_ns = kModelStepNs, .ground = false}),
        control_(*FindBuild("tolerant")->gain, FindBuild("tolerant")->feed_forward),
        engine_(plan.seed),
        row_(kSensorCount),
        input_(model_.HoverInput().begin(), model_.HoverInput().end()) {
    const Reference start = Path(0);
    plant_.Reset({start.x_m, start.y_m, start.z_m}, {0, 0, 0});
  }

  FlightRecord Run() {
    const auto steps = static_cast<ModelStep>(plan_.duration_s / 0.004);
    for (ModelStep step = 0; step < steps; ++step) Step(step);
    return record_;
  }

 private:
  struct Pending {
    TimeNs at_ns = 0;
    Actuators command;
  };

  Reference Path(double t_s) const {
    const double w = 2 * 3 * std::numbers::pi / 60;
    Reference path{.x_m = 2, .y_m = 0, .z_m = 5};
    if (plan_.spiral) {
      path = {.x_m = static_cast<float>(5 * std::cos(w * t_s) - 3),
              .y_m = static_cast<float>(5 * std::sin(w * t_s)),
              .z_m = static_cast<float>(t_s / 6 + 0.5),
              .vx_m_s = static_cast<float>(-5 * w * std::sin(w * t_s)),
              .vy_m_s = static_cast<float>(5 * w * std::cos(w * t_s)),
              .vz_m_s = 1.0F / 6};
    }
    if (plan_.jumps_from_s > 0 && t_s >= plan_.jumps_from_s && std::fmod(t_s, 10) < 5) {
      path.x_m += 1;
      path.y_m -= 1;
    }
    return path;
  }

  // Twelve uniform numbers less 6: mean 0, variance 1, nearly normal, the same with every library.
  double Noise() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += Uniform();
    return sum;
  }
  double Uniform() { return static_cast<double>(engine_()) * 0x1p-32; }
  bool Lost() { return Uniform() < plan_.drop && now_s_ >= 5; }

  Sensors Sense() {
    static constexpr std::array<double, kSensorCount> kSpread = {
        2e-3, 2e-3, 2e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2, 1e-2, 1e-2, 1e-2, 3e-2, 3e-2};
    plant_.State(row_);
    Sensors sensors;
    for (std::size_t i = 0; i < kSensorCount; ++i) {
      sensors.*kSensorFields[i].in_float =
          static_cast<float>(row_[i] + (plan_.noise ? kSpread[i] * Noise() : 0));
    }
    return sensors;
  }

  void Send(TimeNs now, const std::optional<Actuators>& command) {
    if (command && !Lost()) {
      commands_.push_back({.at_ns = now + kWireNs + plan_.delay_ms * kNsPerMs, .command = *command});
    }
  }

  void Step(ModelStep step) {
    const TimeNs begin = step * kModelStepNs;
    const double t_s = ToSeconds(begin);
    now_s_ = t_s;
    const Reference reference = Path(t_s);
    for (; !commands_.empty() && commands_.front().at_ns <= begin; commands_.erase(commands_.begin())) {
      const Actuators& u = commands_.front().command;
      input_ = {u.f_r_n, u.f_l_n, u.tau_r_nm, u.tau_l_nm};
      in_force_.Command(step, u);
    }
    if (step % 3 == 0) {
      control_.NoteRequest({.origin_ns = 0, .begin_ns = begin, .sent_ns = begin + kRequestNs});
      const Sensors sensors = Sense();
      Observe(step, sensors);
      if (!Lost()) Send(begin + kReplyNs, control_.OnReply(begin + kReplyNs, sensors, reference));
    }
    Send(begin + kTimeoutNs, control_.OnTimeout(begin + kTimeoutNs, reference));
    Note(t_s, reference);

    std::vector<double> input = input_;
    plant_.InputInForce(input);
    Disturbance disturbance;
    disturbance.mass_factor = plan_.mass;
    disturbance.inertia_factor = plan_.inertia;
    if (t_s >= 10) disturbance.wind_m_s = {0, plan_.wind_m_s, 0};
    if (plan_.fault && t_s >= plan_.fault_s) plan_.fault(input, disturbance);
    plant_.Step(input, disturbance);
  }

  // The model under the commands that were in force, from sample to sample.
  void Observe(ModelStep step, const Sensors& sensors) {
    if (!plan_.observe) return;
    const MotionState sample = ToMotion(sensors);
    if (step == 0) {
      in_force_.Begin(0, sample, FindBuild("tolerant")->feed_forward);
      return;
    }
    const MotionState before = in_force_.last_sample();
    plan_.observe(sample, in_force_.At(step), before);
    in_force_.Correct(step, sample);
  }

  void Note(double t_s, const Reference& reference) {
    const ActuatorMonitor& monitor = control_.actuator_monitor();
    const double after_s = t_s - plan_.fault_s;
    const bool jam =
        monitor.stands_still(0) || monitor.stands_still(1) || monitor.jammed(0) || monitor.jammed(1);
    const bool noticed = monitor.acts() || monitor.weak_rotor(0) || monitor.weak_rotor(1);
    if (!plan_.fault || after_s < 0) {
      if (jam || noticed) record_.false_alarm_s = std::min(record_.false_alarm_s, t_s);
    } else {
      if (noticed) record_.noticed_s = std::min(record_.noticed_s, after_s);
      if (jam) record_.jam_noticed_s = std::min(record_.jam_noticed_s, after_s);
    }
    plant_.State(row_);
    if (control_.descends()) {
      if (!plan_.fault || after_s < 0) record_.false_alarm_s = std::min(record_.false_alarm_s, t_s);
      record_.descent_s = std::min(record_.descent_s, after_s);
      if (after_s > record_.descent_s + 3) {
        record_.sink_max_m_s = std::max(record_.sink_max_m_s, -row_[10]);
        record_.climb_max_m_s = std::max(record_.climb_max_m_s, row_[10]);
      }
    }
    if (t_s < 8) return;
    record_.tilt_max_rad =
        std::max(record_.tilt_max_rad, std::acos(std::min(1.0, std::cos(row_[3]) * std::cos(row_[4]))));
    record_.error_max_m =
        std::max(record_.error_max_m,
                 std::hypot(row_[0] - reference.x_m, row_[1] - reference.y_m, row_[2] - reference.z_m));
    record_.lowest_m = std::min(record_.lowest_m, row_[2]);
  }

  FlightPlan plan_;
  plant::VehicleModel model_;
  plant::Plant plant_;
  TolerantControl control_;
  MotionTimeline in_force_;
  std::mt19937 engine_;
  std::vector<double> row_;
  std::vector<double> input_;
  std::vector<Pending> commands_;
  FlightRecord record_;
  double now_s_ = 0;
};

}  // namespace

FlightRecord Fly(const FlightPlan& plan) { return ActuatorFlight(plan).Run(); }

FlightFault WeakRotor(unsigned rotor, double factor) {
  return [=](std::span<double> input, Disturbance&) { input[rotor] *= factor; };
}

FlightFault LessThrust(unsigned rotor, double factor) {
  return [=](std::span<double>, Disturbance& disturbance) { disturbance.thrust_factor[rotor] = factor; };
}

FlightFault JammedServo(unsigned hinge) {
  return [=](std::span<double>, Disturbance& disturbance) { disturbance.hinges[hinge].held = true; };
}

}  // namespace tiltproof::firmware
