#include "tools/plumbline/refine_queries.h"

#include <algorithm>
#include <numbers>
#include <utility>

#include "plumb/features/segment_refiner.h"
#include "plumb/features/straighten.h"
#include "plumb/runtime/rectify_points.h"
#include "tools/datasets/image_file.h"
#include "tools/datasets/line_annotations.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/synth/camera_path.h"
#include "tools/synth/line_city.h"

namespace plumb::tools {
Outcome MakeCityQueries(const CityQueryOptions& options, LineMap* out_map,
                        RefineQueries* out_queries) {
  const synth::LineCity city({.num_lines = options.num_lines, .seed = options.seed});
  RefineQueries& out = *out_queries;
  out.camera = synth::LineCity::MakeCamera();
  synth::Random random(options.seed + 1);
  for (size_t i = 0; i < options.num_frames; ++i) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
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
  return std::nullopt;
}

Outcome ReadQueries(FrameRun* run, const std::string& segments_path, size_t limit,
                    RefineQueries* out_queries) {
  const size_t count = std::min(limit, run->frames.size());
  std::vector<std::vector<Segment2>> known;
  if (!segments_path.empty()) {
    std::vector<AnnotatedImage> images(count);
    for (size_t i = 0; i < count; ++i) images[i].path = run->frames[i].color_path;
    Result<std::vector<std::vector<Segment2>>> read = ReadDetections(segments_path, images);
    if (!read) return FailureFrom(read.error());
    known = *std::move(read);
  }
  out_queries->camera = run->sequence.camera;
  SegmentRefiner refiner{SegmentRefinerOptions{}};
  PointFrontEnd points;
  ProgressBar progress("load", count);
  for (size_t i = 0; i < count; ++i) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    const SequenceFrame& frame = run->frames[i];
    RefineQuery& query = out_queries->queries.emplace_back();
    query.prior = run->priors[i];
    query.more_priors.assign(run->MorePriors(i).begin(), run->MorePriors(i).end());
    query.true_cam_from_world = frame.cam_from_world;
    if (segments_path.empty() || run->with_points) {
      const Result<cv::Mat> image = ReadColorImage(frame.color_path);
      if (!image) return FailureFrom(image.error());
      if (segments_path.empty()) {
        Result<std::vector<Segment2>> found =
            DetectRefined(ViewOf(*image), run->sequence.rectifier, run->detector.get(), &refiner);
        if (!found) return FailureFrom(found.error());
        query.segments = *std::move(found);
      }
      if (run->with_points) {
        if (const Status extracted = points.ExtractQuery(*image, run->sequence.rectifier);
            !extracted) {
          return FailureFrom(extracted.error());
        }
        query.points = points.MatchQuery(run->sequence.camera, *run->index, run->PriorPoses(i),
                                         run->session.refiner.method);
        RectifyPoints(run->sequence.rectifier, &query.points);
      }
    }
    if (!segments_path.empty()) {
      query.segments = StraightenSegments(run->sequence.rectifier, std::move(known[i]));
    }
    progress.Advance();
  }
  return std::nullopt;
}

}  // namespace plumb::tools
