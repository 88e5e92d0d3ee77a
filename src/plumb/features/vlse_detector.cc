#include "plumb/features/vlse_detector.h"

#include <cmath>
#include <utility>

#include "plumb/features/clip_segment.h"
#include "plumb/nn/model_file.h"

namespace plumb {
namespace {

Result<nn::Model> ReadModel(const VlseDetectorOptions& options) {
  if (options.model_path.empty() == options.model_data.empty()) {
    return Error{ErrorCode::kInvalidArgument,
                 "VlseDetectorOptions: give either model_path or model_data"};
  }
  if (!options.model_path.empty()) return nn::LoadModel(options.model_path);
  return nn::ParseModel(options.model_data);
}

}  // namespace

Result<std::unique_ptr<VlseDetector>> VlseDetector::Create(const VlseDetectorOptions& options) {
  Result<nn::Model> model = ReadModel(options);
  if (!model) return model.error();
  std::unique_ptr<VlseDetector> detector(new VlseDetector);
  detector->device_ = options.device;
  if (detector->device_ == nullptr) {
    Result<std::shared_ptr<gpu::Device>> device = gpu::Device::Create(options.device_options);
    if (!device) return device.error();
    detector->device_ = std::move(*device);
  }

  Result<std::unique_ptr<nn::Network>> network =
      nn::Network::Create(detector->device_, *model,
                          {.family = options.family,
                           .input_width = options.input_width_px,
                           .input_height = options.input_height_px});
  if (!network) return network.error();
  detector->network_ = std::move(*network);
  const nn::NetworkInfo& info = detector->network_->info();
  const nn::ModelSpec& spec = model->spec;
  detector->score_threshold_ = options.score_threshold.value_or(spec.score_threshold);
  detector->duplicate_decay_ = {spec.duplicate_distance, spec.duplicate_decay};
  Result<std::unique_ptr<VlseDecoder>> decoder =
      VlseDecoder::Create(detector->device_,
                          {.width_cells = info.output_width,
                           .height_cells = info.output_height,
                           .max_lines = options.max_lines.value_or(spec.top_k),
                           .score_threshold = detector->score_threshold_,
                           .nms_decay = spec.nms_decay,
                           .displacement_scale = spec.displacement_scale},
                          info.family);
  if (!decoder) return decoder.error();
  detector->decoder_ = std::move(*decoder);

  detector->name_ = spec.preset;
  detector->normalization_ = {spec.mean, spec.std};
  detector->family_ = info.family;
  detector->timeout_ = options.timeout;
  if (options.warm_up) {
    if (const Status warm = detector->WarmUp(); !warm) return warm.error();
  }
  return detector;
}

Status VlseDetector::WarmUp() {
  const nn::NetworkInfo& info = network_->info();
  const std::vector<uint8_t> black(static_cast<size_t>(3 * info.input_width) *
                                   static_cast<size_t>(info.input_height));
  ImageView image;
  image.format = PixelFormat::kRgb8;
  image.width_px = info.input_width;
  image.height_px = info.input_height;
  image.planes[0] = {black.data(), int64_t{3} * info.input_width};
  const Result<std::vector<Segment2>> segments = Detect(image);
  if (!segments) return segments.error();
  return Ok();
}

Status VlseDetector::Record(const ImageView& image) {
  commands_.reset();
  const nn::NetworkInfo& info = network_->info();
  Result<std::unique_ptr<ImagePreprocessor>> preprocessor =
      ImagePreprocessor::Create(device_, {.format = image.format,
                                          .image_width_px = image.width_px,
                                          .image_height_px = image.height_px,
                                          .tensor_width_px = info.input_width,
                                          .tensor_height_px = info.input_height,
                                          .normalization = normalization_,
                                          .family = family_});
  if (!preprocessor) return preprocessor.error();
  preprocessor_ = std::move(*preprocessor);

  Result<std::unique_ptr<gpu::Recorder>> recorder =
      gpu::Recorder::Create(device_, {.name = "vlse detector"});
  if (!recorder) return recorder.error();
  (*recorder)->BeginStage("preprocess");
  preprocessor_->Record(**recorder, network_->input().All());
  (*recorder)->BeginStage("network");
  network_->Record(**recorder);
  (*recorder)->BeginStage("decode");
  decoder_->Record(**recorder, network_->output().All(), image.width_px, image.height_px);
  Result<std::unique_ptr<gpu::CommandList>> commands = (*recorder)->Finish();
  if (!commands) return commands.error();
  commands_ = std::move(*commands);
  return Ok();
}

Status VlseDetector::Submit(const ImageView& image) {
  if (commands_ != nullptr && commands_->InFlight()) {
    return Error{ErrorCode::kInvalidArgument, "VlseDetector: an image is in flight already"};
  }
  if (const Status valid = image.Validate(); !valid) return valid.error();
  const bool is_recorded = commands_ != nullptr &&
                           preprocessor_->GetOptions().format == image.format &&
                           preprocessor_->GetOptions().image_width_px == image.width_px &&
                           preprocessor_->GetOptions().image_height_px == image.height_px;
  if (!is_recorded) {
    if (const Status recorded = Record(image); !recorded) return recorded.error();
  }
  preprocessor_->Upload(image);
  return commands_->Submit();
}

Result<std::vector<Segment2>> VlseDetector::Collect() {
  if (commands_ == nullptr || !commands_->InFlight()) {
    return Error{ErrorCode::kInvalidArgument, "VlseDetector: no image was submitted"};
  }
  const Result<gpu::WaitResult> waited = commands_->Wait(timeout_);
  if (!waited) return waited.error();
  if (*waited == gpu::WaitResult::kTimeout) {
    return Error{ErrorCode::kInternal, "VlseDetector: the device did not finish within " +
                                           std::to_string(timeout_.count() / 1'000'000) + " ms"};
  }
  stage_times_ = commands_->StageTimes();

  const ImagePreprocessor::Options& image = preprocessor_->GetOptions();
  const nn::NetworkInfo& network = network_->info();
  const std::span<const DecodedLine> decoded = decoder_->Lines();
  lines_.assign(decoded.begin(), decoded.end());
  DecayDuplicates(
      duplicate_decay_,
      static_cast<float>(network.output_width) / static_cast<float>(image.image_width_px),
      static_cast<float>(network.output_height) / static_cast<float>(image.image_height_px),
      score_threshold_, &lines_);
  std::vector<Segment2> segments;
  segments.reserve(lines_.size());
  for (const DecodedLine& line : lines_) {
    Segment2 segment;
    segment.start = Eigen::Vector2d(line.start_x, line.start_y);
    segment.end = Eigen::Vector2d(line.end_x, line.end_y);
    segment.score = line.score;
    if (ClipToImage(image.image_width_px, image.image_height_px, &segment)) {
      segments.push_back(segment);
    }
  }
  return segments;
}

}  // namespace plumb
