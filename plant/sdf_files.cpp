#include "plant/sdf_files.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>

namespace tiltproof::plant {
namespace {

using std::filesystem::path;
using tinyxml2::XMLElement;

// A vehicle description is some kilobytes; anything huge is a mistake.
constexpr std::uintmax_t kSdfBytesMax = 16U << 20U;
constexpr std::size_t kModelsMax = 256;

std::string ReadSdfText(const path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw VehicleError(file, 0, "no such file");
  if (!std::filesystem::is_regular_file(file, error)) throw VehicleError(file, 0, "not a file");
  if (std::filesystem::file_size(file, error) > kSdfBytesMax)
    throw VehicleError(file, 0, "larger than 16 MiB");
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// A template becomes SDF by a tool of its owner.
void RefuseTemplate(const path& file, const std::string& text) {
  const std::size_t at = std::min(text.find("{%"), text.find("{{"));
  if (file.extension() != ".jinja" && at == std::string::npos) return;
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(at, text.size()));
  const int line = at == std::string::npos ? 0 : 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
  const path output = file.extension() == ".jinja" ? file.stem() : file.filename();
  throw VehicleError(file, line,
                     fmt::format("a jinja template, not SDF. Convert it with the tool of PX4's "
                                 "sitl_gazebo-classic: `python3 scripts/jinja_gen.py {} {} --output-file {}` "
                                 "(in Debian 12, with the packages python3-jinja2 and python3-numpy)",
                                 file.string(), file.has_parent_path() ? file.parent_path().string() : ".",
                                 output.string()));
}

[[noreturn]] void RefuseUrdf(const path& file, const XMLElement& root) {
  const bool is_xacro = root.Attribute("xmlns:xacro") != nullptr || file.extension() == ".xacro";
  const std::string stem = file.stem().string();
  const std::string command =
      is_xacro ? fmt::format("xacro {0} > {1}.urdf && gz sdf -p {1}.urdf > {1}.sdf", file.string(), stem)
               : fmt::format("gz sdf -p {} > {}.sdf", file.string(), stem);
  throw VehicleError(file, root.GetLineNum(),
                     fmt::format("not an SDF file: the root is <robot>, not <sdf>. Convert this {}: `{}` "
                                 "(in Debian 12, `gz sdf` is `ign sdf` of the packages ignition-tools and "
                                 "libsdformat-dev{})",
                                 is_xacro ? "xacro file" : "URDF file", command,
                                 is_xacro ? "; `xacro` is not in Debian, but in ROS and on PyPI" : ""));
}

// Worlds hold vehicles among other things.
[[noreturn]] void RefuseWorld(const path& file, const XMLElement& world) {
  std::string models;
  for (const auto* e = world.FirstChildElement("include"); e != nullptr; e = e->NextSiblingElement("include"))
    models += fmt::format("{}{}", models.empty() ? "" : ", ", TrimmedText(e->FirstChildElement("uri")));
  for (const auto* e = world.FirstChildElement("model"); e != nullptr; e = e->NextSiblingElement("model"))
    models += fmt::format("{}<model name=\"{}\"> of line {}", models.empty() ? "" : ", ",
                          AttributeOf(*e, "name"), e->GetLineNum());
  throw VehicleError(
      file, world.GetLineNum(),
      fmt::format("a world, which holds no <model> of its own: name the vehicle's own file. The "
                  "world holds: {}",
                  models.empty() ? "no model" : models));
}

std::vector<path> ModelFolders(const path& file) {
  const path folder = file.parent_path().empty() ? path(".") : file.parent_path();
  std::vector<path> folders = {folder / "..", folder};
  for (const char* name :
       {"GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH"}) {
    const char* value = std::getenv(name);
    std::string rest = value == nullptr ? "" : value;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(':'), rest.size());
      if (end > 0) folders.emplace_back(rest.substr(0, end));
      rest.erase(0, std::min(end + 1, rest.size()));
    }
  }
  return folders;
}

// 109 for "1.9"; nullopt when it is not two numbers.
std::optional<int> VersionNumber(std::string_view text) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos) return std::nullopt;
  int major = 0, minor = 0;
  const auto read = [](std::string_view part, int& value) {
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    return error == std::errc() && end == part.data() + part.size() && part.size() < 4 && value >= 0;
  };
  if (!read(text.substr(0, point), major) || !read(text.substr(point + 1), minor)) return std::nullopt;
  return major * 100 + minor;
}

