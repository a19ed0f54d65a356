// Writes the C header of each protocol, and glue_c.c and glue_cpp.cpp with the tables of header_glue.h.
//
// Usage: header_glue_writer FOLDER
#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "harness/protocol/c_header.h"
#include "header_protocols.h"

namespace tiltproof::harness {
namespace {

std::string Upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string Send(const link::Protocol& protocol) {
  const std::string p = CPrefix(protocol);
  const auto names = CMessageNames(protocol);
  std::string text = fmt::format(
      "static size_t send_{}(int type, const double* values, uint8_t* frame) {{\n  (void)values;\n  switch "
      "(type) {{\n",
      p);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const link::MessageType& type = protocol.messages[i];
    text += fmt::format("    case {}: {{\n", i);
    if (type.fields.empty()) {
      text += fmt::format("      return {}_send_{}(frame);\n    }}\n", p, names[i]);
      continue;
    }
    text += fmt::format("      struct {}_msg_{} message;\n", p, names[i]);
    const auto fields = CFieldNames(type);
    for (std::size_t j = 0; j < fields.size(); ++j)
      text += fmt::format("      message.{} = ({})values[{}];\n", fields[j], CFieldType(type.fields[j]), j);
    text += fmt::format("      return {}_send_{}(&message, frame);\n    }}\n", p, names[i]);
  }
  return text + "  }\n  return 0;\n}\n";
}

std::string Decode(const link::Protocol& protocol) {
  const std::string p = CPrefix(protocol), capitals = Upper(p);
  const auto names = CMessageNames(protocol);
  std::string text = fmt::format(
      "static int decode_{0}(int line, const uint8_t* payload, size_t payload_bytes, int* type, double* "
      "values) {{\n"
      "  enum {0}_type found = {1}_MSG_{2};\n"
      "  enum {0}_status status = {0}_identify((enum {0}_line)line, payload, payload_bytes, &found);\n"
      "  (void)values;\n  if (status != {1}_OK) return (int)status;\n  *type = (int)found;\n  switch (found) "
      "{{\n",
      p, capitals, Upper(names.front()));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const link::MessageType& type = protocol.messages[i];
    text += fmt::format("    case {}_MSG_{}: {{\n", capitals, Upper(names[i]));
    if (type.fields.empty()) {
      text += fmt::format("      return (int){}_decode_{}(payload, payload_bytes);\n    }}\n", p, names[i]);
      continue;
    }
    text += fmt::format(
        "      struct {0}_msg_{1} message;\n      status = {0}_decode_{1}(payload, payload_bytes, "
        "&message);\n"
        "      if (status != {2}_OK) return (int)status;\n",
        p, names[i], capitals);
    const auto fields = CFieldNames(type);
    for (std::size_t j = 0; j < fields.size(); ++j)
      text += fmt::format("      values[{}] = (double)message.{};\n", j, fields[j]);
    text += "      return 0;\n    }\n";
  }
  return text + "  }\n  return (int)status;\n}\n";
}

std::string Reader(const link::Protocol& protocol) {
  return fmt::format(
      "static struct {0}_reader reader_{0};\n"
      "static void reset_{0}(void) {{ {0}_reset(&reader_{0}); }}\n"
      "static size_t take_{0}(uint8_t byte, const uint8_t** payload) {{\n"
      "  *payload = reader_{0}.bytes;\n  return {0}_take(&reader_{0}, byte);\n}}\n",
      CPrefix(protocol));
}

std::string Glue(const std::vector<link::Protocol>& protocols, std::string_view table) {
  std::string includes = "#include \"header_glue.h\"\n", functions, rows;
  for (const link::Protocol& protocol : protocols) {
    const std::string p = CPrefix(protocol);
    includes += fmt::format("#include \"{}.h\"\n", p);
    functions += Send(protocol) + Decode(protocol) + Reader(protocol);
    rows += fmt::format(
        "    {{\"{0}\", {1}_FRAME_ROOM({1}_LONGEST_PAYLOAD), send_{2}, reset_{2}, take_{2}, decode_{2}}},\n",
        protocol.name, Upper(p), p);
  }
  return includes + functions +
         fmt::format("const HeaderGlue {}[] = {{\n{}    {{NULL, 0, NULL, NULL, NULL, NULL}}}};\n", table,
                     rows);
}

void Write(const std::string& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw std::runtime_error(file + ": cannot be written");
}

}  // namespace
}  // namespace tiltproof::harness

int main(int argc, char** argv) {
  using namespace tiltproof::harness;  // NOLINT(google-build-using-namespace)
  if (argc != 2) return std::fprintf(stderr, "usage: header_glue_writer FOLDER\n"), 2;
  const std::string folder = argv[1];
  const auto protocols = HeaderProtocols();
  for (const auto& protocol : protocols) Write(folder + "/" + CPrefix(protocol) + ".h", CHeader(protocol));
  Write(folder + "/glue_c.c", Glue(protocols, "kHeadersInC"));
  Write(folder + "/glue_cpp.cpp", Glue(protocols, "kHeadersInCpp"));
  return 0;
}
