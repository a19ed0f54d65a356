// The rest of example_context.h: of the headers in harness/.

// harness/
using namespace std::chrono_literals;
using link::Direction;
extern const examples::Function Fail, Flip, Handle, Keep, NoteLateness, Report, Send;
extern const harness::Scenario scenario;
extern const link::Protocol& protocol;
extern const plant::VehicleModel model;
extern const VehicleSignals vehicle;
#include <boost/asio/io_context.hpp>
extern boost::asio::io_context& loop;
extern dds::Bus& bus;
extern const dds::Circle members;
extern const std::string run_id, text;
extern const std::filesystem::path folder;
extern const std::vector<std::string> columns, fault_ids;
extern const std::function<void()> wake, on_data;
extern const std::function<void(const std::string&)> on_lost;
extern std::vector<std::uint8_t> bytes;
extern const std::vector<double> row;
extern BootTime now;
extern TimeNs t;
extern std::size_t client;
extern pid_t pid;
extern bool realtime;

// harness/campaign/
extern const VehicleSignals signals;
extern const FlightJob job;
extern const Severity severity;

// harness/campaign/campaign_draw.h
extern const CampaignSpec spec;
extern const DrawBase base;
extern const std::vector<EnvelopeRow> rows;

// harness/campaign/campaign_flights.h
extern const CampaignPlan plan;
extern const FlightMeans means;
bool Keep(const CampaignRun& run);
std::optional<std::uint64_t> NextNumber();

// harness/campaign/campaign_minimiser.h
extern const CampaignPlan plan;
extern const FlightMeans means;
extern const std::vector<std::uint64_t> failing;
extern const std::filesystem::path folder;
extern CampaignStore store;

// harness/campaign/campaign_store.h
extern const std::vector<CampaignRun> runs;

// harness/campaign/campaign_signature.h
extern const CampaignRun run;
extern MinimisedChooser chooser;
extern const examples::Function Use;

// harness/campaign/campaign_summary.h
extern const CampaignFrame frame;
extern const CampaignStore& store;

// harness/campaign/campaign_failures.h
extern CampaignStore& store;
extern const std::filesystem::path folder;
std::optional<MinimalForm> SmallestOf(std::uint64_t run);

// harness/campaign/campaign_tasks.h
extern CampaignStore& store;
extern const std::filesystem::path folder, scratch;

// harness/campaign/campaign_confirm.h
extern const CampaignStore& store;
extern const examples::Function Fly;

// harness/engine/flights_options.h
extern const examples::Function Show, FlyMore;

// harness/cli/slurm.h
extern const examples::Function Wait;

// harness/cli/temporary_folder.h
extern const examples::Function Use;

// harness/campaign/campaign_compare.h
extern const CampaignStore &store, &another;

// harness/campaign/envelope_rows.h
extern const faults::FaultType* type;
extern const Scenario base;

// harness/campaign/broken_flight.h
#include <map>
extern const FlightResult result;
extern std::map<std::string, BrokenFlight> findings;

// harness/campaign/fuzz.h
extern const examples::Function Complain;

// harness/campaign/hostile_sequence.h
extern const Scenario base;

// harness/campaign/why_flights.h
extern const MomentRange range;

// harness/campaign/trials.h
extern const examples::Function Take;

// harness/campaign/search_space.h
extern const std::uint64_t stream;
extern const examples::Function FlyAlone;

// harness/campaign/smallest_failure.h
#include "harness/scenario/reader.h"
extern const Scenario scenario;
std::optional<Flown> Fly(const Scenario& flown);
extern const examples::Function Write;

// harness/scenario/set_keys.h
#include "harness/scenario/reader.h"
extern const ReadOptions options;

// harness/cli/sweep.h
extern const examples::Function Fly;

// harness/cli/sweep_table.h
#include "harness/cli/console.h"
#include "harness/report/files.h"
extern const std::vector<SweepRow> rows;
extern const std::filesystem::path folder;
extern const Console console;

