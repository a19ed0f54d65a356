// Names that the examples in headers assume and do not declare (tests/architecture/header_examples.py). Declarations
// after a line `// <header>` hold for the examples of that header; those after `// <folder>/`, for all in it,
// where the header does not declare the same name. They are in the header's namespace.
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace tiltproof::examples {

// A function of the reader's: it takes anything.
struct Function {
  void operator()(auto&&...) const {}
};

// `...` among the alternatives of a std::visit.
struct OtherAlternatives {
  void operator()(const auto&) const;
};

}  // namespace tiltproof::examples

// link/
void Spawn(const std::vector<std::string>& command);
extern const examples::Function Use, log;
#include <boost/asio/io_context.hpp>
extern boost::asio::io_context& loop;
extern std::vector<std::uint8_t> payload, frame;
extern BootTime now;

// link/character.h
extern const BootTime begin;
extern const std::uint8_t byte;

// link/check.h
extern TimeNs now, last_ns_;

// link/disturbance.h
extern const struct Plant {
  void Step(std::span<const double> input, const Disturbance& disturbance) const;
} plant;
extern std::vector<double> input;
extern Disturbance push;

// link/fields.h
struct Restart {
  TimeNs time_ns = 0;
  std::string cause;
  TILTPROOF_FIELDS(time_ns, cause)
};
extern Restart restart, another;
extern const examples::Function Print;

// link/frame.h
extern std::span<const std::uint8_t> received;

// link/framing.h
extern const Framing& framing;
extern std::span<const std::uint8_t> received;

// link/frame_cutter.h
extern std::span<const std::uint8_t> bytes;

// link/named.h
enum class Side { kLeft, kRight };
constexpr std::string_view Name(Side side) { return side == Side::kLeft ? "left" : "right"; }
constexpr Side LastOf(Side) { return Side::kRight; }

// link/overloaded.h
struct Reset {};
struct Hang {};
extern const struct Command { std::variant<Reset, Hang> action; } command;

// link/posix_regex.h
extern const examples::Function Report;
extern std::string_view line;

// link/protocol.h
extern const Protocol& protocol;
extern const examples::Function Answer;
extern std::vector<double> row;

// link/pty.h
extern ByteLine::Received received;
extern ByteLine::Closed closed;

// link/serial_port.h
extern const examples::Function Lost;
extern struct Decoder { void Feed(std::span<const std::uint8_t> bytes); } decoder;

// link/signal_table.h
extern const struct Model { const VehicleSignals& signals() const; } model;
extern std::vector<double> values;

// link/socket_line.h
extern ByteLine::Received received;
extern ByteLine::Closed closed;

// link/termios_baud.h
extern int descriptor;

// link/time.h
extern const BootTime arrival_of_start, arrival;
extern const examples::Function wake_at;
extern const struct Fault { TimeNs start_ns; } fault;

// link/raw_framing.h
#include "link/wire.h"
extern ChunkFilter* filter;

// link/wire.h
extern const Protocol& protocol;
extern ChunkFilter* filter;

// plant/
extern const VehicleModel model;
extern const std::filesystem::path file;
extern std::vector<double> state;
extern std::vector<std::string> warnings;

// faults/
#include "link/overloaded.h"
extern const struct Scenario {
  std::vector<FaultSpec> faults;
  std::uint64_t seed;
  TimeNs duration_ns;
  struct Link {
    std::shared_ptr<const link::Protocol> protocol;
  } link;
} scenario;
extern const FaultSpec spec;
extern const examples::Function At, Kill, Refuse, Report, ResetAt;
extern TimeNs t;

// faults/frame_words.h
extern const examples::Function Complain;

// faults/activity.h
extern const Window window;
extern TimeNs begin, end, wake_at;

// faults/active_time.h
extern const SampleContext& context;

// faults/between_frames.h
extern const WireSetup& wire_setup;
extern const WireContext& wire_context;
extern const link::Chunk& chunk;

// faults/device_command.h
extern const FlipBits flips;
extern const struct Region { std::uint32_t begin, size_bytes; } region;
extern std::map<std::uint32_t, std::uint8_t> memory;

// faults/fault_type.h
std::unique_ptr<SensorModel> MakeBias(const SignalSetup& setup);
extern const FaultType& type;
extern struct FaultsOfWire { void Add(const WireKind& kind); } faults_of_wire;

// faults/frame_edit.h
extern const link::Protocol& protocol;
extern link::Chunk chunk;

// faults/fault_event.h
extern FaultSchedule line_faults, plant_faults;

// faults/field_range.h
#include "faults/random.h"
extern const link::MessageField field;
extern Random random;

// faults/random.h
extern std::uint64_t frame_number;

// plant/sensors.h
extern SensorDraws draws;
extern const BaseMotion motion, later;
extern std::vector<double> row;

// faults/schedule.h
#include "link/wire.h"
using link::Direction, link::Wire;
extern const link::WireConfig config;
extern const link::Protocol& protocol;
extern const BootTime boot_time_of_t0, arrival;
extern std::vector<double> values, input;
extern bool new_command;
extern const struct Plant {
  void Step(std::span<const double> input, const Disturbance& disturbance) const;
} plant;
extern std::vector<std::uint8_t> bytes;
extern std::vector<ReceiveMark> marks;

// faults/signal_choice.h
extern const struct Model { const VehicleSignals& signals() const; } model;