// The file of the newest version that model.config lists, else model.sdf; empty when there is neither.
path FileOfFolder(const path& folder) {
  tinyxml2::XMLDocument config;
  std::error_code error;
  path newest;
  int version_max = -1;
  if (std::filesystem::exists(folder / "model.config", error) &&
      config.LoadFile((folder / "model.config").c_str()) == tinyxml2::XML_SUCCESS &&
      config.RootElement() != nullptr) {
    for (const auto* e = config.RootElement()->FirstChildElement("sdf"); e != nullptr;
         e = e->NextSiblingElement("sdf")) {
      const int version = VersionNumber(AttributeOf(*e, "version")).value_or(0);
      if (version <= version_max) continue;
      version_max = version;
      newest = folder / TrimmedText(e);
    }
  }
  if (newest.empty() && std::filesystem::exists(folder / "model.sdf", error)) newest = folder / "model.sdf";
  return newest;
}

// The file that the uri of an <include> in `file` means.
path FileOfUri(const path& file, const XMLElement& include) {
  const std::string uri = TrimmedText(include.FirstChildElement("uri"));
  if (uri.empty()) throw VehicleError(file, include.GetLineNum(), "<include> has no <uri>");
  std::vector<path> places;
  const path folder = file.parent_path();
  if (constexpr std::string_view kModel = "model://"; uri.starts_with(kModel)) {
    for (const path& each : ModelFolders(file)) places.push_back(each / uri.substr(kModel.size()));
  } else if (constexpr std::string_view kFile = "file://"; uri.starts_with(kFile)) {
    places.push_back(folder / uri.substr(kFile.size()));
  } else if (uri.find("://") != std::string::npos) {
    throw VehicleError(
        file, include.GetLineNum(),
        fmt::format("<uri> '{}': download this model yourself, and name its folder here", uri));
  } else {
    places = {folder / uri, folder / ".." / uri};
  }
  std::string tried;
  for (const path& place : places) {
    std::error_code error;
    if (std::filesystem::is_regular_file(place, error)) return place.lexically_normal();
    if (const path found = FileOfFolder(place); !found.empty()) return found.lexically_normal();
    tried += (tried.empty() ? "" : ", ") + place.lexically_normal().string();
  }
  throw VehicleError(file, include.GetLineNum(),
                     fmt::format("<uri> '{}' is not found; looked for {}. GZ_SIM_RESOURCE_PATH may name "
                                 "further folders",
                                 uri, tried));
}

}  // namespace

std::string AttributeOf(const XMLElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value == nullptr ? std::string() : std::string(value);
}

std::string TrimmedText(const XMLElement* element) {
  const char* text = element == nullptr ? nullptr : element->GetText();
  const std::string_view all = text == nullptr ? "" : text;
  constexpr std::string_view kBlanks = " \t\r\n";
  const std::size_t begin = all.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return std::string(all.substr(begin, all.find_last_not_of(kBlanks) + 1 - begin));
}

std::optional<double> ParseNumber(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || rest != end || std::isnan(value)) return std::nullopt;
  return value;
}

std::vector<std::string> Words(std::string_view text) {
  std::vector<std::string> words;
  std::istringstream in{std::string(text)};
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

SdfFiles::SdfFiles(const path& file) {
  const XMLElement& root = Open(file);
  const std::string version = AttributeOf(root, "version");
  models_.push_back({.file = file,
                     .element = root.FirstChildElement("model"),
                     .version = VersionNumber(version).value_or(109)});
  Gather(models_.front());
}

// The root element of the file.
const XMLElement& SdfFiles::Open(const path& file) {
  const std::string text = ReadSdfText(file);
  RefuseTemplate(file, text);
  documents_.push_back(std::make_unique<tinyxml2::XMLDocument>());
  tinyxml2::XMLDocument& document = *documents_.back();
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    throw VehicleError(
        file, document.ErrorLineNum(),
        fmt::format("not well-formed XML ({})", tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID())));
  }
  const XMLElement* root = document.RootElement();
  if (root != nullptr && std::string_view(root->Name()) == "robot") RefuseUrdf(file, *root);
  if (root == nullptr || std::string_view(root->Name()) != "sdf") {
    throw VehicleError(file, root == nullptr ? 0 : root->GetLineNum(),
                       "not an SDF file: the root is not <sdf>");
  }
  const XMLElement* model = root->FirstChildElement("model");
  if (model == nullptr) {
    if (const auto* world = root->FirstChildElement("world")) RefuseWorld(file, *world);
    throw VehicleError(file, root->GetLineNum(), "holds no <model>");
  }
  if (const auto* second = model->NextSiblingElement("model")) {
    throw VehicleError(file, second->GetLineNum(), "holds a second <model>");
  }
  return *root;
}