// harness/cli/command_table.h
extern const CLI::App& app;

// harness/cli/protocol_flag.h
extern std::vector<std::uint8_t> payload;

// harness/cli/manual.h
extern const CommandRow program;
extern const examples::Function Write;

// harness/cli/gain_header.h
extern std::ostream& file;
extern const plant::LqrDesign design;
extern const plant::VehicleModel model;

// harness/integrity/frame_sample.h
extern const link::Protocol& protocol;
extern faults::Random random;
extern std::vector<std::uint8_t> damaged;

// harness/integrity/check_group.h
extern const std::vector<std::uint8_t> content;
extern const examples::Function Receive;

// harness/integrity/damager.h
extern const FrameSample sample;
extern const CheckGroup group;
extern faults::Random random;

// harness/cli/session_talk.h
extern const nlohmann::ordered_json hello, ended;
extern ModelCache models;
extern FlightJob job;

// harness/cli/live_page.h
extern const RunOptions options;
extern const FlightMeans means;
extern const RunInfo info;
extern std::vector<FlightJob> jobs;
extern const FlightJob job;
extern const FlightResult result;

// harness/cli/stated_computing.h
#include "harness/cli/commands.h"
extern const FlightMeans means;
extern const SuiteScenario entry;

// harness/cli/run_plan.h
#include "harness/terminal/terminal.h"
extern const RunOptions options;
extern const Suite suite;

// harness/cli/run_record.h
#include "harness/cli/run_flights.h"
extern const RunInfo info;
extern const std::vector<FlightJob> jobs;
extern bool interrupted;

// harness/client/code_place.h
#include <csignal>
extern const siginfo_t* signal;

// harness/client/captured_output.h
extern const examples::Function CallFirmware, log;

// harness/client/firmware_files.h
extern const std::string dialect;

// harness/client/firmware_guard.h
TimeNs grant(BootTime now);

// harness/client/emulator_limits.h
extern EmulatorProcess board;
extern const TimeNs until, answer_after, now;
extern const std::function<void(const EmulatorMessage&)> on_message;
std::string time_text(TimeNs at);

// harness/client/floating_point.h
extern const examples::Function CallOthers;

// harness/client/line_splitter.h
extern const examples::Function log;
extern std::string_view bytes;

// harness/client/make_client.h
extern ClientHost host;

// harness/client/program_client.h
extern ClientHost host;
extern const ProgramHello hello;

// harness/client/program_process.h
extern const std::function<void(std::string)> on_line;

// harness/client/sanitizer.h
extern const std::string line;

// harness/dds/bus.h
extern struct Loop { void Post(const std::function<void()>& work); } loop;

// harness/dds/messages.h
extern Publisher<RunEvent> publisher;
extern const std::string run;
extern std::int64_t last;

// harness/dds/participant.h
extern const NodeLife node;

// harness/dds/sequence_filter.h
extern const RunEvent message;

// harness/emulator/diagnosis/cpu_state.h
extern EmulatorProcess board;
extern const std::uint32_t code;

// harness/emulator/emulator_process.h
extern std::span<const lockstep::ReceivedByte> bytes;

// harness/emulator/diagnosis/gdb_board.h
extern int socket;
extern const lockstep::UsartStates usarts;

// harness/emulator/bit_flipper.h
extern int socket;

// harness/emulator/gdb_client.h
extern int socket;

// harness/emulator/line_sampler.h
extern TimeNs begin_ns, now_ns;
extern std::uint8_t byte;
extern double sender_bit_ns, receiver_bit_ns, tolerance;

// harness/emulator/diagnosis/post_mortem.h
extern StoppedBoard& board;
extern const ElfSymbols symbols;
extern const SourceLines source;
extern const UsartRoles roles;

// harness/emulator/plugin/block_counts.h
extern qemu_plugin_tb* block;

// harness/emulator/plugin/chip.h
extern Chip chip;
extern const Chip::Options options;
extern void* core_clock;

