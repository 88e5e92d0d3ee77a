/* A host program in C99: uses the interface as meant, then in every wrong way there is.
 * usage: abi_test FIXTURE (from write_fixture) */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <plumbline/plumbline.h>

#define NUM_FRAMES 4
#define SECOND_NS INT64_C(1000000000)

static int num_failures = 0;

#define EXPECT(condition)                                                             \
  do {                                                                                \
    if (!(condition)) {                                                               \
      ++num_failures;                                                                 \
      fprintf(stderr, "%s:%d: %s (last error: %s)\n", __FILE__, __LINE__, #condition, \
              plumb_last_error());                                                    \
    }                                                                                 \
  } while (0)

/* An error whose text names what was wrong. */
#define EXPECT_ERROR(call, code, part)                  \
  do {                                                  \
    EXPECT((call) == (code));                           \
    EXPECT(strstr(plumb_last_error(), (part)) != NULL); \
  } while (0)

typedef struct fixture {
  char map_path[1024];
  uint8_t* pixels[NUM_FRAMES];
  uint8_t* through_radtan; /* frame 0 through lenses */
  uint8_t* through_fisheye;
  uint32_t width_px, height_px;
  double camera[4];
  double prior_q[NUM_FRAMES][4], prior_t[NUM_FRAMES][3];
  double true_q[NUM_FRAMES][4], true_t[NUM_FRAMES][3];
} fixture;

static int read_numbers(FILE* file, double* out, int count) {
  int i;
  for (i = 0; i < count; ++i) {
    if (fscanf(file, "%lf", &out[i]) != 1) return 0;
  }
  return 1;
}

/* All images have one size. */
static uint8_t* read_image(const char* path, fixture* out) {
  unsigned w, h;
  uint8_t* pixels;
  FILE* file = fopen(path, "rb");
  if (file == NULL || fscanf(file, "P5 %u %u 255", &w, &h) != 2) return NULL;
  fgetc(file);
  out->width_px = w;
  out->height_px = h;
  pixels = malloc((size_t)w * h);
  if (pixels == NULL || fread(pixels, w, h, file) != h) return NULL;
  fclose(file);
  return pixels;
}

static int read_fixture(const char* folder, fixture* out) {
  char path[1100];
  FILE* file;
  int i;
  snprintf(out->map_path, sizeof out->map_path, "%s/map", folder);
  snprintf(path, sizeof path, "%s/poses.txt", folder);
  file = fopen(path, "r");
  if (file == NULL) return 0;
  for (i = 0; i < NUM_FRAMES; ++i) {
    if (!read_numbers(file, out->camera, 4) || !read_numbers(file, out->prior_q[i], 4) ||
        !read_numbers(file, out->prior_t[i], 3) || !read_numbers(file, out->true_q[i], 4) ||
        !read_numbers(file, out->true_t[i], 3)) {
      fclose(file);
      return 0;
    }
  }
  fclose(file);
  for (i = 0; i < NUM_FRAMES; ++i) {
    snprintf(path, sizeof path, "%s/%d.pgm", folder, i);
    out->pixels[i] = read_image(path, out);
    if (out->pixels[i] == NULL) return 0;
  }
  snprintf(path, sizeof path, "%s/radtan.pgm", folder);
  out->through_radtan = read_image(path, out);
  snprintf(path, sizeof path, "%s/fisheye.pgm", folder);
  out->through_fisheye = read_image(path, out);
  return out->through_radtan != NULL && out->through_fisheye != NULL;
}

static plumb_frame make_frame(const fixture* f, int i) {
  plumb_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.struct_size = sizeof frame;
  frame.format = PLUMB_FORMAT_GRAY8;
  frame.width_px = f->width_px;
  frame.height_px = f->height_px;
  frame.planes[0] = f->pixels[i];
  frame.row_stride_bytes[0] = f->width_px;
  frame.fx = f->camera[0];
  frame.fy = f->camera[1];
  frame.cx = f->camera[2];
  frame.cy = f->camera[3];
  frame.timestamp_ns = 1000 + i;
  frame.user_tag = 70u + (unsigned)i;
  frame.pose_convention = PLUMB_POSE_CV_CAM_FROM_WORLD;
  memcpy(frame.prior_q_xyzw, f->prior_q[i], sizeof frame.prior_q_xyzw);
  memcpy(frame.prior_t_m, f->prior_t[i], sizeof frame.prior_t_m);
  return frame;
}

static plumb_session_options make_options(const plumb_map* map) {
  plumb_session_options options;
  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.map = map;
  options.model = "lsd";
  options.policy = PLUMB_POLICY_BLOCK;
  return options;
}

static plumb_session* make_session(const plumb_session_options* options) {
  plumb_session* session = NULL;
  EXPECT(plumb_session_create(options, &session) == PLUMB_OK);
  return session;
}

