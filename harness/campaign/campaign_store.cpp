#include "harness/campaign/campaign_store.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "harness/report/files.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Version of the tables: increased when a reader of the previous one would misread them.
constexpr int kStoreFormat = 1;
constexpr int kApplicationId = 0x74706331;  // "tpc1", for `file`
// A program that goes on after another one was killed may have to wait for a reader that repairs the file.
constexpr int kPatienceMs = 1000;

constexpr const char* kTables = R"sql(
CREATE TABLE text(id INTEGER PRIMARY KEY, value TEXT NOT NULL UNIQUE);
CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE runs(number INTEGER PRIMARY KEY, seed, scenario INTEGER, firmware INTEGER, verdict INTEGER, end INTEGER,
  criterion INTEGER, time_s REAL, margin REAL, trace_hash, wall_s REAL, signature INTEGER);
CREATE TABLE faults(run INTEGER, position INTEGER, id INTEGER, type INTEGER, place INTEGER, severity REAL, start_s REAL,
  end_s REAL, activations INTEGER, PRIMARY KEY(run, position)) WITHOUT ROWID;
CREATE TABLE criteria(run INTEGER, position INTEGER, name INTEGER, verdict INTEGER, margin REAL,
  PRIMARY KEY(run, position)) WITHOUT ROWID;
CREATE TABLE failures(run INTEGER PRIMARY KEY, signature INTEGER, minimal INTEGER);
CREATE VIEW run AS SELECT number, seed, f.value AS firmware, v.value AS verdict, e.value AS end, c.value AS criterion,
  time_s, margin, CASE typeof(trace_hash) WHEN 'blob' THEN lower(hex(trace_hash)) ELSE trace_hash END AS trace_hash,
  wall_s, s.value AS scenario, g.value AS signature
  FROM runs LEFT JOIN text f ON f.id = firmware LEFT JOIN text v ON v.id = verdict LEFT JOIN text e ON e.id = end
  LEFT JOIN text c ON c.id = criterion LEFT JOIN text s ON s.id = scenario LEFT JOIN text g ON g.id = signature;
CREATE VIEW fault AS SELECT run, i.value AS id, t.value AS type, p.value AS place, severity, start_s, end_s, activations
  FROM faults LEFT JOIN text i ON i.id = faults.id LEFT JOIN text t ON t.id = type LEFT JOIN text p ON p.id = place;
CREATE VIEW criterion AS SELECT run, n.value AS name, v.value AS verdict, margin
  FROM criteria LEFT JOIN text n ON n.id = name LEFT JOIN text v ON v.id = verdict;
CREATE VIEW failure AS SELECT s.value AS signature, run, m.value AS minimal
  FROM failures LEFT JOIN text s ON s.id = signature LEFT JOIN text m ON m.id = minimal;
)sql";

// A table that campaigns of older versions lack.
constexpr const char* kLaterTables = R"sql(
CREATE TABLE IF NOT EXISTS confirmations(run INTEGER, client INTEGER, verdict INTEGER, end INTEGER, criterion INTEGER,
  time_s REAL, margin REAL, trace_hash, PRIMARY KEY(run, client)) WITHOUT ROWID;
CREATE VIEW IF NOT EXISTS confirmation AS SELECT run, n.value AS client, v.value AS verdict, e.value AS end,
  c.value AS criterion, time_s, margin,
  CASE typeof(trace_hash) WHEN 'blob' THEN lower(hex(trace_hash)) ELSE trace_hash END AS trace_hash
  FROM confirmations LEFT JOIN text n ON n.id = client LEFT JOIN text v ON v.id = verdict LEFT JOIN text e ON e.id = end
  LEFT JOIN text c ON c.id = criterion;
)sql";

// A hash of 64 bits as lower-case digits takes eight bytes instead of sixteen; any other text stays as it is.
std::optional<std::string> PackedHash(std::string_view text) {
  if (text.size() != 16 || text.find_first_not_of("0123456789abcdef") != std::string_view::npos) return {};
  std::string bytes;
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  for (std::size_t i = 0; i < text.size(); i += 2)
    bytes += static_cast<char>(digit(text[i]) * 16 + digit(text[i + 1]));
  return bytes;
}

