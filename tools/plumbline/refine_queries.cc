#include "tools/plumbline/refine_queries.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <numbers>
#include <utility>

#include "plumb/base/file.h"
#include "plumb/features/segment_refiner.h"
#include "tools/datasets/image_file.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/synth/camera_path.h"
#include "tools/synth/line_city.h"

namespace plumb::tools {
namespace {

constexpr size_t kMaxSegmentsFile = size_t{1} << 30;

using SegmentsOfImages = std::map<std::string, std::vector<Segment2>>;  // by file name

Outcome ReadSegments(const std::string& path, SegmentsOfImages* out) {
  const Result<std::string> text = ReadFile(path, kMaxSegmentsFile);
  if (!text) return FailureFrom(text.error());
  const auto bad = [&] {
    return Failure{kExitBadData, path + ": is not what `plumbline detect --json` prints"};
  };
  const Json images = Json::parse(*text, nullptr, false);
  if (!images.is_array()) return bad();
  for (const Json& image : images) {
    if (!image.is_object() || !image.contains("file") || !image["file"].is_string() ||
        !image.contains("lines") || !image["lines"].is_array()) {
      return bad();
    }
    std::vector<Segment2>& segments =
        (*out)[std::filesystem::path(image["file"].get<std::string>()).filename().string()];
    for (const Json& line : image["lines"]) {
      if (!line.is_array() || line.size() != 4) return bad();
      double v[4];
      for (size_t i = 0; i < 4; ++i) {
        if (!line[i].is_number()) return bad();
        v[i] = line[i].get<double>();
      }
      segments.push_back({{v[0], v[1]}, {v[2], v[3]}});
    }
  }
  return std::nullopt;
}

}  // namespace

RefineQueries MakeCityQueries(const CityQueryOptions& options, LineMap* out_map) {
  const synth::LineCity city({.num_lines = options.num_lines, .seed = options.seed});
  RefineQueries out;
  out.camera = synth::LineCity::MakeCamera();
  synth::Random random(options.seed + 1);
  for (size_t i = 0; i < options.num_frames; ++i) {
    const synth::LineCity::Frame frame =
        city.MakeFrame(options.num_segments, options.num_points, &random);
    RefineQuery& query = out.queries.emplace_back();
    query.segments = frame.segments;
    for (const synth::LineCity::Point& point : frame.points) {
      query.points.push_back({point.pixel, point.point_in_world, point.deviation_in_world});
    }
    query.prior.position_sigma_m = 0.01 * options.prior_cm;
    query.prior.rotation_sigma_rad = options.prior_deg * std::numbers::pi / 180.0;
    query.prior.cam_from_world = synth::Displace(frame.cam_from_world, query.prior.position_sigma_m,
                                                 query.prior.rotation_sigma_rad, &random);
    query.true_cam_from_world = frame.cam_from_world;
  }
  *out_map = city.map();
  return out;
}

Outcome ReadQueries(FrameRun* run, const std::string& segments_path, size_t limit,
                    RefineQueries* out_queries) {
  SegmentsOfImages known;
  if (!segments_path.empty()) {
    if (Outcome failed = ReadSegments(segments_path, &known)) return failed;
  }
  out_queries->camera = run->sequence.camera;
  SegmentRefiner refiner{SegmentRefinerOptions{}};
  PointFrontEnd points;
  const size_t count = std::min(limit, run->frames.size());
  ProgressBar progress("load", count);
  for (size_t i = 0; i < count; ++i) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    const SequenceFrame& frame = run->frames[i];
    RefineQuery& query = out_queries->queries.emplace_back();
    query.prior = run->priors[i];
    query.true_cam_from_world = frame.cam_from_world;
    if (segments_path.empty() || run->with_points) {
      const Result<cv::Mat> image = ReadColorImage(frame.color_path);
      if (!image) return FailureFrom(image.error());
      if (segments_path.empty()) {
        Result<std::vector<Segment2>> found = run->detector->Detect(ViewOf(*image));
        if (!found) return FailureFrom(found.error());
        query.segments = refiner.Refine(ViewOf(*image), *found);
      }
      if (run->with_points) {
        Result<std::vector<PointMatch>> matches =
            points.QueryMatches(*image, run->sequence.camera, *run->index,
                                query.prior.cam_from_world, run->session.refiner.method);
        if (!matches) return FailureFrom(matches.error());
        query.points = *std::move(matches);
      }
    }
    if (!segments_path.empty()) {
      const auto found = known.find(std::filesystem::path(frame.color_path).filename().string());
      if (found == known.end()) {
        return Failure{kExitBadData, segments_path + ": has no segments of " + frame.color_path};
      }
      query.segments = found->second;
    }
    progress.Advance();
  }
  return std::nullopt;
}

}  // namespace plumb::tools
