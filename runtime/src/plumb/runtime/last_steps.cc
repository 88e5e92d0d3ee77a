#include "plumb/runtime/last_steps.h"

#include <algorithm>
#include <cmath>

#include "plumb/runtime/point_solver.h"

namespace plumb {
namespace {

constexpr size_t kMinLocalLines = 20;

// Points that take part in the joint solution lie near to the lines' pose; so many are worth it.
constexpr size_t kMinPoints = 6;

// The joint solution's last word.
constexpr double kLineRobust = 1.0;  // as in the steps before
constexpr int kPolishSteps = 5;

// Of the pairs that are reported as matches.
constexpr AssociationGates kMatchGates{.sigma_px = 2.0, .sigma_sine = 0.05};

}  // namespace

void LastSteps::Begin(const Frame& frame) {
  frame_ = frame;
  local_lines_.clear();
}

bool LastSteps::AlignOnLocalLines(const PosePriorFactor& prior, FineAlignment* alignment) {
  selector_.SelectLocal(frame_.camera, alignment->cam_from_world, &local_lines_);
  if (local_lines_.size() < kMinLocalLines) return false;
  aligner_.Begin(frame_.camera, alignment->cam_from_world, local_lines_, *frame_.segments);
  *alignment = aligner_.Run(alignment->cam_from_world, LocalSchedule(), prior);
  return true;
}

void LastSteps::AlignWithPoints(const PosePriorFactor& prior, FineAlignment* alignment) {
  point_terms_.FindNear(frame_.camera, alignment->cam_from_world, *frame_.point_table, kNearPointPx,
                        &near_rows_);
  if (near_rows_.size() < kMinPoints) return;
  near_points_.AssignRows(*frame_.point_table, near_rows_);
  near_points_.ShareWeights();
  // The aligner still holds the local lines, if there were enough.
  if (local_lines_.size() < kMinLocalLines) {
    const auto& lines = fine_lines_.Near(frame_.camera, alignment->cam_from_world);
    aligner_.Begin(frame_.camera, alignment->cam_from_world, lines, *frame_.segments);
  }
  *alignment = aligner_.Run(alignment->cam_from_world, JointSchedule(), prior, &near_points_);
  alignment->cam_from_world =
      aligner_.Polish(*alignment, kLineRobust, kPolishSteps, prior, near_points_);
}

void LastSteps::SolveOneToOne(FineAlignment* alignment) {
  const Rigid3& pose = alignment->cam_from_world;
  near_observations_.clear();
  point_terms_.FindNear(frame_.camera, pose, *frame_.point_table, kNearPointPx, &near_rows_);
  for (const uint32_t row : near_rows_) near_observations_.push_back(frame_.points[row]);
  AssociateFineLines(pose);
  lines_to_match_.clear();
  for (const CandidateLine& line : fine_lines_.lines()) {
    lines_to_match_.push_back(line.segment_in_world);
  }
  match_candidates_.clear();
  for (const LinePair& pair : pairs_) match_candidates_.push_back({pair.segment, pair.line});
  std::sort(match_candidates_.begin(), match_candidates_.end());
  one_to_one_solver_.Solve(frame_.camera, frame_.segments->segments, lines_to_match_,
                           match_candidates_, near_observations_, LineResidual::kMidpointAngle,
                           &alignment->cam_from_world);
}

void LastSteps::AppendMatches(const Rigid3& cam_from_world, std::vector<LineMatch>* matches) {
  AssociateFineLines(cam_from_world);
  best_pair_.assign(frame_.segments->segments.size(), -1);
  for (size_t p = 0; p < pairs_.size(); ++p) {
    int32_t& best = best_pair_[pairs_[p].segment];
    if (best < 0 || pairs_[p].weight > pairs_[static_cast<size_t>(best)].weight) {
      best = static_cast<int32_t>(p);
    }
  }
  for (size_t s = 0; s < best_pair_.size(); ++s) {
    if (best_pair_[s] < 0) continue;
    const LinePair& pair = pairs_[static_cast<size_t>(best_pair_[s])];
    matches->push_back({.segment = frame_.segments->source[s],
                        .line = fine_lines_.lines()[pair.line].id,
                        .distance_px = std::sqrt(static_cast<double>(pair.square_px2))});
  }
}

void LastSteps::AssociateFineLines(const Rigid3& cam_from_world) {
  const auto& lines = fine_lines_.Near(frame_.camera, cam_from_world);
  ProjectCandidates(frame_.camera, cam_from_world, lines, kMinVisiblePx, &projected_);
  associator_.Associate(projected_, frame_.segments->table, kMatchGates, &pairs_);
}

}  // namespace plumb
