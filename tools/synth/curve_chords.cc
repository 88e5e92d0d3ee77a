#include "tools/synth/curve_chords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace plumb::synth {
namespace {

constexpr int kSteps = 128;

/// The furthest distance of points first..last of a curve from the chord between those two.
double Sagitta(const std::vector<Eigen::Vector2d>& curve, size_t first, size_t last) {
  const Eigen::Vector2d unit = (curve[last] - curve[first]).normalized();
  double furthest = 0.0;
  for (size_t i = first + 1; i < last; ++i) {
    const Eigen::Vector2d d = curve[i] - curve[first];
    furthest = std::max(furthest, std::abs(unit.x() * d.y() - unit.y() * d.x()));
  }
  return furthest;
}

void AppendChords(const std::vector<Eigen::Vector2d>& curve, size_t first, size_t last,
                  double min_length_px, std::vector<Segment2>* chords) {
  if (last - first > 1 && Sagitta(curve, first, last) > kChordTolerancePx) {
    const size_t middle = (first + last) / 2;
    AppendChords(curve, first, middle, min_length_px, chords);
    AppendChords(curve, middle, last, min_length_px, chords);
    return;
  }
  const Segment2 chord{curve[first], curve[last]};
  if (chord.Length() > min_length_px) chords->push_back(chord);
}

}  // namespace

std::vector<Segment2> ChordsInImage(const Rectifier& rectifier, const Segment2& segment,
                                    double min_length_px) {
  if (rectifier.IsIdentity()) return {segment};
  std::vector<Segment2> chords;
  std::vector<Eigen::Vector2d> curve;
  for (int i = 0; i <= kSteps + 1; ++i) {
    const double u = static_cast<double>(i) / kSteps;
    const std::optional<ImagePoint> at =
        i <= kSteps ? rectifier.ToImage(segment.start + u * segment.Delta()) : std::nullopt;
    if (at && rectifier.image_camera().pinhole.Contains(at->px)) {
      curve.push_back(at->px);
      continue;
    }
    if (curve.size() > 1) AppendChords(curve, 0, curve.size() - 1, min_length_px, &chords);
    curve.clear();
  }
  return chords;
}

}  // namespace plumb::synth
