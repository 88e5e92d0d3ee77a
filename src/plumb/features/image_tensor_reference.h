// Camera image to network input on the CPU, in plain loops: defines what ImagePreprocessor does.
#pragma once

#include <array>
#include <vector>

#include "plumb/features/image_view.h"

namespace plumb {

/// What the network was trained with: (v - mean) / standard deviation of RGB values 0..255.
struct TensorNormalization {
  std::array<float, 3> mean = {0.0f, 0.0f, 0.0f};
  std::array<float, 3> standard_deviation = {1.0f, 1.0f, 1.0f};  // positive
};

/// The tensor [3][height][width] of a valid image.
///
/// Pixel (x, y) of the tensor samples the image at ((x + 0.5) * W / width - 0.5, ...) by bilinear
/// interpolation with repeated borders, as cv::resize with INTER_LINEAR does. YUV is BT.601 of full
/// range, each chroma sample serves its 2 x 2 pixels, and RGB is clamped to 0..255 after the
/// interpolation. Grey fills all three channels.
/// Source: ITU-T T.871 (JFIF) for the conversion.
std::vector<float> ImageToTensorReference(const ImageView& image, int width, int height,
                                          const TensorNormalization& normalization);

}  // namespace plumb