// harness/emulator/plugin/harness_socket.h
using harness::lockstep::Kind;
extern HarnessSocket socket;
extern const harness::lockstep::Hello hello;

// harness/emulator/plugin/readers.h
extern void* cpu;
extern qemu_plugin_tb* block;

// harness/emulator/plugin/sleep.h
extern void* cpu;

// harness/emulator/plugin/stack_watch.h
extern void* cpu;
extern qemu_plugin_tb* block;
extern const std::vector<WatchedStack> stacks;

// harness/emulator/plugin/turn_limit.h
extern TurnLimit limit;
extern void* cpu;
extern const harness::lockstep::Run run;
void AtLimit(void* cpu, RunOnCpuData data);
void Stop();

// harness/emulator/plugin/turn_sleep.h
extern TurnSleep turn_sleep;
extern const std::int64_t deadline_ns;

// harness/emulator/plugin/usart.h
extern UsartUnit usart;
extern const ClockTree clocks;
extern Dma dma;
extern const UsartUnit::Callbacks callbacks;

// harness/client/board_stacks.h
extern const ElfSymbols symbols;
extern EmulatorProcess board;
extern const lockstep::Event event;
extern const SourceLines source;
void log(const std::string& text);

// harness/emulator/image_stacks.h
extern const ElfSymbols symbols;

// harness/emulator/stack_content.h
extern const std::vector<std::uint8_t> content;
extern const std::uint32_t lowest_pointer, begin;

// harness/emulator/diagnosis/stopped_board.h
extern EmulatorProcess board;
extern const TimeNs now_ns;

// harness/emulator/qmp_client.h
extern int socket;
extern const std::function<void(const std::string&, const std::string&)> on_event;

// harness/emulator/diagnosis/unmodelled_blocks.h
extern const std::uint32_t pc;
extern const SourceLines source;
void log(const std::string& text);

// harness/emulator/usart_rate.h
extern const struct Registers { std::uint32_t brr, cr1, cr3, clock_hz; } registers;
extern double sender_bit_ns;

// harness/emulator/diagnosis/watched_variable.h
extern std::span<const std::uint8_t> bytes;

// harness/engine/forked_futures.h
#include "harness/engine/flight_job.h"
extern const std::shared_ptr<const plant::VehicleModel> model;
extern const Scenario scenario;
extern const FlightMeans means;
extern const std::array<int, 2> pipe_ends;

// harness/engine/trunk.h
extern const std::shared_ptr<const plant::VehicleModel> model;
extern const Scenario scenario;
extern const FlightMeans means;

// harness/engine/engine.h
extern const std::shared_ptr<const plant::VehicleModel> model;

// harness/formula/condition.h
#include "harness/run/row_signals.h"
double ValueOf(std::string_view signal);

// harness/formula/formula.h
extern const std::vector<std::string> signals;

// harness/node/board_reset.h
extern const examples::Function Listen;
extern NodeServices& services;
extern link::SerialPort& port;

// harness/process/cpu_wait.h
extern TimeNs late_after_ns, since_last_ns;

// harness/node/reset_listener.h
extern std::vector<std::uint8_t> pass;

// harness/node/deaf_receiver.h
extern std::span<const std::uint8_t> bytes;
extern TimeNs now;

// harness/node/emulated_board.h
extern NodeServices& services;
extern const BoardWiring wiring;
extern const EmulatedBoard::Callbacks callbacks;

// harness/node/client_ports.h
extern const Ports ports;
extern const NodeOptions options;
extern const Scenario scenario;
extern const std::size_t place;

// harness/node/port_end.h
extern NodeServices& services;
extern Ports ports;
extern const link::ByteLine::Received received;
extern const link::ByteLine::Closed closed;

// harness/node/origin_follower.h
extern NodeClock clock;
extern const dds::PlantState plant_state;
extern const examples::Function Use;

// harness/node/firmware_process.h
extern NodeServices& services;
extern const ChildSpec spec;

// harness/node/firmware_use_watch.h
extern NodeServices& services;

