// COLMAP models in both forms: what is read, what is refused, and that nothing crashes the reader.
#include "tools/datasets/colmap_model.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plumb/base/split_mix64.h"
#include "tests/tools/colmap_files.h"
#include "tests/tools/temporary_directory.h"

namespace plumb::tools {
namespace {

using ::testing::AllOf;
using testing::AsColmapBinary;
using testing::AsColmapText;
using testing::ColmapFileCamera;
using testing::ColmapFileImage;
using testing::ColmapFiles;
using ::testing::HasSubstr;
using testing::TemporaryDirectory;

Rigid3 Pose(double s) { return {ExpSo3({0.3 * s, -0.2, 0.1 * s}), {s, 2.0, -0.5 * s}}; }

std::vector<ColmapFileCamera> Cameras() {
  return {{7, 1, "PINHOLE", 640, 480, {500, 510, 320, 240}},
          {3, 4, "OPENCV", 320, 240, {200, 210, 160.25, 120, -0.3, 0.1, 0.001, -0.002}}};
}

std::vector<ColmapFileImage> Images() {
  return {{9, Pose(0.5), 7, "b/two words.jpg", 3},
          {2, Pose(1.5), 3, "a.png", 0},
          {4, Pose(-1.0), 7, "c.png", 1}};
}

Result<ColmapModel> ParseText(const ColmapFiles& files) {
  return ParseColmapText(files.cameras, files.images, "cameras.txt", "images.txt");
}
Result<ColmapModel> ParseBinary(const ColmapFiles& files) {
  return ParseColmapBinary(files.cameras, files.images, "cameras.bin", "images.bin");
}

void ExpectTheModel(const Result<ColmapModel>& model) {
  ASSERT_TRUE(model) << model.error().message;
  ASSERT_EQ(model->cameras.size(), 2u);
  EXPECT_EQ(model->cameras[0].id, 3u);
  EXPECT_EQ(model->cameras[1].id, 7u);
  const Camera& pinhole = model->cameras[1].camera.pinhole;
  EXPECT_EQ(pinhole, (Camera{500, 510, 319.5, 239.5, 640, 480}));  // half a pixel less
  EXPECT_TRUE(model->cameras[1].camera.lens.IsNone());
  EXPECT_EQ(model->cameras[0].camera.lens,
            *MakeLens(LensModel::kRadTan, std::vector<double>{-0.3, 0.1, 0.001, -0.002}));
  ASSERT_EQ(model->images.size(), 3u);
  const char* names[] = {"a.png", "b/two words.jpg", "c.png"};
  const uint32_t ids[] = {2, 9, 4};
  const double at[] = {1.5, 0.5, -1.0};
  const size_t cameras[] = {0, 1, 1};
  for (size_t i = 0; i < 3; ++i) {
    const ColmapImage& image = model->images[i];
    EXPECT_EQ(image.name, names[i]);
    EXPECT_EQ(image.id, ids[i]);
    EXPECT_EQ(image.camera, cameras[i]);
    EXPECT_LT(DistanceBetween(image.cam_from_world, Pose(at[i])).position_m, 1e-12);
    EXPECT_LT(DistanceBetween(image.cam_from_world, Pose(at[i])).rotation_rad, 1e-7);
  }
}

TEST(ColmapModel, BothFormsSayTheSame) {
  ExpectTheModel(ParseText(AsColmapText(Cameras(), Images())));
  ExpectTheModel(ParseBinary(AsColmapBinary(Cameras(), Images())));
}

TEST(ColmapModel, DirectoriesAreReadInEitherForm) {
  const TemporaryDirectory dir;
  const ColmapFiles text = AsColmapText(Cameras(), Images());
  dir.Write("cameras.txt", text.cameras);
  dir.Write("images.txt", text.images);
  ExpectTheModel(ReadColmapModel(dir.path()));
  // The binary form wins, as in COLMAP.
  const ColmapFiles binary = AsColmapBinary(Cameras(), Images());
  dir.Write("cameras.bin", binary.cameras);
  dir.Write("images.bin", binary.images);
  dir.Write("images.txt", "nonsense");
  ExpectTheModel(ReadColmapModel(dir.path()));
  const auto missing = ReadColmapModel(dir / "no");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
}

TEST(ColmapModel, EveryKnownModelBecomesOneOfOurs) {
  struct Case {
    int32_t id;
    const char* name;
    std::vector<double> parameters;
    double fy;
    LensModel lens;
    std::vector<double> coefficients;
  };
  const Case cases[] = {
      {0, "SIMPLE_PINHOLE", {300, 160, 120}, 300, LensModel::kNone, {}},
      {1, "PINHOLE", {300, 301, 160, 120}, 301, LensModel::kNone, {}},
      {2, "SIMPLE_RADIAL", {300, 160, 120, .1}, 300, LensModel::kRadTan, {.1, 0, 0, 0}},
      {3, "RADIAL", {300, 160, 120, .1, .2}, 300, LensModel::kRadTan, {.1, .2, 0, 0}},
      {4,
       "OPENCV",
       {300, 301, 160, 120, .1, .2, .3, .4},
       301,
       LensModel::kRadTan,
       {.1, .2, .3, .4}},
      {5,
       "OPENCV_FISHEYE",
       {300, 301, 160, 120, .1, .2, .3, .4},
       301,
       LensModel::kKannalaBrandt,
       {.1, .2, .3, .4}},
      {6,
       "FULL_OPENCV",
       {300, 301, 160, 120, .1, .2, .3, .4, .5, .6, .7, .8},
       301,
       LensModel::kRadTan,
       {.1, .2, .3, .4, .5, .6, .7, .8}}};
  for (const Case& c : cases) {
    const std::vector<ColmapFileCamera> cameras = {{7, c.id, c.name, 320, 240, c.parameters}};
    const std::vector<ColmapFileImage> images = {{1, Pose(0), 7, "a.png"}};
    for (const auto& model :
         {ParseText(AsColmapText(cameras, images)), ParseBinary(AsColmapBinary(cameras, images))}) {
      ASSERT_TRUE(model) << c.name << ": " << model.error().message;
      const ImageCamera& camera = model->cameras[0].camera;
      EXPECT_EQ(camera.pinhole, (Camera{300, c.fy, 159.5, 119.5, 320, 240})) << c.name;
      EXPECT_EQ(camera.lens, c.coefficients.empty() ? Lens{} : *MakeLens(c.lens, c.coefficients))
          << c.name;
    }
  }
}

TEST(ColmapModel, OtherModelsAreNamedWithTheirCamera) {
  const std::vector<ColmapFileImage> images = {{1, Pose(0), 5, "a.png"}};
  const ColmapFileCamera fov{5, 7, "FOV", 320, 240, {300, 300, 160, 120, 0.9}};
  for (const auto& model :
       {ParseText(AsColmapText({fov}, images)), ParseBinary(AsColmapBinary({fov}, images))}) {
    ASSERT_FALSE(model);
    EXPECT_EQ(model.error().code, ErrorCode::kUnsupported);
    EXPECT_THAT(model.error().message, AllOf(HasSubstr("camera 5"), HasSubstr("FOV")));
  }
  const auto strange = ParseBinary(AsColmapBinary({{5, 99, "?", 320, 240, {1}}}, images));
  ASSERT_FALSE(strange);
  EXPECT_THAT(strange.error().message, AllOf(HasSubstr("camera 5"), HasSubstr("number 99")));
  // A camera that no image uses may be of any kind.
  std::vector<ColmapFileCamera> cameras = Cameras();
  cameras.push_back(fov);
  EXPECT_TRUE(ParseText(AsColmapText(cameras, Images())));
  EXPECT_TRUE(ParseBinary(AsColmapBinary(cameras, Images())));
}

TEST(ColmapModel, ErrorsNameTheirPlace) {
  const auto expect = [](const std::string& cameras, const std::string& images,
                         const std::string& where, const std::string& what) {
    const auto model = ParseColmapText(cameras, images, "cameras.txt", "images.txt");
    ASSERT_FALSE(model) << what;
    EXPECT_EQ(model.error().code, ErrorCode::kCorruptData);
    EXPECT_THAT(model.error().message, AllOf(HasSubstr(where), HasSubstr(what)));
  };
  const std::string camera = "1 PINHOLE 640 480 500 500 320 240\n";
  const std::string image = "1 1 0 0 0 0 0 0 1 a.png\n\n";
  expect("# c\n1 PINHOLE 640 480 500 500 320\n", image, "cameras.txt:2", "3 parameters");
  expect("1 PINHOLE 640 x 500 500 320 240\n", image, "cameras.txt:1", "no camera");
  expect("1 PINHOLE 640 480 500 nan 320 240\n", image, "cameras.txt:1", "nan");
  expect("1 PINHOLE 640 480 500 -500 320 240\n", image, "cameras.txt:1", "focal length");
  expect("1 PINHOLE 0 480 500 500 320 240\n", image, "cameras.txt:1", "0 x 480");
  expect(camera + camera, image, "cameras.txt:2", "camera 1 again");
  expect("", image, "images.txt:1", "camera 1, which is not");
  expect(camera, "", "images.txt", "no image");
  expect(camera, "1 1 0 0 0 0 0 1 a.png\n\n", "images.txt:1", "CAMERA_ID");
  expect(camera, "1 2 0 0 0 0 0 0 1 a.png\n\n", "images.txt:1", "norm of 2");
  expect(camera, "1 1 0 0 0 0 0 0 1\n\n", "images.txt:1", "no name");
  expect(camera, "x 1 0 0 0 0 0 0 1 a.png\n\n", "images.txt:1", "no image");
  expect(camera, "1 1 0 0 0 2e7 0 0 1 a.png\n\n", "images.txt:1", "image 1 lies more than 1e7 m");
  expect(camera, image + "1 1 0 0 0 0 0 0 1 b.png\n\n", "images.txt", "image 1 twice");
  expect(camera, image + "2 1 0 0 0 0 0 0 1 a.png\n\n", "images.txt", "a.png twice");
}

TEST(ColmapModel, NoImageIsTakenForObservations) {
  const std::string camera = "1 PINHOLE 640 480 500 500 320 240\n";
  const std::string a = "1 1 0 0 0 0 0 0 1 a.png\n", b = "2 1 0 0 0 0 0 0 1 b.png\n";
  const std::string number = "3 1 0 0 0 0 0 0 1 10\n";  // a name of digits
  const auto parse = [&](const std::string& images) {
    return ParseColmapText(camera, images, "cameras.txt", "images.txt");
  };
  for (const std::string& images : {a + b, "# two\n" + a + number, a + "0.5 1.5 7 1 2\n" + b + "\n",
                                    a + "0.5 1.5 7.5\n" + b + "\n", a + "0.5 nan 7\n" + b + "\n"}) {
    const auto model = parse(images);
    ASSERT_FALSE(model) << images;
    EXPECT_EQ(model.error().code, ErrorCode::kCorruptData);
    const std::string line = images.starts_with('#') ? "images.txt:3" : "images.txt:2";
    EXPECT_THAT(model.error().message, AllOf(HasSubstr(line), HasSubstr("of image 1")));
  }
  // Editors and scripts drop the last blank line.
  for (const std::string& images :
       {a + "\n" + b, a + " \t\n" + b + "\n\n\n", a + "0.5 1.5 7 2 -3.25 -1\n" + b}) {
    const auto model = parse(images);
    ASSERT_TRUE(model) << model.error().message;
    EXPECT_EQ(model->images.size(), 2u) << images;
  }
}

TEST(ColmapModel, EveryTruncationOfTheBinaryFormIsRefused) {
  const ColmapFiles files = AsColmapBinary(Cameras(), Images());
  for (size_t size = 0; size < files.cameras.size(); ++size) {
    const auto model = ParseBinary({files.cameras.substr(0, size), files.images});
    ASSERT_FALSE(model) << size;
    EXPECT_THAT(model.error().message, HasSubstr("cameras.bin")) << size;
  }
  for (size_t size = 0; size < files.images.size(); ++size) {
    const auto model = ParseBinary({files.cameras, files.images.substr(0, size)});
    ASSERT_FALSE(model) << size;
    EXPECT_THAT(model.error().message, HasSubstr("images.bin")) << size;
  }
  EXPECT_FALSE(ParseBinary({files.cameras + "x", files.images}));
  EXPECT_FALSE(ParseBinary({files.cameras, files.images + "x"}));
}

TEST(ColmapModel, TruncatedAndDamagedFilesGiveAnErrorOrAModelAndNothingElse) {
  SplitMix64 random(4);
  const ColmapFiles forms[] = {AsColmapText(Cameras(), Images()),
                               AsColmapBinary(Cameras(), Images())};
  for (const ColmapFiles& files : forms) {
    const bool binary = &files == &forms[1];
    const auto parse = [&](const ColmapFiles& damaged) {
      const auto model = binary ? ParseBinary(damaged) : ParseText(damaged);
      if (!model) {
        EXPECT_FALSE(model.error().message.empty());
        return;
      }
      for (const ColmapImage& image : model->images) {
        EXPECT_TRUE(image.cam_from_world.IsFinite());
        EXPECT_LT(image.camera, model->cameras.size());
      }
      for (const ColmapCamera& camera : model->cameras) {
        EXPECT_TRUE(camera.camera.pinhole.IsValid());
      }
    };
    for (size_t size = 0; size < files.cameras.size(); ++size) {
      parse({files.cameras.substr(0, size), files.images});
    }
    for (size_t size = 0; size < files.images.size(); ++size) {
      parse({files.cameras, files.images.substr(0, size)});
    }
    for (std::string ColmapFiles::*file : {&ColmapFiles::cameras, &ColmapFiles::images}) {
      for (size_t bit = 0; bit < 8 * (files.*file).size(); ++bit) {
        ColmapFiles damaged = files;
        (damaged.*file)[bit / 8] ^= static_cast<char>(1 << bit % 8);
        parse(damaged);
      }
      for (int round = 0; round < 500; ++round) {
        ColmapFiles damaged = files;
        for (int k = 0; k < 4; ++k) {
          (damaged.*file)[random.Next() % (damaged.*file).size()] =
              static_cast<char>(random.Next());
        }
        parse(damaged);
      }
    }
  }
}

}  // namespace
}  // namespace plumb::tools
