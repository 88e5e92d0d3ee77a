// What adjustments of lines over several views have in common: checks of their input, since Ceres
// aborts the process on misuse, and the solver that eliminates the lines.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

inline bool IsPose(const Rigid3& pose) {
  return pose.IsFinite() && std::abs(pose.rotation.norm() - 1.0) < 1e-3;
}

inline bool IsFinite(const Segment2& segment) {
  return segment.start.allFinite() && segment.end.allFinite();
}

inline bool IsFinite(const Segment3& segment) {
  return segment.start.allFinite() && segment.end.allFinite();
}

inline bool IsPositive(double value) { return std::isfinite(value) && value > 0.0; }

/// A dense solver that eliminates the lines (group 0), silent and in one order of summation. What
/// else the problem has must be added to linear_solver_ordering, as group 1.
inline ceres::Solver::Options EliminateLines(const ceres::Problem& problem,
                                             std::vector<std::array<double, 4>>& deltas,
                                             int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (auto& delta : deltas) {
    if (!problem.HasParameterBlock(delta.data())) continue;
    options.linear_solver_ordering->AddElementToGroup(delta.data(), 0);
  }
  options.max_num_iterations = max_iterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace plumb