// harness/process/hang_watch.h
extern std::chrono::steady_clock::time_point last_byte, last_byte_there;
extern bool held;

// harness/node/joystick_input.h
extern TimeNs now;

// harness/node/joystick_reference.h
extern const ReferencePoint start;
extern const JoystickAxes axes;
extern TimeNs period_ns;

// harness/process/child_process.h
extern int log_file;
extern struct Loop { void Watch(int descriptor, const std::function<void()>& look = {}); } loop;

// harness/process/own_time.h
bool Answered();
void WaitForAnswer(std::chrono::milliseconds limit);
extern TimeNs limit_ns;

// harness/reference/reference_point.h
#include "harness/reference/trajectory.h"
extern const Trajectory trajectory;

// harness/report/activations_file.h
#include "harness/report/flight_hashes.h"

// harness/report/why_file.h
extern const std::filesystem::path folder;
extern const examples::Function Draw;

// harness/report/build_id.h
#include "harness/report/results.h"
extern RunInfo info;
extern const std::filesystem::path library;

// harness/report/difference.h
#include "harness/terminal/terminal.h"
extern const std::filesystem::path folder_a, folder_b;

// harness/report/decimation.h
extern const std::vector<double> values, times;
void Draw(double time_s, double value);

// harness/report/flight_pack.h
extern const FlightView view;

// harness/report/flight_view.h
extern const FlightResult result;
extern const std::optional<VehicleShape> vehicle;
void Draw(double begin_s, double end_s);

// harness/report/line_frames.h
extern const std::vector<std::uint8_t> content_of_link_bin;
void Show(std::span<const std::uint8_t> sent, const std::vector<LinkRecord>& delivered);

// harness/report/report_page.h
extern const FlightLoader load;

// harness/report/machine.h
extern RunInfo info;

// harness/report/json_fields.h
extern const harness::Restart restart;

// harness/report/outcomes.h
extern const std::filesystem::path golden_folder;
extern const FlightResult result;

// harness/report/files.h
extern const std::string_view bytes;

// harness/report/zstd_bytes.h
extern const std::string_view bytes;
extern const std::size_t kBytesMax;

// harness/report/packed_trace.h
extern const Trace trace;
extern const examples::Function Tell;

// harness/report/trace_file.h
extern const Trace trace;
extern const std::filesystem::path folder;

// harness/export/
#include "harness/export/recorded_flight.h"
#include "harness/report/files.h"
extern NewFile file;
extern const RecordedFlight flight;
extern const examples::Function Declare, Tell;
extern const Trace trace;
extern const TimeNs time_ns;
extern const std::optional<VehicleShape> vehicle;
extern McapWriter mcap;
extern const McapWriter::Topic scene_topic, transforms;

// harness/run/
extern RunLog log;
extern Line& line;
extern PlantServer& server;
extern const PlantServer::Reply reply;
extern RecordSink& sink;
extern const Record record;

// harness/run/future.h
#include "harness/run/flight.h"

// harness/run/arbiter.h
extern std::vector<double> command;
extern const TimeNs time_ns;

// harness/client/computing_time.h
extern const std::vector<faults::DeviceCommand> commands;
extern Origin origin;
extern const BootTime now;

// harness/client/task_delays.h
extern Origin origin;
extern BootTime wake_ns;

// harness/run/client_history.h
extern const TimeNs time_ns;

// harness/run/board_line.h
extern BootTime now, until;
extern std::vector<std::uint8_t> bytes;
void Receive(BootTime arrival, std::span<const std::uint8_t> bytes,
             std::span<const faults::ReceiveMark> marks);

// harness/run/client_channel.h
std::unique_ptr<Client> make_client(std::size_t client, ClientHost host);
extern BootTime horizon;
extern Origin origin;

// harness/run/fault_conditions.h
extern std::vector<faults::FaultEvent> events;

// harness/run/introduction.h
#include "harness/process/child_process.h"
extern dds::Circle circle;

