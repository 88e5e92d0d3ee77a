#include "plumb/map/depth_correction.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>

#include "plumb/base/median.h"

namespace plumb {
namespace {

constexpr size_t kMinSamples = 100;  // a half
constexpr int kIterations = 10;
constexpr double kCauchyScale = 2.0;  // in standard deviations
// Prior deviation of every coefficient: sensors are off by percents, not more.
constexpr double kPriorSigma = 0.05;
constexpr double kFirstNoiseFactor = 2.0;
constexpr double kMedianOfNormal = 0.6745;  // of |x|, x standard normal
constexpr double kMaxNoiseFactor = 16.0;
constexpr int kBisections = 30;

constexpr int kNumCoefficients = 6;
using Coefficients = Eigen::Matrix<double, kNumCoefficients, 1>;
using Information = Eigen::Matrix<double, kNumCoefficients, kNumCoefficients>;

Coefficients Regressors(const DepthSample& sample) {
  Coefficients out;
  out << sample.ray.homogeneous(), sample.sensor * sample.ray.homogeneous();
  return out;
}

double Deviation(const DepthSample& sample, const DepthCorrection& correction) {
  return sample.views - correction(sample.ray, sample.sensor);
}

double Variance(const DepthSample& sample, const DepthNoise& noise, double factor) {
  const double sensor = factor * noise.InverseSigmaAt(sample.sensor);
  return sensor * sensor + sample.views_sigma * sample.views_sigma;
}

DepthCorrection Fit(std::span<const DepthSample> samples, const DepthNoise& noise) {
  DepthCorrection correction;
  for (int k = 0; k < kIterations; ++k) {
    Information information = Information::Identity() / (kPriorSigma * kPriorSigma);
    Coefficients moment = Coefficients::Zero();
    for (const DepthSample& sample : samples) {
      const double variance = Variance(sample, noise, kFirstNoiseFactor);
      const double deviation = Deviation(sample, correction);
      const double weight =
          1.0 / (variance + deviation * deviation / (kCauchyScale * kCauchyScale));
      const Coefficients regressors = Regressors(sample);
      information += weight * regressors * regressors.transpose();
      moment += weight * (sample.views - sample.sensor) * regressors;
    }
    const Coefficients solved = information.ldlt().solve(moment);
    correction = {solved.head<3>(), solved.tail<3>()};
  }
  return correction;
}

// Negative logarithm of the samples' likelihood [nat], but for a constant.
double RobustCost(std::span<const DepthSample> samples, const DepthCorrection& correction,
                  const DepthNoise& noise) {
  double cost = 0.0;
  for (const DepthSample& sample : samples) {
    const double deviation = Deviation(sample, correction);
    cost += std::log1p(deviation * deviation / (kCauchyScale * kCauchyScale) /
                       Variance(sample, noise, kFirstNoiseFactor));
  }
  return 0.5 * kCauchyScale * kCauchyScale * cost;
}

// The factor with which half of the deviations are as small as normal ones would be.
double NoiseFactor(std::span<const DepthSample> samples, const DepthCorrection& correction,
                   const DepthNoise& noise) {
  double low = 0.0, high = kMaxNoiseFactor;
  std::vector<double> normalised(samples.size());
  for (int k = 0; k < kBisections; ++k) {
    const double factor = 0.5 * (low + high);
    std::transform(samples.begin(), samples.end(), normalised.begin(),
                   [&](const DepthSample& sample) {
                     return std::abs(Deviation(sample, correction)) /
                            std::sqrt(Variance(sample, noise, factor));
                   });
    (Median(normalised) > kMedianOfNormal ? low : high) = factor;
  }
  return high;
}

}  // namespace

std::optional<DepthFit> FitDepthCorrection(std::span<const DepthSample> samples,
                                           const DepthNoise& noise) {
  size_t half_begin = samples.size() / 2;
  while (half_begin > 0 && half_begin < samples.size() &&
         samples[half_begin].key_frame == samples[half_begin - 1].key_frame) {
    ++half_begin;
  }
  if (half_begin < kMinSamples || samples.size() < half_begin + kMinSamples) return std::nullopt;
  const auto first = samples.first(half_begin), second = samples.subspan(half_begin);
  const auto improves = [&noise](std::span<const DepthSample> fitted,
                                 std::span<const DepthSample> others) {
    return RobustCost(others, Fit(fitted, noise), noise) <
           RobustCost(others, {}, noise) - kNumCoefficients;
  };
  DepthFit out;
  if (improves(first, second) && improves(second, first)) out.correction = Fit(samples, noise);
  out.noise_factor = NoiseFactor(samples, out.correction, noise);
  std::vector<double> change;
  for (const DepthSample& sample : samples) {
    change.push_back(std::abs(sample.sensor / out.correction(sample.ray, sample.sensor) - 1.0));
  }
  out.median_change = Median(change);
  return out;
}

}  // namespace plumb
