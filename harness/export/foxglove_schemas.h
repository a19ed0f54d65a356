// Foxglove's own types of messages that an export writes, as JSON Schema: Foxglove's 3-D panel draws topics whose schema has
// one of these names.
//
//   mcap.AddTopic({.topic = "/scene", .schema = kSceneUpdate, .schema_data = JsonText(SceneUpdateSchema())});
//
// Names, fields and requirements are Foxglove's (https://docs.foxglove.dev/docs/sdk/schemas, package @foxglove/schemas); a test
// compares them. Its descriptions are left out.
#pragma once

#include "harness/report/json_fields.h"

namespace tiltproof::harness {

inline constexpr const char* kFrameTransform = "foxglove.FrameTransform";
inline constexpr const char* kSceneUpdate = "foxglove.SceneUpdate";

Json FrameTransformSchema();
Json SceneUpdateSchema();

}  // namespace tiltproof::harness
