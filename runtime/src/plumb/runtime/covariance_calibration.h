// Calibrates a map's covariance on its own key frames, each refined against the others.
#pragma once

#include <cstddef>

#include "plumb/map/line_map.h"

namespace plumb {

struct CovarianceCalibration {
  double factor = 1.0, growth = 0.0;  // LineMap::covariance_factor, covariance_growth
  size_t num_errors = 0;              // that the two were fitted to
};

/// Fewer errors say nothing: the map's own values are returned.
inline constexpr size_t kMinCalibrationErrors = 8;

/// Refines up to 64 key frames, evenly spaced, from their own poses against the unfused lines of
/// three others: the nearest ones first, then such that are farther and farther away. The squared
/// error over its expectation, e^T C^-1 e / 5.35 (median of a chi-square variable with 6 degrees of
/// freedom), is how much too small the covariance is; factor + growth x distance is fitted to its
/// logarithm by least absolute deviations, which a few wrong poses do not bend. Errors of map and
/// key-frame poses are common to all lines of a frame: its residuals do not show them, other key
/// frames do. Needs no images and no second map; about half a millisecond an error. Deterministic.
/// Source: docs/adr/0010-covariance-from-the-maps-own-key-frames.md.
CovarianceCalibration CalibrateCovariance(const LineMap& map);

}  // namespace plumb
