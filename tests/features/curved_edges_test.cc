// Straight edges that a lens bends: found as straight segments of the ideal image, as well as
// without the lens.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/features/lsd_detector.h"
#include "plumb/features/segment_refiner.h"
#include "plumb/features/segment_ridge.h"
#include "plumb/features/straighten.h"
#include "plumb/geometry/rectifier.h"
#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::DistanceFromLine;
using testing::GrayImage;
using testing::SoftRectangle;

struct Setting {
  const char* name;
  double focal_px;
  Lens lens;

  Rectifier Make() const {
    return *Rectifier::Create({Camera{focal_px, focal_px, 319.5, 239.5, 640, 480}, lens});
  }
};

const Setting kPlain{"pinhole", 400.0, {}};
const Setting kBarrel{"RADTAN -0.3 0.1", 400.0, {LensModel::kRadTan, {-0.3, 0.1, 0.001, -0.002}}};
const Setting kPincushion{
    "RADTAN 0.2 0.05", 400.0, {LensModel::kRadTan, {0.2, 0.05, 0.0, 0.0, 0.01}}};
// 140 degrees across.
const Setting kFisheye{"KANNALA_BRANDT", 262.0, {LensModel::kKannalaBrandt, {0.0, 0.0, 0.0, 0.0}}};

// Rectangles of the ideal image about the principal point, from the middle out to the corners.
std::vector<SoftRectangle> Rectangles(const Rectifier& rectifier) {
  const Eigen::Vector2d middle(rectifier.ideal().cx, rectifier.ideal().cy);
  std::vector<SoftRectangle> rectangles;
  for (const auto& [x, y, half_x, half_y, angle] :
       {std::array{0.0, 0.0, 90.0, 60.0, 0.1}, std::array{0.0, 0.0, 240.0, 170.0, 0.02},
        std::array{0.0, 0.0, 220.0, 180.0, 0.006}, std::array{120.0, -60.0, 130.0, 110.0, 0.4},
        std::array{-100.0, 70.0, 180.0, 25.0, -0.3}}) {
    rectangles.push_back({middle + Eigen::Vector2d(x, y), {half_x, half_y}, angle});
  }
  return rectangles;
}

// What the camera takes of the rectangle: steps under a blur of 0.5 px of the taken image, exactly
// on the borders' curves.
GrayImage Take(const Rectifier& rectifier, const SoftRectangle& rectangle) {
  const auto step = [](double d) { return 0.5 * std::erfc(-d / (0.5 * std::sqrt(2.0))); };
  const Camera& camera = rectifier.image_camera().pinhole;
  GrayImage image(camera.width_px, camera.height_px, 50);
  for (int y = 0; y < camera.height_px; ++y) {
    for (int x = 0; x < camera.width_px; ++x) {
      const auto ideal = rectifier.ToIdeal(Eigen::Vector2d(x, y));
      if (!ideal) continue;
      const ImagePoint at = *rectifier.ToImage(*ideal);
      double share = 1.0;
      for (const int axis : {0, 1}) {
        const double inside = rectangle.half_size[axis] -
                              std::abs((*ideal - rectangle.centre).dot(rectangle.Axis(axis)));
        share *= step(inside / at.StretchAcross(rectangle.Axis(1 - axis)));
      }
      image.At(x, y) = static_cast<uint8_t>(std::lround(50.0 + 150.0 * share));
    }
  }
  return image;
}

// The part of a border from u0 to u1 as a detector would give it: the chord of its curve.
Segment2 Chord(const Rectifier& rectifier, const Segment2& border, double u0, double u1) {
  return {rectifier.ToImage(border.start + u0 * border.Delta())->px,
          rectifier.ToImage(border.start + u1 * border.Delta())->px};
}

// Largest distance of the ends of a refined segment from its border, in pixels of the taken image.
double ErrorInImage(const Rectifier& rectifier, const Segment2& refined, const Segment2& border) {
  const Eigen::Vector2d unit = border.Delta().normalized();
  double worst = 0.0;
  for (const Eigen::Vector2d& end : {refined.start, refined.end}) {
    const Eigen::Vector2d d = end - border.start;
    const double stretch = rectifier.ToImage(end)->StretchAcross(unit);
    worst = std::max(worst, std::abs(unit.x() * d.y() - unit.y() * d.x()) / stretch);
  }
  return worst;
}

