#include "plumb/matching/candidate_line.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "plumb/geometry/line_projection.h"
#include "plumb/matching/undirected_angle.h"

namespace plumb {

void ProjectedLines::Clear() {
  line.clear();
  for (std::vector<float>* column :
       {&x, &y, &direction_x, &direction_y, &length, &angle, &weight}) {
    column->clear();
  }
}

void ProjectedLines::Reserve(size_t count) {
  line.reserve(count);
  for (std::vector<float>* column :
       {&x, &y, &direction_x, &direction_y, &length, &angle, &weight}) {
    column->reserve(count);
  }
}

void ProjectedLines::Resize(size_t count) {
  line.resize(count);
  for (std::vector<float>* column : {&x, &y, &direction_x, &direction_y, &length, &angle, &weight,
                                     &start_x, &start_y, &start_z, &end_x, &end_y, &end_z}) {
    column->resize(count);
  }
}

void ProjectCandidates(const Camera& camera, const Rigid3& cam_from_world,
                       std::span<const CandidateLine> lines, double min_length_px,
                       ProjectedLines* out) {
  out->Clear();
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  for (size_t i = 0; i < lines.size(); ++i) {
    const Segment3& segment = lines[i].segment_in_world;
    const auto image =
        ProjectSegmentInCam(camera, {rotation * segment.start + cam_from_world.translation,
                                     rotation * segment.end + cam_from_world.translation});
    if (!image) continue;
    const Eigen::Vector2d delta = image->Delta();
    const double length = delta.norm();
    if (!(length > min_length_px)) continue;
    out->line.push_back(static_cast<uint32_t>(i));
    out->x.push_back(static_cast<float>(image->start.x()));
    out->y.push_back(static_cast<float>(image->start.y()));
    out->direction_x.push_back(static_cast<float>(delta.x() / length));
    out->direction_y.push_back(static_cast<float>(delta.y() / length));
    out->length.push_back(static_cast<float>(length));
    out->angle.push_back(UndirectedAngle(delta));
    out->weight.push_back(static_cast<float>(lines[i].weight));
  }
}

double MapVariancePx(const Camera& camera, const Rigid3& cam_from_world,
                     const CandidateLine& line) {
  const Eigen::Vector3d a = cam_from_world * line.segment_in_world.start;
  const Eigen::Vector3d b = cam_from_world * line.segment_in_world.end;
  const Eigen::Vector3d normal = a.cross(b);
  const double length = normal.norm();
  if (!(length > 0.0)) return 0.0;
  const Eigen::Vector3d across = cam_from_world.rotation.conjugate() * (normal / length);
  const auto variance = [&](const Eigen::Matrix3d& covariance, double depth) {
    const double scale = camera.MeanFocal() / std::max(depth, 0.2);
    return scale * scale * across.dot(covariance * across);
  };
  return std::max(variance(line.covariance_start, a.z()), variance(line.covariance_end, b.z()));
}

}  // namespace plumb
