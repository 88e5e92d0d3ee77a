#include "plumb/features/configured_detector.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace plumb {
namespace {

constexpr int kMaxTilesPerAxis = 64;
// Two detections of a line in two tiles may differ by so many pixels of the detector's own grid.
constexpr double kReach = 1.5;

class ConfiguredDetector : public LineDetector {
 public:
  ConfiguredDetector(std::unique_ptr<LineDetector> detector, const DetectionOptions& options)
      : detector_(std::move(detector)), options_(options) {}

  Status Submit(const ImageView& image) override {
    if (in_flight_) {
      return Error{ErrorCode::kInvalidArgument, "LineDetector: an image is in flight already"};
    }
    if (const Status valid = image.Validate(); !valid) return valid.error();
    width_px_ = image.width_px;
    height_px_ = image.height_px;
    tiles_ = LayOutTiles(image.width_px, image.height_px, GridFor(image));
    found_.clear();
    for (size_t i = 0; i < tiles_.size(); ++i) {
      if (i > 0) {
        if (const Status collected = CollectTile(); !collected) return collected.error();
      }
      const Status submitted = detector_->Submit(ViewOfTile(image, tiles_[i]));
      if (!submitted) return submitted.error();
    }
    in_flight_ = true;
    return Ok();
  }

  Result<std::vector<Segment2>> Collect() override {
    if (!in_flight_) {
      return Error{ErrorCode::kInvalidArgument, "LineDetector: no image was submitted"};
    }
    if (const Status collected = CollectTile(); !collected) return collected.error();
    in_flight_ = false;
    std::vector<Segment2> segments = tiles_.size() == 1
                                         ? std::move(found_.front())
                                         : MergeTileSegments(tiles_, found_, ReachPx());
    SelectSegments(options_.selection, width_px_, height_px_, &segments);
    return segments;
  }

  bool WorksInBackground() const override { return detector_->WorksInBackground(); }
  std::string Name() const override { return detector_->Name(); }
  std::string DeviceName() const override { return detector_->DeviceName(); }
  ImageSize InputSize() const override { return detector_->InputSize(); }

 private:
  TileGrid GridFor(const ImageView& image) const {
    if (options_.tiles.columns > 0) return options_.tiles;
    const ImageSize input = detector_->InputSize();
    return ChooseTileGrid(image.width_px, image.height_px, input.width_px, input.height_px);
  }

  double ReachPx() const {
    const ImageSize input = detector_->InputSize();
    if (input.width_px == 0) return kReach;
    const ImageTile& tile = tiles_.front();
    return kReach * std::max({1.0, static_cast<double>(tile.width) / input.width_px,
                              static_cast<double>(tile.height) / input.height_px});
  }

  Status CollectTile() {
    Result<std::vector<Segment2>> segments = detector_->Collect();
    if (!segments) return segments.error();
    found_.push_back(*std::move(segments));
    return Ok();
  }

  std::unique_ptr<LineDetector> detector_;
  DetectionOptions options_;
  // Of the image in flight.
  bool in_flight_ = false;
  int width_px_ = 0, height_px_ = 0;
  std::vector<ImageTile> tiles_;
  std::vector<std::vector<Segment2>> found_;
};

Status Check(const DetectionOptions& options) {
  const auto invalid = [](const std::string& message) -> Status {
    return Error{ErrorCode::kInvalidArgument, "DetectionOptions: " + message};
  };
  const SegmentSelection& selection = options.selection;
  if (!(selection.min_score >= 0.0 && selection.min_score <= 1.0)) {
    return invalid("min_score " + std::to_string(selection.min_score) + " is outside 0..1");
  }
  if (!(selection.min_length_px >= 0.0 && selection.min_length_px <= 1e5)) {
    return invalid("min_length_px " + std::to_string(selection.min_length_px) +
                   " is outside 0..100000");
  }
  if (!(selection.structural_nms >= 0.0 && selection.structural_nms <= 1e5)) {
    return invalid("structural_nms " + std::to_string(selection.structural_nms) +
                   " is outside 0..100000");
  }
  const TileGrid& tiles = options.tiles;
  const bool automatic = tiles.columns == 0 && tiles.rows == 0;
  if (!automatic && (std::min(tiles.columns, tiles.rows) < 1 ||
                     std::max(tiles.columns, tiles.rows) > kMaxTilesPerAxis)) {
    return invalid("tiles " + std::to_string(tiles.columns) + " x " + std::to_string(tiles.rows) +
                   " are outside 1..64");
  }
  return Ok();
}

}  // namespace

Result<std::unique_ptr<LineDetector>> ConfigureDetector(std::unique_ptr<LineDetector> detector,
                                                        const DetectionOptions& options) {
  if (const Status valid = Check(options); !valid) return valid.error();
  const SegmentSelection& selection = options.selection;
  const bool asks_for_nothing = selection.min_score == 0.0 && selection.min_length_px == 0.0 &&
                                selection.structural_nms == 0.0 && selection.max_count == 0 &&
                                options.tiles.columns == 1 && options.tiles.rows == 1;
  if (asks_for_nothing) return detector;
  return std::unique_ptr<LineDetector>(
      std::make_unique<ConfiguredDetector>(std::move(detector), options));
}

}  // namespace plumb