// Errors of all borders, each seen as chords of a third of it, a pixel off across.
std::vector<double> RefineBorders(const Setting& setting) {
  const Rectifier rectifier = setting.Make();
  SegmentRefinerOptions options;
  options.add_other_borders = false;
  SegmentRefiner refiner(options);
  std::vector<double> errors;
  for (const SoftRectangle& rectangle : Rectangles(rectifier)) {
    const GrayImage image = Take(rectifier, rectangle);
    for (const Segment2& border : rectangle.Borders()) {
      for (const double begin : {0.05, 0.35, 0.62}) {
        Segment2 chord = Chord(rectifier, border, begin, begin + 0.33);
        const Eigen::Vector2d unit = chord.Delta().normalized();
        chord.start += Eigen::Vector2d(-unit.y(), unit.x());
        chord.end -= 0.5 * Eigen::Vector2d(-unit.y(), unit.x());
        const auto refined = refiner.Refine(image.View(), std::vector<Segment2>{chord}, &rectifier);
        EXPECT_EQ(refined.size(), 1u) << setting.name;
        if (refined.size() == 1) errors.push_back(ErrorInImage(rectifier, refined[0], border));
      }
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

TEST(CurvedEdges, RefinedSegmentsAreAsGoodAsWithoutTheLens) {
  constexpr size_t kMedian = 30, kP90 = 54, kCount = 60;
  const std::vector<double> plain = RefineBorders(kPlain);
  ASSERT_EQ(plain.size(), kCount);
  EXPECT_LT(plain.back(), 0.2) << "edges along the pixels' rows are the worst";
  for (const Setting& setting : {kBarrel, kPincushion, kFisheye}) {
    const std::vector<double> errors = RefineBorders(setting);
    ASSERT_EQ(errors.size(), kCount);
    EXPECT_LT(errors[kMedian], 1.3 * plain[kMedian]) << setting.name;
    EXPECT_LT(errors[kP90], 1.3 * plain[kP90]) << setting.name;
    EXPECT_LT(errors.back(), 1.3 * plain.back()) << setting.name;
    RecordProperty(setting.name, std::to_string(errors[kMedian]) + " " +
                                     std::to_string(errors[kP90]) + " " +
                                     std::to_string(errors.back()));
  }
  RecordProperty(kPlain.name, std::to_string(plain[kMedian]) + " " + std::to_string(plain[kP90]) +
                                  " " + std::to_string(plain.back()));
}

// A whole border is bent by more than the refiner reaches across a chord.
TEST(CurvedEdges, LongBordersFoundAsOneChordAreFollowed) {
  const Rectifier rectifier = kBarrel.Make();
  const SoftRectangle rectangle = Rectangles(rectifier)[1];
  const GrayImage image = Take(rectifier, rectangle);
  SegmentRefiner refiner({});
  for (const Segment2& border : rectangle.Borders()) {
    const Segment2 chord = Chord(rectifier, border, 0.15, 0.85);
    const Eigen::Vector2d middle = rectifier.ToImage(border.Midpoint())->px;
    const Eigen::Vector2d d = middle - chord.Midpoint();
    EXPECT_GT(d.norm(), 4.5);
    const auto refined = refiner.Refine(image.View(), std::vector<Segment2>{chord}, &rectifier);
    ASSERT_EQ(refined.size(), 1u);
    EXPECT_LT(ErrorInImage(rectifier, refined[0], border), 0.1);
    EXPECT_GT(refined[0].Length(), 0.6 * border.Length());
  }
}

TEST(CurvedEdges, DetectedAndRefinedSegmentsLieOnTheBorders) {
  for (const Setting& setting : {kPlain, kBarrel, kFisheye}) {
    const Rectifier rectifier = setting.Make();
    for (const SoftRectangle& rectangle : Rectangles(rectifier)) {
      const GrayImage image = Take(rectifier, rectangle);
      const auto raw = CreateLsdDetector()->Detect(image.View());
      ASSERT_TRUE(raw);
      SegmentRefiner refiner({});
      double covered = 0.0, length = 0.0;
      for (const Segment2& refined : refiner.Refine(image.View(), *raw, &rectifier)) {
        double nearest = 1e9;
        for (const Segment2& border : rectangle.Borders()) {
          nearest = std::min(nearest, ErrorInImage(rectifier, refined, border));
        }
        EXPECT_LT(nearest, 0.3) << setting.name;
        covered += refined.Length();
      }
      for (const Segment2& border : rectangle.Borders()) length += border.Length();
      EXPECT_GT(covered, 0.8 * length) << setting.name;
    }
  }
}

TEST(CurvedEdges, AnIdentityIsNoLens) {
  const Rectifier identity = kPlain.Make();
  const SoftRectangle rectangle = Rectangles(identity)[0];
  const GrayImage image = Take(identity, rectangle);
  SegmentRefiner refiner({});
  std::vector<Segment2> raw;
  for (const Segment2& border : rectangle.Borders())
    raw.push_back(Chord(identity, border, 0.1, 0.9));
  const auto with = refiner.Refine(image.View(), raw, &identity);
  const auto without = refiner.Refine(image.View(), raw);
  ASSERT_EQ(with.size(), without.size());
  for (size_t i = 0; i < with.size(); ++i) {
    EXPECT_EQ(with[i].start, without[i].start);
    EXPECT_EQ(with[i].end, without[i].end);
  }
}

TEST(CurvedEdges, OtherBordersOfBarsAreFoundBesideTheCurve) {
  const Rectifier rectifier = kBarrel.Make();
  SoftRectangle bar = Rectangles(rectifier)[1];
  bar.centre.y() -= 150.0;
  bar.half_size = {200.0, 1.6};
  const GrayImage image = Take(rectifier, bar);
  SegmentRefiner refiner({});
  const auto refined = refiner.Refine(
      image.View(), std::vector<Segment2>{Chord(rectifier, bar.Borders()[0], 0.3, 0.7)},
      &rectifier);
  ASSERT_EQ(refined.size(), 2u);
  EXPECT_LT(ErrorInImage(rectifier, refined[0], bar.Borders()[0]), 0.35);
  EXPECT_LT(ErrorInImage(rectifier, refined[1], bar.Borders()[2]), 0.35);
}

TEST(StraightenSegment, LiesOnTheStraightLineWhoseCurveWasSampled) {
  const Rectifier rectifier = kBarrel.Make();
  const Segment2 border = Rectangles(rectifier)[2].Borders()[1];
  // Short enough to be its own chord.
  const auto straight = StraightenSegment(rectifier, Chord(rectifier, border, 0.5, 0.55));
  ASSERT_TRUE(straight);
  EXPECT_LT(DistanceFromLine(straight->nearest, border), 0.05);
  EXPECT_LT((straight->nearest.start - (border.start + 0.5 * border.Delta())).norm(), 0.1);
}

TEST(StraightenSegment, KeepsDirectionAndScoreAndDropsWhatTheLensDoesNotImage) {
  const Rectifier rectifier = *Rectifier::Create(
      {Camera{400.0, 400.0, 319.5, 239.5, 640, 480}, {LensModel::kRadTan, {-0.3}}});
  ASSERT_FALSE(rectifier.ToIdeal({0.0, 0.0}));
  const auto inwards = StraightenSegment(rectifier, {{0.0, 0.0}, {300.0, 230.0}, 0.7});
  ASSERT_TRUE(inwards);
  for (const Segment2& segment : {inwards->nearest, inwards->through_ends}) {
    EXPECT_EQ(segment.score, 0.7);
    EXPECT_TRUE(segment.start.allFinite());
    EXPECT_GT(segment.Delta().x(), 100.0);
  }
  EXPECT_FALSE(StraightenSegment(rectifier, {{0.0, 0.0}, {8.0, 4.0}, 0.7}));
}

TEST(StraightenSegments, KeepsTheOrderOfThoseThatAreLeft) {
  const Rectifier rectifier = *Rectifier::Create(
      {Camera{400.0, 400.0, 319.5, 239.5, 640, 480}, {LensModel::kRadTan, {-0.3}}});
  const std::vector<Segment2> segments = {
      {{300, 200}, {340, 230}, 0.9}, {{0, 0}, {8, 4}, 0.8}, {{200, 200}, {240, 230}, 0.7}};
  const auto straight = StraightenSegments(rectifier, segments);
  ASSERT_EQ(straight.size(), 2u);
  EXPECT_EQ(straight[0].score, 0.9);
  EXPECT_EQ(straight[1].score, 0.7);
  EXPECT_EQ(StraightenSegments(kPlain.Make(), segments)[1].start, segments[1].start);
}

}  // namespace
}  // namespace plumb
