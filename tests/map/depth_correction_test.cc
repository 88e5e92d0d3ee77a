// A warped sensor is found from noisy views with outliers; an exact one is left as it is.
#include "plumb/map/depth_correction.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr uint32_t kFrames = 20;

// What a sensor says of places at 0.7 to 4 m whose true inverse depth is w: warp^-1(w) + noise.
struct Recording {
  DepthCorrection warp;
  double noise_factor = 2.0;
  double views_sigma = 0.002;
  double outliers = 0.0;  // share of samples whose views are wrong
  int per_frame = 60;

  std::vector<DepthSample> Samples(uint32_t seed = 3) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-0.6, 0.6), inverse(0.25, 1.4), chance(0.0, 1.0);
    std::normal_distribution<double> normal;
    std::vector<DepthSample> samples;
    for (uint32_t k = 0; k < kFrames; ++k) {
      for (int i = 0; i < per_frame; ++i) {
        DepthSample& sample = samples.emplace_back();
        sample.key_frame = k;
        sample.ray = {place(random), place(random)};
        sample.sensor = inverse(random);
        sample.views_sigma = views_sigma;
        const double sigma =
            std::hypot(views_sigma, noise_factor * DepthNoise().InverseSigmaAt(sample.sensor));
        sample.views = warp(sample.ray, sample.sensor) + sigma * normal(random);
        if (chance(random) < outliers) sample.views = inverse(random);
      }
    }
    return samples;
  }
};

// Largest |fitted / warped - 1| over the image and 0.7 to 4 m.
double WorstError(const DepthCorrection& fitted, const DepthCorrection& warp) {
  double worst = 0.0;
  for (const double x : {-0.6, 0.0, 0.6}) {
    for (const double y : {-0.45, 0.0, 0.45}) {
      for (const double w : {0.25, 0.6, 1.4}) {
        worst = std::max(worst, std::abs(fitted({x, y}, w) / warp({x, y}, w) - 1.0));
      }
    }
  }
  return worst;
}

const DepthCorrection kWarp{{-0.008, 0.004, 0.012}, {0.01, -0.02, -0.015}};

TEST(DepthCorrection, FindsOffsetScaleAndTheirTilt) {
  const Recording recording{kWarp};
  const auto fit = FitDepthCorrection(recording.Samples());
  ASSERT_TRUE(fit);
  EXPECT_GT(WorstError({}, kWarp), 0.04);
  EXPECT_LT(WorstError(fit->correction, kWarp), 0.01);
  EXPECT_NEAR(fit->noise_factor, 2.0, 0.2);
  EXPECT_GT(fit->median_change, 0.005);
}

TEST(DepthCorrection, WrongViewsDoNotBendIt) {
  Recording recording{kWarp};
  recording.outliers = 0.25;
  const auto fit = FitDepthCorrection(recording.Samples());
  ASSERT_TRUE(fit);
  EXPECT_LT(WorstError(fit->correction, kWarp), 0.015);
}

TEST(DepthCorrection, AnExactSensorStaysAsItIs) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const auto fit = FitDepthCorrection(Recording{}.Samples(seed));
    ASSERT_TRUE(fit);
    EXPECT_EQ(WorstError(fit->correction, {}), 0.0) << seed;
    EXPECT_NEAR(fit->noise_factor, 2.0, 0.2) << seed;
  }
}

TEST(DepthCorrection, WhatHoldsInHalfOfTheFramesOnlyIsNotKept) {
  // The first half of the frames says +3 %, the second -3 %.
  Recording first{{Eigen::Vector3d::Zero(), {0.0, 0.0, 0.03}}};
  Recording second{{Eigen::Vector3d::Zero(), {0.0, 0.0, -0.03}}};
  std::vector<DepthSample> samples = first.Samples();
  const std::vector<DepthSample> others = second.Samples();
  std::copy(others.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2), others.end(),
            samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2));
  const auto fit = FitDepthCorrection(samples);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->correction.scale, Eigen::Vector3d::Zero());
  EXPECT_EQ(fit->correction.shift, Eigen::Vector3d::Zero());
  EXPECT_GT(fit->noise_factor, 2.2);  // what is not corrected counts as noise
}

TEST(DepthCorrection, NoiseOfTheViewsIsNotTheSensors) {
  Recording recording{kWarp};
  recording.views_sigma = 0.02;
  recording.noise_factor = 1.0;
  const auto fit = FitDepthCorrection(recording.Samples());
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->noise_factor, 1.8);
}

TEST(DepthCorrection, FewSamplesSayNothing) {
  Recording recording{kWarp};
  recording.per_frame = 9;
  EXPECT_FALSE(FitDepthCorrection(recording.Samples()));
  EXPECT_FALSE(FitDepthCorrection({}));
  recording.per_frame = 60;
  std::vector<DepthSample> of_one_frame = recording.Samples();
  for (DepthSample& sample : of_one_frame) sample.key_frame = 0;
  EXPECT_FALSE(FitDepthCorrection(of_one_frame));
}

TEST(DepthCorrection, NeverTurnsDepthBehindTheCamera) {
  const DepthCorrection strong{{0.0, 0.0, -1.0}, Eigen::Vector3d::Zero()};
  EXPECT_EQ(strong({0.0, 0.0}, 0.5), 0.01);
}

}  // namespace
}  // namespace plumb
