// plumbline synth: a rendered room as a posed RGB-D sequence.
#include <memory>
#include <string>
#include <vector>

#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/output_directory.h"
#include "tools/synth/sequence_writer.h"

namespace plumb::tools {
namespace {

struct SynthOptions {
  synth::SequenceOptions sequence;
  std::string camera_model = "PINHOLE";
  std::vector<double> distortion;
  std::string out;
  bool json = false;
};

constexpr ResultFiles kSynthFiles = {"lines3d.txt", synth::IsSequenceFile};

Outcome RunSynth(SynthOptions options) {
  const LensModel model = options.camera_model == "RADTAN"           ? LensModel::kRadTan
                          : options.camera_model == "KANNALA_BRANDT" ? LensModel::kKannalaBrandt
                                                                     : LensModel::kNone;
  const Result<Lens> lens = MakeLens(model, options.distortion);
  if (!lens) return Failure{kExitUsage, "--distortion: " + lens.error().message};
  options.sequence.lens = *lens;
  if (const Status valid = options.sequence.Validate(); !valid) {
    return Failure{kExitUsage, valid.error().message};
  }
  OutputDirectory output;
  if (Outcome failed = output.Open(options.out, kSynthFiles)) return failed;
  {
    ProgressBar progress("synth", static_cast<size_t>(options.sequence.num_frames));
    Outcome interrupted;
    const Status written =
        synth::WriteSequence(options.sequence, output.path(), [&](int, int) -> Status {
          progress.Advance();
          interrupted = CheckInterrupt();
          if (interrupted) return Error{ErrorCode::kInternal, interrupted->message};
          return Ok();
        });
    if (interrupted) return interrupted;
    if (!written) return Failure{kExitIo, written.error().message};
  }
  if (Outcome failed = output.Commit()) return failed;
  if (options.json) {
    return PrintJson({{"sequence", options.out},
                      {"frames", options.sequence.num_frames},
                      {"seed", options.sequence.seed}});
  }
  return PrintText(options.out + ": " + std::to_string(options.sequence.num_frames) +
                   " frames of room " + std::to_string(options.sequence.seed) + "\n");
}

}  // namespace

void AddSynth(CLI::App& program, PendingRun& pending) {
  AddCommand<SynthOptions>(
      program, pending, "synth", "Render a furnished room as a posed RGB-D sequence",
      [](CLI::App& command, SynthOptions& options) {
        synth::SequenceOptions& s = options.sequence;
        command
            .add_option(
                "--out", options.out,
                "Directory to create; an earlier sequence of this command there is replaced")
            ->required();
        command.add_option("--seed", s.seed, "Room and camera path")->capture_default_str();
        command.add_option("--frames", s.num_frames, "Frames")->capture_default_str();
        command.add_option("--map-every", s.map_every, "Every so many frames is a map frame")
            ->capture_default_str();
        command.add_option("--width", s.width_px, "Image width [px]")->capture_default_str();
        command.add_option("--height", s.height_px, "Image height [px]")->capture_default_str();
        command.add_option("--focal", s.focal_px, "Focal length [px]")->capture_default_str();
        command.add_option("--camera-model", options.camera_model, "Lens of the camera")
            ->check(CLI::IsMember({"PINHOLE", "RADTAN", "KANNALA_BRANDT"}))
            ->capture_default_str();
        command
            .add_option(
                "--distortion", options.distortion,
                "Its coefficients, separated by commas: RADTAN k1,k2,p1,p2[,k3[,k4,k5,k6]], "
                "KANNALA_BRANDT k1,k2,k3,k4")
            ->delimiter(',')
            ->expected(1, 8);
        command.add_option("--sweep", s.sweep_deg, "Turn of the camera in all [deg]")
            ->capture_default_str();
        command
            .add_option("--depth-noise", s.depth_noise,
                        "Standard deviation of the depth at 1 m [m]; grows with its square")
            ->capture_default_str();
        command.add_option("--image-noise", s.image_noise, "Standard deviation [grey levels]")
            ->capture_default_str();
        command.add_option("--samples", s.samples_per_axis, "Rays a pixel = square of this")
            ->capture_default_str();
        command.add_flag("!--no-shadows", s.shadows, "Lamps shine through furniture");
        command.add_flag("--png", s.png, "Exact colour images instead of JPEG");
        command.add_flag("--json", options.json, "Print {sequence, frames, seed}");
        command.footer(
            "Writes the layout of TUM RGB-D with exact poses, exact 3D edges (lines3d.txt), their\n"
            "visible parts (annotations.json), map and query frames and priors that are off.\n"
            "Examples:\n"
            "  plumbline synth --out room --seed 2 --frames 48\n"
            "  plumbline synth --out tiny --frames 6 --width 320 --height 240 --samples 1\n"
            "  plumbline synth --out noisy --depth-noise 0.002 --image-noise 4\n"
            "  plumbline synth --out barrel --camera-model RADTAN --distortion=-0.3,0.1,0,0");
      },
      RunSynth);
}

}  // namespace plumb::tools