static plumb_frame_result empty_result(void) {
  plumb_frame_result result;
  memset(&result, 0, sizeof result);
  result.struct_size = sizeof result;
  return result;
}

/* Of the translation of cam_from_world, which moves with both kinds of error. */
static double translation_error(const fixture* f, int i, const double t[3]) {
  double sum = 0.0;
  int k;
  for (k = 0; k < 3; ++k) sum += (t[k] - f->true_t[i][k]) * (t[k] - f->true_t[i][k]);
  return sqrt(sum);
}

static void test_maps(const fixture* f) {
  plumb_map* map = NULL;
  plumb_map_info info;
  EXPECT(plumb_map_open(f->map_path, &map) == PLUMB_OK);
  memset(&info, 0, sizeof info);
  info.struct_size = sizeof info;
  EXPECT(plumb_map_get_info(map, &info) == PLUMB_OK);
  EXPECT(info.struct_size == sizeof info);
  EXPECT(info.num_key_frames == 5);
  EXPECT(info.num_lines > 50);
  EXPECT(info.num_lifted_segments > info.num_lines);
  EXPECT(strcmp(info.detector, "lsd") == 0);
  EXPECT_ERROR(plumb_map_get_info(NULL, &info), PLUMB_ERROR_INVALID_ARGUMENT, "map");
  EXPECT_ERROR(plumb_map_get_info(map, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "plumb_map_info");
  info.struct_size = 0;
  EXPECT_ERROR(plumb_map_get_info(map, &info), PLUMB_ERROR_INVALID_ARGUMENT, "struct_size 0");
  plumb_map_destroy(map);
  plumb_map_destroy(NULL);
  map = (plumb_map*)&info;
  EXPECT_ERROR(plumb_map_open("/nowhere/at/all", &map), PLUMB_ERROR_NOT_FOUND, "/nowhere/at/all");
  EXPECT(map == NULL);
  EXPECT_ERROR(plumb_map_open(NULL, &map), PLUMB_ERROR_INVALID_ARGUMENT, "path");
  EXPECT_ERROR(plumb_map_open(f->map_path, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "out_map");
}

static void test_frames_in_order(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_session_stats stats;
  int i, k;
  EXPECT(plumb_session_poll_result(session, &result) == PLUMB_NOT_READY);
  EXPECT(plumb_session_wait_result(session, 1000, &result) == PLUMB_TIMEOUT);
  for (i = 0; i < NUM_FRAMES; ++i) {
    plumb_frame frame = make_frame(f, i);
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  }
  for (i = 0; i < NUM_FRAMES; ++i) {
    EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
    EXPECT(result.struct_size == sizeof result);
    EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
    EXPECT(result.status == PLUMB_STATUS_REFINED);
    EXPECT(result.error == PLUMB_OK && result.error_message[0] == '\0');
    EXPECT(result.frame_index == (uint64_t)i);
    EXPECT(result.user_tag == 70u + (unsigned)i);
    EXPECT(result.timestamp_ns == 1000 + i);
    EXPECT(result.pose_convention == PLUMB_POSE_CV_CAM_FROM_WORLD);
    EXPECT(result.was_searched == 1);
    EXPECT(translation_error(f, i, f->prior_t[i]) > 0.03);
    EXPECT(translation_error(f, i, result.t_m) < 0.01);
    EXPECT(result.map_support > 0.3 && result.map_support <= 1.0);
    EXPECT(result.num_observed_directions == 6);
    EXPECT(result.num_segments > 20 && result.num_matches > 10);
    EXPECT(result.detect_ns > 0 && result.ridge_ns > 0 && result.refine_ns > 0);
    EXPECT(result.total_ns >= result.wait_ns + result.detect_ns + result.ridge_ns);
    for (k = 0; k < 6; ++k) {
      const double sigma = sqrt(result.covariance[7 * k]);
      EXPECT(sigma > 0.0 && sigma < 0.02);
    }
  }
  memset(&stats, 0, sizeof stats);
  stats.struct_size = sizeof stats;
  EXPECT(plumb_session_get_stats(session, &stats) == PLUMB_OK);
  EXPECT(stats.num_submitted == NUM_FRAMES && stats.num_processed == NUM_FRAMES);
  EXPECT(stats.num_dropped == 0 && stats.num_failed == 0 && stats.num_results_discarded == 0);
  plumb_session_destroy(session);
}

/* world_from_cam of a cam_from_world pose, for which q' = conj(q), t' = -R(q') t. */
static void invert_pose(const double q[4], const double t[3], double out_q[4], double out_t[3]) {
  const double x = -q[0], y = -q[1], z = -q[2], w = q[3];
  const double cx = y * t[2] - z * t[1], cy = z * t[0] - x * t[2], cz = x * t[1] - y * t[0];
  out_q[0] = x;
  out_q[1] = y;
  out_q[2] = z;
  out_q[3] = w;
  out_t[0] = -(t[0] + 2.0 * (w * cx + y * cz - z * cy));
  out_t[1] = -(t[1] + 2.0 * (w * cy + z * cx - x * cz));
  out_t[2] = -(t[2] + 2.0 * (w * cz + x * cy - y * cx));
}

/* The same frame in all four conventions gives the same pose. */
static void test_pose_conventions(const fixture* f, const plumb_map* map) {
  static const int32_t conventions[4] = {PLUMB_POSE_CV_CAM_FROM_WORLD, PLUMB_POSE_CV_WORLD_FROM_CAM,
                                         PLUMB_POSE_GL_CAM_FROM_WORLD,
                                         PLUMB_POSE_GL_WORLD_FROM_CAM};
  double reference[3] = {0.0, 0.0, 0.0};
  int c, k;
  for (c = 0; c < 4; ++c) {
    plumb_session_options options = make_options(map);
    plumb_session* session = make_session(&options);
    plumb_frame_result result = empty_result();
    plumb_frame frame = make_frame(f, 0);
    double q[4], t[3];
    memcpy(q, frame.prior_q_xyzw, sizeof q);
    memcpy(t, frame.prior_t_m, sizeof t);
    if (c >= 2) { /* y and z of the camera change their signs: (1, 0, 0, 0) * q */
      const double gl[4] = {q[3], -q[2], q[1], -q[0]};
      memcpy(q, gl, sizeof q);
      t[1] = -t[1];
      t[2] = -t[2];
    }
    if (c % 2 == 1) {
      invert_pose(q, t, frame.prior_q_xyzw, frame.prior_t_m);
    } else {
      memcpy(frame.prior_q_xyzw, q, sizeof q);
      memcpy(frame.prior_t_m, t, sizeof t);
    }
    frame.pose_convention = conventions[c];
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
    EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
    EXPECT(result.pose_convention == conventions[c]);
    EXPECT(result.status == PLUMB_STATUS_REFINED);
    memcpy(t, result.t_m, sizeof t);
    if (c % 2 == 1) invert_pose(result.q_xyzw, result.t_m, q, t);
    if (c >= 2) {
      t[1] = -t[1];
      t[2] = -t[2];
    }
    if (c == 0) memcpy(reference, t, sizeof t);
    for (k = 0; k < 3; ++k) EXPECT(fabs(t[k] - reference[k]) < 1e-6);
    plumb_session_destroy(session);
  }
}

static void test_covariance_as_prior(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_frame frame = make_frame(f, 0);
  int k;
  frame.prior_uncertainty = PLUMB_UNCERTAINTY_COVARIANCE;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "prior_covariance");
  for (k = 0; k < 6; ++k) frame.prior_covariance[7 * k] = k < 3 ? 4e-4 : 3.3e-3;
  frame.prior_covariance[1] = 1e-4;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "symmetric");
  frame.prior_covariance[6] = 1e-4;
  frame.prior_covariance[35] = -1.0;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "positive semi-definite");
  frame.prior_covariance[35] = 3.3e-3;
  EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  plumb_session_destroy(session);
}

