#include "harness/report/trace_csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace tiltproof::harness {

std::string WriteTraceCsv(const Trace& trace) {
  std::string csv = fmt::format("{}\n", fmt::join(trace.columns(), ","));
  std::array<char, 32> number;
  for (std::size_t r = 0; r < trace.row_count(); ++r) {
    bool first = true;
    for (const double value : trace.row(r)) {
      if (!first) csv += ',';
      first = false;
      if (std::isnan(value)) {
        csv += "nan";
        continue;
      }
      const auto end = std::to_chars(number.data(), number.data() + number.size(), value).ptr;
      csv.append(number.data(), static_cast<std::size_t>(end - number.data()));
    }
    csv += '\n';
  }
  return csv;
}

namespace {

// Into `trace`, row by row.
void ReadRows(std::string_view csv, Trace& trace) {
  std::size_t line_number = 0;
  const auto next_line = [&]() -> std::string_view {
    ++line_number;
    const std::size_t end = csv.find('\n');
    if (end == std::string_view::npos)
      throw std::runtime_error(fmt::format("line {}: cut before its end", line_number));
    const std::string_view line = csv.substr(0, end);
    csv.remove_prefix(end + 1);
    return line;
  };
  const auto split = [](std::string_view line) {
    std::vector<std::string_view> cells;
    for (std::size_t begin = 0;;) {
      const std::size_t comma = line.find(',', begin);
      cells.push_back(line.substr(begin, comma - begin));
      if (comma == std::string_view::npos) return cells;
      begin = comma + 1;
    }
  };
  std::vector<std::string> columns;
  for (const std::string_view cell : split(next_line())) columns.emplace_back(cell);
  trace = Trace(std::move(columns));
  std::vector<double> row;
  while (!csv.empty()) {
    const auto cells = split(next_line());
    if (cells.size() != trace.columns().size())
      throw std::runtime_error(fmt::format("line {}: {} values for {} columns", line_number, cells.size(),
                                           trace.columns().size()));
    row.assign(cells.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (cells[c] == "nan") continue;
      const auto [end, error] = std::from_chars(cells[c].data(), cells[c].data() + cells[c].size(), row[c]);
      if (error != std::errc{} || end != cells[c].data() + cells[c].size())
        throw std::runtime_error(fmt::format("line {}: '{}' is not a number (column {})", line_number,
                                             cells[c], trace.columns()[c]));
    }
    std::copy(row.begin(), row.end(), trace.AppendRow().begin());
  }
}

}  // namespace

TracePart ReadTraceCsvPart(std::string_view csv) {
  TracePart part;
  try {
    ReadRows(csv, part.trace);
  } catch (const std::runtime_error& error) {
    part.trouble = error.what();
  }
  return part;
}

Trace ReadTraceCsv(std::string_view csv) {
  Trace trace;
  ReadRows(csv, trace);
  return trace;
}

}  // namespace tiltproof::harness
