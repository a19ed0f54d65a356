#include "plant/sdf_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <initializer_list>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <string_view>

#include "plant/sensor_elements.h"

namespace tiltproof::plant {
namespace {

using tinyxml2::XMLElement;

// libsdformat, and the URDF reader that it falls back to, print to std::cerr besides returning errors. While
// one of these lives that text goes here.
class StderrCapture {
 public:
  StderrCapture() : lock_(Mutex()), previous_(std::cerr.rdbuf(text_.rdbuf())) {}
  ~StderrCapture() { std::cerr.rdbuf(previous_); }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> lock_;
  std::ostringstream text_;
  std::streambuf* previous_;
};

// Writes the flat model, and knows the place of each of its lines in the files.
class PlainSdf {
 public:
  PlainSdf(const SdfFiles& files, const std::set<std::string>& hinges);
  const std::string& text() const { return text_; }
  // Line 0 and the vehicle's file for a line without one.
  SdfPlace Place(int line) const;

 private:
  // A copy with its attributes and text, and those children that are in `tags`.
  XMLElement& Copy(const SdfPart& part, const XMLElement& from, XMLElement& to,
                   std::initializer_list<std::string_view> tags);
  void AddModelFrame(const SdfModel& model, XMLElement& to);
  void AddFrame(const SdfPart& frame, XMLElement& to);
  void AddLink(const SdfPart& link, XMLElement& to);
  void AddJoint(const SdfPart& joint, bool is_hinge, XMLElement& to);
  // The pose of the copy relative to the frame that the part means: that of its model, unless it names one.
  void SetPose(const SdfModel& model, XMLElement& copy, bool in_model_frame);
  std::string Frame(const SdfModel& model, const std::string& name) const;
  void FindPlaces(const XMLElement& written, const XMLElement& read);

