// The main directions of a set of 3D lines: walls, edges of furniture.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/search/search_line.h"

namespace plumb {

struct DirectionCluster {
  Eigen::Vector3f direction = Eigen::Vector3f::UnitX();  // unit, sign without meaning
  float weight = 1.0f;                                   // over the heaviest cluster's, 0..1
};

/// Greedy clusters of directions, heaviest first: the line with the heaviest neighbourhood of 5 deg
/// takes that neighbourhood. A line counts with its weight times its length, at most 1 m. Owns its
/// work space; not thread-safe.
class DirectionClusterer {
 public:
  void Cluster(std::span<const SearchLine> lines, size_t max_clusters,
               std::vector<DirectionCluster>* out);

 private:
  /// Adds `weight` to the neighbourhoods of all lines near line `center`.
  void AddNear(size_t center, float weight);

  std::vector<float> x_, y_, z_;  // directions
  std::vector<float> weights_;
  std::vector<float> neighbourhood_;  // weight of the lines near each line that are left
  std::vector<uint8_t> taken_;
};

}  // namespace plumb