std::string HashText(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) text += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return text;
}

[[noreturn]] void Fail(sqlite3* db, const std::filesystem::path& file) {
  const int last_errno = errno;
  const int code = db == nullptr ? SQLITE_NOMEM : sqlite3_errcode(db) & 0xff;
  const std::string name = file.string();
  switch (code) {
    case SQLITE_BUSY:
      throw std::runtime_error(fmt::format(
          "{}: another program writes to this campaign: wait until it has ended, or end it", name));
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
      throw std::runtime_error(fmt::format("{} is no campaign, or is damaged: {}", name, sqlite3_errmsg(db)));
    case SQLITE_FULL:
      throw FileError(fmt::format("{}: the disk is full; what was written before is kept", name));
    default:
      break;
  }
  if (db == nullptr) throw FileError(fmt::format("{}: out of memory", name));
  // SQLite forgets the cause when COMMIT failed.
  const int system = sqlite3_system_errno(db) != 0 ? sqlite3_system_errno(db) : last_errno;
  const bool is_of_system = code == SQLITE_IOERR || code == SQLITE_CANTOPEN;
  throw FileError(
      fmt::format("{}: {}{}", name, sqlite3_errmsg(db),
                  is_of_system && system != 0 ? fmt::format(" ({})", std::strerror(system)) : ""));
}

// A number that is not a whole one of 64 bits with a sign stands as text.
struct Whole {
  std::uint64_t value;
};
struct HashOf {
  const std::string& text;
};