static void test_points(const fixture* f, const plumb_map* map) {
  const double px[4] = {10, 20, 30, 40}, world[6] = {0, 0, 3, 1, 0, 3};
  double bad[6] = {0, 0, 3, 1, 0, 3};
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_frame frame = make_frame(f, 0);
  frame.num_points = 2;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "points_px");
  bad[4] = NAN;
  frame.points_px = px;
  frame.points_in_world_m = bad;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "points[1]");
  frame.points_in_world_m = world; /* two wrong points change nothing */
  EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  plumb_session_destroy(session);
}

/* Refines frame 0; returns its result. */
static plumb_frame_result refine_frame(const plumb_session_options* options,
                                       const plumb_frame* frame) {
  plumb_session* session = make_session(options);
  plumb_frame_result result = empty_result();
  EXPECT(plumb_session_submit_frame(session, frame) == PLUMB_OK);
  EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
  EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
  plumb_session_destroy(session);
  return result;
}

/* Images through a lens are refined as well as those without; the same images taken for a
 * pinhole's are not; a caller from before there were lenses has none. */
static void test_lenses(const fixture* f, const plumb_map* map) {
  const plumb_session_options options = make_options(map);
  plumb_frame frame = make_frame(f, 0);
  plumb_frame_result result;
  frame.planes[0] = f->through_radtan;
  frame.lens_model = PLUMB_LENS_RADTAN;
  frame.lens_distortion[0] = -0.3;
  frame.lens_distortion[1] = 0.1;
  frame.lens_distortion[2] = 0.001;
  frame.lens_distortion[3] = -0.002;
  result = refine_frame(&options, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  frame.struct_size = (uint32_t)offsetof(plumb_frame, lens_model);
  result = refine_frame(&options, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED || translation_error(f, 0, result.t_m) > 0.01);

  frame = make_frame(f, 0);
  frame.planes[0] = f->through_fisheye;
  frame.lens_model = PLUMB_LENS_KANNALA_BRANDT;
  frame.lens_distortion[0] = -0.02;
  frame.lens_distortion[1] = 0.005;
  result = refine_frame(&options, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
}

static plumb_pose_prior make_prior(const double q[4], const double t[3]) {
  plumb_pose_prior prior;
  memset(&prior, 0, sizeof prior);
  prior.struct_size = sizeof prior;
  memcpy(prior.q_xyzw, q, sizeof prior.q_xyzw);
  memcpy(prior.t_m, t, sizeof prior.t_m);
  return prior;
}

/* As a later version may have it. */
typedef struct longer_prior {
  plumb_pose_prior prior;
  double added;
} longer_prior;

/* The right one of several places is refined, wherever it stands; broken ones are named. */
static void test_more_priors(const fixture* f, const plumb_map* map) {
  const double far_t[3] = {f->true_t[0][0] + 1.0, f->true_t[0][1] - 0.8, f->true_t[0][2] + 0.6};
  const plumb_session_options plain = make_options(map);
  plumb_session_options options = plain;
  plumb_session* session = make_session(&options);
  plumb_pose_prior more[2];
  longer_prior longer[2];
  plumb_frame frame = make_frame(f, 0);
  plumb_frame_result result;
  EXPECT(refine_frame(&plain, &frame).prior_index == 0);
  more[0] = make_prior(f->prior_q[0], far_t);
  more[1] = make_prior(f->prior_q[0], f->prior_t[0]);
  memcpy(frame.prior_t_m, far_t, sizeof far_t);
  result = refine_frame(&plain, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  frame.more_priors = more;
  frame.num_more_priors = 2;
  result = refine_frame(&plain, &frame);
  EXPECT(result.status == PLUMB_STATUS_REFINED);
  EXPECT(result.prior_index == 2);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  frame.struct_size = (uint32_t)offsetof(plumb_frame, more_priors); /* from before there were any */
  result = refine_frame(&plain, &frame);
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  frame.struct_size = sizeof frame;
  frame.num_more_priors = 1;
  result = refine_frame(&plain, &frame); /* both are wrong: the frame's own is kept */
  EXPECT(result.status != PLUMB_STATUS_REFINED);
  EXPECT(result.prior_index == 0);
  EXPECT(memcmp(result.t_m, far_t, sizeof far_t) == 0);

  /* A newer caller's entries are longer. */
  memset(longer, 0, sizeof longer);
  longer[0].prior = more[0];
  longer[1].prior = more[1];
  longer[0].prior.struct_size = longer[1].prior.struct_size = sizeof longer[0];
  frame.more_priors = &longer[0].prior;
  frame.num_more_priors = 2;
  result = refine_frame(&plain, &frame);
  EXPECT(result.prior_index == 2);
  EXPECT(translation_error(f, 0, result.t_m) < 0.01);
  longer[1].added = 1.0;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_UNSUPPORTED,
               "more_priors[1]");

  frame.more_priors = more;
#define EXPECT_REFUSED(change, part)                                                               \
  do {                                                                                             \
    more[1] = make_prior(f->prior_q[0], f->prior_t[0]);                                            \
    change;                                                                                        \
    EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT, part); \
  } while (0)
  EXPECT_REFUSED(more[1].struct_size = 0, "more_priors[1].struct_size 0");
  EXPECT_REFUSED(more[1].struct_size = sizeof longer[0], "more_priors[1].struct_size 376");
  EXPECT_REFUSED(more[1].uncertainty = 7, "more_priors[1].uncertainty 7");
  EXPECT_REFUSED(more[1].t_m[2] = NAN, "more_priors[1].q_xyzw or t_m is not finite");
  EXPECT_REFUSED(more[1].q_xyzw[0] = 3.0, "more_priors[1].q_xyzw has norm");
  EXPECT_REFUSED(more[1].position_sigma_m = -0.25, "more_priors[1].position_sigma_m -0.25");
  EXPECT_REFUSED(more[1].uncertainty = PLUMB_UNCERTAINTY_COVARIANCE, "more_priors[1].covariance");
  EXPECT_REFUSED(more[0].struct_size = 0, "more_priors[0]: plumb_pose_prior.struct_size 0");
  EXPECT_REFUSED(more[0].struct_size = 369, "more_priors[0].struct_size 369");
  more[0].struct_size = sizeof more[0];
  EXPECT_REFUSED(frame.more_priors = NULL, "more_priors is NULL");
  frame.more_priors = more;
  EXPECT_REFUSED(frame.num_more_priors = PLUMB_MAX_MORE_PRIORS + 1, "num_more_priors 9");
  frame.num_more_priors = 2;
  EXPECT_REFUSED(frame.reserved_priors = 1, "reserved_priors");
  frame.reserved_priors = 0;
#undef EXPECT_REFUSED
  plumb_session_destroy(session);
  options.method = PLUMB_METHOD_PAPER;
  session = make_session(&options);
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "more_priors has 2 entries");
  plumb_session_destroy(session);
}

