#include "plumb/matching/segment_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/matching/undirected_angle.h"

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kFarAwayPx = 1e8f;

}  // namespace

size_t SegmentTable::BinOf(float value) {
  const float bin = value * (static_cast<float>(kBins) / kPi);
  return bin > 0.0f ? std::min(static_cast<size_t>(bin), kBins - 1) : 0;
}

void SegmentTable::Assign(std::span<const Segment2> segments) {
  for (std::vector<float>* column :
       {&x0, &y0, &x1, &y1, &direction_x, &direction_y, &length, &angle}) {
    column->clear();
  }
  source.clear();
  for (uint32_t i = 0; i < segments.size(); ++i) {
    if (segments[i].Length() > 1e-6) source.push_back(i);
  }
  unsorted_.resize(segments.size());
  for (const uint32_t i : source) unsorted_[i] = UndirectedAngle(segments[i].Delta());
  std::sort(source.begin(), source.end(), [&](uint32_t a, uint32_t b) {
    return unsorted_[a] != unsorted_[b] ? unsorted_[a] < unsorted_[b] : a < b;
  });
  for (const uint32_t i : source) {
    const Segment2& segment = segments[i];
    const double pixels = segment.Length();
    const Eigen::Vector2d direction = segment.Delta() / pixels;
    x0.push_back(static_cast<float>(segment.start.x()));
    y0.push_back(static_cast<float>(segment.start.y()));
    x1.push_back(static_cast<float>(segment.end.x()));
    y1.push_back(static_cast<float>(segment.end.y()));
    direction_x.push_back(static_cast<float>(direction.x()));
    direction_y.push_back(static_cast<float>(direction.y()));
    length.push_back(static_cast<float>(pixels));
    angle.push_back(unsorted_[i]);
  }
  uint32_t row = 0;
  for (size_t bin = 0; bin <= kBins; ++bin) {
    while (row < angle.size() && (bin == kBins || BinOf(angle[row]) < bin)) ++row;
    bin_begin_[bin] = row;
  }
  for (std::vector<float>* column : {&x0, &y0, &x1, &y1}) {
    column->insert(column->end(), kLanes, kFarAwayPx);
  }
  for (std::vector<float>* column : {&direction_x, &direction_y, &length}) {
    column->insert(column->end(), kLanes, 0.0f);
  }
}

std::array<SegmentTable::Range, 2> SegmentTable::NearAngle(float around, float max_sine) const {
  // A little wider than asked, so that rounding never loses a row; callers test the sine itself.
  return Within(around, max_sine < 1.0f ? std::asin(max_sine) + 1e-4f : kPi);
}

std::array<SegmentTable::Range, 2> SegmentTable::Within(float around, float half) const {
  const uint32_t count = static_cast<uint32_t>(angle.size());
  // Two ranges of whole bins must not meet on the other side.
  if (half >= 0.5f * kPi - 2.0f * kPi / kBins) return {Range{0, count}, Range{}};
  const auto begin = [&](float value) { return bin_begin_[BinOf(value)]; };
  const auto end = [&](float value) { return bin_begin_[BinOf(value) + 1]; };
  const float low = around - half, high = around + half;
  if (low < 0.0f) return {Range{0, end(high)}, Range{begin(low + kPi), count}};
  if (high > kPi) return {Range{0, end(high - kPi)}, Range{begin(low), count}};
  return {Range{begin(low), end(high)}, Range{}};
}

}  // namespace plumb
