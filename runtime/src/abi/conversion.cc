#include "abi/conversion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>

#include <Eigen/Eigenvalues>

#include "abi/guard.h"
#include "abi/versioned_struct.h"

namespace plumb::abi {
namespace {

constexpr double kMaxQuaternionError = 1e-3;

// Of the struct's first version; never changes.
constexpr size_t kPosePriorSizeV1 =
    offsetof(plumb_pose_prior, covariance) + sizeof(plumb_pose_prior::covariance);

static_assert(PLUMB_MAX_MORE_PRIORS == kMaxMorePriors);

Error Invalid(const std::string& message) { return {ErrorCode::kInvalidArgument, message}; }

bool IsGl(int32_t convention) {
  return convention == PLUMB_POSE_GL_CAM_FROM_WORLD || convention == PLUMB_POSE_GL_WORLD_FROM_CAM;
}

bool IsWorldFromCam(int32_t convention) {
  return convention == PLUMB_POSE_CV_WORLD_FROM_CAM || convention == PLUMB_POSE_GL_WORLD_FROM_CAM;
}

// Half a turn about x: between y down, z forward and y up, z backward. Its own inverse.
Rigid3 GlFromCv() { return {Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), Eigen::Vector3d::Zero()}; }

Result<PixelFormat> FormatFromAbi(int32_t format) {
  switch (format) {
    case PLUMB_FORMAT_GRAY8:
      return PixelFormat::kGray8;
    case PLUMB_FORMAT_RGB8:
      return PixelFormat::kRgb8;
    case PLUMB_FORMAT_BGR8:
      return PixelFormat::kBgr8;
    case PLUMB_FORMAT_NV12:
      return PixelFormat::kNv12;
    case PLUMB_FORMAT_NV21:
      return PixelFormat::kNv21;
    case PLUMB_FORMAT_I420:
      return PixelFormat::kI420;
    default:
      return Invalid("frame.format " + std::to_string(format) + " is not a PLUMB_FORMAT");
  }
}

Result<Lens> LensFromAbi(const plumb_frame& frame) {
  if (frame.reserved_lens != 0) return Invalid("frame.reserved_lens is not zero");
  Lens lens;
  size_t num_coefficients = 0;
  switch (frame.lens_model) {
    case PLUMB_LENS_NONE:
      break;
    case PLUMB_LENS_RADTAN:
      lens.model = LensModel::kRadTan;
      num_coefficients = 8;
      break;
    case PLUMB_LENS_KANNALA_BRANDT:
      lens.model = LensModel::kKannalaBrandt;
      num_coefficients = 4;
      break;
    default:
      return Invalid("frame.lens_model " + std::to_string(frame.lens_model) +
                     " is not a PLUMB_LENS");
  }
  for (size_t i = 0; i < lens.coefficients.size(); ++i) {
    const double value = frame.lens_distortion[i];
    const auto wrong = [&](const std::string& why) {
      return Invalid("frame.lens_distortion[" + std::to_string(i) + "] " + std::to_string(value) +
                     why);
    };
    if (!std::isfinite(value)) return wrong(" is not finite");
    if (i >= num_coefficients && value != 0.0) {
      return wrong(" is not 0, which frame.lens_model " + std::to_string(frame.lens_model) +
                   " does not use");
    }
    lens.coefficients[i] = value;
  }
  return lens;
}

// Messages begin with the member.
Result<PosePrior> PriorFromAbi(int32_t convention, const plumb_pose_prior& from) {
  PosePrior prior;
  const Result<Rigid3> pose = PoseFromAbi(convention, from.q_xyzw, from.t_m);
  if (!pose) return pose.error();
  prior.cam_from_world = *pose;
  switch (from.uncertainty) {
    case PLUMB_UNCERTAINTY_SIZES:
      // Zero keeps the default; the session refuses what is negative or not finite.
      if (from.position_sigma_m != 0.0) prior.position_sigma_m = from.position_sigma_m;
      if (from.rotation_sigma_rad != 0.0) prior.rotation_sigma_rad = from.rotation_sigma_rad;
      return prior;
    case PLUMB_UNCERTAINTY_COVARIANCE:
      if (const Status read = SizesOfCovariance(from.covariance, &prior); !read) {
        return read.error();
      }
      return prior;
    default:
      return Invalid("uncertainty " + std::to_string(from.uncertainty) +
                     " is not a PLUMB_UNCERTAINTY");
  }
}

Result<PosePrior> FirstPriorFromAbi(const plumb_frame& frame) {
  plumb_pose_prior from{};
  from.uncertainty = frame.prior_uncertainty;
  std::copy_n(frame.prior_q_xyzw, 4, from.q_xyzw);
  std::copy_n(frame.prior_t_m, 3, from.t_m);
  from.position_sigma_m = frame.prior_position_sigma_m;
  from.rotation_sigma_rad = frame.prior_rotation_sigma_rad;
  std::copy_n(frame.prior_covariance, 36, from.covariance);
  Result<PosePrior> prior = PriorFromAbi(frame.pose_convention, from);
  if (!prior) return Invalid("frame.prior_" + prior.error().message);
  return prior;
}

std::optional<GravityPrior> GravityFromAbi(const plumb_frame& frame) {
  const Eigen::Map<const Eigen::Vector3d> down(frame.gravity_in_camera);
  if (down.isZero(0.0)) return std::nullopt;
  GravityPrior gravity;
  gravity.down_in_camera = down;
  if (IsGl(frame.pose_convention)) gravity.down_in_camera = GlFromCv() * gravity.down_in_camera;
  gravity.down_in_world = Eigen::Map<const Eigen::Vector3d>(frame.gravity_in_world);
  if (frame.gravity_sigma_rad != 0.0) gravity.sigma_rad = frame.gravity_sigma_rad;
  return gravity;
}

Status MorePriorsFromAbi(const plumb_frame& frame, std::vector<PosePrior>* out_priors) {
  out_priors->clear();
  if (frame.reserved_priors != 0) return Invalid("frame.reserved_priors is not zero");
  if (frame.num_more_priors == 0) return Ok();
  if (frame.num_more_priors > PLUMB_MAX_MORE_PRIORS) {
    return Invalid("frame.num_more_priors " + std::to_string(frame.num_more_priors) + " is above " +
                   std::to_string(PLUMB_MAX_MORE_PRIORS));
  }
  if (frame.more_priors == nullptr) return Invalid("frame.more_priors is NULL");
  const auto* bytes = reinterpret_cast<const unsigned char*>(frame.more_priors);
  const uint32_t stride = frame.more_priors->struct_size;
  if (stride % alignof(plumb_pose_prior) != 0) {
    return Invalid("frame.more_priors[0].struct_size " + std::to_string(stride) +
                   " is not the size of plumb_pose_prior (" +
                   std::to_string(sizeof(plumb_pose_prior)) + ")");
  }
  for (uint32_t i = 0; i < frame.num_more_priors; ++i) {
    const auto* entry =
        reinterpret_cast<const plumb_pose_prior*>(bytes + static_cast<size_t>(i) * stride);
    const auto wrong = [i](const Error& error, const char* between) -> Status {
      return Error{error.code,
                   "frame.more_priors[" + std::to_string(i) + "]" + between + error.message};
    };
    // Before it is believed: a larger size would be read past the end of the array.
    if (entry->struct_size != stride) {
      return Invalid("frame.more_priors[" + std::to_string(i) + "].struct_size " +
                     std::to_string(entry->struct_size) + " is not the first one's " +
                     std::to_string(stride));
    }
    const Result<plumb_pose_prior> read = ReadStruct(entry, kPosePriorSizeV1, "plumb_pose_prior");
    if (!read) return wrong(read.error(), ": ");
    const Result<PosePrior> prior = PriorFromAbi(frame.pose_convention, *read);
    if (!prior) return wrong(prior.error(), ".");
    out_priors->push_back(*prior);
  }
  return Ok();
}

int32_t StatusToAbi(RefineStatus status) {
  switch (status) {
    case RefineStatus::kRefined:
      return PLUMB_STATUS_REFINED;
    case RefineStatus::kKeptPrior:
      return PLUMB_STATUS_KEPT_PRIOR;
    case RefineStatus::kAmbiguous:
      return PLUMB_STATUS_AMBIGUOUS;
    case RefineStatus::kDegenerate:
      return PLUMB_STATUS_DEGENERATE;
    case RefineStatus::kLowSupport:
      return PLUMB_STATUS_LOW_SUPPORT;
  }
  return PLUMB_STATUS_NONE;
}

int32_t OutcomeToAbi(FrameOutcome outcome) {
  switch (outcome) {
    case FrameOutcome::kProcessed:
      return PLUMB_OUTCOME_PROCESSED;
    case FrameOutcome::kDropped:
      return PLUMB_OUTCOME_DROPPED;
    case FrameOutcome::kLate:
      return PLUMB_OUTCOME_LATE;
    case FrameOutcome::kFailed:
      return PLUMB_OUTCOME_FAILED;
  }
  return PLUMB_OUTCOME_FAILED;
}

}  // namespace