/* Each detection option changes what is found; a caller from before they were there has none. */
static void test_detection_options(const fixture* f, const plumb_map* map) {
  const plumb_frame frame = make_frame(f, 0);
  const plumb_session_options plain = make_options(map);
  plumb_session_options options;
  const uint32_t usual = refine_frame(&plain, &frame).num_segments;
  EXPECT(usual > 40);
#define EXPECT_SEGMENTS(change, relation)                         \
  do {                                                            \
    options = plain;                                              \
    change;                                                       \
    EXPECT(refine_frame(&options, &frame).num_segments relation); \
  } while (0)
  EXPECT_SEGMENTS(options.score_threshold = 0.5, < usual);
  EXPECT_SEGMENTS(options.min_length_px = 30.0, < usual);
  EXPECT_SEGMENTS(options.structural_nms = 2000.0, < usual);
  EXPECT_SEGMENTS(options.top_k = 10, <= 20); /* each may bring its other border */
  EXPECT_SEGMENTS(options.top_k = 10; options.edge_flags = PLUMB_EDGE_ONE_BORDER, <= 10);
  EXPECT_SEGMENTS(options.tile_columns = 2; options.tile_rows = 2, != 0);
  EXPECT_SEGMENTS(options.tile_columns = options.tile_rows = PLUMB_TILES_AUTO, == usual);
  EXPECT_SEGMENTS(options.edge_min_length_px = 30.0, < usual);
  EXPECT_SEGMENTS(options.edge_flags = PLUMB_EDGE_KEEP_DUPLICATES, >= usual); /* LSD has none */
  EXPECT_SEGMENTS(options.edge_flags = PLUMB_EDGE_KEEP_ENDS, != 0);
  EXPECT_SEGMENTS(options.struct_size = (uint32_t)offsetof(plumb_session_options, score_threshold);
                  options.top_k = 1, == usual);
#undef EXPECT_SEGMENTS
}

