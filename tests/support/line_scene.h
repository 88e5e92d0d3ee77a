// Random lines in front of a camera, as candidates and as their noisy, broken images.
#pragma once

#include <random>
#include <vector>

#include "plumb/geometry/line_projection.h"
#include "plumb/matching/candidate_line.h"

namespace plumb::testing {

struct LineScene {
  Camera camera{500.0, 500.0, 319.5, 239.5, 640, 480};
  Rigid3 cam_from_world;
  std::vector<CandidateLine> lines;
  std::vector<Segment2> segments;
};

/// Every line is seen as one to three fragments whose ends are off by about `noise_px`; every third
/// segment belongs to no line.
inline LineScene MakeLineScene(int num_lines, unsigned seed, double noise_px = 1.0) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> xy(-1.5, 1.5), z(2.0, 5.0), unit(0.0, 1.0), u(0.0, 639.0),
      v(0.0, 479.0);
  std::normal_distribution<double> noise(0.0, noise_px);
  LineScene scene;
  scene.cam_from_world = {ExpSo3({0.3, -0.2, 0.1}), {0.2, -0.1, 0.4}};
  const Rigid3 world_from_cam = scene.cam_from_world.Inverse();
  for (int i = 0; i < num_lines; ++i) {
    CandidateLine line;
    line.segment_in_world = {world_from_cam * Eigen::Vector3d(xy(rng), xy(rng), z(rng)),
                             world_from_cam * Eigen::Vector3d(xy(rng), xy(rng), z(rng))};
    line.weight = 0.1 + 0.9 * unit(rng);
    line.id = static_cast<uint32_t>(1000 + i);
    scene.lines.push_back(line);
    if (const auto image =
            ProjectSegment(scene.camera, scene.cam_from_world, line.segment_in_world)) {
      const int num_fragments = 1 + i % 3;
      for (int k = 0; k < num_fragments; ++k) {
        const auto disturbed = [&](double at) -> Eigen::Vector2d {
          return image->start + at / num_fragments * image->Delta() +
                 Eigen::Vector2d(noise(rng), noise(rng));
        };
        Segment2 fragment = {disturbed(k + 0.05), disturbed(k + 0.9)};
        if (i % 2 == 1) std::swap(fragment.start, fragment.end);
        scene.segments.push_back(fragment);
      }
    }
    scene.segments.push_back({{u(rng), v(rng)}, {u(rng), v(rng)}});
  }
  return scene;
}

/// What ProjectCandidates() and SegmentTable make of given segments of the image.
inline ProjectedLines AsProjectedLines(const std::vector<Segment2>& images,
                                       const std::vector<float>& weights) {
  // A camera with f = 1 at 1 m: coordinates are pixels.
  std::vector<CandidateLine> lines;
  for (size_t i = 0; i < images.size(); ++i) {
    CandidateLine line;
    line.segment_in_world = {images[i].start.homogeneous(), images[i].end.homogeneous()};
    line.weight = static_cast<double>(weights[i]);
    lines.push_back(line);
  }
  ProjectedLines projected;
  ProjectCandidates({1.0, 1.0, 0.0, 0.0, 10'000, 10'000}, {}, lines, 0.0, &projected);
  return projected;
}

}  // namespace plumb::testing