Result<Rigid3> PoseFromAbi(int32_t convention, const double q_xyzw[4], const double t_m[3]) {
  Rigid3 pose{Eigen::Quaterniond(q_xyzw[3], q_xyzw[0], q_xyzw[1], q_xyzw[2]),
              Eigen::Vector3d(t_m[0], t_m[1], t_m[2])};
  if (!pose.IsFinite()) return Invalid("q_xyzw or t_m is not finite");
  const double norm = pose.rotation.norm();
  if (!(std::abs(norm - 1.0) < kMaxQuaternionError)) {
    return Invalid("q_xyzw has norm " + std::to_string(norm) + ", not 1");
  }
  pose.rotation.normalize();
  if (IsWorldFromCam(convention)) pose = pose.Inverse();
  return IsGl(convention) ? GlFromCv() * pose : pose;
}

void PoseToAbi(int32_t convention, const Rigid3& cam_from_world, double q_xyzw[4], double t_m[3]) {
  Rigid3 pose = IsGl(convention) ? GlFromCv() * cam_from_world : cam_from_world;
  if (IsWorldFromCam(convention)) pose = pose.Inverse();
  std::copy_n(pose.rotation.coeffs().data(), 4, q_xyzw);
  std::copy_n(pose.translation.data(), 3, t_m);
}