/* Whatever the settings: results come, in order, and a black image returns the prior. */
static void test_every_mode_and_method(const fixture* f, const plumb_map* map) {
  int combination;
  uint8_t* black = calloc((size_t)f->width_px, f->height_px);
  if (black == NULL) return;
  for (combination = 0; combination < 4; ++combination) {
    plumb_session_options options = make_options(map);
    plumb_session* session;
    int i, k;
    options.mode = combination % 2 == 0 ? PLUMB_MODE_INDEPENDENT : PLUMB_MODE_STREAM;
    options.method = combination < 2 ? PLUMB_METHOD_SEARCH : PLUMB_METHOD_PAPER;
    session = make_session(&options);
    for (i = 0; i < NUM_FRAMES; ++i) {
      plumb_frame_result result = empty_result();
      plumb_frame frame = make_frame(f, i);
      if (i == NUM_FRAMES - 1) frame.planes[0] = black;
      EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
      EXPECT(plumb_session_wait_result(session, 60 * SECOND_NS, &result) == PLUMB_OK);
      EXPECT(result.outcome == PLUMB_OUTCOME_PROCESSED);
      EXPECT(result.status != PLUMB_STATUS_NONE);
      EXPECT(result.frame_index == (uint64_t)i);
      for (k = 0; k < 3; ++k) EXPECT(isfinite(result.t_m[k]));
      if (i < NUM_FRAMES - 1) continue;
      EXPECT(result.status == PLUMB_STATUS_LOW_SUPPORT);
      EXPECT(result.num_segments == 0 && result.num_matches == 0);
      if (options.mode == PLUMB_MODE_INDEPENDENT) {
        for (k = 0; k < 3; ++k) EXPECT(fabs(result.t_m[k] - frame.prior_t_m[k]) < 1e-12);
      } else if (options.method == PLUMB_METHOD_SEARCH) { /* the correction is carried on */
        EXPECT(translation_error(f, i, result.t_m) < 0.02);
      }
    }
    plumb_session_destroy(session);
  }
  free(black);
}

