// The nearest hypothesis of every view is found as by looking at each of them.
#include "plumb/map/depth_hypotheses.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

std::vector<DepthHypothesis> RandomHypotheses(size_t count, std::mt19937* random) {
  std::uniform_real_distribution<double> depth(1.0, 3.0), sigma(0.01, 0.3);
  std::vector<DepthHypothesis> hypotheses;
  uint32_t view = 0;
  for (uint32_t k = 0; k < count; ++k) {
    if ((*random)() % 5 == 0) view += 1 + static_cast<uint32_t>((*random)() % 3);
    hypotheses.push_back(
        {{depth(*random), depth(*random)}, {sigma(*random), sigma(*random)}, view, k});
  }
  return hypotheses;
}

double SquareDifference(const DepthHypothesis& a, const DepthHypothesis& b) {
  double largest = 0.0;
  for (int end = 0; end < 2; ++end) {
    const double sigma = std::hypot(a.sigma[end], b.sigma[end]);
    largest = std::max(largest, std::pow((a.depth[end] - b.depth[end]) / sigma, 2));
  }
  return largest;
}

using Found = std::vector<std::pair<size_t, double>>;

Found ByLookingAtEach(const std::vector<DepthHypothesis>& hypotheses, const DepthHypothesis& to,
                      double max_square) {
  Found found;
  for (size_t k = 0; k < hypotheses.size(); ++k) {
    const double square = SquareDifference(to, hypotheses[k]);
    if (!(square < max_square)) continue;
    if (found.empty() || hypotheses[found.back().first].view != hypotheses[k].view) {
      found.emplace_back(k, square);
    } else if (square < found.back().second) {
      found.back() = {k, square};
    }
  }
  return found;
}

TEST(DepthHypotheses, FindsTheNearestOfEveryView) {
  std::mt19937 random(5);
  size_t num_found = 0;
  for (const size_t count : {0u, 1u, 7u, 8u, 9u, 64u, 301u}) {
    const std::vector<DepthHypothesis> hypotheses = RandomHypotheses(count, &random);
    DepthHypotheses table(hypotheses);
    for (const DepthHypothesis& to : RandomHypotheses(40, &random)) {
      for (const double max_square : {0.5, 6.25}) {
        Found found;
        table.ForBestOfEachView(to, max_square, [&found](size_t index, double square) {
          found.emplace_back(index, square);
        });
        const Found expected = ByLookingAtEach(hypotheses, to, max_square);
        ASSERT_EQ(found.size(), expected.size());
        for (size_t i = 0; i < found.size(); ++i) {
          EXPECT_EQ(found[i].first, expected[i].first);
          EXPECT_NEAR(found[i].second, expected[i].second, 1e-9);
        }
        num_found += found.size();
      }
    }
  }
  EXPECT_GT(num_found, 500u);
}

TEST(DepthHypotheses, OfEqualsTheFirstIsTaken) {
  const DepthHypothesis one{{2.0, 2.0}, {0.1, 0.1}, 3, 0};
  const std::vector<DepthHypothesis> hypotheses(10, one);
  DepthHypotheses table(hypotheses);
  std::vector<size_t> found;
  table.ForBestOfEachView(one, 1.0, [&found](size_t index, double) { found.push_back(index); });
  EXPECT_EQ(found, std::vector<size_t>{0});
}

}  // namespace
}  // namespace plumb