Status SizesOfCovariance(const double covariance[36], PosePrior* out_prior) {
  constexpr double kRelativeTolerance = 1e-6;
  const Matrix6d matrix =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(covariance);
  if (!matrix.allFinite()) return Invalid("covariance is not finite");
  const double tolerance = kRelativeTolerance * matrix.cwiseAbs().maxCoeff();
  if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > tolerance) {
    return Invalid("covariance is not symmetric");
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(matrix, Eigen::EigenvaluesOnly);
  if (solver.eigenvalues().minCoeff() < -tolerance) {
    return Invalid("covariance is not positive semi-definite");
  }
  const double rotation = matrix.topLeftCorner<3, 3>().trace();
  const double position = matrix.bottomRightCorner<3, 3>().trace();
  if (!(rotation > 0.0 && position > 0.0)) {
    return Invalid("covariance leaves no uncertainty in rotation or position");
  }
  out_prior->rotation_sigma_rad = std::sqrt(rotation);
  out_prior->position_sigma_m = std::sqrt(position);
  return Ok();
}

Result<SessionFrame> FrameFromAbi(const plumb_frame& frame, FrameLists* lists) {
  constexpr uint32_t kMaxSidePx = 16384, kMaxPoints = 1u << 20;
  SessionFrame out;
  if (frame.reserved != 0) return Invalid("frame.reserved is not zero");
  const Result<PixelFormat> format = FormatFromAbi(frame.format);
  if (!format) return format.error();
  if (frame.width_px > kMaxSidePx || frame.height_px > kMaxSidePx) {
    return Invalid("frame of " + std::to_string(frame.width_px) + " x " +
                   std::to_string(frame.height_px) + " px is larger than 16384 px");
  }
  out.image.format = *format;
  out.image.width_px = static_cast<int>(frame.width_px);
  out.image.height_px = static_cast<int>(frame.height_px);
  for (size_t i = 0; i < 3; ++i) {
    out.image.planes[i] = {frame.planes[i], frame.row_stride_bytes[i]};
  }
  out.camera.pinhole = {frame.fx, frame.fy,           frame.cx,
                        frame.cy, out.image.width_px, out.image.height_px};
  const Result<Lens> lens = LensFromAbi(frame);
  if (!lens) return lens.error();
  out.camera.lens = *lens;
  out.timestamp_ns = frame.timestamp_ns;
  out.user_tag = frame.user_tag;
  out.user_kind = static_cast<uint32_t>(frame.pose_convention);
  if (frame.pose_convention < PLUMB_POSE_CV_CAM_FROM_WORLD ||
      frame.pose_convention > PLUMB_POSE_GL_WORLD_FROM_CAM) {
    return Invalid("frame.pose_convention " + std::to_string(frame.pose_convention) +
                   " is not a PLUMB_POSE convention");
  }
  const Result<PosePrior> prior = FirstPriorFromAbi(frame);
  if (!prior) return prior.error();
  out.prior = *prior;
  out.prior.gravity = GravityFromAbi(frame);
  if (const Status read = MorePriorsFromAbi(frame, &lists->more_priors); !read) {
    return read.error();
  }
  for (PosePrior& more : lists->more_priors) more.gravity = out.prior.gravity;
  out.more_priors = lists->more_priors;

  if (frame.num_points > kMaxPoints) {
    return Invalid("frame.num_points " + std::to_string(frame.num_points) + " is above 2^20");
  }
  if (frame.num_points > 0 && (frame.points_px == nullptr || frame.points_in_world_m == nullptr)) {
    return Invalid("frame.points_px or frame.points_in_world_m is NULL");
  }
  lists->points.resize(frame.num_points);
  for (size_t i = 0; i < frame.num_points; ++i) {
    PointMatch& point = lists->points[i];
    point.pixel = Eigen::Map<const Eigen::Vector2d>(frame.points_px + 2 * i);
    point.point_in_world = Eigen::Map<const Eigen::Vector3d>(frame.points_in_world_m + 3 * i);
    point.deviation_in_world.setZero();
    if (frame.points_deviation_m != nullptr) {
      point.deviation_in_world =
          Eigen::Map<const Eigen::Vector3d>(frame.points_deviation_m + 3 * i);
    }
  }
  out.points = lists->points;
  out.release = frame.release;
  out.release_user = frame.release_user;
  return out;
}