static void count_result(const plumb_frame_result* result, void* user) {
  int* count = user;
  if (result->struct_size == sizeof *result && result->outcome == PLUMB_OUTCOME_PROCESSED) {
    ++*count;
  }
}

static void count_release(void* user) { ++*(int*)user; }

static void test_callbacks(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session;
  plumb_session_stats stats;
  int num_results = 0, num_released = 0, i;
  options.on_result = count_result;
  options.on_result_user = &num_results;
  session = make_session(&options);
  for (i = 0; i < NUM_FRAMES; ++i) {
    plumb_frame frame = make_frame(f, i);
    frame.release = count_release;
    frame.release_user = &num_released;
    EXPECT(plumb_session_submit_frame(session, &frame) == PLUMB_OK);
  }
  memset(&stats, 0, sizeof stats);
  stats.struct_size = sizeof stats;
  do {
    EXPECT(plumb_session_get_stats(session, &stats) == PLUMB_OK);
  } while (stats.num_processed < NUM_FRAMES);
  plumb_session_destroy(session); /* joins: the counters are ours again */
  EXPECT(num_results == NUM_FRAMES);
  EXPECT(num_released == NUM_FRAMES);
}

static void test_destroy_with_frames_in_flight(const fixture* f, const plumb_map* map) {
  int round;
  for (round = 0; round < 5; ++round) {
    plumb_session_options options = make_options(map);
    plumb_session* session;
    int num_released = 0, num_accepted = 0, i;
    options.policy = PLUMB_POLICY_NEWEST;
    options.mode = round % 2 == 0 ? PLUMB_MODE_STREAM : PLUMB_MODE_INDEPENDENT;
    session = make_session(&options);
    for (i = 0; i < NUM_FRAMES; ++i) {
      plumb_frame frame = make_frame(f, i);
      frame.release = count_release;
      frame.release_user = &num_released;
      if (plumb_session_submit_frame(session, &frame) >= 0) ++num_accepted;
    }
    plumb_session_destroy(session);
    EXPECT(num_accepted == NUM_FRAMES);
    EXPECT(num_released == NUM_FRAMES);
  }
}

static void test_broken_frames(const fixture* f, const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  const plumb_frame good = make_frame(f, 0);
  plumb_frame frame;
  unsigned char larger[sizeof(plumb_frame) + 8];
  uint32_t larger_size = sizeof larger;
#define EXPECT_REFUSED(change, part)                                                               \
  do {                                                                                             \
    frame = good;                                                                                  \
    change;                                                                                        \
    EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT, part); \
  } while (0)
  EXPECT_REFUSED(frame.struct_size = 4, "struct_size 4");
  EXPECT_REFUSED(frame.struct_size = 0, "struct_size 0");
  EXPECT_REFUSED(frame.struct_size = 0xffffffffu, "struct_size");
  EXPECT_REFUSED(frame.format = 0, "format 0");
  EXPECT_REFUSED(frame.format = 99, "format 99");
  EXPECT_REFUSED(frame.width_px = 0, "width_px");
  EXPECT_REFUSED(frame.height_px = 0xffffffffu, "16384");
  EXPECT_REFUSED(frame.planes[0] = NULL, "planes[0]");
  EXPECT_REFUSED(frame.row_stride_bytes[0] = frame.width_px - 1, "row_stride_bytes");
  EXPECT_REFUSED(frame.row_stride_bytes[0] = -1000, "row_stride_bytes");
  EXPECT_REFUSED(frame.format = PLUMB_FORMAT_NV12, "planes[1]");
  EXPECT_REFUSED(frame.fx = 0.0, "camera");
  EXPECT_REFUSED(frame.cy = NAN, "camera");
  EXPECT_REFUSED(frame.pose_convention = 0, "pose_convention 0");
  EXPECT_REFUSED(frame.pose_convention = 5, "pose_convention 5");
  EXPECT_REFUSED(frame.prior_t_m[1] = NAN, "not finite");
  EXPECT_REFUSED(frame.prior_q_xyzw[3] = INFINITY, "not finite");
  EXPECT_REFUSED(memset(frame.prior_q_xyzw, 0, sizeof frame.prior_q_xyzw), "norm 0");
  EXPECT_REFUSED(frame.prior_uncertainty = 7, "prior_uncertainty 7");
  EXPECT_REFUSED(frame.prior_position_sigma_m = -0.1, "position_sigma_m");
  EXPECT_REFUSED(frame.prior_rotation_sigma_rad = NAN, "rotation_sigma_rad");
  EXPECT_REFUSED(frame.num_points = 0xffffffffu, "num_points");
  EXPECT_REFUSED(frame.reserved = 1, "reserved");
  EXPECT_REFUSED(frame.lens_model = 3, "lens_model 3");
  EXPECT_REFUSED(frame.lens_model = -1, "lens_model -1");
  EXPECT_REFUSED(frame.reserved_lens = 1, "reserved_lens");
  EXPECT_REFUSED(frame.lens_distortion[0] = 0.1, "lens_distortion[0] 0.1");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_KANNALA_BRANDT;
                 frame.lens_distortion[4] = 0.1, "lens_distortion[4] 0.1");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_RADTAN;
                 frame.lens_distortion[7] = NAN, "lens_distortion[7] nan");
  EXPECT_REFUSED(frame.lens_model = PLUMB_LENS_RADTAN; frame.lens_distortion[0] = -1e9, "camera");
  EXPECT_REFUSED(frame.gravity_in_camera[0] = NAN, "gravity in the camera");
  EXPECT_REFUSED(frame.gravity_in_camera[1] = 9.8, "gravity in the world (0, 0, 0)");
  EXPECT_REFUSED(frame.gravity_in_camera[1] = 9.8; frame.gravity_in_world[1] = 1.0;
                 frame.gravity_sigma_rad = -0.1, "gravity uncertainty -0.1");