// A prepared statement. A use of it begins with Bind() and ends with Reset(), or with the last row.
class Statement {
 public:
  Statement(sqlite3* db, const std::filesystem::path& file, const char* sql) : db_(db), file_(file) {
    if (sqlite3_prepare_v3(db, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement_, nullptr) != SQLITE_OK)
      Fail(db, file);
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  template <class... Values>
  Statement& Bind(const Values&... values) {
    Reset();
    int place = 0;
    (Put(++place, values), ...);
    return *this;
  }
  // True: there is a row. False: the end, and the statement may be used again.
  bool Step() {
    const int code = sqlite3_step(statement_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) {
      // The reset would replace the cause.
      try {
        Fail(db_, file_);
      } catch (...) {
        sqlite3_reset(statement_);
        throw;
      }
    }
    Reset();
    return false;
  }
  void Reset() { sqlite3_reset(statement_); }

  bool IsNull(int column) { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  bool IsBlob(int column) { return sqlite3_column_type(statement_, column) == SQLITE_BLOB; }
  std::int64_t Integer(int column) { return sqlite3_column_int64(statement_, column); }
  std::uint64_t Unsigned(int column) {
    if (sqlite3_column_type(statement_, column) == SQLITE_INTEGER)
      return static_cast<std::uint64_t>(Integer(column));
    return std::stoull(Text(column));
  }
  double Real(int column) { return sqlite3_column_double(statement_, column); }
  std::optional<double> MaybeReal(int column) {
    return IsNull(column) ? std::nullopt : std::optional(Real(column));
  }
  std::string Text(int column) {
    const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement_, column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
    return bytes == nullptr ? std::string() : std::string(bytes, size);
  }

 private:
  void Put(int place, std::int64_t value) { sqlite3_bind_int64(statement_, place, value); }
  void Put(int place, double value) { sqlite3_bind_double(statement_, place, value); }
  void Put(int place, std::nullopt_t) { sqlite3_bind_null(statement_, place); }
  void Put(int place, Whole whole) {
    if (whole.value <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
      return Put(place, static_cast<std::int64_t>(whole.value));
    Put(place, std::to_string(whole.value));
  }
  void Put(int place, const std::string& text) {
    sqlite3_bind_text64(statement_, place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  }
  template <class T>
  void Put(int place, const std::optional<T>& value) {
    if (value)
      Put(place, *value);
    else
      Put(place, std::nullopt);
  }
  void Put(int place, const HashOf& hash) {
    if (const std::optional<std::string> bytes = PackedHash(hash.text))
      sqlite3_bind_blob64(statement_, place, bytes->data(), bytes->size(), SQLITE_TRANSIENT);
    else
      Put(place, hash.text);
  }

  sqlite3* db_;
  const std::filesystem::path& file_;
  sqlite3_stmt* statement_ = nullptr;
};

// A run's number, as SQLite counts.
std::int64_t Key(std::uint64_t number) {
  Check(number <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()),
        "a campaign has fewer than 2^63 runs");
  return static_cast<std::int64_t>(number);
}

}  // namespace

struct CampaignStore::Impl {
  std::filesystem::path file;
  bool writes;
  sqlite3* db = nullptr;
  // Texts that the tables name by their number.
  std::unordered_map<std::string, std::int64_t> ids;
  std::optional<Statement> find_text, add_text, add_run, add_fault, add_criterion, add_failure;

  Impl(std::filesystem::path path, Mode mode) : file(std::move(path)), writes(mode != Mode::kRead) {
    try {
      Open(mode);
    } catch (...) {
      Close();
      throw;
    }
  }
  ~Impl() { Close(); }

  void Close() {
    for (auto* statement : {&find_text, &add_text, &add_run, &add_fault, &add_criterion, &add_failure})
      statement->reset();
    // With an open transaction in which nothing was written.
    sqlite3_close_v2(db);
    db = nullptr;
  }

  void Execute(const char* sql) {
    if (sqlite3_exec(db, sql, nullptr, nullptr, nullptr) != SQLITE_OK) Fail(db, file);
  }
  Statement Prepare(const char* sql) const { return {db, file, sql}; }
  int Pragma(const char* sql) const {
    Statement statement = Prepare(sql);
    return statement.Step() ? static_cast<int>(statement.Integer(0)) : 0;
  }

  void OpenFile(const std::string& name, int flags) {
    sqlite3_close_v2(std::exchange(db, nullptr));
    if (sqlite3_open_v2(name.c_str(), &db, flags | SQLITE_OPEN_EXRESCODE, nullptr) != SQLITE_OK)
      Fail(db, file);
    sqlite3_busy_timeout(db, kPatienceMs);
  }

  void Open(Mode mode) {
    if (mode != Mode::kCreate && !std::filesystem::exists(file))
      throw FileError(fmt::format("{}: there is no such file", file.string()));
    if (writes) {
      OpenFile(file.string(), SQLITE_OPEN_READWRITE | (mode == Mode::kCreate ? SQLITE_OPEN_CREATE : 0));
      CheckTables(mode);
      Execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL");
      // The lock of a writer is held from now on, and given up only for a moment to write.
      Execute("BEGIN IMMEDIATE");
      if (Pragma("PRAGMA user_version") == 0) Create();
      Execute(kLaterTables);
      Commit();
      PrepareAll();
      return;
    }
    OpenFile(file.string(), SQLITE_OPEN_READONLY);
    try {
      CheckTables(mode);
    } catch (const FileError&) {
      // In a folder that cannot be written to, SQLite reads only what surely is at rest.
      std::filesystem::path log = file;
      if (std::filesystem::exists(log += "-wal")) throw;
      OpenFile(UriOf(file), SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
      CheckTables(mode);
    }
  }

  static std::string UriOf(const std::filesystem::path& path) {
    std::string uri = "file:";
    for (const char c : std::filesystem::absolute(path).string())
      uri += std::string_view("%?#").find(c) == std::string_view::npos
                 ? std::string(1, c)
                 : fmt::format("%{:02x}", static_cast<unsigned char>(c));
    return uri + "?immutable=1";
  }

  void CheckTables(Mode mode) const {
    const int format = Pragma("PRAGMA user_version"), application = Pragma("PRAGMA application_id");
    const bool is_empty =
        format == 0 && application == 0 && Pragma("SELECT count(*) FROM sqlite_master") == 0;
    if (mode == Mode::kCreate && is_empty) return;
    if (is_empty || application != kApplicationId)
      throw std::runtime_error(fmt::format("{} is no campaign", file.string()));
    if (mode == Mode::kCreate)
      throw std::runtime_error(fmt::format("{}: there is a campaign already", file.string()));
    if (format > kStoreFormat)
      throw std::runtime_error(
          fmt::format("{}: written by a newer tiltproof (format {}; this one reads formats up to {})",
                      file.string(), format, kStoreFormat));
  }

  void Create() {
    Execute(kTables);
    Execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", kApplicationId, kStoreFormat)
                .c_str());
    Commit();
  }

  void PrepareAll() {
    find_text.emplace(db, file, "SELECT id FROM text WHERE value = ?");
    add_text.emplace(db, file, "INSERT INTO text(value) VALUES (?)");
    add_run.emplace(db, file, "INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
    add_fault.emplace(db, file, "INSERT INTO faults VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
    add_criterion.emplace(db, file, "INSERT INTO criteria VALUES (?, ?, ?, ?, ?)");
    add_failure.emplace(db, file, "INSERT OR REPLACE INTO failures VALUES (?, ?, ?)");
  }

  void Commit() {
    Execute("COMMIT");
    Execute("BEGIN IMMEDIATE");
  }

  // One transaction.
  template <class Function>
  void Write(const Function& function) {
    Check(writes, "a campaign that is only read is not written to");
    try {
      // After a COMMIT without the next BEGIN.
      if (sqlite3_get_autocommit(db) != 0) Execute("BEGIN IMMEDIATE");
      function();
      Commit();
    } catch (...) {
      ids.clear();
      if (sqlite3_get_autocommit(db) == 0) sqlite3_exec(db, "ROLLBACK", nullptr, nullptr, nullptr);
      sqlite3_exec(db, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr);
      throw;
    }
  }

  // Its number; none for "".
  std::optional<std::int64_t> Id(const std::string& text) {
    if (text.empty()) return {};
    const auto known = ids.find(text);
    if (known != ids.end()) return known->second;
    std::int64_t id = 0;
    if (find_text->Bind(text).Step()) {
      id = find_text->Integer(0);
      find_text->Reset();
    } else {
      add_text->Bind(text).Step();
      id = sqlite3_last_insert_rowid(db);
    }
    ids.emplace(text, id);
    return id;
  }

  void AddRun(const CampaignRun& run) {
    const std::int64_t key = Key(run.number);
    try {
      add_run
          ->Bind(key, Whole{run.seed}, Id(run.scenario), Id(run.firmware), Id(run.verdict), Id(run.end),
                 Id(run.criterion), run.time_s, run.margin, HashOf{run.trace_hash}, run.wall_s,
                 Id(run.signature))
          .Step();
    } catch (const std::exception&) {
      if ((sqlite3_errcode(db) & 0xff) != SQLITE_CONSTRAINT) throw;
      throw std::runtime_error(fmt::format("{}: run {} is there already", file.string(), run.number));
    }
    std::int64_t position = 0;
    for (const CampaignFault& fault : run.faults)
      add_fault
          ->Bind(key, position++, Id(fault.id), Id(fault.type), Id(fault.place), fault.severity,
                 fault.start_s, fault.end_s, fault.activations)
          .Step();
    position = 0;
    for (const CriterionRow& row : run.criteria)
      add_criterion->Bind(key, position++, Id(row.name), Id(row.verdict), row.margin).Step();
  }

  // A reader's view of one moment. A writer sees only its own.
  struct Moment {
    explicit Moment(const Impl& impl) : db(impl.writes ? nullptr : impl.db) {
      if (db != nullptr && sqlite3_exec(db, "BEGIN", nullptr, nullptr, nullptr) != SQLITE_OK)
        Fail(db, impl.file);
    }
    ~Moment() {
      if (db != nullptr) sqlite3_exec(db, "COMMIT", nullptr, nullptr, nullptr);
    }
    Moment(const Moment&) = delete;
    Moment& operator=(const Moment&) = delete;
    sqlite3* db;
  };
};

namespace {

using Texts = std::unordered_map<std::int64_t, std::string>;

std::string TextAt(Statement& row, int column, const Texts& texts) {
  if (row.IsNull(column)) return "";
  const auto found = texts.find(row.Integer(column));
  return found == texts.end() ? "" : found->second;
}

CampaignRun RunAt(Statement& row, const Texts& texts) {
  CampaignRun run;
  run.number = row.Unsigned(0);
  run.seed = row.Unsigned(1);
  int column = 2;
  for (std::string* text : {&run.scenario, &run.firmware, &run.verdict, &run.end, &run.criterion})
    *text = TextAt(row, column++, texts);
  run.time_s = row.MaybeReal(7);
  run.margin = row.MaybeReal(8);
  run.trace_hash = row.IsBlob(9) ? HashText(row.Text(9)) : row.Text(9);
  run.wall_s = row.Real(10);
  run.signature = TextAt(row, 11, texts);
  return run;
}

}  // namespace

// Runs in the order of their numbers.
class CampaignStore::Reader {
 public:
  // From `from` to `to`, both included.
  explicit Reader(const Impl& impl, std::int64_t from = 0,
                  std::int64_t to = std::numeric_limits<std::int64_t>::max())
      : moment_(impl),
        runs_(impl.Prepare("SELECT * FROM runs WHERE number BETWEEN ? AND ? ORDER BY number")),
        faults_(impl.Prepare("SELECT * FROM faults WHERE run BETWEEN ? AND ? ORDER BY run, position")),
        criteria_(impl.Prepare("SELECT * FROM criteria WHERE run BETWEEN ? AND ? ORDER BY run, position")) {
    Statement texts = impl.Prepare("SELECT id, value FROM text");
    while (texts.Step()) texts_.emplace(texts.Integer(0), texts.Text(1));
    has_fault_ = faults_.Bind(from, to).Step();
    has_criterion_ = criteria_.Bind(from, to).Step();
    runs_.Bind(from, to);
  }
  std::optional<CampaignRun> Next() {
    if (!runs_.Step()) return {};
    CampaignRun run = RunAt(runs_, texts_);
    for (; has_fault_ && faults_.Unsigned(0) == run.number; has_fault_ = faults_.Step())
      run.faults.push_back({TextAt(faults_, 2, texts_), TextAt(faults_, 3, texts_),
                            TextAt(faults_, 4, texts_), faults_.Real(5), faults_.Real(6), faults_.Real(7),
                            faults_.Integer(8)});
    for (; has_criterion_ && criteria_.Unsigned(0) == run.number; has_criterion_ = criteria_.Step())
      run.criteria.push_back(
          {TextAt(criteria_, 2, texts_), TextAt(criteria_, 3, texts_), criteria_.MaybeReal(4)});
    return run;
  }

 private:
  Impl::Moment moment_;
  Statement runs_, faults_, criteria_;
  Texts texts_;
  bool has_fault_ = false, has_criterion_ = false;
};

CampaignStore::CampaignStore(std::filesystem::path file, Mode mode)
    : impl_(std::make_unique<Impl>(std::move(file), mode)) {}
CampaignStore::~CampaignStore() = default;

const std::filesystem::path& CampaignStore::file() const { return impl_->file; }

void CampaignStore::Add(std::span<const CampaignRun> runs) {
  impl_->Write([&] {
    for (const CampaignRun& run : runs) impl_->AddRun(run);
  });
}

bool CampaignStore::Has(std::uint64_t number) const {
  return impl_->Prepare("SELECT 1 FROM runs WHERE number = ?").Bind(Key(number)).Step();
}

std::vector<std::uint64_t> CampaignStore::FlownNumbers() const {
  std::vector<std::uint64_t> numbers;
  Statement runs = impl_->Prepare("SELECT number FROM runs ORDER BY number");
  while (runs.Step()) numbers.push_back(runs.Unsigned(0));
  return numbers;
}

std::optional<CampaignRun> CampaignStore::Find(std::uint64_t number) const {
  return Reader(*impl_, Key(number), Key(number)).Next();
}

void CampaignStore::ForEach(const std::function<void(const CampaignRun&)>& visit) const {
  Reader reader(*impl_);
  while (const std::optional<CampaignRun> run = reader.Next()) visit(*run);
}

void CampaignStore::ForEachBeside(
    const CampaignStore& other,
    const std::function<void(const CampaignRun*, const CampaignRun*)>& visit) const {
  Reader own_reader(*impl_), other_reader(*other.impl_);
  std::optional<CampaignRun> a = own_reader.Next(), b = other_reader.Next();
  while (a || b) {
    const bool has_a = a && (!b || a->number <= b->number), has_b = b && (!a || b->number <= a->number);
    visit(has_a ? &*a : nullptr, has_b ? &*b : nullptr);
    if (has_a) a = own_reader.Next();
    if (has_b) b = other_reader.Next();
  }
}

std::uint64_t CampaignStore::Count() const {
  Statement count = impl_->Prepare("SELECT count(*) FROM runs");
  count.Step();
  return count.Unsigned(0);
}

void CampaignStore::SetMeta(const std::string& key, const std::string& value) {
  impl_->Write([&] { impl_->Prepare("INSERT OR REPLACE INTO meta VALUES (?, ?)").Bind(key, value).Step(); });
}

std::optional<std::string> CampaignStore::Meta(const std::string& key) const {
  Statement meta = impl_->Prepare("SELECT value FROM meta WHERE key = ?");
  if (!meta.Bind(key).Step()) return {};
  return meta.Text(0);
}

std::map<std::string, std::string> CampaignStore::AllMeta() const {
  std::map<std::string, std::string> all;
  Statement meta = impl_->Prepare("SELECT key, value FROM meta");
  while (meta.Step()) all.emplace(meta.Text(0), meta.Text(1));
  return all;
}

void CampaignStore::PutFailures(std::span<const CampaignFailure> failures) {
  impl_->Write([&] {
    for (const CampaignFailure& failure : failures)
      impl_->add_failure
          ->Bind(Key(failure.run), impl_->Id(failure.signature),
                 failure.minimal ? impl_->Id(*failure.minimal) : std::nullopt)
          .Step();
  });
}

void CampaignStore::PutConfirmations(std::span<const CampaignConfirmation> confirmations) {
  impl_->Write([&] {
    Statement add = impl_->Prepare("INSERT OR REPLACE INTO confirmations VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
    for (const CampaignConfirmation& found : confirmations)
      add.Bind(Key(found.run), impl_->Id(found.client), impl_->Id(found.verdict), impl_->Id(found.end),
               impl_->Id(found.criterion), found.time_s, found.margin, HashOf{found.trace_hash})
          .Step();
  });
}

std::vector<CampaignConfirmation> CampaignStore::Confirmations() const {
  if (impl_->Pragma("SELECT count(*) FROM sqlite_master WHERE name = 'confirmation'") == 0) return {};
  std::vector<CampaignConfirmation> confirmations;
  Statement rows = impl_->Prepare(
      "SELECT run, client, verdict, end, criterion, time_s, margin, trace_hash FROM confirmation ORDER BY "
      "client, run");
  while (rows.Step()) {
    CampaignConfirmation& found = confirmations.emplace_back();
    found.run = rows.Unsigned(0);
    int column = 1;
    for (std::string* text : {&found.client, &found.verdict, &found.end, &found.criterion})
      *text = rows.Text(column++);
    found.time_s = rows.MaybeReal(5);
    found.margin = rows.MaybeReal(6);
    found.trace_hash = rows.Text(7);
  }
  return confirmations;
}

std::vector<CampaignFailure> CampaignStore::Failures() const {
  std::vector<CampaignFailure> failures;
  Statement rows = impl_->Prepare("SELECT run, signature, minimal FROM failure ORDER BY run");
  while (rows.Step()) {
    CampaignFailure& failure = failures.emplace_back();
    failure.run = rows.Unsigned(0);
    failure.signature = rows.Text(1);
    if (!rows.IsNull(2)) failure.minimal = rows.Text(2);
  }
  return failures;
}

}  // namespace tiltproof::harness