plumb_frame_result ResultToAbi(const FrameResult& result) {
  const int32_t convention = static_cast<int32_t>(result.user_kind);
  plumb_frame_result out{};
  out.struct_size = sizeof out;
  out.outcome = OutcomeToAbi(result.outcome);
  if (result.outcome == FrameOutcome::kProcessed) out.status = StatusToAbi(result.refined.status);
  if (result.outcome == FrameOutcome::kFailed) {
    out.error = ToAbi(result.error.code);
    std::snprintf(out.error_message, sizeof out.error_message, "%s", result.error.message.c_str());
  }
  out.frame_index = result.frame_index;
  out.user_tag = result.user_tag;
  out.timestamp_ns = result.timestamp_ns;
  out.pose_convention = convention;
  out.was_searched = result.searched ? 1 : 0;
  PoseToAbi(convention, result.refined.cam_from_world, out.q_xyzw, out.t_m);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(out.covariance) =
      result.refined.covariance;
  out.map_support = result.refined.map_support;
  out.runner_up_ratio = result.refined.runner_up_ratio;
  out.num_observed_directions = static_cast<uint32_t>(result.refined.num_observed_directions);
  out.num_segments = static_cast<uint32_t>(result.segments.size());
  out.num_matches = static_cast<uint32_t>(result.refined.matches.size());
  out.num_points_used = result.refined.num_points_used;
  out.prior_index = result.refined.prior_index;
  out.wait_ns = result.times.wait_ns;
  out.detect_ns = result.times.detect_ns;
  out.ridge_ns = result.times.ridge_ns;
  out.search_ns = result.times.search_ns;
  out.refine_ns = result.times.match_and_refine_ns;
  out.total_ns = result.times.total_ns;
  return out;
}