// harness/process/shared_processor.h
extern const examples::Function Wait;

// harness/dds/cdr.h
#include "harness/dds/messages.h"

// harness/live/bus_observer.h
extern const dds::BusConfig bus_config;
extern LiveBoard board;
extern const std::function<void()> changed;
extern const LivePlan plan;
extern const BusObserver::Loader load;
extern const BusObserver::Finisher finish;

// harness/live/live_process.h
extern const LiveOptions options;
extern const std::vector<LivePlan> plans;
extern FlightJob job;
extern const BusPlace place;
extern const std::string entry;
extern std::size_t i;
extern bool flying;
extern const examples::Function Stop;

// harness/live/live_server.h
extern LiveBoard board;
extern const std::string token;
extern const std::function<std::string()> page;

// harness/live/row_ring.h
extern std::size_t flight, columns;
extern RowRing::Cursor cursor;

// harness/report/page_json.h
extern const RunView view;
extern const FlightEntry flight;

// harness/run/log_builder.h
extern const VehicleSignals vehicle;

// harness/run/message_binding.h
extern std::span<const double> row;

// harness/run/message_order.h
extern const link::MessageType& type;
extern std::vector<double> values;
extern const std::span<const std::uint8_t> payload;
extern link::Message message;

// harness/run/message_range.h
extern const examples::Function Warn;

// harness/run/realtime/send_backlog.h
extern const link::LineRate rate;
extern Lateness lateness;

// harness/run/realtime/injection.h
#include "harness/run/realtime/realtime_flight.h"
extern const RealtimeOptions options;
extern Scenario scenario;
extern bool running;
extern TimeNs now, done_until_ns;
extern AddedFault fault;
extern const Injector::Tell tell;

// harness/run/realtime/log_messages.h
extern const dds::Participant harness;
extern TimeNs flown_ns;

// harness/run/realtime/public_log.h
extern const std::vector<Record> records;

// harness/run/realtime/node_order.h
#include "link/overloaded.h"
extern dds::Publisher<dds::FaultCommand> commands;
extern const dds::FaultCommand message;

// harness/run/realtime/run_bus.h
#include "harness/run/realtime/members.h"
extern const RealtimeOptions options;
extern const std::function<void()> wake;
extern const dds::RunCommand command;
extern const Member member;
using SteadyClock = std::chrono::steady_clock;

// harness/run/realtime/ending.h
#include "harness/run/realtime/members.h"
extern Ending ending;
extern Members members;
extern OwnTime::SteadyClock::time_point now;
extern TimeNs sim_ns;

// harness/run/reference_talk.h
extern ReferenceTalk talk;
extern const examples::Function Note;

// harness/run/archive.h
#include "harness/run/remote/protocol.h"
extern RunEvent event;

// harness/run/record_stream.h
extern BootTime now;
extern const Origin origin;

// harness/run/row_signals.h
extern const Trace trace;
extern std::size_t r;

// harness/run/trace.h
extern tiltproof::plant::Plant plant;

// harness/scenario/fault_support.h
extern const ClientSpec client;

// harness/score/
extern const RunLog log;
#include "harness/run/row_signals.h"
extern const Trace trace;

// harness/score/sliding_fold.h
struct Min {
  double operator()(double a, double b) const;
};
extern const std::vector<double> values;
extern double infinity;
extern std::vector<double> lowest;
std::size_t first(std::size_t i);
std::size_t last(std::size_t i);

// harness/terminal/terminal.h
extern const std::runtime_error error;
extern const std::string coloured;

// harness/client/serial_program.h
extern const examples::Function Start;

// harness/client/preload/kernel.h
extern const Trap trap;
extern int descriptor;
extern char* bytes;
extern unsigned long count;

// harness/client/preload/harness_line.h
extern const char* path;
extern ByteSink sink;

// harness/client/preload/threads.h
extern ucontext_t* context;
extern int port;
bool HasBytes(void* port);

// harness/client/preload/ports.h
extern int descriptor;
extern const iovec* parts;