// firmware/
extern const firmware::Build& build;
extern const link::Dialect dialect;
extern firmware::Port& port;
extern std::vector<std::uint8_t> bytes;
extern TimeNs now;
extern const examples::Function Control, Use;

// firmware/examples/nmpc/dynamics.h
extern const Rotorcraft vehicle;
extern const Sizes<2, 2>::State x;
extern const Sizes<2, 2>::Input u;
extern const Disturbance disturbance;

// firmware/examples/nmpc/riccati_qp.h
extern const RiccatiQp<2, 1, 1>::State x_0;

// firmware/examples/nmpc/reference_preview.h
extern const double now_s;
extern const Reference reference;
extern const std::vector<double> lengths_s;

// firmware/examples/nmpc/planner.h
extern const Rotorcraft vehicle;
extern const Options options;
extern const std::vector<double> start;
extern const Disturbance disturbance;
extern const double time_s;
extern const std::vector<PathPoint> path;

// firmware/examples/nmpc/nmpc_law.h
extern const Rotorcraft vehicle;
extern const Options options;
extern const bool rates_in_world;
extern const Compute compute;
extern const firmware::ControlPeriod period;
extern const std::array<float, 16> sensed;
extern const Reference reference;
extern std::array<float, 4> command;

// firmware/failover/role_protocol.h
extern const bool link_good;
extern const Heartbeat received;

// firmware/failover/cross_line.h
extern const Heartbeat heartbeat;
extern const Integrals integrals;
extern RoleProtocol roles;

// firmware/failover/redundant_board.h
extern ControlLaw law;

// firmware/lqr/lqr_application.h
extern const LqrSetup setup;

// firmware/lqr/timed_law.h
extern const LqrSetup setup;
extern const Compute compute;

// firmware/ports/host/host_port.h
extern const TiltproofHost* host;
extern const std::vector<std::uint8_t> frame;

// firmware/lqr/lqr_sensors.h
extern const link::Protocol& protocol;
extern const link::Message message;
extern LqrLaw law;
extern const Reference reference;
extern std::array<float, 4> command;

// firmware/lqr/lqr_law.h
extern const LqrTable table;
extern std::array<float, 12> sensed;
extern const Reference reference;
extern std::array<float, 4> command;

// firmware/messages.h
extern std::vector<std::uint8_t> payload;
extern Sensors sensors;
extern const Dialect dialect;

// firmware/tolerant/accepted_replies.h
extern const Sensors sensors;

// firmware/tolerant/actuator_model.h
extern const Actuators wanted;

// firmware/tolerant/actuator_monitor.h
extern MotionTimeline timeline;
extern const ModelStep step;
extern const MotionState sample;
extern const Actuators wanted;
extern Actuators command;
extern const bool line_is_good;

// firmware/control_activity.h
extern const Reference reference;
extern const ControlItem item;
extern ActuatorWriter writer;

// firmware/tolerant/controlled_descent.h
extern const ActuatorMonitor monitor;
extern ControlLaw law;
extern const Sensors sensors;
extern const Reference reference;
extern const bool needs_more_thrust;
extern Actuators command;

// firmware/tolerant/innovation.h
extern const MotionState sample, predicted, previous_sample;

// firmware/tolerant/lag_estimator.h
extern LagEstimator estimator;
extern MotionTimeline timeline;
extern const ModelStep step;
extern const MotionState sample;

// firmware/tolerant/motion_timeline.h
extern MotionTimeline timeline;
extern const ModelStep step;
extern const MotionState sample, next_sample;
extern const Actuators hover, actuators;

// firmware/tolerant/reply_matcher.h
extern ReplyMatcher matcher;
extern MotionTimeline timeline;
extern const ModelStep step, now_step;
extern const MotionState sample;

// firmware/sensor_reader.h
extern SensorReader reader;

// firmware/tolerant/signal_screen.h
extern const Sensors first_sample, sensed, predicted;

// firmware/tolerant/tolerant_control.h
extern const Gain gain;
extern const Actuators feed_forward;
extern const RequestTimes request;
extern const Sensors sensors;
extern const Reference reference;
extern const examples::Function Send;

// firmware/trigonometry.h
extern const float yaw_rad;

// firmware/tolerant/vector3.h
extern const Matrix3 R_WB;
extern const Vector3 force_B, rate_W;

// firmware/tolerant/vehicle_dynamics.h
extern const Sensors sensors;
extern const Actuators inputs;

// firmware/ports/stm32f4/byte_ring.h
extern std::uint8_t byte;

// firmware/ports/stm32f4/console.h
extern std::uint32_t pc;

// firmware/ports/stm32f4/instruction_count.h
#include "firmware/control_law.h"
extern firmware::ControlLaw law;
extern const Sensors sensors;
extern const Reference reference;

// firmware/ports/stm32f4/other_boards.h
#include "firmware/flight_application.h"
extern firmware::FlightApplication flight_application;
using firmware::Uart;

// firmware/ports/stm32f4/usart_line.h
extern UsartRegisters& usart;
extern ByteRing<kReceiveRingBytes> receive_ring;
extern ByteRing<kTransmitRingBytes> transmit_ring;
extern TiltproofReceiveErrorCounts errors;
extern const std::vector<std::uint8_t> bytes;
using firmware::Uart;

// firmware/ports/stm32f4/run_statistics.h
extern std::vector<std::uint32_t> main_stack;
