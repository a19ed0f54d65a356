#include "harness/export/foxglove_schemas.h"

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace tiltproof::harness {
namespace {

using TypeProperties = std::initializer_list<std::pair<const char*, Json>>;

Json ObjectType(const TypeProperties& properties, bool required = true) {
  Json schema = {{"type", "object"}};
  for (const auto& [name, property] : properties) schema["properties"][name] = property;
  if (required)
    for (const auto& [name, property] : properties) schema["required"].push_back(name);
  return schema;
}

Json Titled(std::string_view name, Json schema) {
  schema["title"] = "foxglove." + std::string(name);
  return schema;
}

Json ArrayOf(const Json& items) { return {{"type", "array"}, {"items", items}}; }
Json ChoiceType(int count) {
  Json choices = Json::array();
  for (int value = 0; value < count; ++value) choices.push_back({{"const", value}});
  return {{"oneOf", choices}};
}

Json NumberType() { return {{"type", "number"}}; }
Json BooleanType() { return {{"type", "boolean"}}; }
Json TextType() { return {{"type", "string"}}; }
Json IndexType() { return {{"type", "integer"}, {"minimum", 0}}; }
Json NanosecondsType() { return {{"type", "integer"}, {"minimum", 0}, {"maximum", 999'999'999}}; }
// Foxglove recognises a time and a duration by these titles.
Json TimeType() {
  Json schema = ObjectType({{"sec", IndexType()}, {"nsec", NanosecondsType()}}, false);
  schema["title"] = "time";
  return schema;
}
Json DurationType() {
  Json schema = ObjectType({{"sec", {{"type", "integer"}}}, {"nsec", NanosecondsType()}}, false);
  schema["title"] = "duration";
  return schema;
}

Json TripleType(std::string_view name) {
  return Titled(name, ObjectType({{"x", NumberType()}, {"y", NumberType()}, {"z", NumberType()}}));
}
Json Vector3Type() { return TripleType("Vector3"); }
Json Point3Type() { return TripleType("Point3"); }
Json QuaternionType() {
  return Titled(
      "Quaternion",
      ObjectType({{"x", NumberType()}, {"y", NumberType()}, {"z", NumberType()}, {"w", NumberType()}}));
}
Json PoseType() {
  return Titled("Pose", ObjectType({{"position", Vector3Type()}, {"orientation", QuaternionType()}}));
}
Json ColorType() {
  return Titled(
      "Color",
      ObjectType({{"r", NumberType()}, {"g", NumberType()}, {"b", NumberType()}, {"a", NumberType()}}));
}

Json EntityType() {
  const Json metadata = Titled("KeyValuePair", ObjectType({{"key", TextType()}, {"value", TextType()}}));
  const Json arrow = Titled("ArrowPrimitive", ObjectType({{"pose", PoseType()},
                                                          {"shaft_length", NumberType()},
                                                          {"shaft_diameter", NumberType()},
                                                          {"head_length", NumberType()},
                                                          {"head_diameter", NumberType()},
                                                          {"color", ColorType()}}));
  const Json cube = Titled(
      "CubePrimitive", ObjectType({{"pose", PoseType()}, {"size", Vector3Type()}, {"color", ColorType()}}));
  const Json sphere = Titled(
      "SpherePrimitive", ObjectType({{"pose", PoseType()}, {"size", Vector3Type()}, {"color", ColorType()}}));
  const Json cylinder = Titled("CylinderPrimitive", ObjectType({{"pose", PoseType()},
                                                                {"size", Vector3Type()},
                                                                {"bottom_scale", NumberType()},
                                                                {"top_scale", NumberType()},
                                                                {"color", ColorType()}}));
  const Json line = Titled("LinePrimitive", ObjectType({{"type", Titled("LineType", ChoiceType(3))},
                                                        {"pose", PoseType()},
                                                        {"thickness", NumberType()},
                                                        {"scale_invariant", BooleanType()},
                                                        {"points", ArrayOf(Point3Type())},
                                                        {"color", ColorType()},
                                                        {"colors", ArrayOf(ColorType())},
                                                        {"indices", ArrayOf(IndexType())}}));
  const Json triangles = Titled("TriangleListPrimitive", ObjectType({{"pose", PoseType()},
                                                                     {"points", ArrayOf(Point3Type())},
                                                                     {"color", ColorType()},
                                                                     {"colors", ArrayOf(ColorType())},
                                                                     {"indices", ArrayOf(IndexType())}}));
  const Json text = Titled("TextPrimitive", ObjectType({{"pose", PoseType()},
                                                        {"billboard", BooleanType()},
                                                        {"font_size", NumberType()},
                                                        {"scale_invariant", BooleanType()},
                                                        {"color", ColorType()},
                                                        {"text", TextType()}}));
  Json bytes = TextType();
  bytes["contentEncoding"] = "base64";
  const Json model = Titled("ModelPrimitive", ObjectType({{"pose", PoseType()},
                                                          {"scale", Vector3Type()},
                                                          {"color", ColorType()},
                                                          {"override_color", BooleanType()},
                                                          {"url", TextType()},
                                                          {"media_type", TextType()},
                                                          {"data", bytes}}));
  return Titled("SceneEntity", ObjectType({{"timestamp", TimeType()},
                                           {"frame_id", TextType()},
                                           {"id", TextType()},
                                           {"lifetime", DurationType()},
                                           {"frame_locked", BooleanType()},
                                           {"metadata", ArrayOf(metadata)},
                                           {"arrows", ArrayOf(arrow)},
                                           {"cubes", ArrayOf(cube)},
                                           {"spheres", ArrayOf(sphere)},
                                           {"cylinders", ArrayOf(cylinder)},
                                           {"lines", ArrayOf(line)},
                                           {"triangles", ArrayOf(triangles)},
                                           {"texts", ArrayOf(text)},
                                           {"models", ArrayOf(model)}}));
}

}  // namespace

Json FrameTransformSchema() {
  return Titled("FrameTransform", ObjectType({{"timestamp", TimeType()},
                                              {"parent_frame_id", TextType()},
                                              {"child_frame_id", TextType()},
                                              {"translation", Vector3Type()},
                                              {"rotation", QuaternionType()}}));
}

Json SceneUpdateSchema() {
  const Json deletion =
      Titled("SceneEntityDeletion", ObjectType({{"timestamp", TimeType()},
                                                {"type", Titled("SceneEntityDeletionType", ChoiceType(2))},
                                                {"id", TextType()}}));
  return Titled("SceneUpdate",
                ObjectType({{"deletions", ArrayOf(deletion)}, {"entities", ArrayOf(EntityType())}}));
}

}  // namespace tiltproof::harness