void SdfFiles::Gather(const SdfModel& model) {
  for (const auto* e = model.element->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    const std::string_view tag = e->Name();
    const SdfPart part{.element = e, .model = &model, .name = model.scope + AttributeOf(*e, "name")};
    if (tag == "link") links_.push_back(part);
    if (tag == "joint") joints_.push_back(part);
    if (tag == "frame") frames_.push_back(part);
    if (tag == "plugin") plugins_.push_back(part);
    if (tag == "include") Include(model, *e);
    if (tag == "model")
      Nest(model, *e,
           {.file = model.file, .element = e, .pose = e->FirstChildElement("pose"), .version = model.version},
           AttributeOf(*e, "name"), e->BoolAttribute("merge"));
  }
}

void SdfFiles::Include(const SdfModel& around, const XMLElement& include) {
  const path file = FileOfUri(around.file, include);
  const XMLElement& root = Open(file);
  SdfModel model{.file = file,
                 .element = root.FirstChildElement("model"),
                 .pose = include.FirstChildElement("pose"),
                 .version = VersionNumber(AttributeOf(root, "version")).value_or(109)};
  if (model.pose == nullptr) model.pose = model.element->FirstChildElement("pose");
  std::string name = TrimmedText(include.FirstChildElement("name"));
  if (name.empty()) name = AttributeOf(*model.element, "name");
  Nest(around, include, std::move(model), name, include.BoolAttribute("merge"));
  for (const auto* e = include.FirstChildElement("plugin"); e != nullptr; e = e->NextSiblingElement("plugin"))
    plugins_.push_back({.element = e, .model = &around, .name = AttributeOf(*e, "name")});
}

void SdfFiles::Nest(const SdfModel& around, const XMLElement& element, SdfModel nested,
                    const std::string& name, bool merged) {
  if (models_.size() >= kModelsMax)
    throw VehicleError(around.file, element.GetLineNum(),
                       fmt::format("more than {} models; does one include itself?", kModelsMax));
  if (element.Attribute("placement_frame") != nullptr ||
      element.FirstChildElement("placement_frame") != nullptr)
    throw VehicleError(around.file, element.GetLineNum(),
                       "placement_frame is not supported: give the <pose> of the model's own frame");
  if (!merged && name.empty())
    throw VehicleError(around.file, element.GetLineNum(), "a model in a model needs a name");
  nested.around = &around;
  nested.scope = merged ? around.scope : around.scope + name + "::";
  nested.frame = fmt::format("tiltproof_model_{}", models_.size());
  models_.push_back(std::move(nested));
  Gather(models_.back());
}

const SdfPart* SdfFiles::Link(std::string_view name) const {
  const auto found =
      std::find_if(links_.begin(), links_.end(), [&](const SdfPart& p) { return p.name == name; });
  return found == links_.end() ? nullptr : &*found;
}

const SdfPart* SdfFiles::Joint(std::string_view name) const {
  const auto found =
      std::find_if(joints_.begin(), joints_.end(), [&](const SdfPart& p) { return p.name == name; });
  return found == joints_.end() ? nullptr : &*found;
}

const SdfModel* SdfFiles::ModelOf(std::string_view scope) const {
  if (scope.empty()) return nullptr;
  const auto found =
      std::find_if(models_.begin(), models_.end(), [&](const SdfModel& m) { return m.scope == scope; });
  return found == models_.end() ? nullptr : &*found;
}

std::string SdfFiles::CanonicalLink(const SdfModel& model) const {
  const std::string named = AttributeOf(*model.element, "canonical_link");
  if (!named.empty()) return model.scope + named;
  const auto found = std::find_if(links_.begin(), links_.end(),
                                  [&](const SdfPart& p) { return p.name.starts_with(model.scope); });
  return found == links_.end() ? std::string() : found->name;
}

std::string SdfFiles::LinkNamed(const SdfModel& model, const std::string& name) const {
  std::string full = name == "__model__" ? CanonicalLink(model) : model.scope + name;
  for (int i = 0; i < 16 && Link(full) == nullptr; ++i) {
    const auto frame =
        std::find_if(frames_.begin(), frames_.end(), [&](const SdfPart& p) { return p.name == full; });
    if (const SdfModel* nested = ModelOf(full + "::")) {
      full = CanonicalLink(*nested);
    } else if (frame != frames_.end()) {
      const std::string attached = AttributeOf(*frame->element, "attached_to");
      full = attached.empty() ? CanonicalLink(*frame->model) : frame->model->scope + attached;
    } else {
      break;
    }
  }
  return full;
}

std::vector<path> SdfFiles::included() const {
  std::vector<path> files;
  for (const SdfModel& model : models_)
    if (model.file != file() && std::find(files.begin(), files.end(), model.file) == files.end())
      files.push_back(model.file);
  return files;
}

}  // namespace tiltproof::plant