  const SdfFiles& files_;
  tinyxml2::XMLDocument document_;
  std::map<const XMLElement*, SdfPlace> origins_;
  std::map<int, SdfPlace> places_;
  std::string text_;
};

PlainSdf::PlainSdf(const SdfFiles& files, const std::set<std::string>& hinges) : files_(files) {
  XMLElement& root = *document_.NewElement("sdf");
  root.SetAttribute("version", "1.9");
  document_.InsertEndChild(&root);
  const SdfModel& vehicle = files.models().front();
  XMLElement& model = *root.InsertNewChildElement("model");
  if (const char* name = vehicle.element->Attribute("name")) model.SetAttribute("name", name);
  origins_[&root] = {vehicle.file, files.root().GetLineNum()};
  origins_[&model] = {vehicle.file, vehicle.element->GetLineNum()};
  for (const SdfPart& link : files.links()) AddLink(link, model);
  for (const SdfPart& joint : files.joints()) AddJoint(joint, hinges.contains(joint.name), model);
  for (const SdfPart& frame : files.frames()) AddFrame(frame, model);
  for (const SdfModel& each : files.models())
    if (!each.frame.empty()) AddModelFrame(each, model);
  tinyxml2::XMLPrinter printer;
  document_.Print(&printer);
  text_ = printer.CStr();
  // The lines of what was printed are those that libsdformat names.
  tinyxml2::XMLDocument read;
  if (read.Parse(text_.c_str(), text_.size()) == tinyxml2::XML_SUCCESS) FindPlaces(root, *read.RootElement());
}

void PlainSdf::FindPlaces(const XMLElement& written, const XMLElement& read) {
  if (const auto found = origins_.find(&written); found != origins_.end())
    places_.emplace(read.GetLineNum(), found->second);
  const auto* r = read.FirstChildElement();
  for (const auto* w = written.FirstChildElement(); w != nullptr && r != nullptr;
       w = w->NextSiblingElement()) {
    FindPlaces(*w, *r);
    r = r->NextSiblingElement();
  }
}

SdfPlace PlainSdf::Place(int line) const {
  const auto found = places_.find(line);
  return found == places_.end() ? SdfPlace{files_.file(), 0} : found->second;
}

XMLElement& PlainSdf::Copy(const SdfPart& part, const XMLElement& from, XMLElement& to,
                           std::initializer_list<std::string_view> tags) {
  XMLElement& copy = *to.InsertNewChildElement(from.Name());
  origins_[&copy] = {part.file(), from.GetLineNum()};
  for (const auto* a = from.FirstAttribute(); a != nullptr; a = a->Next())
    copy.SetAttribute(a->Name(), a->Value());
  if (const char* text = from.GetText()) copy.SetText(text);
  for (const auto* e = from.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    if (tags.size() == 0 || std::find(tags.begin(), tags.end(), std::string_view(e->Name())) != tags.end())
      Copy(part, *e, copy, {});
  return copy;
}

// A name of a frame in the model, as the flat model has it.
std::string PlainSdf::Frame(const SdfModel& model, const std::string& name) const {
  if (name == "__model__") return model.frame.empty() ? name : model.frame;
  if (const SdfModel* nested = files_.ModelOf(model.scope + name + "::")) return nested->frame;
  return InnerName(model.scope + name);
}

void PlainSdf::SetPose(const SdfModel& model, XMLElement& copy, bool in_model_frame) {
  XMLElement* pose = copy.FirstChildElement("pose");
  if (pose == nullptr) {
    if (!in_model_frame || model.frame.empty()) return;
    pose = copy.InsertNewChildElement("pose");
    pose->SetText("0 0 0 0 0 0");
  }
  // SDF 1.6 and older say `frame`.
  std::string relative_to = AttributeOf(*pose, "relative_to");
  if (relative_to.empty()) relative_to = AttributeOf(*pose, "frame");
  pose->DeleteAttribute("frame");
  pose->DeleteAttribute("relative_to");
  if (!relative_to.empty())
    pose->SetAttribute("relative_to", Frame(model, relative_to).c_str());
  else if (in_model_frame && !model.frame.empty())
    pose->SetAttribute("relative_to", model.frame.c_str());
}

void PlainSdf::AddModelFrame(const SdfModel& model, XMLElement& to) {
  XMLElement& frame = *to.InsertNewChildElement("frame");
  frame.SetAttribute("name", model.frame.c_str());
  origins_[&frame] = {model.file, model.element->GetLineNum()};
  if (model.pose != nullptr) {
    const SdfPart around{.element = model.pose, .model = model.around, .name = {}};
    Copy(around, *model.pose, frame, {});
  }
  SetPose(*model.around, frame, true);
}

void PlainSdf::AddFrame(const SdfPart& part, XMLElement& to) {
  XMLElement& frame = Copy(part, *part.element, to, {"pose"});
  frame.SetAttribute("name", InnerName(part.name).c_str());
  const std::string attached_to = AttributeOf(frame, "attached_to");
  frame.DeleteAttribute("attached_to");
  if (!attached_to.empty()) frame.SetAttribute("attached_to", Frame(*part.model, attached_to).c_str());
  SetPose(*part.model, frame, attached_to.empty());
}

void PlainSdf::AddLink(const SdfPart& part, XMLElement& to) {
  XMLElement& link = Copy(part, *part.element, to, {"pose", "inertial"});
  link.SetAttribute("name", InnerName(part.name).c_str());
  SetPose(*part.model, link, true);
  if (XMLElement* inertial = link.FirstChildElement("inertial"))
    if (XMLElement* pose = inertial->FirstChildElement("pose")) {
      pose->DeleteAttribute("frame");
      pose->DeleteAttribute("relative_to");
    }
  for (const auto* e = part.element->FirstChildElement("collision"); e != nullptr;
       e = e->NextSiblingElement("collision"))
    SetPose(*part.model, Copy(part, *e, link, {"pose", "geometry"}), false);
  for (const auto* e = part.element->FirstChildElement("sensor"); e != nullptr;
       e = e->NextSiblingElement("sensor"))
    if (IsSensorType(AttributeOf(*e, "type")))
      SetPose(*part.model,
              Copy(part, *e, link,
                   {"pose", "update_rate", "imu", "magnetometer", "air_pressure", "navsat", "gps"}),
              false);
}

void PlainSdf::AddJoint(const SdfPart& part, bool is_hinge, XMLElement& to) {
  const SdfModel& model = *part.model;
  XMLElement& joint = Copy(part, *part.element, to, {"pose", is_hinge ? "axis" : ""});
  joint.SetAttribute("name", InnerName(part.name).c_str());
  joint.SetAttribute("type", is_hinge ? "revolute" : "fixed");
  for (const char* end : {"parent", "child"}) {
    const std::string link = files_.LinkNamed(model, TrimmedText(part.element->FirstChildElement(end)));
    joint.InsertNewChildElement(end)->SetText(InnerName(link).c_str());
  }
  SetPose(model, joint, false);
  XMLElement* axis = joint.FirstChildElement("axis");
  XMLElement* xyz = axis == nullptr ? nullptr : axis->FirstChildElement("xyz");
  if (xyz == nullptr) return;
  // SDF 1.4 means the model's frame, 1.5 and 1.6 do with use_parent_model_frame, 1.7 says expressed_in.
  const std::string in_model = TrimmedText(axis->FirstChildElement("use_parent_model_frame"));
  std::string expressed_in = AttributeOf(*xyz, "expressed_in");
  if (model.version <= 104 || (model.version <= 106 && (in_model == "1" || in_model == "true" ||
                                                        in_model == "True" || in_model == "TRUE")))
    expressed_in = "__model__";
  if (XMLElement* old = axis->FirstChildElement("use_parent_model_frame")) axis->DeleteChild(old);
  xyz->DeleteAttribute("expressed_in");
  if (!expressed_in.empty()) xyz->SetAttribute("expressed_in", Frame(model, expressed_in).c_str());
}

// A character that no name of SDF has by custom, because libsdformat 12 keeps "::" for nested models.
constexpr char kScopeMark = '|';

}  // namespace

std::string InnerName(std::string name) {
  for (std::size_t at = name.find("::"); at != std::string::npos; at = name.find("::", at))
    name.replace(at, 2, 1, kScopeMark);
  return name;
}

std::string OuterName(std::string name) {
  for (std::size_t at = name.find(kScopeMark); at != std::string::npos; at = name.find(kScopeMark, at + 2))
    name.replace(at, 1, "::");
  return name;
}

void LoadSdf(const SdfFiles& files, const std::set<std::string>& hinges, sdf::Root& root,
             std::vector<VehicleProblem>& problems) {
  const PlainSdf plain(files, hinges);
  sdf::Errors errors;
  std::string trouble;
  {
    const StderrCapture capture;
    try {
      errors = root.LoadSdfString(plain.text());
    } catch (const std::exception& error) {
      trouble = error.what();
    }
  }
  const auto is_told = [&problems](const SdfPlace& place) {
    return std::any_of(problems.begin(), problems.end(), [&](const VehicleProblem& problem) {
      return problem.file == place.file && problem.line == place.line;
    });
  };
  if (!trouble.empty() && problems.empty())
    problems.push_back({files.file(), 0, fmt::format("libsdformat cannot read it ({})", trouble)});
  // It stops at the first element that it cannot read, and then names all those around it too.
  const auto is_around = [](const sdf::Error& a, const sdf::Error& b) {
    constexpr std::string_view kReading = "Error reading element";
    return a.Message().starts_with(kReading) && b.Message().starts_with(kReading);
  };
  errors.erase(std::unique(errors.begin(), errors.end(), is_around), errors.end());
  for (const bool has_line : {true, false}) {
    // An error without a line follows from another problem, if there is another one.
    if (!has_line && !problems.empty()) break;
    for (const sdf::Error& error : errors) {
      // LoadVehicle's own error names the reason and the line, and can be waived.
      if (error.Code() == sdf::ErrorCode::LINK_INERTIA_INVALID) continue;
      const SdfPlace place = plain.Place(error.LineNumber().value_or(0));
      if ((place.line > 0) == has_line && !is_told(place))
        problems.push_back({place.file, place.line, OuterName(error.Message())});
    }
  }
}

}  // namespace tiltproof::plant