Result<SessionOptions> OptionsFromAbi(const plumb_session_options& options) {
  SessionOptions out;
  const auto unknown = [](const char* name, int32_t value) {
    return Invalid(std::string("options.") + name + " " + std::to_string(value) + " is unknown");
  };
  if (options.reserved != 0) return Invalid("options.reserved is not zero");
  switch (options.mode) {
    case PLUMB_MODE_INDEPENDENT:
      out.mode = SessionMode::kIndependent;
      break;
    case PLUMB_MODE_STREAM:
      out.mode = SessionMode::kStream;
      break;
    default:
      return unknown("mode", options.mode);
  }
  switch (options.method) {
    case PLUMB_METHOD_SEARCH:
      out.refiner.method = RefineMethod::kSearch;
      break;
    case PLUMB_METHOD_PAPER:
      out.refiner.method = RefineMethod::kPaper;
      break;
    default:
      return unknown("method", options.method);
  }
  switch (options.policy) {
    case PLUMB_POLICY_NEWEST:
      out.policy = FramePolicy::kNewest;
      break;
    case PLUMB_POLICY_BLOCK:
      out.policy = FramePolicy::kBlock;
      break;
    default:
      return unknown("policy", options.policy);
  }
  if (options.num_hypotheses != 0) out.refiner.num_hypotheses = options.num_hypotheses;
  if (options.min_map_support != 0.0) out.refiner.min_map_support = options.min_map_support;
  out.refiner.seed = options.seed;
  if (options.max_segments > 4096) {
    return Invalid("options.max_segments " + std::to_string(options.max_segments) +
                   " is above 4096");
  }
  if (options.max_segments != 0) out.segments.max_count = options.max_segments;
  constexpr uint32_t kEdgeFlags =
      PLUMB_EDGE_KEEP_ENDS | PLUMB_EDGE_ONE_BORDER | PLUMB_EDGE_KEEP_DUPLICATES;
  if ((options.edge_flags & ~kEdgeFlags) != 0) {
    return Invalid("options.edge_flags " + std::to_string(options.edge_flags) +
                   " has bits that are no PLUMB_EDGE");
  }
  out.segments.trim = (options.edge_flags & PLUMB_EDGE_KEEP_ENDS) == 0;
  out.segments.add_other_borders = (options.edge_flags & PLUMB_EDGE_ONE_BORDER) == 0;
  out.segments.remove_duplicates = (options.edge_flags & PLUMB_EDGE_KEEP_DUPLICATES) == 0;
  if (options.edge_min_length_px != 0.0) {
    if (!(options.edge_min_length_px >= 1.0 && options.edge_min_length_px <= 1e5)) {
      return Invalid("options.edge_min_length_px " + std::to_string(options.edge_min_length_px) +
                     " is outside 1..100000");
    }
    out.segments.min_length_px = options.edge_min_length_px;
  }
  if (options.result_capacity != 0) out.result_capacity = options.result_capacity;
  out.deadline_ns = options.deadline_ns;
  out.submit_timeout_ns = options.submit_timeout_ns;
  return out;
}

}  // namespace plumb::abi