#undef EXPECT_REFUSED
  EXPECT_ERROR(plumb_session_submit_frame(session, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_submit_frame(NULL, &good), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  /* A newer caller: welcome while it uses nothing that this library does not know. */
  memset(larger, 0, sizeof larger);
  memcpy(larger, &good, sizeof good);
  memcpy(larger, &larger_size, sizeof larger_size);
  larger[sizeof good + 3] = 1;
  EXPECT_ERROR(plumb_session_submit_frame(session, (const plumb_frame*)(const void*)larger),
               PLUMB_ERROR_UNSUPPORTED, "does not know");
  larger[sizeof good + 3] = 0;
  EXPECT(plumb_session_submit_frame(session, (const plumb_frame*)(const void*)larger) == PLUMB_OK);
  frame = good;
  EXPECT_ERROR(plumb_session_submit_frame(session, &frame), PLUMB_ERROR_INVALID_ARGUMENT,
               "timestamp_ns");
  plumb_session_destroy(session);
}

static void test_broken_options(const plumb_map* map) {
  const plumb_session_options good = make_options(map);
  plumb_session_options options;
  plumb_session* session = NULL;
#define EXPECT_REFUSED(change, code, part)                              \
  do {                                                                  \
    options = good;                                                     \
    change;                                                             \
    session = (plumb_session*)&options;                                 \
    EXPECT_ERROR(plumb_session_create(&options, &session), code, part); \
    EXPECT(session == NULL);                                            \
  } while (0)
  EXPECT_REFUSED(options.struct_size = 8, PLUMB_ERROR_INVALID_ARGUMENT, "struct_size 8");
  EXPECT_REFUSED(options.map = NULL, PLUMB_ERROR_INVALID_ARGUMENT, "options.map");
  EXPECT_REFUSED(options.mode = 2, PLUMB_ERROR_INVALID_ARGUMENT, "mode 2");
  EXPECT_REFUSED(options.method = -1, PLUMB_ERROR_INVALID_ARGUMENT, "method -1");
  EXPECT_REFUSED(options.policy = 9, PLUMB_ERROR_INVALID_ARGUMENT, "policy 9");
  EXPECT_REFUSED(options.reserved = 1, PLUMB_ERROR_INVALID_ARGUMENT, "reserved");
  EXPECT_REFUSED(options.num_hypotheses = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "num_hypotheses");
  EXPECT_REFUSED(options.max_segments = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "max_segments");
  EXPECT_REFUSED(options.min_map_support = 1.5, PLUMB_ERROR_INVALID_ARGUMENT, "min_map_support");
  EXPECT_REFUSED(options.min_map_support = NAN, PLUMB_ERROR_INVALID_ARGUMENT, "min_map_support");
  EXPECT_REFUSED(options.deadline_ns = -1, PLUMB_ERROR_INVALID_ARGUMENT, "deadline_ns");
  EXPECT_REFUSED(options.submit_timeout_ns = -1, PLUMB_ERROR_INVALID_ARGUMENT, "submit_timeout_ns");
  EXPECT_REFUSED(options.result_capacity = 9999, PLUMB_ERROR_INVALID_ARGUMENT, "result_capacity");
  EXPECT_REFUSED(options.score_threshold = 1.5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "score_threshold 1.5");
  EXPECT_REFUSED(options.score_threshold = NAN, PLUMB_ERROR_INVALID_ARGUMENT,
                 "score_threshold nan");
  EXPECT_REFUSED(options.min_length_px = -1.0, PLUMB_ERROR_INVALID_ARGUMENT, "min_length_px -1");
  EXPECT_REFUSED(options.structural_nms = 2e5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "structural_nms 200000");
  EXPECT_REFUSED(options.top_k = 5000, PLUMB_ERROR_INVALID_ARGUMENT, "top_k 5000");
  EXPECT_REFUSED(options.tile_columns = 2, PLUMB_ERROR_INVALID_ARGUMENT, "2 x 0");
  EXPECT_REFUSED(options.tile_rows = PLUMB_TILES_AUTO, PLUMB_ERROR_INVALID_ARGUMENT, "0 x -1");
  EXPECT_REFUSED(options.tile_columns = options.tile_rows = 65, PLUMB_ERROR_INVALID_ARGUMENT,
                 "65 x 65");
  EXPECT_REFUSED(options.edge_flags = 8, PLUMB_ERROR_INVALID_ARGUMENT, "edge_flags 8");
  EXPECT_REFUSED(options.edge_min_length_px = 0.5, PLUMB_ERROR_INVALID_ARGUMENT,
                 "edge_min_length_px 0.5");
  EXPECT_REFUSED(options.model_data = &good, PLUMB_ERROR_INVALID_ARGUMENT, "model_data");
  EXPECT_REFUSED(options.model_size_bytes = 7, PLUMB_ERROR_INVALID_ARGUMENT, "model_size_bytes");
#undef EXPECT_REFUSED
  EXPECT_ERROR(plumb_session_create(NULL, &session), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_create(&good, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "out_session");
}

static void test_other_misuse(const plumb_map* map) {
  plumb_session_options options = make_options(map);
  plumb_session* session = make_session(&options);
  plumb_frame_result result = empty_result();
  plumb_session_stats stats;
  memset(&stats, 0, sizeof stats);
  EXPECT_ERROR(plumb_session_poll_result(NULL, &result), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  EXPECT_ERROR(plumb_session_poll_result(session, NULL), PLUMB_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_ERROR(plumb_session_wait_result(session, -1, &result), PLUMB_ERROR_INVALID_ARGUMENT,
               "timeout_ns");
  EXPECT_ERROR(plumb_session_get_stats(session, &stats), PLUMB_ERROR_INVALID_ARGUMENT,
               "struct_size 0");
  EXPECT_ERROR(plumb_session_get_stats(NULL, &stats), PLUMB_ERROR_INVALID_ARGUMENT, "session");
  EXPECT_ERROR(plumb_log_set_callback(NULL, NULL, 17), PLUMB_ERROR_INVALID_ARGUMENT, "min_level");
  result.struct_size = 12;
  EXPECT_ERROR(plumb_session_poll_result(session, &result), PLUMB_ERROR_INVALID_ARGUMENT,
               "struct_size 12");
  plumb_session_destroy(session);
  plumb_session_destroy(NULL);
}

static void test_strings(void) {
  EXPECT(plumb_version() == PLUMB_VERSION);
  EXPECT(strcmp(plumb_result_string(PLUMB_OK), "PLUMB_OK") == 0);
  EXPECT(strcmp(plumb_result_string(PLUMB_ERROR_IO), "PLUMB_ERROR_IO") == 0);
  EXPECT(strcmp(plumb_result_string(-1000), "PLUMB_RESULT_UNKNOWN") == 0);
  EXPECT(strcmp(plumb_status_string(PLUMB_STATUS_REFINED), "PLUMB_STATUS_REFINED") == 0);
  EXPECT(strcmp(plumb_status_string(99), "PLUMB_STATUS_UNKNOWN") == 0);
}

int main(int argc, char** argv) {
  static fixture f;
  plumb_map* map = NULL;
  int i;
  if (argc != 2 || !read_fixture(argv[1], &f)) {
    fprintf(stderr, "usage: abi_test FIXTURE\n");
    return 2;
  }
  EXPECT(strcmp(plumb_last_error(), "") == 0);
  test_strings();
  test_maps(&f);
  if (plumb_map_open(f.map_path, &map) != PLUMB_OK) return 3;
  test_frames_in_order(&f, map);
  test_pose_conventions(&f, map);
  test_covariance_as_prior(&f, map);
  test_points(&f, map);
  test_lenses(&f, map);
  test_more_priors(&f, map);
  test_detection_options(&f, map);
  test_every_mode_and_method(&f, map);
  test_callbacks(&f, map);
  test_destroy_with_frames_in_flight(&f, map);
  test_broken_frames(&f, map);
  test_broken_options(map);
  test_other_misuse(map);
  plumb_map_destroy(map);
  for (i = 0; i < NUM_FRAMES; ++i) free(f.pixels[i]);
  free(f.through_radtan);
  free(f.through_fisheye);
  if (num_failures > 0) fprintf(stderr, "%d expectations failed\n", num_failures);
  return num_failures == 0 ? 0 : 1;
}
